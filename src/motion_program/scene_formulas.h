/// The formulas of a scene that an emitted program needs.
#pragma once

#include <vector>

#include "variator_sim/expression/guards.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Nodes by shaft i, constraint m and input n.
struct SceneFormulas {
  std::vector<expression::Node> torque;             ///< Q_i
  std::vector<expression::Node> residual;           ///< psi, f' (order 1), c0 (order 3)
  std::vector<expression::Node> velocity_residual;  ///< f, 0 of other orders
  std::vector<expression::Node> entry;              ///< C_mi
  std::vector<expression::Node> curvature;          ///< d2psi_m/de_i de_j
  std::vector<expression::Node> input_slope;        ///< dpsi_m/du_n, 0 but of order 2
  std::vector<expression::Node> inertia;            ///< J_ii
  std::vector<expression::Node> inertial_torque;    ///< 1/2 J_i' omega^2
  std::vector<expression::Node> connection;         ///< 1/2 J_i' omega
  std::vector<expression::Branch> signs;            ///< switching functions, of events at the end
  std::vector<expression::Passage> tables;
  std::vector<expression::Node> rate;  ///< of each state
  std::vector<expression::Node> set;   ///< values that events set
  bool inertia_varies = false;
};

/// Throws SceneError, with the element and the reason, for elements that C does not support.
SceneFormulas collectFormulas(const Scene& scene);

}  // namespace variator_sim
