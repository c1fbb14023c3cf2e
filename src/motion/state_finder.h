/// The equations of shafts and constraints as the place to ask at which states a motion may begin,
/// and why it stops.
#pragma once

#include <string>

#include "motion/diagnosis.h"
#include "variator_sim/motion_state.h"

namespace variator_sim {

class StateFinder {
 public:
  /// `scene` has to outlive this. `like`: of a scene that may have the same elements, or nullptr.
  StateFinder(const Scene& scene, const StateFinder* like);

  /// The inputs are from now on `signals`, whose times count from `origin`, s. [loop]
  void enterInputs(const CommandSignal* signals, double origin);

  /// Finds the state at time 0, where the inputs are those that were entered. False where there is
  /// none. [loop]
  bool findFirst();
  /// The same of a given state, whose inputs are entered. `may_move`: inconsistent values become
  /// the nearest consistent ones.
  bool accept(const MotionState& given, bool may_move);
  /// The values that were found, as the equations have them, and the accelerations, rad/s^2.
  const State& x() const { return start_.x; }
  const double* acceleration() const { return epsilon_; }
  /// Writes angles, velocities and accelerations (3 S values) and, of the reaction of gauss, the
  /// multipliers that were found. [loop]
  void write(double* state, double* multiplier);

  /// Returns `given` with the values that were found, as one without a history.
  MotionState found(const MotionState& given);

  /// Returns why no state was found. [loop]
  MotionStatus explainStart() { return diagnoseStart(system_, start_); }
  /// Throws SceneError where initial values contradict the constraints.
  void requireConsistency();
  /// Returns a sentence why `given` is none that a motion may go on from.
  std::string describeInconsistency(const MotionState& given);

  /// Finds out why no step from a state (3 S values) at the origin of the inputs' times succeeds.
  /// `longest`: see diagnoseStop. [loop]
  void explainStop(const double* state, const double* longest, MotionStatus* status);

  /// Returns the values of a given state as the equations have them.
  State valuesOf(const MotionState& given) const;

  System& system() { return system_; }

 private:
  /// The same of the state `later` s behind a given one.
  bool tryState(const MotionState& given, double later, bool may_move);

  System system_;
  Start start_;
  double epsilon_[kMaxShafts] = {};  ///< found, rad/s^2
};

}  // namespace variator_sim
