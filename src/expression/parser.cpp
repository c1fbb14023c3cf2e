// The grammar is written with Boost.Spirit X3 and stands in parseGrammar's rules below; the actions
// build nodes on a stack. Places where an error is possible end in an action that throws, because
// x3::expectation_failure knows only the name of a rule, not what the user meant.
#include "variator_sim/expression/parser.h"

#include <algorithm>
#include <boost/spirit/home/x3.hpp>
#include <charconv>
#include <cmath>
#include <system_error>
#include <utility>

#include "variator_sim/expression/tape.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim::expression {

namespace {

namespace x3 = boost::spirit::x3;

struct Function {
  const char* name;
  Operation operation;
};

constexpr Function kFunctions[] = {
    {"abs", Operation::kAbs},   {"acos", Operation::kAcos},   {"asin", Operation::kAsin},
    {"atan", Operation::kAtan}, {"atan2", Operation::kAtan2}, {"cos", Operation::kCos},
    {"cosh", Operation::kCosh}, {"exp", Operation::kExp},     {"log", Operation::kLog},
    {"max", Operation::kMax},   {"min", Operation::kMin},     {"pow", Operation::kPower},
    {"sign", Operation::kSign}, {"sin", Operation::kSin},     {"sinh", Operation::kSinh},
    {"sqrt", Operation::kSqrt}, {"tan", Operation::kTan},     {"tanh", Operation::kTanh}};

constexpr double kPi = 3.14159265358979323846;

const Function* findFunction(const std::string& name) {
  for (const Function& function : kFunctions) {
    if (name == function.name) {
      return &function;
    }
  }
  return nullptr;
}

// std::isalpha and friends depend on the locale.
bool isDigit(char c) {
  return c >= '0' && c <= '9';
}
bool isNameStart(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

/// True for the bytes that continue a UTF-8 character.
bool continuesCharacter(char c) {
  return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
}

int columnOf(const std::string& text, std::size_t offset) {
  int column = 1;
  for (std::size_t i = 0; i < std::min(offset, text.size()); ++i) {
    column += continuesCharacter(text[i]) ? 0 : 1;
  }
  return column;
}

/// Two lines: the text around `column`, cut to fit a terminal, and a caret below it.
std::string showPlace(const std::string& text, int column) {
  constexpr int kBefore = 50;
  constexpr int kAfter = 25;
  std::string shown;
  int position = 0;
  bool cut_before = false;
  bool cut_after = false;
  for (const char c : text) {
    position += continuesCharacter(c) ? 0 : 1;
    if (position < column - kBefore) {
      cut_before = true;
    } else if (position > column + kAfter) {
      cut_after = true;
    } else {
      shown += c == '\n' || c == '\r' || c == '\t' ? ' ' : c;
    }
  }
  const int indent = cut_before ? kBefore + 3 : column - 1;
  return "\n  " + std::string(cut_before ? "..." : "") + shown + (cut_after ? "..." : "") + "\n  " +
         std::string(static_cast<std::size_t>(indent), ' ') + "^";
}

using Iterator = std::string::const_iterator;

/// What the actions of the grammar work on.
class Builder {
 public:
  Builder(const std::string& text, const SymbolTable& symbols, Graph& graph,
          const NameExplainer& explain, const SymbolTable& linear)
      : text_(text), symbols_(symbols), graph_(graph), explain_(explain), linear_(linear) {}

  Node result() const { return values_.back(); }

  [[noreturn]] void fail(Iterator where, const std::string& message) const {
    throw ExpressionError(message, text_, columnOf(text_, offsetOf(where)));
  }

  /// The piece at `where` as a user would call it: a name, a number or one character in quotes.
  std::string describe(Iterator where) const {
    if (where == text_.end()) {
      return "the end";
    }
    Iterator end = where + 1;
    if (isNameStart(*where)) {
      end = std::find_if(end, text_.end(), [](char c) { return !isNameStart(c) && !isDigit(c); });
    } else if (isDigit(*where)) {
      end = std::find_if(end, text_.end(), [](char c) { return !isDigit(c) && c != '.'; });
    } else {
      end = std::find_if(end, text_.end(), [](char c) { return !continuesCharacter(c); });
    }
    return "'" + std::string(where, end) + "'";
  }

  // ------------------------------------------------------------------------------------- operands
  void pushNumber(Iterator begin, Iterator end) {
    // Spirit's own real numbers may be off by a rounding; std::from_chars is exact.
    double value = 0.0;
    const std::string digits(begin, end);
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::result_out_of_range) {
      fail(begin, "the number " + digits + " is too large or too small for double precision");
    }
    if (error != std::errc() || stop != digits.data() + digits.size()) {
      fail(begin, "'" + digits + "' is not a number");
    }
    if (end != text_.end() && (isNameStart(*end) || *end == '.')) {
      fail(end, "unexpected " + describe(end) + " after the number " + digits +
                    (*end == '.' ? "" : " (a product needs its '*')"));
    }
    values_.push_back(graph_.constant(value));
  }

  void beginName(Iterator begin, Iterator end) {
    name_ = std::string(begin, end);
    name_begin_ = begin;
  }

  void pushVariable() {
    const auto symbol = symbols_.find(name_);
    if (symbol != symbols_.end()) {
      values_.push_back(symbol->second);
    } else if (name_ == "pi") {
      values_.push_back(graph_.constant(kPi));
    } else if (findFunction(name_) != nullptr) {
      fail(name_begin_, "the function '" + name_ + "' needs its arguments in parentheses");
    } else {
      failUnknown(name_begin_);
    }
  }

  // ---------------------------------------------------------------------- parentheses and
  // functions
  void beginParenthesis(Iterator where) {
    if (++nesting_ > kMaxNesting) {
      fail(where, "nested deeper than " + std::to_string(kMaxNesting) + " levels");
    }
  }
  void endParenthesis() { --nesting_; }

  void beginCall(Iterator where) {
    const Function* function = findFunction(name_);
    if (function == nullptr) {
      if (symbols_.count(name_) != 0 || name_ == "pi") {
        fail(name_begin_, "'" + name_ + "' is not a function (a product needs its '*')");
      }
      std::string hint = explain_ ? explain_(name_) : "";
      if (hint.empty()) {
        hint = "functions are " + joinNames(functionNames());
      }
      fail(name_begin_,
           "unknown function '" + name_ + "'" + suggestName(name_, functionNames()) + "; " + hint);
    }
    beginParenthesis(where);
    calls_.push_back({function, name_begin_, values_.size()});
  }

  void endCall() {
    const Call call = calls_.back();
    calls_.pop_back();
    endParenthesis();
    const std::size_t given = values_.size() - call.first_argument;
    const auto needed = static_cast<std::size_t>(operandCount(call.function->operation));
    if (given != needed) {
      fail(call.where, "the function '" + std::string(call.function->name) + "' takes " +
                           std::to_string(needed) + (needed == 1 ? " argument" : " arguments") +
                           ", not " + std::to_string(given));
    }
    const Node* arguments = values_.data() + call.first_argument;
    const Node value =
        graph_.make(call.function->operation, arguments[0], needed > 1 ? arguments[1] : Node{});
    if (value != arguments[0] && readsLinear(value)) failNotLinear(call.where, value);
    values_.resize(call.first_argument);
    values_.push_back(checked(value, call.where));
  }

  // ------------------------------------------------------------------------------------- operators
  void operatorAt(Iterator where) { operators_.push_back(where); }
  void applyBinary(Operation operation) {
    const Node right = values_.back();
    values_.pop_back();
    if (operation == Operation::kDivide && graph_.isConstant(right, 0.0)) {
      fail(operators_.back(), "division by zero");
    }
    const Node left = values_.back();
    const Node value = graph_.make(operation, left, right);
    const bool bends = operation == Operation::kMultiply ? readsLinear(left) && readsLinear(right)
                       : operation == Operation::kDivide
                           ? readsLinear(right)
                           : operation == Operation::kPower && value != left;
    if (bends && readsLinear(value)) failNotLinear(operators_.back(), value);
    values_.back() = checked(value, operators_.back());
    operators_.pop_back();
  }

  void beginSigns() { negative_.push_back(false); }
  void flipSign() { negative_.back() = !negative_.back(); }
  void applySign() {
    if (negative_.back()) {
      values_.back() = graph_.negate(values_.back());
    }
    negative_.pop_back();
  }

  void beginPower() { powers_.push_back(values_.size()); }
  /// a ^ +-b ^ +-c: from the right, each sign before its power is used as an exponent.
  void endPower() {
    const std::size_t base = powers_.back();
    powers_.pop_back();
    while (values_.size() > base + 1) {
      applySign();
      applyBinary(Operation::kPower);
    }
  }

  // ---------------------------------------------------------------------------------------- errors
  [[noreturn]] void failOperand(Iterator where) const {
    const bool after_star =
        where != text_.begin() && where != text_.end() && *where == '*' && *(where - 1) == '*';
    if (after_star) {
      fail(where - 1, "'**' is not an operator here: write '^' for powers");
    }
    if (std::all_of(text_.begin(), text_.end(), [](char c) { return isSpace(c); })) {
      fail(text_.begin(), "the formula is empty");
    }
    fail(where, "expected a number, a name or '(' instead of " + describe(where));
  }

  [[noreturn]] void failOperator(Iterator where) const {
    const std::string closing = nesting_ > 0 ? "')'" : "the end";
    if (where != text_.end()) {
      if (*where == ')' && nesting_ == 0) {
        fail(where, "')' without its '('");
      }
      if (isNameStart(*where) || isDigit(*where) || *where == '(' || *where == '.') {
        fail(where,
             "expected an operator before " + describe(where) + " (a product needs its '*')");
      }
      if (*where == ',') {
        fail(where, "',' separates arguments of functions only");
      }
      if (*where == '=') {
        fail(where, "'=' is not an operator: a formula is a value");
      }
    }
    fail(where, "expected an operator or " + closing + " instead of " + describe(where));
  }

  static bool isSpace(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
  }

 private:
  struct Call {
    const Function* function;
    Iterator where;
    std::size_t first_argument;
  };

  std::size_t offsetOf(Iterator where) const {
    return static_cast<std::size_t>(where - text_.begin());
  }

  /// Whether one of `linear_` occurs in `node`.
  bool readsLinear(Node node) {
    if (linear_.empty()) return false;
    // Operands precede their users.
    for (int i = static_cast<int>(reads_linear_.size()); i <= node.index; ++i) {
      const Graph::Entry& entry = graph_.entry({i});
      bool reads = std::any_of(linear_.begin(), linear_.end(),
                               [i](const auto& symbol) { return symbol.second == Node{i}; });
      for (int k = 0; k < operandCount(entry.operation); ++k) {
        reads = reads || reads_linear_[static_cast<std::size_t>(entry.operands[k])];
      }
      reads_linear_.push_back(reads);
    }
    return reads_linear_[static_cast<std::size_t>(node.index)];
  }

  [[noreturn]] void failNotLinear(Iterator where, Node value) const {
    std::string names;
    for (const auto& [name, variable] : linear_) {
      if (!graph_.dependsOn(value, graph_.entry(variable).slot)) continue;
      names += (names.empty() ? "" : ", ") + name;
    }
    fail(where, "the formula is not linear in " + names +
                    " here (a constraint of order 3 is C(t, phi, w, e) j + c0 = 0)");
  }

  Node checked(Node value, Iterator where) const {
    if (graph_.isConstant(value) && !std::isfinite(graph_.constantValue(value))) {
      fail(where, "the value of this constant part is not finite");
    }
    return value;
  }

  [[noreturn]] void failUnknown(Iterator where) const {
    const std::string explanation = explain_ ? explain_(name_) : "";
    if (!explanation.empty()) {
      fail(where, "unknown name '" + name_ + "': " + explanation);
    }
    std::vector<std::string> names;
    for (const auto& symbol : symbols_) {
      names.push_back(symbol.first);
    }
    names.emplace_back("pi");
    const std::string known = joinNames(names);
    for (const std::string& name : functionNames()) {
      names.push_back(name);
    }
    fail(where,
         "unknown name '" + name_ + "'" + suggestName(name_, names) + "; known are " + known);
  }

  const std::string& text_;
  const SymbolTable& symbols_;
  Graph& graph_;
  const NameExplainer& explain_;
  const SymbolTable& linear_;

  std::vector<bool> reads_linear_;  ///< of the nodes of the graph, as far as asked for
  std::string name_;
  Iterator name_begin_;
  int nesting_ = 0;
  std::vector<Node> values_;
  std::vector<Call> calls_;
  std::vector<Iterator> operators_;
  std::vector<bool> negative_;
  std::vector<std::size_t> powers_;
};

// --------------------------------------------------------------------------------------- grammar
namespace grammar {

// Lower-case names: the rules read as a grammar, and BOOST_SPIRIT_DEFINE wants rule and rule_def.
// NOLINTBEGIN(readability-identifier-naming)

struct BuilderTag;

/// The state that the actions share.
template <typename Context>
Builder& builder(const Context& context) {
  return x3::get<BuilderTag>(context);
}
/// Where an action runs: behind what its parser took.
template <typename Context>
Iterator place(const Context& context) {
  return x3::_where(context).begin();
}

// Actions of the same shape: a call of a Builder's method.
const auto kPushNumber = [](auto& context) {
  builder(context).pushNumber(x3::_attr(context).begin(), x3::_attr(context).end());
};
const auto kBeginName = [](auto& context) {
  builder(context).beginName(x3::_attr(context).begin(), x3::_attr(context).end());
};
const auto kPushVariable = [](auto& context) { builder(context).pushVariable(); };
const auto kBeginParenthesis = [](auto& context) {
  builder(context).beginParenthesis(place(context) - 1);
};
const auto kEndParenthesis = [](auto& context) { builder(context).endParenthesis(); };
const auto kBeginCall = [](auto& context) { builder(context).beginCall(place(context) - 1); };
const auto kEndCall = [](auto& context) { builder(context).endCall(); };
const auto kOperator = [](auto& context) { builder(context).operatorAt(place(context) - 1); };
const auto kAdd = [](auto& context) { builder(context).applyBinary(Operation::kAdd); };
const auto kSubtract = [](auto& context) { builder(context).applyBinary(Operation::kSubtract); };
const auto kMultiply = [](auto& context) { builder(context).applyBinary(Operation::kMultiply); };
const auto kDivide = [](auto& context) { builder(context).applyBinary(Operation::kDivide); };
const auto kBeginSigns = [](auto& context) { builder(context).beginSigns(); };
const auto kFlipSign = [](auto& context) { builder(context).flipSign(); };
const auto kApplySign = [](auto& context) { builder(context).applySign(); };
const auto kBeginPower = [](auto& context) { builder(context).beginPower(); };
const auto kEndPower = [](auto& context) { builder(context).endPower(); };
const auto kFailOperand = [](auto& context) { builder(context).failOperand(place(context)); };
const auto kFailOperator = [](auto& context) { builder(context).failOperator(place(context)); };

const x3::rule<class SumRule> sum = "sum";

const auto digits = +x3::char_('0', '9');
const auto mantissa = digits >> -(x3::lit('.') >> -digits) | x3::lit('.') >> digits;
const auto exponent = x3::char_("eE") >> -x3::char_("+-") >> digits;
const auto number = x3::raw[x3::lexeme[mantissa >> -exponent]];
const auto name_start = x3::char_('a', 'z') | x3::char_('A', 'Z') | x3::char_('_');
const auto name = x3::raw[x3::lexeme[name_start >> *(name_start | x3::char_('0', '9'))]];

const auto close = x3::lit(')') | x3::eps[kFailOperator];
const auto arguments = x3::lit(')')[kEndCall] | (sum % ',' >> close >> x3::eps[kEndCall]);
const auto operand = number[kPushNumber] |
                     name[kBeginName] >>
                         (x3::lit('(')[kBeginCall] >> arguments | x3::eps[kPushVariable]) |
                     x3::lit('(')[kBeginParenthesis] >> sum >> close >> x3::eps[kEndParenthesis] |
                     x3::eps[kFailOperand];
const auto signs = x3::eps[kBeginSigns] >> *(x3::lit('+') | x3::lit('-')[kFlipSign]);
const auto power = x3::eps[kBeginPower] >> operand >>
                   *(x3::lit('^')[kOperator] >> signs >> operand) >> x3::eps[kEndPower];
const auto factor = signs >> power >> x3::eps[kApplySign];
const auto product = factor >> *(x3::lit('*')[kOperator] >> factor >> x3::eps[kMultiply] |
                                 x3::lit('/')[kOperator] >> factor >> x3::eps[kDivide]);
const auto sum_def = product >> *(x3::lit('+')[kOperator] >> product >> x3::eps[kAdd] |
                                  x3::lit('-')[kOperator] >> product >> x3::eps[kSubtract]);
BOOST_SPIRIT_DEFINE(sum)

const auto formula = sum >> (x3::eoi | x3::eps[kFailOperator]);
const auto space = x3::char_(" \t\n\r\v\f");
// NOLINTEND(readability-identifier-naming)

}  // namespace grammar

// ---------------------------------------------------------------------------- formulas of a scene

/// True for `prefix` followed by digits only.
bool isNumbered(const std::string& name, const std::string& prefix) {
  return name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), name.end(),
                     isDigit);
}

