#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "variator_sim/errors.h"

namespace variator_sim {

/// True when `values` has `value`.
template <class Value, class Wanted>
bool contains(const std::vector<Value>& values, const Wanted& value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

/// Returns the candidate most like `name` (fewest edits: insertion, deletion, substitution, swap of
/// neighbours; letter case counts half), or an empty string when none is near enough to be meant.
std::string findNearestName(const std::string& name, const std::vector<std::string>& candidates);

/// Returns " (did you mean 'x'?)" for the nearest candidate, or an empty string.
std::string suggestName(const std::string& name, const std::vector<std::string>& candidates);
/// Returns the same and "; allowed: x, y", or "; allowed: none".
std::string suggestAmong(const std::string& name, const std::vector<std::string>& allowed);
/// Returns the index of `name` in `allowed`. Throws SceneError at `path`, which says that the name
/// `is_not` ("is not a shaft") and what is allowed.
int placeOf(const std::string& name, const std::vector<std::string>& allowed,
            const std::string& path, const std::string& is_not);

}  // namespace variator_sim
