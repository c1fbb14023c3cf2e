/// Writes out a scene's laws and its equations of motion.
///
/// Only `simulate` shows them, so this file stands with it: it turns names and formulas of the
/// model into text for readers, and no computation depends on it.
#pragma once

#include <vector>

#include "tools/scene_words.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// left = right
struct Equation {
  expression::TermPtr left;
  expression::TermPtr right;
};

struct EquationSection {
  Words title;
  std::vector<Words> sentences;
  std::vector<Equation> equations;
};

/// Returns the names, the shared terms, every torque and constraint, the equations of motion, and
/// the terms that are not computed.
std::vector<EquationSection> writeEquations(const Simulation& simulation);

}  // namespace variator_sim
