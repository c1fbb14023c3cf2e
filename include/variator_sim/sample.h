/// One sample of a motion: everything that is published, in arrays of fixed capacity.
#pragma once

#include "variator_sim/types.h"

namespace variator_sim {

/// The energy balance of a motion: kinetic - kinetic at the start = applied + reactions, and the
/// rate of kinetic is the sum of both powers.
struct Energy {
  double kinetic = 0.0;         ///< T = 1/2 omega^T J omega, J
  double applied = 0.0;         ///< of the applied torques since the start of the motion, J
  double reactions = 0.0;       ///< of the reactions since then, J
  double applied_power = 0.0;   ///< sum Q_i omega_i, W
  double reaction_power = 0.0;  ///< sum R_i omega_i, W
};

/// Only the first s (shafts) or k (constraints) entries of an array are valid.
struct Sample {
  double time = 0.0;                             ///< t, s
  double angle[kMaxShafts] = {};                 ///< phi, rad
  double velocity[kMaxShafts] = {};              ///< omega, rad/s
  double acceleration[kMaxShafts] = {};          ///< epsilon, rad/s^2
  double applied_torque[kMaxShafts] = {};        ///< Q, N m, positive accelerates
  double reaction_torque[kMaxShafts] = {};       ///< R = J epsilon - Q, N m
  double reaction_torque_rate[kMaxShafts] = {};  ///< R', N m/s
  /// G = R' - Gamma R omega [6], N m/s: R' where the inertias are constant.
  double reaction_torque_covariant_rate[kMaxShafts] = {};
  double residual[kMaxConstraints] = {};    ///< psi, the constraint's own unit
  double multiplier[kMaxConstraints] = {};  ///< Lambda of R' = C^T Lambda [12, 15]
  Energy energy;                            ///< if tracked (Simulation::trackEnergy)
  /// Estimated global errors, at least 0, with Simulation::estimateErrors; NaN if unknown.
  double angle_error[kMaxShafts] = {};         ///< rad
  double velocity_error[kMaxShafts] = {};      ///< rad/s
  double acceleration_error[kMaxShafts] = {};  ///< rad/s^2
  double state_error[kMaxInputs] = {};         ///< of the scene's states, their own units
};

}  // namespace variator_sim
