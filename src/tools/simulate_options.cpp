#include "tools/simulate_options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "model/number_text.h"

namespace variator_sim {
namespace {

ColumnGroups readColumns(const std::string& list) {
  try {
    return readColumnGroups(list);
  } catch (const std::invalid_argument& error) {
    throw UsageError(std::string("--columns: ") + error.what());
  }
}

double readNumber(const std::string& option, const std::string& word) {
  double value = 0.0;
  if (!readWhole(word, &value) || !std::isfinite(value)) {
    throw UsageError(option + ": " + inQuotes(word) + " is not a finite number");
  }
  return value;
}

std::vector<double> readTimes(const std::string& word) {
  std::vector<double> times;
  for (const std::string& part : splitAt(word, ',')) {
    const double time = readNumber("--times", part);
    if (time < 0.0) throw UsageError("--times: " + inQuotes(word) + " holds a time below 0 s");
    if (!times.empty() && time < times.back()) {
      throw UsageError("--times: " + inQuotes(word) + " is not in ascending order");
    }
    times.push_back(time);
  }
  return times;
}

/// Options for CLI11, processed in order: the last occurrence counts, the first error is reported,
/// and an error behind --help is ignored.
class OptionParser {
 public:
  OptionParser() {
    app_.set_help_flag();
    app_.allow_extras();
    app_.option_defaults()->disable_flag_override();
  }

  void help(const std::string& names) {
    app_.add_flag_callback(names, [] { throw CLI::CallForHelp(); })->trigger_on_parse();
  }
  void flag(const std::string& name, bool& is_given) {
    app_.add_flag_callback(name, [&is_given] { is_given = true; })->trigger_on_parse();
  }
  template <class Take>
  void take(const std::string& name, Take take) {
    const CLI::callback_t callback = [take](const CLI::results_t& words) {
      take(words.back());
      return true;
    };
    app_.add_option(name, callback)->trigger_on_parse();
  }
  void text(const std::string& name, std::string& text) {
    take(name, [&text](const std::string& word) { text = word; });
  }
  void list(const std::string& name, std::vector<std::string>& list) {
    take(name, [&list](const std::string& word) { list.push_back(word); });
  }
  void number(const std::string& name, double& number) {
    take(name, [name, &number](const std::string& word) { number = readNumber(name, word); });
  }
  bool has(const std::string& name) const { return app_.count(name) > 0; }

  /// Throws UsageError, and CLI::CallForHelp.
  void parse(const std::vector<std::string>& words, const std::string& scene) {
    for (const std::string& word : words) {
      // CLI11 would consume the next word.
      if (word.size() > 3 && word.compare(0, 2, "--") == 0 && word.find('=') + 1 == word.size()) {
        throw UsageError(word.substr(0, word.size() - 1) + " needs a value");
      }
    }
    try {
      app_.parse(std::vector<std::string>(words.rbegin(), words.rend()));
    } catch (const CLI::ArgumentMismatch& error) {
      // The message begins with the option's name, that of a flag without its dashes.
      const std::string message = error.what();
      const std::string name = message.substr(0, message.find_first_of(": "));
      throw UsageError(name.front() == '-' ? name + " needs a value"
                                           : "--" + name + " takes no value");
    }
    for (const std::string& word : app_.remaining()) refuse(word, scene);
  }

 private:
  [[noreturn]] void refuse(const std::string& word, const std::string& scene) const {
    if (word.size() < 2 || word.front() != '-') {
      throw UsageError(inQuotes(word) + " is one word too many: the scene is " + inQuotes(scene));
    }
    std::vector<std::string> names;
    for (const CLI::Option* option : app_.get_options()) names.push_back(option->get_name());
    const std::string name = word.substr(0, word.find('='));
    throw UsageError("unknown option " + inQuotes(name) + suggestName(name, names));
  }

