/// Bounds of parameter trees from all sources: readers walk through them recursively.
#pragma once

namespace variator_sim {

constexpr int kDeepestNesting = 64;

}  // namespace variator_sim