/// "w1, w2".
std::string listNumbered(const std::string& prefix, int count) {
  std::vector<std::string> names;
  for (int i = 1; i <= count; ++i) {
    names.push_back(prefix + std::to_string(i));
  }
  return joinNames(names);
}

/// Why a numbered name means nothing in a scene of `shaft_count` shafts, or an empty string.
std::string explainName(const std::string& name, int shaft_count, FormulaKind kind) {
  const bool order3 = kind == FormulaKind::kOrder3 || kind == FormulaKind::kOrder3WithoutJerks;
  if (isNumbered(name, "j") && !order3) {
    return "jerks occur in constraints of order 3 only";
  }
  if (kind == FormulaKind::kOrder1 && isNumbered(name, "e")) {
    return "a constraint of order 1 may depend on t, phi and w only";
  }
  if (kind == FormulaKind::kTorque && isNumbered(name, "e")) {
    return "a torque may depend on t, phi and w only (with e its rate would need the jerk)";
  }
  for (const char* prefix : {"phi", "w", "e", "j"}) {
    if (isNumbered(name, prefix)) {
      return "the scene has " + std::to_string(shaft_count) +
             (shaft_count == 1 ? " shaft: " : " shafts: ") + listNumbered(prefix, shaft_count);
    }
  }
  return "";
}

