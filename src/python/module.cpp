/// The Python module variator_sim._core: the only file that knows pybind11 (with trees.h).

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "python/analysis.h"
#include "python/session.h"
#include "python/sweep.h"
#include "python/trees.h"
#include "ros/plugin_loader.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim::python {
namespace {

using Array = py::array_t<double>;

py::object errorClass(const char* name) {
  return py::module_::import("variator_sim.errors").attr(name);
}

[[noreturn]] void raise(const py::object& error) {
  PyErr_SetObject(py::type::handle_of(error).ptr(), error.ptr());
  throw py::error_already_set();
}

Array toArray(const double* values, std::size_t count) {
  return Array(static_cast<py::ssize_t>(count), values);
}

// --- Samples

/// Names of a scene's columns that a sample has, shared by all samples of a simulation.
struct SampleNames {
  std::vector<std::string> names;  ///< of the state's columns
  std::map<std::string, std::size_t> places;
  RowMaker rows;
  std::size_t shafts;
  std::size_t constraints;
};

struct NamedSample {
  Sample sample;
  std::shared_ptr<const SampleNames> names;

  std::vector<double> row() const {
    std::vector<double> values(names->rows.columnCount());
    names->rows.write(sample, nullptr, values.data());
    return values;
  }
  double at(const std::string& column) const {
    const auto place = names->places.find(column);
    if (place == names->places.end()) {
      throw py::key_error(inQuotes(column) + " is no column of a sample" +
                          suggestName(column, names->names) +
                          "; allowed: " + joinNames(names->names));
    }
    double values[kMaxColumns];
    names->rows.write(sample, nullptr, values);
    return values[place->second];
  }
  static constexpr int kMaxColumns = 1 + 6 * kMaxShafts + 2 * kMaxConstraints;
};

std::shared_ptr<const SampleNames> nameSamples(const Simulation& simulation) {
  const ColumnGroups state;
  SampleNames names{columnNames(simulation, state),
                    {},
                    RowMaker(simulation, state),
                    simulation.scene().shafts.size(),
                    simulation.scene().constraints.size()};
  for (std::size_t i = 0; i < names.names.size(); ++i) names.places[names.names[i]] = i;
  return std::make_shared<const SampleNames>(std::move(names));
}

// --- The simulation

ParameterTree readSceneArgument(const py::object& scene) {
  if (py::isinstance<py::dict>(scene)) return toTree(scene, "");
  const auto text = py::module_::import("os").attr("fspath")(scene).cast<std::string>();
  // No file's name has a line's end; a mapping in one line begins with its brace.
  const bool is_text = text.find('\n') != std::string::npos || text.rfind('{', 0) == 0;
  return is_text ? readYamlText(text, "scene") : readYamlFile(text);
}

Overrides readOverrides(const py::object& overrides) {
  Overrides values;
  if (overrides.is_none()) return values;
  for (const auto& [path, value] : overrides.cast<py::dict>()) {
    const auto name = path.cast<std::string>();
    values.emplace_back(name, toTree(value, name));
  }
  return values;
}

/// False on Ctrl-C; called without the interpreter's lock.
bool hearSignals() {
  const py::gil_scoped_acquire lock;
  return PyErr_CheckSignals() == 0;
}

class PythonSimulation {
 public:
  PythonSimulation(const py::object& scene, const py::object& overrides, bool energy)
      : session_(readScene(scene, overrides)), names_(nameSamples(session_.simulation())) {
    Simulation& simulation = session_.simulation();
    simulation.trackEnergy(energy);
    simulation.loadMachineCode(simulation.scene().solver.machine_code == MachineCode::kAlways);
  }

  /// The simulation, unless another thread has it.
  Simulation& get() {
    if (is_busy_) throw std::runtime_error("another thread is moving this simulation");
    return session_.simulation();
  }
  const Scene& scene() const { return session_.simulation().scene(); }

  double time() { return get().time(); }

