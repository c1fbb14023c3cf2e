/// A simulation bound to Python.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <complex>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "motion/motion.h"
#include "motion/stop_message.h"
#include "python/sample_layout.h"
#include "python/sweep.h"
#include "python/trees.h"
#include "ros/plugin_loader.h"
#include "tools/analysis_text.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/linear_model.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/trim.h"

namespace variator_sim::python {

/// The files of parts are sought from the working folder.
inline ParameterTree withParts(ParameterTree tree) {
  loadParts(&tree);
  return tree;
}

inline ParameterTree readSceneArgument(const py::object& scene) {
  if (py::isinstance<py::dict>(scene)) return withParts(toTree(scene, ""));
  const py::object path = py::module::import("os").attr("fspath")(scene);
  const auto has = [&](const char* method, const char* part) {
    return py::isinstance<py::str>(path) && path.attr(method)(part).cast<bool>();
  };
  // File names have no line breaks, and a mapping in one line begins with its brace.
  const bool is_text = has("__contains__", "\n") || has("startswith", "{");
  return is_text ? withParts(readYamlText(toText(path, ""), "scene"))
                 : readYamlFile(readPath(path));
}

inline Overrides readOverrides(const py::object& overrides) {
  Overrides values;
  if (overrides.is_none()) return values;
  for (const auto& [path, value] : toDict(overrides, "overrides", "{'drive/inertia': 1.2}")) {
    const std::string name = toText(path, "overrides");
    values.emplace_back(name, toTree(value, name));
  }
  return values;
}

/// Names of quantities with values, NaN for none.
using Choices = std::vector<std::pair<py::object, double>>;

inline std::vector<TrimChoice> readChoices(const Choices& choices) {
  std::vector<TrimChoice> read;
  for (const auto& [name, value] : choices) read.push_back({toText(name, "fix and free"), value});
  return read;
}

/// Does `work` without the interpreter's lock; signals interrupt it (Interruption), such as that of
/// Ctrl-C, for whose handlers the interpreter is asked, with its lock, twenty times a second.
/// Rethrows the exceptions of the handlers.
template <typename Work>
void withoutLock(const Work& work) {
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kPeriod(50);
  try {
    const py::gil_scoped_release release;
    const Interruption interruption([next = Clock::now() + kPeriod, has_raised = false]() mutable {
      const Clock::time_point now = Clock::now();
      if (has_raised || now < next) return has_raised;
      next = now + kPeriod;
      const py::gil_scoped_acquire lock;
      has_raised = PyErr_CheckSignals() != 0;
      return has_raised;
    });
    work();
  } catch (...) {
    if (PyErr_Occurred() == nullptr) throw;
  }
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
}

template <typename Names, typename Values>
py::dict toDictionary(const Names& names, const Values& values) {
  py::dict result;
  for (std::size_t i = 0; i < names.size(); ++i) result[py::str(names[i])] = values[i];
  return result;
}

/// Returns what was raised.
inline py::object toObject(py::error_already_set& raised) {
  PyObject *type, *value, *trace;
  raised.restore();
  PyErr_Fetch(&type, &value, &trace);
  PyErr_NormalizeException(&type, &value, &trace);
  Py_XDECREF(type);
  Py_XDECREF(trace);
  return py::reinterpret_steal<py::object>(value);
}

class PythonSimulation {
 public:
  PythonSimulation(const py::object& scene, const py::object& overrides, bool energy)
      : tree_(withOverrides(readSceneArgument(scene), readOverrides(overrides))),
        simulation_(load(tree_, energy)),
        layout_(simulation_) {
    for (const std::string& warning : simulation_.scene().warnings) warn(warning);
  }

  /// pybind11 calls this operator when the object's __init__ has not been called, as after
  /// Simulation.__new__. The global operator makes the objects themselves.
  static void* operator new(std::size_t) {
    throw py::type_error("Simulation: its __init__ has not been called");
  }
  static void operator delete(void* memory) { ::operator delete(memory); }

  /// Returns the simulation; throws if another thread is using it.
  Simulation& get() {
    if (is_busy_) throw std::runtime_error("another thread is moving this simulation");
    return simulation_;
  }
  const Scene& scene() const { return simulation_.scene(); }

  double time() { return get().time(); }

