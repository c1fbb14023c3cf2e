/// The places of a sample's numbers, for the class Sample of variator_sim/simulation.py.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstring>

#include "tools/columns.h"
#include "variator_sim/simulation.h"

namespace variator_sim::python {

namespace py = pybind11;

using Array = py::array_t<double>;
/// Contiguous doubles, converted from the caller's array if need be.
using DenseArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

class SampleLayout {
 public:
  explicit SampleLayout(const Simulation& simulation) {
    const Columns columns(simulation, {});
    for (std::size_t i = 0; i < columns.names().size(); ++i) {
      places_[py::str(columns.names()[i])] = columns.places()[i];
    }
    const auto add = [this](const char* name, std::size_t offset, std::size_t count) {
      const auto begin = static_cast<py::ssize_t>(offset / sizeof(double));
      slices_[name] = py::slice(begin, begin + static_cast<py::ssize_t>(count), 1);
    };
    const std::size_t shafts = simulation.scene().shafts.size();
    add("angle", offsetof(Sample, angle), shafts);
    add("velocity", offsetof(Sample, velocity), shafts);
    add("acceleration", offsetof(Sample, acceleration), shafts);
    add("applied_torque", offsetof(Sample, applied_torque), shafts);
    add("reaction_torque", offsetof(Sample, reaction_torque), shafts);
    add("reaction_torque_rate", offsetof(Sample, reaction_torque_rate), shafts);
    add("reaction_torque_covariant_rate", offsetof(Sample, reaction_torque_covariant_rate), shafts);
    const std::size_t constraints = simulation.scene().constraints.size();
    add("residual", offsetof(Sample, residual), constraints);
    add("multiplier", offsetof(Sample, multiplier), constraints);
  }

  /// Reads a column of `sample`. Returns false if there is none of this name.
  bool read(const Sample& sample, PyObject* column, double* value) const {
    PyObject* const place = PyDict_GetItemWithError(places_.ptr(), column);
    if (place == nullptr) {
      PyErr_Clear();
      return false;
    }
    *value = numberAt(sample, PyLong_AsSize_t(place));
    return true;
  }
  /// Returns a Sample of Python.
  py::object make(const Sample& sample) const {
    Array numbers(static_cast<py::ssize_t>(kSampleNumbers));
    std::memcpy(numbers.mutable_data(), &sample, sizeof(Sample));
    return class_(numbers, places_, slices_);
  }

 private:
  py::dict places_;  ///< of the columns among a sample's numbers
  py::dict slices_;  ///< of its arrays
  py::object class_ = py::module::import("variator_sim.simulation").attr("Sample");
};

}  // namespace variator_sim::python
