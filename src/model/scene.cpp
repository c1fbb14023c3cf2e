#include "variator_sim/scene.h"

#include <cmath>
#include <exception>
#include <limits>
#include <map>
#include <optional>

#include "model/scene_readers.h"
#include "model/thrown.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

const Choices<Principle> kPrinciples{{"generalized_gauss", Principle::kGeneralizedGauss},
                                     {"gauss", Principle::kGauss}};
const Choices<StepperKind> kSteppers{{"auto", StepperKind::kAuto},
                                     {"rk4", StepperKind::kRk4},
                                     {"dopri5", StepperKind::kDopri5},
                                     {"fehlberg78", StepperKind::kFehlberg78},
                                     {"radau", StepperKind::kRadau},
                                     {"taylor", StepperKind::kTaylor},
                                     {"taylor_fixed", StepperKind::kTaylorFixed}};
const Choices<MachineCode> kMachineCodes{
    {"auto", MachineCode::kAuto}, {"never", MachineCode::kNever}, {"always", MachineCode::kAlways}};

template <class Value>
const char* wordOf(const Choices<Value>& words, Value value) {
  for (const auto& [word, meaning] : words) {
    if (meaning == value) return word;
  }
  return "";
}

/// Refuses the steppers of earlier versions, of which some have a successor.
void refuseRemovedStepper(ParameterReader& reader) {
  static const std::map<std::string, std::string> kSuccessors{
      {"rosenbrock4", "radau"},  {"rosenbrock4_fixed", "radau"}, {"radau5", "radau"},
      {"radau5_fixed", "radau"}, {"dop853", "fehlberg78"},       {"dopri5_fixed", "rk4"}};
  const ParameterTree* given = reader.raw("stepper");
  const auto found = kSuccessors.find(given != nullptr ? given->asText() : "");
  if (found == kSuccessors.end()) return;
  std::vector<std::string> allowed;
  for (const auto& it : kSteppers) allowed.emplace_back(it.first);
  throw reader.error("stepper", inQuotes(found->first) + " was removed; use " +
                                    inQuotes(found->second) + "; allowed: " + joinNames(allowed));
}

SolverSettings readSolver(ParameterReader& root) {
  SolverSettings settings;
  if (!root.has("solver")) return settings;
  ParameterReader reader = root.section("solver");
  refuseRemovedStepper(reader);
  settings.stepper = reader.choice("stepper", kSteppers, "auto");
  // A step cannot be controlled to tolerances closer to round-off than this.
  settings.relative_tolerance =
      reader.number("relative_tolerance", Range::between(1e-14, 0.1), settings.relative_tolerance);
  settings.absolute_tolerance =
      reader.number("absolute_tolerance", Range::notNegative(), settings.absolute_tolerance);
  settings.step = reader.number("step", Range::positive("s"), settings.step);
  settings.maximum_step =
      reader.number("maximum_step", Range::positive("s"), settings.maximum_step);
  settings.maximum_steps =
      reader.integer("maximum_steps", 1, std::numeric_limits<int>::max(), settings.maximum_steps);
  settings.sleep = reader.boolean("sleep", settings.sleep);
  settings.machine_code = reader.choice("machine_code", kMachineCodes, "auto");
  reader.finish();
  return settings;
}

InitialConditions readInitial(ParameterReader& root, std::size_t shaft_count) {
  InitialConditions initial;
  initial.angle.assign(shaft_count, 0.0);
  initial.velocity.assign(shaft_count, 0.0);
  if (!root.has("initial")) return initial;
  ParameterReader reader =
      root.section("initial", {"angle", "velocity", "acceleration", "project"});
  if (reader.has("angle")) initial.angle = reader.numbers("angle", shaft_count, Range::any("rad"));
  if (reader.has("velocity"))
    initial.velocity = reader.numbers("velocity", shaft_count, Range::any("rad/s"));
  if (reader.has("acceleration")) {
    initial.acceleration = reader.numbers("acceleration", shaft_count, Range::any("rad/s^2"));
  }
  initial.project = reader.boolean("project", initial.project);
  reader.finish();
  return initial;
}

/// A kind of component, as the scene and the factory know it.
template <class Component>
struct ComponentKind {
  const char* name;
  const char* list;
  std::vector<std::string> columns;  ///< NAME/COLUMN of each component, taken for outputs
  std::shared_ptr<Component> (ComponentFactory::*create)(const std::string& type);
  /// Called only when a message needs the types: a factory may have to search for plugins.
  std::vector<std::string> (ComponentFactory::*types)();
};
const ComponentKind<Torque> kTorqueKind{"torque",
                                        "torques",
                                        {"power"},
                                        &ComponentFactory::createTorque,
                                        &ComponentFactory::torqueTypes};
