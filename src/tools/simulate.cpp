/// The offline tool: a scene, commands from a file, samples into CSV or a bag. No ROS master.

#include <sys/time.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "emit_c/emit_c.h"
#include "emit_fmu/emit_fmu.h"
#include "model/number_text.h"
#include "model/thrown.h"
#include "ros/plugin_loader.h"
#include "tools/analysis_run.h"
#include "tools/run_report.h"
#include "tools/sample_writer.h"
#include "tools/scene_equations.h"
#include "tools/sensitivity.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

enum ExitStatus {
  kSuccess = 0,
  kStopped = 1,
  kBadUsage = 2,
  kBadOutput = 3,
  kNoRest = 4,
  kNotLeast = 5,
  kSignalBase = 128
};

/// The work that a signal interrupts.
enum Work : std::sig_atomic_t {
  kReading,    ///< nothing polls g_signal, and no output has to be completed
  kComputing,  ///< g_signal is polled, unless a plugin blocks
  kWriting     ///< g_signal is polled, and an output has to be completed
};

volatile std::sig_atomic_t g_signal = 0;
volatile std::sig_atomic_t g_work = kReading;
volatile std::sig_atomic_t g_has_rung = 0;

template <std::size_t kSize>
[[noreturn]] void endAtOnce(const char (&message)[kSize], int signal) {
  if (::write(STDERR_FILENO, message, kSize - 1) < 0) ::_exit(kBadOutput);
  ::_exit(kSignalBase + signal);
}

/// (On Linux a mere system call, so that a signal handler may use it.)
void ringIn(int milliseconds) {
  const itimerval wait{{0, 0}, {0, 1000 * milliseconds}};
  ::setitimer(ITIMER_REAL, &wait, nullptr);
}

void takeSignal(int signal) {
  if (g_work == kReading) endAtOnce("simulate: interrupted\n", signal);
  g_signal = signal;
  ringIn(800);
}

/// Ends a computation that has not heard the signal: at the second alarm, as the first one may come
/// from a machine with so much to do that nothing was computed since.
void takeAlarm(int /*signal*/) {
  if (g_work != kComputing) return;
  if (g_has_rung == 0) {
    g_has_rung = 1;
    ringIn(200);
    return;
  }
  endAtOnce(
      "simulate: interrupted, while a step does not end (a plugin's function?); samples since the "
      "last ones in the output are lost\n",
      g_signal);
}

void installSignalHandlers() {
  std::signal(SIGALRM, takeAlarm);
  struct sigaction action = {};
  action.sa_handler = takeSignal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second Ctrl-C ends the process at once
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  ::sigaction(SIGHUP, &action, nullptr);  // a terminal that is closed
  // A closed reader is an error of write(), not the end of this program.
  std::signal(SIGPIPE, SIG_IGN);
  // So is a file that reached its size limit (`ulimit -f`).
  std::signal(SIGXFSZ, SIG_IGN);
}

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<TimedCommand> readCommands(const SimulateOptions& options, const Scene& scene) {
  if (options.commands_path.empty()) return {};
  return resolveCommands(readCommandFile(options.commands_path), scene, options.commands_path);
}

/// Reads a file, of which its faults tell; a fault of one of its parts tells of both.
ParameterTree readSceneFile(const std::string& path) {
  try {
    return readYamlFile(path);
  } catch (const SceneError& error) {
    if (error.keyPath().empty()) throw;
    throw SceneError("", path + ": " + error.what());
  }
}

/// Returns what `use` makes of the scene's tree; faults name their source.
template <class Use>
auto useTree(const SimulateOptions& options, const Use& use) {
  const std::string& path = options.scene_path;
  ParameterTree tree = readSceneFile(path);
  fromSource(path, [&] { applyOwnOverrides(tree); });
  fromSource("--set", [&] {
    for (const std::string& text : options.overrides) applyOverride(tree, text);
  });
  return fromSource(path + (options.overrides.empty() ? "" : " with --set"),
                    [&] { return use(tree); });
}

/// Chooses machine code for the scene's formulas: from the cache, or compiled if the scene requires
/// it or the rest of the run repays it.
class MachineCodeChoice {
 public:
  explicit MachineCodeChoice(Simulation& simulation) : simulation_(simulation) {
    const bool always = simulation.scene().solver.machine_code == MachineCode::kAlways;
    is_decided_ = simulation.loadMachineCode(always) || always;
    if (always && !simulation.hasMachineCode()) warn();
  }
  /// Decides again after `seconds` of wall time on the part `done` of the run.
  void reconsider(double seconds, double done) {
    constexpr double kUsualCompile = 0.3;  // s
    if (is_decided_ || seconds < kUsualCompile ||
        seconds * (1.0 / done - 1.0) < 4.0 * kUsualCompile) {
      return;
    }
    is_decided_ = true;
    if (simulation_.scene().solver.machine_code != MachineCode::kNever &&
        !simulation_.loadMachineCode(true)) {
      warn();
    }
  }

