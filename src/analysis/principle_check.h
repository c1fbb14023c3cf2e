/// The least change that a principle asks for, found without the solver of the motion: dense least
/// squares on the scene's own formulas, differentiated as graphs. Not for the loop.
///
/// With x the jerks and F = G = J x + g under generalized_gauss [6], x the accelerations and
/// F = R = J x + g under gauss,
///     Z(x) = 1/2 F^T J^-1 F    is least over all x with    C x + c = 0.
/// With J = L L^T and y = L^-1 F that is the shortest y with B y = d, B = C L^-T,
/// d = B L^-1 g - c.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "analysis/motion_equations.h"
#include "variator_sim/operating_point.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// J, g, C and c at one instant.
struct PrincipleSystem {
  Eigen::MatrixXd J;
  Eigen::VectorXd g;
  Eigen::MatrixXd C;
  Eigen::VectorXd c;

  /// Returns x of F.
  Eigen::VectorXd unknownsOf(const Eigen::VectorXd& F) const;
  /// Returns Z(x).
  double measure(const Eigen::VectorXd& x) const;
  /// Returns x by [10]: F.h = 0 for a basis of all h with C h = 0, beside C x + c = 0.
  Eigen::VectorXd solveByNullSpace() const;
  /// Returns x by [16]: S1 = 1/2 x^T J x + g.x is stationary over all x with C x + c = 0, with
  /// multipliers.
  Eigen::VectorXd solveByStationarity() const;
  /// Returns unit directions h, h^T J h = 1, with C h = 0, one per column.
  Eigen::MatrixXd admissibleDirections() const;
};

/// A motion's Z beside the least one.
struct LeastChange {
  double measure = 0.0;  ///< Z of the motion's own F
  double least = 0.0;    ///< the least Z over all x that the constraints allow
  double scale = 0.0;    ///< `least` and Z(0), the measure of x = 0: these are compared
  double off = 0.0;      ///< the distance, in sqrt(2 Z), of the motion's x from C x + c = 0
};

class PrincipleCheck {
 public:
  /// `scene` has to outlive it. Throws SceneError where nothing is least: for reactions with a
  /// direction of their own, and for constraints of order 3, or with kinks in the accelerations,
  /// under `gauss`.
  explicit PrincipleCheck(const Scene& scene);

  /// Returns the equations at this instant.
  PrincipleSystem calc(const OperatingPoint& point);
  /// Returns F of the motion itself.
  Eigen::VectorXd ownOf(const Sample& sample) const;
  static LeastChange compare(const PrincipleSystem& system, const Eigen::VectorXd& own);

  /// Returns sentences about what the check cannot tell in this scene.
  std::vector<std::string> limits() const;
  bool isClassical() const { return is_classical_; }

 private:
  /// The formulas in one mode of the elements that hold.
  struct Formulas {
    Formulas(const Scene& scene, const std::vector<int>& mode, bool is_classical);
    MotionEquations equations;
    expression::Tape rates;     ///< z' of the states
    expression::Tape inertia;   ///< J, then R
    expression::Tape balances;  ///< F, then C x + c, then C
  };

  const Scene& scene_;
  const bool is_classical_;
  std::map<std::vector<int>, std::unique_ptr<Formulas>> formulas_;  ///< by mode
};

}  // namespace variator_sim
