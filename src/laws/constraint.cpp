#include "variator_sim/constraint.h"

#include <algorithm>
#include <string>

#include "variator_sim/errors.h"
#include "variator_sim/expression/guards.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;
using expression::Tape;

namespace {

/// The variables of highest derivative in a constraint of each order, from 1.
constexpr Source kHighest[] = {Source::kVelocity, Source::kAcceleration, Source::kJerk};

/// Returns the order of `function`: that of the highest derivative it reads; 0 if it reads none.
int orderOf(const Graph& graph, Node function) {
  int order = 3;
  while (order > 0 && !expression::reads(graph, {function}, kHighest[order - 1])) --order;
  return order;
}

/// Returns the shafts whose accelerations abs, min, max, sign and comparisons in `node` read: there
/// it is at best piecewise linear, although its second derivatives are zero.
ShaftSet findPiecewise(Graph& graph, Node node) {
  std::vector<Node> arguments;
  for (const expression::Branch& it : expression::findBranches(graph, {node})) {
    arguments.push_back(it.argument);
  }
  ShaftSet mask;
  for (const int i : expression::indicesIn(graph, arguments, Source::kAcceleration)) {
    mask.set(static_cast<std::size_t>(i));
  }
  return mask;
}

/// Largest number of kinks in the accelerations that the solver distinguishes.
constexpr std::size_t kMostKinks = 16;

/// Returns functions at whose zeros `given` has a kink in the accelerations but does not jump.
std::vector<Node> findKinks(Graph& graph, Node given, int s) {
  std::vector<Node> kinks;
  for (const expression::Branch& it : expression::findBranches(graph, {given})) {
    // (A kink of a piecewise constant, as abs(sign(e1)), is none.)
    bool moves = false;
    for (int i = 0; i < s; ++i) {
      const Node slope = graph.differentiate(it.argument, slotOf(Source::kAcceleration, i));
      moves = moves || !graph.isConstant(slope, 0.0);
    }
    if (moves && !it.jumps && kinks.size() < kMostKinks) kinks.push_back(it.argument);
  }
  return kinks;
}

}  // namespace

/// A function of the accelerations at whose zeros a constraint has a kink, or its form of order 3.
class Constraint::Derived final : public Constraint {
 public:
  Derived(const Constraint& of, Node function, int order) : Constraint(of, function, order) {}

 private:
  void build(LawContext& /*scene*/) override {}
};

void Constraint::derive(const LawContext& law) {
  Graph& graph = Law::graph();
  const Node given = law.psi().in(graph);
  const int s = shaftCount();
  const int order = orderOf(graph, given);
  if (order == 0) {
    throw SceneError(law.place(), "the constraint depends on no velocity, acceleration or jerk");
  }
  compile(given, order, law.place());
  if (!law.directions().empty())
    direction_.assign(static_cast<std::size_t>(s), graph.constant(0.0));
  for (const auto& [shaft, D] : law.directions()) {
    direction_[static_cast<std::size_t>(shaft)] = D.in(graph);
  }
  if (order != 2) return;
  for (const Node kink : findKinks(graph, given, s)) {
    kinks_.push_back(std::make_shared<Derived>(*this, kink, 2));
  }
}

ConstraintPtr Constraint::inOrder3() const {
  Graph& graph = Law::graph();
  Node sum = row_nodes_.back();
  for (int i = 0; i < shaftCount(); ++i) {
    const Node jerk = graph.variable(slotOf(Source::kJerk, i));
    sum = graph.add(sum, graph.multiply(row_nodes_[static_cast<std::size_t>(i)], jerk));
  }
  return std::make_shared<Derived>(*this, sum, 3);
}

