/// Formulas as C.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// A function of C that computes `outputs`:
///     void NAME(double t, const double* p, const double* w, const double* e, const double* u,
///               const double* v, const double* a, const struct tables* T, double* y)
/// of the time, the angles, velocities and accelerations, and the inputs with their first and
/// second rates. Every operation rounds as a Tape's does, so that a compiler which keeps to the
/// order written (no -ffast-math, -ffp-contract=off) makes the same bits. `prelude` stands before
/// the first of them.
///
/// Tables stay where they are: they are asked through T, by their number in `tables` of the graph.
std::string writeFunction(const Graph& graph, const std::string& name,
                          const std::vector<Node>& outputs);
/// What functions need before them.
const char* prelude();
/// True when all of `outputs` can be written: nothing in them is a function of somebody's own.
bool isWritable(const Graph& graph, const std::vector<Node>& outputs);

}  // namespace variator_sim::expression