const ComponentKind<Constraint> kConstraintKind{"constraint",
                                                "constraints",
                                                {"residual", "multiplier"},
                                                &ComponentFactory::createConstraint,
                                                &ComponentFactory::constraintTypes};

template <class Kind, class Other>
[[noreturn]] void throwUnknownType(const Kind& kind, const Other& other, ComponentFactory& factory,
                                   const std::string& path, const std::string& type) {
  const std::vector<std::string> types = (factory.*kind.types)();
  const std::vector<std::string> others = (factory.*other.types)();
  if (contains(others, type)) {
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

/// Rejects outputs whose columns NAME/OUTPUT are taken.
void checkOutputNames(const Law& law, const std::vector<std::string>& columns) {
  std::vector<std::string> taken = columns;
  for (const auto& it : law.outputs()) {
    if (!isName(it.first) || contains(taken, it.first)) {
      throw SceneError(law.name(), "states an output " + inQuotes(it.first) +
                                       " (outputNames); allowed: letters, digits and '_', starting "
                                       "with a letter, each name once, and none of " +
                                       joinNames(columns));
    }
    taken.push_back(it.first);
  }
}

/// Makes and configures a component of one kind.
template <class Component, class Other>
std::shared_ptr<Component> readComponent(const std::string& name, ParameterReader& root,
                                         const ComponentKind<Component>& kind, const Other& other,
                                         ComponentFactory& factory, Scene* scene) {
  ParameterReader reader = root.section(name);
  const std::string type = reader.text("type");
  std::shared_ptr<Component> component;
  try {
    component = (factory.*kind.create)(type);
  } catch (...) {
    throw reader.error("type", inQuotes(type) + " cannot be loaded: " + describeThrown());
  }
  if (component == nullptr) {
    throwUnknownType(kind, other, factory, reader.keyPath("type"), type);
  }

  LawContext law(name, reader, scene->shafts, scene->inputs, scene->symbols, scene->graph,
                 factory.libraries());
  endIfInterrupted();
  try {
    component->configure(law);
  } catch (const SceneError& error) {
    // An error of the whole component follows from its numbers.
    if (error.keyPath() != name) throw;
    throw SceneError(name, error.message() + scene->extreme_numbers);
  } catch (const Interrupted&) {
    throw;
  } catch (...) {
    throw SceneError(name, inQuotes(type) + " cannot be configured: " + describeThrown());
  }
  reader.finish();
  const std::vector<std::string>& warnings = law.warnings();
  scene->warnings.insert(scene->warnings.end(), warnings.begin(), warnings.end());
  checkOutputNames(*component, kind.columns);
  return component;
}

/// Rejects inputs without two derivatives: a constraint of order 1 is differentiated twice, so a
/// jump of u or u' would need an impulse.
void checkInputsOfOrder1(const Constraint& constraint, const Scene& scene) {
  if (constraint.order() != 1) return;
  for (const int index : expression::inputsIn(*scene.graph, {constraint.function()})) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(index)];
    if (input.hold == Hold::kSecondOrderLag) continue;
    if (input.kind != InputKind::kCommanded) {
      throw SceneError(constraint.name(),
                       "it is of order 1 and reads " + inQuotes(input.name) +
                           ", a variable, state or delay, whose second rate it would need "
                           "without jumps; allowed: a "
                           "constraint of order 2 (of a ratio: variator_sim/SlipRatio)");
    }
    const bool is_shared = input.owner != constraint.name();
    // The message names the input's own dictionary, if it has one.
    const std::size_t end = input.topic_path.rfind('/');
    const std::string place = is_shared                  ? input.owner
                              : end == std::string::npos ? constraint.name()
                                                         : input.topic_path.substr(0, end);
    throw SceneError(place + "/hold",
                     "the input of topic " + inQuotes(input.topic) + " " +
                         (is_shared ? "is read by the constraint " + inQuotes(constraint.name())
                                    : std::string("belongs to a constraint")) +
                         " of order 1, which takes inputs with two derivatives only; allowed: hold "
                         "second_order_lag, with a time_constant (a ratio that may jump: a "
                         "constraint of order 2, variator_sim/SlipRatio)");
  }
}

