/// What a whole step by series is made of: series_step.inc, as C++ sees it.
#pragma once

namespace variator_sim {

namespace series_step {
using Real = double;
#include "dynamics/series_step_data.inc"
}  // namespace series_step
using series_step::SeriesLayout;
using series_step::SeriesStep;

}  // namespace variator_sim