  void advanceTo(double time) {
    Simulation& simulation = get();
    if (!std::isfinite(time)) throw std::invalid_argument("time: not a finite number");
    if (time < simulation.time()) {
      throw std::invalid_argument("time: " + formatNumber(time) + " s lies before the present, " +
                                  formatNumber(simulation.time()) + " s");
    }
    if (time <= simulation.quietUntil()) {
      simulation.advanceTo(time);  // for this the lock is not worth giving away
    } else {
      withoutLock([&] { session_.advanceTo(time, hearSignals); });
    }
    check();
  }
  void advance(double duration) {
    if (!(duration >= 0.0)) {
      throw std::invalid_argument("duration: " + formatNumber(duration) + " s; allowed: >= 0");
    }
    advanceTo(get().time() + duration);
  }
  NamedSample step(double duration, const py::object& commands) {
    if (!commands.is_none()) {
      for (const auto& [topic, value] : commands.cast<py::dict>()) {
        command(topic.cast<std::string>(), value.cast<double>());
      }
    }
    advance(duration);
    return sample();
  }
  bool command(const std::string& topic, double value) {
    Simulation& simulation = get();
    switch (simulation.command(session_.findInput(topic), value)) {
      case CommandResult::kAccepted:
        return true;
      case CommandResult::kClamped:
        return false;
      case CommandResult::kRefused:
        break;
    }
    throw std::invalid_argument("command on " + inQuotes(topic) + ": " + std::to_string(value) +
                                "; allowed: any finite number");
  }
  NamedSample sample() {
    Simulation& simulation = get();
    const Sample& taken = simulation.sample();
    check();
    return {taken, names_};
  }
  py::dict quantities(QuantityGroup group) {
    Simulation& simulation = get();
    const std::vector<std::string>& names = simulation.quantityNames(group);
    std::vector<double> values(names.size());
    simulation.calcQuantities(group, values.data());
    check();
    py::dict result;
    for (std::size_t i = 0; i < names.size(); ++i) result[py::str(names[i])] = values[i];
    return result;
  }
  py::dict energy() {
    const Energy energy = get().energy();
    check();
    py::dict result;
    result["kinetic"] = energy.kinetic;
    result["applied"] = energy.applied;
    result["reactions"] = energy.reactions;
    result["applied_power"] = energy.applied_power;
    result["reaction_power"] = energy.reaction_power;
    return result;
  }
  py::object state() {
    MotionState state;
    if (!get().saveState(&state)) raise(stopped());
    return toObject(toTree(state, scene()));
  }
  void setState(const py::dict& values, bool project) {
    Simulation& simulation = get();
    if (!simulation.status().ok()) simulation.reset();  // what has stopped takes no state
    const MotionState state = readState(values, simulation);
    const std::string fault = simulation.setState(state, project);
    if (!fault.empty()) throw SceneError("state", fault);
  }
  void reset() { get().reset(); }

  LinearModel linearize(const py::object& state, bool project, bool full) {
    if (state.is_none()) sample();  // raises where the motion has stopped
    return linearizeAt(get(), state, project, full);
  }

  /// Rows, how many commands lay outside, and None or the error that ended the run.
  py::tuple run(const RunRequest& request) {
    get().trackEnergy(request.columns.energy || tracksEnergy());
    RunRows rows;
    withoutLock([&] { rows = session_.run(request, hearSignals); });
    const auto columns = static_cast<py::ssize_t>(columnsOf(request.columns).size());
    const auto count = static_cast<py::ssize_t>(rows.values.size()) / columns;
    Array values({count, columns}, rows.values.data());
    const bool is_ok = session_.simulation().status().ok();
    return py::make_tuple(values, rows.ignored_commands, is_ok ? py::none() : stopped());
  }
  std::vector<std::string> columnsOf(const ColumnGroups& groups) {
    return columnNames(get(), groups);
  }
  py::object stopped() {
    Simulation& simulation = session_.simulation();
    const MotionStatus& status = simulation.status();
    const auto name = [](const auto& parts, int index) -> py::object {
      if (index < 0) return py::none();
      return py::str(parts[static_cast<std::size_t>(index)]->name());
    };
    return errorClass("MotionStopped")(simulation.describeStatus(), toString(status.reason),
                                       status.time, NamedSample{simulation.sample(), names_},
                                       name(scene().constraints, status.constraint),
                                       name(scene().torques, status.torque));
  }

  void trackEnergy(bool on) {
    tracks_energy_ = on;
    get().trackEnergy(on);
  }
  bool tracksEnergy() const { return tracks_energy_; }

 private:
  static Scene readScene(const py::object& scene, const py::object& overrides) {
    PluginlibComponentFactory factory;
    return makeScene(readSceneArgument(scene), readOverrides(overrides), factory);
  }

  void check() {
    if (!session_.simulation().status().ok()) raise(stopped());
  }

  template <typename Work>
  void withoutLock(const Work& work) {
    is_busy_ = true;  // seen by who holds the interpreter's lock, as we do here
    try {
      const py::gil_scoped_release release;
      work();
    } catch (...) {
      is_busy_ = false;
      throw;
    }
    is_busy_ = false;
    if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  }

