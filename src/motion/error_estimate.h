/// Estimates of the global error of every sample.
///
/// A second motion of the same scene, its companion, gets the same commands at the same instants
/// and is stepped more finely. The error of the run at t, to first order in both, is
///
///     x(t) - x*(t) = (x(t) - y(t)) + (y(t) - x*(t)),    x run, y companion, x* exact,
///
/// and the last part is small against the first one: the estimate is |x - y|, in angles, velocities
/// and accelerations alike. It contains the errors of dense output, projections, jumps and events
/// of the run, but not the rounding that both share, which bounds the estimate from below.
///
/// If errors do not grow in proportion (near an unstable equilibrium, in chaos), or both motions
/// pass a law's events differently, the estimate says so (ErrorDoubt).
#pragma once

#include <cstdint>
#include <string>

#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"
#include "variator_sim/status.h"

namespace variator_sim {

struct Motion;

/// The Simulation gives the companion the same commands as the run and advances it, too.
class ErrorEstimate {
 public:
  /// Expects the run at its start.
  explicit ErrorEstimate(const Scene& scene);

  Simulation& companion() { return companion_; }
  /// Counts errors from here on.
  void forget();
  /// Writes the estimated errors of the run's sample at its current time into it. [loop]
  void judge(Motion& run, Sample* sample);
  const ErrorDoubt& doubt() const { return doubt_; }
  std::string describe() const;

 private:
  /// Estimates the errors of a column of `count` values; true when all are at rounding. `largest`:
  /// the largest magnitudes so far.
  bool compare(const double* run, const double* companion, std::size_t count, double* largest,
               double* error);
  /// Notes when the laws of both have jumped a different number of times.
  void noteEdges(Motion& run);

  Simulation companion_;
  const double relative_;  // tolerances of the run
  const double absolute_;
  double largest_[3][kMaxShafts] = {};
  double largest_state_[kMaxInputs] = {};
  bool is_grown_ = false;          // by the last sample
  double counts_differ_ = -1.0;    // start of the difference, s
  std::int64_t counted_more_ = 0;  // events of the run less those of its companion
  ErrorDoubt doubt_;
};

}  // namespace variator_sim
