/// Finds out why a motion stops: a law or a row of C that fails at its last state or just ahead of
/// it.
#pragma once

#include "motion/stepped_program.h"
#include "variator_sim/status.h"
#include "variator_sim/types.h"

namespace variator_sim {

struct Motion;

StopReason reasonOf(scene_status status);

class StopSearch {
 public:
  /// `motion` has to outlive this.
  explicit StopSearch(Motion& motion);

  /// Writes to the motion's status why it stops at the state in the program's `it`. [loop]
  void explain();
  /// Tell whether there is a law that is not finite at a state, or a row of C that has lost rank or
  /// nearly so, and write it to the motion's status. [loop]
  bool findBadValue(StateView state);
  bool findLostRow(const StateView& state, int highest_order);

  /// Notes the rates of the 3 S values at the front.
  void lookAtFront();
  /// Writes the values that these rates lead to `h` s ahead of the front.
  void goAhead(double h, double* values) const;
  /// Returns the distance, s, at which a search ahead of the front begins.
  double leastDistance() const;
  /// True where two solutions for the accelerations of `gauss` meet, behind which there are none.
  bool doSolutionsMeet();

 private:
  /// Follows the accelerations of the front, with their multipliers, to the other values of a state
  /// `h` s ahead of it. False where there are none.
  bool followAhead(double h, double* values, double* multipliers);
  /// Looks for a law that is not finite, or accelerations that end, just ahead of the front.
  bool findFaultAhead();

  Motion& motion_;
  const Scene& scene_;
  SteppedProgram& program_;
  const int S;  // shafts
  double slope_[3 * kMaxShafts] = {};
};

}  // namespace variator_sim
