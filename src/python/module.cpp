/// The Python module variator_sim._core: its names and their bindings.

#include <pybind11/complex.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model/table_file.h"
#include "python/python_simulation.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim::python {
namespace {

py::dict statistics(PythonSimulation& self) {
  const Statistics& counts = self.get().statistics();
  return toDictionary(
      std::array{"steps", "rejected_steps", "right_hand_sides", "projections", "newton_iterations",
                 "implicit_steps", "jumps", "sleeps", "commands_accepted", "commands_clamped",
                 "commands_refused", "command_timeouts"},
      std::array{counts.steps, counts.rejected_steps, counts.right_hand_sides, counts.projections,
                 counts.newton_iterations, counts.implicit_steps, counts.jumps, counts.sleeps,
                 counts.commands_accepted, counts.commands_clamped, counts.commands_refused,
                 counts.command_timeouts});
}

using CommandTuple = std::tuple<double, std::string, double>;

using Times = std::optional<std::vector<double>>;

RunRequest makeRequest(double duration, double rate, const Times& times,
                       const std::vector<CommandTuple>& commands, const std::string& columns,
                       bool until_rest) {
  RunRequest request{duration, rate, times, {}, readColumnGroups(columns), until_rest};
  for (const auto& [time, topic, value] : commands) {
    const int line = static_cast<int>(request.commands.size());
    request.commands.push_back({time, topic, value, line});
  }
  return request;
}

void bindSweep(py::module& module) {
  py::class_<Sweep, std::shared_ptr<Sweep>>(module, "_Sweep")
      .def(py::init([](const py::object& scene, const py::object& overrides,
                       std::vector<std::string> paths, double duration, double rate,
                       const Times& times, const std::vector<CommandTuple>& commands,
                       const std::string& columns, bool compiles) {
        return std::shared_ptr<Sweep>(new Sweep{
            withOverrides(readSceneArgument(scene), readOverrides(overrides)), std::move(paths),
            makeRequest(duration, rate, times, commands, columns, false), makePluginFactory(),
            CodeOfRows(compiles)});
      }))
      .def("cancel", [](Sweep& self) { self.is_cancelled = true; });
  py::class_<RowRunner>(module, "_RowRunner")
      .def(py::init<std::shared_ptr<Sweep>>())
      .def("run", [](RowRunner& self, const std::vector<double>& values, py::ssize_t columns) {
        SweepRow row;
        {
          const py::gil_scoped_release release;
          row = self.run(values);
        }
        const auto samples = static_cast<py::ssize_t>(row.values.size()) / columns;
        return py::make_tuple(Array({samples, columns}, row.values.data()), row.reason);
      });
}

void translateErrors() {
  // (pybind11 calls it by value.) NOLINTNEXTLINE(performance-unnecessary-value-param)
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const SceneError& error) {
      const py::object python_error = errorClass("SceneError")(error.what(), error.keyPath());
      PyErr_SetObject(python_error.get_type().ptr(), python_error.ptr());
    } catch (const CommandFileError& error) {
      PyErr_SetString(PyExc_ValueError, error.what());
    }
  });
}

