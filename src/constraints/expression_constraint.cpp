#include "variator_sim/constraints/expression_constraint.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;
using expression::Tape;

namespace {

/// What a constraint of some order is differentiated by to give C, as messages name it.
struct Highest {
  Source source;
  const char* name;
};

expression::FormulaKind kindOf(int order) {
  switch (order) {
    case 1:
      return expression::FormulaKind::kOrder1;
    case 2:
      return expression::FormulaKind::kOrder2;
    default:
      return expression::FormulaKind::kOrder3;
  }
}

Highest highestOf(int order) {
  switch (order) {
    case 1:
      return {Source::kVelocity, "a velocity (w1.. of the shafts)"};
    case 2:
      return {Source::kAcceleration, "an acceleration (e1.. of the shafts)"};
    default:
      return {Source::kJerk, "a jerk (j1.. of the shafts)"};
  }
}

bool isPiecewise(Operation operation) {
  return operation == Operation::kAbs || operation == Operation::kMin ||
         operation == Operation::kMax || operation == Operation::kSign ||
         operation == Operation::kSelect;
}

/// For every node of the graph, which of the s variables of `source` it reads, bit i for shaft i.
std::vector<unsigned> findReads(const Graph& graph, Source source, int s) {
  std::vector<unsigned> reads(static_cast<std::size_t>(graph.size()), 0U);
  for (int n = 0; n < graph.size(); ++n) {
    const Graph::Entry& entry = graph.entry({n});
    unsigned& mask = reads[static_cast<std::size_t>(n)];
    if (entry.operation == Operation::kVariable && expression::sourceOf(entry.slot) == source &&
        expression::indexOf(entry.slot) < s) {
      mask = 1U << static_cast<unsigned>(expression::indexOf(entry.slot));
    }
    // Operands precede their users.
    for (int p = 0; p < operandCount(entry.operation); ++p) {
      mask |= reads[static_cast<std::size_t>(entry.operands[p])];
    }
  }
  return reads;
}

/// What of `reads` abs, min, max, sign and comparisons in `node` read: there it is linear in pieces
/// at best, for all that its second derivatives are zero.
unsigned findPiecewise(const Graph& graph, const std::vector<unsigned>& reads, Node node) {
  unsigned mask = 0;
  const std::vector<bool> reachable = graph.findReachable({node});
  for (std::size_t n = 0; n < reachable.size(); ++n) {
    if (!reachable[n] || !isPiecewise(graph.entry({static_cast<int>(n)}).operation)) continue;
    const Graph::Entry& entry = graph.entry({static_cast<int>(n)});
    // On its branches a select is what they are.
    const int compared = entry.operation == Operation::kSelect ? 2 : operandCount(entry.operation);
    for (int p = 0; p < compared; ++p) mask |= reads[static_cast<std::size_t>(entry.operands[p])];
  }
  return mask;
}

/// More kinks than these in the accelerations are not told apart.
constexpr std::size_t kMostKinks = 16;

/// The functions at whose zeros `given` has a kink in the accelerations but does not jump.
std::vector<Node> findKinks(Graph& graph, const std::vector<unsigned>& reads, Node given, int s) {
  std::vector<Node> kinks;
  const std::vector<bool> reachable = graph.findReachable({given});
  for (std::size_t n = 0; n < reachable.size() && kinks.size() < kMostKinks; ++n) {
    if (!reachable[n] || reads[n] == 0U) continue;
    const Graph::Entry entry = graph.entry({static_cast<int>(n)});
    Node found;
    if (entry.operation == Operation::kAbs) {
      found = {entry.operands[0]};
    } else if (entry.operation == Operation::kMin || entry.operation == Operation::kMax) {
      found = graph.subtract({entry.operands[0]}, {entry.operands[1]});
    } else {
      continue;
    }
    if (std::find(kinks.begin(), kinks.end(), found) != kinks.end()) continue;
    // (A kink of what is constant in pieces, as abs(sign(e1)), is none.)
    bool moves = false;
    for (int i = 0; i < s; ++i) {
      const Node slope = graph.differentiate(found, slotOf(Source::kAcceleration, i));
      moves = moves || !graph.isConstant(slope, 0.0);
    }
    if (moves) kinks.push_back(found);
  }
  return kinks;
}

}  // namespace

