#include "tools/principle_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "model/number_text.h"
#include "tools/sample_writer.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

using Eigen::VectorXd;

namespace {

/// Largest excess of Z and distance from the constraints, as parts of the scale.
constexpr double kAllowed = 1e-9;

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
  const OperatingPoint point = simulation_.operatingPoint();
  const PrincipleSystem system = check_.calc(point);
  const VectorXd own = check_.ownOf(sample);
  LeastChange change = PrincipleCheck::compare(system, own);
  if (!(change.excess() <= kAllowed && change.distance() <= kAllowed)) {
    change.forgive(check_.calcRounding(point));
  }
  if (count_++ == 0 || !(change.excess() <= worst_.excess())) {
    worst_ = change;
    worst_time_ = sample.time;
  }
  if (!(change.distance() <= largest_off_)) {
    largest_off_ = change.distance();
    off_time_ = sample.time;
  }
  largest_measure_ = std::max(largest_measure_, change.measure);
  if (system.C.rows() > 0) compareDerivations(system, own, change.scale);
  if (with_curves_) addCurves(sample.time, system, own, change);
}

void MinimumWatch::compareDerivations(const PrincipleSystem& system, const VectorXd& own,
                                      double scale) {
  const VectorXd x = system.unknownsOf(own);
  for (const VectorXd& other :
       {system.solveByNullSpace(), system.solveByStationarity(), system.solveByElimination()}) {
    if (other.size() == 0) continue;
    const VectorXd change = other - x;
    const double part = std::sqrt(0.5 * change.dot(system.J * change) / scale);
    derivation_difference_ = std::max(derivation_difference_, part);
  }
}

void MinimumWatch::addCurves(double time, const PrincipleSystem& system, const VectorXd& own,
                             const LeastChange& change) {
  const VectorXd x = system.unknownsOf(own);
  const Eigen::MatrixXd directions = system.admissibleDirections();
  const double reach = std::sqrt(2.0 * change.scale);
  constexpr int kSteps = 10;  // to each side
  for (int n = 0; n < directions.cols(); ++n) {
    for (int step = -kSteps; step <= kSteps; ++step) {
      const double length = reach * step / kSteps;
      const double Z = system.measure(x + length * directions.col(n));
      curves_ += formatNumber(time) + "," + std::to_string(n + 1) + "," + formatNumber(length) +
                 "," + formatNumber(Z) + "\n";
    }
  }
}

bool MinimumWatch::isLeast() const {
  return worst_.excess() <= kAllowed && largest_off_ <= kAllowed;  // false when NaN
}

std::string MinimumWatch::describe() const {
  const bool is_classical = check_.isClassical();
  std::string text =
      std::string("principle: ") +
      (is_classical ? "gauss, Z = 1/2 R^T J^-1 R over the accelerations that the constraints allow"
                    : "generalized_gauss, Z = 1/2 G^T J^-1 G over the jerks that the constraints "
                      "allow") +
      "\ninstants: " + std::to_string(count_) +
      "\nlargest Z of the motion: " + rounded(largest_measure_) +
      (is_classical ? " N m/s^2" : " N m/s^4") +
      "\nlargest excess over the least Z: " + rounded(worst_.excess()) + " of its scale, at " +
      formatNumber(worst_time_) + " s (Z " + formatNumber(worst_.measure) + ", least " +
      formatNumber(worst_.least) + ", scale " + rounded(worst_.scale) +
      ")\nlargest distance from the constraints: " + rounded(largest_off_) + " of the scale" +
      (largest_off_ > 0.0 ? ", at " + formatNumber(off_time_) + " s" : "") +
      "\nlargest difference of [10], [15] and [16] from the motion's " +
      (is_classical ? "accelerations: " : "jerks: ") + rounded(derivation_difference_) +
      " of the scale\n";
  for (const std::string& limit : check_.limits()) text += "note: " + limit + "\n";
  return text;
}

// --- principles beside each other ----------------------------------------------------------------