  Session session_;
  std::shared_ptr<const SampleNames> names_;
  bool is_busy_ = false;
  bool tracks_energy_ = false;
};

py::dict statistics(PythonSimulation& self) {
  const Statistics& counts = self.get().statistics();
  py::dict result;
  result["steps"] = counts.steps;
  result["rejected_steps"] = counts.rejected_steps;
  result["right_hand_sides"] = counts.right_hand_sides;
  result["projections"] = counts.projections;
  result["newton_iterations"] = counts.newton_iterations;
  result["implicit_steps"] = counts.implicit_steps;
  result["jumps"] = counts.jumps;
  result["sleeps"] = counts.sleeps;
  result["commands_accepted"] = counts.commands_accepted;
  result["commands_clamped"] = counts.commands_clamped;
  result["commands_refused"] = counts.commands_refused;
  result["command_timeouts"] = counts.command_timeouts;
  return result;
}

using CommandTuple = std::tuple<double, std::string, double>;

RunRequest makeRequest(double duration, double rate, const py::object& times,
                       const std::vector<CommandTuple>& commands, const std::string& columns,
                       bool until_rest) {
  RunRequest request;
  request.duration = duration;
  request.rate = rate;
  request.has_times = !times.is_none();
  if (request.has_times) request.times = times.cast<std::vector<double>>();
  for (const auto& [time, topic, value] : commands) {
    TimedCommand command;
    command.time = time;
    command.topic = topic;
    command.value = value;
    command.line = static_cast<int>(request.commands.size());
    request.commands.push_back(command);
  }
  request.columns = readColumnGroups(columns);
  request.until_rest = until_rest;
  return request;
}

using MetricTuple = std::tuple<std::string, std::size_t, double>;

Metric makeMetric(const MetricTuple& parts) {
  static const std::map<std::string, MetricKind> kinds = {{"final", MetricKind::kFinal},
                                                          {"min", MetricKind::kMinimum},
                                                          {"max", MetricKind::kMaximum},
                                                          {"mean", MetricKind::kMean},
                                                          {"settling", MetricKind::kSettlingTime}};
  const auto& [kind, column, band] = parts;
  return {kinds.at(kind), column, band};
}

/// Values of the metrics, runs x metrics, and the runs' reasons.
py::tuple sweepRows(const py::object& scene, const py::object& overrides,
                    const std::vector<std::string>& paths,
                    const std::vector<std::vector<double>>& values, const RunRequest& run,
                    const std::vector<MetricTuple>& metrics, int threads) {
  SweepRequest request{readSceneArgument(scene), readOverrides(overrides), paths, run, {}};
  for (const MetricTuple& metric : metrics) request.metrics.push_back(makeMetric(metric));
  PluginlibComponentFactory factory;
  std::vector<SweepRow> rows;
  {
    const py::gil_scoped_release release;
    rows = runSweep(request, values, threads, factory, hearSignals);
  }
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  Array result({static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(metrics.size())});
  double* number = result.mutable_data();
  py::list reasons;
  for (const SweepRow& row : rows) {
    number = std::copy(row.metrics.begin(), row.metrics.end(), number);
    reasons.append(row.reason);
  }
  return py::make_tuple(result, reasons);
}

void translateErrors() {
  // (By value is how pybind11 calls it.)
  // NOLINTNEXTLINE(performance-unnecessary-value-param)
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const SceneError& error) {
      const py::object python_error = errorClass("SceneError")(error.what(), error.keyPath());
      PyErr_SetObject(py::type::handle_of(python_error).ptr(), python_error.ptr());
    } catch (const CommandFileError& error) {
      PyErr_SetString(PyExc_ValueError, error.what());
    }
  });
}

void bindSample(py::module_& module) {
  py::class_<NamedSample> sample(module, "Sample");
  sample.def_property_readonly("time", [](const NamedSample& self) { return self.sample.time; });
  const auto add = [&sample](const char* name, const double(Sample::*member)[kMaxShafts]) {
    sample.def_property_readonly(name, [member](const NamedSample& self) {
      return toArray(self.sample.*member, self.names->shafts);
    });
  };
  add("angle", &Sample::angle);
  add("velocity", &Sample::velocity);
  add("acceleration", &Sample::acceleration);
  add("applied_torque", &Sample::applied_torque);
  add("reaction_torque", &Sample::reaction_torque);
  add("reaction_torque_rate", &Sample::reaction_torque_rate);
  sample.def_property_readonly("residual", [](const NamedSample& self) {
    return toArray(self.sample.residual, self.names->constraints);
  });
  sample.def_property_readonly("multiplier", [](const NamedSample& self) {
    return toArray(self.sample.multiplier, self.names->constraints);
  });
  sample.def("keys", [](const NamedSample& self) { return self.names->names; });
  sample.def("__getitem__", &NamedSample::at);
  sample.def("__repr__", [](const NamedSample& self) {
    std::string text = "Sample(";
    const std::vector<double> row = self.row();
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += (i > 0 ? ", " : "") + self.names->names[i] + "=" + formatNumber(row[i]);
    }
    return text + ")";
  });
}

