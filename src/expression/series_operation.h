/// series_operation.inc as C++.
#pragma once

namespace variator_sim::expression {

#include "expression/series_operation.inc"

}  // namespace variator_sim::expression
