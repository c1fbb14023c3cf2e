#include "tools/analysis_run.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "model/number_text.h"
#include "tools/linear_model_file.h"
#include "tools/sample_writer.h"
#include "tools/state_file.h"
#include "tools/steady_state.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/linear_model.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/trim.h"

namespace variator_sim {
namespace {

/// How long rest is waited for without --duration, s.
constexpr double kPatience = 1000.0;

/// Into a file, or to standard output where `path` is empty.
void writeText(const std::string& path, const std::string& text) {
  std::FILE* const file = path.empty() ? stdout : std::fopen(path.c_str(), "wb");
  const std::string name = path.empty() ? "standard output" : path;
  const auto fail = [&name] { throw OutputError(name + ": " + std::strerror(errno)); };
  if (file == nullptr) fail();
  const bool is_written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  const bool is_flushed = std::fflush(file) == 0;
  if (path.empty() && !(is_written && is_flushed) && errno == EPIPE) {
    throw OutputClosed("standard output: closed");
  }
  if (!is_written || !is_flushed) fail();
  if (!path.empty() && std::fclose(file) != 0) fail();
}

bool readTime(const std::string& word, double* time) {
  const char* const end = word.data() + word.size();
  const auto [rest, error] = numberFromChars(word.data(), end, *time);
  return error == std::errc() && rest == end;
}

/// `velocity=[10, 5], inputs={throttle: 0.5}` as YAML.
std::string toFlow(const std::string& inline_state) {
  std::string yaml = "{";
  for (const char c : inline_state) yaml += c == '=' ? std::string(": ") : std::string(1, c);
  return yaml + "}";
}

bool isInline(const std::string& word) {
  return word.find_first_of("=:") != std::string::npos && !std::ifstream(word);
}

/// Advances through the commands up to `time`.
class Run {
 public:
  Run(Simulation& simulation, const std::vector<ResolvedCommand>& commands)
      : simulation_(simulation), commands_(commands) {
    // Those before a state that the run goes on from are over.
    while (next_ < commands_.size() && commands_[next_].time < simulation.time()) ++next_;
  }

  bool advanceTo(double time) {
    for (; next_ < commands_.size() && commands_[next_].time <= time; ++next_) {
      simulation_.advanceTo(commands_[next_].time);
      simulation_.command(commands_[next_].input, commands_[next_].value);
    }
    simulation_.advanceTo(time);
    simulation_.sample();
    return simulation_.status().ok() && simulation_.time() >= time;
  }
  /// To the first rest until `end`. False when there is none.
  bool advanceToRest(double end) {
    for (double time = simulation_.time(); time < end;) {
      time = std::min(end, time + std::max(0.05, 0.01 * time));
      if (!advanceTo(time)) return false;
      if (simulation_.isSleeping()) return true;
    }
    return false;
  }

 private:
  Simulation& simulation_;
  const std::vector<ResolvedCommand>& commands_;
  std::size_t next_ = 0;
};

/// `otherwise`: where the motion has not stopped.
void tellWhy(const Simulation& simulation, const std::string& otherwise) {
  const std::string why = simulation.status().ok() ? otherwise : simulation.describeStatus();
  std::fprintf(stderr, "simulate: %s\n", why.c_str());
}

/// False, with a message, when it cannot be reached.
bool reachPoint(Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                const SimulateOptions& options, OperatingPoint* point) {
  double time = 0.0;
  Run run(simulation, commands);
  if (options.at == "rest") {
    const double end = options.duration > 0.0 ? options.duration : kPatience;
    if (!run.advanceToRest(end)) {
      const std::string until = formatNumber(simulation.time()) + " s";
      tellWhy(simulation,
              simulation.time() < end
                  ? "interrupted at " + until
                  : "no rest until " + until +
                        " (laws that read the time never rest; --duration waits longer)");
      return false;
    }
  } else if (readTime(options.at, &time)) {
    if (!(time >= 0.0) || !std::isfinite(time)) throw UsageError("--at: must be at least 0 s");
    if (!run.advanceTo(time)) {
      tellWhy(simulation, "interrupted at " + formatNumber(simulation.time()) + " s");
      return false;
    }
  } else if (isInline(options.at)) {
    *point =
        readOperatingPoint(readYamlText(toFlow(options.at), "--at"), simulation.scene(), "--at");
    return true;
  } else {
    readStateFile(options.at, simulation);
  }
  *point = simulation.operatingPoint();
  return true;
}

TrimChoice readChoice(const std::string& option, const std::string& text, bool needs_value) {
  const std::size_t equals = text.find('=');
  TrimChoice choice;
  choice.name = text.substr(0, equals);
  if (equals == std::string::npos) {
    if (needs_value) throw UsageError(option + ": " + inQuotes(text) + " is not NAME=VALUE");
    return choice;
  }
  if (!readTime(text.substr(equals + 1), &choice.value) || !std::isfinite(choice.value)) {
    throw UsageError(option + ": " + inQuotes(text) +
                     " has no finite number behind the equals sign");
  }
  return choice;
}

std::string asComment(const std::string& text) {
  std::string commented = "# ";
  for (std::size_t n = 0; n < text.size(); ++n) {
    commented += text[n];
    if (text[n] == '\n' && n + 1 < text.size()) commented += "# ";
  }
  return commented;
}

}  // namespace

bool runLinearize(Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                  const SimulateOptions& options) {
  // A path that means nothing is told before the run.
  if (!options.output_path.empty()) checkModelPath(options.output_path);
  OperatingPoint point;
  if (!reachPoint(simulation, commands, options, &point)) return false;
  const LinearModel model =
      linearize(simulation.scene(), point, options.full ? LinearForm::kFull : LinearForm::kMinimal);
  if (!options.output_path.empty()) {
    writeText(options.output_path, writeModel(model, options.output_path));
  }
  writeText("", describeModel(model, options.output_path.empty()));
  return true;
}

bool runTrim(const Scene& scene, const SimulateOptions& options) {
  TrimOptions wanted;
  wanted.accelerating = options.accelerating;
  for (const std::string& text : options.fix) {
    wanted.fix.push_back(readChoice("--fix", text, true));
  }
  for (const std::string& text : options.free) {
    wanted.free.push_back(readChoice("--free", text, false));
  }
  const TrimResult result = trim(scene, wanted);
  std::fprintf(stderr, "simulate: %s\n", result.message.c_str());
  if (result.states.empty()) return false;
  std::string text;
  for (const TrimState& state : result.states) {
    const bool is_first = &state == &result.states.front();
    const std::string yaml = toYaml(toTree(makeState(state.point, scene), scene));
    text += is_first ? "" : "# another:\n";
    text += "# residual " + formatNumber(state.residual) + "; " +
            describeStability(scene, state.point) + "\n";
    text += is_first ? yaml : asComment(yaml);
  }
  writeText(options.output_path, text);
  return true;
}

}  // namespace variator_sim
