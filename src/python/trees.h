/// Python's values as parameter trees and back.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include "variator_sim/errors.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim::python {

namespace py = pybind11;

inline ParameterTree toTree(py::handle value, const std::string& path);

inline ParameterTree dictionaryToTree(const py::dict& values, const std::string& path) {
  ParameterTree::Dictionary dictionary;
  for (const auto& [key, item] : values) {
    if (!py::isinstance<py::str>(key)) {
      throw SceneError(path, "key " + std::string(py::repr(key)) + " is not a text");
    }
    const auto name = key.cast<std::string>();
    std::string item_path = path;
    if (!path.empty()) item_path += "/";
    item_path += name;
    dictionary.emplace(name, toTree(item, item_path));
  }
  return ParameterTree::dictionary(std::move(dictionary));
}

/// Arrays and numbers of NumPy are what their `tolist()` is. Throws SceneError with the value's
/// path.
inline ParameterTree toTree(py::handle value, const std::string& path) {
  if (value.is_none()) return {};
  if (py::isinstance<py::bool_>(value)) return ParameterTree::boolean(value.cast<bool>());
  if (py::isinstance<py::str>(value)) return ParameterTree::text(value.cast<std::string>());
  if (py::isinstance<py::dict>(value)) {
    return dictionaryToTree(py::reinterpret_borrow<py::dict>(value), path);
  }
  if (py::hasattr(value, "tolist")) return toTree(value.attr("tolist")(), path);
  if (py::isinstance<py::float_>(value)) return ParameterTree::real(value.cast<double>());
  if (py::isinstance<py::int_>(value)) {
    const long long number = PyLong_AsLongLong(value.ptr());
    if (number == -1 && PyErr_Occurred() != nullptr) throw py::error_already_set();
    return ParameterTree::integer(number);
  }
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    ParameterTree::List list;
    for (const py::handle item : value) {
      list.push_back(toTree(item, path + "[" + std::to_string(list.size()) + "]"));
    }
    return ParameterTree::list(std::move(list));
  }
  throw SceneError(path, std::string(py::repr(value)) +
                             " is neither a number, a boolean, a text, None, a list, an array nor "
                             "a dict");
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
