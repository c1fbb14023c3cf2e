#include "motion_program/scene_formulas.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "variator_sim/errors.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;

namespace {

void noteOpaque(const std::string& name, bool is_opaque, SceneFormulas& made) {
  if (made.no_text || !is_opaque) return;
  made.no_text =
      SceneError(name,
                 "it calls a function of its plugin, which cannot be seen into; allowed: formulas "
                 "without an OpaqueFunction");
}

void addGeneralInertia(const Scene& scene, SceneFormulas& made) {
  const GeneralInertia J(*scene.graph, scene);
  made.inertia_varies = true;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    made.inertia.push_back(J.entry(i, i));
    made.inertial_torque.push_back(J.inertialTorque(i));
    made.connection.push_back(scene.graph->constant(0.0));
    for (int j = 0; j < scene.shaftCount(); ++j) {
      made.pair.push_back(J.entry(i, j));
      made.turn.push_back(J.connection(i, j));
    }
  }
}

void addInertia(const Scene& scene, SceneFormulas& made) {
  if (!scene.inertia_formulas.empty()) return addGeneralInertia(scene, made);
  Graph& graph = *scene.graph;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    // The mean comes last: scenes that differ in it alone sum the rest in the same order.
    const Node harmonics = addHarmonics(graph, scene, i, graph.constant(0.0));
    const Node inertia = graph.add(graph.constant(scene.inertia(i, i)), harmonics);
    const bool varies = !graph.isConstant(inertia);
    const Node omega = graph.variable(slotOf(Source::kVelocity, i));
    const Node connection = varies ? connectionOf(graph, inertia, i) : graph.constant(0.0);
    made.inertia_varies = made.inertia_varies || varies;
    made.inertia.push_back(inertia);
    made.connection.push_back(connection);
    made.inertial_torque.push_back(varies ? graph.multiply(connection, omega) : connection);
  }
}

/// Adds the row C of a constraint `function` = 0; its reaction is along D, or C where D is empty.
void addRow(const Scene& scene, int order, Node function, Node residual, const std::vector<Node>& C,
            const std::vector<Node>& D, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  const Node zero = graph.constant(0.0);
  made.residual.push_back(residual);
  made.velocity_residual.push_back(order == 1 ? function : zero);
  made.entry.insert(made.entry.end(), C.begin(), C.end());
  made.direction.insert(made.direction.end(), D.empty() ? C.begin() : D.begin(),
                        D.empty() ? C.end() : D.end());
  const bool is_curved = order == 2 || (order == 3 && isFormal(scene));
  for (const Node entry : C) {
    for (int j = 0; j < scene.shaftCount(); ++j) {
      made.curvature.push_back(
          is_curved ? graph.differentiate(entry, slotOf(Source::kAcceleration, j)) : zero);
    }
  }
  for (int n = 0; n < scene.inputCount(); ++n) {
    made.input_slope.push_back(order == 2 ? graph.differentiate(function, slotOf(Source::kInput, n))
                                          : zero);
  }
}

void addConstraint(const Scene& scene, const ConstraintPtr& constraint, SceneFormulas& made) {
  noteOpaque(constraint->name(), constraint->callsOpaqueFunction(), made);
  if (!constraint->kinks().empty() && scene.principle == Principle::kGauss) {
    throw SceneError(constraint->name(),
                     "abs, min or max of accelerations bends it, and where the least reaction "
                     "leads in a corner is not known; allowed under 'principle: gauss': a formula "
                     "that is smooth in the accelerations, sqrt(x^2+1e-12) for abs(x)");
  }
  const auto row = constraint->row().begin();
  addRow(scene, constraint->order(), constraint->function(), constraint->residual(),
         {row, row + scene.shaftCount()}, constraint->direction(), made);
  made.has_directions = made.has_directions || !constraint->direction().empty();
}

/// Adds the row of a slip f as that of a constraint of order 1.
void addSlip(const Scene& scene, const SceneHold& hold, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  const std::vector<Graph::Rate> rates = expression::ratesOf(graph, scene.shaftCount(), {});
  const bool is_general = scene.principle == Principle::kGeneralizedGauss;
  for (int n = 0; n < scene.inputCount(); ++n) {
    if (!graph.dependsOn(hold.slip, slotOf(Source::kInput, n))) continue;
    throw SceneError(made.hold_names[made.holds.size()],
                     "its ratio reads an input; allowed: a number, or under 'principle: gauss' a "
                     "formula of t");
  }
  std::vector<Node> C;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    C.push_back(graph.differentiate(hold.slip, slotOf(Source::kVelocity, i)));
    if (is_general && !graph.isConstant(C.back())) {
      throw SceneError(made.hold_names[made.holds.size()],
                       "its ratio changes, and how its reaction turns has no meaning under "
                       "'principle: generalized_gauss'; allowed: a ratio that is a number, or "
                       "'principle: gauss'");
    }
  }
  addRow(scene, 1, hold.slip, graph.totalDerivative(hold.slip, rates), C, {}, made);
}

