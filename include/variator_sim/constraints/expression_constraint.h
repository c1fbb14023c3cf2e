#pragma once

#include <vector>

#include "variator_sim/constraint.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {

/// A constraint psi(t, phi, omega, epsilon) = 0 of order 2 that the scene states as a formula; its
/// derivatives are exact.
///
/// Keys: `order` (2), `expression` (psi, in its own unit; names t, phi1.., w1.., e1.. and the
/// parameters), `parameters` (optional dictionary of numbers). psi must depend on an acceleration.
///
/// One instance is evaluated by one thread at a time.
class ExpressionConstraint : public Constraint {
 protected:
  void doConfigure(ComponentContext& context) override;
  double doCalcResidual(const StateView& state) const override;
  double doCalcResidualAndJacobian(const StateView& state, double* C) const override;
  void doCalcRow(const StateView& state, double* C, double* c0) const override;
  void doCalcPartials(const StateView& state, ConstraintPartials& partials) const override;
  void doCalcHessian(const StateView& state, double* H) const override;
  bool doIsLinearInAcceleration() const override { return is_linear_; }

 private:
  // One program per question: none computes more than it is asked for.
  expression::Tape residual_;               ///< psi
  expression::Tape residual_and_jacobian_;  ///< psi, then C
  expression::Tape row_;                    ///< C, then c0
  expression::Tape partials_;               ///< those of partial_slots_
  expression::Tape hessian_;                ///< s x s
  std::vector<int> partial_slots_;          ///< variables by which psi has a derivative
  bool is_linear_ = false;
};

}  // namespace variator_sim
