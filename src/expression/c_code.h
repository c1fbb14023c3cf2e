/// Formulas as C.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// What generated C is made of. Numbers are no part of it: it reads them from an array, so that
/// formulas which differ in nothing else share their code.
struct CodeStructure {
  std::vector<int> words;         ///< those of equal ones are written as the same C
  std::vector<double> constants;  ///< what the code finds in its array

  /// Notes a number that may stand in the code; true when it does, and not in the array.
  bool note(double value);
};
/// True for 0, 1 and -1, which stand in the code: a compiler leaves out what they do.
bool isWrittenOut(double value);
/// How the code reads a number: itself where it is written out, else its place in the array.
std::string writeNumber(double value, std::size_t place);

/// A function of C that computes `outputs`:
///     void NAME(double t, const double* p, const double* w, const double* e, const double* u,
///               const double* v, const double* a, const struct tables* T, double* y)
/// of the time, the angles, velocities and accelerations, and the inputs with their first and
/// second rates. Every operation rounds as a Tape's does, so that a compiler which keeps to the
/// order written (no -ffast-math, -ffp-contract=off) makes the same bits. `prelude` stands before
/// the first of them.
///
/// Tables and constants stay where they are: they are asked through T, tables by their number in
/// `tables` of the graph, constants by that which `addStructure` gives them when `before` constants
/// are there already.
std::string writeFunction(const Graph& graph, const std::string& name,
                          const std::vector<Node>& outputs, std::size_t before);
/// What `writeFunction` makes its text from.
void addStructure(const Graph& graph, const std::vector<Node>& outputs, CodeStructure* structure);
/// What functions need before them.
const char* prelude();
/// True when all of `outputs` can be written: nothing in them is a function of somebody's own.
bool isWritable(const Graph& graph, const std::vector<Node>& outputs);

}  // namespace variator_sim::expression
