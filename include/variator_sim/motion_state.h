/// The state of a motion: with the scene it determines the motion to come.
#pragma once

#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/types.h"

namespace variator_sim {

struct Scene;

/// Sources of the energy of a motion since its start.
struct EnergyAccount {
  double start_kinetic = 0.0;  ///< J
  double applied = 0.0;        ///< J, brought by the applied torques
  double throughput = 0.0;     ///< J, brought and taken: integral of sum |Q_i omega_i|
  double reactions = 0.0;      ///< J, brought by the reactions, at the end of the last step
  double doubt_since = -1.0;   ///< s, see EnergyDoubt
  bool has_turned = false;     ///< C has turned since the start
  double directions[kMaxConstraints][kMaxShafts] = {};  ///< of the rows of C at the start
};

/// The state of an element that holds, beside its multiplier.
struct HeldState {
  int mode = 2;       ///< as of HeldElement
  int counts = 0;     ///< 1: its row of C is independent of the others'
  double side = 0.0;  ///< with which its torque slides
  double heat = 0.0;  ///< J
};

/// Plain data. Angles, velocities, accelerations and inputs are the state of the theory; the
/// history is all else that later steps depend on. Without one the state is that of a start.
struct MotionState {
  struct History {
    bool exists = false;
    bool is_start = false;     ///< commands are initial values still
    bool is_implicit = false;  ///< the steps of `auto` are implicit
    /// Square of the greatest length of each row of C, of constraints and of elements that hold.
    double longest_row[kMaxConstraints + kMaxHolds] = {};
    double multiplier[kMaxConstraints + kMaxHolds] = {};  ///< with which their iteration goes on
    /// The component of the reaction that no constraint can change, N m; per root of kg m^2 where
    /// inertias depend on angles.
    double kept_reaction[kMaxShafts] = {};
    HeldState held[kMaxHolds];   ///< in the order of Scene::holdNames
    int armed[kMaxEvents] = {};  ///< signs from which the functions of events are watched
    /// The pieces of the past of each delayed formula (MotionPast).
    std::vector<std::vector<std::vector<double>>> past;
    EnergyAccount energy;
  };

  double time = 0.0;                     ///< t, s
  double angle[kMaxShafts] = {};         ///< rad
  double velocity[kMaxShafts] = {};      ///< rad/s
  double acceleration[kMaxShafts] = {};  ///< rad/s^2
  bool is_acceleration_given = true;     ///< false: accelerations of least reaction are meant
  CommandSignal signal[kMaxInputs];      ///< their times count from `time`
  double last_command[kMaxInputs] = {};  ///< s, time of the last one; infinity: none, or timed out
  History history;
};

/// Returns the state as a tree that restores it to the bit, with the scene's own names.
ParameterTree toTree(const MotionState& state, const Scene& scene);

/// Reads a tree of toTree, or a part of one: values left out are those of `otherwise`, and the
/// result has no history then. A tree with a history has to be complete. Throws SceneError with the
/// key's path.
MotionState readMotionState(const ParameterTree& tree, const Scene& scene,
                            const MotionState& otherwise);

}  // namespace variator_sim
