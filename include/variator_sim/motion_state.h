/// The state of a motion: all that the motion to come depends on beside the scene.
#pragma once

#include <limits>

#include "variator_sim/command_input.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/types.h"

namespace variator_sim {

struct Scene;

/// What no constraint can change of the reaction, and so is kept as it was at the start: where
/// `exists`, of the shafts that are `free` or, where C is constant, of the part out of range(C^T).
struct KeptReaction {
  bool exists = false;
  bool is_free[kMaxShafts] = {};
  double value[kMaxShafts] = {};  ///< N m; per root of kg m^2 where inertias depend on angles
};

/// Where the energy of a motion has come from since its start.
struct EnergyAccount {
  double start_kinetic = 0.0;  ///< J
  double applied = 0.0;        ///< J, brought by the applied torques
  double throughput = 0.0;     ///< J, what they have brought and taken
  double reactions = 0.0;      ///< J, brought by the reactions, at the end of the last step
  double doubt_since = -1.0;   ///< s, see EnergyDoubt
  bool has_turned = false;     ///< C has, since the start
  double directions[kMaxConstraints][kMaxShafts] = {};  ///< of the rows of C at the start
};

/// Plain data. The angles, velocities, accelerations and inputs are the state that theory speaks
/// of; the history is what else a motion has behind it. Without one the state is that of a start.
struct MotionState {
  struct History {
    bool exists = false;
    bool is_implicit = false;                  ///< the steps of `auto` are implicit
    double longest_row[kMaxConstraints] = {};  ///< square of the longest that a row of C has been
    KeptReaction kept_reaction;
    EnergyAccount energy;
  };

  double time = 0.0;                     ///< t, s
  double angle[kMaxShafts] = {};         ///< rad
  double velocity[kMaxShafts] = {};      ///< rad/s
  double acceleration[kMaxShafts] = {};  ///< rad/s^2
  bool is_acceleration_given = true;     ///< or those of least reaction are meant
  CommandSignal signal[kMaxInputs];      ///< their times count from `time`
  double last_command[kMaxInputs] = {};  ///< s, when it came; infinity: none, or it timed out
  History history;
};

/// The state as a tree that can be read back to the bit, with the scene's own names.
ParameterTree toTree(const MotionState& state, const Scene& scene);

/// Reads a tree of toTree, or one that has a part of it: what it leaves out is as in `otherwise`,
/// and the result has no history then. One with a history has to have everything. Throws SceneError
/// with the key's path.
MotionState readMotionState(const ParameterTree& tree, const Scene& scene,
                            const MotionState& otherwise);

}  // namespace variator_sim
