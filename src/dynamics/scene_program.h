/// The formulas of a scene as programs: those of all elements together, so that what they have in
/// common is computed once.
///
/// Q is the sum of all torques; C and c0 are those of all constraints [12]. What no formula states
/// (a plugin with a law of its own) is asked for one by one.
#pragma once

#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// `scene` has to outlive it. Evaluations are [loop].
class SceneProgram {
 public:
  explicit SceneProgram(const Scene& scene);

  /// Q, N m, s values.
  void calcTorque(const StateView& state, double* torque) const {
    torque_.evaluate(state, torque);
    for (const Torque* element : opaque_torques_) element->addTorque(state, torque);
  }
  /// Its total rate Q', N m/s, s values.
  void calcTorqueRate(const StateView& state, double* rate) const {
    rate_.evaluate(state, rate);
    for (const Torque* element : opaque_torques_) element->addTorqueRate(state, rate);
  }

  /// One behind the other: for each constraint C (s values) and c0; of what no formula states, 0.
  /// Valid until the next evaluation.
  const double* calcRows(const StateView& state) const { return rows_.evaluate(state); }
  /// Q' (s values), then what calcRows gives.
  const double* calcRateAndRows(const StateView& state) const {
    return rate_and_rows_.evaluate(state);
  }
  /// The elements that no formula states: torques, and rows m of constraints.
  const std::vector<const Torque*>& opaqueTorques() const { return opaque_torques_; }
  const std::vector<int>& opaqueRows() const { return opaque_rows_; }

 private:
  expression::Tape torque_;
  expression::Tape rate_;
  expression::Tape rows_;
  expression::Tape rate_and_rows_;
  std::vector<const Torque*> opaque_torques_;
  std::vector<int> opaque_rows_;
};

}  // namespace variator_sim
