#pragma once

#include <optional>
#include <vector>

#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/torque.h"

namespace variator_sim {

/// A torque Q(t, phi, omega, u) on one shaft that the scene states as a formula, or between two
/// shafts; its rate is exact.
///
/// Keys: `shaft`, `torque` (N m, positive accelerates; names t, phi1.., w1.., the scene's inputs
/// and tables, and the parameters), `parameters` (optional dictionary of numbers, all of which it
/// has to read), `reaction_on` (optional: another shaft, on which the opposite torque acts).
///
/// A formula too large for the exact derivatives of the rate by the state (state_derivatives.h)
/// keeps Torque's central differences for them.
///
/// One instance is evaluated by one thread at a time.
class ExpressionTorque : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return torque_dependence_; }
  Dependence doRateDependence() const override { return rate_dependence_; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  std::vector<GuardPtr> doGuards() const override { return guards_; }
  std::vector<double> doInstants() const override { return instants_; }

 private:
  int shaft_ = 0;
  int reaction_ = -1;        ///< the shaft of the opposite torque; -1: none
  expression::Tape torque_;  ///< Q, N m
  expression::Tape rate_;    ///< Q', N m/s
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  bool has_rate_ = false;         ///< false: Q' = 0 at every state
  /// Of Q'; empty when the formula is too large.
  std::optional<expression::StateDerivatives> rate_derivatives_;
  Dependence torque_dependence_;
  Dependence rate_dependence_;
};

}  // namespace variator_sim
