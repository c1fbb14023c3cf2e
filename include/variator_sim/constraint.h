/// Nonholonomic constraints: the base class of constraint plugins.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/guard.h"
#include "variator_sim/law_context.h"
#include "variator_sim/named_outputs.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Partial derivatives of psi; s values per array.
struct ConstraintPartials {
  double time = 0.0;                     ///< dpsi/dt
  double angle[kMaxShafts] = {};         ///< dpsi/dphi
  double velocity[kMaxShafts] = {};      ///< dpsi/domega
  double acceleration[kMaxShafts] = {};  ///< dpsi/depsilon, the row of C
  double input[kMaxInputs] = {};         ///< dpsi/du of commanded inputs
};

class Constraint;
using ConstraintPtr = std::shared_ptr<Constraint>;

/// One constraint, of order 1, 2 or 3:
///     order 1   f(t, phi, omega, u) = 0             (kinematic variators)
///     order 2   psi(t, phi, omega, epsilon, u) = 0  [11]
///     order 3   C eta + c0 = 0, given directly      [1]
/// The motion obeys its third-order form C eta + c0 = 0 [12]: psi differentiated once, f twice. All
/// forms of one constraint have the same C: df/domega = df'/depsilon = df''/deta.
///
/// It says in `build` what is zero; C, c0, all derivatives, its dependences and its guards follow
/// from that.
///
///     class Slip : public variator_sim::Constraint {
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
/// (`second_order_lag`) only. A law that is no formula calls an OpaqueFunction.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw: they run in the
/// real-time loop. A value that does not exist is NaN and stops the motion by name. One instance is
/// evaluated by one thread at a time.
class Constraint {
 public:
  virtual ~Constraint() = default;
  Constraint(const Constraint&) = delete;
  Constraint& operator=(const Constraint&) = delete;

  /// Builds the law. Called once, before any evaluation. Throws SceneError.
  void configure(ComponentContext& context);
  /// The constraint's name in the scene.
  const std::string& name() const { return name_; }
  /// Number of shafts s of the scene.
  int shaftCount() const { return shaft_count_; }
  /// 1, 2 or 3.
  int order() const { return order_; }

  expression::Graph& graph() const { return *graph_; }
  /// f, psi, or C eta + c0.
  expression::Node function() const { return function_; }
  /// f' = C epsilon + .. of order 1, psi of order 2.
  expression::Node secondOrder() const { return second_order_; }
  /// C (s nodes), then c0.
  const std::vector<expression::Node>& row() const { return row_nodes_; }
  /// True when an OpaqueFunction is called.
  bool callsOpaqueFunction() const { return graph_->hasOpaque({function_}); }

  /// What is to be zero: f (order 1) or psi (order 2), in the constraint's own unit. Not for order
  /// 3, whose residual C eta + c0 needs the jerk.
  double calcResidual(const StateView& state) const;
  /// Orders 1 and 2: the second-order form, f' or psi, and its C = d/depsilon (s values, all
  /// written).
  double calcResidualAndJacobian(const StateView& state, double* C) const;
  /// C (s values, all written) and c0 of C eta + c0 = 0 [12].
  void calcRow(const StateView& state, double* C, double* c0) const;
  /// Orders 1 and 2: the partial derivatives of f or psi, all of them.
  void calcPartials(const StateView& state, ConstraintPartials& partials) const;
  /// The parts of dC/dt = D + H eta: D (s values) and H = dC/depsilon (s x s values, row by row),
  /// all written. Only the classical Gauss principle asks for them.
  void calcJacobianRate(const StateView& state, double* D, double* H) const;
  /// H = dC/depsilon (s x s values, row by row, all written): for psi its second derivatives. It
  /// steers Newton's iteration for the accelerations of least reaction.
  void calcHessian(const StateView& state, double* H) const { hessian_.evaluate(state, H); }
  /// d(C, c0)/d(phi, omega, epsilon): 3s directions, the first s by the angles; all written.
  /// dC_i/dx_q to dC[q * s + i], dc0/dx_q to dc0[q]. Only stiff steppers ask for it.
  void calcRowDerivatives(const StateView& state, double* dC, double* dc0) const;

