/// The derivatives that plugins state, against their own psi and Q.
#pragma once

#include "variator_sim/scene.h"

namespace variator_sim {

/// Whose derivatives are compared.
enum class Compared {
  kStated,  ///< of components that state them, opaque functions among these
  kAll      ///< those that follow from formulas, too: for tests of what makes them
};

/// Compares, at a few states near the scene's start, every derivative that a constraint or a torque
/// states with differences of its own function: the partial derivatives of f and psi, C in all its
/// forms, f', c0, dC/depsilon, dC/dt, dQ/dt, and the derivatives of C, c0 and Q' by the state.
/// Throws SceneError at the first that does not fit, with both values and the state.
///
/// So it does where a component states that something does not depend on the time or the angles
/// (Dependence), or that C is constant, and evaluations say otherwise. What does not read the time
/// has the same bits at any time.
///
/// Differences are noisy and blind at kinks, so a derivative is refused only where they are beyond
/// doubt: they converge as the step shrinks, they agree from both sides, and what they converge to
/// is not what is stated; and all that at a second state nearby as well. What rounding leaves where
/// terms cancel is told by its size: small against what the derivative is at other states, or
/// against C, the torque, or the torque that moves its shaft. States where something is
/// not finite are left out, and so are the derivatives by the state that Constraint and Torque make
/// by default: they are differences themselves, of one step.
///
/// A formula's derivatives are nobody's statement: they follow from it. What differences have to
/// say of it is what they cannot resolve (cos(1e15 t), a table with a gap of 1e10), so it is not
/// asked.
void verifyDerivatives(const Scene& scene, Compared compared = Compared::kStated);

}  // namespace variator_sim