void checkTopics(const Scene& scene, const std::vector<std::string>& taken) {
  for (const CommandInputSettings& input : scene.inputs) {
    const bool is_taken = contains(taken, input.topic);
    if (!is_taken || input.kind != InputKind::kCommanded) continue;
    throw SceneError(input.topic_path.empty() ? input.owner + "/topic" : input.topic_path,
                     inQuotes(input.topic) +
                         " is a topic of the node itself; allowed: any name but " +
                         joinNames(taken));
  }
}

template <class Values, class Make>
ParameterTree toTree(const Values& values, Make make) {
  ParameterTree::List list;
  for (const auto& value : values) list.push_back(make(value));
  return ParameterTree::list(std::move(list));
}

/// Returns `tree` without the node's keys and with the defaults that were taken. `inertia`: J as
/// the scene gives it.
ParameterTree resolve(const ParameterTree& tree, const SceneNames& names,
                      const std::vector<std::string>& node_keys, const Scene& scene,
                      const Eigen::MatrixXd& inertia, bool verify_derivatives) {
  ParameterTree::Dictionary root = tree.asDictionary();
  for (const std::string& key : node_keys) root.erase(key);
  for (const SceneList& list : kSceneLists) {
    root[list.key] = toTree(names.*list.names, ParameterTree::text);
  }
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!scene.inertia_harmonics.empty() && !scene.inertia_harmonics[n].empty()) continue;
    if (!scene.inertia_formulas.empty()) continue;
    root[scene.shafts[n]] =
        ParameterTree::dictionary({{"inertia", ParameterTree::real(inertia(i, i))}});
  }
  root.emplace("inertia_coupling", ParameterTree::list());
  root["verify_derivatives"] = ParameterTree::boolean(verify_derivatives);
  root["principle"] = ParameterTree::text(toString(scene.principle));

  ParameterTree::Dictionary initial{
      {"angle", toTree(scene.initial.angle, ParameterTree::real)},
      {"velocity", toTree(scene.initial.velocity, ParameterTree::real)},
      {"project", ParameterTree::boolean(scene.initial.project)}};
  if (!scene.initial.acceleration.empty()) {
    initial["acceleration"] = toTree(scene.initial.acceleration, ParameterTree::real);
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

/// Collects the faults of independent parts of a scene for one message.
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
  /// Throws a SceneError with all faults, at the path of the first, if there are any.
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

void readComponents(ParameterReader& root, const SceneNames& names, ComponentFactory& factory,
                    Scene* scene, Faults* faults) {
  for (const std::string& name : names.torques) {
    faults->collect([&] {
      scene->torques.push_back(
          readComponent(name, root, kTorqueKind, kConstraintKind, factory, scene));
    });
  }
  for (const std::string& name : names.constraints) {
    faults->collect([&] {
      scene->constraints.push_back(
          readComponent(name, root, kConstraintKind, kTorqueKind, factory, scene));
      checkInputsOfOrder1(*scene->constraints.back(), *scene);
    });
  }
}

void readOutputs(ParameterReader& root, const SceneNames& names, Scene* scene, Faults* faults) {
  namePrinciple(scene);
  for (const std::string& name : names.outputs) {
    faults->collect([&] {
      ParameterReader reader = root.section(name);
      ComponentContext context = contextOf(name, reader, scene);
      scene->outputs.push_back(readOutput(context));
      reader.finish();
      if (expression::describeTakenName(name, scene->shafts).empty())
        scene->symbols.values.emplace(name, scene->outputs.back().si);
    });
  }
  scene->symbols.observed.clear();
}

/// Limits the number of switching functions: each step is searched for the zeros of each, if
/// necessary in thousands of parts, so more of them would keep one step busy for minutes. (Steps
/// end there, because an error estimate across a kink is unreliable.)
void checkEdges(const Scene& scene) {
  constexpr std::size_t kMostEdges = 500;
  std::size_t count = 0;
  for (const Law* law : scene.laws()) {
    count += expression::countSwitchingFunctions(*scene.graph, law->formulas());
  }
  if (count <= kMostEdges) return;
  throw SceneError("", "abs, min, max, sign, clamp, if, tables and laws that switch make " +
                           std::to_string(count) +
                           " edges at which the torques and constraints change their branch; "
                           "allowed: " +
                           std::to_string(kMostEdges) + " at most");
}

}  // namespace

const char* toString(Principle principle) {
  return wordOf(kPrinciples, principle);
}
const char* toString(StepperKind kind) {
  return wordOf(kSteppers, kind);
}
const char* toString(MachineCode machine_code) {
  return wordOf(kMachineCodes, machine_code);
}

