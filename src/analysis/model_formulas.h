/// A principle's equations of motion, as formulas E(v, y) = 0, in which y follows from the state x
/// and the inputs:
///     generalized_gauss    y = (eta, Lambda[, a])          R' - Gamma R omega - C^T Lambda,
///                                                          C eta + c0[, J a - R]
///     gauss, orders 1, 2   y = (epsilon, lambda)           R - C^T lambda, psi (order 1: f')
///     gauss with order 3   y = (eta, lambda', a, lambda)   R' - (C^T lambda)', C eta + c0,
///                                                          J a - R + C^T lambda, C a
/// with R = J epsilon + n - Q.
#pragma once

#include <vector>

#include "analysis/motion_equations.h"

namespace variator_sim {

enum class MotionKind { kGeneralized, kClassical, kFormal };
MotionKind kindOf(const Scene& scene);

/// `all` holds E, then as many rows of each kind as the counts say.
struct ModelFormulas {
  std::vector<expression::Node> all;
  std::vector<int> unknowns;  ///< y, variables, as many as E has formulas
  int velocity_rows = 0;      ///< f
  int acceleration_rows = 0;  ///< f', psi; where the accelerations are states
  int conserved_rows = 0;     ///< parts of R that no constraint can change
  int outputs = 0;            ///< outputs of the model, in the order of outputNames
  int equations() const { return static_cast<int>(unknowns.size()); }
};

ModelFormulas makeModelFormulas(MotionEquations& equations, const Scene& scene);

/// Returns "drive/angle", .., "drive/reaction_torque", .., "outputs/NAME".
std::vector<std::string> outputNames(const Scene& scene);

}  // namespace variator_sim
