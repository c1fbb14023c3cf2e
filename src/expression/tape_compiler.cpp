// Compiles nodes to a Tape, operands first. A sum, product, ... with a single reader joins the
// reader's instruction; the roundings remain those of separate operations. A register is free again
// after the last reader of its value.
#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <stdexcept>
#include <utility>

#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

class TapeBuilder {
 public:
  TapeBuilder(const Graph& graph, const std::vector<Node>& outputs, Tape& tape)
      : graph_(graph), tape_(tape), nodes_(graph.listReachable(outputs)) {
    register_of_.assign(nodes_.size(), -1);
    output_of_.assign(nodes_.size(), -1);
    readers_.assign(nodes_.size(), 0);
    reserveOutputs(outputs);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (isLeaf(i)) allocateLeaf(i);
      for (int k = 0; k < operandCount(entry(i).operation); ++k) ++readers_[operand(i, k)];
      if (isShared(entry(i))) together_[keyOf(entry(i))].push_back(i);
    }
    join();
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (!isLeaf(i) && !is_joined_[i]) addInstruction(i);
    }
    copyOutputs(outputs);
  }

 private:
  /// The call that nodes share, by its function (-1: sine and cosine) and arguments.
  using Key = std::array<int, 5>;

  const Graph::Entry& entry(std::size_t i) const { return graph_.entry({nodes_[i]}); }
  bool isLeaf(std::size_t i) const { return operandCount(entry(i).operation) == 0; }
  /// Returns the place of a node in the list.
  std::size_t placeOf(int index) const {
    return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), index) -
                                    nodes_.begin());
  }
  std::size_t operand(std::size_t i, int k) const { return placeOf(entry(i).operands[k]); }
  static std::uint32_t toField(int value) { return static_cast<std::uint32_t>(value); }

  int newRegister() {
    if (!free_registers_.empty()) {
      const int free_register = free_registers_.back();
      free_registers_.pop_back();
      return free_register;
    }
    tape_.registers_.push_back(0.0);
    return static_cast<int>(tape_.registers_.size()) - 1;
  }
  std::uint32_t allocate(std::size_t i) {
    register_of_[i] = output_of_[i] >= 0 ? output_of_[i] : newRegister();
    return toField(register_of_[i]);
  }

  /// Assigns the first registers to the outputs, consecutively; a node with several outputs is
  /// computed in the first of them.
  void reserveOutputs(const std::vector<Node>& outputs) {
    for (const Node output : outputs) {
      const int place = newRegister();
      int& first = output_of_[placeOf(output.index)];
      if (first < 0) first = place;
      ++readers_[placeOf(output.index)];  // never freed
    }
    tape_.output_count_ = static_cast<int>(outputs.size());
  }

  void allocateLeaf(std::size_t i) {
    const Graph::Entry& it = entry(i);
    const std::uint32_t to = allocate(i);
    if (it.operation == Operation::kConstant) {
      tape_.registers_[to] = it.value;
      ++readers_[i];  // never freed: filled in once
      return;
    }
    if (it.slot < 0 || sourceOf(it.slot) == Source::kJerk) {
      throw std::invalid_argument("a tape reads only what a StateView holds");
    }
    tape_.loads_.push_back({to, toField(indexOf(it.slot)), sourceOf(it.slot)});
  }

  /// Tells whether one instruction may compute this node with others: sine and cosine of one
  /// argument, the derivatives of one opaque call.
  static bool isShared(const Graph::Entry& it) {
    return it.operation == Operation::kSin || it.operation == Operation::kCos ||
           (it.operation == Operation::kOpaque && it.order[0] > 0);
  }
  static Key keyOf(const Graph::Entry& it) {
    return {it.slot, it.operands[0], it.operands[1], it.operands[2], it.operands[3]};
  }

  bool isArithmetic(std::size_t i) const {
    return entry(i).operation >= Operation::kAdd && entry(i).operation <= Operation::kDivide;
  }
  /// Lets each sum, product, .. and negative take in one operand that has no other reader.
  void join() {
    is_joined_.assign(nodes_.size(), false);
    joins_.assign(nodes_.size(), -1);
    for (std::size_t i = nodes_.size(); i-- > 0;) {
      const Operation operation = entry(i).operation;
      if (is_joined_[i] || (!isArithmetic(i) && operation != Operation::kNegate)) continue;
      for (int k = 0; k < operandCount(operation) && joins_[i] < 0; ++k) {
        const std::size_t inner = operand(i, k);
        if (readers_[inner] != 1 || !isArithmetic(inner)) continue;
        joins_[i] = k;
        is_joined_[inner] = true;
      }
    }
  }
  /// Returns the code of a node, with that of the operand it takes in, and writes the places of its
  /// operands.
  std::uint8_t codeOf(std::size_t i, std::vector<std::size_t>& operands) const {
    const Graph::Entry& it = entry(i);
    const int joined = joins_[i];
    for (int k = 0; joined >= 0 && k < 2; ++k) operands.push_back(operand(operand(i, joined), k));
    for (int k = 0; k < operandCount(it.operation); ++k) {
      if (k != joined) operands.push_back(operand(i, k));
    }
    Tape::Then then = Tape::kAlone;
    Operation first = it.operation;
    if (joined >= 0) {
      constexpr Tape::Then kThens[4][2] = {{Tape::kPlus, Tape::kPlus},
                                           {Tape::kMinus, Tape::kFrom},
                                           {Tape::kTimes, Tape::kTimes},
                                           {Tape::kOver, Tape::kUnder}};
      then = isArithmetic(i) ? kThens[static_cast<int>(first) - static_cast<int>(Operation::kAdd)]
                                     [static_cast<std::size_t>(joined)]
                             : Tape::kNegated;
      first = entry(operand(i, joined)).operation;
    }
    return static_cast<std::uint8_t>(Tape::codeOf(first, then));
  }

  void addInstruction(std::size_t i) {
    const Graph::Entry& it = entry(i);
    Tape::Instruction instruction = {};
    std::vector<std::size_t> operands;
    instruction.code = codeOf(i, operands);
    for (int k = 0; k < 2; ++k) instruction.order[k] = static_cast<std::uint8_t>(it.order[k]);
    for (std::size_t k = 0; k < operands.size(); ++k) {
      instruction.operands[k] = toField(register_of_[operands[k]]);
      if (--readers_[operands[k]] == 0) free_registers_.push_back(register_of_[operands[k]]);
    }
    if (register_of_[i] >= 0) return;  // computed with an earlier node
    if (it.operation == Operation::kOpaque) {
      addCall(i, instruction);
      return;
    }
    // A result may take the register of an operand: every instruction reads before it writes.
    instruction.result = allocate(i);
    if (it.operation == Operation::kTable) {
      instruction.index = toField(indexIn(tape_.tables_, graph_.tableOf(it)));
    } else if (it.operation == Operation::kTable2) {
      instruction.index = toField(indexIn(tape_.tables2_, graph_.table2Of(it)));
    } else if (it.operation == Operation::kPower) {
      instruction.order[0] = graph_.isConstant({it.operands[1]}) ? 1 : 0;
    } else if (isShared(it) && together_.at(keyOf(it)).size() == 2) {
      addCosine(i, instruction);
    }
    tape_.program_.push_back(instruction);
  }

  /// Completes the instruction of a sine or cosine, computed first, with the other one.
  void addCosine(std::size_t i, Tape::Instruction& instruction) {
    const std::vector<std::size_t>& both = together_.at(keyOf(entry(i)));
    const std::uint32_t other = allocate(both[0] == i ? both[1] : both[0]);
    instruction.operands[1] = other;
    if (entry(i).operation == Operation::kCos) {
      std::swap(instruction.result, instruction.operands[1]);
    }
    instruction.code = static_cast<std::uint8_t>(Tape::codeOf(Operation::kSin));
    instruction.order[0] = 1;
  }

  /// Adds a call, with all derivatives of one call at the place of the first.
  void addCall(std::size_t i, Tape::Instruction& instruction) {
    const Graph::Entry& it = entry(i);
    Tape::Call call = {};
    call.function = graph_.opaqueOf(it);
    std::copy(std::begin(instruction.operands), std::end(instruction.operands), call.arguments);
    std::fill(std::begin(call.results), std::end(call.results), -1);
    const std::vector<std::size_t> value = {i};
    for (const std::size_t result : isShared(it) ? together_.at(keyOf(it)) : value) {
      call.results[entry(result).order[0]] = allocate(result);
    }
    instruction.index = toField(static_cast<int>(tape_.calls_.size()));
    tape_.calls_.push_back(std::move(call));
    tape_.program_.push_back(instruction);
  }

  /// Copies outputs that repeat another one.
  void copyOutputs(const std::vector<Node>& outputs) {
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      const int computed = register_of_[placeOf(outputs[k].index)];
      if (graph_.isConstant(outputs[k])) tape_.registers_[k] = graph_.constantValue(outputs[k]);
      if (computed == static_cast<int>(k) || graph_.isConstant(outputs[k])) continue;
      Tape::Instruction copy = {};
      copy.code = static_cast<std::uint8_t>(Tape::codeOf(Operation::kVariable));
      copy.result = toField(static_cast<int>(k));
      copy.operands[0] = toField(computed);
      tape_.program_.push_back(copy);
    }
  }

  /// Returns the index of `table` in `tables`, and adds a new one.
  template <class T>
  static int indexIn(std::vector<std::shared_ptr<const T>>& tables,
                     const std::shared_ptr<const T>& table) {
    const auto found = std::find(tables.begin(), tables.end(), table);
    const auto index = found - tables.begin();
    if (found == tables.end()) tables.push_back(table);
    return static_cast<int>(index);
  }

  const Graph& graph_;
  Tape& tape_;
  std::vector<int> nodes_;        ///< needed nodes; the vectors below have an entry for each
  std::vector<int> register_of_;  ///< -1: none yet
  std::vector<int> output_of_;    ///< the first output that is this node; -1: none
  std::vector<int> readers_;      ///< those still to come
  std::vector<bool> is_joined_;   ///< computed in the instruction of its only reader
  std::vector<int> joins_;        ///< which operand is; -1: none
  std::vector<int> free_registers_;
  std::map<Key, std::vector<std::size_t>> together_;  ///< nodes of isShared
};

Tape::Tape(const Graph& graph, const std::vector<Node>& outputs) {
  TapeBuilder(graph, outputs, *this);
}

}  // namespace variator_sim::expression
