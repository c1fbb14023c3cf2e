/// Formulas of the variables of a scene, and at run time: a program over registers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
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
/// subexpression once. Values are bit by bit those of the formulas as the graph holds them; powers
/// as in powerOf.
class Tape {
 public:
  Tape() = default;
  /// Throws std::invalid_argument for a variable that no StateView holds.
  Tape(const Graph& graph, const std::vector<Node>& outputs);

  int outputCount() const { return static_cast<int>(outputs_.size()); }

  /// Writes `outputCount()` values. It reads only those arrays of `state` that occur in the
  /// formulas, all of them before it writes `outputs`. For the real-time loop: it allocates
  /// nothing, takes no lock, and throws only an opaque function's exceptions. One thread may use a
  /// tape at a time, as it keeps its values.
  void evaluate(const StateView& state, double* outputs) const {
    const double* values = evaluate(state);
    std::copy(values, values + outputs_.size(), outputs);
  }
  /// Returns the outputs in place: valid until the next evaluation.
  const double* evaluate(const StateView& state) const;

 private:
  struct Load {
    std::size_t to;
    Source source;
    int index;
  };
  struct Instruction {
    Operation operation;
    int order[2];  ///< of a derivative, as in Graph::Entry
    bool has_constant_exponent;
    std::size_t operands[4];  ///< places of values
    std::size_t result;
    std::shared_ptr<const Table> table;
    std::shared_ptr<const OpaqueFunction> function;
  };

  static double compute(const Instruction& it, const double* operands);

  std::vector<Load> loads_;
  std::vector<Instruction> program_;
  std::vector<std::size_t> outputs_;  ///< places of values
  /// The outputs, then one value of each node; the constants are filled in once.
  mutable std::vector<double> values_;
};

/// Returns the rates of all variables of a scene with `shaft_count` shafts, for
/// Graph::totalDerivative: phi' = omega, omega' = epsilon, t' = 1, u' and u'' of the inputs,
/// epsilon constant, as its rate is multiplied by C.
inline std::vector<Graph::Rate> ratesOf(Graph& graph, int shaft_count,
                                        const std::set<int>& inputs) {
  std::vector<Graph::Rate> rates = {{slotOf(Source::kTime), graph.constant(1.0)}};
  const auto add = [&](Source of, Source rate, int i) {
    rates.emplace_back(slotOf(of, i), graph.variable(slotOf(rate, i)));
  };
  for (int i = 0; i < shaft_count; ++i) {
    add(Source::kAngle, Source::kVelocity, i);
    add(Source::kVelocity, Source::kAcceleration, i);
  }
  for (const int i : inputs) {
    add(Source::kInput, Source::kInputRate, i);
    add(Source::kInputRate, Source::kInputSecondRate, i);
  }
  return rates;
}

/// Returns the indices of the variables of `source` that occur in `nodes`.
inline std::set<int> indicesIn(const Graph& graph, const std::vector<Node>& nodes, Source source) {
  std::set<int> indices;
  for (const int n : graph.listReachable(nodes)) {
    const Graph::Entry& entry = graph.entry({n});
    const bool is_its = entry.operation == Operation::kVariable && sourceOf(entry.slot) == source;
    if (is_its) indices.insert(indexOf(entry.slot));
  }
  return indices;
}

/// Returns the inputs that `nodes` read, without the sides of elements that hold, which are
/// constant between events.
inline std::set<int> inputsIn(const Graph& graph, const std::vector<Node>& nodes) {
  std::set<int> inputs = indicesIn(graph, nodes, Source::kInput);
  inputs.erase(inputs.lower_bound(kMaxInputs), inputs.end());
  return inputs;
}

/// Tells if a variable of `source` occurs in `nodes`.
inline bool reads(const Graph& graph, const std::vector<Node>& nodes, Source source) {
  return !indicesIn(graph, nodes, source).empty();
}

}  // namespace variator_sim::expression
