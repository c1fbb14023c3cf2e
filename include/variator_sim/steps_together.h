/// Steps of several motions, made at once.
#pragma once

namespace variator_sim {

class MotionSeries;

/// Who makes a step of a motion together with steps of others (Simulation::makeStepsWith).
class StepsTogether {
 public:
  StepsTogether() = default;
  StepsTogether(const StepsTogether&) = delete;
  StepsTogether& operator=(const StepsTogether&) = delete;
  virtual ~StepsTogether() = default;
  /// A step of `series` is wanted: returns when it is made. False where it is to be made alone.
  virtual bool make(MotionSeries& series) = 0;
  /// The coefficients of the last step of `series` are asked for: of the rows from `begin` to
  /// before `end` of those that samples are made of, which are the state's to begin with.
  virtual void fetch(MotionSeries& series, int begin, int end) = 0;
};

}  // namespace variator_sim
