// Recursive descent, one function for each rule:
//   formula  = sum
//   sum      = product { ( "+" | "-" ) product }
//   product  = factor { ( "*" | "/" ) factor }
//   factor   = signs power
//   signs    = { "+" | "-" }
//   power    = operand { "^" signs operand }
//   operand  = number | name | call | "(" sum ")"
//   call     = name "(" [ sum { "," sum } ] ")" | "if" "(" sum compare sum "," sum "," sum ")"
//   compare  = "<" | "<=" | ">" | ">="
//   number   = ( digits [ "." [ digits ] ] | "." digits ) [ ( "e" | "E" ) [ "+" | "-" ] digits ]
// White space separates tokens and means nothing. Only parentheses recurse, and they are counted:
// repetitions are loops, so that a long text needs no deep stack.
#include "variator_sim/expression/parser.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "expression/characters.h"
#include "expression/operations.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim::expression {

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr const char* kDelay = "delay";

/// Reads one text. A rule's function consumes the rule's text, makes its nodes and leaves the
/// position at the next token; it throws on an error.
class Parser {
 public:
  Parser(const std::string& text, const SymbolTable& symbols, Graph& graph,
         const NameExplainer& explain, const NamedTables& tables, const DelayMaker& delay)
      : text_(text),
        symbols_(symbols),
        graph_(graph),
        explain_(explain),
        tables_(tables),
        delay_(delay) {}

  Node formula() {
    moveTo(0);
    const Node value = sum();
    if (position_ != text_.size()) failOperator();
    return value;
  }
  const std::set<std::string>& used() const { return used_; }

 private:
  // ---------------------------------------------------------------------------------------- tokens
  /// Moves to `offset` or, from white space, to the token behind it, never in between.
  void moveTo(std::size_t offset) {
    position_ = offset;
    while (position_ < text_.size() && isSpace(text_[position_])) ++position_;
  }

  bool isAt(std::size_t offset, char c) const {
    return offset < text_.size() && text_[offset] == c;
  }
  bool isDigitAt(std::size_t offset) const {
    return offset < text_.size() && isDigit(text_[offset]);
  }

  bool accept(char c) {
    if (!isAt(position_, c)) return false;
    moveTo(position_ + 1);
    return true;
  }

  /// Returns the end of the name that begins at `offset`.
  std::size_t endOfName(std::size_t offset) const {
    while (offset < text_.size() && (isNameStart(text_[offset]) || isDigit(text_[offset]))) {
      ++offset;
    }
    return offset;
  }

  bool beginsNumber(std::size_t offset) const {
    return isDigitAt(offset) || (isAt(offset, '.') && isDigitAt(offset + 1));
  }

  [[noreturn]] void fail(std::size_t where, const std::string& message) const {
    throw ExpressionError(message, text_, columnOf(text_, where));
  }

  /// Returns the token at `where`: a name, a number or one character.
  std::string piece(std::size_t where) const {
    std::size_t end = where + 1;
    if (isNameStart(text_[where])) {
      end = endOfName(end);
    } else if (isDigit(text_[where])) {
      while (isDigitAt(end) || isAt(end, '.')) ++end;
    } else {
      while (end < text_.size() && continuesCharacter(text_[end])) ++end;
    }
    return text_.substr(where, end - where);
  }
  std::string describe(std::size_t where) const {
    return where == text_.size() ? "the end" : inQuotes(piece(where));
  }

  // ----------------------------------------------------------------------------------------- rules
  Node sum() {
    return chain(&Parser::product, {'+', Operation::kAdd}, {'-', Operation::kSubtract});
  }
  Node product() {
    return chain(&Parser::factor, {'*', Operation::kMultiply}, {'/', Operation::kDivide});
  }

  struct Sign {
    char sign;
    Operation operation;
  };
  /// Reads what `next` reads, with one of two signs between.
  Node chain(Node (Parser::*next)(), Sign one, Sign other) {
    Node value = (this->*next)();
    for (;;) {
      const std::size_t where = position_;
      const bool is_one = accept(one.sign);
      if (!is_one && !accept(other.sign)) return value;
      const Operation operation = is_one ? one.operation : other.operation;
      value = applyBinary(operation, value, (this->*next)(), where);
    }
  }

  Node factor() {
    const bool is_negative = signs();
    const Node value = power();
    return is_negative ? graph_.negate(value) : value;
  }

