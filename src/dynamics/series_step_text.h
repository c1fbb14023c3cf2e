/// The text of series_step_data.inc, series_step.inc and series_step_lanes.inc, for kernels.
#pragma once

namespace variator_sim {

extern const char* const kSeriesStepData;
extern const char* const kSeriesStepText;
extern const char* const kSeriesStepLanes;

}  // namespace variator_sim
