/// How long the next step is.
#pragma once

#include "integrate/current_step.h"
#include "integrate/step_control.h"
#include "motion/command_rhythm.h"

namespace variator_sim {

/// All are [loop].
class StepSize : private StepPart {
 public:
  explicit StepSize(CurrentStep& step) : StepPart(step) {}

  void reset() { rhythm_.reset(); }
  /// A command has come at `time`: steps end where the next one may be expected.
  void noteCommand(double time) { rhythm_.note(time); }
  /// The next step has no past: the motion begins anew, or another stepper goes on.
  void forgetErrors() { control_.reset(); }

  /// The length of a first step by the sizes of x, x' and the change of x' over a small Euler step
  /// (Hairer, Norsett, Wanner: Solving ODE I, II.4), s.
  double chooseFirst();
  /// The next step as the stepper knows it beforehand. False when it does not.
  bool letStepperChoose();
  /// The latest end of a step: the end of an input's segment, an instant at which a law is not
  /// smooth, or the instant at which a command is expected.
  double endOfReach() const;

  /// The factor for the step after one with the error `norm`, `estimate` without the checks of
  /// StepChecks.
  double growth(double norm, double estimate);
  /// The factor for another attempt after one with the error `norm`.
  double shrink(double norm) const { return control_.shrink(norm); }
  /// The stepper that made the last attempt, which may have changed its order, is judged from now
  /// on.
  void followScheme() {
    control_.setScheme(std::max(1, step_.stepper->errorOrder()), !step_.stepper->isImplicit());
  }

 private:
  StepControl control_{1};
  CommandRhythm rhythm_;
  bool is_chosen_ = false;  // by the stepper
};

}  // namespace variator_sim
