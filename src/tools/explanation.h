/// Lays out the equations of a scene for `simulate --explain`.
#pragma once

#include <string>
#include <vector>

#include "tools/scene_equations.h"

namespace variator_sim {

/// Lays out for a terminal: aligned equal signs, broken sums in place of long lines.
std::string layOutText(const std::vector<EquationSection>& sections, const std::string& title);
/// Returns a whole document for pdflatex with amsmath.
std::string layOutLatex(const std::vector<EquationSection>& sections, const std::string& title);

}  // namespace variator_sim
