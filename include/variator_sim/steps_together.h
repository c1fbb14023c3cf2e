/// Steps of several motions, made at once.
#pragma once

namespace variator_sim {

class MotionSeries;

/// Makes a step of a motion together with steps of others (Simulation::makeStepsWith).
class StepsTogether {
 public:
  StepsTogether() = default;
  StepsTogether(const StepsTogether&) = delete;
  StepsTogether& operator=(const StepsTogether&) = delete;
  virtual ~StepsTogether() = default;
  /// Makes a step of `series`; false if the caller has to make it alone.
  virtual bool make(MotionSeries& series) = 0;
  /// Fetches coefficients of the last step of `series`: the rows from `begin` to before `end` of
  /// those that samples are made of, the state's first.
  virtual void fetch(MotionSeries& series, int begin, int end) = 0;
};

}  // namespace variator_sim