  /// Returns true when the signs negate their operand.
  bool signs() {
    bool is_negative = false;
    for (;;) {
      if (accept('-')) {
        is_negative = !is_negative;
      } else if (!accept('+')) {
        return is_negative;
      }
    }
  }

  /// a ^ +-b ^ +-c: from the right, each sign before its power is used as an exponent.
  Node power() {
    struct Exponent {
      std::size_t where;  ///< its '^'
      bool is_negative;
      Node value;
    };
    Node base = operand();
    std::vector<Exponent> exponents;
    for (std::size_t where = position_; accept('^'); where = position_) {
      const bool is_negative = signs();
      exponents.push_back({where, is_negative, operand()});
    }
    while (!exponents.empty()) {
      const Exponent last = exponents.back();
      exponents.pop_back();
      const Node exponent = last.is_negative ? graph_.negate(last.value) : last.value;
      Node& raised = exponents.empty() ? base : exponents.back().value;
      raised = applyBinary(Operation::kPower, raised, exponent, last.where);
    }
    return base;
  }

  Node operand() {
    const std::size_t begin = position_;
    if (beginsNumber(begin)) return number();
    if (begin < text_.size() && isNameStart(text_[begin])) {
      const std::size_t end = endOfPath(begin);
      moveTo(end);
      const std::string name = text_.substr(begin, end - begin);
      return isAt(position_, '(') ? call(name, begin) : variable(name, begin);
    }
    if (!accept('(')) failOperand();
    beginParenthesis(begin);
    const Node value = sum();
    endParenthesis();
    return value;
  }

  /// Returns the end of the longest name at `begin` that the scene has: those of parts have slashes
  /// in them.
  std::size_t endOfPath(std::size_t begin) const {
    std::size_t end = endOfName(begin);
    for (std::size_t last = end;
         isAt(last, '/') && last + 1 < text_.size() && isNameStart(text_[last + 1]);) {
      last = endOfName(last + 1);
      const std::string path = text_.substr(begin, last - begin);
      if (symbols_.count(path) != 0 || tables_.count(path) != 0) end = last;
    }
    return end;
  }

  Node number() {
    const std::size_t begin = position_;
    countOperand(begin);
    double value = 0.0;
    const char* const first = text_.data() + begin;
    const auto [stop, error] = std::from_chars(first, text_.data() + text_.size(), value);
    const std::string digits(first, stop);
    const std::size_t end = begin + digits.size();
    if (error == std::errc::result_out_of_range) {
      fail(begin, "the number " + digits + " is too large or too small for double precision");
    }
    if (end < text_.size() && (isNameStart(text_[end]) || text_[end] == '.')) {
      fail(end, "unexpected " + describe(end) + " after the number " + digits +
                    (text_[end] == '.' ? "" : " (a product needs its '*')"));
    }
    moveTo(end);
    return graph_.constant(value);
  }

  /// Reads a variable: `name` was read at `where`; it has no arguments.
  Node variable(const std::string& name, std::size_t where) {
    countOperand(where);
    const auto symbol = symbols_.find(name);
    if (symbol != symbols_.end()) {
      used_.insert(name);
      return symbol->second;
    }
    if (name == "pi") return graph_.constant(kPi);
    if (findFunction(name) != nullptr || tables_.count(name) != 0) {
      fail(where, kindOf(name) + " needs its arguments in parentheses");
    }
    failUnknown(name, where);
  }

  /// Reads a call: `name` was read at `where`; its arguments come next.
  Node call(const std::string& name, std::size_t where) {
    const Function* const function = findFunction(name);
    if (name == kDelay && delay_ && tables_.count(name) == 0) return delayed(where);
    if (function == nullptr && tables_.count(name) == 0) failUnknownFunction(name, where);
    const std::size_t opening = position_;
    accept('(');
    beginParenthesis(opening);
    if (function != nullptr && function->operation == Operation::kSelect) return choice(where);
    std::vector<Node> arguments;
    if (!isAt(position_, ')')) {
      do {
        arguments.push_back(sum());
      } while (accept(','));
    }
    endParenthesis();
    const int needed =
        function != nullptr ? function->argumentCount() : tables_.at(name)->argumentCount();
    if (arguments.size() != static_cast<std::size_t>(needed)) {
      fail(where, kindOf(name) + " takes " + std::to_string(needed) +
                      (needed == 1 ? " argument" : " arguments") + ", not " +
                      std::to_string(arguments.size()));
    }
    return function != nullptr ? applyFunction(*function, arguments, where)
                               : applyTable(tables_.at(name), arguments, where);
  }

