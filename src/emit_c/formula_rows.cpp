#include "emit_c/formula_rows.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "emit_c/c_text.h"
#include "model/number_text.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Operation;

std::string literalOf(double value) {
  if (std::isnan(value)) throw std::invalid_argument("a constant that is no number");
  if (std::isinf(value)) return value > 0.0 ? "INFINITY" : "-INFINITY";
  const DotLocale dot;
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  // (The shortest text that reads back is used.)
  for (int digits = 1; digits < 17; ++digits) {
    char shorter[40];
    std::snprintf(shorter, sizeof shorter, "%.*g", digits, value);
    if (std::strtod(shorter, nullptr) != value) continue;
    std::copy(std::begin(shorter), std::end(shorter), text);
    break;
  }
  std::string literal = text;
  if (literal.find_first_of(".en") == std::string::npos) literal += ".0";
  return literal;
}

namespace {

template <class Values, class Write>
std::string join(const Values& values, Write write) {
  std::string text;
  std::size_t column = 0;
  for (const auto& value : values) {
    const std::string word = write(value);
    if (column + word.size() > 92) {
      text += ",\n    ";
      column = 4;
    } else if (!text.empty()) {
      text += ", ";
    }
    text += word;
    column += word.size() + 2;
  }
  return text.empty() ? "0" : text;
}

constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

/// Calls `use` with the point from which each piece is counted: the lower one of its two, for the
/// lowest piece the first; third derivatives are taken slightly inside of the piece.
template <class Use>
void forEachPiece(const std::vector<double>& points, Use use) {
  for (std::size_t k = 0; k <= points.size(); ++k) {
    const double x = k == 0 ? points.front() : points[k - 1];
    use(x, k == 0 ? std::nextafter(x, -std::numeric_limits<double>::infinity()) : x);
  }
}

}  // namespace

std::string listOf(const std::vector<double>& values) {
  return join(values, [](double value) { return literalOf(value); });
}

std::string listOf(const std::vector<int>& values) {
  return join(values, [](int value) { return std::to_string(value); });
}

void FormulaRows::write(const std::vector<Node>& series, const std::vector<Node>& at_once) {
  std::vector<Node> all = series;
  all.insert(all.end(), at_once.begin(), at_once.end());
  const std::vector<bool> in_series = graph_.findReachable(series);
  const std::vector<bool> reachable = graph_.findReachable(all);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    const Node node{static_cast<int>(i)};
    if (!reachable[i]) continue;
    const Entry entry = graph_.entry(node);
    bool reads = entry.operation == Operation::kVariable &&
                 expression::sourceOf(entry.slot) == expression::Source::kAcceleration;
    for (int k = 0; k < expression::operandCount(entry.operation); ++k) {
      reads = reads || accelerated_.count(entry.operands[k]) > 0;
    }
    if (reads) accelerated_.insert(node.index);
    noteGrowth(node, entry);
  }
  // Series come first: a pair of sine and cosine is made at the place of its first one.
  for (std::size_t i = 0; i < in_series.size(); ++i) {
    const Node node{static_cast<int>(i)};
    if (in_series[i]) writeNode(node, isAccelerated(node) ? Part::kAccelerated : Part::kGiven);
  }
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    const bool is_series = i < in_series.size() && in_series[i];
    if (reachable[i] && !is_series) writeNode({static_cast<int>(i)}, Part::kAtOnce);
  }
}

void FormulaRows::noteGrowth(Node node, const Entry& entry) {
  const int count = expression::operandCount(entry.operation);
  const auto any = [&](const std::set<int>& nodes) {
    for (int k = 0; k < count; ++k) {
      if (nodes.count(entry.operands[k]) > 0) return true;
    }
    return false;
  };
  const bool is_plain_power =
      entry.operation == Operation::kPower && graph_.isConstant(Node{entry.operands[1]});
  if (any(grows_) || entry.operation == Operation::kExp || entry.operation == Operation::kSinh ||
      entry.operation == Operation::kCosh ||
      (entry.operation == Operation::kPower && !is_plain_power)) {
    grows_.insert(node.index);
  }
  if (any(has_pole_) || entry.operation == Operation::kDivide ||
      entry.operation == Operation::kTan || entry.operation == Operation::kLog ||
      (is_plain_power && !(graph_.constantValue(Node{entry.operands[1]}) > 0.0))) {
    has_pole_.insert(node.index);
  }
}