 private:
  void warn() const { tell("note: formulas are run by " + simulation_.machineCode()); }
  Simulation& simulation_;
  bool is_decided_ = false;
};

/// The simulated time interval, s.
struct Span {
  double begin;
  double end;
};

/// Writes the outputs of a run beside its samples. Returns the exit status.
int finish(Simulation& simulation, OfflineRun& offline_run, const SimulateOptions& options) {
  if (!options.save_state_path.empty()) {
    offline_run.saveState();  // of a run that was interrupted
    if (const MotionState* state = offline_run.savedState()) {
      writeStateFile(options.save_state_path, *state, simulation);
    } else {
      tell("the motion has stopped: no state is saved in " + inQuotes(options.save_state_path));
    }
  }
  if (!options.events_path.empty()) {
    writeOutput(options.events_path, writeEvents(simulation));
  }
  if (!options.until_rest || !simulation.status().ok() || g_signal != 0) return kSuccess;
  if (offline_run.rest().isReached()) {
    tell(printed("at rest since %.6g s", offline_run.rest().since()));
    return kSuccess;
  }
  tell(printed("not at rest by the end of the duration, at %.6g s", simulation.time()));
  return kNoRest;
}

/// Reports how a run has ended. Returns the exit status, `exit_status` if that is an error already.
int report(Simulation& simulation, OfflineRun& offline_run, const SimulateOptions& options,
           bool reader_has_gone, int exit_status) {
  if (offline_run.refusedCount() > 0) {
    const TimedCommand& first = offline_run.firstRefused();
    tell("warning: " + std::to_string(offline_run.refusedCount()) +
         " commands refused, not finite; the first: " + escaped(options.commands_path, 300) + ":" +
         std::to_string(first.line) + ", on '" + escaped(first.topic, 300) + "'");
  }
  if (!simulation.status().ok()) {
    tell(simulation.describeStatus());
    if (exit_status == kSuccess) exit_status = kStopped;
  } else if (g_signal != 0) {
    tell(printed("interrupted at %.6g s", simulation.time()));
    exit_status = kSignalBase + g_signal;
  }
  try {
    const int finish_status = finish(simulation, offline_run, options);
    if (exit_status == kSuccess) exit_status = finish_status;
  } catch (const OutputError& error) {
    tell(error.what());
    exit_status = kBadOutput;
  }
  if (!reader_has_gone) {
    for (const std::string& doubt : describeDoubts(simulation)) tell("warning: " + doubt);
  }
  return exit_status;
}

/// Runs to the end, a stop, a signal or a closed output.
int run(Simulation& simulation, OfflineRun& offline_run, SampleWriter* writer,
        const SimulateOptions& options, const Span& span) {
  using Clock = std::chrono::steady_clock;
  // Blocks last long enough for their two readings of the clock not to matter, and are short enough
  // for a progress bar to move and for Ctrl-C to be heard.
  constexpr double kShortBlock = 0.01;  // s
  constexpr double kLongBlock = 0.1;    // s

  const bool samples_on_terminal = options.output_path.empty() && ::isatty(STDOUT_FILENO) == 1;
  const double duration = span.end - span.begin;
  ProgressBar progress(duration, samples_on_terminal);
  WallTimes wall;
  std::uint64_t sample_count = 0;
  SampleBlock block;
  block.samples.reserve(OfflineRun::kBlockSize);
  if (options.stats) offline_run.measureSampling();
  // The span is positive, however short the run.
  double block_span = std::max(duration / 64.0, std::numeric_limits<double>::min());
  MachineCodeChoice machine_code(simulation);
  int exit_status = kSuccess;
  bool reader_has_gone = false;
  try {
    bool more = true;
    while (more && g_signal == 0) {
      const Clock::time_point start = Clock::now();
      g_work = kComputing;
      more = offline_run.advanceBlock(block_span, block);
      g_work = kWriting;
      const double block_time = secondsSince(start);
      wall.simulation += block_time;
      const double done = simulation.time() - span.begin;
      machine_code.reconsider(wall.simulation, done / duration);
      if (block_time < kShortBlock) block_span *= 2.0;
      if (block_time > kLongBlock) block_span *= 0.5;

      const Clock::time_point output_start = Clock::now();
      if (writer != nullptr && !block.samples.empty()) writer->write(block);
      wall.output += secondsSince(output_start);
      sample_count += block.samples.size();
      progress.update(done);
    }
    const Clock::time_point output_start = Clock::now();
    if (writer != nullptr) writer->close();
    wall.output += secondsSince(output_start);
  } catch (const OutputClosed&) {
    reader_has_gone = true;  // the reader closed it on purpose, so no message
  } catch (const OutputError& error) {
    progress.clear();
    tell(error.what());
    exit_status = kBadOutput;
  }
  progress.clear();

  exit_status = report(simulation, offline_run, options, reader_has_gone, exit_status);
  wall.sampling = offline_run.samplingSeconds();
  if (options.stats) {
    printStatistics(simulation, options.columns.energy, wall, sample_count);
  }
  return exit_status;
}

