#include "variator_sim/scene.h"

#include <algorithm>
#include <array>
#include <exception>
#include <limits>
#include <set>
#include <utility>

#include "model/derivative_check.h"
#include "model/extreme_numbers.h"
#include "model/scene_inertia.h"
#include "model/scene_names.h"
#include "model/scene_symbols.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim {
namespace {

constexpr std::array<StepperKind, 13> kSteppers{
    StepperKind::kAuto,        StepperKind::kRk4,
    StepperKind::kDopri5,      StepperKind::kDop853,
    StepperKind::kFehlberg78,  StepperKind::kRosenbrock4,
    StepperKind::kDopri5Fixed, StepperKind::kRosenbrock4Fixed,
    StepperKind::kRadau,       StepperKind::kRadau5,
    StepperKind::kRadau5Fixed, StepperKind::kTaylor,
    StepperKind::kTaylorFixed};

Principle readPrinciple(ParameterReader& root) {
  const std::string generalized_gauss = toString(Principle::kGeneralizedGauss);
  const std::string gauss = toString(Principle::kGauss);
  return root.choice("principle", {generalized_gauss, gauss}, generalized_gauss) == gauss
             ? Principle::kGauss
             : Principle::kGeneralizedGauss;
}

MachineCode readMachineCode(ParameterReader& reader) {
  const std::string chosen =
      reader.choice("machine_code", {"auto", "never", "always"}, toString(MachineCode::kAuto));
  for (const MachineCode one : {MachineCode::kNever, MachineCode::kAlways}) {
    if (chosen == toString(one)) return one;
  }
  return MachineCode::kAuto;
}

SolverSettings readSolver(ParameterReader& root) {
  SolverSettings settings;
  if (!root.has("solver")) return settings;
  ParameterReader reader = root.section("solver");
  std::vector<std::string> names;
  names.reserve(kSteppers.size());
  for (const StepperKind kind : kSteppers) names.emplace_back(toString(kind));
  const std::string stepper = reader.choice("stepper", names, toString(settings.stepper));
  settings.stepper = *std::find_if(kSteppers.begin(), kSteppers.end(),
                                   [&](StepperKind kind) { return stepper == toString(kind); });
  // Closer than this to round-off a step cannot be controlled.
  settings.relative_tolerance =
      reader.number("relative_tolerance", Range::between(1e-14, 0.1), settings.relative_tolerance);
  settings.absolute_tolerance =
      reader.number("absolute_tolerance", Range::notNegative(), settings.absolute_tolerance);
  settings.step = reader.number("step", Range::positive(), settings.step);
  settings.maximum_step = reader.number("maximum_step", Range::positive(), settings.maximum_step);
  settings.maximum_steps =
      reader.integer("maximum_steps", 1, std::numeric_limits<int>::max(), settings.maximum_steps);
  settings.sleep = reader.boolean("sleep", settings.sleep);
  settings.machine_code = readMachineCode(reader);
  reader.finish();
  return settings;
}

InitialConditions readInitial(ParameterReader& root, std::size_t shaft_count) {
  InitialConditions initial;
  initial.angle.assign(shaft_count, 0.0);
  initial.velocity.assign(shaft_count, 0.0);
  if (!root.has("initial")) return initial;
  ParameterReader reader = root.section("initial");
  for (const char* key : {"angle", "velocity", "acceleration", "project"}) reader.allow(key);
  if (reader.has("angle")) initial.angle = reader.numbers("angle", shaft_count);
  if (reader.has("velocity")) initial.velocity = reader.numbers("velocity", shaft_count);
  if (reader.has("acceleration")) {
    initial.acceleration = reader.numbers("acceleration", shaft_count);
  }
  initial.project = reader.boolean("project", initial.project);
  reader.finish();
  return initial;
}

/// One kind of component as the scene and the factory know it.
struct ComponentKind {
  const char* name;
  const char* list;
  std::vector<std::string> columns;  ///< NAME/COLUMN that each has: no output's name
  /// Asked for only when a message needs them: a factory may have to search for plugins.
  std::vector<std::string> (ComponentFactory::*types)();
};
const ComponentKind kTorqueKind{"torque", "torques", {"power"}, &ComponentFactory::torqueTypes};
const ComponentKind kConstraintKind{
    "constraint", "constraints", {"residual", "multiplier"}, &ComponentFactory::constraintTypes};

[[noreturn]] void throwUnknownType(const ComponentKind& kind, const ComponentKind& other,
                                   ComponentFactory& factory, const std::string& path,
                                   const std::string& type) {
  const std::vector<std::string> types = (factory.*kind.types)();
  const std::vector<std::string> others = (factory.*other.types)();
  if (std::find(others.begin(), others.end(), type) != others.end()) {
    throw SceneError(path, inQuotes(type) + " is a " + other.name + ", not a " + kind.name +
                               ": its name belongs in " + other.list + ", not in " + kind.list +
                               "; allowed: " + joinNames(types));
  }
  const std::string package = type.substr(0, type.find('/'));
  const bool is_elsewhere = package != type && package != "variator_sim";
  throw SceneError(
      path, inQuotes(type) + " is not a known type of " + kind.name + suggestName(type, types) +
                (is_elsewhere ? ": is the package " + inQuotes(package) +
                                    " built, and its setup.bash sourced in this terminal?"
                              : "") +
                "; allowed: " + (types.empty() ? "none" : joinNames(types)));
}

/// A component's outputs become columns NAME/OUTPUT.
void checkOutputNames(const std::string& component, const ComponentKind& kind,
                      const std::vector<std::string>& outputs) {
  std::vector<std::string> taken = kind.columns;
  for (const std::string& output : outputs) {
    if (!isName(output) || std::find(taken.begin(), taken.end(), output) != taken.end()) {
      throw SceneError(component, "states an output " + inQuotes(output) +
                                      " (outputNames); allowed: letters, digits and '_', starting "
                                      "with a letter, each name once, and none of " +
                                      joinNames(kind.columns));
    }
    taken.push_back(output);
  }
}

/// `create` makes a component of a type; the rest is the same for torques and constraints.
template <typename Create>
auto readComponent(const std::string& name, ParameterReader& root, const ComponentKind& kind,
                   const ComponentKind& other, ComponentFactory& factory, Create create,
                   Scene* scene, std::set<int>* used_inputs = nullptr) {
  ParameterReader reader = root.section(name);
  const std::string type = reader.text("type");
  decltype(create(type)) component;
  try {
    component = create(type);
  } catch (const std::exception& error) {
    throw SceneError(reader.keyPath("type"), inQuotes(type) + " cannot be loaded: " + error.what());
  }
  if (component == nullptr) {
    throwUnknownType(kind, other, factory, reader.keyPath("type"), type);
  }

  ComponentContext context(name, reader, scene->shafts, scene->inputs, scene->symbols, scene->graph,
                           factory.libraries());
  try {
    component->configure(context);
  } catch (const SceneError& error) {
    // Of the whole component: a consequence of its numbers.
    if (error.keyPath() != name) throw;
    throw SceneError(name, error.message() + scene->extreme_numbers);
  } catch (const std::exception& error) {
    throw SceneError(name, inQuotes(type) + " cannot be configured: " + error.what());
  }
  reader.finish();
  const std::vector<std::string>& warnings = context.warnings();
  scene->warnings.insert(scene->warnings.end(), warnings.begin(), warnings.end());
  if (used_inputs != nullptr) *used_inputs = context.usedInputs();
  checkOutputNames(name, kind, component->outputNames());
  return component;
}

/// A constraint of order 1 is differentiated twice, and its inputs with it: a jump of u or u' would
/// need an impulse.
void checkInputsOfOrder1(const Constraint& constraint, const Scene& scene,
                         const std::set<int>& used_inputs) {
  if (constraint.order() != 1) return;
  for (const int index : used_inputs) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(index)];
    if (input.hold == Hold::kSecondOrderLag) continue;
    const bool is_shared = input.owner != constraint.name();
    // Where its dictionary stands, if it has one of its own.
    const std::size_t end = input.topic_path.rfind('/');
    const std::string place = is_shared                  ? input.owner
                              : end == std::string::npos ? constraint.name()
                                                         : input.topic_path.substr(0, end);
    throw SceneError(place + "/hold",
                     "the input of topic " + inQuotes(input.topic) + " " +
                         (is_shared ? "is read by the constraint " + inQuotes(constraint.name())
                                    : std::string("belongs to a constraint")) +
                         " of order 1, which takes inputs with two derivatives only; allowed: hold "
                         "second_order_lag");
  }
}

