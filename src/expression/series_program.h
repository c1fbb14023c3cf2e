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

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "expression/series_functions.h"
#include "expression/series_operation.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim {
class MotionRows;
}
namespace variator_sim::expression {

struct CodeStructure;
namespace plain {
class SeriesInterpreter;
}
namespace fused {
class SeriesInterpreter;
}

/// Solves for the accelerations of an order.
class AccelerationSolver {
 public:
  /// Sets coefficient n of the accelerations; the first outputs are known for the coefficient 0.
  /// [loop]
  virtual void solve(int n) = 0;

 protected:
  ~AccelerationSolver() = default;
};

/// The rows of coefficients of a set of formulas. One thread may use it at a time.
class SeriesProgram {
 public:
  /// The places of a row. The last one is kept by recurrences; sums by fours read the others behind
  /// the last coefficient, which stay 0.
  static constexpr int kStride = 36;

  /// Groups of nodes: without accelerations; with accelerations and needed by the first outputs;
  /// all with accelerations; those that the arguments of noteArguments follow from.
  enum class Part { kGiven, kTrial, kAccelerated, kArguments };

  /// True when all of `nodes` have series: no function in them is opaque.
  static bool hasSeries(const Graph& graph, const std::vector<Node>& nodes) {
    return !graph.hasOpaque(nodes);
  }

  SeriesProgram() = default;
  /// Makes rows of coefficients 0 to `order` for `trial`, then `others`, and for the variables in
  /// `slots`, which have to be all that occur.
  SeriesProgram(const Graph& graph, const std::vector<Node>& trial, const std::vector<Node>& others,
                const std::vector<int>& slots, int order);

  /// The largest order.
  int order() const { return kStride - kPad - 1; }
  /// The row of output n, and of the n-th of `slots`.
  int output(int n) const { return outputs_[static_cast<std::size_t>(n)]; }
  int variable(int n) const { return variables_[static_cast<std::size_t>(n)]; }
  /// True when all coefficients but the first are 0.
  bool isConstant(int row) const { return degree_[static_cast<std::size_t>(row)] == 0; }
  /// True when the row depends on an acceleration.
  bool isAccelerated(int row) const { return accelerated_[static_cast<std::size_t>(row)] != 0; }

  /// Coefficient n of a variable. [loop]
  void set(int row, int n, double value) { write(row, n, value); }
  /// The coefficients of a row, 0 first.
  const double* coefficients(int row) const { return forward(row); }
  /// The last coefficient of a row that is a polynomial of s; otherwise a number beyond all orders.
  int degree(int row) const { return degree_[static_cast<std::size_t>(row)]; }
  /// Computes coefficient 0 of the nodes of a part from those of the variables. kArguments is no
  /// beginning of a series.
  /// [loop]
  void begin(Part part);
  /// Computes coefficient n > 0 of all nodes from those of the variables, 0 for accelerations.
  /// Then, unless `corrects` is false, the nodes are corrected for the accelerations of `solver`: a
  /// product a b by a_0 b_n + a_n b_0, a sum by the changes of its terms. [loop]
  void extend(int n, bool corrects, AccelerationSolver& solver);
  /// Adds the structure of the C; its constants are those of `const double* c` there.
  void addStructure(CodeStructure* structure) const;
  /// Writes the C of `begin` and `extend` as functions of the order n: series_given, series_trial,
  /// series_corrected (nodes of the trial, for the accelerations of order n > 0) and series_rest,
  /// on `vs_row* r` and `Real* s`. At order 0 they add functions at their limit to `*limit`.
  std::string writeCode() const;
  bool readsTables() const { return !pieces_.empty(); }
  /// True if some coefficients depend on modes.
  bool hasBranches() const;
  void noteLimit(bool is_reached) { has_limit_[series_] = is_reached; }
  /// True if some function of this series has reached its limit: see isAtLimit.
  bool hasLimit() const { return has_limit_[series_]; }
  /// Returns the text of the recurrences, for rows of `stride` places, and for numbers or for
  /// `lanes`, which defines their numbers.
  static std::string codePrelude(const std::string& stride, const char* lanes = nullptr);
  double* rows() { return rows_.data() + rows_begin_; }
  const double* rows() const { return rows_.data() + rows_begin_; }
  double* states() { return states_.data() + states_begin_; }
  const double* states() const { return states_.data() + states_begin_; }
  std::size_t rowsSize() const { return rows_.size() / 2; }
  std::size_t statesSize() const { return states_.size() / 2; }
  int rowCount() const { return static_cast<int>(degree_.size()); }
  /// Switches to the other one of two series of the same formulas. Not for tables.
  void turn() {
    series_ = 1 - series_;
    rows_begin_ = rows_.size() / 2 - rows_begin_;
    states_begin_ = states_.size() / 2 - states_begin_;
  }
  /// The offset of coefficient 0 of a row in rows().
  std::size_t offset(int row) const { return static_cast<std::size_t>(row) * kStride; }
  /// False while the piece of some table is unknown, or a part has overflowed: code cannot detect
  /// that.
  bool isDecided() const {
    return !hasLimit() && std::all_of(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
      return piece.side[0] != 0 && (piece.table2 == nullptr || piece.side[1] != 0);
    });
  }

