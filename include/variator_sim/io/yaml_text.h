/// A parameter tree as YAML text.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Returns the whole tree, uncut, in block style. Read again (YAML 1.1 or 1.2) it gives the same
/// tree: reals keep every bit and stay reals, texts stay texts.
std::string toYaml(const ParameterTree& tree);

}  // namespace variator_sim
