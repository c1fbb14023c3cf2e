/// Formulas along a motion as power series: the coefficients of every node, one order after the
/// other.
///
/// For y = f(x, ..) with series x_0 + x_1 s + x_2 s^2 + .. the coefficient y_n follows from those
/// of the operands up to n and of y up to n - 1 (Moore; Jorba and Zou: A software package for the
/// numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14
/// (2005) 99-117):
///     y = a b        y_n = sum_{j=0..n} a_j b_{n-j}
///     y = a / b      y_n = (a_n - sum_{j=1..n} b_j y_{n-j}) / b_0
///     y' = x' w      y_n = 1/n sum_{j=1..n} j x_j w_{n-j}   (exp: w = y; sin, cos; tanh: w =
///     1-y^2) y' = p / w     y_n = q_{n-1} / n,  q = p / w           (log, atan, asin, ..)
/// Modes (of abs, min, a piece of a table) are those of the state at s = 0, or, at an event, of the
/// direction of motion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "expression/series_functions.h"
#include "expression/series_operation.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim {
class MotionRows;
}
namespace variator_sim::expression {

/// True for 0, 1 and -1, which are literals in the code: a compiler simplifies their operations.
bool isWrittenOut(double value);

/// The rows of coefficients of a set of formulas. The interpreter and the C of kernels compute them
/// (MotionRows).
class SeriesProgram {
 public:
  /// The places of a row. The last one is kept by recurrences; sums by fours read the others behind
  /// the last coefficient, which stay 0.
  static constexpr int kStride = 36;

  SeriesProgram() = default;
  /// Makes rows for `trial`, then `others`, and for the variables in `slots`, which have to be all
  /// that occur.
  SeriesProgram(const Graph& graph, const std::vector<Node>& trial, const std::vector<Node>& others,
                const std::vector<int>& slots);

  /// The row of output n.
  int output(int n) const { return outputs_[static_cast<std::size_t>(n)]; }
  /// True when the row depends on an acceleration.
  bool isAccelerated(int row) const { return accelerated_[static_cast<std::size_t>(row)] != 0; }

  /// The last coefficient of a row that is a polynomial of s; otherwise a number beyond all orders.
  int degree(int row) const { return degree_[static_cast<std::size_t>(row)]; }
  /// Adds the structure of the C: equal words mean the same C but for its numbers.
  void addStructure(std::vector<int>* words) const;
  int rowCount() const { return static_cast<int>(degree_.size()); }
  /// The order of series along parabolas of the variables.
  static constexpr int kAlong = 8;
  /// The operations that determine the outputs, in order, with their operand rows.
  const std::vector<SeriesOperation>& resolved() const { return resolved_; }

 private:
  friend class SeriesCompiler;
  friend class variator_sim::MotionRows;

  enum class Code : std::uint8_t {
    kLinear,
#define VARIATOR_SIM_CODE(code, kind, call) code,
    VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_CODE)
#undef VARIATOR_SIM_CODE
        kTable,
    kTable2,
    kOpaque
  };
  struct Instruction {
    Code code = Code::kLinear;
    int result = -1;
    int operands[4] = {-1, -1, -1, -1};
    int aux[2] = {-1, -1};  ///< further rows, or terms and their count
    int state = -1;         ///< of states_: the mode
    int ends = 0;           ///< the last order with coefficients other than 0
    int last = 0;           ///< the last coefficient of operand 1, a rate
    bool is_tried = false;  ///< the first outputs follow from it
    double constant = 0.0;
  };
  struct Term {
    int row;
    double factor;
  };
  /// A table, and the derivative of it that is looked up; or an opaque function.
  struct Piece {
    std::shared_ptr<const OpaqueFunction> function;
    std::shared_ptr<const Table> table;
    int order[2] = {};
    int degree[2] = {};  ///< of the remaining polynomial
  };

  static constexpr int kNoDegree = 1 << 20;

  std::vector<int> rowsReadBy(const Instruction& it) const;
  /// Marks the instructions that the rows in `open` follow from.
  std::vector<bool> findNeeded(std::vector<int> open) const;

  SeriesOperation operationOf(const Instruction& it) const;
  std::vector<SeriesOperation> operationsOf(const Instruction& it) const;
  void listResolved();
  /// Finds the degrees of operations along parabolas of the variables: sums and products of these.
  void notePowers();

  std::vector<int> degree_;
  std::vector<char> accelerated_;
  std::vector<bool> has_pole_;  ///< may be infinite without an overflow
  std::vector<Instruction> instructions_;
  std::vector<SeriesOperation> resolved_;
  std::vector<Term> terms_;
  int states_ = 0;                  ///< the number of modes
  std::vector<int> accelerations_;  ///< their rows
  std::vector<Piece> pieces_;
  std::vector<int> outputs_;
  std::vector<int> variables_;
  std::vector<std::pair<int, double>> constants_;  ///< row and value
};

}  // namespace variator_sim::expression
