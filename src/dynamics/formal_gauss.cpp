#include "dynamics/formal_gauss.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

void FormalGauss::derive(const State& x, State& dxdt, double t) {
  drivetrain_.countRightHandSide();
  copyRates(x, dxdt);
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double lambda[kMaxRows] = {};
  double reaction_rate[kMaxShafts];
  calcJerk(view(t, x), torque, reaction, lambda, &dxdt[2 * S], reaction_rate);
}

ProjectionResult FormalGauss::project(double t, State& x, State& moved, std::uint64_t* iterations) {
  const ProjectionResult result = AccelerationSystem::project(t, x, moved, iterations);
  if (result != ProjectionResult::kConverged) return result;
  const StateView state = view(t, x);
  double* epsilon = x.data() + 2 * S;
  if (!calcReactionInRange(state, epsilon, moved.data() + 2 * S)) {
    return ProjectionResult::kSingular;
  }
  return ProjectionResult::kConverged;
}

// epsilon follows Q: with a torque that rises by 1e8 N m/s, one ulp of the time is 1e-8 N m.
void FormalGauss::addReactionRounding(double t, const State& x, double* acceleration) {
  constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
  const StateView state = view(t, x);
  double torque[kMaxShafts];
  double lambda[kMaxRows] = {};
  double rest[kMaxShafts];
  double c0[kMaxRows] = {};
  if (!drivetrain_.calcRows(state, c0)) return;
  drivetrain_.calcTorqueRate(state, torque);
  for (int i = 0; i < S; ++i) torque[i] *= kUlps * state.time;
  drivetrain_.calcOutOfRange(torque, lambda, rest);
  for (int i = 0; i < S; ++i) acceleration[i] += std::abs(rest[i]);
}

InitialResult FormalGauss::start(State& x, double* nearest, bool* velocities_at_fault) {
  const InitialResult result = AccelerationSystem::start(x, nearest, velocities_at_fault);
  if (result != InitialResult::kConsistent || scene_.initial.acceleration.empty()) return result;
  return acceptReaction(0.0, scene_.initial.project, x, nearest);
}

InitialResult FormalGauss::accept(double t, bool may_move, bool are_given, State& x,
                                  double* epsilon, double* nearest, bool* velocities_at_fault) {
  const InitialResult result =
      AccelerationSystem::accept(t, may_move, are_given, x, epsilon, nearest, velocities_at_fault);
  if (result != InitialResult::kConsistent || !are_given) return result;
  const InitialResult of_reaction = acceptReaction(t, may_move, x, nearest);
  std::copy_n(x.data() + 2 * S, S, epsilon);
  return of_reaction;
}

InitialResult FormalGauss::acceptReaction(double t, bool may_move, State& x, double* nearest) {
  const StateView state = view(t, x);
  double* epsilon = x.data() + 2 * S;
  double moved[kMaxShafts] = {};
  if (!calcReactionInRange(state, epsilon, moved)) return InitialResult::kSingular;
  std::copy(epsilon, epsilon + S, nearest);
  for (int i = 0; i < S; ++i) {
    if (!(std::abs(moved[i]) <= 1e-9 * std::max(1.0, std::abs(epsilon[i]))) && !may_move) {
      return InitialResult::kInconsistent;
    }
  }
  return InitialResult::kConsistent;
}

bool FormalGauss::calcSample(double t, const State& x, Sample* sample) {
  const StateView state = view(t, x);
  copyState(t, x, sample);
  double eta[kMaxShafts];
  const bool regular = calcJerk(state, sample->applied_torque, sample->reaction_torque,
                                sample->multiplier, eta, sample->reaction_torque_rate);
  calcResiduals(state, eta, sample);
  return regular;
}

bool FormalGauss::calcJerk(const StateView& state, double* torque, double* reaction, double* lambda,
                           double* eta, double* reaction_rate) {
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  double c0[kMaxRows] = {};
  if (drivetrain_.calcRows(state, c0)) {
    drivetrain_.calcMultipliers(reaction, lambda);
    if (drivetrain_.calcFormalJerk(state, lambda, eta, reaction_rate)) return true;
  }
  std::fill(eta, eta + S, std::numeric_limits<double>::quiet_NaN());
  return false;
}

bool FormalGauss::calcReactionInRange(const StateView& state, double* epsilon, double* moved) {
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double lambda[kMaxRows] = {};
  double c0[kMaxRows] = {};
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  if (!drivetrain_.calcRows(state, c0)) return false;
  double rest[kMaxShafts];
  drivetrain_.calcOutOfRange(reaction, lambda, rest);
  for (int i = 0; i < S; ++i) {
    moved[i] += std::abs(rest[i]);
    epsilon[i] += rest[i];
  }
  return true;
}

}  // namespace variator_sim
