/// The data of a step by series: series_step.inc as C++.
#pragma once

#include <algorithm>

namespace variator_sim {

namespace series_step {
using Real = double;
#define SERIES_LANES 1
#include "dynamics/series_step_data.inc"
#undef SERIES_LANES
}  // namespace series_step
using series_step::SeriesLayout;
using series_step::SeriesNode;
using series_step::SeriesSample;
using series_step::SeriesStep;

/// Limits up to which steps continue without a check by the caller.
struct Reach {
  double target;      ///< s: no step follows one that reaches it
  double horizon;     ///< s: no step ends beyond it
  double maximum;     ///< s: maximum step length
  int most;           ///< steps; no more than kSeriesStride are made
  bool watches_rest;  ///< no step follows one with little change

  /// Returns the longest step from t, s.
  double longestFrom(double t) const { return std::min(horizon - t, maximum); }
};

}  // namespace variator_sim
