#pragma once

#include <string>
#include <vector>

#include "variator_sim/message_text.h"

namespace variator_sim {

/// Returns the candidate most like `name` (fewest edits: insertion, deletion, substitution, swap of
/// neighbours; letter case counts half), or an empty string when none is near enough to be meant.
std::string findNearestName(const std::string& name, const std::vector<std::string>& candidates);

/// Returns " (did you mean 'x'?)" for the nearest candidate, or an empty string.
std::string suggestName(const std::string& name, const std::vector<std::string>& candidates);
/// Returns the same and "; allowed: x, y", or "; allowed: none".
std::string suggestAmong(const std::string& name, const std::vector<std::string>& allowed);

}  // namespace variator_sim
