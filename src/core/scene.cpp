#include "variator_sim/scene.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <map>

#include "derivative_check.h"
#include "variator_sim/nearest_name.h"
#include "variator_sim/types.h"

namespace variator_sim {
namespace {

constexpr std::array<StepperKind, 10> kSteppers{
    StepperKind::kAuto,        StepperKind::kRk4,
    StepperKind::kDopri5,      StepperKind::kDop853,
    StepperKind::kFehlberg78,  StepperKind::kRosenbrock4,
    StepperKind::kDopri5Fixed, StepperKind::kRosenbrock4Fixed,
    StepperKind::kRadau5,      StepperKind::kRadau5Fixed};

/// Keys at the scene's root that are not names of shafts, torques or constraints.
const std::vector<std::string>& sceneKeys() {
  static const std::vector<std::string> keys{"shafts",      "inertia_coupling",  "torques",
                                             "constraints", "principle",         "initial",
                                             "solver",      "verify_derivatives"};
  return keys;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::string> joined(std::vector<std::string> first,
                                const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

std::string elementPath(const std::string& list, std::size_t index) {
  return list + "[" + std::to_string(index) + "]";
}

/// ^[A-Za-z][A-Za-z0-9_]*$
bool isName(const std::string& name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !name.empty() && is_letter(name.front()) &&
         std::all_of(name.begin(), name.end(),
                     [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; });
}

/// The names that a scene lists.
struct Lists {
  std::vector<std::string> shafts;
  std::vector<std::string> torques;
  std::vector<std::string> constraints;
};

/// Valid names, unique together, none of them a key of the scene or of the node.
void checkNames(const Lists& lists) {
  std::map<std::string, std::string> listed_in;
  const auto check = [&](const char* list, const std::vector<std::string>& names) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string path = elementPath(list, i);
      const std::string& name = names[i];
      if (!isName(name)) {
        throw SceneError(path, "'" + name +
                                   "' is not a valid name; allowed: letters, digits and '_', "
                                   "starting with a letter");
      }
      const std::vector<std::string> taken = joined(sceneKeys(), nodeKeys());
      if (contains(taken, name)) {
        throw SceneError(path, "'" + name + "' is a key of the " +
                                   (contains(sceneKeys(), name) ? "scene" : "node") +
                                   " itself; allowed: any name but " + joinNames(taken));
      }
      const auto [other, is_new] = listed_in.emplace(name, list);
      if (!is_new) {
        throw SceneError(path,
                         "'" + name + "' is listed twice" +
                             (other->second == list ? std::string()
                                                    : ": in " + other->second + " and in " + list) +
                             "; allowed: names that differ from those of all shafts, torques "
                             "and constraints");
      }
    }
  };
  check("shafts", lists.shafts);
  check("torques", lists.torques);
  check("constraints", lists.constraints);
}

Lists readLists(const ParameterTree& tree, ParameterReader& root) {
  const std::string shafts_expected =
      "a list of 1 to " + std::to_string(kMaxShafts) + " names of shafts";
  if (!root.has("shafts")) {
    std::vector<std::string> keys;
    for (const auto& entry : tree.asDictionary()) {
      if (!contains(sceneKeys(), entry.first)) keys.push_back(entry.first);
    }
    const std::string misspelt = findNearestName("shafts", keys);
    throw SceneError(
        "shafts",
        "missing; expected " + shafts_expected +
            (misspelt.empty() ? std::string() : " (is '" + misspelt + "' meant for 'shafts'?)"));
  }
  Lists lists;
  lists.shafts = root.names("shafts");
  lists.torques = root.names("torques");
  lists.constraints = root.names("constraints");
  if (lists.shafts.empty() || lists.shafts.size() > static_cast<std::size_t>(kMaxShafts)) {
    throw SceneError("shafts",
                     std::to_string(lists.shafts.size()) + " shafts; allowed: " + shafts_expected);
  }
  checkNames(lists);
  if (lists.constraints.size() >= lists.shafts.size()) {
    throw SceneError("constraints",
                     std::to_string(lists.constraints.size()) + " constraints on " +
                         std::to_string(lists.shafts.size()) +
                         " shafts leave nothing to move; allowed: fewer constraints than shafts, "
                         "here at most " +
                         std::to_string(lists.shafts.size() - 1));
  }
  return lists;
}

/// Refuses keys at the root that are neither the scene's, nor the node's, nor a listed name. Plain
/// values come first: a misspelt list would otherwise be blamed on the dictionaries it orders.
void checkRootKeys(const ParameterTree& tree, const std::vector<std::string>& allowed) {
  const auto is_dictionary = [](const ParameterTree& value) {
    return value.kind() == ParameterTree::Kind::kDictionary;
  };
  for (const bool dictionaries : {false, true}) {
    for (const auto& [key, value] : tree.asDictionary()) {
      if (is_dictionary(value) != dictionaries || contains(allowed, key)) continue;
      throw SceneError(
          key,
          "unknown key" + suggestName(key, allowed) +
              (dictionaries ? "; it is in none of the lists shafts, torques, constraints" : "") +
              "; allowed: " + joinNames(allowed));
    }
  }
}

struct ShaftInertia {
  double mean = 0.0;
  std::vector<InertiaHarmonic> harmonics;
};

double calcInertia(const ShaftInertia& inertia, double angle) {
  double value = inertia.mean;
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    value += harmonic.cosine * std::cos(harmonic.order * angle) +
             harmonic.sine * std::sin(harmonic.order * angle);
  }
  return value;
}

/// The least inertia over all angles: the best of a fine grid, refined by golden sections.
double calcLeastInertia(const ShaftInertia& inertia) {
  int highest = 1;
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    highest = std::max(highest, harmonic.order);
  }
  const int points = 64 * highest;
  const double spacing = 2.0 * 3.14159265358979323846 / points;
  double best = 0.0;
  for (int n = 0; n < points; ++n) {
    if (calcInertia(inertia, n * spacing) < calcInertia(inertia, best)) best = n * spacing;
  }
  double low = best - spacing;
  double high = best + spacing;
  constexpr double kGolden = 0.6180339887498949;
  for (int n = 0; n < 60; ++n) {
    const double left = high - kGolden * (high - low);
    const double right = low + kGolden * (high - low);
    (calcInertia(inertia, left) < calcInertia(inertia, right) ? high : low) =
        calcInertia(inertia, left) < calcInertia(inertia, right) ? right : left;
  }
  return std::min(calcInertia(inertia, best), calcInertia(inertia, 0.5 * (low + high)));
}

