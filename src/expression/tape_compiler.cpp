// Steps of compilation:
//   1. lower: powers with small integer exponents become multiplications; unused nodes are dropped;
//   2. fuse: a sum, product, ... with a single reader joins it in one instruction. The roundings
//   remain those of the separate operations;
//   3. schedule (tape_schedule.h): the step on the longest remaining chain goes first, with steps
//   of the same code;
//   4. allocate: a register is free again after its last reader.
#include <algorithm>
#include <array>
#include <initializer_list>
#include <iterator>
#include <map>
#include <stdexcept>
#include <utility>

#include "instruction_set.h"
#include "tape_schedule.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

namespace {

int functionCode(Operation operation) {
  switch (operation) {
#define VARIATOR_SIM_CODE(name, value) \
  case Operation::k##name:             \
    return kCode##name;
    VARIATOR_SIM_FUNCTIONS(VARIATOR_SIM_CODE)
#undef VARIATOR_SIM_CODE
    default:
      return kCodeReturn;
  }
}

/// Returns the index of one of the four operations, or -1.
int arithmeticOf(Operation operation) {
  switch (operation) {
    case Operation::kAdd:
      return kPlus;
    case Operation::kSubtract:
      return kMinus;
    case Operation::kMultiply:
      return kTimes;
    case Operation::kDivide:
      return kOver;
    default:
      return -1;
  }
}

}  // namespace

class TapeBuilder {
 public:
  TapeBuilder(const Graph& graph, const std::vector<Node>& outputs, Tape& tape) : tape_(tape) {
    lower(graph, outputs);
    countUses();
    fuse();
    order_ = schedule(steps_);
    allocate();
  }

 private:
  /// An instruction whose fields are not yet packed.
  struct Draft {
    int code = kCodeReturn;
    int result = 0;
    int operands[4] = {};
  };

  static std::size_t at(int index) { return static_cast<std::size_t>(index); }
  const Graph::Entry& entry(int index) const { return graph_.entry({index}); }
  bool isLeaf(int index) const { return operandCount(entry(index).operation) == 0; }

  /// Makes x^n by the same products as powerOf.
  Node lowerPower(Node base, double exponent) {
    if (exponent < 0.0) {
      return graph_.divide(graph_.constant(1.0), lowerPower(base, -exponent));
    }
    const int n = static_cast<int>(exponent);
    if (n <= 1) {
      return n == 0 ? graph_.constant(1.0) : base;
    }
    if (n % 2 == 1) {
      return graph_.multiply(lowerPower(base, n - 1), base);
    }
    const int half = n / 2;
    const Node root = lowerPower(base, half);
    return graph_.multiply(root, root);
  }

  void lower(const Graph& source, const std::vector<Node>& outputs) {
    const std::vector<int> reachable = source.listReachable(outputs);
    std::vector<Node> lowered(reachable.size());
    const auto loweredOf = [&](int index) {
      const auto place = std::lower_bound(reachable.begin(), reachable.end(), index);
      return lowered[static_cast<std::size_t>(place - reachable.begin())];
    };
    for (std::size_t i = 0; i < reachable.size(); ++i) {
      const Graph::Entry& it = source.entry({reachable[i]});
      Node operands[4] = {};
      for (int k = 0; k < operandCount(it.operation); ++k) {
        operands[k] = loweredOf(it.operands[k]);
      }
      if (it.operation == Operation::kPower && graph_.isConstant(operands[1]) &&
          isMultipliedPower(graph_.constantValue(operands[1]))) {
        lowered[i] = lowerPower(operands[0], graph_.constantValue(operands[1]));
      } else {
        lowered[i] = graph_.remake(source, it, operands);
      }
    }
    for (const Node output : outputs) {
      outputs_.push_back(loweredOf(output.index));
    }
    needed_ = graph_.findReachable(outputs_);
  }

  int nodeCount() const { return static_cast<int>(needed_.size()); }

