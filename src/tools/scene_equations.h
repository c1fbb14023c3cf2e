/// Writes out a scene's laws and its equations of motion for `simulate --explain`.
///
/// Only `simulate` shows them, so this file stands with it: it turns names and formulas of the
/// model into text for readers, and no computation depends on it.
#pragma once

#include <string>
#include <vector>

#include "expression/term_maker.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/simulation.h"

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

/// Lays out for a terminal: aligned equal signs, broken sums in place of long lines.
std::string layOutText(const std::vector<EquationSection>& sections, const std::string& title);
/// Returns a whole document for pdflatex with amsmath.
std::string layOutLatex(const std::vector<EquationSection>& sections, const std::string& title);

}  // namespace variator_sim
