/// A motion: its current time, commands and samples.
///
/// The scene's program (src/runtime) finds the state that it begins with and makes all steps,
/// freely ahead of the current time; the current time lies in the last one. Samples are taken from
/// inside that step and commands cut it, so that no sampling rate, tick or advance changes one bit
/// of the motion. Commands wait for `settle`, which comes before the current time moves and before
/// the state is read: those before the first advance are initial values.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "motion/beginning.h"
#include "motion/energy_balance.h"
#include "motion/error_estimate.h"
#include "motion/mode_events.h"
#include "motion/motion_inputs.h"
#include "motion/progress.h"
#include "motion/quantities.h"
#include "motion/stepped_program.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/simulation.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// All are [loop] but construction, states from elsewhere, descriptions and machine code.
struct Motion {
  /// `like`: has machine code that may fit, or nullptr. Throws SceneError where the initial values
  /// contradict the constraints.
  Motion(Scene its_scene, const Motion* like);
  Motion(const Motion&) = delete;
  Motion& operator=(const Motion&) = delete;
  static Motion& of(Simulation& simulation) { return *simulation.motion_; }

  void reset();
  const MotionStatus& advanceTo(double end);
  /// Carries out commands; nothing else does. All that wait take effect together at the current
  /// time: where inputs jump the torques move on the straight line between their old and new
  /// values, so that no order means anything.
  void settle();
  /// See Simulation.
  double quietUntil() const;

  /// Returns the current state without settling commands.
  Sample& sample();
  /// Returns the sample's state as a view; valid until the next evaluation elsewhere.
  StateView view();
  Energy calcEnergy();
  OperatingPoint operatingPoint();
  void forgetSample() {
    is_sample_valid_ = false;
    quiet_until_ = -1.0;
  }

  /// See Simulation.
  bool peekState(MotionState* state);
  bool saveState(MotionState* state);
  std::string setState(const MotionState& state, bool project);

  /// Stops at `at`, s, or at the end of the last step, where it finds out why.
  void stop(StopReason reason, double at);
  void stop(scene_status why);
  /// Tell whether there is a law that is not finite at a state, or a row of C that has lost rank or
  /// nearly so, and write it to the status.
  bool findBadValue(StateView state);
  bool findLostRow(const StateView& state, int highest_order);
  /// Notes the rates of the 3 S values at the end of the last step.
  void lookAtFront();
  /// Writes the values that these rates lead to `h` s ahead of it.
  void goAhead(double h, double* values) const;
  /// Returns the distance, s, at which a search ahead begins.
  double leastDistance() const;
  /// True where two solutions for the accelerations of `gauss` meet, behind which there are none.
  bool doSolutionsMeet();

  const Scene scene;
  MotionInputs inputs;
  SteppedProgram program;
  const Quantities quantities;
  Beginning beginning;
  EnergyBalance energy;
  ModeEvents events;
  Progress progress;
  MotionStatus status;
  Statistics statistics;
  std::unique_ptr<ErrorEstimate> error_estimate;  ///< null: errors are not estimated
  bool is_energy_tracked = false;
  double time = 0.0;  ///< the current time

 private:
  /// Moves the current time to `end`, or to the time of a stop.
  void moveTo(double end);
  /// Makes one accepted step. False when the motion stopped.
  bool step();
  /// Returns the latest time inside the last step.
  double lastInside() const;
  /// Cuts the last step at the current time. False when the motion stopped.
  bool cut();
  void changeInputs();
  /// Begins at the initial time with the inputs as they are. Throws SceneError where the initial
  /// values contradict the constraints and no command has come.
  void start();
  /// Begins the account of the energy at the current state.
  void beginEnergy();
  void noteEnergy();
  /// Writes to the status why the motion stops at the end of the last step.
  void explainStop();
  /// Looks for a law that is not finite, or accelerations that end, just ahead.
  bool findFaultAhead();
  /// Begins from a state of elsewhere.
  scene_status goOnFrom(const MotionState& state, bool may_move);
  /// True where a motion may go on from a saved state to the bit.
  bool isConsistent(const MotionState& state);

  Sample sample_;
  bool is_sample_valid_ = false;
  double quiet_until_ = -1.0;  ///< s: up to here nothing but the current time changes
  bool is_start_ = true;
  double slope_[3 * kMaxShafts] = {};  ///< at the end of the last step
  double first_[3 * kMaxShafts] = {};  ///< the state in which the motion has begun
  std::vector<double> entries_;        ///< of C at the end of the last step, by rows
};

StopReason reasonOf(scene_status status);

/// True where elements that hold, reactions beside the gradient, states, events, delays or an
/// inertia by formulas belong to a scene: more than laws of its shafts.
bool hasMoreThanLaws(const Scene& scene);

}  // namespace variator_sim
