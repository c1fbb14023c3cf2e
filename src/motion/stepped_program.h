/// The program of a scene at work: its code, and the last step that it has made.
#pragma once

#include <memory>
#include <string>

#include "machine_code/kernel_library.h"
#include "motion/exchange.h"
#include "motion/motion_inputs.h"
#include "motion/motion_past.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

/// All are [loop] but construction, descriptions and code.
class SteppedProgram {
 public:
  /// The kinds of beginnings (host.h).
  enum class Begin { kSaved, kStart, kWritten };

  /// `inputs` has to outlive this.
  SteppedProgram(std::shared_ptr<const MotionProgram> program, const MotionInputs& inputs);

  const MotionProgram& text() const { return *program_; }
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
  /// Writes what is seen `at` s behind the start of the last step.
  scene_status see(double at, vs_seen* to) { return host_->see(at, to); }
  /// Returns the work of the applied torques up to there, J, and that of their magnitudes.
  double calcWork(double at, double* through) { return host_->calcWork(at, through); }
  /// Writes the rows of C there.
  void look(double at, double* entries) { host_->look(at, entries); }

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
    return (it.choice.method != 0 || program_->BY_STAGES != 0) && !program_->isExplicit();
  }

  const char* stepperName() const;
  std::string describeStepper(std::uint64_t switches) const;
  std::vector<std::string> skips() const;

  /// Loads machine code; returns "" or why there is none.
  std::string loadCode(KernelLibrary::Missing missing, bool* compiled);
  /// Uses the machine code of `other`, if its scene differs in numbers alone. False if it does not.
  bool shareCode(const SteppedProgram& other);

 private:
  /// Steps between two beginnings: there code that was loaded meanwhile takes over, so that no bit
  /// depends on when it was.
  static constexpr int kMostBetween = 64;
  /// s: the length of a first step is found from a series in this unit.
  static constexpr double kFirstUnit = 1e-3;

  /// Lets the code begin anew, or loaded code take over: both to the same bits.
  void beginAnew();
  bool use(const std::shared_ptr<KernelLibrary>& library);

  const std::shared_ptr<const MotionProgram> program_;
  const MotionInputs& inputs_;
  MotionPast past_;
  std::unique_ptr<HostedMotion> host_;
  std::unique_ptr<HostedMotion> next_host_;  ///< takes over at the next beginning, or null
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  int made_since_ = 0;                       ///< steps, since the state was given
  double begin_ = 0.0;                       ///< start of the last step, s
  double begin_rest_ = 0.0;                  ///< the part of it that a double rounds off
  bool has_step_ = false;
};

}  // namespace variator_sim