/// `inertia`: a number, or {mean, harmonics: [{order, cos, sin}, ...]}; positive at every angle.
ShaftInertia readInertia(ParameterReader& root, const std::string& shaft) {
  ParameterReader reader = root.section(shaft);
  reader.allow("inertia");
  ShaftInertia inertia;
  const ParameterTree* value = reader.raw("inertia");
  if (value == nullptr || value->kind() != ParameterTree::Kind::kDictionary) {
    inertia.mean = reader.number("inertia", Range::positive());
    reader.finish();
    return inertia;
  }
  ParameterReader parts = reader.section("inertia");
  for (const char* key : {"mean", "harmonics"}) parts.allow(key);
  inertia.mean = parts.number("mean", Range::positive());
  const ParameterTree* harmonics = parts.raw("harmonics");
  if (harmonics != nullptr && harmonics->kind() != ParameterTree::Kind::kNothing) {
    if (harmonics->kind() != ParameterTree::Kind::kList) {
      throw SceneError(parts.keyPath("harmonics"), "expected a list of {order, cos, sin}, got " +
                                                       harmonics->describeKind() + ": " +
                                                       harmonics->toText());
    }
    for (std::size_t n = 0; n < harmonics->asList().size(); ++n) {
      ParameterReader entry(harmonics->asList()[n], elementPath(parts.keyPath("harmonics"), n));
      for (const char* key : {"order", "cos", "sin"}) entry.allow(key);
      InertiaHarmonic harmonic;
      harmonic.order = entry.integer("order", 1, 1000);
      harmonic.cosine = entry.number("cos", Range::any(), 0.0);
      harmonic.sine = entry.number("sin", Range::any(), 0.0);
      entry.finish();
      inertia.harmonics.push_back(harmonic);
    }
  }
  parts.finish();
  reader.finish();
  const double least = calcLeastInertia(inertia);
  if (!(least > 0.0)) {
    throw SceneError(reader.keyPath("inertia"),
                     value->toText() + " falls to " + ParameterTree::real(least).toText() +
                         " kg m^2 at some angle; allowed: > 0 at every angle");
  }
  return inertia;
}