  void countUses() {
    uses_.assign(needed_.size(), 0);
    for (int i = 0; i < nodeCount(); ++i) {
      if (needed_[at(i)]) {
        for (int k = 0; k < operandCount(entry(i).operation); ++k) {
          ++uses_[at(entry(i).operands[k])];
        }
      }
    }
    for (const Node output : outputs_) {
      ++uses_[at(output.index)];
    }
  }

  bool canJoin(int index) const {
    return uses_[at(index)] == 1 && arithmeticOf(entry(index).operation) >= 0;
  }

  void setStep(int index, int code, std::initializer_list<int> operands) {
    Step& step = steps_[at(index)];
    step.code = code;
    step.results[0] = index;
    step.operand_count = 0;
    for (const int operand : operands) {
      step.operands[step.operand_count++] = operand;
    }
  }

  void fuse() {
    steps_.resize(needed_.size());
    std::vector<bool> joined(needed_.size(), false);
    for (int i = nodeCount() - 1; i >= 0; --i) {
      if (!needed_[at(i)] || joined[at(i)] || isLeaf(i)) {
        continue;
      }
      const Graph::Entry& it = entry(i);
      const int a = it.operands[0];
      const int b = it.operands[1];
      const int o = arithmeticOf(it.operation);
      if (o >= 0) {
        if (canJoin(a) && canJoin(b)) {
          setStep(i,
                  quadCode(arithmeticOf(entry(a).operation), o, arithmeticOf(entry(b).operation)),
                  {entry(a).operands[0], entry(a).operands[1], entry(b).operands[0],
                   entry(b).operands[1]});
          joined[at(a)] = joined[at(b)] = true;
        } else if (canJoin(a)) {
          constexpr int kFormOf[4] = {kThenPlus, kThenMinus, kThenTimes, kThenOver};
          setStep(i, triadCode(arithmeticOf(entry(a).operation), kFormOf[o]),
                  {entry(a).operands[0], entry(a).operands[1], b});
          joined[at(a)] = true;
        } else if (canJoin(b)) {
          constexpr int kFormOf[4] = {kThenPlus, kFromThen, kThenTimes, kOverThen};
          setStep(i, triadCode(arithmeticOf(entry(b).operation), kFormOf[o]),
                  {entry(b).operands[0], entry(b).operands[1], a});
          joined[at(b)] = true;
        } else {
          setStep(i, pairCode(o), {a, b});
        }
      } else if (it.operation == Operation::kNegate && canJoin(a)) {
        setStep(i, triadCode(arithmeticOf(entry(a).operation), kThenNegate),
                {entry(a).operands[0], entry(a).operands[1]});
        joined[at(a)] = true;
      } else if (it.operation == Operation::kSelect) {
        setStep(i, kCodeSelect, {it.operands[0], it.operands[1], it.operands[2], it.operands[3]});
      } else if (it.operation == Operation::kTable) {
        setStep(i, kCodeTable, {a});
      } else if (it.operation == Operation::kTable2) {
        setStep(i, kCodeTable2, {a, b});
      } else if (it.operation == Operation::kOpaque) {
        setStep(i, kCodeOpaque, {a, b, it.operands[2], it.operands[3]});
      } else if (operandCount(it.operation) == 2) {
        setStep(i, functionCode(it.operation), {a, b});
      } else {
        setStep(i, functionCode(it.operation), {a});
      }
    }
    shareSinCos();
    shareGradients();
  }

  void shareSinCos() {
    std::vector<int> sine_of(needed_.size(), -1);
    std::vector<int> cosine_of(needed_.size(), -1);
    for (int i = 0; i < nodeCount(); ++i) {
      if (steps_[at(i)].code == kCodeSin) {
        sine_of[at(entry(i).operands[0])] = i;
      } else if (steps_[at(i)].code == kCodeCos) {
        cosine_of[at(entry(i).operands[0])] = i;
      }
    }
    for (int x = 0; x < nodeCount(); ++x) {
      if (sine_of[at(x)] >= 0 && cosine_of[at(x)] >= 0) {
        // Both become one step, at the place of the earlier one: all readers come later.
        const int first = std::min(sine_of[at(x)], cosine_of[at(x)]);
        const int second = std::max(sine_of[at(x)], cosine_of[at(x)]);
        setStep(first, kCodeSinCos, {x});
        steps_[at(first)].results[0] = sine_of[at(x)];
        steps_[at(first)].results[1] = cosine_of[at(x)];
        steps_[at(second)].code = -1;
      }
    }
  }