void checkTopics(const Scene& scene, const std::vector<std::string>& taken) {
  for (const CommandInputSettings& input : scene.inputs) {
    if (std::find(taken.begin(), taken.end(), input.topic) == taken.end()) continue;
    throw SceneError(input.topic_path.empty() ? input.owner + "/topic" : input.topic_path,
                     inQuotes(input.topic) +
                         " is a topic of the node itself; allowed: any name but " +
                         joinNames(taken));
  }
}

ParameterTree toTree(const std::vector<std::string>& names) {
  ParameterTree::List values;
  for (const std::string& name : names) values.push_back(ParameterTree::text(name));
  return ParameterTree::list(std::move(values));
}

ParameterTree toTree(const std::vector<double>& numbers) {
  ParameterTree::List values;
  for (const double number : numbers) values.push_back(ParameterTree::real(number));
  return ParameterTree::list(std::move(values));
}

/// `tree` without the node's keys and with the defaults that were taken.
ParameterTree resolve(const ParameterTree& tree, const SceneNames& names,
                      const std::vector<std::string>& node_keys, const Scene& scene,
                      bool verify_derivatives) {
  ParameterTree::Dictionary root = tree.asDictionary();
  for (const std::string& key : node_keys) root.erase(key);
  root["shafts"] = toTree(names.shafts);
  root["torques"] = toTree(names.torques);
  root["constraints"] = toTree(names.constraints);
  root["inputs"] = toTree(names.inputs);
  root["tables"] = toTree(names.tables);
  root["outputs"] = toTree(names.outputs);
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!scene.inertia_harmonics.empty() && !scene.inertia_harmonics[n].empty()) continue;
    root[scene.shafts[n]] =
        ParameterTree::dictionary({{"inertia", ParameterTree::real(scene.inertia(i, i))}});
  }
  root.emplace("inertia_coupling", ParameterTree::list());
  root["verify_derivatives"] = ParameterTree::boolean(verify_derivatives);
  root["principle"] = ParameterTree::text(toString(scene.principle));

  ParameterTree::Dictionary initial{{"angle", toTree(scene.initial.angle)},
                                    {"velocity", toTree(scene.initial.velocity)},
                                    {"project", ParameterTree::boolean(scene.initial.project)}};
  if (!scene.initial.acceleration.empty()) {
    initial["acceleration"] = toTree(scene.initial.acceleration);
  }
  root["initial"] = ParameterTree::dictionary(std::move(initial));

  const SolverSettings& solver = scene.solver;
  root["solver"] = ParameterTree::dictionary(
      {{"stepper", ParameterTree::text(toString(solver.stepper))},
       {"relative_tolerance", ParameterTree::real(solver.relative_tolerance)},
       {"absolute_tolerance", ParameterTree::real(solver.absolute_tolerance)},
       {"step", ParameterTree::real(solver.step)},
       {"maximum_step", ParameterTree::real(solver.maximum_step)},
       {"maximum_steps", ParameterTree::integer(solver.maximum_steps)},
       {"sleep", ParameterTree::boolean(solver.sleep)},
       {"machine_code", ParameterTree::text(toString(solver.machine_code))}});
  return ParameterTree::dictionary(std::move(root));
}

