/// Scalar formulas as a graph in which equal subexpressions are one node, and their exact
/// derivatives. Everything here happens while a scene is loaded; tape.h evaluates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "variator_sim/expression/opaque_function.h"
#include "variator_sim/table.h"

namespace variator_sim::expression {

/// A subexpression of one Graph. Copies are free; a node is meaningless in another graph.
struct Node {
  int index = -1;
};
inline bool operator==(Node a, Node b) {
  return a.index == b.index;
}
inline bool operator!=(Node a, Node b) {
  return a.index != b.index;
}

enum class Operation : std::uint8_t {
  kConstant,
  kVariable,
  kNegate,
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kPower,
  kSin,
  kCos,
  kTan,
  kAsin,
  kAcos,
  kAtan,
  kAtan2,
  kSinh,
  kCosh,
  kTanh,
  kExp,
  kLog,
  kSqrt,
  kAbs,
  kSign,
  kMin,
  kMax,
  kTable,       ///< a derivative of a table of one variable at a
  kTable2,      ///< the same of two variables, at (a, b)
  kOpaque,      ///< a function of the user's own at (a, ..)
  kSelect,      ///< a <= b ? c : d
  kWhereFinite  ///< b, but 0 where a is infinite and NaN where a is; written by derivatives only
};

/// Number of operands: 0 for constants and variables, 4 for kSelect and for kOpaque, which repeats
/// its last argument.
int operandCount(Operation operation);

/// x^exponent for an exponent that is a constant: x^n = (x^(n/2))^2 for even n, x^(n-1) x for odd
/// n, x^-n = 1/x^n for integers up to 16 in size (at most |n| - 1 rounded products, so a relative
/// error below |n| units of round-off), std::pow otherwise.
double powerOf(double x, double exponent);
/// Returns the value of an operation with `operandCount` operands as at run time; not for tables
/// and kOpaque.
double evaluateOperation(Operation operation, const double* operands);

/// The graph. Makers return the existing node when the same subexpression was made before, compute
/// constants as run time would, and simplify; the value of a node made by them is, bit by bit, the
/// value of the formula as it is written (but for the sign of a zero, which only 1/0 and atan2 can
/// show). They keep 0*x, 0/x and x - x, which are NaN if x is not finite; derivatives, whose zeros
/// hold everywhere, simplify them. Operands precede their users: their indices are smaller.
class Graph {
 public:
  struct Entry {
    Operation operation = Operation::kConstant;
    int operands[4] = {-1, -1, -1, -1};
    int slot = -1;       ///< of kVariable; index of a table or function of the graph
    double value = 0.0;  ///< of kConstant
    int order[2] = {};   ///< of the derivative: for kTable by a, for kTable2 by a and b
  };
  /// The rate of the variable in a slot, for totalDerivative, or its value, for substitute.
  using Rate = std::pair<int, Node>;

  Node constant(double value);
  /// The variable in `slot` (not negative); the caller defines the meaning of slots.
  Node variable(int slot);

  Node negate(Node a);
  Node add(Node a, Node b);
  Node subtract(Node a, Node b);
  Node multiply(Node a, Node b);
  Node divide(Node a, Node b);
  Node power(Node base, Node exponent);
  Node minimum(Node a, Node b) { return make(Operation::kMin, a, b); }
  Node maximum(Node a, Node b) { return make(Operation::kMax, a, b); }
  /// The derivative of this order of a table at x or (x, y); 0 if the order exceeds that of its
  /// polynomials.
  Node table(const std::shared_ptr<const Table>& table, Node x, Node y = {},
             Table::Order order = {});
  /// `function` of as many `arguments` as it has. Its derivatives are functions of their own
  /// (opaque_slope.h), those of these differences.
  Node opaque(const std::shared_ptr<const OpaqueFunction>& function, const Node (&arguments)[4]);
  /// Makes left <= right ? yes : no; NaN when left and right cannot be compared.
  Node select(Node left, Node right, Node yes, Node no);
  /// Makes any operation with operands, simplified as by the maker of its name. Unused operands are
  /// omitted: make(Operation::kSin, x). Not for tables and kOpaque.
  Node make(Operation operation, Node a, Node b = {}, Node c = {}, Node d = {});

  /// The exact partial derivative by the variable in `slot`. Kinks: |x|' = sign(x) x', the
  /// derivative of sign is 0, that of min and max is the active operand's (the first one's in a
  /// tie).
  ///
  /// It has a value wherever the formula has one, even if exp, sinh, cosh or c^x in it overflow or
  /// nearly do. 1/(1 + exp(x)) is 0 there to all digits, and so is its derivative, though its parts
  /// are inf/inf^2: contributions through an infinite part into a quotient, atan, .. vanish. And
  /// exp(x) x' may overflow before exp(x): derivatives of such formulas are made in the scale
  /// 2^-100.
  Node differentiate(Node node, int slot);
  /// The sum of (partial derivative by slot) times (rate of slot), made in one sweep. Variables
  /// without a rate are held constant.
  Node totalDerivative(Node node, const std::vector<Rate>& rates);

  /// Returns `node` with each variable in the slots of `values` replaced by its value.
  Node substitute(Node node, const std::vector<Rate>& values);

