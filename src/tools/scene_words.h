/// What is said about a scene calls its things as the scene does: shafts, inputs, tables, outputs.
#pragma once

#include <string>
#include <vector>

#include "expression/term_maker.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Text and LaTeX of the same words.
using Words = expression::Symbol;

/// Words without formulas: in LaTeX what means something there is escaped.
Words plainWords(const std::string& text);

/// w_drive and the like.
Words shaftWords(const Scene& scene, expression::Source of, int shaft);

/// What the formulas of the scene call their variables, tables and, by the outputs of elements,
/// their parts. `w_drive`, inputs and tables are called as formulas call them; an input without a
/// name goes by its topic, a table without a name by its place in the scene, each made unique.
expression::Names nameThings(const Scene& scene);

/// What the inputs and tables that occur in `nodes` are, one by one.
std::vector<Words> describeThings(const Scene& scene, const expression::Names& names,
                                  const std::vector<expression::Node>& nodes);

}  // namespace variator_sim
