#include "motion/energy.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {
namespace {

/// Angle, rad, from which on C counts as turned.
constexpr double kTurned = 0.01;
/// Factor above the tolerance's effect from which on an energy is certain.
constexpr double kCertain = 100.0;
constexpr int kHalvings = 4;

}  // namespace

EnergyMeter::EnergyMeter(Integrator& integrator, System& system)
    : S(system.shafts()),
      integrator_(integrator),
      drivetrain_(system.drivetrain()),
      tolerance_{system.scene().solver.absolute_tolerance,
                 system.scene().solver.relative_tolerance},
      is_watched_(system.scene().principle == Principle::kGeneralizedGauss &&
                  !drivetrain_.hasConstantJacobian() && drivetrain_.constraintCount() > 0) {}

void EnergyMeter::begin() {
  const State& x = integrator_.stepEnd().x;
  resume({}, 0.0);
  account_.start_kinetic = drivetrain_.calcKineticEnergy(x.data(), x.data() + S);
  for (int m = 0; m < drivetrain_.constraintCount() && is_watched_; ++m) {
    calcDirection(integrator_.rows()[m], account_.directions[m]);
  }
}

void EnergyMeter::resume(const EnergyAccount& account, double time) {
  account_ = account;
  judged_at_ = time;
  applied_before_ = account.applied;
  before_ = doubtAtFront();
}

void EnergyMeter::noteStep() {
  const StepNode& from = integrator_.stepStart();
  const StepNode& to = integrator_.stepEnd();
  const double h = to.time - from.time;
  const Power begin = powerOf(from);
  const Power end = powerOf(to);
  applied_before_ = account_.applied;
  before_ = doubtAtFront();
  addStep(h, begin, end, is_tracked_ ? calcWork(1.0) : estimateWork(h, begin, end));
  if (is_watched_) watch(to.time, to.x.data(), integrator_.rows());
}

void EnergyMeter::cut(const StepNode& present) {
  const StepNode& from = integrator_.stepStart();
  const double h = present.time - from.time;
  StepNode end = present;
  calcTorque(end.time, end.x, end.torque.data());
  const Power begin = powerOf(from);
  const Power power = powerOf(end);
  account_.throughput = before_.throughput + 0.5 * h * (begin.through + power.through);
  if (is_tracked_) {
    account_.applied = applied_before_ + calcWork(h / (integrator_.stepEnd().time - from.time));
  } else {
    // The rate at the end is not known for order 3.
    const double bend = h * begin.rate - (power.value - begin.value);
    const bool is_bend_small = std::abs(bend) <= std::abs(begin.value) + std::abs(power.value);
    account_.applied = applied_before_ + 0.5 * h * (begin.value + power.value) +
                       (is_bend_small ? h / 6.0 * bend : 0.0);
  }
  if (is_watched_) judge(present.time, present.x.data());
}

double EnergyMeter::calcApplied(double now) const {
  if (!integrator_.inside().contains(now)) return account_.applied;
  const double begin = integrator_.stepStart().time;
  return applied_before_ + calcWork((now - begin) / (integrator_.stepEnd().time - begin));
}

double EnergyMeter::calcWork(double part) const {
  const StepNode& from = integrator_.stepStart();
  const double h = integrator_.stepEnd().time - from.time;
  const auto power = [&](double theta) {
    State x(from.x.size());
    integrator_.inside().calcPart(theta, x);
    double Q[kMaxShafts];
    calcTorque(from.time + theta * h, x, Q);
    double sum = 0.0;
    for (int i = 0; i < S; ++i) sum += Q[i] * x[S + i];
    return sum;
  };
  return h * integrate(power, 0.0, part, std::max(tolerance_.relative, 1e-13), kHalvings);
}

Energy EnergyMeter::calcEnergy(const Sample& sample, double now) {
  Energy energy;
  energy.applied = calcApplied(now);
  energy.kinetic = drivetrain_.calcKineticEnergy(sample.angle, sample.velocity);
  energy.reactions = energy.kinetic - account_.start_kinetic - energy.applied;
  for (int i = 0; i < S; ++i) {
    energy.applied_power += sample.applied_torque[i] * sample.velocity[i];
    energy.reaction_power += sample.reaction_torque[i] * sample.velocity[i];
  }
  return energy;
}

EnergyMeter::Power EnergyMeter::powerOf(const double* torque, const double* torque_rate,
                                        const double* omega, const double* epsilon) const {
  Power power;
  for (int i = 0; i < S; ++i) {
    const double part = torque[i] * omega[i];
    power.value += part;
    power.through += std::abs(part);
    power.rate += torque_rate[i] * omega[i] + torque[i] * epsilon[i];
  }
  return power;
}

void EnergyMeter::calcTorque(double t, const State& x, double* Q) const {
  // Torques do not read accelerations.
  drivetrain_.calcTorque(drivetrain_.view(t, x.data(), x.data() + S, x.data() + S), Q);
}

void EnergyMeter::addStep(double h, const Power& begin, const Power& end, double work) {
  account_.throughput += 0.5 * h * (begin.through + end.through);
  account_.applied += work;
}

double EnergyMeter::estimateWork(double h, const Power& begin, const Power& end) {
  const double correction = h / 6.0 * (begin.rate - end.rate);
  const double largest = std::max(std::abs(begin.value), std::abs(end.value));
  const double sum = begin.value + end.value;
  return 0.5 * h * (std::abs(correction) <= largest ? sum + correction : sum);
}

void EnergyMeter::calcDirection(const double* c, double* direction) const {
  double square = 0.0;
  for (int i = 0; i < S; ++i) {
    direction[i] = c[i] / std::sqrt(drivetrain_.inertia().entry(i, i));
    square += direction[i] * direction[i];
  }
  const double scale = 1.0 / std::sqrt(square);
  for (int i = 0; i < S; ++i) direction[i] *= scale;
}

bool EnergyMeter::haveRowsTurned(const double (*rows)[kMaxShafts]) const {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    double direction[kMaxShafts];
    calcDirection(rows[m], direction);
    double cosine = 0.0;
    for (int i = 0; i < S; ++i) cosine += direction[i] * account_.directions[m][i];
    if (1.0 - cosine * cosine > kTurned * kTurned) return true;
  }
  return false;
}

void EnergyMeter::judge(double time, const double* x) {
  judged_at_ = drivetrain_.origin() + time;
  account_.reactions =
      drivetrain_.calcKineticEnergy(x, x + S) - account_.start_kinetic - account_.applied;
  if (account_.doubt_since >= 0.0 || !account_.has_turned || !doubtAtFront().isShareLarge()) return;
  // The uncertainty of T at this tolerance.
  double uncertain = 0.0;
  for (int i = 0; i < S; ++i) {
    const double omega = x[S + i];
    uncertain += drivetrain_.inertia().entry(i, i) * std::abs(omega) * tolerance_.of(omega);
  }
  if (std::abs(account_.reactions) > kCertain * uncertain) account_.doubt_since = judged_at_;
}

}  // namespace variator_sim