/// Binds the read-only properties.
void bindViews(py::class_<PythonSimulation>& simulation) {
  using Self = PythonSimulation;
  for (const QuantityGroup group : kQuantityGroups) {
    simulation.def_property_readonly(toString(group),
                                     [group](Self& s) { return s.quantities(group); });
  }
  const auto add_list = [&simulation](const char* name, auto parts, auto value) {
    simulation.def_property_readonly(name, [parts, value](const Self& s) {
      py::list list;
      for (const auto& part : s.scene().*parts) list.append(value(part));
      return list;
    });
  };
  add_list("shafts", &Scene::shafts, [](const std::string& shaft) { return shaft; });
  add_list("constraints", &Scene::constraints, [](const auto& row) { return row->name(); });
  add_list("orders", &Scene::constraints, [](const auto& row) { return row->order(); });
  simulation.def_property_readonly("topics", [](const Self& s) {
    py::list list;
    for (const CommandInputSettings& input : s.scene().inputs) {
      if (input.kind == InputKind::kCommanded) list.append(input.topic);
    }
    return list;
  });
  simulation.def_property_readonly("energy", &Self::energy)
      .def_property_readonly("scene", [](const Self& s) { return toObject(s.scene().resolved); })
      .def_property_readonly("stepper", [](Self& s) { return s.get().describeStepper(); })
      .def_property_readonly("machine_code", [](Self& s) { return s.get().machineCode(); })
      .def_property_readonly("is_sleeping", [](Self& s) { return s.get().isSleeping(); })
      .def_property_readonly("doubts", [](Self& s) { return describeDoubts(s.get()); })
      .def_property_readonly("statistics", &statistics)
      .def(
          "columns",
          [](Self& s, const std::string& groups) { return s.columnsOf(readColumnGroups(groups)); },
          py::arg("groups") = "state");
}

void bindSimulation(py::module& module) {
  using Self = PythonSimulation;
  py::class_<Self> simulation(module, "Simulation");
  simulation
      .def(py::init([](const py::object& scene, const py::object& overrides, bool energy) {
             return std::unique_ptr<Self>(::new Self(scene, overrides, energy));
           }),
           py::arg("scene"), py::arg("overrides") = py::none(), py::kw_only(),
           py::arg("energy") = false)
      .def_property_readonly("time", &Self::time)
      .def("advance", &Self::advance, py::arg("duration"))
      .def("advance_to", py::overload_cast<const py::object&>(&Self::advanceTo), py::arg("time"))
      .def("step", &Self::step, py::arg("duration"), py::arg("commands") = py::none())
      .def("command", &Self::command, py::arg("topic"), py::arg("value"))
      .def("sample", &Self::sample)
      .def("__getitem__", &Self::read, py::arg("column"))
      .def("state", &Self::state)
      .def("set_state", &Self::setState, py::arg("state"), py::arg("project") = false)
      .def("reset", &Self::reset)
      .def("take_events", &Self::takeEvents)
      .def("_linearize", &Self::linearize)
      .def("_trim", &Self::trim)
      .def("_residuals", &Self::residuals)
      .def("compile", &Self::compile)
      .def(
          "_run",
          [](Self& s, double duration, double rate, const Times& times,
             const std::vector<CommandTuple>& commands, const std::string& columns, bool until_rest,
             const std::vector<std::string>& gradient) {
            return s.run(makeRequest(duration, rate, times, commands, columns, until_rest),
                         gradient);
          },
          py::arg("duration"), py::arg("rate"), py::arg("times"), py::arg("commands"),
          py::arg("columns"), py::arg("until_rest"),
          py::arg("gradient") = std::vector<std::string>{});
  bindViews(simulation);
}

}  // namespace
}  // namespace variator_sim::python

PYBIND11_MODULE(_core, module) {
  using namespace variator_sim;
  namespace py = pybind11;
  python::translateErrors();
  python::bindSimulation(module);
  python::bindSweep(module);
  module.def("_describe_scene", [](const py::object& scene, const py::object& overrides) {
    // Numbers keep all bits, unlike Python's str() of an array.
    std::string text = toYaml(python::readSceneArgument(scene));
    for (const auto& [path, value] : python::readOverrides(overrides)) {
      text += toYaml(ParameterTree::text(path)) + toYaml(value);
    }
    return text;
  });
  module.def("_format", &formatNumber);
  module.def("_file_path", [](const std::string& name) { return filePathOf(name, "file"); });
  module.def("read_commands", [](const py::object& path) {
    std::vector<python::CommandTuple> commands;
    for (const TimedCommand& command : readCommandFile(python::readPath(path))) {
      commands.emplace_back(command.time, command.topic, command.value);
    }
    return commands;
  });
}