  /// Reads behind the '(' of an `if` at `where`.
  Node choice(std::size_t where) {
    const Node left = sum();
    const bool is_less = isAt(position_, '<');
    if (!is_less && !isAt(position_, '>')) failComparison();
    const bool has_equal = isAt(position_ + 1, '=');
    moveTo(position_ + (has_equal ? 2 : 1));
    const Node right = sum();
    Node values[2];
    for (Node& value : values) {
      if (isAt(position_, ')')) failChoice(where);
      if (!accept(',')) failOperator();
      value = sum();
    }
    if (isAt(position_, ',')) failChoice(where);
    endParenthesis();
    // a < b is the negation of b <= a, and a > b that of a <= b.
    const Node low = is_less == has_equal ? left : right;
    const Node high = is_less == has_equal ? right : left;
    return graph_.select(low, high, values[has_equal ? 0 : 1], values[has_equal ? 1 : 0]);
  }

  /// Reads behind the name `delay` at `where`.
  Node delayed(std::size_t where) {
    beginParenthesis(position_);
    accept('(');
    const Node x = sum();
    const bool has_time = accept(',');
    const Node time = has_time ? sum() : x;
    if (!has_time || isAt(position_, ',')) {
      fail(where, "the function 'delay' takes 2 arguments: the formula and the delay, s");
    }
    endParenthesis();
    const double seconds = graph_.isConstant(time) ? graph_.constantValue(time) : 0.0;
    if (!(seconds > 0.0) || !std::isfinite(seconds)) {
      fail(where, "the delay of 'delay' is " +
                      (graph_.isConstant(time) ? formatNumber(seconds) : "not constant") +
                      "; allowed: a number > 0, s, as in delay(x, 0.2), or a parameter: only then "
                      "are the instants known at which jumps come again");
    }
    if (graph_.isConstant(x)) return x;
    const std::size_t end = text_.find_last_of(')', position_ - 1) + 1;
    return delay_(x, seconds, text_.substr(where, end - where));
  }

  void countOperand(std::size_t where) {
    if (graph_.countOperand()) return;
    fail(where, "the scene's formulas have more than " + std::to_string(graph_.mostOperands()) +
                    " numbers and names in all; a table may take their place");
  }

  /// Reads behind a '(' at `where`.
  void beginParenthesis(std::size_t where) {
    if (++nesting_ > kMaxNesting) {
      fail(where, "nested deeper than " + std::to_string(kMaxNesting) + " levels");
    }
  }
  void endParenthesis() {
    if (!accept(')')) failOperator();
    --nesting_;
  }

  // --------------------------------------------------------------------------------------- meaning
  Node applyBinary(Operation operation, Node left, Node right, std::size_t where) {
    if (operation == Operation::kDivide && graph_.isConstant(right, 0.0)) {
      fail(where, "division by zero");
    }
    return checked(graph_.make(operation, left, right), where);
  }

  Node applyFunction(const Function& function, const std::vector<Node>& arguments,
                     std::size_t where) {
    const bool is_clamp = function.operation == Operation::kConstant;
    if (is_clamp && graph_.isConstant(arguments[1]) && graph_.isConstant(arguments[2]) &&
        graph_.constantValue(arguments[1]) > graph_.constantValue(arguments[2])) {
      fail(where, "the limits of this 'clamp' are " +
                      formatNumber(graph_.constantValue(arguments[1])) + " and " +
                      formatNumber(graph_.constantValue(arguments[2])) +
                      ": the lower one comes first");
    }
    const Node value =
        is_clamp ? graph_.minimum(graph_.maximum(arguments[0], arguments[1]), arguments[2])
                 : graph_.make(function.operation, arguments[0],
                               arguments.size() > 1 ? arguments[1] : Node{});
    return checked(value, where);
  }

  Node applyTable(const std::shared_ptr<const Table>& table, const std::vector<Node>& arguments,
                  std::size_t where) {
    return checked(graph_.table(table, arguments.front(), arguments.back()), where);
  }

  Node checked(Node value, std::size_t where) const {
    if (graph_.isConstant(value) && !std::isfinite(graph_.constantValue(value))) {
      fail(where, "the value of this constant part is not finite");
    }
    return value;
  }

  // ---------------------------------------------------------------------------------------- errors
  /// Fails as no operand begins here.
  [[noreturn]] void failOperand() const {
    if (position_ > 0 && isAt(position_, '*') && isAt(position_ - 1, '*')) {
      fail(position_ - 1, "'**' is not an operator here: write '^' for powers");
    }
    if (std::all_of(text_.begin(), text_.end(), isSpace)) fail(0, "the formula is empty");
    failForeign();
    fail(position_, "expected a number, a name or '(' instead of " + describe(position_));
  }