  bool isConstant(Node node) const { return entry(node).operation == Operation::kConstant; }
  /// True for the constants that equal `value`.
  bool isConstant(Node node, double value) const {
    return isConstant(node) && entry(node).value == value;
  }
  /// The value of a node for which isConstant holds.
  double constantValue(Node node) const { return entry(node).value; }
  /// True when the variable in `slot` occurs in `node`, or in one of `nodes`.
  bool dependsOn(Node node, int slot) const { return dependsOn(std::vector<Node>{node}, slot); }
  bool dependsOn(const std::vector<Node>& nodes, int slot) const;
  /// True when a constant that is NaN or infinite occurs in one of `nodes`.
  bool hasNonFiniteConstant(const std::vector<Node>& nodes) const;

  /// The table of an entry of kTable or kTable2.
  const std::shared_ptr<const Table>& tableOf(const Entry& entry) const {
    return tables_[static_cast<std::size_t>(entry.slot)];
  }
  /// The function of an entry of kOpaque.
  const std::shared_ptr<const OpaqueFunction>& opaqueOf(const Entry& entry) const {
    return functions_[static_cast<std::size_t>(entry.slot)];
  }
  /// True when one of `nodes` needs an opaque function, which has no series and no text.
  bool hasOpaque(const std::vector<Node>& nodes) const;
  /// True when one of `nodes` needs a second derivative of such a function, which is a difference.
  bool hasDifference(const std::vector<Node>& nodes) const;
  const Entry& entry(Node node) const { return entries_[static_cast<std::size_t>(node.index)]; }
  /// Limits the numbers and names of all formulas parsed into this graph: the time of loading a
  /// scene grows with them.
  void limitOperands(int most) { most_operands_ = most; }
  int mostOperands() const { return most_operands_; }
  /// Counts an operand that stands in a formula; false when there are too many.
  bool countOperand() { return ++operands_ <= most_operands_; }
  /// Counts an element that holds and returns its number, from 0.
  int countHold() { return holds_++; }
  /// Number of nodes; all indices are below it.
  int size() const { return static_cast<int>(entries_.size()); }
  /// Lists the indices of needed nodes, ascending: operands come first. The time is proportional to
  /// the list, not to the graph.
  std::vector<int> listReachable(const std::vector<Node>& nodes) const;

 private:
  /// Properties of a node's value that follow from its form.
  struct Traits {
    bool is_positive = false;      ///< > 0 except for underflow
    bool is_not_negative = false;  ///< >= 0
    bool has_growth = false;       ///< exp, sinh, cosh or c^x occurs
    bool may_overflow = false;     ///< through growth
    bool may_have_pole = false;    ///< may be infinite for another reason
  };
  struct EntryHash {
    std::size_t operator()(const Entry& entry) const;
  };
  struct EntryEqual {
    bool operator()(const Entry& a, const Entry& b) const;
  };
  /// Derivatives of nodes by index; absent ones are Node{}.
  using Derivatives = std::vector<Node>;

  /// Tells whether one of `nodes` needs an entry of which `is` is true.
  template <class Is>
  bool anyReachable(const std::vector<Node>& nodes, Is is) const;
  /// Makes the node of `entry` with other operands.
  Node remake(const Entry& entry, const Node (&operands)[4]);
  Node intern(const Entry& entry);
  Node internOperation(Operation operation, Node a, Node b = {}, Node c = {}, Node d = {});
  Node operand(Node node, int position) const { return {entry(node).operands[position]}; }
  void deriveInto(Node node, const std::vector<Rate>& rates, Derivatives& derivatives);
  Node deriveOne(Node node, const std::vector<Rate>& rates, const Derivatives& derivatives);
  Node deriveFunction(Node node, Node da);
  Node derivePower(Node node, Node da, Node db);
  Node deriveTable(const Entry& it, Node da, Node db);
  Node deriveOpaque(const Entry& it, const Derivatives& derivatives);
  /// The derivative of `function` by argument `by` as a function.
  std::shared_ptr<const OpaqueFunction> slopeOf(
      const std::shared_ptr<const OpaqueFunction>& function, int by);
  // Makers for derivatives. A factor that is zero by the rules of differentiation removes its
  // product, and constant factors are gathered.
  Node product(Node a, Node b);
  Node quotient(Node a, Node b);
  Node difference(Node a, Node b);
  /// Returns `derivative`, that of `node`, for a function with a limit for infinite `node`.
  Node insideLimit(Node node, Node derivative);
  Node whereFinite(Node node, Node value);

  Traits findTraits(const Entry& entry) const;
  /// Finds the sign, and the growth, from the traits of all operands and of any one.
  void findSign(const Entry& entry, const Traits& all, const Traits& some, Traits* made) const;
  void findGrowth(const Entry& entry, Traits* made) const;
  const Traits& traits(Node node) const { return traits_[static_cast<std::size_t>(node.index)]; }
  /// The factor of the derivatives of `node` while they are made.
  double scaleFor(Node node) const;

  std::vector<Entry> entries_;
  std::vector<Traits> traits_;  ///< traits of the entries
  std::unordered_map<Entry, int, EntryHash, EntryEqual> index_of_;
  std::vector<std::shared_ptr<const Table>> tables_;
  std::vector<std::shared_ptr<const OpaqueFunction>> functions_;
  std::map<std::pair<int, double>, Derivatives> partials_;  ///< by slot and scale
  int operands_ = 0;                                        ///< operands of formulas as written
  int most_operands_ = std::numeric_limits<int>::max();
  int holds_ = 0;
};

}  // namespace variator_sim::expression
