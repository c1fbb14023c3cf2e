#include "integrate/step_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "motion/time_origin.h"

namespace variator_sim {

void StepChecks::reset() {
  largest_acceleration_.fill(0.0);
  largest_torque_.fill(0.0);
}

double StepChecks::stepAndProject(Stepper& stepper, const StepNode& from, double end, double h,
                                  State& x) {
  const double norm = stepper.step(system_, from, h, x);
  if (!isGood(norm)) return norm;
  return worseOf(norm, projectEnd(stepper, from.x, end, h, norm, x));
}

double StepChecks::projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                              double estimate, State& x) {
  if (!x.isFinite()) return std::numeric_limits<double>::quiet_NaN();
  if (drivetrain_.constraintCount() == 0) return 0.0;
  State moved(x.size());
  const ProjectionResult result =
      stepper.isImplicit() ? projectStiffly(stepper, end, h, x, moved, &statistics_.projections)
                           : system_.project(end, x, moved, &statistics_.projections);
  if (result != ProjectionResult::kConverged) return std::numeric_limits<double>::quiet_NaN();
  // Stages that hold psi = 0 themselves leave rounding to the projection, no error.
  if (stepper.isImplicit() && system_.keepsConstraintsInStages()) return 0.0;
  const double norm = calcErrorNorm(moved, x_old, x, tolerance_);
  if (norm <= kSteadyNorm || norm <= estimate) return norm;
  return discountRounding(end, x_old, x, moved);
}

double StepChecks::discountRounding(double end, const State& x_old, const State& x,
                                    const State& moved) {
  State rounding(x.size());
  const double largest = calcRounding(end, x, rounding);
  State left = moved;
  for (int n = 0; n < x.size(); ++n) left[n] = std::max(0.0, moved[n] - rounding[n]);
  const double norm = calcErrorNorm(left, x_old, x, tolerance_);
  if (norm <= 1.0) noteRounding(largest);
  return norm;
}

double StepChecks::calcRounding(double end, const State& x, State& rounding) {
  double velocity[kMaxShafts];
  double acceleration[kMaxShafts];
  drivetrain_.calcProjectionRounding(system_.view(end, x), velocity, acceleration);
  system_.addReactionRounding(end, x, acceleration);
  double largest = 0.0;
  const auto note = [&](int n, double size) {
    rounding[n] = size;
    largest = std::max(largest, size / tolerance_.of(x[n]));
  };
  for (int i = 0; i < S; ++i) {
    note(S + i, velocity[i]);
    if (integrates_torque_) note(x.size() - S + i, acceleration[i]);
  }
  return largest;
}

void StepChecks::noteRounding(double largest) {
  if (largest > 1.0) {
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, largest);
  }
}

void StepChecks::noteProjectionRounding(double end, const State& x) {
  State rounding(x.size());
  noteRounding(calcRounding(end, x, rounding));
}

ProjectionResult StepChecks::projectStiffly(const Stepper& stepper, double end, double h, State& x,
                                            State& moved, std::uint64_t* iterations) {
  State slope(x.size());
  stepper.calcSlope(1.0, end - (end - h), slope);
  return system_.projectStiffly(end, h, slope, x, moved, iterations);
}

void StepChecks::noteTorque(StepNode& node) {
  calcTorque(node);
  noteTorqueRate(node);
  if (!integrates_torque_) {
    drivetrain_.calcTorqueRate(viewDerived(node), node.torque_rate.data());
  }
}

void StepChecks::noteTorqueRate(StepNode& node) {
  if (integrates_torque_) {
    node.torque_rate.assign(system_.torqueRate());
  }
}

void StepChecks::noteAccelerations(const StepNode& node) {
  if (!integrates_torque_) {
    const double memory = tolerance_.absolute > 0.0 ? 0.9 : 1.0;
    for (int i = 0; i < S; ++i) {
      double& largest = largest_acceleration_[i];
      largest = std::max(memory * largest, std::abs(node.dxdt[S + i]));
    }
  }
}