/// Returns the span from `begin`. Throws UsageError if requested instants lie outside.
Span spanOf(const SimulateOptions& options, double begin) {
  const Span span{begin, options.has_duration ? begin + options.duration : options.times.back()};
  const auto check = [&](const char* option, double time) {
    if (time >= span.begin && time <= span.end) return;
    throw UsageError(option + (": " + formatNumber(time)) + " s is outside of the run, from " +
                     formatNumber(span.begin) + " to " + formatNumber(span.end) + " s");
  };
  if (!options.times.empty()) {
    check("--times", options.times.front());
    check("--times", options.times.back());
  }
  if (options.has_save_time) check("--save-at", options.save_time);
  constexpr double kMostSamples = 9e15;  // more than a double can count
  if (!(span.end * options.rate < kMostSamples) && span.begin > 0.0) {
    throw UsageError("--rate: " + formatNumber(options.rate) + " Hz is more than " +
                     formatNumber(span.end) + " s can have samples");
  }
  return span;
}

int emitC(Simulation& simulation, const SimulateOptions& options) {
  const std::string& path = options.scene_path;
  const EmittedScene scene = fromSource(path, [&] {
    return emitScene(simulation, nameForC(path), path.substr(path.rfind('/') + 1));
  });
  g_work = kWriting;
  try {
    writeEmittedScene(scene, options.emit_c_path);
  } catch (const std::runtime_error& error) {
    throw OutputError(error.what());
  }
  return kSuccess;
}

int emitFmu(Simulation& simulation, const SimulateOptions& options) {
  const std::string& path = options.scene_path;
  const std::string description = fromSource(path, [&] {
    return describeFmu(simulation, options.fmi, nameForC(path), path.substr(path.rfind('/') + 1));
  });
  g_work = kWriting;
  try {
    runPythonFile("fmu_archive.py", options.emit_fmu_path, description);
  } catch (const Interrupted&) {
    tell("interrupted; " + inQuotes(options.emit_fmu_path) + " is not written");
    return kSignalBase + g_signal;
  }
  return kSuccess;
}

/// Returns nullptr where samples are only looked at. `columns`: those of the options, and
/// derivatives.
std::unique_ptr<SampleWriter> makeWriter(const Simulation& simulation,
                                         const SimulateOptions& options,
                                         const ColumnGroups& columns) {
  if (options.check_minimum && options.output_path.empty()) return nullptr;
  return endingOf(options.output_path) == ".bag"
             ? makeBagWriter(options.output_path, simulation, columns)
             : makeCsvWriter(options.output_path, simulation, columns);
}

/// Runs, and checks the principle at each sample.
int runChecked(Simulation& simulation, OfflineRun& offline_run, const SimulateOptions& options,
               const Span& span) {
  MinimumWatch watch(simulation, !options.curves_path.empty());
  offline_run.lookAt([&watch](const Sample& sample) { watch.look(sample); });
  const int status = run(simulation, offline_run,
                         makeWriter(simulation, options, options.columns).get(), options, span);
  bool is_least = true;
  writeOutput("", watch.describe(&is_least));
  if (!options.curves_path.empty()) writeOutput(options.curves_path, watch.curves());
  if (is_least) return status;
  tell("the motion is not the one of least Z");
  return status == kSuccess ? kNotLeast : status;
}

/// Runs with derivatives of the samples.
int runDifferentiated(Simulation& simulation, OfflineRun& offline_run,
                      const SimulateOptions& options, const Span& span) {
  Sensitivity sensitivity = useTree(options, [&](const ParameterTree& tree) {
    return Sensitivity(tree, readSceneWithPlugins, options.sensitivity, offline_run.commands());
  });
  ColumnGroups columns = options.columns;
  columns.derivatives = sensitivity.names();
  offline_run.differentiate(&sensitivity);
  const int status =
      run(simulation, offline_run, makeWriter(simulation, options, columns).get(), options, span);
  if (sensitivity.stop().empty()) return status;
  tell(sensitivity.stop());
  return status == kSuccess ? kStopped : status;
}

