#include "motion/energy.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {
namespace {

constexpr int kHalvings = 4;

}  // namespace

EnergyMeter::EnergyMeter(Integrator& integrator, System& system)
    : S(system.shafts()),
      integrator_(integrator),
      drivetrain_(system.drivetrain()),
      tolerance_{system.scene().solver.absolute_tolerance,
                 system.scene().solver.relative_tolerance},
      balance_(system.scene(), drivetrain_.hasConstantJacobian(), kMaxShafts) {}

void EnergyMeter::begin() {
  const State& x = integrator_.stepEnd().x;
  balance_.begin(drivetrain_.calcKineticEnergy(x.data(), x.data() + S));
  if (balance_.isWatched()) balance_.noteDirections(integrator_.rows()[0], x.data());
}

void EnergyMeter::noteStep() {
  const StepNode& from = integrator_.stepStart();
  const StepNode& to = integrator_.stepEnd();
  const double h = to.time - from.time;
  const Power begin = powerOf(from);
  const Power end = powerOf(to);
  const double work = is_tracked_ ? calcWork(1.0) : estimateWork(h, begin, end);
  balance_.noteStep(drivetrain_.origin() + to.time, work, 0.5 * h * (begin.through + end.through),
                    to.x.data(), to.x.data() + S, integrator_.rows()[0]);
}

void EnergyMeter::cut(const StepNode& present) {
  const StepNode& from = integrator_.stepStart();
  const double h = present.time - from.time;
  StepNode end = present;
  calcTorque(end.time, end.x, end.torque.data());
  const Power begin = powerOf(from);
  const Power power = powerOf(end);
  double work = 0.0;
  if (is_tracked_) {
    work = calcWork(h / (integrator_.stepEnd().time - from.time));
  } else {
    // The rate at the end is not known for order 3.
    const double bend = h * begin.rate - (power.value - begin.value);
    const bool is_bend_small = std::abs(bend) <= std::abs(begin.value) + std::abs(power.value);
    work = 0.5 * h * (begin.value + power.value) + (is_bend_small ? h / 6.0 * bend : 0.0);
  }
  balance_.cut(drivetrain_.origin() + end.time, balance_.appliedBefore() + work,
               balance_.throughputBefore() + 0.5 * h * (begin.through + power.through),
               end.x.data(), end.x.data() + S);
}

double EnergyMeter::calcApplied(double now) const {
  if (!integrator_.inside().contains(now)) return balance_.account().applied;
  const double begin = integrator_.stepStart().time;
  return balance_.appliedBefore() + calcWork((now - begin) / (integrator_.stepEnd().time - begin));
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
  return balance_.report(sample, drivetrain_.calcKineticEnergy(sample.angle, sample.velocity),
                         calcApplied(now));
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

double EnergyMeter::estimateWork(double h, const Power& begin, const Power& end) {
  const double correction = h / 6.0 * (begin.rate - end.rate);
  const double largest = std::max(std::abs(begin.value), std::abs(end.value));
  const double sum = begin.value + end.value;
  return 0.5 * h * (std::abs(correction) <= largest ? sum + correction : sum);
}

}  // namespace variator_sim
