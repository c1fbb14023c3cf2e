/// The formulas of a scene that an emitted program needs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/formula_laws.h"
#include "variator_sim/errors.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Nodes by shaft i, constraint m and input n.
struct SceneFormulas {
  std::vector<expression::Node> torque;             ///< Q_i
  std::vector<expression::Node> residual;           ///< psi, f' (order 1), c0 (order 3)
  std::vector<expression::Node> velocity_residual;  ///< f, 0 of other orders
  std::vector<expression::Node> entry;              ///< C_mi
  std::vector<expression::Node> direction;          ///< D_mi
  std::vector<expression::Node> curvature;          ///< d2psi_m/de_i de_j
  std::vector<expression::Node> input_slope;        ///< dpsi_m/du_n, 0 but of order 2
  std::vector<expression::Node> inertia;            ///< J_ii
  std::vector<expression::Node> inertial_torque;    ///< 1/2 J_i' omega^2
  std::vector<expression::Node> connection;         ///< 1/2 J_i' omega
  /// An inertia by formulas has J_ij, and B_ij of the connection B J^-1 R, s x s each.
  std::vector<expression::Node> pair, turn;
  std::vector<expression::Branch> signs;  ///< switching functions, of events at the end
  std::vector<expression::Passage> tables;
  /// The formulas of elements that hold, whose rows follow those of the constraints above.
  std::vector<SceneHold> holds;
  std::vector<std::string> hold_names;  ///< the element's, and the part's behind a slash
  std::vector<expression::Node> rate;   ///< of each state
  std::vector<expression::Node> set;    ///< values that events set
  std::vector<expression::Node> delayed;
  bool inertia_varies = false;
  bool has_directions = false;  ///< R has a part D' lambda, which its rate alone does not tell
  /// The element that keeps the formulas from being written, and the reason: an opaque function. Of
  /// their coefficients the first two are true.
  std::optional<SceneError> no_text;
};

/// True where R = C' lambda is differentiated, the formal equations [18].
inline bool isFormal(const Scene& scene) {
  return scene.principle == Principle::kGauss && scene.hasOrder3();
}

/// Returns the formulas of an element that holds.
std::vector<expression::Node> nodesOf(const SceneHold& hold);
/// Throws SceneError, with the element and the reason, for elements that have no series.
SceneFormulas collectFormulas(const Scene& scene);

}  // namespace variator_sim
