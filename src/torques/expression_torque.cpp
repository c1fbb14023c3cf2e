#include "variator_sim/torques/expression_torque.h"

#include <stdexcept>
#include <string>
#include <vector>

#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;
using expression::Tape;

void ExpressionTorque::doConfigure(ComponentContext& context) {
  ParameterReader& reader = context.parameters();
  // All known from the start, so that a missing key can be told from a misspelt one.
  for (const char* key : {"shaft", "reaction_on", "torque", "parameters"}) reader.allow(key);
  shaft_ = context.readShaft("shaft");
  if (reader.has("reaction_on")) {
    reaction_ = context.readShaft("reaction_on");
    if (reaction_ == shaft_) {
      throw SceneError(reader.keyPath("reaction_on"),
                       "'" + reader.text("reaction_on") +
                           "' is the shaft that the torque acts on, too: the two cancel; allowed: "
                           "another shaft");
    }
  }
  Graph graph;
  const Node torque = readFormula(context, "torque", expression::FormulaKind::kTorque, graph);

  // Q' = dQ/dt + dQ/dphi omega + dQ/domega epsilon + dQ/du u'
  const std::vector<Graph::Rate> rates =
      expression::ratesOf(graph, context.shaftCount(), context.usedInputs());
  const Node rate = graph.totalDerivative(torque, rates);
  if (graph.hasNonFiniteConstant(rate)) {
    throw SceneError(reader.keyPath("torque"), "the rate of '" + reader.formula("torque") +
                                                   "' has a constant part that is not finite");
  }
  has_rate_ = !graph.isConstant(rate, 0.0);
  try {
    torque_ = Tape(graph, {torque});
    rate_ = Tape(graph, {rate});
    guards_ = expression::findGuards(graph, {torque});
    instants_ = expression::findInstants(graph, {torque});
  } catch (const std::length_error& error) {
    throw SceneError(reader.keyPath("torque"), error.what());
  }
  torque_dependence_ = expression::dependenceOf(graph, torque, context.shaftCount());
  rate_dependence_ = expression::dependenceOf(graph, rate, context.shaftCount());
  rate_derivatives_ = expression::StateDerivatives::of(graph, {rate}, context.shaftCount());
}

void ExpressionTorque::doAddTorque(const StateView& state, double* torque) const {
  double value = 0.0;
  torque_.evaluate(state, &value);
  torque[shaft_] += value;
  if (reaction_ >= 0) torque[reaction_] -= value;
}

void ExpressionTorque::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  if (!has_rate_) {
    return;
  }
  double value = 0.0;
  rate_.evaluate(state, &value);
  torque_rate[shaft_] += value;
  if (reaction_ >= 0) torque_rate[reaction_] -= value;
}

void ExpressionTorque::doAddTorqueRateDerivatives(const StateView& state,
                                                  double* derivatives) const {
  if (!rate_derivatives_) {
    Torque::doAddTorqueRateDerivatives(state, derivatives);
    return;
  }
  rate_derivatives_->evaluate(state, [&](int /*of*/, int by, double value) {
    derivatives[by * shaftCount() + shaft_] += value;
    if (reaction_ >= 0) derivatives[by * shaftCount() + reaction_] -= value;
  });
}

}  // namespace variator_sim
