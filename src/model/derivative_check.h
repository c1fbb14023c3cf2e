/// Checks the gradients that opaque functions state against their values.
#pragma once

#include "variator_sim/scene.h"

namespace variator_sim {

/// Compares the gradient of each OpaqueFunction with differences of its values, at the arguments
/// that its law calls it with at the scene's start and at a few states near it. Throws SceneError
/// at the first entry that does not fit, with both values and the arguments.
///
/// Differences are noisy and blind at kinks, so an entry is rejected only if they are certain: they
/// converge as the step shrinks, they agree from both sides, and their limit is not the stated
/// value; and all that at a second state nearby as well. Arguments with values that are not finite
/// are skipped.
void verifyDerivatives(const Scene& scene);

}  // namespace variator_sim
