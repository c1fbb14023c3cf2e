/// The motion at an instant inside its last step, as laws and observers read it.
#pragma once

#include "motion/motion_inputs.h"
#include "motion/stepped_program.h"
#include "variator_sim/sample.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// All are [loop].
class Observation {
 public:
  /// All have to outlive this.
  Observation(const Scene& scene, SteppedProgram& program, const MotionInputs& inputs)
      : scene_(scene), program_(program), inputs_(inputs) {}

  /// Writes the sample `at` s behind the start of the last step, and its jerks unless that is null.
  /// Later views have the values that formulas read beside the shafts from it.
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

 private:
  const Scene& scene_;
  SteppedProgram& program_;
  const MotionInputs& inputs_;
  double kinetic_ = 0.0;
  double seen_input_[3 * kMaxInputs] = {};           ///< the value, u' and u'' of each
  double input_value_[kMaxInputs + kMaxHolds] = {};  ///< and sides of elements that hold
  double input_rate_[kMaxInputs + kMaxHolds] = {};
  double input_second_rate_[kMaxInputs + kMaxHolds] = {};
  HeldElement held_[kMaxHolds];
  double held_value_[3 * kMaxHolds] = {};  ///< for formulas
};

}  // namespace variator_sim
