/// Many runs of one scene with other values, on all cores. It does not depend on Python.
#pragma once

#include <string>
#include <vector>

#include "python/session.h"

namespace variator_sim::python {

enum class MetricKind { kFinal, kMinimum, kMaximum, kMean, kIntegral, kSettlingTime };

/// One number of a run, from one of its columns.
struct Metric {
  MetricKind kind = MetricKind::kFinal;
  std::size_t column = 0;  ///< of RunRequest::columns
  /// For kSettlingTime: half width of the settled band, as a part of the change, end minus start.
  double band = 0.02;
};

/// Evaluates `rows` of `column_count` values, the time first; NaN without rows. kMean, kIntegral:
/// over time, by trapezoids. kSettlingTime: the first sample from which on the value stays within
/// the band around its last one, s since the start.
double calcMetric(const Metric& metric, const std::vector<double>& rows, std::size_t column_count);

struct SweepRequest {
  ParameterTree tree;
  Overrides overrides;             ///< the same for all runs
  std::vector<std::string> paths;  ///< keys whose values differ
  RunRequest run;
  std::vector<Metric> metrics;
  /// Compiles formulas without machine code in the cache before the runs.
  bool compiles = false;
};

/// One run of a sweep.
struct SweepRow {
  std::vector<double> metrics;  ///< NaN where the run failed
  std::string reason;           ///< "" or why it failed
};

/// Runs every row of `values` (one value a path) on `threads` threads, or on as many as can be
/// started; an Interruption of the calling thread ends all of them. A row's result depends neither
/// on the other rows nor on the number of threads. Any exception of a thread other than a row's
/// fault ends the others and is rethrown.
std::vector<SweepRow> runSweep(const SweepRequest& request,
                               const std::vector<std::vector<double>>& values, int threads,
                               ComponentFactory& factory);

}  // namespace variator_sim::python