int FormulaRows::constantRow(double value) {
  const auto [found, is_new] = row_of_constant_.try_emplace(value, -1);
  if (is_new) found->second = rows_++;
  return found->second;
}

std::string FormulaRows::operand(const Entry& entry, int k) const {
  return row(row_of_node_.at(entry.operands[k]));
}

std::string FormulaRows::call(const std::string& function,
                              const std::vector<std::string>& arguments) {
  functions_.insert(function);
  if (is_series_) noteOperation(function, arguments);
  std::string text = function + "(";
  for (const std::string& argument : arguments) text += argument + ", ";
  return text + "n);";
}

void FormulaRows::noteOperation(const std::string& function,
                                const std::vector<std::string>& arguments) {
  using namespace expression;  // NOLINT: its operations are many
  struct Known {
    const char* name;
    int kind;
    int result, second, a, b;  ///< arguments; -1: none
    int number;                ///< a factor, an exponent or a branch
  };
  static constexpr Known kKnown[] = {
      {"scale", kSeriesSum, 0, -1, 1, -1, 2},
      {"shift", kSeriesSum, 0, -1, 1, -1, -1},
      {"add", kSeriesSum, 0, -1, 1, 2, -1},
      {"subtract", kSeriesSum, 0, -1, 1, 2, -1},
      {"multiply", kSeriesProduct, 0, -1, 1, 2, -1},
      {"divide", kSeriesQuotient, 0, -1, 1, 2, -1},
      {"exponential", kSeriesExp, 0, -1, 1, -1, -1},
      {"logarithm", kSeriesLog, 0, -1, 1, -1, -1},
      {"sine_cosine", kSeriesSine, 0, 1, 2, -1, -1},
      {"sinh_cosh", kSeriesSinh, 0, 1, 2, -1, -1},
      {"tangent", kSeriesTan, 0, 1, 2, -1, -1},
      {"tangent_hyperbolic", kSeriesTanh, 0, 1, 2, -1, -1},
      {"arc_tangent", kSeriesAtan, 0, -1, 2, -1, -1},
      {"arc_sine", kSeriesAsin, 0, -1, 2, -1, -1},
      {"arc_cosine", kSeriesAcos, 0, -1, 2, -1, -1},
      {"arc_tangent_of_two", kSeriesAtan2, 0, -1, 2, 3, -1},
      {"square_root", kSeriesSqrt, 0, -1, 1, -1, -1},
      {"power", kSeriesPower, 0, -1, 1, -1, 2},
      {"absolute", kSeriesSum, 0, -1, 1, -1, -1},
      {"minimum", kSeriesEither, 0, -1, 1, 2, 3},
      {"maximum", kSeriesOther, 0, -1, 1, 2, 3},
      {"choose", kSeriesEither, 0, -1, 3, 4, 5},
      {"where_finite", kSeriesFinite, 0, -1, 1, 2, -1},
      {"look_up", kSeriesTable, 0, -1, 1, -1, 5},
      {"look_up_two", kSeriesTable, 0, -1, 1, 2, 7},
  };
  for (const Known& it : kKnown) {
    if (function != it.name) continue;
    // "r[12]", "r + 12", "b + 3", "p + 6"
    const auto number = [&](int n) {
      return std::stoi(arguments[static_cast<std::size_t>(n)].substr(
          n >= 0 && arguments[static_cast<std::size_t>(n)][1] == '[' ? 2 : 4));
    };
    const auto row = [&](int n) { return n < 0 ? -1 : number(n); };
    SeriesOperation made = {
        it.kind, row(it.result), row(it.second), row(it.a), row(it.b), 1 << 20, -1, 0, 1.0, 1.0};
    if (function == "subtract") made.g = -1.0;
    if (function == "scale" || function == "power") {
      const DotLocale dot;
      made.f = std::strtod(arguments[static_cast<std::size_t>(it.number)].c_str(), nullptr);
    } else if (it.number >= 0) {
      made.state = number(it.number);
    }
    if (function == "look_up_two") made.f = 6.0;
    operations_.push_back(made);
    return;
  }
}