  /// Merges the derivatives of one call into one step, at the place of the earliest.
  void shareGradients() {
    std::map<std::array<int, 5>, int> first_of;
    for (int i = 0; i < nodeCount(); ++i) {
      const Graph::Entry& it = entry(i);
      if (steps_[at(i)].code != kCodeOpaque || it.order[0] == 0) continue;
      const auto [first, is_new] = first_of.try_emplace(
          {it.slot, it.operands[0], it.operands[1], it.operands[2], it.operands[3]}, i);
      if (is_new) continue;
      auto& results = steps_[at(first->second)].results;
      *std::find(std::begin(results), std::end(results), -1) = i;
      steps_[at(i)].code = -1;
    }
  }

  int newRegister() {
    if (!free_registers_.empty()) {
      const int free_register = free_registers_.back();
      free_registers_.pop_back();
      return free_register;
    }
    if (tape_.registers_.size() > 0xFFFFU) {
      throw std::length_error("the formula is too large: more than 65536 values at a time");
    }
    tape_.registers_.push_back(0.0);
    return static_cast<int>(tape_.registers_.size()) - 1;
  }

  /// Assigns the first registers to the outputs, consecutively; a node with several outputs is
  /// computed in the first of them.
  void reserveOutputs() {
    output_of_.assign(needed_.size(), -1);
    for (std::size_t k = 0; k < outputs_.size(); ++k) {
      newRegister();
      int& first = output_of_[at(outputs_[k].index)];
      if (first < 0) first = static_cast<int>(k);
    }
    tape_.output_count_ = static_cast<int>(outputs_.size());
  }

  int registerFor(int index) {
    return output_of_[at(index)] >= 0 ? output_of_[at(index)] : newRegister();
  }

  void allocate() {
    reserveOutputs();
    register_of_.assign(needed_.size(), -1);
    std::vector<int> readers(needed_.size(), 0);
    for (const int i : order_) {
      for (int k = 0; k < steps_[at(i)].operand_count; ++k) {
        ++readers[at(steps_[at(i)].operands[k])];
      }
    }
    for (const Node output : outputs_) {
      ++readers[at(output.index)];  // never freed
    }
    for (int i = 0; i < nodeCount(); ++i) {
      if (needed_[at(i)] && isLeaf(i)) {
        allocateLeaf(i, readers);
      }
    }
    for (const int i : order_) {
      const Step& step = steps_[at(i)];
      Draft instruction;
      instruction.code = step.code;
      for (int k = 0; k < step.operand_count; ++k) {
        const int operand = step.operands[k];
        instruction.operands[k] = register_of_[at(operand)];
        if (--readers[at(operand)] == 0) {
          free_registers_.push_back(register_of_[at(operand)]);
        }
      }
      // A result may take the register of an operand: every instruction reads before it writes.
      for (int k = 0; k < 4 && step.results[k] >= 0; ++k) {
        register_of_[at(step.results[k])] = registerFor(step.results[k]);
      }
      instruction.result = register_of_[at(step.results[0])];
      if (step.code == kCodeSinCos) {
        instruction.operands[1] = register_of_[at(step.results[1])];
      }
      nameTable(i, instruction);
      if (step.code == kCodeOpaque) nameCall(step, instruction);
      program_.push_back(instruction);
    }
    finishOutputs();
  }

  /// Copies outputs that repeat another one, and ends the program.
  void finishOutputs() {
    for (std::size_t k = 0; k < outputs_.size(); ++k) {
      const int computed = register_of_[at(outputs_[k].index)];
      if (computed == static_cast<int>(k)) continue;
      if (graph_.isConstant(outputs_[k])) {
        tape_.registers_[k] = graph_.constantValue(outputs_[k]);
        continue;
      }
      Draft copy;
      copy.code = kCodeCopy;
      copy.result = static_cast<int>(k);
      copy.operands[0] = computed;
      program_.push_back(copy);
    }
    program_.emplace_back();
    gatherRuns();
    pack();
  }

