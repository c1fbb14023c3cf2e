// Our own methods: Simulation on the scenes of benchmark/scenes/, as formulas and compiled.
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "peers/method.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::benchmark {
namespace {

constexpr std::size_t index(int i) {
  return static_cast<std::size_t>(i);
}

/// A state as variables to differentiate by, in the order angles, velocities, accelerations.
template <int S>
struct StateVariables {
  using Number = Dual<double, 3 * S>;
  explicit StateVariables(const StateView& x) {
    for (int i = 0; i < S; ++i) {
      phi[i] = Number::variable(x.angle[i], i);
      w[i] = Number::variable(x.velocity[i], S + i);
      e[i] = Number::variable(x.acceleration[i], 2 * S + i);
    }
  }
  Number phi[S];
  Number w[S];
  Number e[S];
};

/// A hand-written scene's torques as one compiled element.
template <template <class> class SceneOf>
class CompiledTorque : public Torque {
 public:
  explicit CompiledTorque(const SceneParameters& parameters)
      : scene_(parameters), parameters_(parameters) {}

 private:
  static constexpr int S = SceneOf<double>::kShafts;
  void doConfigure(ComponentContext& /*context*/) override {}
  void doAddTorque(const StateView& x, double* torque) const override {
    double Q[S];
    scene_.torque(x.time, x.angle, x.velocity, Q);
    for (int i = 0; i < S; ++i) torque[i] += Q[i];
  }
  void doAddTorqueRate(const StateView& x, double* torque_rate) const override {
    double rate[S];
    scene_.torqueRate(x.time, x.angle, x.velocity, x.acceleration, rate);
    for (int i = 0; i < S; ++i) torque_rate[i] += rate[i];
  }
  void doAddTorqueRateDerivatives(const StateView& x, double* derivatives) const override {
    const StateVariables<S> at(x);
    typename StateVariables<S>::Number rate[S];
    const SceneOf<typename StateVariables<S>::Number> scene(parameters_);
    scene.torqueRate(x.time, at.phi, at.w, at.e, rate);
    for (int i = 0; i < S; ++i) {
      for (int q = 0; q < 3 * S; ++q) derivatives[q * S + i] += rate[i].derivative[index(q)];
    }
  }
  Dependence doTorqueDependence() const override {
    return {SceneOf<double>::kTorqueReadsTime, SceneOf<double>::kTorqueReadsAngle};
  }
  Dependence doRateDependence() const override {
    return {SceneOf<double>::kRateReadsTime, SceneOf<double>::kTorqueReadsAngle};
  }

  SceneOf<double> scene_;
  SceneParameters parameters_;
};

/// One of a hand-written scene's constraints, with its row by hand.
/// What is computed of the others and not used the compiler leaves out.
template <template <class> class SceneOf, int Index>
class CompiledConstraint : public Constraint {
 public:
  explicit CompiledConstraint(const SceneParameters& parameters)
      : scene_(parameters), parameters_(parameters) {}

 private:
  using Scene = SceneOf<double>;
  static constexpr int S = Scene::kShafts;
  static constexpr int K = Scene::kConstraints;