/// Off-diagonal terms [[a, b, value], ...]. `least` holds the least inertia of every shaft: J is
/// positive definite at every angle when it is with these on its diagonal.
void readInertiaCoupling(ParameterReader& root, const std::vector<std::string>& shafts,
                         const Eigen::VectorXd& least, Eigen::MatrixXd* J) {
  const std::string key = "inertia_coupling";
  const ParameterTree* couplings = root.raw(key);
  if (couplings == nullptr || couplings->kind() == ParameterTree::Kind::kNothing) return;
  const std::string expected = "a list of couplings [shaft, shaft, value in kg m^2]";
  const auto unexpected = [&](const std::string& path, const ParameterTree& value) {
    return SceneError(
        path, "expected " + expected + ", got " + value.describeKind() + ": " + value.toText());
  };
  if (couplings->kind() != ParameterTree::Kind::kList) throw unexpected(key, *couplings);

  std::vector<std::pair<int, int>> coupled;
  for (std::size_t n = 0; n < couplings->asList().size(); ++n) {
    const ParameterTree& coupling = couplings->asList()[n];
    const std::string path = elementPath(key, n);
    if (coupling.kind() != ParameterTree::Kind::kList || coupling.asList().size() != 3) {
      throw unexpected(path, coupling);
    }
    std::array<int, 2> pair{};
    for (std::size_t i = 0; i < 2; ++i) {
      const ParameterTree& name = coupling.asList()[i];
      if (name.kind() != ParameterTree::Kind::kText) throw unexpected(path, coupling);
      const auto found = std::find(shafts.begin(), shafts.end(), name.asText());
      if (found == shafts.end()) {
        throw SceneError(elementPath(path, i), "'" + name.asText() + "' is not a shaft" +
                                                   suggestName(name.asText(), shafts) +
                                                   "; allowed: " + joinNames(shafts));
      }
      pair[i] = static_cast<int>(found - shafts.begin());
    }
    if (pair[0] == pair[1]) {
      throw SceneError(
          path, coupling.toText() + " couples a shaft with itself; allowed: two different shafts");
    }
    const std::pair<int, int> sorted = std::minmax(pair[0], pair[1]);
    if (std::find(coupled.begin(), coupled.end(), sorted) != coupled.end()) {
      throw SceneError(path, coupling.toText() +
                                 " couples these shafts a second time; allowed: every pair once");
    }
    coupled.push_back(sorted);
    const double value =
        ParameterReader::toNumber(coupling.asList()[2], elementPath(path, 2), Range::any());
    (*J)(pair[0], pair[1]) = value;
    (*J)(pair[1], pair[0]) = value;
  }

  Eigen::MatrixXd smallest = *J;
  smallest.diagonal() = least;
  if (Eigen::LLT<Eigen::MatrixXd>(smallest).info() != Eigen::Success) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(smallest, Eigen::EigenvaluesOnly);
    throw SceneError(key,
                     couplings->toText() +
                         " makes the inertia matrix J indefinite: its smallest eigenvalue is " +
                         ParameterTree::real(solver.eigenvalues().minCoeff()).toText() +
                         " kg m^2; allowed: a positive definite J");
  }
}

Principle readPrinciple(ParameterReader& root) {
  const std::string generalized_gauss = toString(Principle::kGeneralizedGauss);
  const std::string gauss = toString(Principle::kGauss);
  return root.choice("principle", {generalized_gauss, gauss}, generalized_gauss) == gauss
             ? Principle::kGauss
             : Principle::kGeneralizedGauss;
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
  /// Asked for only when a message needs them: a factory may have to search for plugins.
  std::vector<std::string> (ComponentFactory::*types)();
};
constexpr ComponentKind kTorqueKind{"torque", "torques", &ComponentFactory::torqueTypes};
constexpr ComponentKind kConstraintKind{"constraint", "constraints",
                                        &ComponentFactory::constraintTypes};

[[noreturn]] void throwUnknownType(const ComponentKind& kind, const ComponentKind& other,
                                   ComponentFactory& factory, const std::string& path,
                                   const std::string& type) {
  const std::vector<std::string> types = (factory.*kind.types)();
  if (contains((factory.*other.types)(), type)) {
    throw SceneError(path, "'" + type + "' is a " + other.name + ", not a " + kind.name +
                               ": its name belongs in " + other.list + ", not in " + kind.list +
                               "; allowed: " + joinNames(types));
  }
  throw SceneError(path, "'" + type + "' is not a known type of " + kind.name +
                             suggestName(type, types) +
                             "; allowed: " + (types.empty() ? "none" : joinNames(types)));
}

/// `create` makes a component of a type; the rest is the same for torques and constraints.
template <typename Create>
auto readComponent(const std::string& name, ParameterReader& root, const ComponentKind& kind,
                   const ComponentKind& other, ComponentFactory& factory, Create create,
                   Scene* scene) {
  ParameterReader reader = root.section(name);
  const std::string type = reader.text("type");
  decltype(create(type)) component;
  try {
    component = create(type);
  } catch (const std::exception& error) {
    throw SceneError(reader.keyPath("type"), "'" + type + "' cannot be loaded: " + error.what());
  }
  if (component == nullptr) {
    throwUnknownType(kind, other, factory, reader.keyPath("type"), type);
  }

  ComponentContext context(name, reader, scene->shafts, scene->inputs);
  try {
    component->configure(context);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& error) {
    throw SceneError(name, "'" + type + "' cannot be configured: " + error.what());
  }
  reader.finish();
  return component;
}