void bindSimulation(py::module_& module) {
  using Self = PythonSimulation;
  py::class_<Self> simulation(module, "Simulation");
  simulation
      .def(py::init<const py::object&, const py::object&, bool>(), py::arg("scene"),
           py::arg("overrides") = py::none(), py::kw_only(), py::arg("energy") = false)
      .def_property_readonly("time", &Self::time)
      .def("advance", &Self::advance, py::arg("duration"))
      .def("advance_to", &Self::advanceTo, py::arg("time"))
      .def("step", &Self::step, py::arg("duration"), py::arg("commands") = py::none())
      .def("command", &Self::command, py::arg("topic"), py::arg("value"))
      .def("sample", &Self::sample)
      .def("state", &Self::state)
      .def("set_state", &Self::setState, py::arg("state"), py::arg("project") = false)
      .def("reset", &Self::reset)
      .def("linearize", &Self::linearize, py::arg("state") = py::none(), py::kw_only(),
           py::arg("project") = false, py::arg("full") = false)
      .def(
          "trim",
          [](const Self& s, const py::object& fix, const py::object& free, bool accelerating) {
            return findSteadyStates(s.scene(), fix, free, accelerating);
          },
          py::arg("fix") = py::none(), py::arg("free") = py::none(), py::kw_only(),
          py::arg("accelerating") = false)
      .def_property_readonly("outputs",
                             [](Self& s) { return s.quantities(QuantityGroup::kOutputs); })
      .def_property_readonly("inputs", [](Self& s) { return s.quantities(QuantityGroup::kInputs); })
      .def_property_readonly("elements",
                             [](Self& s) { return s.quantities(QuantityGroup::kElements); })
      .def_property_readonly("energy", &Self::energy)
      .def_property_readonly("shafts", [](const Self& s) { return s.scene().shafts; })
      .def_property_readonly("constraints",
                             [](const Self& s) {
                               std::vector<std::string> names;
                               for (const auto& c : s.scene().constraints)
                                 names.push_back(c->name());
                               return names;
                             })
      .def_property_readonly("topics",
                             [](const Self& s) {
                               std::vector<std::string> topics;
                               for (const auto& i : s.scene().inputs) topics.push_back(i.topic);
                               return topics;
                             })
      .def_property_readonly("scene", [](const Self& s) { return toObject(s.scene().resolved); })
      .def_property_readonly("stepper", [](Self& s) { return s.get().describeStepper(); })
      .def_property_readonly("machine_code", [](Self& s) { return s.get().machineCode(); })
      .def("compile", [](Self& s) { return s.get().loadMachineCode(true); })
      .def_property_readonly("is_sleeping", [](Self& s) { return s.get().isSleeping(); })
      .def_property_readonly("doubts", [](Self& s) { return describeDoubts(s.get()); })
      .def_property_readonly("statistics", &statistics)
      .def(
          "columns",
          [](Self& s, const std::string& groups) { return s.columnsOf(readColumnGroups(groups)); },
          py::arg("groups") = "state")
      .def("_run", [](Self& s, double duration, double rate, const py::object& times,
                      const std::vector<CommandTuple>& commands, const std::string& columns,
                      bool until_rest) {
        return s.run(makeRequest(duration, rate, times, commands, columns, until_rest));
      });
}

}  // namespace
}  // namespace variator_sim::python

PYBIND11_MODULE(_core, module) {
  using namespace variator_sim;
  namespace py = pybind11;
  python::translateErrors();
  python::bindSample(module);
  python::bindAnalysis(module);
  python::bindSimulation(module);
  module.def("_sweep", [](const py::object& scene, const py::object& overrides,
                          const std::vector<std::string>& paths,
                          const std::vector<std::vector<double>>& values, double duration,
                          double rate, const py::object& times,
                          const std::vector<python::CommandTuple>& commands,
                          const std::string& columns,
                          const std::vector<python::MetricTuple>& metrics, int threads) {
    return python::sweepRows(scene, overrides, paths, values,
                             python::makeRequest(duration, rate, times, commands, columns, false),
                             metrics, threads);
  });
  module.def("read_commands", [](const std::string& path) {
    std::vector<python::CommandTuple> commands;
    for (const TimedCommand& command : readCommandFile(path)) {
      commands.emplace_back(command.time, command.topic, command.value);
    }
    return commands;
  });
}
