/// The text of series_operation.inc, series_resolution.inc and series_ranges.inc,
/// and that of runtime/operations.h, for kernels and emitted programs.
#pragma once

namespace variator_sim::expression {

extern const char* const kOperationsText;
extern const char* const kSeriesOperationText;
extern const char* const kSeriesResolutionText;
extern const char* const kSeriesRangesText;

}  // namespace variator_sim::expression
