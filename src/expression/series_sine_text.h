/// The text of series_sine.inc, for kernels.
#pragma once

namespace variator_sim::expression {

extern const char* const kSeriesSineText;

}  // namespace variator_sim::expression
