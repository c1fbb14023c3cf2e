/// Samples that know their columns, for Python.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstring>
#include <memory>
#include <numeric>
#include <string>
#include <type_traits>
#include <vector>

#include "tools/columns.h"
#include "variator_sim/message_text.h"
#include "variator_sim/nearest_name.h"
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
  explicit SampleNames(const Simulation& simulation)
      : names(columnNames(simulation, {})),
        shafts(simulation.scene().shafts.size()),
        constraints(simulation.scene().constraints.size()) {
    // Every column is one number of a sample; a sample of indices shows which.
    constexpr std::size_t kNumbers = sizeof(Sample) / sizeof(double);
    static_assert(std::is_standard_layout_v<Sample> && kNumbers * sizeof(double) == sizeof(Sample));
    double numbers[kNumbers];
    std::iota(numbers, numbers + kNumbers, 0.0);
    Sample numbered;
    std::memcpy(&numbered, numbers, sizeof(Sample));
    std::vector<double> row(names.size());
    RowMaker(simulation, {}).write(numbered, nullptr, row.data());
    for (std::size_t i = 0; i < names.size(); ++i) {
      places[py::str(names[i])] = static_cast<std::size_t>(row[i]);
    }
  }

  /// Reads a column of `sample`. Returns false if there is none of this name.
  bool read(const Sample& sample, PyObject* column, double* value) const {
    PyObject* const place = PyDict_GetItemWithError(places.ptr(), column);
    if (place == nullptr) {
      PyErr_Clear();
      return false;
    }
    const auto* const bytes = reinterpret_cast<const char*>(&sample);
    std::memcpy(value, bytes + PyLong_AsSize_t(place) * sizeof(double), sizeof(double));
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
};

}  // namespace variator_sim::python
