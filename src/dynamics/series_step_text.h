/// The text of series_step_data.inc and series_step.inc, for kernels.
#pragma once

namespace variator_sim {

extern const char* const kSeriesStepData;
extern const char* const kSeriesStepText;

}  // namespace variator_sim