bool isFixedStep(StepperKind kind) {
  return kind == StepperKind::kRk4 || kind == StepperKind::kTaylorFixed;
}

Scene readScene(const ParameterTree& given, ComponentFactory& factory, const NodeNames& node) {
  const std::optional<ParameterTree> merged = mergeParts(given, node.keys);
  const ParameterTree& tree = merged ? *merged : given;
  ParameterReader root(tree, "");
  const SceneNames names = readSceneNames(tree, root, node.keys);
  Scene scene;
  scene.shafts = names.shafts;
  scene.extreme_numbers = describeExtremeNumbers(tree);
  constexpr int kMostOperands = 50000;
  scene.graph->limitOperands(kMostOperands);
  Faults faults;
  bool verify_derivatives = true;
  bool has_inertia = false;
  bool has_inertia_formulas = false;
  faults.collect([&] {
    has_inertia_formulas = readInertia(root, false, &scene);
    has_inertia = true;
  });
  faults.collect(
      [&] { scene.principle = root.choice("principle", kPrinciples, "generalized_gauss"); });
  faults.collect([&] { scene.initial = readInitial(root, scene.shafts.size()); });
  faults.collect([&] { scene.solver = readSolver(root); });
  faults.collect([&] { verify_derivatives = root.boolean("verify_derivatives", true); });
  bool has_symbols = false;
  faults.collect([&] {
    scene.symbols = readSceneSymbols(root, names, scene.inputs, &scene.warnings);
    declareMemory(root, names, &scene);
    has_symbols = true;
    if (has_inertia_formulas) readInertia(root, true, &scene);
  });
  // Without these names formulas would be blamed for other faults.
  if (!has_symbols) faults.tell();
  readComponents(root, names, factory, &scene, &faults);
  const Eigen::MatrixXd inertia = scene.inertia;
  faults.collect([&] {
    const bool has_all = has_inertia && scene.constraints.size() == names.constraints.size();
    if (has_all) tieMasslessShafts(&scene);
  });
  faults.collect([&] { readMemory(root, names, &scene); });
  readOutputs(root, names, &scene, &faults);
  faults.collect([&] { checkDelays(scene); });
  faults.collect([&] { checkTopics(scene, node.topics); });
  faults.collect([&] { checkEdges(scene); });
  faults.tell();
  if (verify_derivatives) verifyDerivatives(scene);
  scene.resolved = resolve(tree, names, node.keys, scene, inertia, verify_derivatives);
  if (merged) scene.with_parts = given;
  for (const ConstraintPtr& constraint : scene.constraints) warnOfEnergy(*constraint, &scene);
  return scene;
}

void rereadNumbers(const ParameterTree& given, const NodeNames& node, Scene* scene) {
  const std::optional<ParameterTree> merged = mergeParts(given, node.keys);
  const ParameterTree& tree = merged ? *merged : given;
  ParameterReader root(tree, "");
  scene->extreme_numbers = describeExtremeNumbers(tree);
  readInertia(root, true, scene);
  tieMasslessShafts(scene);
  scene->initial = readInitial(root, scene->shafts.size());
  scene->solver = readSolver(root);
  scene->resolved = scene->with_parts = {};
}

bool isOutsideFormulas(const std::string& path, const Scene& scene) {
  const std::string first = path.substr(0, path.find_first_of("/["));
  if (!scene.inertia_formulas.empty()) return first == "solver";
  if (first == "initial" || first == "solver") return true;
  return contains(scene.shafts, first) && !scene.formulas_read_inertia;
}

std::string Scene::nameOfDirection() const {
  for (const ConstraintPtr& it : constraints) {
    if (!it->direction().empty()) return it->name();
  }
  return "";
}

std::vector<std::string> Scene::holdNames() const {
  std::vector<std::string> names;
  for (const Law* law : laws()) {
    for (const Holding& it : law->holdings()) names.push_back(law->nameOf(it));
  }
  return names;
}

std::vector<const Law*> Scene::laws() const {
  std::vector<const Law*> all;
  for (const TorquePtr& torque : torques) all.push_back(torque.get());
  for (const ConstraintPtr& constraint : constraints) all.push_back(constraint.get());
  return all;
}

std::vector<std::string> Scene::eventNames() const {
  std::vector<std::string> names = holdNames();
  for (const SceneEvent& event : events) names.push_back(event.name);
  return names;
}

}  // namespace variator_sim
