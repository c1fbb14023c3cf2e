/// Steps as the motion's series make them in one (dynamics/series_step.inc): what is asked of them,
/// and what each leaves. Several are made ahead, as far as the present and as no caller has to look
/// at the series of one before the next. All but the last of them are passed over: of these only
/// what adds up is kept.
#pragma once

#include "integrate/current_step.h"
#include "integrate/rest.h"
#include "integrate/step_size.h"

namespace variator_sim {

/// All are [loop].
class StepBatch : private StepPart {
 public:
  /// Steps that were passed over, from `from` to the nodes.
  struct Passed {
    explicit Passed(const System& system) : from(system) {}
    StepNode from;
    const SeriesNode* begin = nullptr;
    const SeriesNode* end = nullptr;
  };

  StepBatch(CurrentStep& step, StepSize& size, Sleep& sleep)
      : StepPart(step), size_(size), sleep_(sleep), passed_(step.system) {}

  /// Makes the step, and those passed over before it, as the series make them, where they do, no
  /// law has an event and no input moves. False: it is to be made the other way.
  bool make(double target);
  /// True when the next step may be one of these.
  bool isPossible() const {
    return step_.may_batch && !drivetrain_.haveInputsMoved() && step_.stepper->makesWholeSteps();
  }
  const Passed& passed() const { return passed_; }
  void forgetPassed() { passed_.begin = passed_.end = nullptr; }

 private:
  /// How many are made as far as `target`, each with what it came to. 0: none.
  int makeAhead(double target, const SeriesNode** nodes);
  /// One of them is taken. False when it is no good after all.
  bool take(double from, const SeriesNode& to);
  void moveTo(const SeriesNode& made, StepNode* node) const;

  StepSize& size_;
  Sleep& sleep_;
  Passed passed_;
};

}  // namespace variator_sim
