#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "motion.h"

namespace variator_sim {

void Motion::startOver() {
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  time_ = 0.0;
  advanced_ = false;
  step_window_start_ = 0.0;
  steps_in_window_ = 0;
  pending_count_ = 0;
  rhythm_.reset();
  std::fill(std::begin(last_command_time_), std::end(last_command_time_), kNever);
  choice_.reset(starts_implicitly_);
  drivetrain_.resetInputs();
  std::fill(std::begin(row_reference_), std::end(row_reference_), 0.0);
  checks_.reset();
  origin_ = origin_rest_ = 0.0;
  drivetrain_.setOrigin(0.0);
  crossing_ = Crossing{};
  last_crossing_ = LastCrossing{};
  if (knows_start_) {
    // The accelerations of least reaction are the same every time; commands come later.
    front_ = StepNode(system_);
    front_.x = start_;
    initial_result_ = InitialResult::kConsistent;
    sample_valid_ = false;
    restart();
    return;
  }
  start();
  // (Where accelerations are no part of the state, a start also leaves guesses of them.)
  knows_start_ =
      integrates_torque_ && initial_result_ == InitialResult::kConsistent && status_.ok();
  start_ = front_.x;
}

void Motion::start() {
  front_ = StepNode(system_);
  initial_result_ = system_.start(front_.x, nearest_, &velocities_at_fault_);
  sample_valid_ = false;
  base_ = front_;
  switch (initial_result_) {
    case InitialResult::kConsistent:
      choice_.reset();
      restart();
      if (!status_.ok()) break;
      starts_implicitly_ = choice_.isStiffStart(system_, front_, next_step_);
      // Once more, and as every later reset does: what was done to find out is no part of the
      // run.
      drivetrain_.resetCounts();
      choice_.reset(starts_implicitly_);
      restart();
      break;
    case InitialResult::kSingular:
      stop(StopReason::kSingularConstraint);
      status_.constraint = velocities_at_fault_ ? drivetrain_.singularVelocityConstraint()
                                                : drivetrain_.singularAccelerationConstraint();
      // (Of constraints of order 3 only the solver of all of them knows.)
      if (status_.constraint < 0) status_.constraint = drivetrain_.solver().singularRow();
      break;
    case InitialResult::kNonFinite:
      stop(StopReason::kNonFiniteValue);
      drivetrain_.findNonFinite(system_.view(0.0, front_.x), &status_.torque, &status_.constraint);
      break;
    case InitialResult::kInconsistent:
    case InitialResult::kNotFound:
    case InitialResult::kNotUnique:
    case InitialResult::kDoubtful:
      stop(StopReason::kProjectionFailed);
      break;
  }
}

void Motion::restart() {
  sleeping_ = false;
  hopped_ = false;
  crossing_ = Crossing{};
  rest_.reset();
  choice_.restart();
  stepper_ = &choice_.stepper();
  control_.setOrder(std::max(1, stepper_->errorOrder()));
  moveOrigin(front_.time);
  front_.time = 0.0;
  base_ = front_;
  drivetrain_.refreshInputs(front_.time);
  system_(front_.x, front_.dxdt, front_.time);
  for (double value : front_.dxdt) {
    if (!std::isfinite(value)) {
      explainStop();
      return;
    }
  }
  checks_.noteTorque(front_);
  checks_.noteAccelerations(front_);
  noteRows();
  if (!advanced_) system_.noteReaction(front_);
  base_ = front_;
  if (!guards_.isEmpty()) {
    moveGuards();
    meetEdgeAtStart();
    if (!advanced_ && !leaveCorner()) return;
  }
  control_.reset();
  restart_time_ = front_.time;
  fixed_steps_ = 0;
  if (!choice_.isFixed()) next_step_ = chooseFirstStep();
}

double Motion::chooseFirstStep() {
  const SolverSettings& solver = scene_.solver;
  const auto size = [&](const State& v) {
    double largest = 0.0;
    for (int i = 0; i < v.size(); ++i) {
      const double allowance =
          solver.absolute_tolerance + solver.relative_tolerance * std::abs(front_.x[i]) + 1e-300;
      largest = std::max(largest, std::abs(v[i]) / allowance);
    }
    return largest;
  };
  const double d0 = size(front_.x);
  const double d1 = size(front_.dxdt);
  double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
  h0 = std::min(h0, solver.maximum_step);
  State x1(system_.size());
  State change(system_.size());
  for (int i = 0; i < x1.size(); ++i) x1[i] = front_.x[i] + h0 * front_.dxdt[i];
  system_.noteBase(front_.time, front_.x, front_.dxdt);
  system_(x1, change, front_.time + h0);
  for (int i = 0; i < x1.size(); ++i) change[i] -= front_.dxdt[i];
  const double d2 = size(change) / h0;
  const double largest = std::max(d1, d2);
  double h1 = largest <= 1e-15 ? std::max(1e-6, h0 * 1e-3)
                               : std::pow(0.01 / largest, 1.0 / stepper_->errorOrder());
  if (!std::isfinite(h1)) h1 = 1e-3 * h0;  // the Euler step left the domain
  // Without an absolute tolerance nothing that starts from 0 is ever slow enough: let it try.
  h1 = std::max(h1, 1e-6 * h0);
  return std::min({100.0 * h0, h1, solver.maximum_step});
}

void Motion::writeResiduals(std::ostream& text, const StateView& state) const {
  const std::vector<int>& rows =
      velocities_at_fault_ ? drivetrain_.velocityRows() : drivetrain_.accelerationRows();
  const char* separator = "";
  for (int m : rows) {
    double C[kMaxShafts];
    const Constraint& constraint = drivetrain_.constraint(m);
    text << separator << " residual of '" << constraint.name() << "' = "
         << formatNumber(velocities_at_fault_ ? constraint.calcResidual(state)
                                              : constraint.calcResidualAndJacobian(state, C));
    separator = ",";
  }
}

void Motion::throwInitialError() {
  const InitialConditions& initial = scene_.initial;
  const std::string what = velocities_at_fault_ ? "velocities" : "accelerations";
  const std::string key = velocities_at_fault_ ? "initial/velocity" : "initial/acceleration";
  const std::vector<double>& given = velocities_at_fault_ ? initial.velocity : initial.acceleration;
  std::ostringstream text;
  const auto write = [&](const double* values) {
    text << "[";
    for (int i = 0; i < S; ++i) text << (i ? ", " : "") << formatNumber(values[i]);
    text << "]";
  };
  const StateView state = system_.view(0.0, front_.x);
  if (initial_result_ == InitialResult::kNotUnique || initial_result_ == InitialResult::kDoubtful) {
    const auto& search = system_.search();
    text << (initial_result_ == InitialResult::kNotUnique
                 ? "more than one has the least reaction, and they lead to different motions: "
                 : "which one has the least reaction is not certain, the constraints have too "
                   "many like these: ");
    for (int n = 0; n < search.candidateCount(); ++n) {
      text << (n > 0 ? ", " : "");
      write(search.candidate(n).epsilon);
      text << " with 1/2 R^T J^-1 R = " << formatNumber(search.candidate(n).reaction);
    }
    throw SceneError(key, text.str() + "; give 'initial/acceleration'");
  }
  if (initial_result_ != InitialResult::kInconsistent) {
    text << "no " << what << " that satisfy the constraints were found ";
    text << (given.empty() ? "from the free accelerations; give 'initial/acceleration' (there:"
                           : "near those given (there:");
    writeResiduals(text, state);
    text << ")";
    throw SceneError(key, text.str());
  }
  write(given.data());
  StateView there = state;
  (velocities_at_fault_ ? there.velocity : there.acceleration) = given.data();
  if (scene_.principle == Principle::kGauss && !velocities_at_fault_) {
    text << " is not what the principle 'gauss' gives:";
  } else {
    text << " does not satisfy the constraints:";
  }
  writeResiduals(text, there);
  text << "; the nearest consistent " << what << " are ";
  write(nearest_);
  text << " (write these, or set 'initial/project: true' to start there)";
  throw SceneError(key, text.str());
}

}  // namespace variator_sim
