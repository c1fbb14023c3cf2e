#include "emit_c/scene_formulas.h"

#include <map>
#include <set>
#include <utility>

#include "variator_sim/errors.h"
#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/formula_constraint.h"
#include "variator_sim/formula_torque.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;

namespace {

template <class Law, class Element>
const Law& formulaOf(const Scene& scene, const Element& element) {
  const auto* law = dynamic_cast<const Law*>(element.get());
  if (law == nullptr || &law->graph() != scene.graph.get()) {
    throw SceneError(element->name(),
                     "cannot be written as C: it computes its values by code of its own; allowed: "
                     "elements that are formulas (all of this package, and plugins made on "
                     "FormulaTorque or FormulaConstraint)");
  }
  return *law;
}

void refuseOpaque(const Scene& scene, const std::string& name, const std::vector<Node>& nodes) {
  if (!scene.graph->hasOpaque(nodes)) return;
  throw SceneError(name,
                   "cannot be written as C: it calls a function of its plugin, which cannot be "
                   "seen into; allowed: formulas without an OpaqueFunction");
}

void refuse(const std::string& name, const std::string& reason) {
  throw SceneError(name, "cannot be written as C: " + reason);
}

/// J_i(phi_i) = mean + sum cosine cos(order phi) + sine sin(order phi)
Node inertiaOf(Graph& graph, const Scene& scene, int i) {
  Node sum = graph.constant(scene.inertia(i, i));
  if (scene.inertia_harmonics.empty()) return sum;
  const Node angle = graph.variable(slotOf(Source::kAngle, i));
  for (const InertiaHarmonic& it : scene.inertia_harmonics[static_cast<std::size_t>(i)]) {
    const Node phase = graph.multiply(graph.constant(it.order), angle);
    sum = graph.add(sum,
                    graph.multiply(graph.constant(it.cosine), graph.make(Operation::kCos, phase)));
    sum =
        graph.add(sum, graph.multiply(graph.constant(it.sine), graph.make(Operation::kSin, phase)));
  }
  return sum;
}

void addInertia(const Scene& scene, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const Node inertia = inertiaOf(graph, scene, i);
    const Node omega = graph.variable(slotOf(Source::kVelocity, i));
    const Node slope = graph.differentiate(inertia, slotOf(Source::kAngle, i));
    const Node connection = graph.multiply(graph.constant(0.5), graph.multiply(slope, omega));
    made.inertia_varies = made.inertia_varies || !graph.isConstant(inertia);
    made.inertia.push_back(inertia);
    made.connection.push_back(graph.isConstant(slope, 0.0) ? slope : connection);
    made.inertial_torque.push_back(
        graph.isConstant(slope, 0.0) ? slope : graph.multiply(connection, omega));
  }
}

void addTorques(const Scene& scene, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  made.torque.assign(static_cast<std::size_t>(scene.shaftCount()), graph.constant(0.0));
  for (const TorquePtr& element : scene.torques) {
    for (const auto& [shaft, torque] : formulaOf<FormulaTorque>(scene, element).torques()) {
      refuseOpaque(scene, element->name(), {torque});
      Node& sum = made.torque[static_cast<std::size_t>(shaft)];
      sum = graph.isConstant(sum, 0.0) ? torque : graph.add(sum, torque);
    }
  }
}

bool readsAny(const Graph& graph, Node node, Source source, int count) {
  for (int i = 0; i < count; ++i) {
    if (graph.dependsOn(node, slotOf(source, i))) return true;
  }
  return false;
}