void FormulaRows::writeNode(Node node, Part part) {
  is_series_ = part != Part::kAtOnce;
  const Entry entry = graph_.entry(node);
  if (entry.operation == Operation::kConstant) {
    if (std::isnan(entry.value)) throw std::invalid_argument("a constant that is no number");
    row_of_node_[node.index] = constantRow(entry.value);
    return;
  }
  if (entry.operation == Operation::kVariable) {
    const auto found = row_of_slot_.find(entry.slot);
    if (found == row_of_slot_.end()) throw std::invalid_argument("a variable without a series");
    row_of_node_[node.index] = found->second;
    return;
  }
  const bool is_hyperbolic =
      entry.operation == Operation::kSinh || entry.operation == Operation::kCosh;
  const bool is_pair =
      is_hyperbolic || entry.operation == Operation::kSin || entry.operation == Operation::kCos;
  const bool is_second = entry.operation == Operation::kCos || entry.operation == Operation::kCosh;
  std::string statement;
  if (is_pair) {
    const auto [made, is_new] =
        pairs_.try_emplace({is_hyperbolic, entry.operands[0]}, std::pair<int, int>{-1, -1});
    if (is_new) {
      made->second = {rows_, rows_ + 1};
      rows_ += 2;
      statement = call(is_hyperbolic ? "sinh_cosh" : "sine_cosine",
                       {row(made->second.first), row(made->second.second), operand(entry, 0)});
    }
    row_of_node_[node.index] = is_second ? made->second.second : made->second.first;
  } else {
    const int result = entry.operation == Operation::kTable || entry.operation == Operation::kTable2
                           ? -1
                           : rows_++;
    row_of_node_[node.index] = result;
    statement = statementOf(entry, result);
    // (Tables have their own blocks of rows.)
    if (result < 0)
      row_of_node_[node.index] = rows_ - (entry.operation == Operation::kTable ? 6 : 11);
  }
  if (statement.empty()) return;
  text_[static_cast<std::size_t>(part)] += "  " + statement + "\n";
}

std::string FormulaRows::statementOf(const Entry& entry, int result) {
  const std::string y = row(result);
  const auto with_constant = [&](int k, const std::string& function, double by) {
    return call(function, {y, operand(entry, k), literalOf(by)});
  };
  const Node a{entry.operands[0]};
  const Node b{entry.operands[1]};
  switch (entry.operation) {
    case Operation::kNegate:
      return with_constant(0, "scale", -1.0);
    case Operation::kAdd:
      if (graph_.isConstant(a)) return with_constant(1, "shift", graph_.constantValue(a));
      if (graph_.isConstant(b)) return with_constant(0, "shift", graph_.constantValue(b));
      return call("add", {y, operand(entry, 0), operand(entry, 1)});
    case Operation::kSubtract:
      if (graph_.isConstant(b)) return with_constant(0, "shift", -graph_.constantValue(b));
      return call("subtract", {y, operand(entry, 0), operand(entry, 1)});
    case Operation::kMultiply:
      if (graph_.isConstant(a)) return with_constant(1, "scale", graph_.constantValue(a));
      if (graph_.isConstant(b)) return with_constant(0, "scale", graph_.constantValue(b));
      return call("multiply", {y, operand(entry, 0), operand(entry, 1)});
    case Operation::kDivide:
      if (graph_.isConstant(b) && std::isfinite(1.0 / graph_.constantValue(b))) {
        return with_constant(0, "scale", 1.0 / graph_.constantValue(b));
      }
      break;
    case Operation::kPower:
      return powerOf(entry, result);
    case Operation::kTable:
    case Operation::kTable2:
      return tableOf(entry, result);
    default:
      break;
  }
  std::string statement = statementOfFunction(entry, result);
  // Functions that reach a limit when their operand overflows.
  const int inner = entry.operation == Operation::kDivide ? 1 : 0;
  const int of = entry.operands[inner];
  const bool has_limit = entry.operation == Operation::kDivide ||
                         entry.operation == Operation::kTanh ||
                         entry.operation == Operation::kAtan || entry.operation == Operation::kExp;
  if (!has_limit || grows_.count(of) == 0 || has_pole_.count(of) > 0) return statement;
  functions_.insert("at_limit");
  return "if (at_limit(" + operand(entry, inner) + ", " + y + ", n)) " + y + "[n] = 0.0;\n  else " +
         statement;
}

