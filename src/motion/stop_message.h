/// Explains in words why a motion has stopped or cannot begin: the element to blame, and a remedy.
/// Not in the loop.
#pragma once

#include <string>

#include "dynamics/inertia.h"
#include "dynamics/least_reaction_search.h"
#include "motion/culprit.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// Why a motion cannot begin at given values, although the laws have finite values there.
struct Misfit {
  enum class Kind {
    kNone,
    kInconsistent,  ///< they do not satisfy the constraints and may not be moved
    kNotFound,      ///< no values that satisfy the constraints were found near by
    kNotUnique,     ///< several accelerations have the same least reaction
    kDoubtful,      ///< accelerations with a lesser reaction than those found may exist
    kModes          ///< an element that holds would not be in the mode that the scene asks for
  };
  Kind kind = Kind::kNone;
  bool of_velocities = false;         ///< and not of the accelerations
  double given[3 * kMaxShafts] = {};  ///< angles, velocities, accelerations
  double nearest[kMaxShafts] = {};    ///< consistent ones, of kInconsistent
  int element = 0;                    ///< of kModes: that holds,
  double torque = 0.0, slip = 0.0;    ///< the torque that it would hold, N m, and its slip, rad/s
};

/// Returns the explanation of a reason that needs nothing of the motion; "" of the others.
const char* explainReason(StopReason reason);

/// Returns a sentence for the status of a motion that has stopped at `state`, where J is `inertia`.
/// `function`: that of the branch at which it stopped, as formulas write it; "" where it is not
/// known. Writes the element that it names to `culprit`, unless that is null.
std::string describeStop(const Scene& scene, const MotionStatus& status, const StateView& state,
                         const Inertia& inertia, const std::string& function, Element* culprit);

/// Returns a sentence why a motion cannot continue from `state`, that of the misfit.
std::string describeMisfit(const Scene& scene, const Misfit& misfit, const StateView& state);

/// Throws a SceneError that explains initial values which contradict the constraints, with a
/// remedy. `search`: the candidates of kNotUnique and kDoubtful.
[[noreturn]] void throwInitialError(const Scene& scene, const Misfit& misfit,
                                    const StateView& state, const LeastReactionSearch* search);

}  // namespace variator_sim
