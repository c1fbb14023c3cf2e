/// What is 0 in a steady state. Constant speeds: epsilon = eta = 0, and
///     R = C^T lambda                                 the torques are in balance
///     f = 0, f' = 0, psi = 0, C eta + c0 = 0         the constraints hold, and go on to hold
///     R' = C^T Lambda + Gamma R omega                (generalized_gauss)
///     R' = C^T lambda' + (dC/dt)^T lambda            (gauss)
/// with R = J epsilon + n - Q. Accelerations in constant ratios: eta = mu epsilon beside these.
#pragma once

#include <string>
#include <vector>

#include "analysis/motion_equations.h"

namespace variator_sim {

struct NamedFormula {
  expression::Node formula;
  std::string name;  ///< for messages; "" where there is nothing to say
};

/// Those that are not 0 = 0. Under `gauss` the equations have to have the rates of C.
std::vector<NamedFormula> makeBalance(MotionEquations& equations, const Scene& scene,
                                      bool accelerating);

}  // namespace variator_sim
