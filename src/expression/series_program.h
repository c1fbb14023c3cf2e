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
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_functions.h"
#include "expression/series_operation.h"
#include "expression/series_tables.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// The rows of coefficients of a set of formulas, and the instructions that compute them, one for
/// each row or two: calls of the functions of runtime/operations.h and tables.h, which the
/// interpreter executes and kernels and emitted programs have as text.
class SeriesProgram {
 public:
  /// The places of a row. The last one is kept by recurrences; sums by fours read the others behind
  /// the last coefficient, which stay 0.
  static constexpr int kStride = 36;
  /// The order of series along parabolas of the variables.
  static constexpr int kAlong = 8;
  static constexpr int kNoDegree = 1 << 20;

  using Code = SeriesCode;
  /// The function of the runtime that holds an instruction: vs_given (no accelerations), vs_tried
  /// (with accelerations, and constraints read it), vs_rest (others with accelerations), vs_at_once
  /// (needed at order 0 only). vs_corrected has the changes of vs_tried.
  enum class Part { kGiven, kTried, kRest, kAtOnce };
  struct Instruction {
    Code code = Code::kLinear;
    int result = -1;
    int operands[4] = {-1, -1, -1, -1};
    int aux[2] = {-1, -1};  ///< further rows, or terms and their count
    double constant = 0.0;
    std::shared_ptr<const OpaqueFunction> function;
    int mode = -1;   ///< the first of its modes
    int piece = -1;  ///< of a table or an opaque function: the first of its places
    int table = -1;  ///< index in tables()
    int rows = -1;   ///< of a table: the first of its further rows
    int ends = 0;    ///< the last order with coefficients other than 0
    int last = 0;    ///< the last coefficient of operand 1, a rate
    int limit = -1;  ///< a row; where it has overflowed the function may stay at its limit
    Part part = Part::kAtOnce;
    bool hasTwoResults() const { return code == Code::kSinCos || code == Code::kSinhCosh; }
  };
  struct Term {
    int row;
    double factor;
  };

  /// Makes rows for `outputs` and for the variables in `slots`, which have to be all that occur.
  /// The first `tried` outputs are those that constraints read, the first `series` ones are needed
  /// as series, the others at order 0.
  SeriesProgram(const Graph& graph, const std::vector<Node>& outputs, std::size_t tried,
                std::size_t series, const std::vector<int>& slots);
  SeriesProgram(const SeriesProgram&) = delete;
  SeriesProgram& operator=(const SeriesProgram&) = delete;

  int rowOf(Node output) const { return row_of_.at(output.index); }
  /// True when the row depends on an acceleration.
  bool isAccelerated(int row) const { return accelerated_[static_cast<std::size_t>(row)] != 0; }
  /// The last coefficient of a row that is a polynomial of s; otherwise a number beyond all orders.
  int degree(int row) const { return degree_[static_cast<std::size_t>(row)]; }
  /// The instructions of a part, in order.
  const std::vector<const Instruction*>& instructions(Part part) const {
    return parts_[static_cast<std::size_t>(part)];
  }
  const std::vector<DenseTable>& tables() const { return tables_; }
  /// Rows with a value that never changes.
  const std::vector<std::pair<int, double>>& constants() const { return constants_; }
  /// Terms of sums: those of an instruction from aux[0] on, aux[1] of them.
  const std::vector<Term>& terms() const { return terms_; }
  /// The rows of the accelerations.
  const std::vector<int>& accelerations() const { return accelerations_; }
  /// The operations that determine the outputs that are series, in order, with their operand rows.
  const std::vector<SeriesOperation>& resolved() const { return resolved_; }
  int rows() const { return rows_; }
  int modes() const { return modes_; }
  int pieces() const { return pieces_; }
  /// Returns vs_numbers::constants: factors of terms, then constants of instructions.
  std::vector<double> numbers() const;
  /// The place of an instruction's constant there.
  std::size_t placeOf(const Instruction& it) const {
    return terms_.size() + static_cast<std::size_t>(&it - instructions_.data());
  }

 private:
  friend class SeriesCompiler;

  std::vector<int> rowsReadBy(const Instruction& it) const;
  /// Marks the instructions that the first `count` outputs follow from.
  std::vector<bool> findNeeded(std::size_t count) const;
  /// Completes the instructions by what follows from the rows of all.
  void findPlaces(std::size_t tried, std::size_t series);
  /// Returns a row by whose overflow the function may stay at a limit, or -1; `grows`: rows that
  /// may overflow by an exp.
  int limitOf(const Instruction& it, const std::vector<bool>& grows) const;

  std::vector<SeriesOperation> operationsOf(const Instruction& it) const;
  void listResolved();
  /// Finds the degrees of operations along parabolas of the variables: sums and products of these.
  void notePowers();

  std::vector<int> degree_;
  std::vector<char> accelerated_;
  std::vector<bool> has_pole_;  ///< may be infinite without an overflow
  std::vector<Instruction> instructions_;
  std::vector<const Instruction*> parts_[4];
  std::vector<SeriesOperation> resolved_;
  std::vector<Term> terms_;
  std::vector<DenseTable> tables_;
  std::vector<int> accelerations_;  ///< their rows
  std::vector<int> outputs_;        ///< likewise
  std::map<int, int> row_of_;       ///< of outputs, by node
  std::vector<int> variables_;
  std::vector<std::pair<int, double>> constants_;  ///< row and value
  int rows_ = 0;
  int modes_ = 0;
  int pieces_ = 0;
};

}  // namespace variator_sim::expression
