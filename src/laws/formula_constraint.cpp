#include "variator_sim/formula_constraint.h"

#include <algorithm>
#include <stdexcept>
#include <string>

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

/// The order of `function`: that of the highest derivative it reads; 0 when it reads none.
int orderOf(const Graph& graph, Node function, int shaft_count) {
  for (int order = 3; order > 0; --order) {
    for (int i = 0; i < shaft_count; ++i) {
      if (graph.dependsOn(function, slotOf(kHighest[order - 1], i))) return order;
    }
  }
  return 0;
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
  for (const int n : graph.listReachable({node})) {
    const Graph::Entry& entry = graph.entry({n});
    if (!isPiecewise(entry.operation)) continue;
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

/// The first output of `tape`; the others are the row C.
double evaluateWithRow(const Tape& tape, const StateView& state, double* C) {
  const double* const values = tape.evaluate(state);
  std::copy(values + 1, values + tape.outputCount(), C);
  return values[0];
}

}  // namespace

/// A function of the accelerations at whose zeros a constraint has a kink.
class FormulaConstraint::Kink final : public FormulaConstraint {
 public:
  Kink(const FormulaConstraint& of, Node function)
      : FormulaConstraint(of.name(), of.shaftCount(), of.graph_) {
    compile(function, 2, of.inputs_, of.name());
  }

 private:
  void build(LawContext& /*scene*/) override {}
};

void FormulaConstraint::doConfigure(ComponentContext& context) {
  graph_ = context.graph();
  Graph& graph = *graph_;
  LawContext law(context);
  build(law);
  const Node given = law.psi().in(graph);
  const int s = context.shaftCount();
  const int order = orderOf(graph, given, s);
  if (order == 0) {
    throw SceneError(law.place(), "the constraint depends on no velocity, acceleration or jerk");
  }
  compile(given, order, context.usedInputs(), law.place());
  outputs_ = NamedOutputs(law);
  if (order != 2) return;
  const std::vector<unsigned> reads = findReads(graph, Source::kAcceleration, s);
  for (const Node kink : findKinks(graph, reads, given, s)) {
    kinks_.push_back(std::make_shared<Kink>(*this, kink));
  }
}

/// What a constraint's programs compute.
struct FormulaConstraint::Formulas {
  std::vector<Node> C;  ///< the derivatives by the highest rates that occur
  Node second;          ///< f' = C epsilon + ... for order 1, psi itself for order 2
  Node c0;              ///< of the third-order form [12]
  std::vector<Node> partials;
  std::vector<Node> hessian;        ///< H
  std::vector<Node> jacobian_rate;  ///< D, then H: dC/dt = D + H eta
};

void FormulaConstraint::compile(Node given, int order, const std::set<int>& inputs,
                                const std::string& path) {
  Graph& graph = *graph_;
  const int s = shaftCount();
  function_ = given;
  order_ = order;
  for (const int i : inputs) {
    if (graph.dependsOn(given, slotOf(Source::kInput, i))) inputs_.insert(i);
  }
  const Formulas formulas = derive(inputs, path);
  second_order_ = formulas.second;
  noteNonlinear(formulas);
  check(formulas, path);
  try {
    makePrograms(formulas);
  } catch (const std::length_error& error) {
    throw SceneError(path, error.what());
  }
  // No derivative reads what the formula itself does not.
  dependence_ = expression::dependenceOf(graph, {given}, s);
  has_constant_jacobian_ = std::all_of(formulas.C.begin(), formulas.C.end(),
                                       [&graph](Node entry) { return graph.isConstant(entry); });
  row_derivatives_ = expression::StateDerivatives::of(graph, row_nodes_, s);
}

FormulaConstraint::Formulas FormulaConstraint::derive(const std::set<int>& inputs,
                                                      const std::string& path) {
  Graph& graph = *graph_;
  const int s = shaftCount();
  Formulas made;
  made.C.reserve(static_cast<std::size_t>(s));
  for (int i = 0; i < s; ++i) {
    made.C.push_back(graph.differentiate(function_, slotOf(kHighest[order_ - 1], i)));
  }
  const std::vector<Graph::Rate> rates = expression::ratesOf(graph, s, inputs);
  made.second = order_ == 1 ? graph.totalDerivative(function_, rates) : function_;
  // The jerks of order 3 occur linearly: c0 is what is left without them.
  made.c0 = order_ < 3 ? graph.totalDerivative(made.second, rates) : withoutJerks(made.C, path);
  if (order_ < 3) {
    std::vector<int> slots = {slotOf(Source::kTime)};
    for (int i = 0; i < s; ++i) {
      slots.insert(slots.end(), {slotOf(Source::kAngle, i), slotOf(Source::kVelocity, i),
                                 slotOf(Source::kAcceleration, i)});
    }
    for (const int i : inputs) slots.push_back(slotOf(Source::kInput, i));
    for (const int slot : slots) {
      const Node partial = graph.differentiate(function_, slot);
      if (graph.isConstant(partial, 0.0)) continue;
      made.partials.push_back(partial);
      partial_slots_.push_back(slot);
    }
  }
  for (const Node entry : made.C) {
    made.jacobian_rate.push_back(graph.totalDerivative(entry, rates));
    for (int j = 0; j < s; ++j) {
      made.hessian.push_back(graph.differentiate(entry, slotOf(Source::kAcceleration, j)));
    }
  }
  made.jacobian_rate.insert(made.jacobian_rate.end(), made.hessian.begin(), made.hessian.end());
  return made;
}

Node FormulaConstraint::withoutJerks(const std::vector<Node>& C, const std::string& path) {
  Graph& graph = *graph_;
  std::vector<Graph::Rate> no_jerks;
  for (int i = 0; i < shaftCount(); ++i) {
    no_jerks.emplace_back(slotOf(Source::kJerk, i), graph.constant(0.0));
    for (const Node entry : C) {
      if (!graph.dependsOn(entry, no_jerks.back().first)) continue;
      throw SceneError(path, "a jerk may occur in a constraint of order 3 linearly only");
    }
  }
  return graph.substitute(function_, no_jerks);
}

void FormulaConstraint::noteNonlinear(const Formulas& formulas) {
  const Graph& graph = *graph_;
  const int s = shaftCount();
  if (order_ > 1) {
    const std::vector<unsigned> reads = findReads(graph, Source::kAcceleration, s);
    nonlinear_ = findPiecewise(graph, reads, function_);
    for (int i = 0; i < s; ++i) {
      bool is_constant = findPiecewise(graph, reads, formulas.C[static_cast<std::size_t>(i)]) == 0U;
      const auto row = formulas.hessian.begin() + static_cast<std::ptrdiff_t>(i) * s;
      is_constant = is_constant && std::all_of(row, row + s, [&graph](Node node) {
                      return graph.isConstant(node, 0.0);
                    });
      if (!is_constant) nonlinear_ |= 1U << static_cast<unsigned>(i);
    }
  }
  std::vector<int> accelerations;
  accelerations.reserve(static_cast<std::size_t>(s));
  for (int i = 0; i < s; ++i) accelerations.push_back(slotOf(Source::kAcceleration, i));
  degree_ = graph.polynomialDegree(formulas.second, accelerations);
}

void FormulaConstraint::check(const Formulas& formulas, const std::string& path) {
  const Graph& graph = *graph_;
  // Of an opaque function no second derivative is known: they are NaN.
  const bool is_opaque = graph.hasOpaque({function_});
  if (order_ == 1 && is_opaque && graph.hasNonFiniteConstant(formulas.c0)) {
    throw SceneError(path,
                     "a constraint of order 1 is differentiated twice, and the opaque function in "
                     "it has first derivatives only; allowed: a function made of Expressions, or a "
                     "constraint of order 2");
  }
  has_jacobian_rate_ = !is_opaque || !graph.hasNonFiniteConstant(formulas.jacobian_rate);
  std::vector<Node> checked = formulas.partials;
  checked.push_back(formulas.c0);
  if (has_jacobian_rate_) {
    checked.insert(checked.end(), formulas.jacobian_rate.begin(), formulas.jacobian_rate.end());
  }
  for (const Node node : checked) {
    if (graph.hasNonFiniteConstant(node)) {
      throw SceneError(path, "a derivative of it has a constant part that is not finite");
    }
  }
}

void FormulaConstraint::makePrograms(const Formulas& formulas) {
  const Graph& graph = *graph_;
  const auto with_C = [&formulas](Node first) {
    std::vector<Node> nodes = {first};
    nodes.insert(nodes.end(), formulas.C.begin(), formulas.C.end());
    return nodes;
  };
  row_nodes_ = formulas.C;
  row_nodes_.push_back(formulas.c0);
  row_ = Tape(graph, row_nodes_);
  if (has_jacobian_rate_) {
    hessian_ = Tape(graph, formulas.hessian);
    jacobian_rate_ = Tape(graph, formulas.jacobian_rate);
  }
  if (order_ < 3) {
    residual_ = Tape(graph, {function_});
    residual_and_jacobian_ = Tape(graph, with_C(formulas.second));
    partials_ = Tape(graph, formulas.partials);
  }
  if (order_ == 1) velocity_level_ = Tape(graph, with_C(function_));
  guards_ = expression::findGuards(*graph_, {function_});
  instants_ = expression::findInstants(graph, {function_});
}

double FormulaConstraint::doCalcResidual(const StateView& state) const {
  double psi = 0.0;  // of order 3, which has no residual at this level
  residual_.evaluate(state, &psi);
  return psi;
}

double FormulaConstraint::doCalcVelocityResidualAndJacobian(const StateView& state,
                                                            double* C) const {
  return evaluateWithRow(velocity_level_, state, C);
}

double FormulaConstraint::doCalcResidualAndJacobian(const StateView& state, double* C) const {
  return evaluateWithRow(residual_and_jacobian_, state, C);
}

void FormulaConstraint::doCalcRow(const StateView& state, double* C, double* c0) const {
  double values[kMaxShafts + 1];
  row_.evaluate(state, values);
  std::copy(values, values + shaftCount(), C);
  *c0 = values[shaftCount()];
}

void FormulaConstraint::doCalcPartials(const StateView& state, ConstraintPartials& partials) const {
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

void FormulaConstraint::doCalcHessian(const StateView& state, double* H) const {
  if (!has_jacobian_rate_) {
    Constraint::doCalcHessian(state, H);
    return;
  }
  hessian_.evaluate(state, H);
}

void FormulaConstraint::doCalcRowDerivatives(const StateView& state, double* dC,
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

void FormulaConstraint::doCalcJacobianRate(const StateView& state, double* D, double* H) const {
  if (!has_jacobian_rate_) {
    Constraint::doCalcJacobianRate(state, D, H);
    return;
  }
  double values[kMaxShafts * (1 + kMaxShafts)];
  jacobian_rate_.evaluate(state, values);
  std::copy(values, values + shaftCount(), D);
  std::copy(values + shaftCount(), values + shaftCount() * (1 + shaftCount()), H);
}

}  // namespace variator_sim
