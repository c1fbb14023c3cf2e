#include "variator_sim/torque.h"

#include <algorithm>

#include "variator_sim/errors.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Tape;

namespace {

std::vector<Node> nodesOf(const std::vector<Torque::ShaftNode>& formulas) {
  std::vector<Node> nodes;
  nodes.reserve(formulas.size());
  for (const auto& [shaft, node] : formulas) nodes.push_back(node);
  return nodes;
}

/// Adds the values of a tape, one for each of `formulas`, to their shafts.
void addTo(double* shafts, const std::vector<Torque::ShaftNode>& formulas, const Tape& tape,
           const StateView& state) {
  double values[kMaxShafts];
  tape.evaluate(state, values);
  for (std::size_t i = 0; i < formulas.size(); ++i) shafts[formulas[i].first] += values[i];
}

}  // namespace

void Torque::derive(const LawContext& law) {
  Graph& graph = Law::graph();
  for (const auto& [shaft, torque] : law.torques()) {
    torques_.emplace_back(shaft, torque.in(graph));
  }

  // Q' = dQ/dt + dQ/dphi omega + dQ/domega epsilon + dQ/du u'
  setFormulas(nodesOf(torques_));
  const std::vector<Graph::Rate> motion =
      expression::ratesOf(graph, shaftCount(), expression::inputsIn(graph, formulas()));
  for (const auto& [shaft, torque] : torques_) {
    const Node rate = graph.totalDerivative(torque, motion);
    if (graph.hasNonFiniteConstant({rate})) {
      throw SceneError(law.place(),
                       "the rate of its torque on shaft " +
                           inQuotes(law.shaftNames()[static_cast<std::size_t>(shaft)]) +
                           " has a constant part that is not finite");
    }
    if (!graph.isConstant(rate, 0.0)) rates_.emplace_back(shaft, rate);
  }
  torque_ = Tape(graph, formulas());
  rate_ = Tape(graph, nodesOf(rates_));
}

std::vector<int> Torque::shafts() const {
  std::vector<int> shafts;
  for (const auto& [shaft, torque] : torques_) shafts.push_back(shaft);
  std::sort(shafts.begin(), shafts.end());
  return shafts;
}

void Torque::addTorque(const StateView& state, double* torque) const {
  addTo(torque, torques_, torque_, state);
}

void Torque::addTorqueRate(const StateView& state, double* torque_rate) const {
  if (!rates_.empty()) addTo(torque_rate, rates_, rate_, state);
}

}  // namespace variator_sim
