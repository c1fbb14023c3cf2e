#include <algorithm>
#include <cmath>

#include "model/scene_readers.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {
namespace {

using expression::FormulaKind;
using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;

Node variableOf(const Scene& scene, int input) {
  return scene.graph->variable(slotOf(Source::kInput, input));
}

/// Declares a variable or state as an input; returns its index.
int declare(InputKind kind, const std::string& name, const std::string& path, double initial,
            Scene* scene) {
  const auto same = std::find_if(scene->inputs.begin(), scene->inputs.end(),
                                 [&](const auto& other) { return other.topic == name; });
  if (same != scene->inputs.end()) {
    throw SceneError(path, inQuotes(name) + " is the topic of " + inQuotes(same->owner) +
                               "; choose another name");
  }
  CommandInputSettings input;
  input.kind = kind;
  input.topic = input.name = input.owner = name;
  input.initial = initial;
  return scene->symbols.inputs[name] = addTo(scene->inputs, input, path);
}

void declareState(const std::string& name, const std::string& path, double initial, Scene* scene) {
  SceneState state;
  state.input = declare(InputKind::kState, name, path, initial, scene);
  state.rate = scene->graph->constant(0.0);
  scene->states.push_back(state);
}

/// Reads a formula whose switching functions the motion is searched for. Throws SceneError.
Node readSwitching(ComponentContext& context, const char* key) {
  Graph& graph = *context.graph();
  const Node node = readFormula(context, key, FormulaKind::kOutput, graph);
  constexpr std::size_t kMostEdges = 500;
  const std::size_t edges = expression::findBranches(graph, {node}).size();
  if (edges <= kMostEdges) return node;
  throw context.parameters().error(
      key, "abs, min, max, sign, clamp and if make " + std::to_string(edges) +
               " edges; allowed: " + std::to_string(kMostEdges) + " at most");
}

// --- pid -----------------------------------------------------------------------------------------

/// Reads a controller. With e = error, I the integral part and f the filtered error
///     v = kp e + I + kd f',  f' = (e - f) / Td,  u = v between the limits
///     I' = ki e + (u - v) / Tt
/// The value that formulas read is u. Beyond a limit I follows v back with the time constant Tt:
/// integration that stops there and goes on inside would be switched without end where e pushes v
/// out as kp e' pulls it in.
void readController(const std::string& name, ParameterReader& root, SceneState* states,
                    Scene* scene) {
  ParameterReader reader =
      root.section(name, {"type", "error", "kp", "ki", "kd", "limits", "derivative_time",
                          "tracking_time", "initial", "parameters"});
  const double kp = reader.number("kp", Range::any(), 0.0);
  const double ki = reader.number("ki", Range::any(), 0.0);
  const double kd = reader.number("kd", Range::any(), 0.0);
  if (kp == 0.0 && ki == 0.0 && kd == 0.0) {
    throw reader.error("kp", "kp, ki and kd are 0; allowed: at least one that is not");
  }
  // The derivative of the error itself would need accelerations, which no torque may read.
  const double Td = kd != 0.0 ? reader.number("derivative_time", Range::positive("s")) : 0.0;
  if (kd != 0.0 && !std::isfinite((std::abs(kd) + 1.0) / Td)) {
    throw reader.error(
        "derivative_time",
        formatNumber(Td) + " beside a kd of " + formatNumber(kd) +
            ": kd/derivative_time is beyond double precision; allowed: a longer time");
  }
  std::vector<double> limits;
  if (reader.has("limits")) limits = reader.numbers("limits", 2);
  if (!limits.empty() && !(limits[0] < limits[1])) {
    throw reader.error("limits", formatNumber(limits[0]) + " and " + formatNumber(limits[1]) +
                                     ": the lower limit comes first");
  }
  double Tt = 0.0;
  if (reader.has("tracking_time") || (ki != 0.0 && !limits.empty())) {
    const bool has_preset = kp / ki > 0.0;
    Tt = reader.number("tracking_time", Range::positive("s"),
                       has_preset ? std::optional<double>(kp / ki) : std::nullopt);
  }
  ComponentContext context = contextOf(name, reader, scene);
  Graph& graph = *scene->graph;
  const auto valueOf = [&](const SceneState& state) {
    return Expression(graph, variableOf(*scene, state.input));
  };
  const Expression e(graph, readFormula(context, "error", FormulaKind::kQuantity, graph));
  Expression v = kp * e + valueOf(states[0]);
  if (kd != 0.0) {
    const Expression rate = 1.0 / Td * (e - valueOf(states[1]));
    states[1].rate = rate.in(graph);
    v += kd * rate;
  }
  Expression rate = ki * e;
  const Expression u = limits.empty() ? v : clamp(v, limits[0], limits[1]);
  if (!limits.empty() && Tt > 0.0) rate += 1.0 / Tt * (u - v);
  states[0].rate = rate.in(graph);
  scene->symbols.values[name] = u.in(graph);
  reader.finish();
}

bool isController(const std::string& name, ParameterReader& root) {
  ParameterReader reader = root.section(name);
  if (!reader.has("type")) return false;
  reader.choice("type", {"pid"});
  return true;
}

void readStates(ParameterReader& root, const SceneNames& names, Scene* scene) {
  for (const std::string& name : names.states) {
    if (isController(name, root)) continue;
    ParameterReader reader = root.section(name, {"rate", "initial", "trim", "parameters"});
    ComponentContext context = contextOf(name, reader, scene);
    const int input = scene->symbols.inputs.at(name);
    SceneState& state = *std::find_if(scene->states.begin(), scene->states.end(),
                                      [&](const SceneState& it) { return it.input == input; });
    state.rate = readSwitching(context, "rate");
    for (const SceneState& other : scene->states) {
      if (!scene->graph->dependsOn(state.rate, slotOf(Source::kInputRate, other.input))) continue;
      throw reader.error("rate",
                         "reads a jerk, a rate of reaction or a multiplier, which depends on the "
                         "rate of the state " +
                             inQuotes(scene->inputs[static_cast<std::size_t>(other.input)].name) +
                             "; allowed in when, set and outputs");
    }
    reader.finish();
  }
}

/// Returns the formulas that the motion of shafts follows from.
std::vector<Node> listLaws(const Scene& scene) {
  std::vector<Node> formulas;
  for (const Law* law : scene.laws()) {
    formulas.insert(formulas.end(), law->formulas().begin(), law->formulas().end());
    for (const Holding& it : law->holdings()) {
      for (const std::optional<Expression>& limit : {it.upper, it.lower, it.level, it.gap}) {
        if (limit) formulas.push_back(limit->in(*scene.graph));
      }
    }
  }
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind == InputKind::kDelayed) formulas.push_back(input.delayed);
  }
  return formulas;
}

