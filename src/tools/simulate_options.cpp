#include "tools/simulate_options.h"

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "model/number_text.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim {
namespace {

const std::vector<std::string>& optionNames() {
  static const std::vector<std::string> names = {
      "--duration", "--rate",       "--times",      "--commands", "--output",     "--columns",
      "--set",      "--from-state", "--save-state", "--save-at",  "--until-rest", "--energy",
      "--error",    "--stats",      "--explain",    "--latex",    "--compile",    "--emit-c",
      "--help",     "--linearize",  "--at",         "--full",     "--trim",       "--accelerating",
      "--fix",      "--free"};
  return names;
}

ColumnGroups readColumns(const std::string& list) {
  try {
    return readColumnGroups(list);
  } catch (const std::invalid_argument& error) {
    throw UsageError(std::string("--columns: ") + error.what());
  }
}

double readNumber(const std::string& option, const std::string& word) {
  double value = 0.0;
  const char* end = word.data() + word.size();
  const auto [rest, error] = numberFromChars(word.data(), end, value);
  if (error != std::errc() || rest != end || !std::isfinite(value)) {
    throw UsageError(option + ": " + inQuotes(word) + " is not a finite number");
  }
  return value;
}

std::vector<double> readTimes(const std::string& word) {
  std::vector<double> times;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = word.find(',', begin);
    const double time = readNumber("--times", word.substr(begin, comma - begin));
    if (time < 0.0) throw UsageError("--times: " + inQuotes(word) + " holds a time below 0 s");
    if (!times.empty() && time < times.back()) {
      throw UsageError("--times: " + inQuotes(word) + " is not in ascending order");
    }
    times.push_back(time);
    if (comma == std::string::npos) return times;
    begin = comma + 1;
  }
}

