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

#include "motion/motion.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

class ErrorEstimate {
 public:
  /// `run` has to outlive this and to be at its start.
  explicit ErrorEstimate(Motion& run);

  /// The companion follows to the present of the run. [loop]
  void follow() { companion_.advanceTo(run_.time()); }
  void interruptBy(const Interruption& interruption) { companion_.interruptBy(interruption); }
  void command(int input, double value) { companion_.command(input, value); }  ///< [loop]
  void reset();                                                                ///< [loop]
  /// The run has been set to this: errors are counted from there.
  void setState(const MotionState& state, bool project);
  bool loadMachineCode(bool compile) { return companion_.loadMachineCode(compile); }

  /// The run's sample at the present, with its estimated errors. [loop]
  const Sample& sample();
  const ErrorDoubt& doubt() const { return doubt_; }
  std::string describe() const;

 private:
  void forget();
  /// One of angle, velocity and acceleration: the estimates of all shafts.
  struct Column {
    double largest[kMaxShafts] = {};  ///< magnitude up to now
  };
  /// True when all of them are at rounding.
  bool compare(const double* run, const double* companion, Column& column, double* error);
  void note(const Sample& sample, bool is_at_rounding);
  void noteEdges();

  Motion& run_;
  Motion companion_;
  double relative_;  // tolerances of the run
  double absolute_;
  Column columns_[3];
  bool is_grown_ = false;        // by the last sample
  double counts_differ_ = -1.0;  // since when, s
  Sample sample_;
  ErrorDoubt doubt_;
};

/// How the companion of a run with these settings is stepped.
SolverSettings calcCompanionSettings(const SolverSettings& settings);

}  // namespace variator_sim
