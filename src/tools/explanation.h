/// What `simulate --explain` prints: the equations of a scene, laid out.
#pragma once

#include <string>
#include <vector>

#include "tools/scene_equations.h"

namespace variator_sim {

/// For a terminal: equal signs below each other, sums broken where a line would be too long.
std::string layOutText(const std::vector<EquationSection>& sections, const std::string& title);
/// A whole document for pdflatex with amsmath.
std::string layOutLatex(const std::vector<EquationSection>& sections, const std::string& title);

}  // namespace variator_sim
