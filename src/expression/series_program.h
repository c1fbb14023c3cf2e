/// Formulas along a motion as power series: the coefficients of every node, one order after the
/// other.
///
/// Of y = f(x, ..) with series x_0 + x_1 s + x_2 s^2 + .. the coefficient y_n follows from those of
/// the operands up to n and of y up to n - 1 (Moore; Jorba and Zou: A software package for the
/// numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14
/// (2005) 99-117):
///     y = a b        y_n = sum_{j=0..n} a_j b_{n-j}
///     y = a / b      y_n = (a_n - sum_{j=1..n} b_j y_{n-j}) / b_0
///     y' = x' w      y_n = 1/n sum_{j=1..n} j x_j w_{n-j}   (exp: w = y; sin, cos; tanh: w =
///     1-y^2) y' = p / w     y_n = q_{n-1} / n,  q = p / w           (log, atan, asin, ..)
/// Branches (abs, min, a piece of a table) are those of the state at s = 0, and of the direction
/// into which it moves where that lies on an edge.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "expression/series_operation.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

struct CodeStructure;
namespace plain {
class SeriesInterpreter;
}
namespace fused {
class SeriesInterpreter;
}

/// Who finds the accelerations of an order.
class AccelerationSolver {
 public:
  /// Sets coefficient n of the accelerations; so far they are 0, and the first outputs are known of
  /// that. [loop]
  virtual void solve(int n) = 0;

 protected:
  ~AccelerationSolver() = default;
};

/// The rows of coefficients of a set of formulas. One is used by one thread at a time.
class SeriesProgram {
 public:
  /// Which nodes are made: those that read no acceleration; those that do and are needed by the
  /// first outputs; all that do.
  enum class Part { kGiven, kTrial, kAccelerated };

  /// True when all of `nodes` have series: no function in them is opaque.
  static bool hasSeries(const Graph& graph, const std::vector<Node>& nodes) {
    return !graph.hasOpaque(nodes);
  }

  SeriesProgram() = default;
  /// Rows for `trial`, then `others`, and for the variables in `slots`, all those that occur, of
  /// coefficients 0 to `order`.
  SeriesProgram(const Graph& graph, const std::vector<Node>& trial, const std::vector<Node>& others,
                const std::vector<int>& slots, int order);

  /// The largest order there is room for.
  int order() const { return capacity_ - kPad - 1; }
  /// The row of output n, of the n-th of `slots`.
  int output(int n) const { return outputs_[static_cast<std::size_t>(n)]; }
  int variable(int n) const { return variables_[static_cast<std::size_t>(n)]; }
  /// True when all coefficients but the first are 0.
  bool isConstant(int row) const { return degree_[static_cast<std::size_t>(row)] == 0; }
  /// True when it reads an acceleration.
  bool isAccelerated(int row) const { return accelerated_[static_cast<std::size_t>(row)] != 0; }

