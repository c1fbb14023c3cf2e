/// The motion of a scene by its own program (src/runtime), which knows what an integrator of the
/// equations of shafts and constraints does not.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "integrate/command_rhythm.h"
#include "integrate/progress.h"
#include "integrate/time_origin.h"
#include "motion/motion_base.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

class ProgramMotion final : public MotionBase {
 public:
  /// Throws SceneError where the scene has no such program, or its initial values contradict its
  /// constraints. `like`: has machine code that may fit, or nullptr.
  explicit ProgramMotion(Scene its_scene, const ProgramMotion* like = nullptr);

  const MotionStatus& status() const override { return status_; }
  Statistics& statistics() override { return statistics_; }
  void reset() override;
  bool isSleeping() const override { return is_still_; }
  double frontTime() const override { return it_.time + it_.time_rest; }
  StateView view() override;
  const CommandSignal& signal(int input) const override { return signal_[input]; }
  bool saveState(MotionState* state) override;
  std::string setState(const MotionState& state, bool project) override;
  void trackEnergy(bool on) override { is_energy_tracked_ = on; }
  bool isEnergyTracked() const override { return is_energy_tracked_; }
  Energy calcEnergy() override;
  EnergyDoubt energyDoubt() const override { return {}; }
  void exhaustTime() override { stop(StopReason::kTimeExhausted); }
  std::string describeStop() override;
  const char* stepperName() const override { return "taylor"; }
  std::string describeStepper() const override;
  std::vector<std::string> skips() const override { return {}; }
  std::string loadCode(KernelLibrary::Missing missing, bool* compiled) override;
  bool shareMachineCode(const MotionBase& other) override;

 private:
  /// Where a motion begins (host.h).
  enum class Begin { kSaved, kStart, kWritten };
  /// Steps between two beginnings: there code that was loaded meanwhile takes over, so that no bit
  /// depends on when it was.
  static constexpr int kMostBetween = 64;

  double signalTime() const override { return signal_origin_.relative(time); }
  bool isStart() const override { return is_start_; }
  void leaveStart() override { is_start_ = false; }
  bool isMadeUpTo(double end) const override { return sinceFront(end) <= 0.0; }
  bool step(double end) override;
  double lastInside() const override;
  void changeInputs() override;
  void changeInitialInputs() override;
  void takeSample(Sample* sample) override;
  void recover() override {}

  /// Begins at time 0 with the inputs as they are.
  scene_status start();
  /// Begins with the state in it_.
  scene_status begin(Begin how);
  /// The same from a state of elsewhere.
  scene_status goOnFrom(const MotionState& state, bool may_move);
  /// Writes the closed forms of the inputs at the current time.
  void describeInputs();
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
  [[noreturn]] void throwInitialError(scene_status status);
  double sinceFront(double at) const { return (at - it_.time) - it_.time_rest; }
  /// The time since the start of the last step, s.
  double insideStep(double at) const { return (at - begin_) - begin_rest_; }

  const MotionProgram program_;
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  int made_since_ = 0;                       ///< steps, since the last beginning

  vs_exchange it_ = {};  ///< its arrays are those below; its time is the end of the last step
  double state_[3 * kMaxShafts] = {};
  double multiplier_[kMaxConstraints] = {};
  double reaction_[kMaxShafts] = {};
  double longest_[kMaxConstraints] = {};
  vs_exchanged_signal input_[kMaxInputs] = {};
  int side_[kMaxEvents] = {};
  double seen_input_[kMaxInputs] = {};  ///< values of states and variables in the last sample
  double begin_ = 0.0;                  ///< start of the last step, s
  double begin_rest_ = 0.0;             ///< what a double rounds off that
  bool has_step_ = false;               ///< false: the motion begins at it_
  bool is_start_ = true;
  bool is_still_ = false;

  MotionStatus status_;
  Statistics statistics_;
  Progress progress_;
  CommandRhythm rhythm_;
  TimeOrigin signal_origin_;  ///< that the signals' times count from
  CommandSignal signal_[kMaxInputs];
  double input_value_[kMaxInputs] = {};
  double input_rate_[kMaxInputs] = {};
  double input_second_rate_[kMaxInputs] = {};

  bool is_energy_tracked_ = false;
  double start_kinetic_ = 0.0;   ///< J
  double applied_ = 0.0;         ///< J, at the end of the last step
  double applied_before_ = 0.0;  ///< J, at its start
};

}  // namespace variator_sim
