/// Finds the state that a motion begins with: at the start, and near states of elsewhere.
#pragma once

#include <memory>
#include <string>

#include "dynamics/least_reaction_search.h"
#include "motion/stepped_program.h"

namespace variator_sim {

struct Motion;

class Beginning {
 public:
  using Begin = SteppedProgram::Begin;

  /// `motion` has to outlive this.
  explicit Beginning(Motion& motion);

  /// Begins at the state in the program's `it`, or at the nearest one that the constraints allow if
  /// it `may_move`, with its accelerations if they `are_given`. Where it does not, begins at the
  /// state as it is; the motion's status tells why of SCENE_SINGULAR and SCENE_NOT_FINITE.
  scene_status findNear(Begin how, bool are_given, bool may_move);
  /// Finds first accelerations where psi is not linear in them; else null.
  LeastReactionSearch* search() const { return search_.get(); }

  /// Explain why the last beginning was none, as a sentence about a state of elsewhere and as the
  /// error of a scene.
  std::string describeFault(scene_status status);
  [[noreturn]] void throwFault(scene_status status);

 private:
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

  /// Begins as `how` says, and writes what that has led to.
  scene_status tryToBegin(Begin how, bool are_given, bool may_move, Exchange* left);
  /// Looks for the accelerations of a beginning, where psi is not linear in them, and begins with
  /// them.
  scene_status beginWithFound(Begin how, bool are_given, Exchange* left);
  /// Compare what a beginning has led to with the values that were given.
  void judgeVelocities(scene_status status, bool may_move, const double* found);
  scene_status judgeAccelerations(const Exchange& left);
  /// Tells why no accelerations are found from those in `it`.
  scene_status explainFault(scene_status status);
  [[noreturn]] void throwMode() const;
  /// Says what is wrong with values, of the scene's start or of a state of elsewhere.
  std::string explainMisfit(bool is_start);
  std::string listCandidates() const;

  Motion& motion_;
  const Scene& scene_;
  SteppedProgram& program_;
  const int S;  // shafts
  const std::unique_ptr<LeastReactionSearch> search_;
  Misfit misfit_;  ///< of the last beginning
};

}  // namespace variator_sim
