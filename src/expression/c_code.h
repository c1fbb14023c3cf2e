/// Formulas as C.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// The structure of generated C. It excludes numbers, which the code reads from an array, so that
/// formulas which differ in numbers alone share their code.
struct CodeStructure {
  std::vector<int> words;         ///< equal words mean the same C
  std::vector<double> constants;  ///< values of the code's array

  /// Notes a number; returns true when the code holds it as a literal, and not the array.
  bool note(double value);
};
/// True for 0, 1 and -1, which are literals in the code: a compiler simplifies their operations.
bool isWrittenOut(double value);
/// Writes a number as the code reads it: a literal if it is written out, else its array element.
std::string writeNumber(double value, std::size_t place);

/// Writes a C function that computes `outputs`:
///     void NAME(double t, const double* p, const double* w, const double* e, const double* u,
///               const double* v, const double* a, const struct tables* T, double* y)
/// from the time, the angles, velocities and accelerations, and the inputs with their first and
/// second rates. Every operation rounds as a Tape's does, so that a compiler which keeps the order
/// written (no -ffast-math, -ffp-contract=off) makes the same bits. `prelude` stands before the
/// first of them.
///
/// The function reads tables and constants through T, tables by their number in `tables` of the
/// graph, constants by the number from `addStructure` with `before` constants present.
std::string writeFunction(const Graph& graph, const std::string& name,
                          const std::vector<Node>& outputs, std::size_t before);
/// Adds the structure of the text of `writeFunction`.
void addStructure(const Graph& graph, const std::vector<Node>& outputs, CodeStructure* structure);
/// Returns the declarations that functions need before them.
const char* prelude();
/// True when all of `outputs` can be written: none of them contains an opaque function.
bool isWritable(const Graph& graph, const std::vector<Node>& outputs);

}  // namespace variator_sim::expression
