/// Finds out why a motion stops: a law or a row of C that fails at its last state or just ahead of
/// it.
#pragma once

#include <string>

#include "motion/culprit.h"
#include "motion/stepped_program.h"
#include "variator_sim/status.h"

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
  bool findBadValue(const StateView& state);
  bool findLostRow(const StateView& state, int highest_order);

  /// Returns the sentence for the motion's status. Writes the element that it names to `culprit`,
  /// unless that is null.
  std::string describe(Element* culprit);

 private:
  /// Writes the rates of the 3 S values at the front.
  void calcSlope(double* slope);
  /// Returns the distance, s, at which a search ahead of the front begins.
  double leastDistance() const;
  /// Follows the accelerations of the front, with their multipliers, to the other values of a state
  /// `h` s ahead of it. False where there are none.
  bool followAhead(double h, double* values, double* multipliers);
  /// Looks for a law that is not finite, or accelerations that end, just ahead of the front, whose
  /// state has these slopes. `least`: the first distance, s.
  bool findFaultAhead(const double* slope, double least);
  /// True where two solutions for the accelerations of `gauss` meet, behind which there are none.
  bool doSolutionsMeet();
  /// Finds a law that changes its branch within the shortest step of the front, on either side.
  /// Returns the function of the branch, as formulas write it, or "". Not in the loop.
  std::string findBranch(Element* owner);
  /// Writes what is to blame into `told`, as far as it is not known yet; returns the function of
  /// the branch at which the motion stopped, or "".
  std::string findCulprit(MotionStatus* told);

  std::string describeHugeCommands() const;
  std::string describeLastEvent() const;
  std::string describeRigid() const;
  std::string describePast() const;

  Motion& motion_;
  const Scene& scene_;
  SteppedProgram& program_;
  const int S;  // shafts
};

}  // namespace variator_sim