std::string FormulaRows::statementOfFunction(const Entry& entry, int result) {
  const std::string y = row(result);
  const std::string a = operand(entry, 0);
  switch (entry.operation) {
    case Operation::kDivide:
      return call("divide", {y, a, operand(entry, 1)});
    case Operation::kTan:
      return call("tangent", {y, addRow(), a});
    case Operation::kTanh:
      return call("tangent_hyperbolic", {y, addRow(), a});
    case Operation::kAsin:
      return call("arc_sine", {y, addRow(), a});
    case Operation::kAcos:
      return call("arc_cosine", {y, addRow(), a});
    case Operation::kAtan:
      return call("arc_tangent", {y, addRow(), a});
    case Operation::kAtan2:
      return call("arc_tangent_of_two", {y, addRow(), a, operand(entry, 1)});
    case Operation::kExp:
      return call("exponential", {y, a});
    case Operation::kLog:
      return call("logarithm", {y, a});
    case Operation::kSqrt:
      return call("square_root", {y, a});
    default:
      return statementOfBranch(entry, result);
  }
}

std::string FormulaRows::statementOfBranch(const Entry& entry, int result) {
  const std::string y = row(result);
  const std::string a = operand(entry, 0);
  const auto side = [this] { return "b + " + std::to_string(branches_++); };
  switch (entry.operation) {
    case Operation::kAbs:
      return call("absolute", {y, a, side()});
    case Operation::kSign:
      return call("sign_of", {y, a});
    case Operation::kMin:
      return call("minimum", {y, a, operand(entry, 1), side()});
    case Operation::kMax:
      return call("maximum", {y, a, operand(entry, 1), side()});
    case Operation::kSelect:
      return call("choose",
                  {y, a, operand(entry, 1), operand(entry, 2), operand(entry, 3), side()});
    case Operation::kWhereFinite:
      return call("where_finite", {y, a, operand(entry, 1)});
    default:
      throw std::invalid_argument("a function without a series");
  }
}

std::string FormulaRows::multipliedPower(const std::string& base, int n, std::string& text) {
  if (n == 1) return base;
  const std::string half = multipliedPower(base, n % 2 == 1 ? n - 1 : n / 2, text);
  std::string made = addRow();
  text += call("multiply", {made, half, n % 2 == 1 ? base : half}) + "\n  ";
  return made;
}

