/// The system of the generalized Gauss principle: x = (phi, omega, epsilon), x' = (omega, epsilon,
/// eta) with the jerk whose reaction changes least.
#pragma once

#include "dynamics/acceleration_system.h"

namespace variator_sim {

/// See AccelerationSystem for what it has beside its derivative and its sample.
class GeneralizedGauss final : public AccelerationSystem {
 public:
  explicit GeneralizedGauss(const Scene& scene, const Shortcuts& shortcuts = {});

  void operator()(const State& x, State& dxdt, double t) override { derive_(*this, x, dxdt, t); }
  bool isSpecialized() const override { return has_one_row_; }

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
  /// x' by code for a number of shafts that is known when compiled.
  template <int kShafts>
  static void derive(GeneralizedGauss& self, const State& x, State& dxdt, double t);
  using Derive = void (*)(GeneralizedGauss& self, const State& x, State& dxdt, double t);
  static Derive chooseDerive(int shafts);
  /// eta and Lambda. False, and eta NaN, where C has lost rank. `shafts`: see ConstraintSolver.
  template <class Count>
  bool calcJerk(Count shafts, const StateView& state, double* eta, double* Lambda);

  const Derive derive_;
  const bool has_one_row_;  // and two shafts, and a constant diagonal inertia: most scenes
};

}  // namespace variator_sim