int runSamples(Simulation& simulation, const SimulateOptions& options) {
  simulation.trackEnergy(options.columns.energy);
  simulation.estimateErrors(options.columns.errors);
  if (!options.from_state_path.empty()) readStateFile(options.from_state_path, simulation);
  const Span span = spanOf(options, simulation.time());
  const SampleTimes times = !options.times.empty()
                                ? SampleTimes::at(options.times)
                                : SampleTimes::atRate(options.rate, span.begin, span.end);
  std::vector<TimedCommand> commands = readCommands(options, simulation.scene());
  if (options.compare_principles) {
    return comparePrinciples(simulation, commands, times, span.end, options) ? kSuccess : kStopped;
  }
  if (!options.events_path.empty()) simulation.keepModeEvents();
  OfflineRun offline_run(simulation, times, std::move(commands), span.end);
  offline_run.observe(options.columns.quantities);
  if (options.until_rest) offline_run.endAtRest();
  if (!options.save_state_path.empty()) {
    offline_run.saveStateAt(options.has_save_time ? options.save_time : span.end);
  }
  const auto note = [](std::size_t count, const char* where, double time) {
    if (count == 0) return;
    tell(printed("note: %zu commands lie %s (%.6g s) and are ignored", count, where, time));
  };
  note(offline_run.ignoredCount(), "after the end", span.end);
  note(offline_run.pastCount(), "before the state", span.begin);
  if (options.check_minimum) return runChecked(simulation, offline_run, options, span);
  if (!options.sensitivity.empty())
    return runDifferentiated(simulation, offline_run, options, span);
  return run(simulation, offline_run, makeWriter(simulation, options, options.columns).get(),
             options, span);
}

int runSimulate(const std::vector<std::string>& words) {
  const SimulateOptions options = parseSimulateOptions(words);
  if (options.help) {
    writeOutput("", kSimulateHelp);
    return kSuccess;
  }
  for (const std::string& path :
       {options.save_state_path, options.events_path, options.curves_path, options.emit_fmu_path}) {
    if (!path.empty()) checkWritable(path);
  }
  // (An error of the start names the file, too.)
  Simulation simulation = useTree(
      options, [](const ParameterTree& tree) { return Simulation(readSceneWithPlugins(tree)); });
  for (const std::string& warning : simulation.scene().warnings) tell("warning: " + warning);
  if (options.compile) {
    g_work = kWriting;
    const bool is_loaded = simulation.loadMachineCode(true, /*patiently=*/true);
    tell("formulas are run by " + simulation.machineCode());
    if (!is_loaded && g_signal != 0) return kSignalBase + g_signal;
    return is_loaded ? kSuccess : kBadOutput;
  }
  if (options.explain) {
    const std::vector<EquationSection> sections = writeEquations(simulation);
    writeOutput("", (options.latex ? layOutLatex : layOutText)(sections, options.scene_path));
    return kSuccess;
  }
  if (!options.emit_c_path.empty()) return emitC(simulation, options);
  if (!options.emit_fmu_path.empty()) return emitFmu(simulation, options);
  if (options.trim) return runTrim(simulation.scene(), options) ? kSuccess : kStopped;
  g_work = kComputing;
  if (options.linearize) {
    if (!options.from_state_path.empty()) readStateFile(options.from_state_path, simulation);
    const bool is_done =
        runLinearize(simulation, readCommands(options, simulation.scene()), options);
    if (g_signal != 0) return kSignalBase + g_signal;
    return is_done ? kSuccess : kStopped;
  }
  return runSamples(simulation, options);
}

}  // namespace
}  // namespace variator_sim

int main(int argc, char** argv) {
  using namespace variator_sim;
  installSignalHandlers();
  const Interruption interruption([] { return g_signal != 0; });
  try {
    return runSimulate({argv + 1, argv + argc});
  } catch (const UsageError& error) {
    tell(std::string(error.what()) + "\nTry: simulate --help");
    return kBadUsage;
  } catch (const OutputClosed&) {
    return kSuccess;
  } catch (const OutputError& error) {
    tell(error.what());
    return kBadOutput;
  } catch (const std::bad_alloc&) {
    tell("this takes more memory than there is");
    return kBadUsage;
  } catch (...) {
    tell(describeThrown());
    return g_signal != 0 ? kSignalBase + g_signal : kBadUsage;
  }
}
