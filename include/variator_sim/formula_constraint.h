/// Constraints written as formulas: the base class of constraint plugins that state psi once.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "variator_sim/constraint.h"
#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"
#include "variator_sim/named_outputs.h"

namespace variator_sim {

/// A constraint that says in `build` what is zero; C, c0, all derivatives, its dependences and its
/// edges follow from that.
///
///     class Slip : public variator_sim::FormulaConstraint {
///       void build(variator_sim::LawContext& scene) override {
///         const auto s = scene.shafts("shafts", 2);
///         const double tau = scene.number("time_constant", variator_sim::Range::positive());
///         scene.constrain(tau * (s[1].acceleration - s[0].acceleration) + s[1].velocity -
///                         s[0].velocity);
///       }
///     };
///
/// Its order is that of the highest derivative in it. A jerk may occur linearly only; a constraint
/// of order 1 is differentiated twice, and takes commanded inputs with two derivatives
/// (`second_order_lag`) only.
///
/// A law too large for the exact derivatives of C and c0 by the state (state_derivatives.h), or
/// with an opaque function, keeps Constraint's central differences for them; what needs no second
/// derivative of such a function is exact all the same.
///
/// One instance is evaluated by one thread at a time.
class FormulaConstraint : public Constraint {
 public:
  expression::Graph& graph() const { return *graph_; }
  /// f, psi, or C eta + c0.
  expression::Node function() const { return function_; }
  /// f' = C epsilon + .. of order 1, psi of order 2.
  expression::Node secondOrder() const { return second_order_; }
  /// C (s nodes), then c0.
  const std::vector<expression::Node>& row() const { return row_nodes_; }
  const NamedOutputs& namedOutputs() const { return outputs_; }

 protected:
  FormulaConstraint() = default;
  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;

  void doConfigure(ComponentContext& context) final;
  int doOrder() const final { return order_; }
  double doCalcResidual(const StateView& state) const final;
  double doCalcVelocityResidualAndJacobian(const StateView& state, double* C) const final;
  double doCalcResidualAndJacobian(const StateView& state, double* C) const final;
  void doCalcRow(const StateView& state, double* C, double* c0) const final;
  void doCalcPartials(const StateView& state, ConstraintPartials& partials) const final;
  void doCalcHessian(const StateView& state, double* H) const final;
  void doCalcJacobianRate(const StateView& state, double* D, double* H) const final;
  void doCalcRowDerivatives(const StateView& state, double* dC, double* dc0) const final;
  Dependence doDependence() const final { return dependence_; }
  std::vector<GuardPtr> doGuards() const final { return guards_; }
  std::vector<double> doInstants() const final { return instants_; }
  std::vector<std::string> doOutputNames() const final { return outputs_.names(); }
  void doCalcOutputs(const StateView& state, double* values) const final {
    outputs_.evaluate(state, values);
  }
  bool doReadsInputs() const final { return !inputs_.empty(); }
  bool doHasConstantJacobian() const final { return has_constant_jacobian_; }
  bool doIsLinearInAcceleration() const final { return nonlinear_ == 0; }
  unsigned doNonlinearAccelerations() const final { return nonlinear_; }
  int doAccelerationDegree() const final { return degree_; }
  const std::vector<ConstraintPtr>& doKinks() const final { return kinks_; }

 private:
  class Kink;
  FormulaConstraint(std::string name, int shaft_count, std::shared_ptr<expression::Graph> graph)
      : Constraint(std::move(name), shaft_count), graph_(std::move(graph)) {}

  /// Makes the programs of `given`, a function of order `order` that may read `inputs`; messages
  /// call it `path`.
  void compile(expression::Node given, int order, const std::set<int>& inputs,
               const std::string& path);
  struct Formulas;
  Formulas derive(const std::set<int>& inputs, const std::string& path);
  /// The function of order 3 with all jerks 0.
  expression::Node withoutJerks(const std::vector<expression::Node>& C, const std::string& path);
  void noteNonlinear(const Formulas& formulas);
  void check(const Formulas& formulas, const std::string& path);
  /// Throws std::length_error where one becomes too large.
  void makePrograms(const Formulas& formulas);

  std::shared_ptr<expression::Graph> graph_;
  expression::Node function_;
  expression::Node second_order_;
  std::vector<expression::Node> row_nodes_;

  // One program per question: none computes more than it is asked for.
  expression::Tape residual_;               ///< f or psi
  expression::Tape velocity_level_;         ///< f, then C
  expression::Tape residual_and_jacobian_;  ///< f' or psi, then C
  expression::Tape row_;                    ///< C, then c0
  expression::Tape partials_;               ///< those of partial_slots_
  bool has_jacobian_rate_ = true;           ///< not where that of an opaque function is needed
  expression::Tape hessian_;                ///< H = dC/depsilon, s x s
  expression::Tape jacobian_rate_;          ///< D, then H
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  NamedOutputs outputs_;
  /// Of C, then c0; empty when the formula is too large.
  std::optional<expression::StateDerivatives> row_derivatives_;
  std::vector<int> partial_slots_;  ///< variables by which psi has a derivative
  int order_ = 2;
  Dependence dependence_;
  std::set<int> inputs_;  ///< that it reads
  bool has_constant_jacobian_ = false;
  unsigned nonlinear_ = 0;
  int degree_ = 1;
  std::vector<ConstraintPtr> kinks_;
};

}  // namespace variator_sim