bool endsWith(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

OutputFormat formatOf(const std::string& path) {
  if (path.empty() || endsWith(path, ".csv")) return OutputFormat::kCsv;
  if (endsWith(path, ".bag")) return OutputFormat::kBag;
  throw UsageError("--output: " + inQuotes(path) + " ends neither with .csv nor with .bag");
}

/// Walks through the words; an option's value is the next word or stands behind an equals sign.
class CommandLine {
 public:
  explicit CommandLine(const std::vector<std::string>& words) : words_(words) {}

  bool next() {
    if (index_ == words_.size()) return false;
    name_ = words_[index_++];
    has_value_ = false;
    const std::size_t equals = name_.find('=');
    if (isOption() && equals != std::string::npos) {
      value_ = name_.substr(equals + 1);
      name_.resize(equals);
      has_value_ = true;
    }
    return true;
  }
  bool isOption() const { return name_.size() > 1 && name_.front() == '-'; }
  const std::string& name() const { return name_; }
  const std::string& value() {
    if (!has_value_) {
      if (index_ == words_.size()) throw UsageError(name_ + " needs a value");
      value_ = words_[index_++];
      has_value_ = true;
    }
    return value_;
  }
  void refuseValue() const {
    if (has_value_) throw UsageError(name_ + " takes no value");
  }

 private:
  const std::vector<std::string>& words_;
  std::size_t index_ = 0;
  std::string name_;
  std::string value_;
  bool has_value_ = false;
};

/// What an option without a value sets, or nullptr.
bool* findFlag(const std::string& name, SimulateOptions& options, bool& add_energy) {
  if (name == "--energy") return &add_energy;
  if (name == "--error") return &options.estimate_errors;
  if (name == "--stats") return &options.stats;
  if (name == "--compile") return &options.compile;
  if (name == "--explain") return &options.explain;
  if (name == "--until-rest") return &options.until_rest;
  if (name == "--linearize") return &options.linearize;
  if (name == "--full") return &options.full;
  if (name == "--trim") return &options.trim;
  if (name == "--accelerating") return &options.accelerating;
  return name == "--latex" ? &options.latex : nullptr;
}

/// True when `name` is an option whose value is a text, which `options` then have.
bool readText(const std::string& name, CommandLine& word, SimulateOptions& options) {
  if (name == "--commands") {
    options.commands_path = word.value();
  } else if (name == "--output") {
    options.output_path = word.value() == "-" ? "" : word.value();
  } else if (name == "--columns") {
    options.columns = readColumns(word.value());
  } else if (name == "--set") {
    options.overrides.push_back(word.value());
  } else if (name == "--from-state") {
    options.from_state_path = word.value();
  } else if (name == "--save-state") {
    options.save_state_path = word.value();
  } else if (name == "--emit-c") {
    options.emit_c_path = word.value();
    if (options.emit_c_path.empty()) throw UsageError("--emit-c: needs a folder");
  } else if (name == "--at") {
    options.at = word.value();
  } else if (name == "--fix") {
    options.fix.push_back(word.value());
  } else if (name == "--free") {
    options.free.push_back(word.value());
  } else {
    return false;
  }
  return true;
}

/// Of what is done instead of running: which options belong to what.
void checkInstead(const SimulateOptions& options) {
  const SimulateOptions defaults;
  const struct {
    const char* option;
    bool is_given;
    const char* of;
    bool is_of_given;
  } parts[] = {{"--latex", options.latex, "--explain", options.explain},
               {"--at", options.at != defaults.at, "--linearize", options.linearize},
               {"--full", options.full, "--linearize", options.linearize},
               {"--fix", !options.fix.empty(), "--trim", options.trim},
               {"--free", !options.free.empty(), "--trim", options.trim},
               {"--accelerating", options.accelerating, "--trim", options.trim}};
  for (const auto& part : parts) {
    if (!part.is_given || part.is_of_given) continue;
    throw UsageError(std::string(part.option) + " belongs to " + part.of);
  }
  const char* first = nullptr;
  for (const auto& [name, is_given] : {std::pair<const char*, bool>{"--compile", options.compile},
                                       {"--emit-c", !options.emit_c_path.empty()},
                                       {"--explain", options.explain},
                                       {"--linearize", options.linearize},
                                       {"--trim", options.trim}}) {
    if (!is_given) continue;
    if (first != nullptr) {
      throw UsageError(std::string(first) + " and " + name + " exclude each other");
    }
    first = name;
  }
}

/// What is read is not written over.
void refuseOverwriting(const SimulateOptions& options) {
  struct File {
    const char* what;
    const std::string& path;
  };
  const File scene{"the scene", options.scene_path};
  const File commands{"the file of --commands", options.commands_path};
  const File output{"the file of --output", options.output_path};
  const File state{"--save-state", options.save_state_path};
  const auto refuse = [](const char* option, const File& written, const File& other) {
    std::error_code ignored;
    if (written.path.empty() || other.path.empty()) return;
    if (written.path != other.path &&
        !std::filesystem::equivalent(written.path, other.path, ignored)) {
      return;
    }
    throw UsageError(std::string(option) + ": " + inQuotes(written.path) + " is " + other.what);
  };
  for (const File& other : {scene, commands}) {
    refuse("--output", output, other);
    refuse("--save-state", state, other);
  }
  refuse("--output", output, {"the file of --from-state", options.from_state_path});
  refuse("--save-state", state, output);
}

/// What belongs together, and what does not; fills in what follows.
void completeOptions(bool has_rate, SimulateOptions& options) {
  if (options.scene_path.empty()) throw UsageError("no scene given");
  checkInstead(options);
  if (options.explain || options.linearize || options.trim || !options.emit_c_path.empty()) return;
  if (options.has_times && has_rate) {
    throw UsageError("--rate and --times exclude each other");
  }
  if (!options.has_duration && !options.compile) {
    if (!options.has_times) throw UsageError("--duration is missing");
    options.duration = options.times.back();
  }
  const bool begins_at_zero = options.from_state_path.empty();
  if (begins_at_zero && options.has_times && options.times.back() > options.duration) {
    throw UsageError("--times: the last one lies after the --duration");
  }
  if (options.has_save_time && options.save_state_path.empty()) {
    throw UsageError("--save-at belongs to --save-state");
  }
  if (options.until_rest && !options.has_duration) {
    throw UsageError("--until-rest needs a --duration, after which it gives up");
  }
  options.format = formatOf(options.output_path);
  refuseOverwriting(options);
}

}  // namespace

SimulateOptions parseSimulateOptions(const std::vector<std::string>& words) {
  SimulateOptions options;
  bool has_rate = false;
  bool add_energy = false;
  CommandLine word(words);
  while (word.next()) {
    const std::string& name = word.name();
    if (name == "--help" || name == "-h") {
      options.help = true;
      return options;
    }
    if (name == "--duration") {
      options.duration = readNumber(name, word.value());
      if (options.duration < 0.0) throw UsageError("--duration: must be at least 0 s");
      options.has_duration = true;
    } else if (name == "--rate") {
      options.rate = readNumber(name, word.value());
      if (options.rate <= 0.0) throw UsageError("--rate: must be above 0 Hz");
      has_rate = true;
    } else if (name == "--save-at") {
      options.save_time = readNumber(name, word.value());
      options.has_save_time = true;
    } else if (name == "--times") {
      options.times = readTimes(word.value());
      options.has_times = true;
    } else if (readText(name, word, options)) {
      continue;
    } else if (bool* flag = findFlag(name, options, add_energy)) {
      word.refuseValue();
      *flag = true;
    } else if (word.isOption()) {
      throw UsageError("unknown option " + inQuotes(name) + suggestName(name, optionNames()));
    } else if (options.scene_path.empty()) {
      options.scene_path = name;
    } else {
      throw UsageError(inQuotes(name) + " is one word too many: the scene is " +
                       inQuotes(options.scene_path));
    }
  }
  completeOptions(has_rate, options);
  options.columns.energy = options.columns.energy || add_energy;
  if (options.estimate_errors && !options.columns.state) {
    throw UsageError(
        "--error: its columns stand beside those of the group 'state', which --columns "
        "leaves out");
  }
  options.columns.errors = options.estimate_errors;
  return options;
}

