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
  kJerk  ///< for derivations only: a StateView holds none, a Tape refuses it
};

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
  /// Throws std::invalid_argument for a variable that no StateView holds, std::length_error when
  /// the program would need more than 65536 registers.
  Tape(const Graph& graph, const std::vector<Node>& outputs);

  int outputCount() const { return output_count_; }
  /// Number of instructions, for tests.
  int size() const { return program_.empty() ? 0 : static_cast<int>(program_.size()) - 1; }

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

  /// Fields of 16 bits, in two words loaded together: see instruction_set.h.
  struct Instruction {
    std::uint64_t head;
    std::uint64_t tail;
  };
  /// An opaque function: its value, or the derivatives that the program needs.
  struct Call {
    std::shared_ptr<const OpaqueFunction> function;
    std::uint16_t arguments[OpaqueFunction::kMostArguments];  ///< registers
    /// Registers of the value, then of the derivatives by each argument; -1 if not needed.
    int results[1 + OpaqueFunction::kMostArguments];
  };
  struct Load {
    std::uint16_t to;
    std::uint16_t index;
  };

  void carryOut(const Call& call) const;

  std::vector<Load> loads_;  ///< by source
  int load_end_[static_cast<int>(Source::kJerk)] = {};
  std::vector<Instruction> program_;  ///< ends with an instruction that returns
  int output_count_ = 0;              ///< in the first registers
  std::vector<std::shared_ptr<const Table>> tables_;
  std::vector<std::shared_ptr<const Table2>> tables2_;
  std::vector<Call> calls_;
  mutable std::vector<double> registers_;  ///< the constants are filled in once
};

}  // namespace variator_sim::expression