/// Notes which states the motion, an event or another rate reads, and what trim does with each.
void noteReaders(ParameterReader& root, const SceneNames& names, Scene* scene) {
  std::vector<Node> moving = listLaws(*scene);
  for (const SceneState& state : scene->states) moving.push_back(state.rate);
  std::vector<Node> read = moving;
  for (const SceneEvent& event : scene->events) read.push_back(event.when);
  for (SceneState& state : scene->states) {
    const int slot = slotOf(Source::kInput, state.input);
    state.is_read = scene->graph->dependsOn(read, slot);
    state.trims_to_rest = scene->graph->dependsOn(moving, slot);
    // (Those of a controller have no dictionary of their own.)
    const std::string& name = scene->inputs[static_cast<std::size_t>(state.input)].name;
    if (!contains(names.states, name)) continue;
    ParameterReader reader = root.section(name);
    if (reader.has("trim")) state.trims_to_rest = reader.choice("trim", {"rest", "free"}) == "rest";
  }
}

void readEvents(ParameterReader& root, const SceneNames& names, Scene* scene) {
  Graph& graph = *scene->graph;
  if (names.events.size() > static_cast<std::size_t>(kMaxEvents)) {
    throw SceneError("events", std::to_string(names.events.size()) + " events; allowed: at most " +
                                   std::to_string(kMaxEvents));
  }
  for (const std::string& name : names.events) {
    ParameterReader reader = root.section(name, {"when", "direction", "set", "parameters"});
    ComponentContext context = contextOf(name, reader, scene);
    SceneEvent event;
    event.name = name;
    event.when = readSwitching(context, "when");
    if (graph.isConstant(event.when)) {
      throw reader.error("when",
                         "is a constant, which passes 0 nowhere; allowed: a formula that changes "
                         "its sign along the motion");
    }
    using Direction = SceneEvent::Direction;
    event.direction = reader.choice<Direction>("direction",
                                               {{"rising", Direction::kRising},
                                                {"falling", Direction::kFalling},
                                                {"both", Direction::kBoth}},
                                               "both");
    ParameterReader set = reader.section("set");
    for (int i = 0; i < scene->inputCount(); ++i) {
      const CommandInputSettings& input = scene->inputs[static_cast<std::size_t>(i)];
      if (input.kind != InputKind::kVariable && input.kind != InputKind::kState) continue;
      set.allow(input.name);
      if (!set.has(input.name)) continue;
      event.sets.emplace_back(i,
                              readFormula(context, set, input.name, FormulaKind::kOutput, graph));
    }
    set.finish();
    if (event.sets.empty()) {
      throw reader.error("set",
                         "sets nothing; allowed: names of variables and states with their values");
    }
    reader.finish();
    scene->events.push_back(std::move(event));
  }
}

}  // namespace

