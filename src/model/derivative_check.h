/// The gradients that opaque functions state, against their values.
#pragma once

#include "variator_sim/scene.h"

namespace variator_sim {

/// Compares the gradient of each OpaqueFunction with differences of its values, at the arguments
/// that its law calls it with at the scene's start and at a few states near it. Throws SceneError
/// at the first entry that does not fit, with both values and the arguments.
///
/// Differences are noisy and blind at kinks, so an entry is refused only where they are beyond
/// doubt: they converge as the step shrinks, they agree from both sides, and what they converge to
/// is not what is stated; and all that at a second state nearby as well. Arguments at which
/// something is not finite are left out.
void verifyDerivatives(const Scene& scene);

}  // namespace variator_sim