/// Throws SceneError when a parameter's name cannot be told from something else.
void checkParameterName(const std::string& name, const std::string& path) {
  const std::string quoted = "'" + name + "'";
  if (!isValidName(name)) {
    throw SceneError(path, quoted +
                               " is not a valid name (a letter or '_', then letters, digits and "
                               "'_')");
  }
  if (name == "pi" || findFunction(name) != nullptr) {
    throw SceneError(path, quoted + " is already the name of " +
                               (name == "pi" ? "a number" : "a function") + "; choose another");
  }
  const bool is_variable = name == "t" || isNumbered(name, "phi") || isNumbered(name, "w") ||
                           isNumbered(name, "e") || isNumbered(name, "j");
  if (is_variable) {
    throw SceneError(path, quoted +
                               " is the name of a variable (t, phi1.., w1.., e1.. and j1.. are); "
                               "choose another");
  }
}

}  // namespace

ExpressionError::ExpressionError(const std::string& message, const std::string& text, int column)
    : std::runtime_error(message + " at column " + std::to_string(column) +
                         showPlace(text, column)),
      column_(column) {}

std::vector<std::string> functionNames() {
  std::vector<std::string> names;
  for (const Function& function : kFunctions) {
    names.emplace_back(function.name);
  }
  return names;
}

