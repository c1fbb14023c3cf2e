/// The motion of a scene by its own program (src/runtime).
///
/// The program steps by power series. Where an integrator of the equations of shafts and
/// constraints (Motion) is at hand, it finds the start, and takes over
///   - where the program makes no step, or rounding refuses nearly all: it gets on by other means,
///     or explains why nothing does;
///   - near rest, to let the motion sleep.
/// The program goes on from where the integrator steps by series again. All of it depends on the
/// motion only.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "integrate/command_rhythm.h"
#include "integrate/progress.h"
#include "integrate/time_origin.h"
#include "motion/motion.h"
#include "motion/motion_past.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

class ProgramMotion final : public MotionBase {
 public:
  /// `integrator`: of the same scene, or null for one that only the program can step; then throws
  /// SceneError where the initial values contradict the constraints. `like`: has machine code that
  /// may fit, or nullptr.
  ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program,
                std::unique_ptr<Motion> integrator, const ProgramMotion* like = nullptr);

  /// Returns the motion by the integrator, or null.
  const Motion* byIntegrator() const { return motion_.get(); }

  const MotionStatus& status() const override {
    return motion_ != nullptr ? motion_->status() : status_;
  }
  Statistics& statistics() override {
    Statistics& counted = motion_ != nullptr ? motion_->statistics() : statistics_;
    counted.stepper_switches = switches();
    return counted;
  }
  void reset() override;
  bool isSleeping() const override {
    return is_integrated_ ? motion_->isSleeping() : motion_ == nullptr && is_still_;
  }
  double frontTime() const override {
    return is_integrated_ ? motion_->frontTime() : it_.time + it_.time_rest;
  }
  StateView view() override;
  const CommandSignal& signal(int input) const override {
    return is_integrated_ ? motion_->signal(input) : signal_[input];
  }
  bool saveState(MotionState* state) override;
  std::string setState(const MotionState& state, bool project) override;
  void trackEnergy(bool on) override;
  bool isEnergyTracked() const override { return is_energy_tracked_; }
  Energy calcEnergy() override;
  EnergyDoubt energyDoubt() const override {
    return motion_ != nullptr ? motion_->energy_meter.doubt(time) : EnergyDoubt{};
  }
  void exhaustTime() override;
  bool takeModeEvent(ModeEvent* event) override;
  std::string describeStop() override;
  const char* stepperName() const override {
    if (is_integrated_) return motion_->stepperName();
    return isImplicit() ? "radau" : "taylor";
  }
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

  double signalTime() const override {
    return (is_integrated_ ? motion_->integrator.origin() : signal_origin_).relative(time);
  }
  bool isStart() const override { return is_integrated_ ? motion_->isStart() : is_start_; }
  void leaveStart() override;
  bool isMadeUpTo(double end) const override {
    return is_integrated_ ? motion_->isMadeUpTo(end) : sinceFront(end) <= 0.0;
  }
  bool step(double end) override;
  double lastInside() const override;
  void changeInputs() override;
  void changeInitialInputs() override;
  void takeSample(Sample* sample) override;
  void recover() override;

  // --- the integrator ---
  /// Makes its current time that of this motion.
  Motion& integrated() {
    motion_->time = time;
    return *motion_;
  }
  bool stepIntegrated(double end);
  bool saveIntegrated(MotionState* state);
  /// Passes waiting commands on.
  void commandIntegrated();
  /// True where the program may go on from the integrator's step end.
  bool mayTakeOver();
  /// Writes the state and the inputs at the end of the integrator's step.
  void describeIntegrated();
  void takeOver();
  /// The integrator goes on from the end of the step, for so many steps at least.
  void handOver(int steps);
  /// The same for as many as the patience, which this doubles.
  void handOverPatiently();
  /// Lets the integrator take over behind a step near rest. True if it does.
  bool reconsider();
  void noteRounding();
  void noteEnergy();
  /// Writes the energy account up to the current time, where the last step is cut.
  void cutEnergy(double at);

  /// Begins at time 0 with the inputs as they are.
  scene_status start();
  /// Begins with the state in it_.
  scene_status begin(Begin how);
  /// The same from a state of elsewhere.
  scene_status goOnFrom(const MotionState& state, bool may_move);
  /// Writes the closed forms of the inputs at the current time.
  void describeInputs();
  /// Changes of the stepper, here and by the integrator.
  std::uint64_t switches() const {
    return switches_ + (motion_ != nullptr ? motion_->integrator.choice().switches() : 0);
  }
  /// True where the program makes implicit steps.
  bool isImplicit() const { return it_.choice.method != 0; }
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
  void stop(scene_status status);
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

  /// Steps that the integrator makes at least where the program has made none, or near rest: the
  /// first time, and at most.
  static constexpr int kFirstPatience = 8;
  /// Implicit steps behind those of the integrator, before series are tried again.
  static constexpr int kFewSteps = 3;
  static constexpr int kMostPatience = 1024;
  /// Steps in a row that change the state by so many tolerances only, or, of a motion that time
  /// drives, by next to nothing, are near rest.
  static constexpr int kSettling = 10;
  static constexpr double kNearRest = 100.0;
  static constexpr double kNearStandstill = 0.01;

  std::unique_ptr<Motion> motion_;  ///< by the integrator, or null
  bool is_integrated_ = false;      ///< it makes the steps
  int steps_left_ = 0;              ///< that it makes at least
  int patience_ = kFirstPatience;
  int settling_ = 0;            ///< steps near rest in a row
  std::uint64_t switches_ = 0;  ///< between series and implicit steps

  const std::shared_ptr<const MotionProgram> program_;
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  int made_since_ = 0;                       ///< steps, since the state was given

  vs_exchange it_ = {};  ///< its arrays are those below; its time is the end of the last step
  double state_[3 * kMaxShafts] = {};
  double before_[3 * kMaxShafts] = {};  ///< at the start of the last step
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
  TimeOrigin signal_origin_;  ///< that the signals' times count from
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
  double start_kinetic_ = 0.0;                  ///< J
  double applied_ = 0.0;                        ///< J, at the end of the last step
  double applied_before_ = 0.0;                 ///< J, at its start
  double kinetic_ = 0.0;                        ///< J, of the last sample
  double through_ = 0.0;                        ///< J, that the last step has brought and taken
  std::vector<double> entries_;                 ///< of C at the end of the last step, by rows
  std::unique_ptr<double[][kMaxShafts]> rows_;  ///< the same, each in its place
};

}  // namespace variator_sim
