#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "variator_sim/constraint.h"
#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {

/// A constraint that the scene states as a formula; its derivatives are exact.
///
/// Keys: `order` (1, 2 or 3), `expression` (f, psi or C eta + c0, in its own unit; names t, phi1..,
/// w1.., from order 2 on e1.., in order 3 j1.. linearly, the scene's inputs and tables, and the
/// parameters), `parameters` (optional dictionary of numbers, all of which it has to read). It must
/// depend on its highest derivatives: w, e or j.
///
/// A formula too large for the exact derivatives of C and c0 by the state (state_derivatives.h)
/// keeps Constraint's central differences for them; everything else is exact all the same.
///
/// One instance is evaluated by one thread at a time.
class ExpressionConstraint : public Constraint {
 public:
  ExpressionConstraint() = default;

 protected:
  void doConfigure(ComponentContext& context) override;
  int doOrder() const override { return order_; }
  double doCalcResidual(const StateView& state) const override;
  double doCalcVelocityResidualAndJacobian(const StateView& state, double* C) const override;
  double doCalcResidualAndJacobian(const StateView& state, double* C) const override;
  void doCalcRow(const StateView& state, double* C, double* c0) const override;
  void doCalcPartials(const StateView& state, ConstraintPartials& partials) const override;
  void doCalcHessian(const StateView& state, double* H) const override;
  void doCalcJacobianRate(const StateView& state, double* D, double* H) const override;
  void doCalcRowDerivatives(const StateView& state, double* dC, double* dc0) const override;
  Dependence doDependence() const override { return dependence_; }
  std::vector<GuardPtr> doGuards() const override { return guards_; }
  std::vector<double> doInstants() const override { return instants_; }
  bool doReadsInputs() const override { return !inputs_.empty(); }
  bool doHasConstantJacobian() const override { return has_constant_jacobian_; }
  bool doIsLinearInAcceleration() const override { return nonlinear_ == 0; }
  unsigned doNonlinearAccelerations() const override { return nonlinear_; }
  const std::vector<ConstraintPtr>& doKinks() const override { return kinks_; }

 private:
  /// A kink of the constraint `of`: `function` = 0.
  ExpressionConstraint(const ExpressionConstraint& of, expression::Graph& graph,
                       expression::Node function);

  /// Makes the programs of the formula `given`, which stands as `text` at `path`; `without_jerks`
  /// is its value with all jerks 0 (order 3).
  void build(expression::Graph& graph, expression::Node given, expression::Node without_jerks,
             const std::string& path, const std::string& text);

  // One program per question: none computes more than it is asked for.
  expression::Tape residual_;               ///< f or psi
  expression::Tape velocity_level_;         ///< f, then C
  expression::Tape residual_and_jacobian_;  ///< f' or psi, then C
  expression::Tape row_;                    ///< C, then c0
  expression::Tape partials_;               ///< those of partial_slots_
  expression::Tape hessian_;                ///< H = dC/depsilon, s x s
  expression::Tape jacobian_rate_;          ///< D, then H
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  /// Of C, then c0; empty when the formula is too large.
  std::optional<expression::StateDerivatives> row_derivatives_;
  std::vector<int> partial_slots_;  ///< variables by which psi has a derivative
  int order_ = 2;
  std::set<int> inputs_;  ///< that it reads
  Dependence dependence_;
  bool has_constant_jacobian_ = false;
  unsigned nonlinear_ = 0;
  std::vector<ConstraintPtr> kinks_;
};

}  // namespace variator_sim
