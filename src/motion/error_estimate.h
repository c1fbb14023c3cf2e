/// Estimates of the global error of every sample.
///
/// A second motion of the same scene, its companion, gets the same commands at the same instants
/// and is stepped more finely. The error of the run at t, to first order in both, is
///
///     x(t) - x*(t) = (x(t) - y(t)) + (y(t) - x*(t)),    x run, y companion, x* exact,
///
/// and the last part is small against the first one: the estimate is |x - y|, in angles, velocities
/// and accelerations alike. What dense output, projections, jumps and edges of laws do to the run
/// is in it. What both share is rounding: the estimate is no less than that.
///
/// It is an estimate: where errors do not grow in proportion (near an unstable rest, in chaos) or
/// where both motions pass a law's edges differently, it says so (ErrorDoubt).
#pragma once

#include <string>

#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"
#include "variator_sim/status.h"

namespace variator_sim {

struct Motion;

/// The Simulation that moves the run gives the companion the same commands, and moves it, too.
class ErrorEstimate {
 public:
  /// The run is at its start.
  explicit ErrorEstimate(const Scene& scene);

  Simulation& companion() { return companion_; }
  /// Errors are counted from here on.
  void forget();
  /// Writes the estimated errors of the run's sample at its present into it. [loop]
  void judge(const Motion& run, Sample* sample);
  const ErrorDoubt& doubt() const { return doubt_; }
  std::string describe() const;

 private:
  /// Estimates the errors of a column; true when those of all shafts are at rounding. `largest`:
  /// the magnitudes up to now.
  bool compare(const double* run, const double* companion, double* largest, double* error);
  /// Notes where the laws of both have jumped a different number of times.
  void noteEdges(const Motion& run);

  Simulation companion_;
  const double relative_;  // tolerances of the run
  const double absolute_;
  double largest_[3][kMaxShafts] = {};
  bool is_grown_ = false;        // by the last sample
  double counts_differ_ = -1.0;  // since when, s
  ErrorDoubt doubt_;
};

/// How the companion of a run with these settings is stepped.
SolverSettings calcCompanionSettings(const SolverSettings& settings);

}  // namespace variator_sim