void addConstraint(const Scene& scene, const ConstraintPtr& constraint, SceneFormulas& made) {
  Graph& graph = *scene.graph;
  const int s = scene.shaftCount();
  const Node zero = graph.constant(0.0);
  const auto& law = formulaOf<FormulaConstraint>(scene, constraint);
  const std::string& name = constraint->name();
  refuseOpaque(scene, name, {law.function()});
  if (constraint->order() == 3 && scene.principle == Principle::kGauss) {
    refuse(name,
           "it is of order 3, which under 'principle: gauss' has no series; allowed: orders "
           "1 and 2, or 'principle: generalized_gauss'");
  }
  if (!constraint->kinks().empty()) {
    refuse(name,
           "abs, min or max of accelerations bends it, and where its corners lead is not "
           "known to the emitted program; allowed: a formula that is smooth in the "
           "accelerations, sqrt(x^2+1e-6) for abs(x)");
  }
  Node residual = law.function();
  if (constraint->order() == 1) {
    std::set<int> inputs;
    for (int i = 0; i < scene.inputCount(); ++i) inputs.insert(i);
    residual = graph.totalDerivative(residual, expression::ratesOf(graph, s, inputs));
  } else if (constraint->order() == 3) {
    residual = law.row().back();
  }
  made.residual.push_back(residual);
  made.velocity_residual.push_back(constraint->order() == 1 ? law.function() : zero);
  made.entry.insert(made.entry.end(), law.row().begin(), law.row().end() - 1);
  for (int i = 0; i < s; ++i) {
    for (int j = 0; j < s; ++j) {
      const bool is_curved = constraint->order() == 2;
      made.curvature.push_back(is_curved
                                   ? graph.differentiate(law.row()[static_cast<std::size_t>(i)],
                                                         slotOf(Source::kAcceleration, j))
                                   : zero);
    }
  }
  for (int n = 0; n < scene.inputCount(); ++n) {
    made.input_slope.push_back(constraint->order() == 2
                                   ? graph.differentiate(law.function(), slotOf(Source::kInput, n))
                                   : zero);
  }
}

/// The edges of `nodes` (see expression/guards.cpp).
void addEdges(Graph& graph, const std::vector<Node>& nodes, SceneFormulas& made) {
  std::map<int, bool> signs;
  std::set<std::pair<int, std::vector<double>>> passages;
  const std::vector<bool> reachable = graph.findReachable(nodes);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (!reachable[i]) continue;
    const Graph::Entry it = graph.entry({static_cast<int>(i)});
    const Node a{it.operands[0]};
    const Node b{it.operands[1]};
    if (it.operation == Operation::kTable) passages.emplace(a.index, graph.tableOf(it)->points());
    if (it.operation == Operation::kTable2) {
      passages.emplace(a.index, graph.table2Of(it)->pointsX());
      passages.emplace(b.index, graph.table2Of(it)->pointsY());
    }
    const bool is_of_one = it.operation == Operation::kAbs || it.operation == Operation::kSign;
    const bool is_of_two = it.operation == Operation::kMin || it.operation == Operation::kMax ||
                           it.operation == Operation::kSelect;
    if (!is_of_one && !is_of_two) continue;
    bool& jumps = signs[is_of_one ? a.index : graph.subtract(a, b).index];
    jumps = jumps || it.operation == Operation::kSign || it.operation == Operation::kSelect;
  }
  for (const auto& [index, jumps] : signs) {
    if (!graph.isConstant(Node{index})) made.signs.push_back({Node{index}, jumps});
  }
  for (const auto& [index, points] : passages) {
    if (!graph.isConstant(Node{index})) made.tables.push_back({Node{index}, points});
  }
}

/// f' jumps where f bends; where C does so too, the motion across is more than a projection.
void refuseBentVelocities(const Scene& scene) {
  Graph& graph = *scene.graph;
  for (const ConstraintPtr& constraint : scene.constraints) {
    if (constraint->order() != 1) continue;
    SceneFormulas own;
    addEdges(graph, {formulaOf<FormulaConstraint>(scene, constraint).function()}, own);
    for (const SignEdge& sign : own.signs) {
      if (!readsAny(graph, sign.distance, Source::kVelocity, scene.shaftCount())) continue;
      refuse(constraint->name(),
             "it is of order 1 and abs, min, max or if bends it in the velocities; allowed: a "
             "formula that is smooth in the velocities, sqrt(x^2+1e-6) for abs(x)");
    }
  }
}

}  // namespace

SceneFormulas collectFormulas(const Scene& scene) {
  SceneFormulas made;
  addTorques(scene, made);
  for (const ConstraintPtr& constraint : scene.constraints) addConstraint(scene, constraint, made);
  refuseBentVelocities(scene);
  addInertia(scene, made);
  std::vector<Node> laws = made.torque;
  for (const ConstraintPtr& constraint : scene.constraints) {
    laws.push_back(formulaOf<FormulaConstraint>(scene, constraint).function());
  }
  addEdges(*scene.graph, laws, made);
  return made;
}

}  // namespace variator_sim
