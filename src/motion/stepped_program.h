/// The program of a scene at work: its code, the last step that it has made, and what laws and
/// observers read inside it.
#pragma once

#include <memory>
#include <string>

#include "machine_code/kernel_library.h"
#include "motion/motion_inputs.h"
#include "motion/motion_past.h"
#include "motion_program/motion_steps.h"
#include "variator_sim/sample.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// The numbers that a motion and its program tell each other, with their arrays.
struct Exchange : vs_exchange {
  static constexpr int kMostRows = kMaxConstraints + kMaxHolds;

  Exchange() : vs_exchange{} {
    state = states_;
    multiplier = multipliers_;
    reaction = reactions_;
    longest = longests_;
    input = inputs_;
    hold = holds_;
    armed = armeds_;
  }
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

 private:
  double states_[3 * kMaxShafts] = {};
  double multipliers_[kMostRows] = {};
  double reactions_[kMaxShafts] = {};
  double longests_[kMostRows] = {};
  vs_exchanged_signal inputs_[kMaxInputs] = {};
  vs_exchanged_hold holds_[kMaxHolds] = {};
  int armeds_[kMaxEvents] = {};
};

/// All are [loop] but construction, descriptions and code.
class SteppedProgram {
 public:
  /// The kinds of beginnings (host.h).
  enum class Begin { kSaved, kStart, kWritten };

  /// Both have to outlive this.
  SteppedProgram(const Scene& scene, const MotionInputs& inputs);

  const MotionProgram& text() const { return program_; }
  const MotionPast& past() const { return past_; }
  MotionPast& past() { return past_; }

  Exchange it;  ///< its time is the end of the last step

  /// Begins with the state in `it` and the inputs as they are.
  scene_status begin(Begin how);
  /// Makes a step of at most `left` s.
  scene_status step(double left);
  /// Ends the last step at `at` s behind its start.
  scene_status cut(double at);
  /// The inputs have taken new closed forms.
  scene_status change();
  /// Writes the state at the end of the last step to `it`.
  void leave() { host_->leave(&it); }
  void leave(Exchange* to) { host_->leave(to); }
  /// Returns the work of the applied torques up to there, J, and that of their magnitudes.
  double calcWork(double at, double* through) { return host_->calcWork(at, through); }
  /// Writes the rows of C there.
  void writeRows(double at, double* entries) { host_->look(at, entries); }
  /// Writes the sample there, and its jerks unless that is null. Later views have the values that
  /// formulas read beside the shafts from it.
  scene_status look(double at, Sample* sample, double* jerk = nullptr);
  /// Returns the kinetic energy of the last look, J.
  double kinetic() const { return kinetic_; }
  /// Returns the view of a state (angles, velocities, accelerations) at a time, with the inputs
  /// there; valid until the next one.
  StateView view(const double* state, double time) {
    const int S = scene_.shaftCount();
    return view(time, state, state + S, state + 2 * S);
  }
  StateView view(double time, const double* angle, const double* velocity,
                 const double* acceleration);

  /// False: the motion begins at `it`.
  bool hasStep() const { return has_step_; }
  /// True where nothing that something reads has changed in the last step.
  bool isStill() const { return has_step_ && it.is_still != 0; }
  /// Returns the end of the last step, s.
  double front() const { return it.time + it.time_rest; }
  double sinceFront(double at) const { return (at - it.time) - it.time_rest; }
  /// Returns the time since the start of the last step, s.
  double insideStep(double at) const { return (at - begin_) - begin_rest_; }
  /// True where implicit steps are made.
  bool isImplicit() const {
    return (it.choice.method != 0 || program_.BY_STAGES != 0) && !program_.isExplicit();
  }

  const char* stepperName() const;
  std::string describeStepper(std::uint64_t switches) const;
  std::vector<std::string> skips() const;

  /// Loads machine code, as Simulation describes it; false if there is none.
  bool loadCode(bool compile, bool patiently);
  /// Uses the machine code of `other`, if its scene differs in numbers alone. False if there is
  /// none.
  bool shareCode(const SteppedProgram& other);
  bool hasCode() const { return library_ != nullptr; }
  /// Returns "machine code, ..", or why there is none.
  const std::string& code() const { return code_; }

 private:
  /// Steps between two beginnings: there code that was loaded meanwhile takes over, so that no bit
  /// depends on when it was.
  static constexpr int kMostBetween = 64;
  /// s: the length of a first step is found from a series in this unit.
  static constexpr double kFirstUnit = 1e-3;

  /// Lets the code begin anew, or loaded code take over: both to the same bits.
  void beginAnew();
  bool use(const std::shared_ptr<KernelLibrary>& library);

  const Scene& scene_;
  const MotionInputs& inputs_;
  const MotionProgram program_;
  MotionPast past_;
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  std::string structure_;                    ///< of the program, where there is code
  int made_since_ = 0;                       ///< steps, since the state was given
  double begin_ = 0.0;                       ///< start of the last step, s
  double begin_rest_ = 0.0;                  ///< the part of it that a double rounds off
  bool has_step_ = false;
  std::string code_ = "the interpreter";
  double kinetic_ = 0.0;
  double seen_input_[3 * kMaxInputs] = {};           ///< the value, u' and u'' of each
  double input_value_[kMaxInputs + kMaxHolds] = {};  ///< and sides of elements that hold
  double input_rate_[kMaxInputs + kMaxHolds] = {};
  double input_second_rate_[kMaxInputs + kMaxHolds] = {};
  HeldElement held_[kMaxHolds];
  double held_value_[3 * kMaxHolds] = {};  ///< for formulas
};

}  // namespace variator_sim