namespace {

/// One motion of the comparison.
struct Compared {
  std::string name;
  Simulation simulation;
  std::vector<double> rows;  ///< samples, column by column
  bool has_stopped = false;
  std::string derivations;  ///< a sentence, or ""
};

/// Returns "run_gauss.csv" for "run.csv".
std::string pathBeside(const std::string& path, const std::string& name) {
  const std::size_t dot = path.rfind('.');
  return path.substr(0, dot) + "_" + name + path.substr(dot);
}

void runCompared(Compared& motion, const std::vector<ResolvedCommand>& commands,
                 const SampleTimes& times, double end, const SimulateOptions& options) {
  Simulation& simulation = motion.simulation;
  OfflineRun run(simulation, times, commands, end);
  std::unique_ptr<MinimumWatch> watch;
  try {
    watch = std::make_unique<MinimumWatch>(simulation, false);
    run.lookAt([&watch](const Sample& sample) { watch->look(sample); });
  } catch (const SceneError&) {  // nothing is least: there is nothing to derive otherwise
  }
  const RowMaker maker(simulation, {});
  std::unique_ptr<SampleWriter> writer;
  if (!options.output_path.empty()) {
    const std::string path = pathBeside(options.output_path, motion.name);
    writer = makeCsvWriter(path, simulation, {});
  }
  SampleBlock block;
  bool more = true;
  while (more && !Interruption::isWanted()) {
    more = run.advanceBlock(std::numeric_limits<double>::infinity(), block);
    if (writer && !block.samples.empty()) writer->write(block);
    for (const Sample& sample : block.samples) {
      const std::size_t begin = motion.rows.size();
      motion.rows.resize(begin + maker.columnCount());
      maker.write(sample, nullptr, motion.rows.data() + begin);
    }
  }
  if (writer) writer->close();
  if (watch) {
    motion.derivations = motion.name + ": [10], [15] and [16] differ from it by at most " +
                         rounded(watch->largestDerivationDifference()) + " of the scale\n";
  }
  motion.has_stopped = !simulation.status().ok();
  if (!motion.has_stopped) return;
  std::fprintf(stderr, "simulate: %s: %s\n", motion.name.c_str(),
               simulation.describeStatus().c_str());
}

/// Prints the largest differences of all columns from those of the first motion.
std::string describeDifferences(const std::vector<Compared>& motions) {
  const std::vector<std::string> names = columnNames(motions.front().simulation, {});
  std::string text = "largest difference from " + motions.front().name + "\ncolumn";
  for (std::size_t m = 1; m < motions.size(); ++m) text += "," + motions[m].name;
  text += "\n";
  for (std::size_t column = 1; column < names.size(); ++column) {
    text += names[column];
    for (std::size_t m = 1; m < motions.size(); ++m) {
      const std::vector<double>& a = motions.front().rows;
      const std::vector<double>& b = motions[m].rows;
      double largest = 0.0;
      for (std::size_t n = column; n < std::min(a.size(), b.size()); n += names.size()) {
        largest = std::max(largest, std::abs(a[n] - b[n]));
      }
      text += "," + rounded(largest);
    }
    text += "\n";
  }
  return text;
}

/// Returns the scene of [18]: its constraints in their form of order 3, from the accelerations
/// `first`, whose reaction is in range(C^T).
Scene makeFormal(Scene scene, const double* first) {
  scene.principle = Principle::kGauss;
  for (ConstraintPtr& constraint : scene.constraints) constraint = constraint->inOrder3();
  scene.initial.acceleration.assign(first, first + scene.shaftCount());
  scene.initial.project = true;
  return scene;
}

}  // namespace

bool comparePrinciples(const Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                       const SampleTimes& times, double end, const SimulateOptions& options) {
  std::vector<Compared> motions;
  const auto run = [&](const char* name, Scene scene) {
    motions.push_back({name, Simulation(std::move(scene)), {}, false, ""});
    runCompared(motions.back(), commands, times, end, options);
  };
  Scene scene = simulation.scene();
  scene.principle = Principle::kGeneralizedGauss;
  run("generalized_gauss", scene);
  scene.principle = Principle::kGauss;
  scene.initial.acceleration.clear();
  const bool has_order3 = scene.hasOrder3();
  if (!has_order3) run("gauss", scene);
  // A jump of an input would move C eta + c0 = 0 by an impulse.
  const bool reads_inputs = std::any_of(scene.constraints.begin(), scene.constraints.end(),
                                        [](const ConstraintPtr& it) { return it->readsInputs(); });
  if (reads_inputs || !scene.holdNames().empty() || scene.hasMemory()) {
    std::fputs(
        "simulate: note: [18] is left out: it knows neither elements that hold, states and "
        "events, nor constraints that read inputs\n",
        stderr);
  } else {
    Simulation start(scene);
    run("formal", makeFormal(std::move(scene), start.sample().acceleration));
  }
  std::string text = describeDifferences(motions);
  for (const Compared& it : motions) text += it.derivations;
  writeOutput("", text);
  return std::none_of(motions.begin(), motions.end(),
                      [](const Compared& it) { return it.has_stopped; });
}

}  // namespace variator_sim
