#include "variator_sim/expression/tape.h"

#include <cmath>
#include <stdexcept>

namespace variator_sim::expression {

Tape::Tape(const Graph& graph, const std::vector<Node>& outputs) {
  const std::vector<int> nodes = graph.listReachable(outputs);  // operands first
  const auto placeOf = [&](int index) {
    const auto found = std::lower_bound(nodes.begin(), nodes.end(), index);
    return outputs.size() + static_cast<std::size_t>(found - nodes.begin());
  };
  values_.resize(outputs.size() + nodes.size());
  for (const Node output : outputs) outputs_.push_back(placeOf(output.index));
  for (const int index : nodes) {
    const Graph::Entry& entry = graph.entry({index});
    const std::size_t result = placeOf(index);
    if (entry.operation == Operation::kConstant) {
      values_[result] = entry.value;
      continue;
    }
    if (entry.operation == Operation::kVariable) {
      if (entry.slot < 0 || sourceOf(entry.slot) == Source::kJerk) {
        throw std::invalid_argument("a tape reads only what a StateView holds");
      }
      loads_.push_back({result, sourceOf(entry.slot), indexOf(entry.slot)});
      continue;
    }
    Instruction it{};
    it.operation = entry.operation;
    it.result = result;
    std::copy(entry.order, entry.order + 2, it.order);
    for (int k = 0; k < operandCount(it.operation); ++k) {
      it.operands[k] = placeOf(entry.operands[k]);
    }
    it.has_constant_exponent =
        it.operation == Operation::kPower && graph.isConstant({entry.operands[1]});
    if (it.operation == Operation::kTable || it.operation == Operation::kTable2) {
      it.table = graph.tableOf(entry);
    }
    if (it.operation == Operation::kOpaque) it.function = graph.opaqueOf(entry);
    program_.push_back(std::move(it));
  }
}

double Tape::compute(const Instruction& it, const double* operands) {
  switch (it.operation) {
    case Operation::kTable:
      return it.table->derivative(it.order[0], operands[0]);
    case Operation::kTable2:
      return it.table->derivative({it.order[0], it.order[1]}, operands[0], operands[1]);
    case Operation::kOpaque:
      return it.function->value(operands);
    case Operation::kPower:
      return it.has_constant_exponent ? powerOf(operands[0], operands[1])
                                      : std::pow(operands[0], operands[1]);
    default:
      return evaluateOperation(it.operation, operands);
  }
}

const double* Tape::evaluate(const StateView& state) const {
  const double* const sources[] = {
      &state.time,      state.angle,      state.velocity,          state.acceleration,
      state.input,      state.input_rate, state.input_second_rate, nullptr,
      state.held_values};
  for (const Load& it : loads_) values_[it.to] = sources[static_cast<int>(it.source)][it.index];
  for (const Instruction& it : program_) {
    double operands[4];
    for (int k = 0; k < 4; ++k) operands[k] = values_[it.operands[k]];
    values_[it.result] = compute(it, operands);
  }
  for (std::size_t n = 0; n < outputs_.size(); ++n) values_[n] = values_[outputs_[n]];
  return values_.data();
}

}  // namespace variator_sim::expression