  void doConfigure(ComponentContext& /*context*/) override {}
  int doOrder() const override { return Scene::kOrder; }
  bool doIsLinearInAcceleration() const override { return Scene::kLinear; }
  double doCalcResidual(const StateView& x) const override {
    double psi[K];
    if constexpr (Scene::kOrder == 1) {
      scene_.velocityResidual(x.time, x.angle, x.velocity, psi);
    } else {
      scene_.residual(x.time, x.angle, x.velocity, x.acceleration, psi);
    }
    return psi[Index];
  }
  double doCalcVelocityResidualAndJacobian(const StateView& x, double* C) const override {
    fillRow(x, C, nullptr);
    return doCalcResidual(x);
  }
  double doCalcResidualAndJacobian(const StateView& x, double* C) const override {
    fillRow(x, C, nullptr);
    double psi[K];
    scene_.residual(x.time, x.angle, x.velocity, x.acceleration, psi);
    return psi[Index];
  }
  void doCalcRow(const StateView& x, double* C, double* c0) const override { fillRow(x, C, c0); }
  void doCalcRowDerivatives(const StateView& x, double* dC, double* dc0) const override {
    using Variables = StateVariables<S>;
    const Variables at(x);
    typename Variables::Number C[K][S];
    typename Variables::Number c0[K];
    const SceneOf<typename Variables::Number> scene(parameters_);
    scene.row(x.time, at.phi, at.w, at.e, C, c0);
    for (int q = 0; q < 3 * S; ++q) {
      for (int i = 0; i < S; ++i) dC[q * S + i] = C[Index][i].derivative[index(q)];
      dc0[q] = c0[Index].derivative[index(q)];
    }
  }
  Dependence doDependence() const override { return {Scene::kConstraintReadsTime, false}; }
  bool doHasConstantJacobian() const override { return Scene::kConstantC; }
  /// Asked for when the scene is read and at the start only: dual numbers will do.
  void doCalcPartials(const StateView& x, ConstraintPartials& partials) const override {
    using Number = Dual<double, 3 * S + 1>;
    const SceneOf<Number> scene(parameters_);
    Number phi[S];
    Number w[S];
    Number e[S];
    for (int i = 0; i < S; ++i) {
      phi[i] = Number::variable(x.angle[i], i);
      w[i] = Number::variable(x.velocity[i], S + i);
      e[i] = Number(Scene::kOrder == 1 ? 0.0 : x.acceleration[i]);
      if (Scene::kOrder != 1) e[i] = Number::variable(x.acceleration[i], 2 * S + i);
    }
    const Number t = Number::variable(x.time, 3 * S);
    Number psi[K];
    if constexpr (Scene::kOrder == 1) {
      scene.velocityResidual(t, phi, w, psi);
    } else {
      scene.residual(t, phi, w, e, psi);
    }
    const auto& derivative = psi[Index].derivative;
    partials.time = derivative[3 * S];
    for (std::size_t i = 0; i < S; ++i) {
      partials.angle[i] = derivative[i];
      partials.velocity[i] = derivative[S + i];
      partials.acceleration[i] = derivative[2 * S + i];
    }
  }
  void fillRow(const StateView& x, double* C, double* c0) const {
    // A view of order 1 may carry no accelerations: what they enter is not asked for then.
    static constexpr double kNone[S] = {};
    const double* e = x.acceleration != nullptr ? x.acceleration : kNone;
    double rows[K][S];
    double c[K];
    scene_.row(x.time, x.angle, x.velocity, e, rows, c);
    for (int i = 0; i < S; ++i) C[i] = rows[Index][i];
    if (c0 != nullptr) *c0 = c[Index];
  }

  Scene scene_;
  SceneParameters parameters_;
};

/// The shipped components, "benchmark/Torque" and "benchmark/Constraint0", "benchmark/Constraint1".
template <template <class> class SceneOf>
class CompiledFactory : public BuiltinComponentFactory {
 public:
  explicit CompiledFactory(const SceneParameters& parameters) : parameters_(parameters) {}
  ConstraintPtr createConstraint(const std::string& type) override {
    constexpr int kLast = SceneOf<double>::kConstraints - 1;
    if (type == "benchmark/Constraint0") {
      return std::make_shared<CompiledConstraint<SceneOf, 0>>(parameters_);
    }
    if (type == "benchmark/Constraint" + std::to_string(kLast)) {
      return std::make_shared<CompiledConstraint<SceneOf, kLast>>(parameters_);
    }
    return BuiltinComponentFactory::createConstraint(type);
  }
  TorquePtr createTorque(const std::string& type) override {
    if (type == "benchmark/Torque") return std::make_shared<CompiledTorque<SceneOf>>(parameters_);
    return BuiltinComponentFactory::createTorque(type);
  }

 private:
  SceneParameters parameters_;
};

ParameterTree numbers(const double* values, int count) {
  ParameterTree::List list;
  for (int i = 0; i < count; ++i) list.push_back(ParameterTree::real(values[i]));
  return ParameterTree::list(std::move(list));
}

/// The scene's file with tau and its initial values replaced.
template <template <class> class SceneOf>
ParameterTree readTree(const SceneCase& scene_case, const std::string& folder) {
  ParameterTree tree = readYamlFile(folder + "/" + scene_case.file + ".yaml");
  if (scene_case.tau > 0.0) {
    auto& root = tree.asDictionary();
    root["variator"].asDictionary()["parameters"].asDictionary()["tau"] =
        ParameterTree::real(scene_case.tau);
    if (!scene_case.parameters.slips_at_start) {
      double x[6];
      SceneOf<double>(scene_case.parameters).initial(x);
      auto& initial = root["initial"].asDictionary();
      initial["velocity"] = numbers(x + 2, 2);
      initial["acceleration"] = numbers(x + 4, 2);
    }
  }
  return tree;
}

/// Torques and constraints replaced by the compiled ones.
template <template <class> class SceneOf>
void makeCompiled(ParameterTree& tree) {
  auto& root = tree.asDictionary();
  for (const char* kind : {"torques", "constraints"}) {
    for (const ParameterTree& name : root[kind].asList()) root.erase(name.asText());
  }
  const auto element = [](const std::string& type) {
    return ParameterTree::dictionary({{"type", ParameterTree::text(type)}});
  };
  root["torques"] = ParameterTree::list({ParameterTree::text("all_torques")});
  root["all_torques"] = element("benchmark/Torque");
  ParameterTree::List names;
  for (int m = 0; m < SceneOf<double>::kConstraints; ++m) {
    const std::string name = "constraint_" + std::to_string(m);
    names.push_back(ParameterTree::text(name));
    root[name] = element("benchmark/Constraint" + std::to_string(m));
  }
  root["constraints"] = ParameterTree::list(std::move(names));
}

template <template <class> class SceneOf>
class Ours : public Method {
 public:
  Ours(const std::string& stepper, const std::string& form, SceneCase scene_case,
       ParameterTree tree, const std::string& folder)
      : Method("ours " + stepper, form),
        stepper_(stepper),
        scene_case_(std::move(scene_case)),
        tree_(std::move(tree)) {
    if (!scene_case_.commands.empty()) {
      commands_ = readCommandFile(folder + "/" + scene_case_.commands + ".csv");
    }
  }

