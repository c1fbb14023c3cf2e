/// The system of the generalized Gauss principle: x = (phi, omega, epsilon), x' = (omega, epsilon,
/// eta) with the jerk whose reaction changes least.
#pragma once

#include "dynamics/acceleration_system.h"

namespace variator_sim {

/// Adds the derivative and the sample to AccelerationSystem.
class GeneralizedGauss final : public AccelerationSystem {
 public:
  explicit GeneralizedGauss(const Scene& scene, const Shortcuts& shortcuts = {},
                            const PrincipleSystem* like = nullptr);

  bool isSpecialized() const override { return derive_ == deriveOneRow; }

  /// Exact where the inertia is constant.
  void calcLinearization(double t, const State& x, Linearization& linearization) override;

  /// See Drivetrain::calcStageResidual.
  bool keepsConstraintsInStages() const override {
    return drivetrain_.canKeepConstraintsInStages();
  }
  void calcStageResidual(double t, const State& x, const double* eta,
                         const Linearization& linearization, double* residual) override;
  void calcStageLinearization(double t, const State& x, const State& dxdt,
                              Linearization& linearization) override;

  bool calcSample(double t, const State& x, Sample* sample) override;

 private:
  /// x' by code for a number of shafts known at compile time.
  template <int kShafts>
  static void derive(System& self, const State& x, State& dxdt, double t);
  /// The same for two shafts with a constant diagonal inertia and one constraint: most scenes.
  static void deriveOneRow(System& self, const State& x, State& dxdt, double t);
  Derive chooseDerive(const Shortcuts& shortcuts) const;
  /// Computes eta and Lambda; false, and eta NaN, if C has lost rank. `shafts`: see
  /// ConstraintSolver.
  template <class Count>
  bool calcJerk(Count shafts, const StateView& state, double* eta, double* Lambda);
};

}  // namespace variator_sim