  /// True if no output has more unresolved than its row allows between 0 and `theta`: see
  /// series_resolution.inc; `at`: SeriesResolution::at, or nullptr. [loop]
  bool isResolved(double theta, int order, const SeriesOutputs& outputs,
                  const double* const* at) const;
  /// True if an operation's unresolved terms may exceed its visible ones up to the theta of
  /// `powers`. [loop]
  bool mayHide(int order, const double* powers) const;
  /// The order of series along parabolas of the variables.
  static constexpr int kAlong = 8;
  /// True if some function along parabolas of the variables is no polynomial of that order.
  bool canHide() const { return !hiding_.empty(); }
  /// Stores coefficients 0 of the arguments of these functions, and the variables. [loop]
  void noteArguments();
  /// True if the variables are those of the last noteArguments, except for rounding. [loop]
  bool areArgumentsNoted() const;
  /// True if an argument has moved so far from its stored value that its function may be unresolved
  /// between. [loop]
  bool haveArgumentsGoneFar() const;
  /// The operations that determine the outputs, in order, with their operand rows.
  const std::vector<SeriesOperation>& resolved() const { return resolved_; }

  /// Removes coefficients that are not finite from sums. [loop]
  void clear();

 private:
  friend class SeriesCompiler;
  friend class SeriesStatements;
  friend class SeriesWriter;
  friend class variator_sim::MotionRows;
  friend class plain::SeriesInterpreter;
  friend class fused::SeriesInterpreter;

  enum class Code : std::uint8_t {
    kLinear,
#define VARIATOR_SIM_CODE(code, kind, call) code,
    VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_CODE)
#undef VARIATOR_SIM_CODE
        kTable,
    kTable2
  };
  struct Instruction {
    Code code = Code::kLinear;
    int result = -1;
    int operands[4] = {-1, -1, -1, -1};
    int aux[2] = {-1, -1};  ///< further rows, or terms and their count
    int state = -1;         ///< index in states_: the mode
    int ends = 0;           ///< the last order with coefficients other than 0
    int last = 0;           ///< the last coefficient of operand 1, a rate
    bool is_tried = false;  ///< computed by kTrial
    double constant = 0.0;
    /// Offsets of the results and operands, 0 for missing ones.
    int places[6] = {};
  };
  struct Term {
    int row;
    double factor;
  };
  /// The piece of a table, and rows of powers.
  struct Piece {
    std::shared_ptr<const Table> table;
    std::shared_ptr<const Table2> table2;
    int order[2] = {};
    int degree[2] = {};  ///< of the remaining polynomial
    int a = -1;          ///< index in states_: 6 i + j for (x - x_0)^i (y - y_0)^j
    int side[2] = {};    ///< direction of motion from x_0 and y_0, 0 while at rest
    int rows = 0;        ///< the first of the rows of vs_follow or vs_follow_two
  };

  static constexpr int kPad = 4;
  static constexpr int kNoDegree = 1 << 20;

  double* forward(int row) {
    return rows_.data() + rows_begin_ + offset(row);
  }
  const double* forward(int row) const {
    return rows_.data() + rows_begin_ + offset(row);
  }
  void write(int row, int n, double value) {
    forward(row)[n] = value;
  }

  SeriesOperation operationOf(const Instruction& it) const;
  void listResolved();
  SeriesResolution resolution(int order) const;
  /// The change of a row that kTrial has made, or of an acceleration.
  double& change(int row) {
    return changes_[static_cast<std::size_t>(row)];
  }
  /// 1/(1 + exp(x)) where exp overflows, atan, ..: the function has reached its limit for an
  /// operand that has overflowed, and stays there (as its derivatives do: graph.h).
  bool isAtLimit(const Instruction& it) const;
  /// Returns the operands whose overflow brings a function to its limit; -1 for none.
  static std::array<int, 2> limitingOperands(const Instruction& it);
  /// Computes the coefficients of a table's piece; order 0 needs the first one only.
  void placePiece(const Instruction& it, Piece& piece, int order);

  std::vector<double> rows_;    ///< rows of both series
  std::size_t series_ = 0;      ///< index of the current series
  std::size_t rows_begin_ = 0;  ///< of its rows
  std::size_t states_begin_ = 0;
  std::array<bool, 2> has_limit_ = {};
  std::vector<int> degree_;
  std::vector<char> accelerated_;
  std::vector<bool> has_pole_;  ///< may be infinite without an overflow
  std::vector<Instruction> instructions_;
  std::array<std::vector<int>, 4> programs_;
  std::vector<SeriesOperation> resolved_;
  mutable std::vector<SeriesRange> ranges_;  ///< storage of isResolved, by row
  std::vector<SeriesOperation> hiding_;      ///< entries of resolved_ meant by canHide
  std::vector<double> arguments_;            ///< a, b and second of each entry, variables
  std::vector<Term> terms_;
  std::vector<double> states_;
  std::vector<double> changes_;     ///< changes of the rows
  std::vector<int> accelerations_;  ///< their rows
  std::vector<Piece> pieces_;
  std::vector<int> outputs_;
  std::vector<int> variables_;
  std::vector<std::pair<int, double>> constants_;  ///< row and value
};

}  // namespace variator_sim::expression