  std::string prepare(double tolerance) override {
    ParameterTree tree = tree_;
    tree.asDictionary()["solver"] = ParameterTree::dictionary({
        {"stepper", ParameterTree::text(stepper_)},
        {"machine_code", ParameterTree::text(form() == "machine code" ? "always" : "never")},
        {"relative_tolerance", ParameterTree::real(tolerance)},
        {"absolute_tolerance", ParameterTree::real(tolerance)},
        // As the peers, whose steps nothing limits.
        {"maximum_step", ParameterTree::real(kEnd)},
    });
    CompiledFactory<SceneOf> factory(scene_case_.parameters);
    try {
      simulation_.emplace(readScene(tree, factory));
      if (form() == "machine code" && !simulation_->loadMachineCode(true)) return "no machine code";
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
  bool run() override {
    simulation_->reset();
    for (const TimedCommand& command : commands_) {
      if (!simulation_->advanceTo(command.time).ok()) return finish();
      simulation_->command(0, command.value);
    }
    simulation_->advanceTo(kEnd);
    return finish();
  }
  /// The same motion in small advances, which change no bit of it.
  bool runGuarded(double seconds) override {
    constexpr int kSlices = 300;
    const auto start = ProcessorClock::now();
    late_ = false;
    simulation_->reset();
    std::size_t next = 0;
    for (int slice = 1; slice <= kSlices; ++slice) {
      const double time = kEnd * slice / kSlices;
      for (; next < commands_.size() && commands_[next].time <= time; ++next) {
        if (!simulation_->advanceTo(commands_[next].time).ok()) return finish();
        simulation_->command(0, commands_[next].value);
      }
      if (!simulation_->advanceTo(time).ok()) return finish();
      if (secondsSince(start) > seconds) {
        late_ = true;
        return false;
      }
    }
    return finish();
  }
  Outcome outcome() override {
    Outcome result;
    constexpr int S = SceneOf<double>::kShafts;
    for (std::size_t i = 0; i < S; ++i) {
      result.state[i] = sample_.angle[i];
      result.state[S + i] = sample_.velocity[i];
      result.state[2 * S + i] = sample_.acceleration[i];
    }
    result.right_hand_sides = simulation_->statistics().right_hand_sides;
    result.steps = simulation_->statistics().steps;
    if (late_) {
      result.status = "time-out";
    } else if (!simulation_->status().ok()) {
      result.status = toString(simulation_->status().reason);
    }
    return result;
  }

 private:
  static constexpr double kEnd = static_cast<double>(SceneOf<double>::kEnd);

  bool finish() {
    sample_ = simulation_->sample();
    return simulation_->status().ok();
  }

  std::string stepper_;
  SceneCase scene_case_;
  ParameterTree tree_;
  std::vector<TimedCommand> commands_;
  std::optional<Simulation> simulation_;
  Sample sample_;
  bool late_ = false;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, const std::string& folder, Methods& methods,
                SceneTag<SceneOf> /*tag*/) {
  const ParameterTree formulas = readTree<SceneOf>(scene, folder);
  ParameterTree compiled = formulas;
  makeCompiled<SceneOf>(compiled);
  // Commanded torques are the core's own: their scene has no other form.
  const bool has_compiled = scene.commands.empty();
  for (const char* stepper : {"auto", "dopri5", "fehlberg78", "radau"}) {
    // One stepper shows what formulas cost.
    if (!has_compiled || std::string(stepper) == "auto") {
      for (const char* form : {"formulas", "machine code"}) {
        methods.push_back(std::make_unique<Ours<SceneOf>>(stepper, form, scene, formulas, folder));
      }
    }
    if (has_compiled) {
      methods.push_back(
          std::make_unique<Ours<SceneOf>>(stepper, "compiled", scene, compiled, folder));
    }
  }
}

}  // namespace

void addOurMethods(const SceneCase& scene, const std::string& scene_folder, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, scene_folder, methods, tag); });
}

}  // namespace variator_sim::benchmark
