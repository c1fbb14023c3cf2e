/// The motion of a scene by its own program (src/runtime), which finds the state that it begins
/// with and makes all steps.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/first_accelerations.h"
#include "motion/command_rhythm.h"
#include "motion/energy_balance.h"
#include "motion/exchange.h"
#include "motion/motion_base.h"
#include "motion/motion_past.h"
#include "motion/progress.h"
#include "motion/stop_message.h"
#include "motion/time_resolution.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

struct Element;

class ProgramMotion final : public MotionBase {
 public:
  /// `like`: has machine code that may fit, or nullptr. Throws SceneError where the initial values
  /// contradict the constraints.
  ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program,
                const ProgramMotion* like = nullptr);

  /// True where elements that hold, reactions beside the gradient, states, events, delays or an
  /// inertia by formulas belong to a scene: more than laws of its shafts.
  static bool hasMoreThanLaws(const Scene& scene);

  const MotionStatus& status() const override { return status_; }
  Statistics& statistics() override { return statistics_; }
  void reset() override;
  bool isSleeping() const override { return is_still_ && scene.solver.sleep; }
  double frontTime() const override { return it_.time + it_.time_rest; }
  StateView view() override;
  const CommandSignal& signal(int input) const override { return signal_[input]; }
  bool saveState(MotionState* state) override;
  std::string setState(const MotionState& state, bool project) override;
  void trackEnergy(bool on) override { is_energy_tracked_ = on; }
  bool isEnergyTracked() const override { return is_energy_tracked_; }
  Energy calcEnergy() override;
  EnergyDoubt energyDoubt() const override { return energy_.doubt(time); }
  void exhaustTime() override { stop(StopReason::kTimeExhausted); }
  bool takeModeEvent(ModeEvent* event) override;
  std::string describeStop(Element* culprit) override;
  std::string describeHugeCommands() const;
  const char* stepperName() const override;
  std::string describeStepper() const override;
  std::vector<std::string> skips() const override;
  std::string loadCode(KernelLibrary::Missing missing, bool* compiled) override;
  bool shareMachineCode(const MotionBase& other) override;

 private:
  /// The kinds of beginnings (host.h).
  enum class Begin { kSaved, kStart, kWritten };
  /// Steps between two beginnings: there code that was loaded meanwhile takes over, so that no bit
  /// depends on when it was.
  static constexpr int kMostBetween = 64;
  /// s: the length of a first step is found from a series in this unit.
  static constexpr double kFirstUnit = 1e-3;
  /// Changes of modes that wait to be taken; older ones are forgotten.
  static constexpr std::size_t kMostEvents = 1024;

  double signalTime() const override { return time - signal_origin_; }
  bool isStart() const override { return is_start_; }
  void leaveStart() override { is_start_ = false; }
  bool isMadeUpTo(double end) const override { return sinceFront(end) <= 0.0; }
  bool step(double end) override;
  double lastInside() const override;
  void changeInputs() override;
  void changeInitialInputs() override;
  void takeSample(Sample* sample) override;

  void noteEnergy();
  /// Returns that of the current sample, J.
  double calcKineticEnergy();

  /// Begins at the initial time with the inputs as they are. Throws SceneError where the initial
  /// values contradict the constraints and no command has come.
  void start();
  /// Begins with the state in it_.
  scene_status begin(Begin how);
  /// Begins at the state, or at the nearest one that the constraints allow if it `may_move`, with
  /// its accelerations if they `are_given`. Where it does not, tells why in misfit_ or, of
  /// SCENE_SINGULAR and SCENE_NOT_FINITE, in status_, and begins at the state as it is.
  scene_status beginNear(Begin how, bool are_given, bool may_move);
  /// Begins as `how` says, and writes what that has led to.
  scene_status tryToBegin(Begin how, bool are_given, bool may_move, Exchange* left);
  /// Looks for the accelerations of a beginning, where psi is not linear in them, and begins with
  /// them.
  scene_status beginWithFound(Begin how, bool are_given, Exchange* left);
  /// True where an element that begins in another mode than the scene asks for ends it.
  bool isCulprit(const Exchange& left) const;
  /// Compare what a beginning has led to with the values that were given.
  void judgeVelocities(scene_status status, bool may_move, const double* found);
  scene_status judgeAccelerations(const Exchange& left);
  /// Tells why no accelerations are found from those in it_.
  scene_status explainFault(scene_status status);
  bool isOnConstraints(const StateView& state) const;
  /// Begins from a state of elsewhere.
  scene_status goOnFrom(const MotionState& state, bool may_move);
  /// True where a motion may go on from a saved state to the bit.
  bool isConsistent(const MotionState& state);
  /// Writes the closed forms of the inputs at the current time.
  void describeInputs();
  /// True where the program makes implicit steps.
  bool isImplicit() const {
    return (it_.choice.method != 0 || program_->BY_STAGES != 0) && !program_->isExplicit();
  }
  /// Takes over the values of states and variables from the program.
  void takeMemory();
  /// Cuts the last step at the current time.
  bool cut();
  /// Lets the code begin anew, or loaded code take over: both to the same bits.
  void beginAnew();
  bool use(const std::shared_ptr<KernelLibrary>& library);
  void stop(StopReason reason) {
    status_.reason = reason;
    status_.time = time;
  }
  /// Stops at the end of the last step, and finds out why.
  void stop(scene_status status);
  void explainStop();
  /// True where accelerations that follow from the state agree with given ones.
  static bool agree(const double* given, const double* found, int count);
  /// Follows the accelerations of the front, with their multipliers, to the other values of a state
  /// `h` s ahead of it. False where there are none.
  bool followAhead(double h, double* values, double* multipliers);
  /// Looks for a law that is not finite, or accelerations that end, just ahead of the front, whose
  /// state has these slopes. `least`: the first distance, s.
  bool findFaultAhead(const double* slope, double least);
  /// Looks for another branch of accelerations just ahead of the front: the fold at which a branch
  /// ends lies within the shortest step.
  bool leapsAhead(const double* slope, double least);
  /// Finds a law that changes its branch within the shortest step of the front, on either side.
  /// Returns the function of the branch, as formulas write it, or "". Not in the loop.
  std::string findBranch(Element* owner);
  /// Writes the rates of the 3 S values at the front.
  void calcSlope(double* slope);
  /// Returns the distance, s, at which a search ahead of the front begins.
  double leastDistance() const;
  /// Names the row of C that has lost rank or nearly so.
  bool findLostRow(const StateView& state, int highest_order);
  /// Names a law that is not finite at a state.
  bool findBadValue(const StateView& state);
  /// Returns the view of 3 S values at a time, with the inputs there.
  StateView viewOf(const double* state, double at);
  void writeInputValues(double at);
  /// The same as takeSample, without a stop.
  scene_status look(double at, Sample* sample, double* jerk);
  static StopReason reasonOf(scene_status status);
  void noteEvents();
  /// Copies what belongs to elements that hold into a state, and back.
  void saveHeld(HeldState* held) const;
  void restoreHeld(const HeldState* held);
  /// Writes what is to blame for a stop into `told`, as far as it is not known yet; returns the
  /// function of the branch at which it stopped, or "".
  std::string findCulprit(MotionStatus* told);
  /// Returns a sentence why the motion cannot go on from a state of elsewhere.
  std::string describeFault(scene_status status);
  [[noreturn]] void throwInitialError(scene_status status);
  [[noreturn]] void throwInitialMode() const;
  double sinceFront(double at) const { return (at - it_.time) - it_.time_rest; }
  /// The time since the start of the last step, s.
  double insideStep(double at) const { return (at - begin_) - begin_rest_; }

  /// Implicit steps behind a beginning with them, before series are tried again.
  static constexpr int kFewSteps = 3;

  const std::shared_ptr<const MotionProgram> program_;
  /// Finds first accelerations where psi is not linear in them; else null.
  const std::unique_ptr<FirstAccelerations> search_;
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  int made_since_ = 0;                       ///< steps, since the state was given

  Exchange it_;  ///< its time is the end of the last step
  MotionPast past_;
  double seen_input_[3 * kMaxInputs] = {};  ///< in the last sample; the value, u' and u'' of each
  double begin_ = 0.0;                      ///< start of the last step, s
  double begin_rest_ = 0.0;                 ///< the part of it that a double rounds off
  bool has_step_ = false;                   ///< false: the motion begins at it_
  bool is_start_ = true;
  bool is_still_ = false;

  MotionStatus status_;
  Misfit misfit_;  ///< of the last beginning
  Statistics statistics_;
  Progress progress_;
  CommandRhythm rhythm_;
  double signal_origin_ = 0.0;  ///< s, that the signals' times count from
  CommandSignal signal_[kMaxInputs];
  double input_value_[kMaxInputs + kMaxHolds] = {};  ///< and sides of elements that hold
  double input_rate_[kMaxInputs + kMaxHolds] = {};
  double input_second_rate_[kMaxInputs + kMaxHolds] = {};
  HeldElement held_[kMaxHolds];            ///< of the sample
  double held_value_[3 * kMaxHolds] = {};  ///< likewise, for formulas
  std::vector<ModeEvent> events_;          ///< a ring
  std::size_t first_event_ = 0;            ///< number of the first that waits
  std::size_t event_count_ = 0;            ///< number of the next one
  std::size_t last_events_ = 0;            ///< of these the last step has made

  bool is_energy_tracked_ = false;
  EnergyBalance energy_;
  double kinetic_ = 0.0;         ///< J, of the last sample
  std::vector<double> entries_;  ///< of C at the end of the last step, by rows
};

}  // namespace variator_sim