/// Adds the losses of constraint m, whose multiplier the program has in the slot of jerk `slot`.
/// While they slide to a side s they are an applied torque and a part of D:
///     T = s base_k + slope_k lambda,  with k by the side, which is s or 3 s: mode
void addLosses(const Scene& scene, int slot, SceneHold& hold, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  const Expression side = hold.law.side;
  const Expression square = side * side;
  const Expression first = square * (9.0 - square) / 8.0;    // 1 of s
  const Expression second = square * (square - 1.0) / 72.0;  // 1 of 3 s
  const Expression s = side * (13.0 - square) / 12.0;
  const Losses& it = *hold.law.losses;
  const Expression base = s * (first * it.base[0] + second * it.base[1]);
  const Expression slope = first * it.slope[0] + second * it.slope[1];
  const Expression lambda(graph, graph.variable(slotOf(Source::kJerk, slot)));
  const Expression torque = base + slope * lambda;
  made.has_directions = true;
  hold.torque = torque.in(graph);
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const Expression C(graph, graph.differentiate(hold.slip, slotOf(Source::kVelocity, i)));
    Node& Q = made.torque[static_cast<std::size_t>(i)];
    Node& D = made.direction[static_cast<std::size_t>(hold.load) * scene.shafts.size() +
                             static_cast<std::size_t>(i)];
    Q = (Expression(graph, Q) - C * base).in(graph);
    D = (Expression(graph, D) - C * slope).in(graph);
  }
}

void addHolds(const Scene& scene, SceneFormulas& made) {
  made.hold_names = scene.holdNames();
  const int rows = scene.constraintCount() + static_cast<int>(made.hold_names.size());
  const bool is_classical = scene.principle == Principle::kGauss && !isFormal(scene);
  for (SceneHold& hold : collectHolds(scene)) {
    if (hold.load < 0) {
      noteOpaque(hold.element->name(), scene.graph->hasOpaque(nodesOf(hold)), made);
    } else {
      const int slot = is_classical ? hold.load : rows + scene.shaftCount() + hold.load;
      addLosses(scene, slot, hold, made);
    }
    addSlip(scene, hold, made);
    made.holds.push_back(std::move(hold));
  }
  if (!made.holds.empty() && !scene.initial.acceleration.empty()) {
    throw SceneError("initial/acceleration",
                     "belongs to no scene with " + inQuotes(made.hold_names.front()) +
                         ", which holds: its modes give the accelerations; allowed: a scene "
                         "without one of the two");
  }
  for (const ConstraintPtr& it : scene.constraints) {
    if (made.holds.empty() || it->nonlinearAccelerations().none()) continue;
    throw SceneError(it->name(),
                     "is not linear in the accelerations, and which modes follow an event is "
                     "known beside linear constraints only; allowed: a scene without " +
                         inQuotes(made.hold_names.front()));
  }
}

}  // namespace

std::vector<Node> nodesOf(const SceneHold& it) {
  std::vector<Node> nodes = {it.slip, it.torque, it.upper, it.lower, it.level, it.gap};
  if (it.load >= 0) nodes.insert(nodes.end(), {it.slope[0], it.slope[1], it.base[0], it.base[1]});
  return nodes;
}

SceneFormulas collectFormulas(const Scene& scene) {
  requireOwnFormulas(scene);
  SceneFormulas made;
  made.has_directions = isFormal(scene);
  for (const TorquePtr& element : scene.torques) {
    noteOpaque(element->name(), element->callsOpaqueFunction(), made);
  }
  made.torque = sumTorques(scene);
  for (const ConstraintPtr& constraint : scene.constraints) addConstraint(scene, constraint, made);
  addHolds(scene, made);
  addInertia(scene, made);
  std::vector<Node> laws = made.torque;
  for (const ConstraintPtr& constraint : scene.constraints) laws.push_back(constraint->function());
  for (const SceneHold& it : made.holds) {
    const std::vector<Node> nodes = nodesOf(it);
    laws.insert(laws.end(), nodes.begin(), nodes.end());
  }
  laws.insert(laws.end(), made.pair.begin(), made.pair.end());
  for (const SceneState& state : scene.states) made.rate.push_back(state.rate);
  laws.insert(laws.end(), made.rate.begin(), made.rate.end());
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind == InputKind::kDelayed) made.delayed.push_back(input.delayed);
  }
  laws.insert(laws.end(), made.delayed.begin(), made.delayed.end());
  for (const SceneEvent& event : scene.events) laws.push_back(event.when);
  made.signs = findBranches(*scene.graph, laws);
  made.tables = findPassages(*scene.graph, laws);
  for (const SceneEvent& event : scene.events) {
    made.signs.push_back({event.when, "when", false});
    for (const auto& [input, value] : event.sets) made.set.push_back(value);
  }
  return made;
}

}  // namespace variator_sim