  /// Writes the length of a run of instructions with one code into its first.
  void gatherRuns() {
    for (std::size_t i = 0; i < program_.size();) {
      const int code = program_[i].code;
      std::size_t end = i + 1;
      if (code < kArithmeticCount) {
        while (end < i + kLongestRun && program_[end].code == code) ++end;
        program_[i].code = runCode(code, static_cast<int>(end - i));
      }
      i = end;
    }
  }

  static std::uint16_t toField(int value) { return static_cast<std::uint16_t>(value); }

  void pack() {
    const auto put = [](int field, int value) {
      return static_cast<std::uint64_t>(toField(value)) << (kFieldBits * field);
    };
    for (const Draft& it : program_) {
      tape_.program_.push_back({put(kCodeField, it.code) | put(kResultField, it.result) |
                                    put(kAField, it.operands[0]) | put(kBField, it.operands[1]),
                                put(kCField, it.operands[2]) | put(kDField, it.operands[3])});
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

  /// Adds the table of node i, if it reads one, and the derivative's order to `instruction`.
  void nameTable(int i, Draft& instruction) {
    const Graph::Entry& it = entry(i);
    if (instruction.code == kCodeTable) {
      instruction.operands[1] = indexIn(tape_.tables_, graph_.tableOf(it));
      instruction.operands[2] = it.order[0];
    } else if (instruction.code == kCodeTable2) {
      instruction.operands[2] = indexIn(tape_.tables2_, graph_.table2Of(it));
      instruction.operands[3] = it.order[0] + (it.order[1] << 8);
    }
  }

  /// Adds the call of a step to the tape, and its index to `instruction`.
  void nameCall(const Step& step, Draft& instruction) {
    Tape::Call call = {};
    call.function = graph_.opaqueOf(entry(step.results[0]));
    for (int k = 0; k < 4; ++k) call.arguments[k] = toField(instruction.operands[k]);
    std::fill(std::begin(call.results), std::end(call.results), -1);
    for (const int result : step.results) {
      if (result < 0) continue;
      call.results[entry(result).order[0]] = register_of_[at(result)];
    }
    if (tape_.calls_.size() > 0xFFFFU) throw std::length_error("more than 65536 opaque functions");
    instruction.operands[0] = static_cast<int>(tape_.calls_.size());
    tape_.calls_.push_back(std::move(call));
  }

  void allocateLeaf(int index, std::vector<int>& readers) {
    const Graph::Entry& it = entry(index);
    const int leaf_register = registerFor(index);
    register_of_[at(index)] = leaf_register;
    if (it.operation == Operation::kConstant) {
      tape_.registers_[at(leaf_register)] = it.value;
      ++readers[at(index)];  // never freed: filled in once
      return;
    }
    if (it.slot < 0 || sourceOf(it.slot) >= Source::kJerk) {
      throw std::invalid_argument("a tape reads only what a StateView holds");
    }
    const int source = static_cast<int>(sourceOf(it.slot));
    Tape::Load load = {};
    load.to = toField(leaf_register);
    load.index = toField(indexOf(it.slot));
    tape_.loads_.insert(tape_.loads_.begin() + tape_.load_end_[source], load);
    for (int& end : tape_.load_end_) end += &end >= &tape_.load_end_[source] ? 1 : 0;
  }

  Tape& tape_;
  Graph graph_;  ///< the lowered one
  std::vector<Node> outputs_;
  std::vector<bool> needed_;
  std::vector<int> uses_;
  std::vector<Step> steps_;
  std::vector<int> order_;
  std::vector<Draft> program_;
  std::vector<int> output_of_;  ///< output index by node; -1: none
  std::vector<int> register_of_;
  std::vector<int> free_registers_;
};

Tape::Tape(const Graph& graph, const std::vector<Node>& outputs) {
  TapeBuilder(graph, outputs, *this);
}

}  // namespace variator_sim::expression
