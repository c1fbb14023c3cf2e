#include "integrate/jump_map.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

namespace variator_sim {

JumpMap::JumpMap(System& system, const SolverSettings& settings)
    : S(system.shafts()),
      system_(system),
      drivetrain_(system.drivetrain()),
      path_(drivetrain_, system.keepsReactionInRange()),
      // A jump's error persists and adds to those of other jumps: a tenth of the tolerance.
      tolerance_{0.1 * settings.absolute_tolerance,
                 std::max(0.1 * settings.relative_tolerance, 1e-14)},
      stepper_(makePathStepper(S, tolerance_)),
      consistency_(drivetrain_) {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    const Constraint& constraint = drivetrain_.constraint(m);
    straight_ =
        straight_ && constraint.nonlinearAccelerations().none() && !constraint.readsInputs();
  }
}

MotionStatus JumpMap::apply(double t, State& x, const double* u0, const double* u1,
                            std::uint64_t* projections) {
  const StateView state = system_.viewWithLast(t, x);  // brings J to phi
  if (!system_.integratesTorque()) return system_.accelerations().jump(state, u0, u1);
  path_.begin(state.time, x.data(), x.data() + S, u0, u1);
  return follow(x.data() + 2 * S, projections);
}

MotionStatus JumpMap::applyTorque(double t, State& x, const double* torque_jump,
                                  std::uint64_t* projections) {
  const StateView state = system_.viewWithLast(t, x);  // brings J to phi
  if (!system_.integratesTorque()) return system_.accelerations().jumpTorque(state, torque_jump);
  path_.begin(state.time, x.data(), x.data() + S, drivetrain_.inputs(), drivetrain_.inputs());
  path_.setTorqueJump(torque_jump);
  return follow(x.data() + 2 * S, projections);
}

MotionStatus JumpMap::follow(double* epsilon, std::uint64_t* projections) {
  State e(S);
  std::copy(epsilon, epsilon + S, e.begin());
  State rate(S);
  path_(e, rate, 0.0);
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    row_reference_[m] = drivetrain_.solver().rowLengthSquared(m);
  }
  const MotionStatus status = straight_ ? stepStraight(e, rate) : integrate(e, rate, projections);
  if (status.ok()) std::copy_n(e.data(), S, epsilon);
  return status;
}

MotionStatus JumpMap::stepStraight(State& e, const State& rate) {
  for (int i = 0; i < S; ++i) {
    if (!std::isfinite(rate[i])) return explain(e, 0.0);
    e[i] += rate[i];
  }
  return {};
}

MotionStatus JumpMap::integrate(State& e, State& rate, std::uint64_t* projections) {
  constexpr int kMaxSteps = 100000;
  StepControl control(PathStepper::kErrorOrder);
  control.reset();
  double theta = 0.0;
  double h = 0.1;
  double usual = h;  // without kinks
  bool rejected = false;
  calcKinks(e, 0.0, kinks_);
  if (liesOnKink(e) && !hop(&theta, e, rate, kShortest, projections)) return explain(e, theta);
  // A step of length `beyond` from here passes a kink; shorter ones may not.
  double beyond = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kMaxSteps; ++step) {
    h = std::min(h, 1.0 - theta);
    State e_new(S);
    const double norm = tryStep(theta, e, rate, h, e_new, projections);
    if (norm <= 1.0 && passesKink(e_new, theta + h)) {
      // Bisect the distance to the kink; the last step before it has the length of a hop.
      beyond = h;
      const double resolution = std::max(kKinkResolution * tolerance_.relative, kShortest);
      if (beyond > resolution) {
        h = 0.5 * beyond;
        continue;
      }
      if (!hop(&theta, e, rate, beyond, projections)) return explain(e, theta);
      if (theta >= 1.0) return finish(e, theta);
      h = usual;
      beyond = std::numeric_limits<double>::infinity();
      rejected = false;
      control.reset();
      continue;
    }
    if (norm <= 1.0) {
      theta += h;
      e = e_new;
      if (theta >= 1.0) return finish(e, theta);
      calcKinks(e, theta, kinks_);
      path_(e, rate, theta);
      const double factor = control.growth(norm);
      beyond -= h;
      if (!(beyond > kShortest)) beyond = std::numeric_limits<double>::infinity();
      if (std::isfinite(beyond)) {
        h = std::max(0.5 * beyond, kShortest);
      } else {
        h *= rejected ? std::min(1.0, factor) : factor;
        usual = h;
      }
      rejected = false;
    } else {
      h *= control.shrink(norm);
      rejected = true;
      if (!(h > kShortest)) return explain(e, theta);
    }
  }
  return explain(e, theta);
}

double JumpMap::tryStep(double theta, const State& e, const State& rate, double h, State& e_new,
                        std::uint64_t* projections) {
  State moved(S);
  const double norm = stepper_->step(std::ref(path_), StepNode(theta, e, rate), h, e_new);
  if (!(norm <= 1.0)) return norm;
  const auto projected = projectAccelerations(drivetrain_, path_.at(theta + h, e_new.data()),
                                              e_new.data(), moved.data(), projections);
  // The projection's correction is a second, independent measure of the error.
  return projected == ProjectionResult::kConverged
             ? worseOf(norm, calcErrorNorm(moved, e, e_new, tolerance_))
             : std::numeric_limits<double>::quiet_NaN();
}

