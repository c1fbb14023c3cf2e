/// The formulas of a scene as programs over all elements, so that common subexpressions are
/// computed once.
///
/// Q is the sum of all torques; C and c0 are those of all constraints [12].
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// `scene` has to outlive it. Evaluations are [loop].
class SceneProgram {
 public:
  /// Copies `like`, for a scene with the same elements; compiles if that is nullptr.
  explicit SceneProgram(const Scene& scene, const SceneProgram* like = nullptr);

  /// Q, N m, s values.
  void calcTorque(const StateView& state, double* torque) const {
    std::copy_n(torque_.evaluate(state), S, torque);
  }
  /// Its total rate Q', N m/s, s values.
  void calcTorqueRate(const StateView& state, double* rate) const {
    std::copy_n(rate_.evaluate(state), S, rate);
  }

  // Each of these is valid until the next evaluation.
  /// For each constraint, consecutively: C (s values) and c0.
  const double* calcRows(const StateView& state) const { return rows_.evaluate(state); }
  /// For each constraint of order 1: f, then C (s values).
  const double* calcVelocityLevel(const StateView& state) const {
    return velocity_level_.evaluate(state);
  }
  /// For each constraint of order 1 or 2: f' or psi, then C.
  const double* calcAccelerationLevel(const StateView& state) const {
    return acceleration_level_.evaluate(state);
  }

 private:
  /// Makes the programs of the constraints.
  void makeRows();

  const Scene& scene_;
  const int S;  // shafts
  expression::Tape torque_;
  expression::Tape rate_;
  expression::Tape rows_;
  expression::Tape velocity_level_;
  expression::Tape acceleration_level_;
};

}  // namespace variator_sim