void ExpressionConstraint::doConfigure(ComponentContext& context) {
  ParameterReader& reader = context.parameters();
  order_ = reader.integer("order", 1, 3);
  Graph graph;
  const Node given = readFormula(context, "expression", kindOf(order_), graph);
  Node without_jerks;
  if (order_ == 3) {
    without_jerks =
        readFormula(context, "expression", expression::FormulaKind::kOrder3WithoutJerks, graph);
  }
  const std::string path = reader.keyPath("expression");
  const std::string text = reader.formula("expression");
  inputs_ = context.usedInputs();
  build(graph, given, without_jerks, path, text);
  if (order_ != 2) return;
  const std::vector<unsigned> reads = findReads(graph, Source::kAcceleration, shaftCount());
  for (const Node kink : findKinks(graph, reads, given, shaftCount())) {
    kinks_.push_back(ConstraintPtr(new ExpressionConstraint(*this, graph, kink)));
  }
}

ExpressionConstraint::ExpressionConstraint(const ExpressionConstraint& of, Graph& graph,
                                           Node function)
    : Constraint(of.name(), of.shaftCount()), inputs_(of.inputs_) {
  build(graph, function, {}, of.name(), of.name());
}

void ExpressionConstraint::build(Graph& graph, Node given, Node without_jerks,
                                 const std::string& path, const std::string& text) {
  const int s = shaftCount();
  const auto size = static_cast<std::size_t>(s);
  const auto is_zero = [&graph](Node node) { return graph.isConstant(node, 0.0); };

  // C: the derivatives by the highest rates that occur.
  const Highest highest = highestOf(order_);
  std::vector<Node> C;
  C.reserve(size);
  for (int i = 0; i < s; ++i) C.push_back(graph.differentiate(given, slotOf(highest.source, i)));
  if (std::all_of(C.begin(), C.end(), is_zero)) {
    throw SceneError(path, "the constraint is not of order " + std::to_string(order_) + ": '" +
                               text + "' does not depend on " + highest.name);
  }

  const std::vector<Graph::Rate> rates = expression::ratesOf(graph, s, inputs_);
  std::vector<int> slots = {slotOf(Source::kTime)};
  for (int i = 0; i < s; ++i) {
    slots.insert(slots.end(), {slotOf(Source::kAngle, i), slotOf(Source::kVelocity, i),
                               slotOf(Source::kAcceleration, i)});
  }
  for (const int i : inputs_) slots.push_back(slotOf(Source::kInput, i));

  // The second-order form: f' = C epsilon + ... for order 1, psi itself for order 2.
  const Node second = order_ == 1 ? graph.totalDerivative(given, rates) : given;
  // c0 of the third-order form [12].
  Node c0;
  if (order_ < 3) {
    c0 = graph.totalDerivative(second, rates);
  } else {
    // Linear in the jerks, which the parser sees to: c0 is the formula's value with all of them 0.
    c0 = without_jerks;
  }

  std::vector<Node> partials;
  if (order_ < 3) {
    for (const int slot : slots) {
      const Node partial = graph.differentiate(given, slot);
      if (!is_zero(partial)) {
        partials.push_back(partial);
        partial_slots_.push_back(slot);
      }
    }
  }
  // dC/dt = D + H eta
  std::vector<Node> jacobian_rate;
  std::vector<Node> hessian;
  for (const Node entry : C) {
    jacobian_rate.push_back(graph.totalDerivative(entry, rates));
    for (int j = 0; j < s; ++j) {
      hessian.push_back(graph.differentiate(entry, slotOf(Source::kAcceleration, j)));
    }
  }
  jacobian_rate.insert(jacobian_rate.end(), hessian.begin(), hessian.end());
  if (order_ > 1) {
    const std::vector<unsigned> reads = findReads(graph, Source::kAcceleration, s);
    nonlinear_ = findPiecewise(graph, reads, given);
    for (int i = 0; i < s; ++i) {
      bool is_constant = findPiecewise(graph, reads, C[static_cast<std::size_t>(i)]) == 0U;
      const auto row = hessian.begin() + static_cast<std::ptrdiff_t>(i) * s;
      is_constant = is_constant && std::all_of(row, row + s, is_zero);
      if (!is_constant) nonlinear_ |= 1U << static_cast<unsigned>(i);
    }
  }

  std::vector<Node> checked = partials;
  checked.push_back(c0);
  checked.insert(checked.end(), jacobian_rate.begin(), jacobian_rate.end());
  for (const Node node : checked) {
    if (graph.hasNonFiniteConstant(node)) {
      throw SceneError(path,
                       "a derivative of '" + text + "' has a constant part that is not finite");
    }
  }

  const auto with_C = [&C](Node first) {
    std::vector<Node> nodes = {first};
    nodes.insert(nodes.end(), C.begin(), C.end());
    return nodes;
  };
  std::vector<Node> row = C;
  row.push_back(c0);
  try {
    row_ = Tape(graph, row);
    hessian_ = Tape(graph, hessian);
    jacobian_rate_ = Tape(graph, jacobian_rate);
    if (order_ < 3) {
      residual_ = Tape(graph, {given});
      residual_and_jacobian_ = Tape(graph, with_C(second));
      partials_ = Tape(graph, partials);
    }
    if (order_ == 1) velocity_level_ = Tape(graph, with_C(given));
    guards_ = expression::findGuards(graph, {given});
    instants_ = expression::findInstants(graph, {given});
  } catch (const std::length_error& error) {
    throw SceneError(path, error.what());
  }

  // No derivative reads what the formula itself does not.
  dependence_ = expression::dependenceOf(graph, given, s);
  has_constant_jacobian_ =
      std::all_of(C.begin(), C.end(), [&graph](Node entry) { return graph.isConstant(entry); });
  row_derivatives_ = expression::StateDerivatives::of(graph, row, s);
}