void Constraint::compile(Node given, int order, const std::string& path) {
  Graph& graph = Law::graph();
  const int s = shaftCount();
  setFormulas({given});
  order_ = order;
  std::vector<Node> C;
  C.reserve(static_cast<std::size_t>(s));
  for (int i = 0; i < s; ++i) {
    C.push_back(graph.differentiate(given, slotOf(kHighest[order - 1], i)));
  }
  row_nodes_ = C;
  const std::vector<Graph::Rate> rates =
      expression::ratesOf(graph, s, expression::inputsIn(graph, {given}));
  // The jerks of order 3 occur linearly: c0 is the function without them.
  residual_node_ = order == 1   ? graph.totalDerivative(given, rates)
                   : order == 2 ? given
                                : withoutJerks(path);
  row_nodes_.push_back(order == 3 ? residual_node_ : graph.totalDerivative(residual_node_, rates));
  std::vector<Node> hessian;
  for (const Node entry : C) {
    for (int j = 0; j < s; ++j) {
      hessian.push_back(graph.differentiate(entry, slotOf(Source::kAcceleration, j)));
    }
  }
  if (order > 1) noteNonlinear(hessian);
  if (order == 1 && graph.hasDifference({row_nodes_.back()})) {
    throw SceneError(path,
                     "a constraint of order 1 is differentiated twice, and the opaque function in "
                     "it has first derivatives only; allowed: a function made of Expressions, or a "
                     "constraint of order 2");
  }
  if (graph.hasNonFiniteConstant(row_nodes_) || graph.hasNonFiniteConstant(hessian)) {
    throw SceneError(path, "a derivative of it has a constant part that is not finite");
  }
  row_ = Tape(graph, row_nodes_);
  hessian_ = Tape(graph, hessian);
  if (order == 3) return;
  residual_ = Tape(graph, {given});
  C.insert(C.begin(), residual_node_);
  residual_and_jacobian_ = Tape(graph, C);
}

Node Constraint::withoutJerks(const std::string& path) {
  Graph& graph = Law::graph();
  std::vector<Graph::Rate> no_jerks;
  // In pieces a function may bend with the jerks though no derivative shows it.
  std::vector<Node> bends = row_nodes_;
  for (const expression::Branch& it : expression::findBranches(graph, {function()})) {
    bends.push_back(it.argument);
  }
  std::vector<std::string> names;
  for (int i = 0; i < shaftCount(); ++i) {
    no_jerks.emplace_back(slotOf(Source::kJerk, i), graph.constant(0.0));
    if (graph.dependsOn(bends, no_jerks.back().first)) names.push_back("j" + std::to_string(i + 1));
  }
  if (names.empty()) return graph.substitute(function(), no_jerks);
  throw SceneError(path, "the formula is not linear in " + joinNames(names) +
                             " (a constraint of order 3 is C(t, phi, w, e) j + c0 = 0)");
}

void Constraint::noteNonlinear(const std::vector<Node>& hessian) {
  Graph& graph = Law::graph();
  const int s = shaftCount();
  nonlinear_ = findPiecewise(graph, function());
  for (int i = 0; i < s; ++i) {
    const auto row = hessian.begin() + static_cast<std::ptrdiff_t>(i) * s;
    const bool is_constant =
        findPiecewise(graph, row_nodes_[static_cast<std::size_t>(i)]).none() &&
        std::all_of(row, row + s, [&](Node node) { return graph.isConstant(node, 0.0); });
    if (!is_constant) nonlinear_.set(static_cast<std::size_t>(i));
  }
}

bool Constraint::hasConstantJacobian() const {
  return std::all_of(row_nodes_.begin(), row_nodes_.end() - 1,
                     [this](Node entry) { return graph().isConstant(entry); });
}

double Constraint::calcResidual(const StateView& state) const {
  double psi = 0.0;  // for order 3, which has no residual at this level
  residual_.evaluate(state, &psi);
  return psi;
}

double Constraint::calcResidualAndJacobian(const StateView& state, double* C) const {
  const double* const values = residual_and_jacobian_.evaluate(state);
  std::copy_n(values + 1, shaftCount(), C);
  return values[0];
}

void Constraint::calcRow(const StateView& state, double* C, double* c0) const {
  double values[kMaxShafts + 1];
  row_.evaluate(state, values);
  std::copy(values, values + shaftCount(), C);
  *c0 = values[shaftCount()];
}

}  // namespace variator_sim