bool isValidName(const std::string& name) {
  return !name.empty() && isNameStart(name.front()) &&
         std::all_of(name.begin(), name.end(), [](char c) { return isNameStart(c) || isDigit(c); });
}

Node parse(const std::string& text, const SymbolTable& symbols, Graph& graph,
           const NameExplainer& explain, const SymbolTable& linear) {
  Builder state(text, symbols, graph, explain, linear);
  Iterator position = text.begin();
  x3::phrase_parse(position, text.end(), x3::with<grammar::BuilderTag>(state)[grammar::formula],
                   grammar::space);
  return state.result();
}

Node readFormula(ComponentContext& context, const std::string& key, FormulaKind kind,
                 Graph& graph) {
  ParameterReader& reader = context.parameters();
  const std::string text = reader.formula(key);
  const std::map<std::string, double> parameters = reader.numberDictionary("parameters");

  SymbolTable symbols;
  SymbolTable jerks;
  symbols["t"] = graph.variable(slotOf(Source::kTime));
  for (int i = 0; i < context.shaftCount(); ++i) {
    const std::string number_text = std::to_string(i + 1);
    symbols["phi" + number_text] = graph.variable(slotOf(Source::kAngle, i));
    symbols["w" + number_text] = graph.variable(slotOf(Source::kVelocity, i));
    if (kind != FormulaKind::kTorque && kind != FormulaKind::kOrder1) {
      symbols["e" + number_text] = graph.variable(slotOf(Source::kAcceleration, i));
    }
    if (kind == FormulaKind::kOrder3) {
      const Node jerk = graph.variable(slotOf(Source::kJerk, i));
      symbols["j" + number_text] = jerks["j" + number_text] = jerk;
    } else if (kind == FormulaKind::kOrder3WithoutJerks) {
      symbols["j" + number_text] = graph.constant(0.0);
    }
  }
  for (const auto& [parameter, value] : parameters) {
    checkParameterName(parameter, reader.keyPath("parameters") + "/" + parameter);
    symbols[parameter] = graph.constant(value);
  }
  try {
    const NameExplainer explain = [&](const std::string& unknown) {
      return explainName(unknown, context.shaftCount(), kind);
    };
    return parse(text, symbols, graph, explain, jerks);
  } catch (const ExpressionError& error) {
    throw SceneError(reader.keyPath(key), error.what());
  }
}

}  // namespace variator_sim::expression
