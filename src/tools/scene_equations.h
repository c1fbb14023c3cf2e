/// What a scene's motion obeys, written out: its laws and its equations of motion.
///
/// It stands with `simulate`, which alone shows it: it joins what the model, the formulas and the
/// motion know of themselves into sentences for people, and nothing that moves needs it.
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

/// The names, the parts in common, every torque and constraint, the equations of motion, and what
/// is not computed.
std::vector<EquationSection> writeEquations(const Simulation& simulation);

}  // namespace variator_sim