void declareMemory(ParameterReader& root, const SceneNames& names, Scene* scene) {
  for (const std::string& name : names.torques) {
    for (const char* of : {"_torque", "_power"}) scene->symbols.of_elements->insert(name + of);
  }
  for (const auto& [list, listed] :
       {std::pair{"variables", &names.variables}, {"states", &names.states}}) {
    checkFormulaNames(names, list, *listed);
    for (std::size_t i = 0; i < listed->size(); ++i) {
      const std::string& name = (*listed)[i];
      if (scene->symbols.of_elements->count(name) == 0) continue;
      throw SceneError(elementPath(list, i), inQuotes(name) +
                                                 " is the torque or power of an element in "
                                                 "formulas; choose another");
    }
  }
  for (const std::string& name : names.torques) {
    for (const char* of : {"_slip", "_mode"}) scene->symbols.of_elements->insert(name + of);
  }
  for (const std::string& name : names.constraints)
    scene->symbols.of_elements->insert(name + "_multiplier");
  for (const std::string& name : names.shafts) {
    for (const char* of : {"R_", "Rr_"}) scene->symbols.of_elements->insert(of + name);
  }
  scene->symbols.of_elements->insert(names.outputs.begin(), names.outputs.end());
  for (const std::string& name : names.variables) {
    ParameterReader reader = root.section(name);
    declare(InputKind::kVariable, name, name, reader.number("initial", Range::any(), 0.0), scene);
    reader.finish();
  }
  std::vector<std::pair<std::string, std::size_t>> controllers;
  for (const std::string& name : names.states) {
    ParameterReader reader = root.section(name);
    const double initial = reader.number("initial", Range::any(), 0.0);
    if (!isController(name, root)) {
      declareState(name, name, initial, scene);
      continue;
    }
    controllers.emplace_back(name, scene->states.size());
    declareState(name + "_integral", name, initial, scene);
    if (reader.number("kd", Range::any(), 0.0) != 0.0)
      declareState(name + "_filtered", name, 0.0, scene);
  }
  for (const auto& [name, first] : controllers) {
    readController(name, root, &scene->states[first], scene);
  }
}

void readMemory(ParameterReader& root, const SceneNames& names, Scene* scene) {
  if (scene->torques.size() != names.torques.size()) return;
  if (scene->constraints.size() != names.constraints.size()) return;
  // A scene without observers needs no formulas for what they might read.
  if (names.states.empty() && names.events.empty() && names.outputs.empty()) return;
  nameObservers(scene, false);
  readStates(root, names, scene);
  nameObservers(scene, true);
  readEvents(root, names, scene);
  noteReaders(root, names, scene);
}

void checkDelays(const Scene& scene) {
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind != InputKind::kDelayed) continue;
    bool is_known = !expression::reads(*scene.graph, {input.delayed}, Source::kJerk);
    for (const SceneState& state : scene.states) {
      const int rate = slotOf(Source::kInputRate, state.input);
      is_known = is_known && !scene.graph->dependsOn(input.delayed, rate);
    }
    if (is_known) continue;
    throw SceneError(input.owner, inQuotes(input.name) +
                                      " delays a jerk, a rate of reaction or a multiplier; "
                                      "allowed: formulas without these");
  }
}

int Scene::firstDelay() const {
  const auto found = std::find_if(inputs.begin(), inputs.end(), [](const auto& input) {
    return input.kind == InputKind::kDelayed;
  });
  return found == inputs.end() ? -1 : static_cast<int>(found - inputs.begin());
}

void Scene::refuseDelays(const std::string& why) const {
  if (firstDelay() < 0) return;
  const CommandInputSettings& input = inputs[static_cast<std::size_t>(firstDelay())];
  throw SceneError(input.owner, "reads " + inQuotes(input.name) + ", and " + why +
                                    "; allowed: a state that follows it instead, rate: (x - z)/" +
                                    formatNumber(input.delay));
}

}  // namespace variator_sim
