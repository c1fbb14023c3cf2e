/// The equations of a motion as formulas over one vector of variables, with their exact
/// derivatives, for linear models and trim. Not for the loop.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "motion_program/scene_formulas.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/operating_point.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Converts to an index of the standard library.
inline std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

/// The positions in the vector v of variables. Arrays that a StateView points to are longer here:
/// behind the accelerations stand the jerks and `a`, behind the inputs the multipliers and mu.
struct VariableLayout {
  int S = 0;  ///< shafts
  int k = 0;  ///< constraints
  int U = 0;  ///< inputs

  int time() const { return 0; }
  int angle(int i) const { return 1 + i; }
  int velocity(int i) const { return angle(S) + i; }
  int acceleration(int i) const { return velocity(S) + i; }
  int jerk(int i) const { return acceleration(S) + i; }
  /// Returns an auxiliary acceleration, J^-1 times a torque.
  int auxiliary(int i) const { return jerk(S) + i; }
  int input(int i) const { return auxiliary(S) + i; }
  /// Return lambda of R = C^T lambda, and Lambda (generalized_gauss) or lambda' (gauss) of R'.
  int multiplier(int m) const { return input(U) + m; }
  int multiplierRate(int m) const { return multiplier(k) + m; }
  /// Returns mu of eta = mu epsilon.
  int growth() const { return multiplierRate(k); }
  int inputRate(int i) const { return growth() + 1 + i; }
  int inputSecondRate(int i) const { return inputRate(U) + i; }
  int size() const { return inputSecondRate(U); }

  /// Returns the slot of variable n in the graph.
  int slot(int n) const;
  StateView view(const Eigen::VectorXd& v) const;
  /// Returns the variables at `point`; those that it does not have are 0.
  Eigen::VectorXd valuesAt(const OperatingPoint& point) const;
};

/// A constraint's levels; absent ones are Node{}.
struct ConstraintFormulas {
  expression::Node velocity;             ///< f, of order 1
  expression::Node acceleration;         ///< f' or psi, of orders 1 and 2
  expression::Node jerk;                 ///< C eta + c0
  std::vector<expression::Node> C;       ///< s
  std::vector<expression::Node> D;       ///< of the reaction D^T lambda: C, but for losses; s
  std::vector<expression::Node> D_rate;  ///< dD/dt, s; under `gauss` of order 3
  bool has_constant_C = false;
  std::string name;  ///< "constraint 'belt'"
};

/// The mode of losses in these equations: s with k = 0, 3 s with k = 1, or 0.
struct LossMode {
  explicit LossMode(int mode) : side(mode > 0 ? 1 : -1), line(mode == side ? 0 : 1) {}
  int side;  ///< s
  int line;  ///< k
};

/// Returns the modes of a point for MotionEquations: those of losses, which OperatingPoint has by
/// the shaft that drives, with the side of the slip there.
std::vector<int> modesAt(const Scene& scene, const OperatingPoint& point);

/// The formulas of a scene, in a copy of its graph. Elements that hold are in one mode each: a
/// stuck one is a constraint of order 1 behind those of the scene, one that slides a torque; losses
/// that slide turn the reaction of their constraint from C to D, and are a torque without load.
class MotionEquations {
 public:
  /// `mode`: of modesAt; `with_rates_of_d`: see ConstraintFormulas.
  MotionEquations(const Scene& scene, const std::vector<int>& mode, bool with_rates_of_d);
  MotionEquations(const MotionEquations&) = delete;
  MotionEquations& operator=(const MotionEquations&) = delete;

  const VariableLayout& layout() const { return layout_; }
  expression::Graph& graph() { return graph_; }
  expression::Node variable(int n) { return graph_.variable(layout_.slot(n)); }

  /// Returns Q_i, N m.
  expression::Node torque(int i) const { return formulas_.torque[at(i)]; }
  /// Returns a formula of the scene in the modes of its elements.
  expression::Node inModes(expression::Node node) { return graph_.substitute(node, sides_); }
  /// Returns J_ij, kg m^2.
  expression::Node inertia(int i, int j) const { return J_.entry(i, j); }
  bool hasConstantInertia() const {
    return scene_.inertia_harmonics.empty() && scene_.inertia_formulas.empty();
  }
  bool hasDiagonalInertia() const;
  /// Returns R_i = (J epsilon)_i + n_i - Q_i, N m.
  expression::Node reaction(int i);
  /// Returns Gamma R omega [6], with a = J^-1 R: the part of R' beside C^T Lambda, N m/s.
  expression::Node connection(int i);
  /// Returns R_i - sum_m D_mi lambda_m: 0 if the torques balance (gauss, steady states).
  expression::Node balance(int i);
  /// Returns R' - D^T Lambda - Gamma R omega (generalized_gauss), or with the rates of D the whole
  /// rate of R - D^T lambda (gauss): 0 along the motion by the principle of a rate.
  expression::Node balanceOfRates(int i);
  /// Returns sum_j J_ij a_j.
  expression::Node auxiliaryTorque(int i);
  /// Returns sum_m D_mi times the variable `first + m`.
  expression::Node combine(int i, int first);
  /// Returns term(0) + .. + term(count - 1).
  template <class Term>
  expression::Node sum(int count, const Term& term) {
    expression::Node all = graph_.constant(0.0);
    for (int n = 0; n < count; ++n) all = graph_.add(all, term(n));
    return all;
  }
  const std::vector<ConstraintFormulas>& constraints() const { return constraints_; }
  const std::vector<SceneHold>& holds() const { return formulas_.holds; }
  /// Returns the total derivative by time along the motion.
  expression::Node rate(expression::Node node) { return graph_.totalDerivative(node, rates_); }

 private:
  /// Returns row `row` of the formulas, a constraint of `order`.
  ConstraintFormulas rowOf(int row, int order, const std::string& name);
  void takeModes(const std::vector<int>& mode);
  void addStuck(int hold);
  /// Throws SceneError where losses that slide are not known.
  void refuseLosses(const SceneHold& hold, LossMode mode);

  const Scene& scene_;
  SceneFormulas formulas_;  ///< in the scene's graph, before it is copied
  expression::Graph graph_;
  const GeneralInertia J_;
  VariableLayout layout_;
  bool with_rates_of_d_;
  std::vector<expression::Graph::Rate> rates_;
  std::vector<expression::Graph::Rate> sides_;  ///< of elements that hold
  std::vector<ConstraintFormulas> constraints_;
};

/// Formulas and their derivatives by all variables.
class DifferentiatedFormulas {
 public:
  DifferentiatedFormulas(MotionEquations& equations, const std::vector<expression::Node>& formulas);

  /// True when derivatives contain differences, those of an opaque function.
  bool hasDifferences() const { return has_differences_; }
  void evaluate(const Eigen::VectorXd& v, Eigen::VectorXd& values,
                Eigen::MatrixXd& derivatives) const;

 private:
  const VariableLayout& layout_;
  int count_;
  expression::Tape tape_;                     ///< the formulas, then those of entries_
  std::vector<std::pair<int, int>> entries_;  ///< (formula, variable)
  bool has_differences_ = false;
};

}  // namespace variator_sim
