/// What a whole step by series is made of: series_step.inc, as C++ sees it.
#pragma once

namespace variator_sim {

namespace series_step {
using Real = double;
#define SERIES_LANES 1
#include "dynamics/series_step_data.inc"
#undef SERIES_LANES
}  // namespace series_step
using series_step::SeriesLayout;
using series_step::SeriesStep;

}  // namespace variator_sim