/// What is wrong with parts of a scene that can be read each by itself: told together.
class Faults {
 public:
  template <class Read>
  void collect(Read read) {
    try {
      read();
    } catch (const SceneError& error) {
      if (count_ == 0) path_ = error.keyPath();
      if (++count_ > kMostTold) return;
      text_ += count_ == 1 ? error.message() : std::string("\n") + error.what();
    }
  }
  /// Throws a SceneError when there is any: at the first one's path.
  void tell() const {
    if (count_ == 0) return;
    const int rest = count_ - kMostTold;
    throw SceneError(path_, text_ + (rest > 0 ? "\nand " + std::to_string(rest) + " more" : ""));
  }

 private:
  static constexpr int kMostTold = 10;
  int count_ = 0;
  std::string path_;
  std::string text_;
};

/// Every step is searched for each edge, in thousands of parts where it has to be: more of them
/// would keep one step busy for minutes.
void checkEdges(const Scene& scene) {
  constexpr std::size_t kMostEdges = 500;
  std::size_t count = 0;
  for (const TorquePtr& torque : scene.torques) count += torque->guards().size();
  for (const ConstraintPtr& constraint : scene.constraints) count += constraint->guards().size();
  if (count <= kMostEdges) return;
  throw SceneError("", "abs, min, max, sign, clamp, if, tables and laws that switch make " +
                           std::to_string(count) +
                           " edges at which the torques and constraints change their branch; "
                           "allowed: " +
                           std::to_string(kMostEdges) + " at most");
}

}  // namespace

const char* toString(Principle principle) {
  switch (principle) {
    case Principle::kGeneralizedGauss:
      return "generalized_gauss";
    case Principle::kGauss:
      return "gauss";
  }
  return "";
}

