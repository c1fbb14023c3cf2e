/// Formulas at run time: a program over registers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/types.h"

namespace variator_sim::expression {

/// The source of a variable.
enum class Source : std::uint8_t {
  kTime,
  kAngle,
  kVelocity,
  kAcceleration,
  kInput,
  kInputRate,
  kInputSecondRate,
  kJerk,  ///< for derivations only: a StateView holds none, a Tape refuses it
  kHeld   ///< of elements that hold, for observers only: heldSlot
};

/// The values of an element that holds.
enum class HeldValue {
  kMultiplier,  ///< lambda of the reaction C' lambda that it is stuck with, N m; else 0
  kMode,        ///< -1, 0, 1 or 2, as HeldElement has it
  kCounts       ///< 1 while it is stuck and others do not imply its row, else 0
};
/// Returns the index of Source::kHeld for a value of element `hold`.
constexpr int heldSlot(HeldValue value, int hold) {
  return static_cast<int>(value) * kMaxHolds + hold;
}

/// Returns the slot, for Graph::variable, of element `index` (0 for time) of a source.
constexpr int slotOf(Source source, int index = 0) {
  return static_cast<int>(source) * 4096 + index;
}
constexpr Source sourceOf(int slot) {
  return static_cast<Source>(slot / 4096);
}
constexpr int indexOf(int slot) {
  return slot % 4096;
}

/// The program that computes some nodes of a graph: only what they need, and each common
/// subexpression once. Values are bit by bit those of the formulas as the graph holds them, when
/// the compiler does not contract a*b + c into one rounding (-ffp-contract=off, or a processor
/// without such an instruction); powers as in powerOf.
class Tape {
 public:
  Tape() = default;
  /// Throws std::invalid_argument for a variable that no StateView holds.
  Tape(const Graph& graph, const std::vector<Node>& outputs);

  int outputCount() const { return output_count_; }
  /// Number of instructions, for tests.
  int size() const { return static_cast<int>(program_.size()); }

  /// Writes `outputCount()` values. It reads only those arrays of `state` that occur in the
  /// formulas, all of them before it writes `outputs`. For the real-time loop: it allocates
  /// nothing, takes no lock, and throws only an opaque function's exceptions. One thread may use a
  /// tape at a time, as it keeps its registers.
  void evaluate(const StateView& state, double* outputs) const {
    const double* values = evaluate(state);
    std::copy(values, values + output_count_, outputs);
  }
  /// Returns the outputs in place: valid until the next evaluation.
  const double* evaluate(const StateView& state) const;

 private:
  friend class TapeBuilder;

  /// The second operation of an instruction a o1 b, in which t is the result of o1 and c the third
  /// operand: it saves t the way through memory. Both operations round.
  enum Then : std::uint8_t {
    kAlone,
    kPlus,     ///< t + c
    kMinus,    ///< t - c
    kFrom,     ///< c - t
    kTimes,    ///< t * c
    kOver,     ///< t / c
    kUnder,    ///< c / t
    kNegated,  ///< -t
    kThenCount
  };
  /// Returns the code of an operation; only the four from kAdd to kDivide may have a second one.
  static constexpr int codeOf(Operation operation, Then then = kAlone) {
    const int first = static_cast<int>(operation);
    return then == kAlone ? first : 32 + (first - static_cast<int>(Operation::kAdd)) * 8 + then;
  }
  static_assert(static_cast<int>(Operation::kWhereFinite) < 32 && kThenCount == 8);

  /// Operands and results are registers.
  struct Instruction {
    std::uint8_t code;      ///< of codeOf; kVariable copies one output to another
    std::uint8_t order[2];  ///< of a table's derivative; of kPower 1 if the exponent is a constant,
                            ///< of kSin 1 if its second operand receives the cosine
    std::uint32_t result;
    std::uint32_t operands[4];
    std::uint32_t index;  ///< of a table or a call
  };
  /// An opaque function: its value, or the derivatives that the program needs.
  struct Call {
    std::shared_ptr<const OpaqueFunction> function;
    std::uint32_t arguments[OpaqueFunction::kMostArguments];  ///< registers
    /// Registers of the value, then of the derivatives by each argument; -1 if not needed.
    int results[1 + OpaqueFunction::kMostArguments];
  };
  struct Load {
    std::uint32_t to;
    std::uint32_t index;
    Source source;
  };

  void carryOut(const Call& call) const;

  std::vector<Load> loads_;
  std::vector<Instruction> program_;
  int output_count_ = 0;  ///< in the first registers
  std::vector<std::shared_ptr<const Table>> tables_;
  std::vector<std::shared_ptr<const Table2>> tables2_;
  std::vector<Call> calls_;
  mutable std::vector<double> registers_;  ///< the constants are filled in once
};

}  // namespace variator_sim::expression
