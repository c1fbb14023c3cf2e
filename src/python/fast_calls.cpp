#include "python/fast_calls.h"

#include <vector>

#include "python/python_simulation.h"

namespace variator_sim::python {
namespace {

/// Returns the simulation of an object, or nullptr before its `__init__`.
PythonSimulation* find(PyObject* self) {
  const auto* const instance = reinterpret_cast<const py::detail::instance*>(self);
  void* const* const values = instance->simple_layout ? instance->simple_value_holder
                                                      : instance->nonsimple.values_and_holders;
  return values == nullptr ? nullptr : static_cast<PythonSimulation*>(values[0]);
}

PyObject* advance(PythonSimulation& simulation, PyObject* duration) {
  if (!PyFloat_CheckExact(duration)) return nullptr;
  if (!simulation.tryAdvance(PyFloat_AS_DOUBLE(duration))) return nullptr;
  Py_RETURN_NONE;
}

PyObject* read(PythonSimulation& simulation, PyObject* column) {
  double value;
  return simulation.tryRead(column, &value) ? PyFloat_FromDouble(value) : nullptr;
}

/// A method that tries `kShort`, which returns nullptr, without effect, if it does not apply.
template <PyObject* (*kShort)(PythonSimulation&, PyObject*)>
class FastCall {
 public:
  /// Replaces the method `name` permanently.
  static void put(const py::object& type, const char* name) {
    bound_ = py::object(type.attr(name)).release().ptr();
    definition_ = {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&call)),
                   METH_FASTCALL | METH_KEYWORDS, nullptr};
    auto* const python_type = reinterpret_cast<PyTypeObject*>(type.ptr());
    type.attr(name) =
        py::reinterpret_steal<py::object>(PyDescr_NewMethod(python_type, &definition_));
  }

 private:
  static PyObject* call(PyObject* self, PyObject* const* arguments, Py_ssize_t count,
                        PyObject* names) {
    if (count == 1 && names == nullptr) {
      PythonSimulation* const simulation = find(self);
      if (simulation != nullptr) {
        if (PyObject* const result = kShort(*simulation, arguments[0])) return result;
      }
    }
    const Py_ssize_t named = names == nullptr ? 0 : PyTuple_GET_SIZE(names);
    std::vector<PyObject*> all{self};
    all.insert(all.end(), arguments, arguments + count + named);
    return PyObject_Vectorcall(bound_, all.data(), static_cast<std::size_t>(count) + 1, names);
  }

  inline static PyObject* bound_ = nullptr;
  inline static PyMethodDef definition_{};
};

}  // namespace

void addFastCalls(const py::object& simulation_type) {
  FastCall<&advance>::put(simulation_type, "advance");
  FastCall<&read>::put(simulation_type, "__getitem__");
}

}  // namespace variator_sim::python
