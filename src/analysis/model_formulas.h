/// A principle's equations of motion, as formulas E(v, y) = 0, in which y follows from the state x
/// and the inputs:
///     generalized_gauss    y = (eta, Lambda[, a])          R' - Gamma R omega - C^T Lambda,
///                                                          C eta + c0[, J a - R]
///     gauss, orders 1, 2   y = (epsilon, lambda)           R - C^T lambda, psi (order 1: f')
///     gauss with order 3   y = (eta, lambda', a, lambda)   R' - (C^T lambda)', C eta + c0,
///                                                          J a - R + C^T lambda, C a
/// with R = J epsilon + n - Q. Losses that slide have D^T in the place of C^T.
#pragma once

#include <vector>

#include "analysis/motion_equations.h"

namespace variator_sim {

enum class MotionKind { kGeneralized, kClassical, kFormal };
MotionKind kindOf(const Scene& scene);

/// `all` holds E, then as many rows of each kind as the counts say.
struct ModelFormulas {
  std::vector<expression::Node> all;
  std::vector<int> unknowns;         ///< y, variables, as many as E has formulas
  int velocity_rows = 0;             ///< f
  int acceleration_rows = 0;         ///< f', psi; where the accelerations are states
  int conserved_rows = 0;            ///< parts of R that no constraint can change
  std::vector<std::string> outputs;  ///< names of the model's outputs, as columns have them
  int equations() const { return static_cast<int>(unknowns.size()); }
};

ModelFormulas makeModelFormulas(MotionEquations& equations, const Scene& scene);

/// Returns "drive/angle", .., "drive/reaction_torque", ..: five quantities of each shaft.
std::vector<std::string> shaftQuantities(const Scene& scene);

// --- steady states ------------------------------------------------------------------------------

// The equations of a steady state. Constant speeds: epsilon = eta = 0, and
//     R = C^T lambda                                 the torques are in balance
//     f = 0, f' = 0, psi = 0, C eta + c0 = 0         the constraints hold, and go on to hold
//     R' = C^T Lambda + Gamma R omega                (generalized_gauss)
//     R' = C^T lambda' + (dC/dt)^T lambda            (gauss)
// with R = J epsilon + n - Q. Accelerations in constant ratios: eta = mu epsilon beside these.
// And the quantities that may be fixed or free in one, by name.

struct NamedFormula {
  expression::Node formula;
  std::string name;  ///< for messages; "" if none
};

/// Returns those equations that are not 0 = 0. `gauss` needs equations with the rates of C.
std::vector<NamedFormula> makeBalance(MotionEquations& equations, const Scene& scene,
                                      bool accelerating);

/// Returns the n-th number of Halton's sequence of that dimension, in [0, 1).
double halton(int n, int dimension);

/// Says which of the inputs' values (one each) is beyond its limits; "" where none is.
std::string findInputBeyond(const Scene& scene, const double* values);

/// A variable, or another quantity: an output, or a torque of a shaft.
struct TrimQuantity {
  std::string name;
  int variable = -1;
  expression::Node formula;  ///< if it is not a variable
};

/// Lists variables first; the first of several names of one is the one for messages.
std::vector<TrimQuantity> listTrimQuantities(MotionEquations& equations, const Scene& scene);

}  // namespace variator_sim
