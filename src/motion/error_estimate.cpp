#include "motion/error_estimate.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>

#include "motion/motion.h"

namespace variator_sim {
namespace {

/// Rounding of a column within a few hundred steps, relative to its largest value so far. Both
/// motions share a part of it, so their difference does not show it.
constexpr double kRounding = 8e-15;
constexpr double kGrowth = 1e8;     // tolerances
constexpr double kLargePart = 0.1;  // of a column
constexpr double kLeastTolerance = 1e-14;

// Measured over random scenes (doc/scene.md). The same stepper at a tolerance k times smaller is a
// good companion as long as its error goes with its tolerance; a higher order is cheaper for
// steppers of low order, and `auto` is the one that passes every event.
Scene makeCompanion(const Scene& scene) {
  const SolverSettings& settings = scene.solver;
  Scene companion = scene;
  SolverSettings& finer = companion.solver;
  double factor = 100.0;
  // Above this tolerance `auto` uses Runge-Kutta methods, whose errors may lie far below it.
  if (settings.stepper == StepperKind::kAuto)
    factor = settings.relative_tolerance > 1e-6 ? 1e4 : 300.0;
  // (The same steps, of an order two or three higher.)
  if (settings.stepper == StepperKind::kTaylorFixed) factor = 1e4;
  for (double* const tolerance : {&finer.relative_tolerance, &finer.absolute_tolerance})
    *tolerance = std::min(*tolerance, std::max(*tolerance / factor, kLeastTolerance));
  if (settings.stepper == StepperKind::kDopri5 || settings.stepper == StepperKind::kRk4)
    finer.stepper = StepperKind::kAuto;
  if (settings.stepper == StepperKind::kRk4) {
    // The stepper ignores the tolerance; the error goes with some power of the step.
    constexpr double kUsualStep = 1e-3;  // s
    const double coarseness = std::max(1.0, settings.step / kUsualStep);
    finer.relative_tolerance = std::min(1e-8, 1e-13 * coarseness * coarseness);
    finer.absolute_tolerance = finer.relative_tolerance;
  }
  constexpr int kMost = std::numeric_limits<int>::max() / 4;
  finer.maximum_steps = 4 * std::min(settings.maximum_steps, kMost);
  return companion;
}

}  // namespace

ErrorEstimate::ErrorEstimate(const Scene& scene)
    : companion_(makeCompanion(scene)),
      relative_(scene.solver.relative_tolerance),
      absolute_(scene.solver.absolute_tolerance) {}

void ErrorEstimate::forget() {
  std::fill_n(largest_[0], 3 * kMaxShafts, 0.0);
  std::fill_n(largest_state_, kMaxInputs, 0.0);
  is_grown_ = false;
  counts_differ_ = -1.0;
  doubt_ = {};
}

std::string ErrorEstimate::describe() const {
  const SolverSettings& solver = companion_.scene().solver;
  std::ostringstream text;
  text << toString(solver.stepper) << " at a relative tolerance of " << solver.relative_tolerance;
  return text.str();
}

bool ErrorEstimate::compare(const double* run, const double* companion, std::size_t count,
                            double* largest, double* error) {
  bool is_at_rounding = true;
  for (std::size_t i = 0; i < count; ++i) {
    largest[i] = std::max(largest[i], std::abs(run[i]));
    const double difference = std::abs(run[i] - companion[i]);
    const double rounding = kRounding * largest[i];
    error[i] = std::max(difference, rounding);
    is_at_rounding = is_at_rounding && difference <= rounding;
    const double least = 1e3 * absolute_;
    const double limit = std::min(kGrowth * (absolute_ + relative_ * largest[i]),
                                  std::max(kLargePart * largest[i], least));
    is_grown_ = is_grown_ || difference > limit;
  }
  return is_at_rounding;
}

void ErrorEstimate::judge(Motion& run, Sample* sample) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  companion_.advanceTo(run.time);
  const Sample& other = companion_.sample();
  const bool has_stopped = !companion_.status().ok();
  if (has_stopped || companion_.time() < run.time) {  // or was interrupted
    if (has_stopped && doubt_.stopped < 0.0) doubt_.stopped = companion_.status().time;
    doubt_.reason = companion_.status().reason;
    std::fill_n(sample->angle_error, kMaxShafts, kUnknown);
    std::fill_n(sample->velocity_error, kMaxShafts, kUnknown);
    std::fill_n(sample->acceleration_error, kMaxShafts, kUnknown);
    std::fill_n(sample->state_error, kMaxInputs, kUnknown);
    return;
  }
  is_grown_ = false;
  const std::size_t shafts = companion_.scene().shafts.size();
  const std::size_t states = companion_.scene().states.size();
  double of_run[kMaxInputs];
  double of_companion[kMaxInputs];
  run.quantities.calc(QuantityGroup::kStates, run.view(), *sample, of_run);
  companion_.calcQuantities(QuantityGroup::kStates, of_companion);
  const bool are_at_rounding[] = {
      compare(sample->angle, other.angle, shafts, largest_[0], sample->angle_error),
      compare(sample->velocity, other.velocity, shafts, largest_[1], sample->velocity_error),
      compare(sample->acceleration, other.acceleration, shafts, largest_[2],
              sample->acceleration_error),
      compare(of_run, of_companion, states, largest_state_, sample->state_error)};
  if (is_grown_ && doubt_.grown < 0.0) doubt_.grown = sample->time;
  noteEdges(run);
  if (sample->time <= 0.0) return;  // both are the same at the start
  ++doubt_.samples;
  if (!std::all_of(std::begin(are_at_rounding), std::end(are_at_rounding),
                   [](bool is) { return is; }))
    return;
  if (doubt_.rounding_samples++ == 0) doubt_.rounding = sample->time;
}

/// Both motions run ahead of the current time, by different steps: a difference counts only if it
/// is older than the last step of either, and the same since.
void ErrorEstimate::noteEdges(Motion& run) {
  const auto before = counted_more_;
  counted_more_ = static_cast<std::int64_t>(run.statistics.kinks) -
                  static_cast<std::int64_t>(companion_.statistics().kinks);
  if (counted_more_ == 0) {
    counts_differ_ = -1.0;
    return;
  }
  if (counts_differ_ < 0.0 || counted_more_ != before) {
    counts_differ_ = std::max(run.program.front(), Motion::of(companion_).program.front());
  }
  if (doubt_.parted < 0.0 && run.time > counts_differ_) doubt_.parted = run.time;
}

}  // namespace variator_sim
