/// series_operation.inc as C++.
#pragma once

namespace variator_sim::expression {

#define SERIES_STATE double
#include "expression/series_operation.inc"
#undef SERIES_STATE

}  // namespace variator_sim::expression
