/// The applied torque Q near a state, linear in the velocities.
///
/// Differences over a shift do not resolve a narrower layer (dry friction with
/// `regularization_speed: 1e-6`), and Newton's iteration of an implicit step fails with them. The
/// total rate Q' is linear in epsilon and so gives dQ/domega exactly:
///     dQ/domega e_j = Q'(phi, omega, e_j) - Q'(phi, omega, 0).
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/drivetrain.h"

namespace variator_sim {

/// [loop]
class TorqueTangent {
 public:
  TorqueTangent(Drivetrain& drivetrain, const StateView& base) : drivetrain_(drivetrain) {
    const int S = drivetrain.shafts();
    std::copy_n(base.angle, S, angle_);
    std::copy_n(base.velocity, S, velocity_);
    drivetrain.calcTorque(base, torque_);
    double epsilon[kMaxShafts] = {};
    double rate[kMaxShafts];
    StateView state = base;
    state.acceleration = epsilon;
    drivetrain.calcTorqueRate(state, rate);
    for (int j = 0; j < S; ++j) {
      epsilon[j] = 1.0;
      drivetrain.calcTorqueRate(state, slope_[j]);
      epsilon[j] = 0.0;
      for (int i = 0; i < S; ++i) {
        slope_[j][i] -= rate[i];
        exists_ = exists_ && std::isfinite(slope_[j][i]);
      }
    }
  }

  /// Q + dQ/domega (omega - omega_0) with Q at omega_0; Q itself if it has no derivative.
  void calcTorque(const StateView& state, double* torque) const {
    const int S = drivetrain_.shafts();
    if (exists_ && std::equal(angle_, angle_ + S, state.angle)) {
      std::copy_n(torque_, S, torque);
    } else {
      StateView at = state;
      if (exists_) at.velocity = velocity_;
      drivetrain_.calcTorque(at, torque);
    }
    for (int j = 0; j < S && exists_; ++j) {
      const double change = state.velocity[j] - velocity_[j];
      if (change == 0.0) continue;
      for (int i = 0; i < S; ++i) torque[i] += slope_[j][i] * change;
    }
  }

 private:
  const Drivetrain& drivetrain_;
  bool exists_ = true;
  double angle_[kMaxShafts] = {};
  double velocity_[kMaxShafts] = {};
  double torque_[kMaxShafts] = {};
  double slope_[kMaxShafts][kMaxShafts];  // [j][i]: dQ_i/domega_j
};

}  // namespace variator_sim
