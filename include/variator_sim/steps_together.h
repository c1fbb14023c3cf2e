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
  /// The coefficients of the last step of `series` are asked for.
  virtual void fetch(MotionSeries& series) = 0;
};

}  // namespace variator_sim