const char* toString(StepperKind kind) {
  switch (kind) {
    case StepperKind::kAuto:
      return "auto";
    case StepperKind::kRk4:
      return "rk4";
    case StepperKind::kDopri5:
      return "dopri5";
    case StepperKind::kDop853:
      return "dop853";
    case StepperKind::kFehlberg78:
      return "fehlberg78";
    case StepperKind::kRosenbrock4:
      return "rosenbrock4";
    case StepperKind::kDopri5Fixed:
      return "dopri5_fixed";
    case StepperKind::kRosenbrock4Fixed:
      return "rosenbrock4_fixed";
    case StepperKind::kRadau:
      return "radau";
    case StepperKind::kRadau5:
      return "radau5";
    case StepperKind::kRadau5Fixed:
      return "radau5_fixed";
    case StepperKind::kTaylor:
      return "taylor";
    case StepperKind::kTaylorFixed:
      return "taylor_fixed";
  }
  return "";
}

const char* toString(MachineCode machine_code) {
  switch (machine_code) {
    case MachineCode::kAuto:
      return "auto";
    case MachineCode::kNever:
      return "never";
    case MachineCode::kAlways:
      return "always";
  }
  return "";
}

bool isFixedStep(StepperKind kind) {
  return kind == StepperKind::kRk4 || kind == StepperKind::kDopri5Fixed ||
         kind == StepperKind::kRosenbrock4Fixed || kind == StepperKind::kRadau5Fixed ||
         kind == StepperKind::kTaylorFixed;
}

Scene readScene(const ParameterTree& tree, ComponentFactory& factory, const NodeNames& node) {
  ParameterReader root(tree, "");
  const SceneNames names = readSceneNames(tree, root, node.keys);
  Scene scene;
  scene.shafts = names.shafts;
  scene.extreme_numbers = describeExtremeNumbers(tree);
  constexpr int kMostOperands = 50000;
  scene.graph->limitOperands(kMostOperands);
  Faults faults;
  bool verify_derivatives = true;
  faults.collect([&] { readInertia(root, &scene); });
  faults.collect([&] { scene.principle = readPrinciple(root); });
  faults.collect([&] { scene.initial = readInitial(root, scene.shafts.size()); });
  faults.collect([&] { scene.solver = readSolver(root); });
  faults.collect([&] { verify_derivatives = root.boolean("verify_derivatives", true); });
  faults.collect([&] { scene.symbols = readSceneSymbols(root, names, scene.inputs); });
  // Without these names formulas would be blamed for what is not theirs.
  if (scene.symbols.inputs.size() + scene.symbols.tables.size() <
      names.inputs.size() + names.tables.size()) {
    faults.tell();
  }
  for (const std::string& name : names.torques) {
    faults.collect([&] {
      scene.torques.push_back(readComponent(
          name, root, kTorqueKind, kConstraintKind, factory,
          [&](const std::string& type) { return factory.createTorque(type); }, &scene));
    });
  }
  for (const std::string& name : names.constraints) {
    faults.collect([&] {
      std::set<int> used_inputs;
      scene.constraints.push_back(readComponent(
          name, root, kConstraintKind, kTorqueKind, factory,
          [&](const std::string& type) { return factory.createConstraint(type); }, &scene,
          &used_inputs));
      checkInputsOfOrder1(*scene.constraints.back(), scene, used_inputs);
    });
  }
  for (const std::string& name : names.outputs) {
    faults.collect([&] {
      ParameterReader reader = root.section(name);
      ComponentContext context(name, reader, scene.shafts, scene.inputs, scene.symbols,
                               scene.graph);
      scene.outputs.emplace_back(context);
      reader.finish();
    });
  }
  faults.collect([&] { checkTopics(scene, node.topics); });
  faults.collect([&] { checkEdges(scene); });
  faults.tell();
  if (verify_derivatives) verifyDerivatives(scene);
  scene.resolved = resolve(tree, names, node.keys, scene, verify_derivatives);
  return scene;
}

void rereadNumbers(const ParameterTree& tree, Scene* scene) {
  ParameterReader root(tree, "");
  scene->extreme_numbers = describeExtremeNumbers(tree);
  scene->inertia_harmonics.clear();
  readInertia(root, scene);
  scene->initial = readInitial(root, scene->shafts.size());
  scene->solver = readSolver(root);
  scene->resolved = {};
}

bool isOutsideFormulas(const std::string& path, const Scene& scene) {
  const std::string first = path.substr(0, path.find_first_of("/["));
  return first == "initial" || first == "solver" ||
         std::find(scene.shafts.begin(), scene.shafts.end(), first) != scene.shafts.end();
}

}  // namespace variator_sim
