/// The text of series_step_data.inc, series_arrival.inc, series_step.inc, series_step_sample.inc
/// and series_step_lanes.inc, for kernels.
#pragma once

namespace variator_sim {

extern const char* const kSeriesStepData;
extern const char* const kSeriesStepArrival;
extern const char* const kSeriesStepText;
extern const char* const kSeriesStepSample;
extern const char* const kSeriesStepLanes;

}  // namespace variator_sim
