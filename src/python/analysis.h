/// Linear models and steady states for Python.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "python/named_sample.h"
#include "variator_sim/linear_model.h"
#include "variator_sim/simulation.h"
#include "variator_sim/trim.h"

namespace variator_sim::python {

namespace py = pybind11;

/// Reads a dict as Simulation::setState takes it; what it leaves out is as at the present of
/// `simulation`, or at its start where the motion has stopped. Throws SceneError.
MotionState readState(const py::dict& values, Simulation& simulation);

/// Of `fix` a dict of numbers; of `free` the same, or names; None: nothing. Throws SceneError.
TrimOptions readTrimOptions(const py::object& fix, const py::object& free, bool accelerating);

struct SteadyStates {
  TrimResult found;
  std::vector<std::string> stabilities;  ///< of each of them
};
/// Knows nothing of Python. Throws SceneError.
SteadyStates findSteadyStates(const Scene& scene, const TrimOptions& options);
/// A list of SteadyState; raises NoSteadyState where there is none, warns of infinitely many.
py::list toList(const SteadyStates& states, const Scene& scene);

/// Throws std::invalid_argument unless these are finite, one for each shaft in the last dimension.
void checkAccelerations(const DenseArray& accelerations, const std::vector<std::string>& shafts);

void bindAnalysis(py::module& module);

}  // namespace variator_sim::python