  /// What f or psi and its derivatives depend on.
  Dependence dependence() const { return dependence_; }
  /// True when C is the same at every state: it is factored once.
  bool hasConstantJacobian() const { return has_constant_jacobian_; }
  /// The accelerations that the second-order form reads otherwise than with constant coefficients,
  /// bit i for shaft i: the least reaction is looked for over these alone. Where there is none, C
  /// does not depend on epsilon, and a jump is one exact linear projection.
  unsigned nonlinearAccelerations() const { return nonlinear_; }
  /// The degree of the second-order form as a polynomial of the accelerations; -1 where it is none.
  int accelerationDegree() const { return degree_; }
  /// Functions of the state at whose zeros psi, though continuous, has a kink in epsilon (abs, min,
  /// max of accelerations), each as a constraint of order 2. The least reaction may lie there.
  const std::vector<ConstraintPtr>& kinks() const { return kinks_; }
  /// True when psi reads a commanded input.
  bool readsInputs() const { return !inputs_.empty(); }
  /// Where this law changes its branch, see Guard: a step ends there, for the error estimate of one
  /// that runs over a kink knows little of it.
  const std::vector<GuardPtr>& guards() const { return guards_; }
  /// The instants, s, at which this law or a derivative of it that counts is not smooth (the points
  /// of a table over time, say), in any order: steps end there.
  const std::vector<double>& instants() const { return instants_; }
  /// What this constraint tells beside its residual ("slip").
  const NamedOutputs& outputs() const { return outputs_; }

 protected:
  Constraint() = default;
  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;

 private:
  class Kink;
  /// One that is made by another and not configured.
  Constraint(std::string name, int shaft_count, std::shared_ptr<expression::Graph> graph)
      : name_(std::move(name)), shaft_count_(shaft_count), graph_(std::move(graph)) {}

  /// Makes the programs of `given`, a function of order `order` that may read `inputs`; messages
  /// call it `path`.
  void compile(expression::Node given, int order, const std::set<int>& inputs,
               const std::string& path);
  struct Formulas;
  Formulas derive(const std::set<int>& inputs, const std::string& path);
  /// The function of order 3 with all jerks 0.
  expression::Node withoutJerks(const std::vector<expression::Node>& C, const std::string& path);
  void noteNonlinear(const Formulas& formulas);
  void check(const Formulas& formulas, const std::string& path) const;
  /// Throws std::length_error where one becomes too large.
  void makePrograms(const Formulas& formulas);

  std::string name_;
  int shaft_count_ = 0;
  std::shared_ptr<expression::Graph> graph_;
  expression::Node function_;
  expression::Node second_order_;
  std::vector<expression::Node> row_nodes_;

  // One program per question: none computes more than it is asked for.
  expression::Tape residual_;                     ///< f or psi
  expression::Tape residual_and_jacobian_;        ///< f' or psi, then C
  expression::Tape row_;                          ///< C, then c0
  expression::Tape partials_;                     ///< those of partial_slots_
  expression::Tape hessian_;                      ///< H = dC/depsilon, s x s
  expression::Tape jacobian_rate_;                ///< D, then H
  expression::StateDerivatives row_derivatives_;  ///< of C, then c0
  std::vector<int> partial_slots_;                ///< variables by which psi has a derivative
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  NamedOutputs outputs_;
  int order_ = 2;
  Dependence dependence_;
  std::set<int> inputs_;  ///< that it reads
  bool has_constant_jacobian_ = false;
  unsigned nonlinear_ = 0;
  int degree_ = 1;
  std::vector<ConstraintPtr> kinks_;
};

/// An older name of the class.
using FormulaConstraint = Constraint;

}  // namespace variator_sim
