/// Methods that controllers in lockstep call a million times, past pybind11's dispatch.
#pragma once

#include <pybind11/pybind11.h>

namespace variator_sim::python {

/// Puts shorter ways before `advance` and `[column]` of Simulation: one argument of the expected
/// kind and nothing that fails; all else goes on as bound.
void addFastCalls(const pybind11::object& simulation_type);

}  // namespace variator_sim::python
