/// The equations of a steady state. Constant speeds: epsilon = eta = 0, and
///     R = C^T lambda                                 the torques are in balance
///     f = 0, f' = 0, psi = 0, C eta + c0 = 0         the constraints hold, and go on to hold
///     R' = C^T Lambda + Gamma R omega                (generalized_gauss)
///     R' = C^T lambda' + (dC/dt)^T lambda            (gauss)
/// with R = J epsilon + n - Q. Accelerations in constant ratios: eta = mu epsilon beside these.
/// And the quantities that may be fixed or free in one, by name.
#pragma once

#include <string>
#include <vector>

#include "analysis/motion_equations.h"

namespace variator_sim {

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
