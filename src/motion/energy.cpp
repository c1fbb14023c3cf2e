#include "motion/energy.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

void EnergyMeter::begin(const StepNode& start, const Row* rows) {
  start_kinetic_ = calcKinetic(start.x);
  applied_ = applied_before_ = throughput_ = throughput_before_ = 0.0;
  doubt_ = doubt_before_ = {};
  has_turned_ = false;
  if (!is_watched_) return;
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) calcDirection(rows[m], directions_[m]);
}

EnergyAccount EnergyMeter::account() const {
  EnergyAccount account;
  account.start_kinetic = start_kinetic_;
  account.applied = applied_;
  account.throughput = throughput_;
  account.reactions = doubt_.reactions;
  account.doubt_since = doubt_.since;
  account.has_turned = has_turned_;
  std::copy_n(&directions_[0][0], kMaxRows * kMaxShafts, &account.directions[0][0]);
  return account;
}

void EnergyMeter::resume(const EnergyAccount& account, double time) {
  start_kinetic_ = account.start_kinetic;
  applied_ = applied_before_ = account.applied;
  throughput_ = throughput_before_ = account.throughput;
  doubt_ = {account.doubt_since, time, account.reactions, account.throughput};
  doubt_before_ = doubt_;
  has_turned_ = account.has_turned;
  std::copy_n(&account.directions[0][0], kMaxRows * kMaxShafts, &directions_[0][0]);
}

double EnergyMeter::calcAppliedAtRest(const StepNode& from, const State& x) {
  double Q[kMaxShafts];
  drivetrain_.calcTorque(view(from.time, from.x), Q);
  double work = 0.0;
  for (int i = 0; i < S; ++i) work += Q[i] * (x[i] - from.x[i]);
  return applied_ + work;
}

Energy EnergyMeter::calcEnergy(const Sample& sample, double applied) {
  Energy energy;
  energy.kinetic = drivetrain_.calcKineticEnergy(sample.angle, sample.velocity);
  energy.applied = applied;
  energy.reactions = energy.kinetic - start_kinetic_ - applied;
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

void EnergyMeter::notePassed(const StepNode& from, const SeriesNode* begin, const SeriesNode* end) {
  Power before = powerOf(from);
  double time = from.time;
  for (const SeriesNode* node = begin; node != end; ++node) {
    const double* const omega = node->x + S;
    const Power after = powerOf(node->torque, node->torque_rate, omega, omega + S);
    const double h = node->end - time;
    addStep(h, before, after, estimateWork(h, before, after));
    if (is_watched_) {
      if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(node->x, node->inertia);
      watch(node->end, node->x, node->C);
    }
    before = after;
    time = node->end;
  }
}

StateView EnergyMeter::view(double t, const State& x) {
  // Torques do not read accelerations.
  return drivetrain_.view(t, x.data(), x.data() + S, x.data() + S);
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

bool EnergyMeter::haveRowsTurned(const Row* rows) const {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    double direction[kMaxShafts];
    calcDirection(rows[m], direction);
    double cosine = 0.0;
    for (int i = 0; i < S; ++i) cosine += direction[i] * directions_[m][i];
    if (1.0 - cosine * cosine > kTurned * kTurned) return true;
  }
  return false;
}

void EnergyMeter::judge(double time, const double* x) {
  doubt_.time = drivetrain_.origin() + time;
  doubt_.reactions = drivetrain_.calcKineticEnergy(x, x + S) - start_kinetic_ - applied_;
  doubt_.throughput = throughput_;
  if (doubt_.since >= 0.0 || !has_turned_ || !doubt_.isShareLarge()) return;
  // What the tolerance makes of T is nobody's energy.
  double uncertain = 0.0;
  for (int i = 0; i < S; ++i) {
    const double omega = x[S + i];
    uncertain += drivetrain_.inertia().entry(i, i) * std::abs(omega) * tolerance_.of(omega);
  }
  if (std::abs(doubt_.reactions) > kCertain * uncertain) doubt_.since = doubt_.time;
}

}  // namespace variator_sim