  /// Fails if the next token belongs to other languages.
  void failForeign() const {
    if (position_ == text_.size()) return;
    const std::string way = explainForeignWord(piece(position_));
    if (!way.empty()) fail(position_, describe(position_) + " is not an operator here: " + way);
  }

  /// Fails as the token behind an operand does not continue the formula.
  [[noreturn]] void failOperator() const {
    if (position_ != text_.size()) {
      const char c = text_[position_];
      if (c == ')' && nesting_ == 0) fail(position_, "')' without its '('");
      failForeign();
      if (isNameStart(c) || isDigit(c) || c == '(' || c == '.') {
        fail(position_,
             "expected an operator before " + describe(position_) + " (a product needs its '*')");
      }
      if (c == ',') fail(position_, "',' separates arguments of functions only");
      if (c == '<' || c == '>') {
        fail(position_, describe(position_) +
                            " compares two values, in the first argument of 'if' only: "
                            "if(a < b, x, y)");
      }
      if (c == '=') fail(position_, "'=' is not an operator: a formula is a value");
    }
    const std::string closing = nesting_ > 0 ? "')'" : "the end";
    fail(position_, "expected an operator or " + closing + " instead of " + describe(position_));
  }

  /// Fails as no comparison follows the first value in an `if`.
  [[noreturn]] void failComparison() const {
    const bool is_end = position_ == text_.size();
    if (!is_end && text_.find_first_of(",)=!", position_) != position_) failOperator();
    fail(position_, "expected '<', '<=', '>' or '>=' instead of " + describe(position_) +
                        ": the first argument of 'if' is a comparison");
  }
  [[noreturn]] void failChoice(std::size_t where) const {
    fail(where,
         "the function 'if' takes 3 arguments: a comparison, the value where it holds and "
         "the value elsewhere");
  }

  /// Returns the kind of a name that needs arguments.
  std::string kindOf(const std::string& name) const {
    return (tables_.count(name) != 0 ? "the table " : "the function ") + inQuotes(name);
  }
  /// Returns all names that can be called.
  std::vector<std::string> callableNames() const {
    std::vector<std::string> names = functionNames();
    if (delay_) names.emplace_back(kDelay);
    for (const auto& table : tables_) names.push_back(table.first);
    return names;
  }

  /// Fails if there is an explanation of a name.
  void failExplained(const std::string& what, const std::string& name, std::size_t where) const {
    std::string explanation = explainForeignWord(name);
    if (explanation.empty() && explain_) explanation = explain_(name);
    if (!explanation.empty()) fail(where, what + inQuotes(name) + ": " + explanation);
  }
  [[noreturn]] void failUnknown(const std::string& name, std::size_t where) const {
    failExplained("unknown name ", name, where);
    std::vector<std::string> names;
    for (const auto& symbol : symbols_) names.push_back(symbol.first);
    names.emplace_back("pi");
    const std::string known = joinNames(names);
    for (const std::string& function : callableNames()) names.push_back(function);
    fail(where,
         "unknown name " + inQuotes(name) + suggestName(name, names) + "; known are " + known);
  }

  [[noreturn]] void failUnknownFunction(const std::string& name, std::size_t where) const {
    if (symbols_.count(name) != 0 || name == "pi") {
      fail(where, inQuotes(name) + " is not a function (a product needs its '*')");
    }
    failExplained("unknown function ", name, where);
    fail(where, "unknown function " + inQuotes(name) + suggestName(name, callableNames()) +
                    "; functions are " + joinNames(callableNames()));
  }

  const std::string& text_;
  std::size_t position_ = 0;
  const SymbolTable& symbols_;
  Graph& graph_;
  const NameExplainer& explain_;
  const NamedTables& tables_;
  const DelayMaker& delay_;
  std::set<std::string> used_;  ///< symbols
  int nesting_ = 0;
};

}  // namespace

Node parse(const std::string& text, const SymbolTable& symbols, Graph& graph,
           const NameExplainer& explain, const NamedTables& tables, std::set<std::string>* used,
           const DelayMaker& delay) {
  Parser parser(text, symbols, graph, explain, tables, delay);
  const Node formula = parser.formula();
  if (used != nullptr) *used = parser.used();
  return formula;
}

}  // namespace variator_sim::expression