  /// Coefficient n of a variable. [loop]
  void set(int row, int n, double value) { write(row, n, value); }
  /// The coefficients of a row, 0 first.
  const double* coefficients(int row) const { return forward(row); }
  /// The last coefficient of a row that is a polynomial of s; a number beyond all orders of others.
  int degree(int row) const { return degree_[static_cast<std::size_t>(row)]; }
  /// Where coefficient 0 stands of the row written backwards; zeros follow it.
  const double* backward(int row) const { return forward(row) + width_ + capacity_ - 1 - kPad; }
  /// Coefficient 0 of the nodes of kGiven or kAccelerated; those of the variables are there. [loop]
  void begin(Part part);
  /// Coefficient n > 0 of all nodes; those of the variables are there, of accelerations 0. What has
  /// been tried with them is corrected for those that `solver` finds: a product a b by
  /// a_0 b_n + a_n b_0, a sum by what its terms have become more. [loop]
  /// `corrects`: false where nobody asks for that.
  void extend(int n, bool corrects, AccelerationSolver& solver);
  /// What the C is made from. Its constants are those of `const double* c` there.
  void addStructure(CodeStructure* structure) const;
  /// The statements of C that `extend` carries out of a part, of `double* r` and
  /// `double* s`, and what stands before them. The rows that they read backwards are added to
  /// `mirrored`: no others need be written so.
  std::string writeCode(Part part, std::set<int>* mirrored) const;
  /// Those of order 0 of a part; what they leave in `int limit` is for noteLimit. Not of tables.
  std::string writeBegin(Part part) const;
  bool readsTables() const { return !pieces_.empty(); }
  /// True where some coefficients depend on which branch is taken.
  bool hasBranches() const;
  void noteLimit(bool is_reached) { has_limit_[series_] = is_reached; }
  /// True where some function of this series has reached its limit: see isAtLimit.
  bool hasLimit() const { return has_limit_[series_]; }
  static std::string codePrelude();
  /// `convolveOld` as C, n being C.
  std::string writeConvolution(int a, int b, const std::string& n, std::set<int>* mirrored) const;
  /// What stands before the statement that writes a row backwards, and before all functions.
  static std::string writeMirror(int row);
  std::string writeMirrors(const std::set<int>& mirrored) const;
  double* rows() { return rows_.data() + rows_begin_; }
  const double* rows() const { return rows_.data() + rows_begin_; }
  double* states() { return states_.data() + states_begin_; }
  const double* states() const { return states_.data() + states_begin_; }
  std::size_t rowsSize() const { return rows_.size() / 2; }
  std::size_t statesSize() const { return states_.size() / 2; }
  int rowCount() const { return static_cast<int>(degree_.size()); }
  /// There is room for two series of the same formulas, one of which is used: the other one is from
  /// now on. Not of tables.
  void turn() {
    series_ = 1 - series_;
    rows_begin_ = rows_.size() / 2 - rows_begin_;
    states_begin_ = states_.size() / 2 - states_begin_;
  }
  /// The offset of coefficient 0 of a row in rows(), and of the row written backwards.
  std::size_t offset(int row) const { return static_cast<std::size_t>(row) * 2 * width_; }
  std::size_t backwardOffset(int row) const {
    return offset(row) + width_ + static_cast<std::size_t>(capacity_ - 1 - kPad);
  }
  /// False while the piece of some table is not known yet, or a part has overflowed: code cannot
  /// find that out.
  bool isDecided() const {
    return !hasLimit() && std::all_of(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
      return piece.side[0] != 0 && (piece.table2 == nullptr || piece.side[1] != 0);
    });
  }

  /// True where no output hides more than is allowed for its row between 0 and `theta`: see
  /// series_resolution.inc; `at`: SeriesResolution::at, or nullptr. [loop]
  bool isResolved(double theta, int order, const SeriesOutputs& outputs,
                  const double* const* at) const;
  /// True where an operation may hide more than it shows up to `theta`, whose powers are given.
  /// [loop]
  bool mayHide(int order, const double* powers) const;
  /// The order of series along parabolas of the variables.
  static constexpr int kAlong = 8;
  /// True where some function along parabolas of the variables is no polynomial of that order.
  bool canHide() const { return !hiding_.empty(); }
  /// Keeps the arguments of these functions, of which coefficients 0 are known, and the variables.
  /// [loop]
  void noteArguments();
  /// True where the variables are those of the last noteArguments, but for rounding. [loop]
  bool areArgumentsNoted() const;
  /// True where one of them has moved so far from where it was noted that its function may hide
  /// something between. [loop]
  bool haveArgumentsGoneFar() const;
  /// The operations that the outputs follow from, in order, with the rows they read.
  const std::vector<SeriesOperation>& resolved() const { return resolved_; }

  /// After coefficients that are not finite: what they leave in sums. [loop]
  void clear();

 private:
  friend class SeriesCompiler;
  friend class SeriesWriter;
  friend class SeriesArranger;
  friend class plain::SeriesInterpreter;
  friend class fused::SeriesInterpreter;

  enum class Code : std::uint8_t {
    kLinear,
    kMultiply,
    kSquare,
    kDivide,
    kRate,       ///< d_{n-1} = n x_n
    kExp,        ///< y, D = rate of a
    kSinCos,     ///< y, z, D
    kSinhCosh,   ///< y, z, D
    kTan,        ///< y, w = 1 + y^2, D
    kTanh,       ///< y, w = 1 - y^2, D
    kPrimitive,  ///< y' = p / w by q
    kWronskian,  ///< a b' - b a'
    kSqrt,
    kPower,  ///< a^k
    kAbs,
    kSign,
    kMin,
    kMax,
    kSelect,
    kWhereFinite,
    kTable,
    kTable2
  };
  /// Which function a kPrimitive begins with.
  enum class Begin : std::uint8_t { kLog, kAtan, kAsin, kAcos, kAtan2 };
  struct Instruction {
    Code code = Code::kLinear;
    Begin begin = Begin::kLog;
    int result = -1;
    int operands[4] = {-1, -1, -1, -1};
    int aux[2] = {-1, -1};  ///< further rows, or terms and their count
    int state = -1;         ///< in states_: what order 0 has found out
    bool is_tried = false;  ///< by kTrial
    double constant = 0.0;
  };
  struct Term {
    int row;
    double factor;
  };
  /// What is done from order 1 on: an instruction with its kind and its places found out. What the
  /// operands are of which kind, SeriesArranger says.
  struct Operation {
    enum class Kind : std::uint8_t {
      kSumOfOne,
      kSumOfTwo,
      kSum,           ///< terms a to b - 1
      kProduct,       ///< of two that end nowhere
      kShortProduct,  ///< of two of which one is a polynomial
      kSquare,
      kQuotient,
      kRate,
      kExp,
      kPair,
      kTangent,
      kPower,
      kSqrt,
      kPrimitive,
      kOther,  ///< an instruction's branch, table or Wronskian
      kSolve,  ///< what comes after it, corrects
      // Of what kTrial has made.
      kBefore,     ///< the change of `row` is counted from here
      kAfter,      ///< to here
      kAppearing,  ///< all of `row` is a change
      kChangeOfProduct,
      kChangeOfFirst,   ///< b has not changed
      kChangeOfSecond,  ///< a has not changed
      kChangeOfSum
    };
    Kind kind = Kind::kOther;
    int instruction = -1;
    int result = 0;  ///< where coefficient 0 stands
    int a = 0;       ///< the same
    int b = 0;
    int c = 0;
    int limits[2] = {};  ///< the last coefficients of the operands
    int rows[3] = {};    ///< result and operands
    double factors[2] = {};
  };
  struct PlacedTerm {
    int at;
    double factor;
  };
  /// Of a table: its piece, and rows of powers.
  struct Piece {
    std::shared_ptr<const Table> table;
    std::shared_ptr<const Table2> table2;
    int order[2] = {};
    int degree[2] = {};    ///< of what is left of the polynomial
    int a = -1;            ///< in states_: 6 i + j of (x - x_0)^i (y - y_0)^j
    int side[2] = {};      ///< of x_0 and y_0: where the motion goes, 0 as long as it stands
    int powers_x[6] = {};  ///< rows from the second power on
    int powers_y[6] = {};  ///< the same
    int sums[6] = {};      ///< sum_j a_ij (y - y_0)^j
  };

  static constexpr int kPad = 4;
  static constexpr int kNoDegree = 1 << 20;
  /// Rows that end there or before it are not written beyond it.
  static constexpr int kLongest = 2;

  double* forward(int row) { return rows_.data() + rows_begin_ + offset(row); }
  const double* forward(int row) const { return rows_.data() + rows_begin_ + offset(row); }
  void write(int row, int n, double value) {
    double* const at = forward(row);
    at[n] = value;
    at[width_ + static_cast<std::size_t>(capacity_ - 1 - kPad - n)] = value;
  }
  double& state(const Instruction& it) {
    return states_[states_begin_ + static_cast<std::size_t>(it.state)];
  }

  SeriesOperation operationOf(const Instruction& it) const;
  void listResolved();
  SeriesResolution resolution(int order) const;
  /// What a row that kTrial has made, or an acceleration, has become more.
  double& change(int row) { return changes_[static_cast<std::size_t>(row)]; }
  double beginPrimitive(const Instruction& it) const;
  /// 1/(1 + exp(x)) where exp overflows, atan, ..: the function has reached its limit for an
  /// operand that has overflowed, and stays there (as its derivatives do: graph.h).
  bool isAtLimit(int operand, int result) const;
  /// The coefficients of a table's piece, of which order 0 needs the first one alone.
  void placePiece(const Instruction& it, Piece& piece, int order);

  int capacity_ = 0;            ///< coefficients of a row, padding included
  std::size_t width_ = 0;       ///< the same
  std::vector<double> rows_;    ///< of both series
  std::size_t series_ = 0;      ///< the one that is used
  std::size_t rows_begin_ = 0;  ///< of its
  std::size_t states_begin_ = 0;
  std::array<bool, 2> has_limit_ = {};
  std::vector<int> degree_;
  std::vector<char> accelerated_;
  std::vector<bool> has_pole_;  ///< may be infinite without an overflow
  std::vector<Instruction> instructions_;
  std::array<std::vector<int>, 3> programs_;
  /// Of an order up to kLongest, and of those beyond it.
  std::array<std::vector<Operation>, 2> operations_;
  std::vector<PlacedTerm> placed_;
  std::vector<SeriesOperation> resolved_;
  mutable std::vector<SeriesRange> ranges_;  ///< room for isResolved, of each row
  std::vector<SeriesOperation> hiding_;      ///< those of resolved_ that canHide means
  std::vector<double> arguments_;            ///< a, b and second of each of them, variables
  std::vector<Term> terms_;
  std::vector<double> states_;
  std::vector<double> changes_;     ///< of the rows
  std::vector<int> accelerations_;  ///< their rows
  std::vector<Piece> pieces_;
  std::vector<int> outputs_;
  std::vector<int> variables_;
  std::vector<std::pair<int, double>> constants_;  ///< row and value
};

}  // namespace variator_sim::expression