MotionStatus JumpMap::finish(const State& e, double theta) {
  if (drivetrain_.hasAccelerationRows() && !consistency_.isConsistent(path_.at(theta, e.data()))) {
    return explain(e, theta);
  }
  return {};
}

void JumpMap::calcKinks(const State& e, double theta, double* values) {
  const auto& kinks = drivetrain_.kinks();
  if (kinks.empty()) return;
  const StateView state = path_.at(theta, e.data());
  for (std::size_t j = 0; j < kinks.size(); ++j) values[j] = kinks[j]->calcResidual(state);
}

bool JumpMap::passesKink(const State& e_new, double theta) {
  double values[kMostKinks];
  calcKinks(e_new, theta, values);
  for (std::size_t j = 0; j < drivetrain_.kinks().size(); ++j) {
    if ((kinks_[j] > 0.0 && values[j] < 0.0) || (kinks_[j] < 0.0 && values[j] > 0.0)) return true;
  }
  return false;
}

bool JumpMap::liesOnKink(const State& e) const {
  double size = 0.0;
  for (double value : e) size = std::max(size, std::abs(value));
  for (std::size_t j = 0; j < drivetrain_.kinks().size(); ++j) {
    if (std::abs(kinks_[j]) <= 16.0 * std::numeric_limits<double>::epsilon() * size) return true;
  }
  return false;
}

bool JumpMap::hop(double* theta, State& e, State& rate, double length, std::uint64_t* projections) {
  const std::size_t count = drivetrain_.kinks().size();
  const double end = std::min(1.0, *theta + length);
  double before[kMostKinks];
  double beyond[kMostKinks];
  std::copy_n(kinks_, count, before);
  State there = e;
  double stretch = 2.0 * length;
  for (int n = 0; n < 10; ++n, stretch *= 4.0) {
    // The step is extended until rounding does not hide the side on which it ends.
    for (int i = 0; i < S; ++i) there[i] = e[i] + stretch * rate[i];
    if (!liesOnKinkAt(there, end)) break;
  }
  std::copy_n(kinks_, count, beyond);
  State rate_there(S);
  path_(there, rate_there, end);
  // The rate before the kink holds up to it, the rate behind it from there on.
  double part = 1.0;
  for (std::size_t j = 0; j < count; ++j) {
    if (before[j] * beyond[j] <= 0.0 && before[j] != beyond[j]) {
      part = std::min(part, before[j] / (before[j] - beyond[j]));
    }
  }
  for (int i = 0; i < S; ++i) {
    if (!std::isfinite(rate_there[i])) return false;
    there[i] = e[i] + stretch * (part * rate[i] + (1.0 - part) * rate_there[i]);
  }
  State moved(S);
  if (projectAccelerations(drivetrain_, path_.at(end, there.data()), there.data(), moved.data(),
                           projections) != ProjectionResult::kConverged) {
    return false;
  }
  path_(there, rate_there, end);
  double ahead_values[kMostKinks];
  State ahead(S);
  double size = 0.0;
  double speed = 0.0;
  for (int i = 0; i < S; ++i) {
    if (!std::isfinite(rate_there[i])) return false;
    size = std::max(size, std::abs(there[i] - e[i]));
    speed = std::max(speed, std::abs(rate_there[i]));
  }
  calcKinks(there, end, kinks_);
  for (std::size_t j = 0; j < count; ++j) {
    if (kinks_[j] * beyond[j] < 0.0) return false;
  }
  if (speed > 0.0) {
    for (int i = 0; i < S; ++i) ahead[i] = there[i] + 4.0 * size / speed * rate_there[i];
    calcKinks(ahead, end, ahead_values);
    for (std::size_t j = 0; j < count; ++j) {
      if (kinks_[j] * ahead_values[j] < 0.0) return false;
    }
  }
  *theta = end;
  e = there;
  rate = rate_there;
  return true;
}

bool JumpMap::liesOnKinkAt(const State& e, double theta) {
  calcKinks(e, theta, kinks_);
  return liesOnKink(e);
}

MotionStatus JumpMap::explain(const State& e, double theta) {
  MotionStatus status;
  const StateView state = path_.at(theta, e.data());
  if (drivetrain_.findNonFinite(state, &status.torque, &status.constraint)) {
    status.reason = StopReason::kNonFiniteValue;
    return status;
  }
  status.reason = StopReason::kJumpFailed;
  State rate(S);
  const double nothing[kMaxInputs > kMaxShafts ? kMaxInputs : kMaxShafts] = {};
  if (!drivetrain_.calcJumpRate(state, nothing, nothing, rate.data())) {
    status.reason = StopReason::kSingularConstraint;
    status.constraint = drivetrain_.solver().singularRow();
    status.measure = drivetrain_.solver().singularMeasure();
    return status;
  }
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    const double left = std::sqrt(drivetrain_.solver().rowLengthSquared(m) / row_reference_[m]);
    if (left < kNearlyVanished) {
      status.reason = StopReason::kSingularConstraint;
      status.constraint = m;
      status.measure = left;
    }
  }
  return status;
}

}  // namespace variator_sim
