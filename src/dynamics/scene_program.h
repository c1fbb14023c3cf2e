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
  /// Q' (s values), then the values of calcAccelerationLevel.
  const double* calcRateAndLevel(const StateView& state) const {
    return rate_and_level_.evaluate(state);
  }
  /// Q' (s values), then the values of calcRows.
  const double* calcRateAndRows(const StateView& state) const {
    return rate_and_rows_.evaluate(state);
  }

  /// A derivative by x_q, x = (phi, omega, epsilon), for implicit steps.
  struct Partial {
    enum class Kind { kRate, kEntry, kResidual };  ///< of Q'_i, of C_mi, of psi_m (f' of order 1)
    Kind kind;
    int m;
    int i;
    int q;
  };
  /// Derivatives that are not zero everywhere, and their values; valid until the next evaluation.
  const std::vector<Partial>& partials() const { return partials_; }
  const double* calcPartials(const StateView& state) const {
    return partials_program_.evaluate(state);
  }
  /// False if there are too many derivatives or a constraint of order 3: laws are differentiated
  /// singly.
  bool hasPartials() const { return has_partials_; }

 private:
  /// Makes the programs of the constraints, with Q'.
  void makeRows(const std::vector<expression::Node>& rate);
  void makePartials(const std::vector<expression::Node>& rate);

  const Scene& scene_;
  const int S;  // shafts
  expression::Tape torque_;
  expression::Tape rate_;
  expression::Tape rows_;
  expression::Tape rate_and_rows_;
  expression::Tape velocity_level_;
  expression::Tape acceleration_level_;
  expression::Tape rate_and_level_;
  expression::Tape partials_program_;
  std::vector<Partial> partials_;
  bool has_partials_ = false;
};

}  // namespace variator_sim