const char* simulateHelp() {
  return R"(Simulates a drivetrain without a ROS master, as fast as it can.

usage: simulate SCENE.yaml --duration S [options]
       simulate SCENE.yaml --explain [--latex]
       simulate SCENE.yaml --linearize [--at T|rest|STATE] [--full] [--output FILE.csv|.npz|.mat]
       simulate SCENE.yaml --trim [--fix NAME=VALUE].. [--free NAME].. [--output FILE.yaml]
       simulate SCENE.yaml --emit-c DIRECTORY

  SCENE.yaml              the drivetrain
  --duration S            simulated time, s; may be left out with --times
  --until-rest            end when the motion is at rest: after the last command, every shaft's
                          |acceleration| at most 1e-6 (|velocity| + 1 rad/s) / s, for 1 s or
                          asleep; with --duration as the longest run
  --from-state FILE       go on from a saved state, at its time, instead of starting; samples and
                          --times are at the motion's own time
  --save-state FILE       save the state at the end, from which a run goes on to the bit
  --save-at T             save it at T, s, instead, and go on from there as that run will
  --rate HZ               samples per second (default 100); the end itself is sampled too
  --times T1,T2,...       sample at these instants instead, s, ascending
  --set PATH=VALUE        a value in place of the scene's, e.g. drive/inertia=1.2,
                          initial/velocity=[5, 2], initial/velocity/0=5; VALUE is read as YAML; may
                          be given any number of times, the last one of a path counts
  --commands FILE.csv     commands to play, header time,topic,value
  --output FILE.csv|.bag  where the samples go (default: standard output, as CSV)
  --columns GROUPS        groups of columns beside time, comma between: state (the default),
                          elements (the torques and powers of each torque element, and what
                          elements tell beside: slip, ratio), inputs (commanded inputs in force),
                          outputs (the scene's own), energy (kinetic energy, energies of the
                          applied torques and of the reactions since the start, J, and their
                          powers, W)
  --energy                adds energy to the columns: --columns state,energy
  --error                 an estimate of the global error behind each angle, velocity and
                          acceleration (columns .../estimated_error), by a second, finer motion;
                          standard error tells when they are not to be trusted
  --stats                 print counters and times to standard error
  --explain               print the scene's equations of motion instead of running it: its laws
                          simplified, what they have in common, what is not computed and why
  --latex                 of --explain: as a LaTeX document
  --linearize             print the linear model x' = A x + B u, y = C x + D u of the motion, its
                          eigenvalues and damping instead of running it further; with --output, the
                          matrices go there
  --at T|rest|STATE       of --linearize: after T seconds of the run, with its --commands; at its
                          first rest, until --duration (the default, 1000 s); at a state, as a file
                          (of --trim or --save-state) or as e.g. "velocity=[10, 5], inputs={throttle: 0.5}"
  --full                  of --linearize: all states, and not only coordinates on psi = 0
  --trim                  look for steady states instead of running, and write the nearest
  --fix NAME=VALUE        of --trim: a speed (w_SHAFT), angle, input, SHAFT/applied_torque,
                          SHAFT/reaction_torque or output that is given
  --free NAME[=START]     of --trim: an input that is not, and where to look first
  --accelerating          of --trim: accelerations in constant ratios, not constant speeds
  --compile               make the scene's machine code, for later runs and nodes, and nothing else
  --emit-c DIRECTORY      write the scene as freestanding C99 into a folder, for a controller or a
                          test rig, with a program that plays --commands files, and nothing else
  --help                  this text

A sample at the instant of a command shows the state after it. A bag holds the topics `state`
(variator_sim/DrivetrainState), `joint_states` (sensor_msgs/JointState) and `scene`
(variator_sim/SceneInfo), with these groups `elements`, `inputs` and `outputs`
(variator_sim/NamedValues) and `energy` (variator_sim/DrivetrainEnergy), stamped with simulated time.

Exit status: 0 the end was reached, or the reader of standard output went away
             1 the motion stopped: reason, time and last good state are on standard error;
               or there is no rest, or no steady state
             2 bad usage, scene or command file
             3 the output (of --emit-c: a file) could not be written, or of --compile: no machine
               code could be made
             4 of --until-rest: the --duration ended before the motion came to rest
             130 interrupted by Ctrl-C
In every case the samples up to then are written.
)";
}

}  // namespace variator_sim
