/// The motion of a scene by its own program (src/runtime), which makes all steps. The equations of
/// shafts and constraints (StateFinder) find the state that it begins with, and tell why it stops.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "motion/command_rhythm.h"
#include "motion/energy_balance.h"
#include "motion/motion_base.h"
#include "motion/motion_past.h"
#include "motion/progress.h"
#include "motion/state_finder.h"
#include "motion/time_resolution.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

class ProgramMotion final : public MotionBase {
 public:
  /// `finder`: of the same scene, or null for one with elements that hold, states, events, delays
  /// or an inertia by formulas, whose program finds the state to begin with itself. `like`: has
  /// machine code that may fit, or nullptr. Throws SceneError where the initial values contradict
  /// the constraints.
  ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program, bool has_finder,
                const ProgramMotion* like = nullptr);

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
  std::string describeStop() override;
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
  static constexpr int kMostRows = kMaxConstraints + kMaxHolds;
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
  void recover() override;

  void noteEnergy();
  /// Returns that of the current sample, J.
  double calcKineticEnergy();

  /// Begins at time 0 with the inputs as they are. Throws SceneError where nothing begins and no
  /// command has come.
  void start();
  /// Begins with the state in it_.
  scene_status begin(Begin how);
  /// The same from a state of elsewhere.
  scene_status goOnFrom(const MotionState& state, bool may_move);
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
  static StopReason reasonOf(scene_status status);
  void noteEvents();
  /// Copies what belongs to elements that hold into a state, and back.
  void saveHeld(HeldState* held) const;
  void restoreHeld(const HeldState* held);
  /// Writes the element that is to blame for a stop at `state` into `told`; returns the function
  /// of the branch at which it stopped, or "".
  std::string findCulprit(const StateView& state, MotionStatus* told) const;
  [[noreturn]] void throwInitialError(scene_status status);
  [[noreturn]] void throwInitialMode();
  double sinceFront(double at) const { return (at - it_.time) - it_.time_rest; }
  /// The time since the start of the last step, s.
  double insideStep(double at) const { return (at - begin_) - begin_rest_; }

  /// Implicit steps behind a beginning with them, before series are tried again.
  static constexpr int kFewSteps = 3;

  const std::shared_ptr<const MotionProgram> program_;
  const std::unique_ptr<StateFinder> finder_;  ///< or null
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  int made_since_ = 0;                       ///< steps, since the state was given

  vs_exchange it_ = {};  ///< its arrays are those below; its time is the end of the last step
  double state_[3 * kMaxShafts] = {};
  double multiplier_[kMostRows] = {};
  double reaction_[kMaxShafts] = {};
  double longest_[kMostRows] = {};
  vs_exchanged_hold hold_[kMaxHolds] = {};
  vs_exchanged_signal input_[kMaxInputs] = {};
  int armed_[kMaxEvents] = {};
  MotionPast past_;
  double seen_input_[3 * kMaxInputs] = {};  ///< in the last sample; the value, u' and u'' of each
  double begin_ = 0.0;                      ///< start of the last step, s
  double begin_rest_ = 0.0;                 ///< the part of it that a double rounds off
  bool has_step_ = false;                   ///< false: the motion begins at it_
  bool is_start_ = true;
  bool is_still_ = false;

  MotionStatus status_;
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