double StepChecks::checkTorque(Stepper& stepper, const StepNode& from, StepNode& to) {
  if (integrates_torque_) {
    if (!drivetrain_.hasTorques()) return 0.0;
    noteTorqueSize(from.torque.data());
    calcTorque(to);
    TorqueGain gain(S);
    stepper.calcTorqueGain(system_, from, to, gain);
    const double strict = judgeTorque(gain, from, to, nothing_, nothing_);
    if (strict <= 1.0 || strict != strict) return strict;
    ShaftVector uncertain(S);
    ShaftVector answer(S);
    calcAnswers(from, to, uncertain, answer);
    return judgeTorque(gain, from, to, uncertain, answer);
  }
  return 0.0;
}

bool StepChecks::isTorqueFollowed(const Stepper& stepper, const StepNode& from, StepNode& to) {
  if (!integrates_torque_) {
    if (!drivetrain_.hasTorques() || are_steps_fixed_) return true;
    noteTorque(to);
    if (stepper.isImplicit()) return true;
    const double h = to.time - from.time;
    for (int i = 0; i < S; ++i) {
      const double d = std::abs(to.torque[i] - from.torque[i] -
                                0.5 * h * (to.torque_rate[i] + from.torque_rate[i]));
      if (h * d <= kUnseen * inertiaOf(i) * tolerance_.of(to.x[S + i])) continue;
      const double steepest = std::max(std::abs(to.torque_rate[i]), std::abs(from.torque_rate[i]));
      if (d > 0.5 * h * steepest) return false;
    }
  }
  return true;
}

double StepChecks::checkAccelerations(const Stepper& stepper, const StepNode& from, double end,
                                      const State& x) {
  if (!integrates_torque_) {
    unattainable_ = 0.0;
    steepest_ = -1;
    const double h = end - from.time;
    const State& error = stepper.error();
    State here(x.size());
    system_(x, here, end);
    State beside(x.size());
    for (int n = 0; n < x.size(); ++n) beside[n] = x[n] + error[n];
    if (stepper.isImplicit() && system_.keepsConstraintsInStages()) {
      State moved(x.size());
      std::uint64_t iterations = 0;
      if (projectStiffly(stepper, end, h, beside, moved, &iterations) !=
          ProjectionResult::kConverged) {
        return std::numeric_limits<double>::quiet_NaN();
      }
    }
    round(x, beside);
    State change(x.size());
    calcChange(end, beside, here, change);
    double stability = 0.0;
    if (!stepper.isImplicit()) {
      if (isUnstable(h, x, beside, change)) stability = kUnstable;
    } else if (isOnSlowMotion(h, x, beside, change)) {
      stability = checkFirstSlope(stepper, from, end);
      // A step that is refused for it need not be judged further.
      if (!(stability <= 1.0)) return stability;
    }
    double norm = stability;
    for (int n = S; n < x.size(); ++n) {
      norm = worseOf(norm, kCaution * change[n] / tolerance_.of(here[n]));
    }
    if (norm <= 1.0) return norm;  // the usual case: rounding included
    State rounded = x;
    State uncertain(x.size());
    round(x, rounded);
    calcChange(end, rounded, here, uncertain);
    norm = stability;
    for (int n = S; n < x.size(); ++n) {
      const double part = kCaution * (change[n] - uncertain[n]) / tolerance_.of(here[n]);
      norm = worseOf(norm, part);
      const double largest = std::max(largest_acceleration_[n - S], std::abs(here[n]));
      unattainable_ = worseOf(unattainable_, uncertain[n] / tolerance_.of(largest));
    }
    if (unattainable_ > kAttainable) findSteepest(end, x, rounded, uncertain);
    return norm;
  }
  return 0.0;
}

