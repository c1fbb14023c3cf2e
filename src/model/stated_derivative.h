/// A derivative that is stated, against the values of its function.
#pragma once

#include <functional>
#include <optional>

namespace variator_sim {

/// The derivative of `function` (of a step h) at 0 by differences of order 4, when it is not
/// `stated` beyond doubt; nothing otherwise. `scale` is a step that matters, `slack` what rounding
/// may have left in `stated`.
std::optional<double> findDisagreement(const std::function<double(double)>& function, double stated,
                                       double scale, double slack);

}  // namespace variator_sim
