/// The equations of a motion as formulas over one vector of variables, with their exact
/// derivatives: what linear models and trim are made of. Not for the loop.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// An index of the standard library's.
inline std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

/// Where everything stands in the vector v of variables. Arrays that a StateView points to are
/// longer here: behind the accelerations stand the jerks and `a`, behind the inputs the
/// multipliers, mu and what laws without a formula give.
struct VariableLayout {
  int S = 0;       ///< shafts
  int k = 0;       ///< constraints
  int U = 0;       ///< inputs
  int opaque = 0;  ///< what laws without a formula give

  int time() const { return 0; }
  int angle(int i) const { return 1 + i; }
  int velocity(int i) const { return angle(S) + i; }
  int acceleration(int i) const { return velocity(S) + i; }
  int jerk(int i) const { return acceleration(S) + i; }
  /// An auxiliary acceleration, J^-1 times a torque.
  int auxiliary(int i) const { return jerk(S) + i; }
  int input(int i) const { return auxiliary(S) + i; }
  /// lambda of R = C^T lambda, and what makes R': Lambda (generalized_gauss) or lambda' (gauss).
  int multiplier(int m) const { return input(U) + m; }
  int multiplierRate(int m) const { return multiplier(k) + m; }
  /// mu of eta = mu epsilon.
  int growth() const { return multiplierRate(k); }
  int opaqueValue(int j) const { return growth() + 1 + j; }
  int inputRate(int i) const { return opaqueValue(opaque) + i; }
  int inputSecondRate(int i) const { return inputRate(U) + i; }
  int size() const { return inputSecondRate(U); }

  /// The slot of variable n in the graph.
  int slot(int n) const;
  StateView view(const Eigen::VectorXd& v) const;
};

/// A constraint's levels; those that it has not are Node{}.
struct ConstraintFormulas {
  expression::Node velocity;             ///< f, of order 1
  expression::Node acceleration;         ///< f' or psi, of orders 1 and 2
  expression::Node jerk;                 ///< C eta + c0
  std::vector<expression::Node> C;       ///< s
  std::vector<expression::Node> C_rate;  ///< dC/dt = D + H eta, s; under `gauss` of order 3
  bool has_constant_C = false;
};

/// The formulas of a scene, in a copy of its graph. A law that is no formula, or reads a function
/// whose second derivatives nobody knows, gives variables instead, whose derivatives are
/// differences.
class MotionEquations {
 public:
  /// `numeric`: all laws by differences. `with_rates_of_c`: see ConstraintFormulas.
  MotionEquations(const Scene& scene, bool numeric, bool with_rates_of_c);

  const VariableLayout& layout() const { return layout_; }
  expression::Graph& graph() { return graph_; }
  expression::Node variable(int n) { return graph_.variable(layout_.slot(n)); }

  /// Q_i, N m
  expression::Node torque(int i) const { return torques_[static_cast<std::size_t>(i)]; }
  /// J_ij, kg m^2
  expression::Node inertia(int i, int j);
  bool hasConstantInertia() const { return scene_.inertia_harmonics.empty(); }
  bool hasDiagonalInertia() const;
  /// R_i = (J epsilon)_i + n_i - Q_i, N m, and its rate, N m/s
  expression::Node reaction(int i);
  expression::Node reactionRate(int i);
  /// Gamma R omega [6], with a = J^-1 R: what R' is beside C^T Lambda, N m/s
  expression::Node connection(int i);
  /// R_i - sum_m C_mi lambda_m: 0 where the torques are in balance (gauss, steady states)
  expression::Node balance(int i);
  /// What that has by the principle of a rate, 0 along the motion: R' - C^T Lambda - Gamma R omega
  /// (generalized_gauss), or with the rates of C the whole rate of R - C^T lambda (gauss)
  expression::Node balanceOfRates(int i);
  /// sum_j J_ij a_j
  expression::Node auxiliaryTorque(int i);
  /// sum_m C_mi times the variable `first + m`
  expression::Node combine(int i, int first);
  const std::vector<ConstraintFormulas>& constraints() const { return constraints_; }
  /// The total derivative by time along the motion.
  expression::Node rate(expression::Node node) { return graph_.totalDerivative(node, rates_); }

  /// True when some derivatives are differences.
  bool hasNumericLaws() const { return !opaque_torques_.empty() || !opaque_constraints_.empty(); }
  /// What laws without a formula give, into v.
  void fillOpaque(Eigen::VectorXd& v) const;
  /// Its derivatives by all variables.
  Eigen::MatrixXd calcOpaqueDerivatives(const Eigen::VectorXd& v) const;

 private:
  void addTorques(bool numeric);
  void addConstraint(const Constraint& constraint, bool numeric);
  void addOpaqueConstraint(const Constraint& constraint, int first);
  int opaqueSize(const Constraint& constraint) const;
  int countOpaque(bool numeric);
  bool isFormula(const Torque& torque) const;
  bool isFormula(const Constraint& constraint) const;

  const Scene& scene_;
  expression::Graph graph_;
  VariableLayout layout_;
  bool with_rates_of_c_;
  std::vector<expression::Graph::Rate> rates_;
  std::vector<expression::Node> torques_;
  std::vector<expression::Node> opaque_torque_rates_;
  std::vector<ConstraintFormulas> constraints_;
  std::vector<const Torque*> opaque_torques_;
  std::vector<const Constraint*> opaque_constraints_;
};

/// Some formulas and their derivatives by all variables.
class DifferentiatedFormulas {
 public:
  /// Throws std::length_error when the derivatives are too large to be made.
  DifferentiatedFormulas(MotionEquations& equations, const std::vector<expression::Node>& formulas);

  /// At v, whose opaque part is written.
  void evaluate(Eigen::VectorXd& v, Eigen::VectorXd& values, Eigen::MatrixXd& derivatives) const;

 private:
  const MotionEquations& equations_;
  int count_;
  expression::Tape tape_;                     ///< the formulas, then those of entries_
  std::vector<std::pair<int, int>> entries_;  ///< (formula, variable)
};

}  // namespace variator_sim