  void advanceTo(const py::object& time) { advanceTo(toNumber(time, "time")); }
  void advanceTo(double time) {
    Simulation& simulation = get();
    if (!std::isfinite(time)) throw std::invalid_argument("time: not a finite number");
    if (time < simulation.time()) {
      throw std::invalid_argument("time: " + formatNumber(time) + " s lies before the present, " +
                                  formatNumber(simulation.time()) + " s");
    }
    if (time <= simulation.quietUntil()) {
      simulation.advanceTo(time);  // too short to release the lock for
    } else {
      move([&] { simulation.advanceTo(time); });
    }
    check();
  }
  void advance(const py::object& given) {
    const double duration = toNumber(given, "duration");
    if (!(duration >= 0.0)) {
      throw std::invalid_argument("duration: " + formatNumber(duration) + " s; allowed: >= 0");
    }
    advanceTo(get().time() + duration);
  }
  py::object step(const py::object& duration, const py::object& commands) {
    if (!commands.is_none()) {
      for (const auto& [topic, value] : toDict(commands, "commands", "{'ratio': 0.4}")) {
        command(py::reinterpret_borrow<py::object>(topic),
                py::reinterpret_borrow<py::object>(value));
      }
    }
    advance(duration);
    return sample();
  }
  bool command(const py::object& name, const py::object& given) {
    const std::string topic = toText(name, "commands");
    const double value = toNumber(given, inQuotes(topic));
    Simulation& simulation = get();
    const int input = findInput(scene().inputs, topic);
    const bool is_first = std::isnan(simulation.firstClampedCommand(input));
    switch (simulation.command(input, value)) {
      case CommandResult::kAccepted:
        return true;
      case CommandResult::kClamped:
        if (is_first) warn(describeClamped(scene().inputs[static_cast<std::size_t>(input)], value));
        return false;
      case CommandResult::kRefused:
        break;
    }
    throw std::invalid_argument("command on " + inQuotes(topic) + ": " + formatNumber(value) +
                                "; allowed: any finite number");
  }
  py::object read(const py::object& column) {
    const Sample& taken = get().sample();
    check();
    double value;
    if (layout_.read(taken, column.ptr(), &value)) return py::float_(value);
    return layout_.make(taken)[column];  // raises the error that tells what is allowed
  }
  py::object sample() {
    const Sample& taken = get().sample();
    check();
    return layout_.make(taken);
  }
  py::dict quantities(QuantityGroup group) {
    Simulation& simulation = get();
    const std::vector<std::string>& names = simulation.quantityNames(group);
    std::vector<double> values(names.size());
    simulation.calcQuantities(group, values.data());
    check();
    return toDictionary(names, values);
  }
  /// Returns the events that have not been taken, as dicts.
  py::list takeEvents() {
    Simulation& simulation = get();
    simulation.sample();  // the commands of the present act
    const std::vector<std::string> names = scene().eventNames();
    py::list taken;
    ModeEvent it;
    while (simulation.takeModeEvent(&it)) {
      py::dict told;
      told["time"] = it.time;
      told["element"] = names[static_cast<std::size_t>(it.element)];
      told["from"] = modeName(it.from);
      told["to"] = modeName(it.to);
      told["torque"] = it.torque;
      told["impulse"] = it.impulse;
      taken.append(told);
    }
    return taken;
  }
  py::dict energy() {
    const Energy it = get().energy();
    check();
    return toDictionary(
        std::array{"kinetic", "applied", "reactions", "applied_power", "reaction_power"},
        std::array{it.kinetic, it.applied, it.reactions, it.applied_power, it.reaction_power});
  }
  py::object state() {
    MotionState state;
    if (!get().saveState(&state)) raise(stopped());
    return toObject(toTree(state, scene()));
  }
  void setState(const py::object& given, bool project) {
    const py::dict values = toDict(given, "state", kState);
    Simulation& simulation = get();
    if (!simulation.status().ok()) simulation.reset();  // a stopped motion accepts no state
    const MotionState state = readState(values);
    std::string fault;
    move([&] { fault = simulation.setState(state, project); });
    if (!fault.empty()) throw SceneError("state", fault);
  }
  bool compile() {
    Simulation& simulation = get();
    bool is_loaded = false;
    move([&] { is_loaded = simulation.loadMachineCode(true, true); });
    return is_loaded;
  }
  void reset() { get().reset(); }

  /// Maps (..., s) accelerations to (..., k) residuals.
  Array residuals(const DenseArray& accelerations) {
    const OperatingPoint point = get().operatingPoint();
    check();
    std::vector<py::ssize_t> shape(accelerations.shape(),
                                   accelerations.shape() + accelerations.ndim());
    shape.back() = static_cast<py::ssize_t>(scene().constraints.size());
    Array values(shape);
    const double* from = accelerations.data();
    const double* const end = from + accelerations.size();
    double* to = values.mutable_data();
    move([&] {
      for (; from != end; from += scene().shaftCount(), to += scene().constraints.size()) {
        calcResiduals(scene(), point, from, to);
      }
    });
    return values;
  }

