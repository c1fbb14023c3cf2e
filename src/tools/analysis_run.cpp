#include "tools/analysis_run.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include "io/whole_file.h"
#include "model/number_text.h"
#include "tools/linear_model_file.h"
#include "tools/python_file.h"
#include "tools/sample_writer.h"
#include "tools/state_file.h"
#include "tools/steady_state.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/linear_model.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/trim.h"

namespace variator_sim {
namespace {

/// Longest wait for rest without --duration, s.
constexpr double kPatience = 1000.0;

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
    // Commands before the state from which the run continues are past.
    while (next_ < commands_.size() && commands_[next_].time < simulation.time()) ++next_;
  }

  bool advanceTo(double time) {
    for (; next_ < commands_.size() && commands_[next_].time <= time; ++next_) {
      simulation_.advanceTo(commands_[next_].time);
      simulation_.command(commands_[next_].input, commands_[next_].value);
    }
    simulation_.advanceTo(time);
    simulation_.sample();
    return simulation_.status().ok() && simulation_.time() >= time;  // not interrupted
  }
  /// Advances to the first rest until `end`. Returns false when there is none.
  bool advanceToRest(double end) {
    for (double time = simulation_.time(); time < end && !Interruption::isWanted();) {
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

/// Explains why the motion does not come to rest, and the option that needs none.
std::string explainUnrest(Simulation& simulation) {
  const Scene& scene = simulation.scene();
  std::string readers;
  const auto note = [&readers](const char* kind, const auto& law, const Dependence& dependence) {
    if (dependence.time) readers += (readers.empty() ? "" : ", ") + (kind + inQuotes(law->name()));
  };
  for (const TorquePtr& torque : scene.torques) note("torque ", torque, torque->torqueDependence());
  for (const ConstraintPtr& row : scene.constraints) note("constraint ", row, row->dependence());
  std::string text = "no rest until " + formatNumber(simulation.time()) + " s: ";
  if (!scene.solver.sleep) return text + "'solver/sleep: false' allows none";
  if (isFixedStep(scene.solver.stepper)) return text + "steppers with fixed steps know none";
  if (!readers.empty()) {
    text += readers + (readers.find(',') == std::string::npos ? " reads" : " read") + " the time";
  } else {
    const Sample& sample = simulation.sample();
    int fastest = 0;
    for (int i = 1; i < scene.shaftCount(); ++i) {
      if (std::abs(sample.acceleration[i]) > std::abs(sample.acceleration[fastest])) fastest = i;
    }
    text += "the shafts still accelerate, most of all " +
            inQuotes(scene.shafts[static_cast<std::size_t>(fastest)]) + " by " +
            formatNumber(sample.acceleration[fastest]) +
            " rad/s^2 (--trim --accelerating looks for accelerations in constant ratios; "
            "--duration waits longer)";
  }
  return text + "; --at 0, or another time, takes the model there";
}

/// Returns false, with a message, when the point cannot be reached.
bool reachPoint(Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                const SimulateOptions& options, OperatingPoint* point) {
  double time = 0.0;
  Run run(simulation, commands);
  const auto tell = [&](std::string why) {
    if (!simulation.status().ok()) why = simulation.describeStatus();
    if (Interruption::isWanted()) why = "interrupted at " + formatNumber(simulation.time()) + " s";
    std::fprintf(stderr, "simulate: %s\n", why.c_str());
    return false;
  };
  if (options.at == "rest") {
    const double end = options.duration > 0.0 ? options.duration : kPatience;
    if (!run.advanceToRest(end)) {
      return tell(simulation.status().ok() ? explainUnrest(simulation)
                                           : simulation.describeStatus());
    }
  } else if (readWhole(options.at, &time)) {
    if (!(time >= 0.0) || !std::isfinite(time)) throw UsageError("--at: must be at least 0 s");
    if (!run.advanceTo(time)) return tell("");
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
  if (!readWhole(text.substr(equals + 1), &choice.value) || !std::isfinite(choice.value)) {
    throw UsageError(option + ": " + inQuotes(text) +
                     " has no finite number behind the equals sign");
  }
  return choice;
}

/// Converts a model's CSV to the content of a file with this ending; an empty text only checks that
/// the conversion is possible. Throws OutputError.
std::string convertModel(const std::string& csv, const std::string& ending) {
  return runPythonFile("linear_model_files.py", ending, csv);
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
  const std::string& path = options.output_path;
  // An invalid path or a missing library is reported before the run.
  const std::string ending = path.empty() ? "" : endingOfModel(path);
  const bool converts = ending == ".npz" || ending == ".mat";
  if (converts) convertModel("", ending);
  OperatingPoint point;
  if (!reachPoint(simulation, commands, options, &point)) return false;
  const LinearModel model =
      linearize(simulation.scene(), point, options.full ? LinearForm::kFull : LinearForm::kMinimal);
  const std::string csv = writeModel(model);
  if (!path.empty()) writeOutput(path, converts ? convertModel(csv, ending) : csv);
  writeOutput("", describeModel(model, path.empty()));
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
  writeOutput(options.output_path, text);
  return true;
}

}  // namespace variator_sim
