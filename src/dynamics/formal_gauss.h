/// The classical Gauss principle with constraints of order 3, equation [18]: the derivative of
/// J epsilon + n - Q = C^T lambda gives the jerk, and x = (phi, omega, epsilon).
#pragma once

#include "dynamics/acceleration_system.h"

namespace variator_sim {

/// With constraints of order 3, equation [18]: J epsilon + n - Q = C^T lambda differentiated,
/// beside C eta + c0 = 0. It minimises nothing, but users may want to compare it.
class FormalGauss final : public AccelerationSystem {
 public:
  explicit FormalGauss(const Scene& scene, const Shortcuts& shortcuts = {},
                       const PrincipleSystem* like = nullptr)
      : AccelerationSystem(scene, shortcuts, like, true) {
    derive_ = deriveOf<FormalGauss>;
  }

  void derive(const State& x, State& dxdt, double t);

  void calcLinearization(double t, const State& x, Linearization& linearization) override {
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
  }

  ProjectionResult projectStiffly(double t, double /*h*/, const State& /*slope*/, State& x,
                                  State& moved, std::uint64_t* iterations) override {
    return project(t, x, moved, iterations);
  }
  /// Projects orders 1 and 2, then corrects the reaction's drift from range(C^T).
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) override;

  void addReactionRounding(double t, const State& x, double* acceleration) override;

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) override;
  InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                       double* nearest, bool* velocities_at_fault) override;

  bool calcSample(double t, const State& x, Sample* sample) override;

 private:
  bool calcJerk(const StateView& state, double* torque, double* reaction, double* lambda,
                double* eta, double* reaction_rate);

  /// Accepts accelerations whose reaction lies in range(C^T), or moves them there.
  InitialResult acceptReaction(double t, bool may_move, State& x, double* nearest);

  /// epsilon = J^-1 (Q - n + C^T lambda) with the lambda of the part of R in range(C^T).
  bool calcReactionInRange(const StateView& state, double* epsilon, double* moved);
};

}  // namespace variator_sim