void StepChecks::findSteepest(double end, const State& x, const State& rounded,
                              const State& uncertain) {
  const StateView here = drivetrain_.view(end, x.data(), x.data() + S, x.data() + S);
  StateView beside = here;
  beside.angle = rounded.data();
  beside.velocity = rounded.data() + S;
  ShaftVector size(S);
  double largest = 0.0;
  int steepest = 0;
  const auto& torques = system_.scene().torques;
  for (std::size_t j = 0; j < torques.size(); ++j) {
    double torque[kMaxShafts] = {};
    double moved[kMaxShafts] = {};
    torques[j]->addTorque(here, torque);
    torques[j]->addTorque(beside, moved);
    for (int i = 0; i < S; ++i) {
      size[i] += std::abs(torque[i]) / inertiaOf(i);
      const double change = std::abs(moved[i] - torque[i]) / inertiaOf(i);
      if (!(change > largest)) continue;
      largest = change;
      steepest = static_cast<int>(j);
    }
  }
  for (int i = 0; i < S; ++i) {
    if (!(uncertain[S + i] <= kAttainable * tolerance_.of(size[i]))) steepest_ = steepest;
  }
}

void StepChecks::calcTorque(StepNode& node) {
  if (integrates_torque_) {
    drivetrain_.calcTorque(system_.view(node.time, node.x), node.torque.data());
  } else {
    drivetrain_.calcTorque(viewDerived(node), node.torque.data());
  }
}

double StepChecks::calcAllowed(const StepNode& from, const StepNode& to, int i) const {
  const double torque = std::max(std::abs(to.torque[i]), std::abs(from.torque[i]));
  const double epsilon = std::max(std::abs(to.x[2 * S + i]), std::abs(from.x[2 * S + i]));
  return std::max(inertiaOf(i) * tolerance_.of(epsilon), tolerance_.relative * torque);
}

void StepChecks::calcAnswers(const StepNode& from, const StepNode& to, ShaftVector& uncertain,
                             ShaftVector& answer) {
  constexpr double kUlps = 16.0 * std::numeric_limits<double>::epsilon();
  State shifted = to.x;
  double torque[kMaxShafts];
  const auto addChange = [&](int n, double shift, ShaftVector& sum) {
    shifted[n] = to.x[n] + shift;
    drivetrain_.calcTorque(system_.view(to.time, shifted), torque);
    shifted[n] = to.x[n];
    for (int i = 0; i < S; ++i) sum[i] += std::abs(torque[i] - to.torque[i]);
  };
  const double h = to.time - from.time;
  constexpr double kNear = 0.125;
  ShaftVector near(S);  // what a part of the allowed errors makes of Q
  for (int n = 0; n < 2 * S; ++n) addChange(n, kUlps * to.x[n], uncertain);
  addTimeNoise(to, uncertain);
  for (int i = 0; i < S; ++i) {
    const double shift = h * calcAllowed(from, to, i) / inertiaOf(i);
    addChange(S + i, shift, answer);
    addChange(S + i, kNear * shift, near);
  }
  // A layer that is narrower than that leaves Q unknown, and d an error that stays.
  for (int i = 0; i < S; ++i) {
    if (near[i] > 1.5 * kNear * answer[i]) answer[i] = 0.0;
  }
  system_.view(to.time, to.x);
}

