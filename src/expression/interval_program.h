/// Formulas over intervals.
#pragma once

#include <memory>
#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/guard.h"

namespace variator_sim::expression {

/// Encloses one node of a graph over a box of states: natural interval arithmetic (Moore: Interval
/// Analysis, 1966), whose result holds every value that the formula takes in the box. Rounding is
/// not directed outwards: it equals the formula's own rounding.
class IntervalProgram {
 public:
  IntervalProgram() = default;
  IntervalProgram(const Graph& graph, Node node);

  /// Returns an infinite interval if no bound is known (also outside of a domain). Results and
  /// operands are widened by the part `rounding` of themselves. One thread may use a program at a
  /// time, as it keeps its registers. [loop]
  Interval evaluate(const StateBox& box, double rounding = 0.0) const;
  /// The parts of the state that occur, as Guard::reads tells them.
  StateSet reads() const { return reads_; }
  /// True when the time occurs.
  bool readsTime() const { return reads_time_; }
  /// True when an input occurs.
  bool readsInputs() const { return reads_inputs_; }

 private:
  struct Step {
    Operation operation;
    int slot;
    int operands[4];
    std::shared_ptr<const Table> table;
    std::shared_ptr<const Table2> table2;
    Table2::Order order;
  };
  std::vector<Step> steps_;
  mutable std::vector<Interval> registers_;  ///< one per step; constants are written once
  StateSet reads_;
  bool reads_time_ = false;
  bool reads_inputs_ = false;
};

}  // namespace variator_sim::expression
