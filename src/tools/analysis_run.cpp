#include "tools/analysis_run.h"

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>

#include "model/number_text.h"
#include "motion/culprit.h"
#include "tools/analysis_text.h"
#include "tools/sample_writer.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/trim.h"

namespace variator_sim {

using Eigen::VectorXd;

// --- linear models and steady states -------------------------------------------------------------

namespace {

/// Longest wait for rest without --duration, s.
constexpr double kPatience = 1000.0;

/// True for `velocity=[10, 5], inputs={throttle: 0.5}`.
bool isInline(const std::string& word) {
  return word.find_first_of("=:") != std::string::npos && !std::ifstream(word);
}

/// Advances to the first rest until `end`, at which `run` ends. Returns false when there is none.
bool advanceToRest(Simulation& simulation, OfflineRun& run, double end) {
  SampleBlock none;
  while (simulation.time() < end && !Interruption::isWanted()) {
    run.advanceBlock(std::max(0.05, 0.01 * simulation.time()), none);
    simulation.sample();
    if (!simulation.status().ok()) return false;
    if (simulation.isSleeping()) return true;
  }
  return false;
}

/// Explains why the motion does not come to rest, and the option that needs none.
std::string explainUnrest(Simulation& simulation) {
  const Scene& scene = simulation.scene();
  std::vector<std::string> readers;
  for (const Law* const law : scene.laws()) {
    if (expression::reads(law->graph(), law->formulas(), expression::Source::kTime))
      readers.push_back(describe(*law));
  }
  std::string text = "no rest until " + formatNumber(simulation.time()) + " s: ";
  if (!scene.solver.sleep) return text + "'solver/sleep: false' allows none";
  if (isFixedStep(scene.solver.stepper)) return text + "steppers with fixed steps know none";
  if (!readers.empty()) {
    text += join(readers, ", ") + (readers.size() == 1 ? " reads" : " read") + " the time";
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
bool reachPoint(Simulation& simulation, const std::vector<TimedCommand>& commands,
                const SimulateOptions& options, OperatingPoint* point) {
  double time = 0.0;
  const auto runTo = [&](double end) {
    return OfflineRun(simulation, SampleTimes::at({}), commands, end);
  };
  const auto fail = [&](std::string why) {
    if (!simulation.status().ok()) why = simulation.describeStatus();
    if (Interruption::isWanted()) why = "interrupted at " + formatNumber(simulation.time()) + " s";
    tell(why);
    return false;
  };
  if (options.at == "rest") {
    const double end = options.duration > 0.0 ? options.duration : kPatience;
    OfflineRun run = runTo(end);
    if (!advanceToRest(simulation, run, end)) {
      return fail(simulation.status().ok() ? explainUnrest(simulation) : "");
    }
  } else if (readWhole(options.at, &time)) {
    if (!(time >= 0.0) || !std::isfinite(time)) throw UsageError("--at: must be at least 0 s");
    SampleBlock none;
    runTo(time).advanceBlock(kNever, none);
    simulation.sample();
    if (!simulation.status().ok() || simulation.time() < time) return fail("");
  } else if (isInline(options.at)) {
    const std::string yaml = "{" + boost::replace_all_copy(options.at, "=", ": ") + "}";
    *point = readOperatingPoint(readYamlText(yaml, "--at"), simulation.scene(), "--at");
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

/// `text` ends with a line.
std::string asComment(const std::string& text) {
  const std::string commented = "# " + boost::replace_all_copy(text, "\n", "\n# ");
  return commented.substr(0, commented.size() - 2);
}

}  // namespace

bool runLinearize(Simulation& simulation, const std::vector<TimedCommand>& commands,
                  const SimulateOptions& options) {
  const std::string& path = options.output_path;
  const std::string ending = path.empty() ? "" : endingOfModel(path);
  const bool converts = ending == ".npz" || ending == ".mat";
  const auto convert = [&](const std::string& csv) {
    return runPythonFile("linear_model_files.py", ending, csv);
  };
  // A missing library is reported before the run.
  if (converts) convert("");
  OperatingPoint point;
  if (!reachPoint(simulation, commands, options, &point)) return false;
  const LinearModel model =
      linearize(simulation.scene(), point, options.full ? LinearForm::kFull : LinearForm::kMinimal);
  const std::string csv = writeModel(model);
  if (!path.empty()) writeOutput(path, converts ? convert(csv) : csv);
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
  tell(result.message);
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

// --- the minimum ---------------------------------------------------------------------------------

MinimumWatch::MinimumWatch(Simulation& simulation, bool with_curves)
    : simulation_(simulation), check_(simulation.scene()), with_curves_(with_curves) {
  if (with_curves_) curves_ = "time,direction,step,Z\n";
}

void MinimumWatch::look(const Sample& sample) {
  const PrincipleSystem system = check_.calc(simulation_.operatingPoint());
  const VectorXd own = check_.ownOf(sample);
  const VectorXd x = system.unknownsOf(own);
  Looked looked = {sample.time, PrincipleCheck::compare(system, own), 0.0};
  if (system.C.rows() > 0) {
    for (const VectorXd& other : {system.solveByNullSpace(), system.solveByStationarity()}) {
      const double square = (other - x).dot(system.J * (other - x));
      looked.derivations = std::max(looked.derivations, std::sqrt(square));
    }
  }
  if (with_curves_) addCurves(sample.time, system, x, std::sqrt(2.0 * looked.change.scale));
  looked_.push_back(looked);
}

void MinimumWatch::addCurves(double time, const PrincipleSystem& system, const VectorXd& x,
                             double reach) {
  const Eigen::MatrixXd directions = system.admissibleDirections();
  constexpr int kSteps = 10;  // to each side
  for (int n = 0; n < directions.cols(); ++n) {
    for (int step = -kSteps; step <= kSteps; ++step) {
      const double length = reach * step / kSteps;
      curves_ += formatNumber(time) + "," + std::to_string(n + 1) + "," + formatNumber(length) +
                 "," + formatNumber(system.measure(x + length * directions.col(n))) + "\n";
    }
  }
}

std::string MinimumWatch::describe(bool* is_least) const {
  constexpr double kAllowed = 1e-9;
  constexpr double kQuiet = 1e-7;  // of the largest scale: less is rounding of what has passed
  double largest = std::numeric_limits<double>::min();
  for (const Looked& it : looked_) largest = std::max(largest, it.change.scale);
  double excess = 0.0;
  double off = 0.0;
  double derivations = 0.0;
  const Looked* worst = nullptr;
  for (const Looked& it : looked_) {
    const double scale = std::max(it.change.scale, kQuiet * largest);
    const double its_excess = std::abs(it.change.measure - it.change.least) / scale;
    if (worst == nullptr || !(its_excess <= excess)) {  // a NaN is worst
      worst = &it;
      excess = its_excess;
    }
    const double length = std::sqrt(2.0 * scale);
    if (!(it.change.off / length <= off)) off = it.change.off / length;
    derivations = std::max(derivations, it.derivations / length);
  }
  *is_least = excess <= kAllowed && off <= kAllowed;
  std::string text =
      std::string("principle: ") +
      (check_.isClassical()
           ? "gauss, Z = 1/2 R^T J^-1 R over the accelerations that the constraints allow"
           : "generalized_gauss, Z = 1/2 G^T J^-1 G over the jerks that the constraints allow") +
      "\ninstants: " + std::to_string(looked_.size());
  if (worst != nullptr) {
    text += "\nlargest excess over the least Z: " + printed("%.3g", excess) + " of its scale, at " +
            formatNumber(worst->time) + " s (Z " + formatNumber(worst->change.measure) +
            ", least " + formatNumber(worst->change.least) + ")";
  }
  text += "\nlargest distance from the constraints: " + printed("%.3g", off) +
          " of the scale\nlargest difference by [10] and [16]: " + printed("%.3g", derivations) +
          " of the scale\n";
  for (const std::string& limit : check_.limits()) text += "note: " + limit + "\n";
  return text;
}

// --- principles beside each other ----------------------------------------------------------------

namespace {

/// Returns false when the motion stops on the way.
bool runBeside(const std::string& name, Scene scene, const std::vector<TimedCommand>& commands,
               const SampleTimes& times, double end, const std::string& path) {
  Simulation simulation(std::move(scene));
  OfflineRun run(simulation, times, commands, end);
  std::unique_ptr<MinimumWatch> watch;
  try {
    watch = std::make_unique<MinimumWatch>(simulation, false);
    run.lookAt([&watch](const Sample& sample) { watch->look(sample); });
  } catch (const SceneError&) {  // nothing is least: there is nothing to derive otherwise
  }
  const std::size_t dot = path.rfind('.');  // "run_gauss.csv" for "run.csv"
  const auto writer =
      makeCsvWriter(path.substr(0, dot) + "_" + name + path.substr(dot), simulation, {});
  SampleBlock block;
  for (bool more = true; more && !Interruption::isWanted();) {
    more = run.advanceBlock(kNever, block);
    if (!block.samples.empty()) writer->write(block);
  }
  writer->close();
  bool is_least = true;
  if (watch) writeOutput("", watch->describe(&is_least));
  if (simulation.status().ok()) return true;
  tell(name + ": " + simulation.describeStatus());
  return false;
}

}  // namespace

bool comparePrinciples(const Simulation& simulation, const std::vector<TimedCommand>& commands,
                       const SampleTimes& times, double end, const SimulateOptions& options) {
  const auto run = [&](const char* name, const Scene& scene) {
    return runBeside(name, scene, commands, times, end, options.output_path);
  };
  Scene scene = simulation.scene();
  scene.principle = Principle::kGeneralizedGauss;
  bool all_end = run("generalized_gauss", scene);
  scene.principle = Principle::kGauss;
  scene.initial.acceleration.clear();
  if (!scene.hasOrder3()) all_end = run("gauss", scene) && all_end;
  // A jump of an input would move C eta + c0 = 0 by an impulse.
  const bool reads_inputs = std::any_of(scene.constraints.begin(), scene.constraints.end(),
                                        [](const ConstraintPtr& it) { return it->readsInputs(); });
  if (reads_inputs || !scene.holdNames().empty() || scene.hasMemory() ||
      !scene.inertia_formulas.empty()) {
    tell(
        "note: [18] is left out: it knows neither elements that hold, states, events and inertias "
        "by formulas, nor constraints that read inputs");
    return all_end;
  }
  // [18]: the constraints in their form of order 3, from accelerations whose reaction is in
  // range(C^T).
  Simulation start(scene);
  const double* const first = start.sample().acceleration;
  for (ConstraintPtr& constraint : scene.constraints) constraint = constraint->inOrder3();
  scene.initial.acceleration.assign(first, first + scene.shaftCount());
  scene.initial.project = true;
  return run("formal", scene) && all_end;
}

}  // namespace variator_sim
