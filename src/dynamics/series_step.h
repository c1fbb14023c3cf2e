/// What a whole step by series is made of: series_step.inc, as C++ sees it.
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

/// How far steps may go on before somebody has to look.
struct Reach {
  double target;      ///< s: none follows one that comes to it
  double horizon;     ///< s: none goes beyond
  double maximum;     ///< s: none is longer
  int most;           ///< steps; no more than kSeriesStride are made
  bool watches_rest;  ///< none follows one in which little has changed

  /// The longest step from t, s.
  double longestFrom(double t) const { return std::min(horizon - t, maximum); }
};

}  // namespace variator_sim
