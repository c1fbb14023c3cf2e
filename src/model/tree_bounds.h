/// Bounds of parameter trees, wherever they come from: readers walk through them recursively.
#pragma once

namespace variator_sim {

constexpr int kDeepestNesting = 64;

}  // namespace variator_sim