double ExpressionConstraint::doCalcResidual(const StateView& state) const {
  double psi = 0.0;
  residual_.evaluate(state, &psi);
  return psi;
}

double ExpressionConstraint::doCalcVelocityResidualAndJacobian(const StateView& state,
                                                               double* C) const {
  double values[1 + kMaxShafts];
  velocity_level_.evaluate(state, values);
  std::copy(values + 1, values + 1 + shaftCount(), C);
  return values[0];
}

double ExpressionConstraint::doCalcResidualAndJacobian(const StateView& state, double* C) const {
  double values[1 + kMaxShafts];
  residual_and_jacobian_.evaluate(state, values);
  std::copy(values + 1, values + 1 + shaftCount(), C);
  return values[0];
}

void ExpressionConstraint::doCalcRow(const StateView& state, double* C, double* c0) const {
  double values[kMaxShafts + 1];
  row_.evaluate(state, values);
  std::copy(values, values + shaftCount(), C);
  *c0 = values[shaftCount()];
}

void ExpressionConstraint::doCalcPartials(const StateView& state,
                                          ConstraintPartials& partials) const {
  double values[1 + 3 * kMaxShafts + kMaxInputs];
  partials_.evaluate(state, values);
  for (std::size_t i = 0; i < partial_slots_.size(); ++i) {
    const int index = expression::indexOf(partial_slots_[i]);
    switch (expression::sourceOf(partial_slots_[i])) {
      case Source::kTime:
        partials.time = values[i];
        break;
      case Source::kAngle:
        partials.angle[index] = values[i];
        break;
      case Source::kVelocity:
        partials.velocity[index] = values[i];
        break;
      case Source::kInput:
        partials.input[index] = values[i];
        break;
      default:
        partials.acceleration[index] = values[i];
        break;
    }
  }
}

void ExpressionConstraint::doCalcHessian(const StateView& state, double* H) const {
  hessian_.evaluate(state, H);
}

void ExpressionConstraint::doCalcRowDerivatives(const StateView& state, double* dC,
                                                double* dc0) const {
  if (!row_derivatives_) {
    Constraint::doCalcRowDerivatives(state, dC, dc0);
    return;
  }
  const int s = shaftCount();
  std::fill_n(dC, 3 * s * s, 0.0);
  std::fill_n(dc0, 3 * s, 0.0);
  row_derivatives_->evaluate(
      state, [&](int of, int by, double value) { (of < s ? dC[by * s + of] : dc0[by]) = value; });
}

void ExpressionConstraint::doCalcJacobianRate(const StateView& state, double* D, double* H) const {
  double values[kMaxShafts * (1 + kMaxShafts)];
  jacobian_rate_.evaluate(state, values);
  std::copy(values, values + shaftCount(), D);
  std::copy(values + shaftCount(), values + shaftCount() * (1 + shaftCount()), H);
}

}  // namespace variator_sim
