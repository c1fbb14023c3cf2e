#include "python/analysis.h"

#include <pybind11/complex.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cmath>
#include <stdexcept>

#include "python/trees.h"
#include "tools/analysis_text.h"
#include "tools/simulate_options.h"
#include "variator_sim/message_text.h"

namespace variator_sim::python {
namespace {

struct SteadyState {
  py::dict state;
  double residual;
  std::vector<std::string> undetermined;
  std::string stability;
};

/// Reads {"w_drive": 10}, or, for free quantities without a start, a name or a list of names.
std::vector<TrimChoice> readChoices(const py::object& choices) {
  std::vector<TrimChoice> read;
  if (choices.is_none()) return read;
  const auto add = [&read](py::handle name) {
    read.emplace_back();
    read.back().name = toText(name, "fix and free");
  };
  if (py::hasattr(choices, "items")) {
    for (const py::handle item : choices.attr("items")()) {
      const auto pair = item.cast<py::tuple>();
      add(pair[0]);
      if (!pair[1].is_none()) read.back().value = pair[1].cast<double>();
    }
  } else if (py::isinstance<py::str>(choices)) {
    add(choices);
  } else {
    for (const py::handle name : choices) add(name);
  }
  return read;
}

void checkFixed(const std::vector<TrimChoice>& fix) {
  for (const TrimChoice& choice : fix) {
    if (!std::isfinite(choice.value)) {
      throw SceneError("fix", inQuotes(choice.name) + ": " + formatNumber(choice.value) +
                                  "; allowed: a finite number");
    }
  }
}

void save(const LinearModel& model, const py::object& path) {
  const std::string name = readPath(path);
  py::object content = py::bytes(writeModel(model));
  try {
    const std::string ending = endingOfModel(name);
    if (ending != ".csv") {
      content = py::module::import("variator_sim.linear_model_files")
                    .attr("convert")(writeModel(model), ending);
    }
  } catch (const UsageError& error) {
    throw py::value_error(error.what());
  }
  py::module::import("variator_sim.files").attr("write_bytes")(path, content);
}

/// Copies arrays: a view would keep the model alive, and be read-only.
template <typename Member>
auto copyOf(Member LinearModel::*member) {
  return [member](const LinearModel& model) -> Member { return model.*member; };
}

}  // namespace

MotionState readState(const py::dict& values, Simulation& simulation) {
  MotionState present;
  if (!simulation.peekState(&present)) {
    Simulation start(simulation.scene());
    start.peekState(&present);
  }
  return readMotionState(toTree(values, "state"), simulation.scene(), present);
}

TrimOptions readTrimOptions(const py::object& fix, const py::object& free, bool accelerating) {
  TrimOptions options;
  options.fix = readChoices(fix);
  options.free = readChoices(free);
  options.accelerating = accelerating;
  checkFixed(options.fix);
  return options;
}

py::list toList(const TrimResult& result, const std::vector<std::string>& stabilities,
                const Scene& scene) {
  if (result.states.empty()) {
    raise(errorClass("NoSteadyState")(result.message));
  }
  if (!result.states.front().undetermined.empty()) warn(result.message);
  py::list list;
  for (std::size_t i = 0; i < result.states.size(); ++i) {
    const TrimState& found = result.states[i];
    const ParameterTree tree = variator_sim::toTree(makeState(found.point, scene), scene);
    list.append(SteadyState{toObject(tree), found.residual, found.undetermined, stabilities[i]});
  }
  return list;
}

void checkAccelerations(const DenseArray& accelerations, const std::vector<std::string>& shafts) {
  const py::ssize_t dimensions = accelerations.ndim();
  const auto count = static_cast<py::ssize_t>(shafts.size());
  if (dimensions == 0 || accelerations.shape(dimensions - 1) != count) {
    const auto found = dimensions == 0 ? std::string("one number")
                                       : std::to_string(accelerations.shape(dimensions - 1)) +
                                             " in the last dimension";
    throw std::invalid_argument("accelerations: " + found + "; allowed: " + std::to_string(count) +
                                ", one for each shaft (" + joinNames(shafts) + ")");
  }
  const double* const values = accelerations.data();
  for (py::ssize_t i = 0; i < accelerations.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    const std::string& shaft = shafts[static_cast<std::size_t>(i % count)];
    throw std::invalid_argument("accelerations: " + formatNumber(values[i]) + " for shaft " +
                                inQuotes(shaft) + "; allowed: finite numbers");
  }
}

void bindAnalysis(py::module& module) {
  py::class_<LinearModel> model(module, "LinearModel");
  refuseNew(model);
  model.def_property_readonly("A", copyOf(&LinearModel::A))
      .def_property_readonly("B", copyOf(&LinearModel::B))
      .def_property_readonly("C", copyOf(&LinearModel::C))
      .def_property_readonly("D", copyOf(&LinearModel::D))
      .def_property_readonly("x", copyOf(&LinearModel::x))
      .def_property_readonly("u", copyOf(&LinearModel::u))
      .def_property_readonly("y", copyOf(&LinearModel::y))
      .def_property_readonly("x_rate", copyOf(&LinearModel::x_rate))
      .def_readonly("time", &LinearModel::time)
      .def_readonly("states", &LinearModel::states)
      .def_readonly("inputs", &LinearModel::inputs)
      .def_readonly("outputs", &LinearModel::outputs)
      .def_readonly("notes", &LinearModel::notes)
      .def_property_readonly("eigenvalues",
                             [](const LinearModel& self) {
                               const auto values = calcEigenvalues(self);
                               return Eigen::VectorXcd(Eigen::Map<const Eigen::VectorXcd>(
                                   values.data(), static_cast<Eigen::Index>(values.size())));
                             })
      .def("save", &save, py::arg("path"))
      .def("__str__", [](const LinearModel& self) { return describeModel(self, true); })
      .def("__repr__", [](const LinearModel& self) {
        return "<LinearModel at " + formatNumber(self.time) +
               " s: " + std::to_string(self.states.size()) + " states, " +
               std::to_string(self.inputs.size()) + " inputs, " +
               std::to_string(self.outputs.size()) + " outputs>";
      });

  py::class_<SteadyState> steady_state(module, "SteadyState");
  refuseNew(steady_state);
  steady_state.def_readonly("state", &SteadyState::state)
      .def_readonly("residual", &SteadyState::residual)
      .def_readonly("undetermined", &SteadyState::undetermined)
      .def_readonly("stability", &SteadyState::stability)
      .def("__repr__", [](const SteadyState& self) {
        return "<SteadyState " + py::repr(self.state).cast<std::string>() + ", " + self.stability +
               ">";
      });
}

}  // namespace variator_sim::python