void StepChecks::addTimeNoise(const StepNode& to, ShaftVector& uncertain) {
  if (!drivetrain_.torquesReadTime()) return;
  constexpr double kMost = 1e-6;  // of the largest Q
  double middle[kMaxShafts];
  double before[kMaxShafts];
  double after[kMaxShafts];
  ShaftVector bends(S);
  ShaftVector noise(S);  // the least bend of any span
  noise.fill(std::numeric_limits<double>::infinity());
  const auto torqueAt = [&](double time, double* torque) {
    drivetrain_.calcTorque(system_.view(time, to.x), torque);
  };
  torqueAt(to.time, middle);
  int spans = 0;
  const double resolved = 64.0 * resolutionOf(drivetrain_.origin() + to.time);
  for (const double span : {1e-7, 1e-9, 1e-11, 1e-13}) {  // s
    if (spans > 0 && span < resolved) break;
    ++spans;
    bends.fill(0.0);
    for (const double part : {1.0, 0.618, 0.382, 0.236}) {
      torqueAt(to.time - part * span, before);
      torqueAt(to.time + part * span, after);
      for (int i = 0; i < S; ++i) {
        bends[i] = std::max(bends[i], std::abs(after[i] - 2.0 * middle[i] + before[i]));
      }
    }
    for (int i = 0; i < S; ++i) {
      noise[i] = std::min(noise[i], bends[i]);
      uncertain[i] = std::max(uncertain[i], std::min(2.0 * bends[i], kMost * largest_torque_[i]));
    }
  }
  if (spans < 2) return;
  for (int i = 0; i < S; ++i) uncertain[i] = std::max(uncertain[i], 2.0 * noise[i]);
}

double StepChecks::judgeTorque(const TorqueGain& gain, const StepNode& from, const StepNode& to,
                               const ShaftVector& uncertain, const ShaftVector& answer) const {
  const double h = to.time - from.time;
  // A law that reads the time itself knows it to a rounding.
  const double origin = drivetrain_.torquesReadTime() ? std::abs(drivetrain_.origin()) : 0.0;
  double largest = 0.0;
  for (int i = 0; i < S; ++i) {
    const double size = std::max(std::abs(to.torque[i]), std::abs(from.torque[i]));
    const double rounding = 32.0 * std::numeric_limits<double>::epsilon() *
                            (size + (h + origin + std::abs(to.time)) * gain.largest_rate[i]);
    const double d = std::abs(to.torque[i] - from.torque[i] - gain.change[i]);
    const double part = (d - rounding - uncertain[i]) / (calcAllowed(from, to, i) + answer[i]);
    largest = worseOf(largest, part);
  }
  return largest;
}

void StepChecks::round(const State& x, State& y) {
  constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
  constexpr double kGolden = 0.6180339887498949;
  double turn = 0.0;  // n kGolden modulo 1
  for (int n = 0; n < y.size(); ++n) {
    turn += turn + kGolden < 1.0 ? kGolden : kGolden - 1.0;
    y[n] += (n % 2 == 0 ? kUlps : -kUlps) * (0.5 + turn) * x[n];
  }
}

void StepChecks::calcChange(double t, const State& y, const State& here, State& change) {
  system_(y, change, t);
  for (int n = S; n < y.size(); ++n) change[n] = std::abs(change[n] - here[n]);
}

bool StepChecks::isUnstable(double h, const State& x, const State& beside,
                            const State& change) const {
  double moved = 0.0;
  double answer = 0.0;
  for (int n = 0; n < S; ++n) {
    moved = std::max({moved, std::abs(beside[n] - x[n]) / h, std::abs(beside[S + n] - x[S + n])});
    answer = std::max(answer, h * change[S + n]);
  }
  return answer > kMostStable * moved;
}

bool StepChecks::isOnSlowMotion(double h, const State& x, const State& beside,
                                const State& change) const {
  double moved = 0.0;
  double answer = 0.0;
  for (int n = S; n < 2 * S; ++n) {
    moved = std::max(moved, std::abs(beside[n] - x[n]));
    answer = std::max(answer, h * change[n]);
  }
  return answer > kSlow * moved;
}

double StepChecks::checkFirstSlope(const Stepper& stepper, const StepNode& from, double end) const {
  State slope(from.x.size());
  stepper.calcSlope(0.0, end - from.time, slope);
  double norm = 0.0;
  for (int n = S; n < slope.size(); ++n) {
    const double part = std::abs(slope[n] - from.dxdt[n]) / tolerance_.of(from.dxdt[n]);
    norm = worseOf(norm, part / kFirstSlope);
  }
  return norm;
}

}  // namespace variator_sim