std::string FormulaRows::powerOf(const Entry& entry, int result) {
  constexpr double kMostMultiplied = 1000.0;
  const std::string y = row(result);
  const std::string a = operand(entry, 0);
  const Node exponent{entry.operands[1]};
  std::string text;
  if (!graph_.isConstant(exponent)) {
    // a^b = exp(b log a)
    const std::string logarithm = addRow();
    const std::string product = addRow();
    text = call("logarithm", {logarithm, a}) + "\n  ";
    text += call("multiply", {product, operand(entry, 1), logarithm}) + "\n  ";
    return text + call("exponential", {y, product});
  }
  const double k = graph_.constantValue(exponent);
  if (k != std::trunc(k) || k == 0.0 || std::abs(k) > kMostMultiplied) {
    return call("power", {y, a, literalOf(k)});
  }
  const int n = static_cast<int>(std::abs(k));
  const std::string raised = multipliedPower(a, n, text);
  if (k > 0.0) return text + call("scale", {y, raised, "1.0"});
  return text + call("divide", {y, row(constantRow(1.0)), raised});
}

std::string FormulaRows::nameOfTable(int number) {
  std::string& name = table_names_[number];
  if (!name.empty()) return name;
  name = "table_" + std::to_string(number);
  const Table& table = *graph_.tables()[static_cast<std::size_t>(number)];
  const std::vector<double> points = table.points();
  std::vector<double> pieces;
  forEachPiece(points, [&](double x, double inside) {
    for (int i = 0; i <= Table::kDegree; ++i) {
      pieces.push_back(table.derivative(i, i < 3 ? x : inside) / kFactorial[i]);
    }
  });
  tables_ += "\n/* " + harmless(table.origin()) + " */\nstatic const double " + name +
             "_points[] = {\n    " + listOf(points) + "};\nstatic const double " + name +
             "_pieces[] = {\n    " + listOf(pieces) + "};\nstatic const table_of_one " + name +
             " = {" + std::to_string(points.size()) + ", " + name + "_points, " + name +
             "_pieces};\n";
  return name;
}

std::string FormulaRows::nameOfTable2(int number) {
  std::string& name = table2_names_[number];
  if (!name.empty()) return name;
  name = "map_" + std::to_string(number);
  const Table2& table = *graph_.tables2()[static_cast<std::size_t>(number)];
  std::vector<double> pieces;
  forEachPiece(table.pointsX(), [&](double /*x*/, double inside_x) {
    forEachPiece(table.pointsY(), [&](double /*y*/, double inside_y) {
      for (int i = 0; i <= Table::kDegree; ++i) {
        for (int j = 0; j <= Table::kDegree; ++j) {
          pieces.push_back(table.derivative({i, j}, inside_x, inside_y) /
                           (kFactorial[i] * kFactorial[j]));
        }
      }
    });
  });
  const auto points = [&](const char* axis, const std::vector<double>& values) {
    return "static const double " + name + "_" + axis + "[] = {\n    " + listOf(values) + "};\n";
  };
  tables_ += "\n/* " + harmless(table.origin()) + " */\n" + points("x", table.pointsX()) +
             points("y", table.pointsY()) + points("pieces", pieces) +
             "static const table_of_two " + name + " = {" + std::to_string(table.pointsX().size()) +
             ", " + std::to_string(table.pointsY().size()) + ", " + name + "_x, " + name + "_y, " +
             name + "_pieces};\n";
  return name;
}

std::string FormulaRows::tableOf(const Entry& entry, int /*result*/) {
  const bool has_two = entry.operation == Operation::kTable2;
  const std::string h = "r + " + std::to_string(rows_);
  const std::string side = "b + " + std::to_string(branches_);
  const std::string a = "p + " + std::to_string(pieces_);
  rows_ += has_two ? 11 : 6;
  branches_ += has_two ? 4 : 2;
  pieces_ += has_two ? 36 : 6;
  if (has_two) {
    return call("look_up_two",
                {h, operand(entry, 0), operand(entry, 1), "&" + nameOfTable2(entry.slot),
                 std::to_string(entry.order[0]), std::to_string(entry.order[1]), side, a});
  }
  return call("look_up", {h, operand(entry, 0), "&" + nameOfTable(entry.slot),
                          std::to_string(entry.order[0]), side, a});
}

}  // namespace variator_sim
