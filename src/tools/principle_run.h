/// `simulate --check-minimum` and `simulate --compare-principles`.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "analysis/principle_check.h"
#include "tools/offline_run.h"
#include "tools/simulate_options.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// Compares Z of the motion with the least one at each sample of a run.
class MinimumWatch {
 public:
  /// `with_curves`: also computes Z along the admissible directions. Throws SceneError where the
  /// principle of the scene makes nothing least.
  MinimumWatch(Simulation& simulation, bool with_curves);

  /// Compares at the simulation's current time, whose sample this is.
  void look(const Sample& sample);
  /// Returns the result in sentences.
  std::string describe() const;
  /// Returns false where the excess or the distance from the constraints is beyond 1e-9 of the
  /// scale.
  bool isLeast() const;
  /// Returns Z along the admissible directions as a CSV: time, direction, step, Z.
  const std::string& curves() const { return curves_; }
  /// Returns the largest difference of the jerks (gauss: accelerations) by [10], [16] and, for two
  /// shafts, [15] from those of the motion, in the metric J, as a part of the scale.
  double largestDerivationDifference() const { return derivation_difference_; }

 private:
  void addCurves(double time, const PrincipleSystem& system, const Eigen::VectorXd& own,
                 const LeastChange& change);
  void compareDerivations(const PrincipleSystem& system, const Eigen::VectorXd& own, double scale);

  Simulation& simulation_;
  PrincipleCheck check_;
  bool with_curves_;
  std::string curves_;
  int count_ = 0;
  double largest_measure_ = 0.0;
  LeastChange worst_;  ///< of the largest excess
  double worst_time_ = 0.0;
  double largest_off_ = 0.0;  ///< as a part of sqrt(2 scale)
  double off_time_ = 0.0;
  double derivation_difference_ = 0.0;
};

/// Runs the scene under both principles and under [18], prints the largest differences of the
/// columns, and writes the samples beside `--output`, where that is given. Throws SceneError,
/// OutputError. Returns false when a motion stops on the way.
bool comparePrinciples(const Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                       const SampleTimes& times, double end, const SimulateOptions& options);

}  // namespace variator_sim