  CLI::App app_;
};

/// Adds the options of programs that are written and not run.
void addEmissions(OptionParser& parser, SimulateOptions& options) {
  parser.take("--emit-c", [&options](const std::string& word) {
    if (word.empty()) throw UsageError("--emit-c: needs a folder");
    options.emit_c_path = word;
  });
  parser.take("--emit-fmu", [&options](const std::string& word) {
    if (std::filesystem::path(word).extension() != ".fmu") {
      throw UsageError("--emit-fmu: " + inQuotes(word) + " does not end in .fmu");
    }
    options.emit_fmu_path = word;
  });
  parser.take("--fmi", [&options](const std::string& word) {
    if (word != "2" && word != "3") {
      throw UsageError("--fmi: " + inQuotes(word) +
                       " is no version that is written; allowed: 2, 3");
    }
    options.fmi = word == "2" ? 2 : 3;
  });
}

/// Rejects options without the one that they belong to, and two modes at once.
void checkModes(const OptionParser& given) {
  using Pair = std::pair<const char*, const char*>;
  for (const auto& [option, mode] : {Pair{"--latex", "--explain"},
                                     {"--at", "--linearize"},
                                     {"--fmi", "--emit-fmu"},
                                     {"--curves", "--check-minimum"},
                                     {"--full", "--linearize"},
                                     {"--fix", "--trim"},
                                     {"--free", "--trim"},
                                     {"--accelerating", "--trim"}}) {
    if (!given.has(option) || given.has(mode)) continue;
    throw UsageError(std::string(option) + " belongs to " + mode);
  }
  std::string first;
  for (const char* mode : {"--check-minimum", "--compare-principles", "--compile", "--emit-c",
                           "--emit-fmu", "--explain", "--linearize", "--sensitivity", "--trim"}) {
    if (!given.has(mode)) continue;
    if (!first.empty()) throw UsageError(first + " and " + mode + " exclude each other");
    first = mode;
  }
}

/// Rejects outputs that overwrite an input file, or another output.
void refuseOverwriting(const SimulateOptions& options) {
  struct File {
    const char* option;
    const char* what;
    const std::string& path;
  };
  const File files[] = {{"", "the scene", options.scene_path},
                        {"--commands", "the file of --commands", options.commands_path},
                        {"--output", "the file of --output", options.output_path},
                        {"--save-state", "--save-state", options.save_state_path},
                        {"--events", "--events", options.events_path},
                        {"--curves", "--curves", options.curves_path}};
  const auto refuse = [](const File& written, const File& other) {
    std::error_code ignored;
    if (written.path.empty() || other.path.empty()) return;
    if (written.path != other.path &&
        !std::filesystem::equivalent(written.path, other.path, ignored)) {
      return;
    }
    throw UsageError(written.option + (": " + inQuotes(written.path)) + " is " + other.what);
  };
  const File* const output = files + 2;
  refuse(*output, {"--from-state", "the file of --from-state", options.from_state_path});
  for (const File* written = output; written != std::end(files); ++written) {
    for (const File* other = files; other != written; ++other) refuse(*written, *other);
  }
}

/// Checks combinations of options and fills in derived values.
void completeOptions(const OptionParser& given, SimulateOptions& options) {
  options.has_duration = given.has("--duration");
  options.has_save_time = given.has("--save-at");
  if (options.duration < 0.0) throw UsageError("--duration: must be at least 0 s");
  if (options.rate <= 0.0) throw UsageError("--rate: must be above 0 Hz");
  if (options.scene_path.empty()) throw UsageError("no scene given");
  checkModes(given);
  const bool writes_program = !options.emit_c_path.empty() || !options.emit_fmu_path.empty();
  if (options.explain || options.linearize || options.trim || writes_program) return;
  if (!options.times.empty() && given.has("--rate")) {
    throw UsageError("--rate and --times exclude each other");
  }
  if (!options.has_duration && !options.compile) {
    if (options.times.empty()) throw UsageError("--duration is missing");
    options.duration = options.times.back();
  }
  const bool begins_at_zero = options.from_state_path.empty();
  if (begins_at_zero && !options.times.empty() && options.times.back() > options.duration) {
    throw UsageError("--times: the last one lies after the --duration");
  }
  if (options.has_save_time && options.save_state_path.empty()) {
    throw UsageError("--save-at belongs to --save-state");
  }
  if (options.until_rest && !options.has_duration) {
    throw UsageError("--until-rest needs a --duration, after which it gives up");
  }
  const std::string ending = endingOf(options.output_path);
  if (!options.output_path.empty() && ending != ".csv" && ending != ".bag") {
    throw UsageError("--output: " + inQuotes(options.output_path) +
                     " ends neither with .csv nor with .bag");
  }
  if (options.compare_principles && ending != ".csv") {
    throw UsageError("--compare-principles needs an --output FILE.csv");
  }
  if (!options.sensitivity.empty() && ending == ".bag") {
    throw UsageError("--sensitivity: a bag has no place for derivatives; write a .csv");
  }
  if (!options.sensitivity.empty() && !begins_at_zero) {
    throw UsageError(
        "--sensitivity and --from-state exclude each other: a state has no derivatives");
  }
  refuseOverwriting(options);
}

}  // namespace

SimulateOptions parseSimulateOptions(const std::vector<std::string>& words) {
  SimulateOptions options;
  bool adds_energy = false;
  OptionParser parser;
  parser.text("scene", options.scene_path);
  parser.number("--duration", options.duration);
  parser.number("--rate", options.rate);
  parser.take("--times", [&](const std::string& word) { options.times = readTimes(word); });
  parser.text("--commands", options.commands_path);
  parser.take("--output",
              [&](const std::string& word) { options.output_path = word == "-" ? "" : word; });
  parser.take("--columns", [&](const std::string& word) { options.columns = readColumns(word); });
  parser.list("--set", options.overrides);
  parser.text("--from-state", options.from_state_path);
  parser.text("--save-state", options.save_state_path);
  parser.number("--save-at", options.save_time);
  parser.text("--events", options.events_path);
  parser.flag("--until-rest", options.until_rest);
  parser.flag("--energy", adds_energy);
  parser.flag("--error", options.estimate_errors);
  parser.flag("--stats", options.stats);
  parser.flag("--check-minimum", options.check_minimum);
  parser.text("--curves", options.curves_path);
  parser.take("--sensitivity", [&](const std::string& word) {
    for (const std::string& path : splitAt(word, ',')) {
      if (path.empty()) throw UsageError("--sensitivity: a path is empty");
      options.sensitivity.push_back(path);
    }
  });
  parser.flag("--compare-principles", options.compare_principles);
  parser.flag("--explain", options.explain);
  parser.flag("--latex", options.latex);
  parser.flag("--compile", options.compile);
  addEmissions(parser, options);
  parser.flag("--linearize", options.linearize);
  parser.text("--at", options.at);
  parser.flag("--full", options.full);
  parser.flag("--trim", options.trim);
  parser.flag("--accelerating", options.accelerating);
  parser.list("--fix", options.fix);
  parser.list("--free", options.free);
  parser.help("--help,-h");
  try {
    parser.parse(words, options.scene_path);
  } catch (const CLI::CallForHelp&) {
    options.help = true;
    return options;
  }
  completeOptions(parser, options);
  options.columns.energy = options.columns.energy || adds_energy;
  if (options.estimate_errors && !options.columns.state) {
    throw UsageError(
        "--error: its columns stand beside those of the group 'state', which --columns leaves out");
  }
  options.columns.errors = options.estimate_errors;
  return options;
}

const char* const kSimulateHelp =
    R"(Simulates a drivetrain without a ROS master, as fast as it can.

usage: simulate SCENE.yaml --duration S [options]
       simulate SCENE.yaml --duration S --check-minimum|--compare-principles [options]
       simulate SCENE.yaml --explain [--latex]
       simulate SCENE.yaml --linearize [--at T|rest|STATE] [--full] [--output FILE.csv|.npz|.mat]
       simulate SCENE.yaml --trim [--fix NAME=VALUE].. [--free NAME].. [--output FILE.yaml]
       simulate SCENE.yaml --emit-c DIRECTORY
       simulate SCENE.yaml --emit-fmu FILE.fmu [--fmi 2|3]

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
                          elements tell beside: slip, ratio, modes), inputs (commanded inputs in
                          force), outputs (the scene's own), states (the scene's own),
                          variables (the scene's own), principle (the covariant rate G of the
                          reactions, and 1/2 G^T J^-1 G and 1/2 R^T J^-1 R), energy (kinetic
                          energy, energies of the applied torques and of the reactions since the
                          start, J, and their powers, W)
  --energy                adds energy to the columns: --columns state,energy
  --error                 an estimate of the global error behind each angle, velocity and
                          acceleration (columns .../estimated_error), by a second, finer motion;
                          standard error tells when they are not to be trusted
  --events FILE.csv       changes of modes of elements that hold:
                          time,element,from,to,torque,impulse (s, N m, N m s)
  --stats                 print counters and times to standard error
  --check-minimum         compare the motion with its principle at each sample: the least
                          Z = 1/2 G^T J^-1 G (gauss: 1/2 R^T J^-1 R) that the constraints allow,
                          found without the solver; samples are written with --output only
  --curves FILE.csv       of --check-minimum: Z along the admissible directions at each sample
  --sensitivity PATH,..   the derivatives of the samples by numbers of the scene (drive/inertia,
                          initial/velocity/0) and by commands (ratio@2.0: the value that input gets
                          at 2.0 s), in columns d(load/velocity)/d(drive/inertia) after all others
  --compare-principles    run the scene under generalized_gauss [15], gauss [17] and [18] into
                          FILE_generalized_gauss.csv, FILE_gauss.csv and FILE_formal.csv, beside
                          the --output FILE.csv, for `plot --compare`
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
  --emit-fmu FILE.fmu     write the scene as an FMU for co-simulation in another tool, with its
                          sources and a binary for this machine, and nothing else
  --fmi 2|3               of --emit-fmu: the version of FMI, 2.0 or 3.0 (the default)
  --help                  this text

A sample at the instant of a command shows the state after it. A bag holds the topics `state`
(variator_sim/DrivetrainState), `joint_states` (sensor_msgs/JointState) and `scene`
(variator_sim/SceneInfo), with these groups `elements`, `inputs`, `outputs`, `states`,
`variables`, `principle` (variator_sim/NamedValues) and `energy`
(variator_sim/DrivetrainEnergy), stamped with simulated time.

Exit status: 0 the end was reached, or the reader of standard output went away
             1 the motion stopped: reason, time and last good state are on standard error;
               or there is no rest, or no steady state
             2 bad usage, scene or command file
             3 the output (of --emit-c, --emit-fmu: a file) could not be written, or of --compile: no machine
               code could be made
             4 of --until-rest: the --duration ended before the motion came to rest
             5 of --check-minimum: Z is not the least, or the constraints do not hold, by more than
               1e-9 of the scale of Z
             130 interrupted by Ctrl-C
In every case the samples up to then are written.
)";

}  // namespace variator_sim
