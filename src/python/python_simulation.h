/// A simulation as Python sees it.
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "python/analysis.h"
#include "python/named_sample.h"
#include "python/session.h"
#include "python/trees.h"
#include "ros/plugin_loader.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/message_text.h"
#include "variator_sim/motion_state.h"

namespace variator_sim::python {

inline py::object errorClass(const char* name) {
  return py::module::import("variator_sim.errors").attr(name);
}

[[noreturn]] inline void raise(const py::object& error) {
  PyErr_SetObject(error.get_type().ptr(), error.ptr());
  throw py::error_already_set();
}

inline ParameterTree readSceneArgument(const py::object& scene) {
  if (py::isinstance<py::dict>(scene)) return toTree(scene, "");
  const auto text = py::module::import("os").attr("fspath")(scene).cast<std::string>();
  // No file's name has a line's end; a mapping in one line begins with its brace.
  const bool is_text = text.find('\n') != std::string::npos || text.rfind('{', 0) == 0;
  return is_text ? readYamlText(text, "scene") : readYamlFile(text);
}

inline Overrides readOverrides(const py::object& overrides) {
  Overrides values;
  if (overrides.is_none()) return values;
  for (const auto& [path, value] : overrides.cast<py::dict>()) {
    const auto name = path.cast<std::string>();
    values.emplace_back(name, toTree(value, name));
  }
  return values;
}

/// Warns the caller; throws where warnings are errors.
inline void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

/// False on Ctrl-C; called without the interpreter's lock.
inline bool hearSignals() {
  const py::gil_scoped_acquire lock;
  return PyErr_CheckSignals() == 0;
}

class PythonSimulation {
 public:
  PythonSimulation(const py::object& scene, const py::object& overrides, bool energy)
      : session_(readScene(scene, overrides)),
        names_(std::make_shared<const SampleNames>(session_.simulation())) {
    Simulation& simulation = session_.simulation();
    for (const std::string& warning : simulation.scene().warnings) warn(warning);
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

  // --- What is called a million times: as below, or false where it is not that simple.
  bool tryAdvance(double duration) {
    Simulation& simulation = session_.simulation();
    const double time = simulation.time() + duration;
    return !is_busy_ && duration >= 0.0 && time <= simulation.quietUntil() && std::isfinite(time) &&
           simulation.advanceTo(time).ok();
  }
  bool tryRead(PyObject* column, double* value) {
    if (is_busy_) return false;
    const Sample& taken = session_.simulation().sample();
    return session_.simulation().status().ok() && names_->read(taken, column, value);
  }
  double read(py::handle column) { return sample().at(column); }

  // --- Any call

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

  /// (..., s) accelerations, (..., k) residuals.
  Array residuals(const DenseArray& accelerations) {
    checkAccelerations(accelerations, scene().shafts);
    const OperatingPoint point = get().operatingPoint();
    check();
    std::vector<py::ssize_t> shape(accelerations.shape(),
                                   accelerations.shape() + accelerations.ndim());
    shape.back() = static_cast<py::ssize_t>(scene().constraints.size());
    Array values(shape);
    const double* from = accelerations.data();
    const double* const end = from + accelerations.size();
    double* to = values.mutable_data();
    withoutLock([&] {
      for (; from != end; from += scene().shaftCount(), to += scene().constraints.size()) {
        calcResiduals(scene(), point, from, to);
      }
    });
    return values;
  }

  LinearModel linearize(const py::object& state, bool project, bool full) {
    if (state.is_none()) sample();  // raises where the motion has stopped
    return linearizeAt(get(), state, project, full);
  }
  py::list trim(const py::object& fix, const py::object& free, bool accelerating) {
    const Scene& scene = get().scene();
    const TrimOptions options = readTrimOptions(fix, free, accelerating);
    SteadyStates states;
    withoutLock([&] { states = findSteadyStates(scene, options); });
    return toList(states, scene);
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

}  // namespace variator_sim::python
