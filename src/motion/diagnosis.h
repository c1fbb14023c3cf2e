/// Why a motion stops, or cannot start: the only place that finds it out. motion/stop_message.h
/// puts it into words.
#pragma once

#include "dynamics/system.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// The result of a search for the state at time 0.
struct Start {
  explicit Start(const System& system) : x(system.size()) {}
  State x;
  InitialResult result = InitialResult::kConsistent;
  bool velocities_at_fault = false;  ///< those given, and not the accelerations
  double nearest[kMaxShafts] = {};   ///< consistent ones
};

/// Finds out why no step from `front`, however short, succeeds, and writes it into `status`, whose
/// reason stays where nothing is found. `longest`: the squares of the greatest lengths that the
/// rows of C have had. [loop]
void diagnoseStop(System& system, const StepNode& front, const double* longest,
                  MotionStatus* status);

/// Names a value that is not finite at (t, x) in the status: a torque, a constraint, or, under the
/// classical principle, accelerations that do not exist. False when there is none. [loop]
bool nameBadValue(System& system, double t, const State& x, MotionStatus* status);

/// The status of a motion that starts as `start` says. [loop]
MotionStatus diagnoseStart(System& system, const Start& start);

}  // namespace variator_sim
