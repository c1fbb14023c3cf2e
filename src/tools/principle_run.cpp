#include "tools/principle_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "model/number_text.h"
#include "tools/sample_writer.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

using Eigen::VectorXd;

namespace {

std::string rounded(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

}  // namespace

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
    text += "\nlargest excess over the least Z: " + rounded(excess) + " of its scale, at " +
            formatNumber(worst->time) + " s (Z " + formatNumber(worst->change.measure) +
            ", least " + formatNumber(worst->change.least) + ")";
  }
  text += "\nlargest distance from the constraints: " + rounded(off) +
          " of the scale\nlargest difference by [10] and [16]: " + rounded(derivations) +
          " of the scale\n";
  for (const std::string& limit : check_.limits()) text += "note: " + limit + "\n";
  return text;
}

// --- principles beside each other ----------------------------------------------------------------

namespace {

/// Returns false when the motion stops on the way.
bool runBeside(const std::string& name, Scene scene, const std::vector<ResolvedCommand>& commands,
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
    more = run.advanceBlock(std::numeric_limits<double>::infinity(), block);
    if (!block.samples.empty()) writer->write(block);
  }
  writer->close();
  bool is_least = true;
  if (watch) writeOutput("", watch->describe(&is_least));
  if (simulation.status().ok()) return true;
  std::fprintf(stderr, "simulate: %s: %s\n", name.c_str(), simulation.describeStatus().c_str());
  return false;
}

}  // namespace

bool comparePrinciples(const Simulation& simulation, const std::vector<ResolvedCommand>& commands,
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
    std::fputs(
        "simulate: note: [18] is left out: it knows neither elements that hold, states, events "
        "and inertias by formulas, nor constraints that read inputs\n",
        stderr);
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
