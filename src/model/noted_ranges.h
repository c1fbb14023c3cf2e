/// A record of the ranges that a scene's reader allows, for programs that let others set numbers.
#pragma once

#include <map>
#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Records from now on, by their paths, the ranges of the numbers that readers of this thread read
/// or take as defaults (ParameterReader::noteNumbers); nullptr ends the record.
void noteRanges(std::map<std::string, Range>* ranges);

}  // namespace variator_sim
