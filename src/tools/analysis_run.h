/// `simulate --linearize`, `--trim`, `--check-minimum` and `--compare-principles`.
#pragma once

#include <string>
#include <vector>

#include "analysis/principle_check.h"
#include "tools/offline_run.h"
#include "tools/simulate_options.h"

namespace variator_sim {

/// Brings `simulation` to the point of `--at`, writes its linear model and prints a report. Throws
/// SceneError, UsageError, OutputError. Returns false when the motion stops on the way, comes to no
/// rest or is interrupted (Interruption).
bool runLinearize(Simulation& simulation, const std::vector<TimedCommand>& commands,
                  const SimulateOptions& options);

/// Writes the steady state. Returns false when there is none.
bool runTrim(const Scene& scene, const SimulateOptions& options);

/// Compares Z of the motion with the least one at each sample of a run.
class MinimumWatch {
 public:
  /// `with_curves`: also computes Z along the admissible directions. Throws SceneError where the
  /// principle of the scene makes nothing least.
  MinimumWatch(Simulation& simulation, bool with_curves);

  /// Compares at the simulation's current time, whose sample this is.
  void look(const Sample& sample);
  /// Returns the result in sentences. `is_least` tells that excess and distance from the
  /// constraints are within 1e-9 of the scale of Z: that of the instant, or a ten-millionth of
  /// the largest of the run where that is more.
  std::string describe(bool* is_least) const;
  /// Returns Z along the admissible directions as a CSV: time, direction, step, Z.
  const std::string& curves() const { return curves_; }

 private:
  struct Looked {
    double time;
    LeastChange change;
    double derivations;  ///< distance of the jerks by [10] and [16] from the motion's, as `off`
  };
  void addCurves(double time, const PrincipleSystem& system, const Eigen::VectorXd& x,
                 double reach);

  Simulation& simulation_;
  PrincipleCheck check_;
  bool with_curves_;
  std::string curves_;
  std::vector<Looked> looked_;
};

/// Runs the scene under both principles and under [18], writes the samples beside `--output`, and
/// prints how [10] and [16] differ from each motion. Throws SceneError, OutputError. Returns false
/// when a motion stops on the way.
bool comparePrinciples(const Simulation& simulation, const std::vector<TimedCommand>& commands,
                       const SampleTimes& times, double end, const SimulateOptions& options);

}  // namespace variator_sim
