/// One sample of a motion: everything that is published, in arrays of fixed capacity.
#pragma once

#include "variator_sim/types.h"

namespace variator_sim {

/// Only the first s (shafts) or k (constraints) entries of an array mean something.
struct Sample {
  double time = 0.0;                             ///< t, s
  double angle[kMaxShafts] = {};                 ///< phi, rad
  double velocity[kMaxShafts] = {};              ///< omega, rad/s
  double acceleration[kMaxShafts] = {};          ///< epsilon, rad/s^2
  double applied_torque[kMaxShafts] = {};        ///< Q, N m, positive accelerates
  double reaction_torque[kMaxShafts] = {};       ///< R = J epsilon - Q, N m
  double reaction_torque_rate[kMaxShafts] = {};  ///< R', N m/s
  double residual[kMaxConstraints] = {};         ///< psi, the constraint's own unit
  double multiplier[kMaxConstraints] = {};       ///< Lambda of R' = C^T Lambda [12, 15]
};

}  // namespace variator_sim
