/// Python's values as parameter trees and back, and its errors.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include "variator_sim/parameter_tree.h"

namespace variator_sim::python {

namespace py = pybind11;

inline py::object errorClass(const char* name) {
  return py::module::import("variator_sim.errors").attr(name);
}

[[noreturn]] inline void raise(const py::object& error) {
  PyErr_SetObject(error.get_type().ptr(), error.ptr());
  throw py::error_already_set();
}

/// Returns the bytes of a file's name, which need not be UTF-8.
inline std::string readPath(const py::object& path) {
  return py::module::import("os").attr("fsencode")(path).cast<std::string>();
}

/// Warns the caller; throws where warnings are errors.
inline void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

/// Throws SceneError if `text` is no str, or has no UTF-8, as half of a surrogate pair.
inline std::string toText(py::handle text, const std::string& path) {
  if (!py::isinstance<py::str>(text)) {
    throw SceneError(path, std::string(py::repr(text)) + " is not a text");
  }
  Py_ssize_t size = 0;
  const char* const bytes = PyUnicode_AsUTF8AndSize(text.ptr(), &size);
  if (bytes != nullptr) return {bytes, static_cast<std::size_t>(size)};
  PyErr_Clear();
  throw SceneError(path, std::string(py::repr(text)) +
                             " is not valid Unicode: it contains half of a surrogate pair");
}

/// Returns the beginning of a value's text.
inline std::string shown(py::handle value) {
  return py::repr(value).attr("__getitem__")(py::slice(0, 80, 1)).cast<std::string>();
}

/// Reads an argument, whose name is `what`. Throws TypeError if it is no number.
inline double toNumber(const py::object& value, const std::string& what) {
  const double number = PyFloat_AsDouble(value.ptr());
  if (number != -1.0 || PyErr_Occurred() == nullptr) return number;
  PyErr_Clear();
  throw py::type_error(what + ": " + shown(value) + "; allowed: a number");
}

/// Does the same if it is no dict, nor pairs that one can be made of.
inline py::dict toDict(const py::object& value, const std::string& what,
                       const std::string& example) {
  const auto made = py::reinterpret_steal<py::object>(PyObject_CallFunctionObjArgs(
      reinterpret_cast<PyObject*>(&PyDict_Type), value.ptr(), nullptr));
  if (made) return py::reinterpret_borrow<py::dict>(made);
  PyErr_Clear();
  throw py::type_error(what + ": " + shown(value) + "; allowed: a dict such as " + example);
}

/// Reads one value. Lists, tuples and dicts may contain themselves or be shared, so depth and
/// number of values are bounded.
class TreeReader {
 public:
  /// Throws SceneError with the path of the faulty value.
  ParameterTree read(py::handle value, const std::string& path, int depth = 0) {
    if (depth > kDeepestNesting) {
      throw SceneError(path, "nested more than " + std::to_string(kDeepestNesting) +
                                 " deep; a list or dict that contains itself has no end");
    }
    if (++count_ > kMostValues) {
      throw SceneError(path, "more than " + std::to_string(kMostValues) + " values");
    }
    if (value.is_none()) return {};
    if (py::isinstance<py::bool_>(value)) return ParameterTree::boolean(value.cast<bool>());
    if (py::isinstance<py::str>(value)) return ParameterTree::text(toText(value, path));
    if (py::isinstance<py::dict>(value)) {
      return readDictionary(py::reinterpret_borrow<py::dict>(value), path, depth);
    }
    // Arrays and numbers of NumPy.
    if (py::hasattr(value, "tolist")) return read(value.attr("tolist")(), path, depth + 1);
    if (py::isinstance<py::float_>(value)) return ParameterTree::real(value.cast<double>());
    if (py::isinstance<py::int_>(value)) {
      int is_beyond = 0;
      const long long number = PyLong_AsLongLongAndOverflow(value.ptr(), &is_beyond);
      if (is_beyond == 0) return ParameterTree::integer(number);
      throw SceneError(path,
                       shown(value) + "; allowed: an integer of 64 bits, or a float such as 1e+30");
    }
    if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
      ParameterTree::List list;
      for (const py::handle item : value) {
        list.push_back(read(item, elementPath(path, list.size()), depth + 1));
      }
      return ParameterTree::list(std::move(list));
    }
    throw SceneError(path, std::string(py::repr(value)) +
                               " is neither a number, a boolean, a text, None, a list, an array "
                               "nor a dict");
  }

 private:
  static constexpr int kMostValues = 1000000;

  ParameterTree readDictionary(const py::dict& values, const std::string& path, int depth) {
    ParameterTree::Dictionary dictionary;
    for (const auto& [key, item] : values) {
      const std::string name = toText(key, path);
      dictionary.emplace(name, read(item, entryPath(path, name), depth + 1));
    }
    return ParameterTree::dictionary(std::move(dictionary));
  }

  int count_ = 0;
};

inline ParameterTree toTree(py::handle value, const std::string& path) {
  return TreeReader().read(value, path);
}

inline py::object toObject(const ParameterTree& tree) {
  switch (tree.kind()) {
    case ParameterTree::Kind::kNothing:
      return py::none();
    case ParameterTree::Kind::kBoolean:
      return py::bool_(tree.asBoolean());
    case ParameterTree::Kind::kInteger:
      return py::int_(tree.asInteger());
    case ParameterTree::Kind::kReal:
      return py::float_(tree.asReal());
    case ParameterTree::Kind::kText:
      return py::str(tree.asText());
    case ParameterTree::Kind::kList: {
      py::list list;
      for (const ParameterTree& item : tree.asList()) list.append(toObject(item));
      return std::move(list);
    }
    case ParameterTree::Kind::kDictionary: {
      py::dict dictionary;
      for (const auto& [key, item] : tree.asDictionary()) dictionary[py::str(key)] = toObject(item);
      return std::move(dictionary);
    }
  }
  return py::none();
}

}  // namespace variator_sim::python
