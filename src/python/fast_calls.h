/// Methods that controllers in lockstep call a million times, past pybind11's dispatch.
#pragma once

#include <pybind11/pybind11.h>

namespace variator_sim::python {

/// Puts fast paths before `advance` and `[column]` of Simulation, for one argument of the expected
/// type and no failure; other calls take the bound methods.
void addFastCalls(const pybind11::object& simulation_type);

}  // namespace variator_sim::python
