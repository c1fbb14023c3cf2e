/// series_operation.inc as C++.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace variator_sim::expression {

#include "expression/series_operation.inc"

/// Writes the C that adds seriesHides of each operation which may hide something to `sum`, with the
/// reach of each row once. It reads the powers p, the order `last`, of at most `most`, and the rows
/// by the text that `row` returns.
std::string writeHiding(const std::vector<SeriesOperation>& operations, int most,
                        const std::function<std::string(int)>& row);

}  // namespace variator_sim::expression
