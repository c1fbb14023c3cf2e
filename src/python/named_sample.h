/// Samples that know their columns, for Python.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tools/columns.h"
#include "variator_sim/message_text.h"
#include "variator_sim/simulation.h"

namespace variator_sim::python {

namespace py = pybind11;

using Array = py::array_t<double>;
/// Contiguous doubles, converted from the caller's array if need be.
using DenseArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

inline Array toArray(const double* values, std::size_t count) {
  return Array(static_cast<py::ssize_t>(count), values);
}

/// Forbids objects made by Python, even empty ones by `__new__`: pybind11 would read memory that is
/// not initialized.
inline void refuseNew(const py::object& type) {
  reinterpret_cast<PyTypeObject*>(type.ptr())->tp_new = nullptr;
}

/// Names of a scene's columns that a sample has, shared by all samples of a simulation.
struct SampleNames {
  SampleNames(std::vector<std::string> its_names, py::dict its_places, std::size_t shaft_count,
              std::size_t constraint_count)
      : names(std::move(its_names)),
        shafts(shaft_count),
        constraints(constraint_count),
        places(std::move(its_places)) {}
  explicit SampleNames(const Simulation& simulation)
      : shafts(simulation.scene().shafts.size()),
        constraints(simulation.scene().constraints.size()) {
    const Columns columns(simulation, {});
    names = columns.names();
    for (std::size_t i = 0; i < names.size(); ++i) places[py::str(names[i])] = columns.places()[i];
  }

  /// Reads a column of `sample`. Returns false if there is none of this name.
  bool read(const Sample& sample, PyObject* column, double* value) const {
    PyObject* const place = PyDict_GetItemWithError(places.ptr(), column);
    if (place == nullptr) {
      PyErr_Clear();
      return false;
    }
    *value = numberAt(sample, PyLong_AsSize_t(place));
    return true;
  }
  double get(const Sample& sample, py::handle column) const {
    double value;
    if (read(sample, column.ptr(), &value)) return value;
    const auto name = py::str(column).attr("encode")("utf-8", "replace").cast<std::string>();
    throw py::key_error(inQuotes(name) + " is no column of a sample" + suggestAmong(name, names));
  }

  std::vector<std::string> names;  ///< of the state's columns
  std::size_t shafts;
  std::size_t constraints;
  py::dict places;  ///< by column, which of a sample's numbers it is
};

struct NamedSample {
  Sample sample;
  std::shared_ptr<const SampleNames> names;

  double at(py::handle column) const { return names->get(sample, column); }
  /// True where each column is the same number, or neither is one.
  bool isSame(const NamedSample& other) const {
    if (names->names != other.names->names) return false;
    return std::all_of(names->names.begin(), names->names.end(), [&](const std::string& name) {
      const double a = at(py::str(name));
      const double b = other.at(py::str(name));
      return a == b || (std::isnan(a) && std::isnan(b));
    });
  }
  /// Returns the sample of a pickle. Throws ValueError for those of another version.
  static NamedSample restored(const std::vector<std::string>& names, const py::dict& places,
                              std::size_t shafts, std::size_t constraints,
                              const std::string& bytes) {
    if (bytes.size() != sizeof(Sample))
      throw py::value_error("a Sample of another version of variator_sim");
    NamedSample made{{}, std::make_shared<const SampleNames>(names, places, shafts, constraints)};
    std::memcpy(&made.sample, bytes.data(), sizeof(Sample));
    return made;
  }
};

}  // namespace variator_sim::python
