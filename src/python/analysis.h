/// Linear models and steady states for Python.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "python/named_sample.h"
#include "variator_sim/linear_model.h"
#include "variator_sim/trim.h"

namespace variator_sim::python {

namespace py = pybind11;

/// Reads a dict for Simulation::setState; missing values are those of the current time of
/// `simulation`, or of its start if the motion has stopped. Throws SceneError.
MotionState readState(const py::dict& values, Simulation& simulation);

/// Reads `fix`, a dict of numbers, and `free`, the same or names; None: empty. Throws SceneError.
TrimOptions readTrimOptions(const py::object& fix, const py::object& free, bool accelerating);

/// Returns a list of SteadyState; raises NoSteadyState if it is empty, warns of infinitely many.
/// `stabilities`: one per state.
py::list toList(const TrimResult& result, const std::vector<std::string>& stabilities,
                const Scene& scene);

/// Throws std::invalid_argument unless all are finite and the last dimension is the shaft count.
void checkAccelerations(const DenseArray& accelerations, const std::vector<std::string>& shafts);

void bindAnalysis(py::module& module);

}  // namespace variator_sim::python
