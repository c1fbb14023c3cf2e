/// series_operation.inc as C++.
#pragma once

namespace variator_sim::expression {

#include "expression/series_operation.inc"
inline bool seriesMayHide(const SeriesOperation* op, int order) {
  return op->kind > kSeriesFinite && op->degree > order;
}

}  // namespace variator_sim::expression
