/// The classical Gauss principle with constraints of order 3, equation [18]: the derivative of
/// J epsilon + n - Q = C^T lambda gives the jerk, and x = (phi, omega, epsilon).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "acceleration_system.h"

namespace variator_sim {

/// With constraints of order 3, equation [18]: J epsilon + n - Q = C^T lambda differentiated,
/// beside C eta + c0 = 0. The minimum of nothing, but what a user may want to compare.
class FormalGauss final : public AccelerationSystem {
 public:
  explicit FormalGauss(const Scene& scene) : AccelerationSystem(scene, true) {}

  void operator()(const State& x, State& dxdt, double t) override {
    drivetrain_.countRightHandSide();
    copyRates(x, dxdt);
    double torque[kMaxShafts];
    double reaction[kMaxShafts];
    double lambda[kMaxRows] = {};
    double reaction_rate[kMaxShafts];
    calcJerk(view(t, x), torque, reaction, lambda, &dxdt[2 * S], reaction_rate);
  }

  void calcLinearization(double t, const State& x, Linearization& linearization) override {
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
  }

  ProjectionResult projectStiffly(double t, double /*h*/, const State& /*slope*/, State& x,
                                  State& moved, std::uint64_t* iterations) override {
    return project(t, x, moved, iterations);
  }
  /// Orders 1 and 2 as ever; then the reaction back into range(C^T), from which it drifts.
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) override {
    const ProjectionResult result = AccelerationSystem::project(t, x, moved, iterations);
    if (result != ProjectionResult::kConverged) return result;
    const StateView state = view(t, x);
    double* epsilon = x.data() + 2 * S;
    if (!calcReactionInRange(state, epsilon, moved.data() + 2 * S)) {
      return ProjectionResult::kSingular;
    }
    return ProjectionResult::kConverged;
  }

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) override {
    const InitialResult result = AccelerationSystem::start(x, nearest, velocities_at_fault);
    if (result != InitialResult::kConsistent || scene_.initial.acceleration.empty()) return result;
    const StateView state = view(0.0, x);
    double* epsilon = x.data() + 2 * S;
    // The initial reaction must lie in range(C^T).
    double moved[kMaxShafts] = {};
    if (!calcReactionInRange(state, epsilon, moved)) return InitialResult::kSingular;
    std::copy(epsilon, epsilon + S, nearest);
    for (int i = 0; i < S; ++i) {
      if (!(moved[i] <= 1e-9 * std::max(1.0, std::abs(epsilon[i]))) && !scene_.initial.project) {
        return InitialResult::kInconsistent;
      }
    }
    return InitialResult::kConsistent;
  }

  bool calcSample(double t, const State& x, Sample* sample) override {
    const StateView state = view(t, x);
    copyState(t, x, sample);
    double eta[kMaxShafts];
    const bool regular = calcJerk(state, sample->applied_torque, sample->reaction_torque,
                                  sample->multiplier, eta, sample->reaction_torque_rate);
    calcResiduals(state, eta, sample);
    return regular;
  }

 private:
  bool calcJerk(const StateView& state, double* torque, double* reaction, double* lambda,
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

  /// epsilon = J^-1 (Q - n + C^T lambda) with the lambda of the part of R in range(C^T).
  bool calcReactionInRange(const StateView& state, double* epsilon, double* moved) {
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
};

}  // namespace variator_sim