/// A constraint of order 1 is differentiated twice, and its inputs with it: a jump of u or u' would
/// need an impulse.
void checkInputsOfOrder1(const Scene& scene) {
  for (const ConstraintPtr& constraint : scene.constraints) {
    if (constraint->order() != 1) continue;
    for (const CommandInputSettings& input : scene.inputs) {
      if (input.owner != constraint->name() || input.hold == Hold::kSecondOrderLag) continue;
      throw SceneError(constraint->name(),
                       "the input of topic '" + input.topic +
                           "' belongs to a constraint of order 1, which takes inputs with two "
                           "derivatives only; allowed: hold second_order_lag");
    }
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
ParameterTree resolve(const ParameterTree& tree, const Lists& lists, const Scene& scene,
                      bool verify_derivatives) {
  ParameterTree::Dictionary root = tree.asDictionary();
  for (const std::string& key : nodeKeys()) root.erase(key);
  root["shafts"] = toTree(lists.shafts);
  root["torques"] = toTree(lists.torques);
  root["constraints"] = toTree(lists.constraints);
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
       {"sleep", ParameterTree::boolean(solver.sleep)}});
  return ParameterTree::dictionary(std::move(root));
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
    case StepperKind::kRadau5:
      return "radau5";
    case StepperKind::kRadau5Fixed:
      return "radau5_fixed";
  }
  return "";
}

bool isFixedStep(StepperKind kind) {
  return kind == StepperKind::kRk4 || kind == StepperKind::kDopri5Fixed ||
         kind == StepperKind::kRosenbrock4Fixed || kind == StepperKind::kRadau5Fixed;
}

const std::vector<std::string>& nodeKeys() {
  static const std::vector<std::string> keys{"tick_rate",     "publish_rate", "real_time_factor",
                                             "publish_clock", "start_paused", "realtime_priority",
                                             "lock_memory"};
  return keys;
}

const std::vector<std::string>& nodeTopics() {
  static const std::vector<std::string> topics{
      "state", "energy", "scene", "status", "parameter_descriptions", "parameter_updates"};
  return topics;
}

Scene readScene(const ParameterTree& tree, ComponentFactory& factory) {
  ParameterReader root(tree, "");
  for (const std::string& key : joined(sceneKeys(), nodeKeys())) root.allow(key);
  const Lists lists = readLists(tree, root);
  const std::vector<std::string> names =
      joined(joined(lists.shafts, lists.torques), lists.constraints);
  // A name whose dictionary is missing is told first: the misspelt dictionary is then no riddle.
  for (const std::string& name : names) root.allow(name);
  for (const std::string& name : names) {
    if (!root.has(name)) root.section(name);
  }
  checkRootKeys(tree, joined(joined(sceneKeys(), names), nodeKeys()));

  Scene scene;
  scene.shafts = lists.shafts;
  scene.inertia = Eigen::MatrixXd::Zero(scene.shaftCount(), scene.shaftCount());
  Eigen::VectorXd least(scene.shaftCount());
  bool constant = true;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    ShaftInertia inertia = readInertia(root, scene.shafts[static_cast<std::size_t>(i)]);
    scene.inertia(i, i) = inertia.mean;
    least(i) = calcLeastInertia(inertia);
    constant = constant && inertia.harmonics.empty();
    scene.inertia_harmonics.push_back(std::move(inertia.harmonics));
  }
  if (constant) scene.inertia_harmonics.clear();
  readInertiaCoupling(root, scene.shafts, least, &scene.inertia);
  scene.principle = readPrinciple(root);
  scene.initial = readInitial(root, scene.shafts.size());
  scene.solver = readSolver(root);

  for (const std::string& name : lists.torques) {
    scene.torques.push_back(readComponent(
        name, root, kTorqueKind, kConstraintKind, factory,
        [&](const std::string& type) { return factory.createTorque(type); }, &scene));
  }
  for (const std::string& name : lists.constraints) {
    scene.constraints.push_back(readComponent(
        name, root, kConstraintKind, kTorqueKind, factory,
        [&](const std::string& type) { return factory.createConstraint(type); }, &scene));
  }
  checkInputsOfOrder1(scene);
  const bool verify_derivatives = root.boolean("verify_derivatives", true);
  if (verify_derivatives) verifyDerivatives(scene);
  scene.resolved = resolve(tree, lists, scene, verify_derivatives);
  return scene;
}

}  // namespace variator_sim
