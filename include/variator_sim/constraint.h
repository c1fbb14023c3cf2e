/// Nonholonomic constraints: the base class of constraint plugins.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "variator_sim/law.h"

namespace variator_sim {

class Constraint;
using ConstraintPtr = std::shared_ptr<Constraint>;

/// One constraint, of order 1, 2 or 3:
///     order 1   f(t, phi, omega, u) = 0             (kinematic variators)
///     order 2   psi(t, phi, omega, epsilon, u) = 0  [11]
///     order 3   C eta + c0 = 0, given directly      [1]
/// The motion obeys its third-order form C eta + c0 = 0 [12]: psi differentiated once, f twice. All
/// forms of one constraint have the same C: df/domega = df'/depsilon = df''/deta.
///
/// `build` states the function that is zero; C, c0, all derivatives, dependences and switching
/// functions follow from it (doc/tutorials/own_law.md has an example).
///
/// Its order is that of the highest derivative in it. A jerk may occur linearly only; a constraint
/// of order 1 is differentiated twice, and takes commanded inputs with two derivatives
/// (`second_order_lag`) only.
class Constraint : public Law {
 public:
  int order() const { return order_; }
  /// Returns f, psi, or C eta + c0.
  expression::Node function() const { return formulas().front(); }
  /// Returns f' = C epsilon + .. for order 1, psi for order 2, c0 for order 3.
  expression::Node residual() const { return residual_node_; }
  /// Returns C (s nodes), then c0.
  const std::vector<expression::Node>& row() const { return row_nodes_; }
  /// Returns D (s nodes) of a reaction D' lambda; none where it is along C.
  const std::vector<expression::Node>& direction() const { return direction_; }

  /// Returns f (order 1) or psi (order 2), in the constraint's own unit. Not for order 3, whose
  /// residual C eta + c0 needs the jerk.
  double calcResidual(const StateView& state) const;
  /// Orders 1 and 2: returns the second-order form, f' or psi, and writes its C = d/depsilon (s
  /// values).
  double calcResidualAndJacobian(const StateView& state, double* C) const;
  /// Writes C (s values) and c0 of C eta + c0 = 0 [12].
  void calcRow(const StateView& state, double* C, double* c0) const;
  /// Writes H = dC/depsilon (s x s values, row by row), for psi its second derivatives, which
  /// Newton's iteration for the accelerations of least reaction uses.
  void calcHessian(const StateView& state, double* H) const { hessian_.evaluate(state, H); }

  /// True when C is the same at every state: the solver factors it once.
  bool hasConstantJacobian() const;
  /// Returns the accelerations that the second-order form reads other than with constant
  /// coefficients, bit i for shaft i: the search for the least reaction varies these alone. If
  /// there are none, C does not depend on epsilon, and a jump is one exact linear projection.
  ShaftSet nonlinearAccelerations() const { return nonlinear_; }
  /// Returns functions of the state at whose zeros psi, though continuous, has a kink in epsilon
  /// (abs, min, max of accelerations), as constraints of order 2. The least reaction may lie there.
  const std::vector<ConstraintPtr>& kinks() const { return kinks_; }
  /// Returns the same constraint given as C eta + c0 = 0.
  ConstraintPtr inOrder3() const;
  /// True when psi reads a commanded input.
  bool readsInputs() const { return !expression::inputsIn(graph(), formulas()).empty(); }

 protected:
  Constraint() = default;

 private:
  class Derived;
  /// Makes a constraint that follows from another one, without `configure`.
  Constraint(const Constraint& of, expression::Node function, int order)
      : Law(of.name(), of.shaftCount(), of.sharedGraph()) {
    compile(function, order, of.name());
  }
  void derive(const LawContext& law) override;

  /// Compiles `given`, a function of order `order`; messages call it `path`.
  void compile(expression::Node given, int order, const std::string& path);
  /// Returns the function of order 3, whose C is known, with all jerks 0.
  expression::Node withoutJerks(const std::string& path);
  void noteNonlinear(const std::vector<expression::Node>& hessian);

  expression::Node residual_node_;
  std::vector<expression::Node> row_nodes_;
  std::vector<expression::Node> direction_;

  // One program per quantity: none computes more than its caller needs.
  expression::Tape residual_;               ///< f or psi
  expression::Tape residual_and_jacobian_;  ///< f' or psi, then C
  expression::Tape row_;                    ///< C, then c0
  expression::Tape hessian_;                ///< H = dC/depsilon, s x s
  int order_ = 2;
  ShaftSet nonlinear_;
  std::vector<ConstraintPtr> kinks_;
};

}  // namespace variator_sim
