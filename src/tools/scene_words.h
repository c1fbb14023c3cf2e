/// Names shafts, inputs, tables and outputs in texts as the scene does.
#pragma once

#include <string>
#include <vector>

#include "expression/term_maker.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Text and LaTeX of a phrase.
using Words = expression::Symbol;

/// Returns words without formulas, escaped for LaTeX.
Words plainWords(const std::string& text);

/// Returns a symbol with the shaft's name as its index.
Words shaftWords(const Scene& scene, const char* text, const char* latex, int shaft);
/// Returns w_drive and the like.
Words shaftWords(const Scene& scene, expression::Source of, int shaft);

/// Returns the names of the formulas' variables, tables and, by the outputs of elements, terms.
/// `w_drive`, inputs and tables keep their names in formulas; an input without a name gets its
/// topic, a table without a name its place in the scene, each made unique.
expression::Names nameThings(const Scene& scene);

/// Describes the inputs and tables that occur in `nodes`, one by one.
std::vector<Words> describeThings(const Scene& scene, const expression::Names& names,
                                  const std::vector<expression::Node>& nodes);

}  // namespace variator_sim
