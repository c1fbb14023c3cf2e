/// The text of series_sine.inc, series_operation.inc and series_resolution.inc, for kernels and
/// emitted programs.
#pragma once

namespace variator_sim::expression {

extern const char* const kSeriesSineText;
extern const char* const kSeriesOperationText;
extern const char* const kSeriesResolutionText;

}  // namespace variator_sim::expression