  /// Returns the model as CSV, its eigenvalues, notes and report.
  py::tuple linearize(const py::object& state, bool project, bool full) {
    Simulation& simulation = get();
    const bool is_here = state.is_none();
    if (is_here) sample();  // raises if the motion has stopped
    MotionState there;
    if (!is_here) there = readState(toDict(state, "state", kState));
    LinearModel model;
    std::vector<std::complex<double>> eigenvalues;
    move([&] {
      std::unique_ptr<Simulation> other;  // the motion itself is not moved
      if (!is_here) {
        other = std::make_unique<Simulation>(scene());
        const std::string fault = other->setState(there, project);
        if (!fault.empty()) throw SceneError("state", fault);
      }
      const OperatingPoint point = (is_here ? simulation : *other).operatingPoint();
      model =
          variator_sim::linearize(scene(), point, full ? LinearForm::kFull : LinearForm::kMinimal);
      eigenvalues = calcEigenvalues(model);
    });
    return py::make_tuple(writeModel(model), eigenvalues, model.notes, describeModel(model, true));
  }
  /// Returns what is told of the search, and each steady state with its residual, what is
  /// undetermined there, and its stability.
  py::tuple trim(const Choices& fix, const Choices& free, bool accelerating) {
    const Scene& scene = get().scene();
    const TrimOptions options{readChoices(fix), readChoices(free), accelerating};
    TrimResult result;
    std::vector<std::string> stabilities;
    move([&] {
      result = variator_sim::trim(scene, options);
      for (const TrimState& it : result.states) {
        stabilities.push_back(describeStability(scene, it.point));
      }
    });
    py::list states;
    for (std::size_t i = 0; i < result.states.size(); ++i) {
      const TrimState& it = result.states[i];
      const ParameterTree tree = variator_sim::toTree(makeState(it.point, scene), scene);
      states.append(py::make_tuple(toObject(tree), it.residual, it.undetermined, stabilities[i]));
    }
    return py::make_tuple(result.message, states);
  }

  /// Returns rows, the number of commands outside, and None or what ended the run before: an error,
  /// or what a signal's handler has raised.
  /// With `gradient` also the names of the columns, and why and when the derivatives ended, or "".
  py::tuple run(RunRequest request, const std::vector<std::string>& gradient = {}) {
    get();
    RunRows rows;
    std::unique_ptr<Sensitivity> by;
    py::object error = py::none();
    try {
      move([&] {
        if (!gradient.empty()) {
          by =
              std::make_unique<Sensitivity>(tree_, readSceneWithPlugins, gradient,
                                            resolveCommands(request.commands, scene(), "commands"));
          request.columns.derivatives = by->names();
        }
        rows = python::run(simulation_, request, by.get());
      });
    } catch (py::error_already_set& raised) {  // by a signal's handler
      error = toObject(raised);
    }
    const auto columns = static_cast<py::ssize_t>(columnsOf(request.columns).size());
    const auto count = static_cast<py::ssize_t>(rows.values.size()) / columns;
    Array values({count, columns}, rows.values.data());
    if (error.is_none() && !simulation_.status().ok()) error = stopped();
    if (gradient.empty()) return py::make_tuple(values, rows.ignored_commands, error);
    return py::make_tuple(values, rows.ignored_commands, error, columnsOf(request.columns),
                          by == nullptr ? "" : by->stop());
  }
  std::vector<std::string> columnsOf(const ColumnGroups& groups) {
    return Columns(get(), groups).names();
  }
  py::object stopped() {
    Simulation& simulation = simulation_;
    const MotionStatus& status = simulation.status();
    const Law* culprit = nullptr;
    const std::string message = describeStop(Motion::of(simulation), &culprit);
    const auto nameIf = [culprit](bool is_meant) -> py::object {
      if (culprit == nullptr || !is_meant) return py::none();
      return py::str(culprit->name());
    };
    const bool is_torque = dynamic_cast<const Torque*>(culprit) != nullptr;
    return errorClass("MotionStopped")(message, toString(status.reason), status.time,
                                       layout_.make(simulation.sample()), nameIf(!is_torque),
                                       nameIf(is_torque));
  }

 private:
  static Simulation load(const ParameterTree& tree, bool energy) {
    std::unique_ptr<Simulation> simulation;
    withoutLock([&] {
      simulation = std::make_unique<Simulation>(readSceneWithPlugins(tree));
      simulation->trackEnergy(energy);
      simulation->keepModeEvents();
      simulation->loadMachineCode(simulation->scene().solver.machine_code == MachineCode::kAlways);
    });
    return std::move(*simulation);
  }

  void check() {
    if (!simulation_.status().ok()) raise(stopped());
  }

  /// Reads a dict; missing values are those of the present, or of the start if the motion has
  /// stopped.
  MotionState readState(const py::dict& values) {
    MotionState present;
    if (!simulation_.peekState(&present)) Simulation(scene()).peekState(&present);
    return readMotionState(toTree(values, "state"), scene(), present);
  }

  /// Does long work; other threads must not use the simulation meanwhile.
  template <typename Work>
  void move(const Work& work) {
    is_busy_ = true;  // read and written under the interpreter's lock
    try {
      withoutLock(work);
    } catch (...) {
      is_busy_ = false;
      throw;
    }
    is_busy_ = false;
  }

  static constexpr const char* kState = "{'shafts': {'drive': {'velocity': 5.0}}}";
  const ParameterTree tree_;
  Simulation simulation_;
  const SampleLayout layout_;
  bool is_busy_ = false;
};

}  // namespace variator_sim::python
