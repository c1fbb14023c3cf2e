#include "emit_c/formula_rows.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "emit_c/c_text.h"

namespace variator_sim {

using expression::SeriesProgram;

std::string literalOf(double value) {
  if (std::isnan(value)) return "NAN";
  if (std::isinf(value)) return value > 0.0 ? "INFINITY" : "-INFINITY";
  char text[40];
  std::string literal(text, std::to_chars(text, std::end(text), value).ptr);  // the shortest
  if (literal.find_first_of(".en") == std::string::npos) literal += ".0";
  return literal;
}

namespace {

template <class Values, class Write>
std::string join(const Values& values, Write write) {
  constexpr std::size_t kColumns = 92;
  std::string text;
  std::size_t begin = 0;
  for (const auto& value : values) {
    const std::string word = write(value);
    const bool is_full = text.size() - begin + word.size() > kColumns;
    if (!text.empty()) text += is_full ? ",\n    " : ", ";
    if (is_full) begin = text.size() - 4;
    text += word;
  }
  return text.empty() ? "0" : text;
}

std::size_t index(int n) {
  return static_cast<std::size_t>(n);
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

FormulaRows::FormulaRows(const SeriesProgram& program, int series)
    : SeriesStatements(program), in_series_(findSeries(series)), rows_(program.rowCount()) {
  for (const int row : program_.accelerations_) {
    add(Part::kCorrected, "const Real " + change(row) + " = de[" +
                              std::to_string(row - program_.accelerations_.front()) + "];");
    add(Part::kCorrected, "(void)" + change(row) + ";");
  }
  for (std::size_t n = 0; n < program_.instructions_.size(); ++n) {
    const Instruction& it = program_.instructions_[n];
    const bool is_series = in_series_.count(static_cast<int>(n)) > 0;
    const bool is_tried = program_.isAccelerated(it.result) && it.is_tried;
    noteGrowth(it);
    const std::string statement = statementOf(it);
    add(!is_series                           ? Part::kAtOnce
        : !program_.isAccelerated(it.result) ? Part::kGiven
        : is_tried                           ? Part::kTried
                                             : Part::kRest,
        statement);
    if (is_series && is_tried) add(Part::kCorrected, correct(it, statement, !mayReachLimit(it)));
  }
}

std::set<int> FormulaRows::findSeries(int outputs) const {
  std::vector<int> open(program_.outputs_.begin(), program_.outputs_.begin() + outputs);
  std::map<int, int> producer;
  for (std::size_t n = 0; n < program_.instructions_.size(); ++n) {
    const Instruction& it = program_.instructions_[n];
    producer[it.result] = static_cast<int>(n);
    if (it.code != Code::kLinear && it.aux[0] >= 0) producer[it.aux[0]] = static_cast<int>(n);
  }
  std::set<int> needed;
  while (!open.empty()) {
    const auto found = producer.find(open.back());
    open.pop_back();
    if (found == producer.end() || !needed.insert(found->second).second) continue;
    const Instruction& it = program_.instructions_[index(found->second)];
    open.insert(open.end(), std::begin(it.operands), std::end(it.operands));
    for (int n = 0; it.code == Code::kLinear && n < it.aux[1]; ++n) {
      open.push_back(program_.terms_[index(it.aux[0] + n)].row);
    }
  }
  return needed;
}

void FormulaRows::noteGrowth(const Instruction& it) {
  bool grows = it.code == Code::kExp || it.code == Code::kSinhCosh;
  if (it.code == Code::kLinear) {
    for (int n = 0; n < it.aux[1]; ++n) {
      grows = grows || grows_.count(program_.terms_[index(it.aux[0] + n)].row);
    }
  }
  for (const int operand : it.operands) grows = grows || grows_.count(operand) > 0;
  if (!grows) return;
  grows_.insert(it.result);
  if (it.code == Code::kSinhCosh) grows_.insert(it.aux[0]);
}

void FormulaRows::add(Part part, const std::string& text) {
  text_[static_cast<std::size_t>(part)] += "  " + text + "\n";
}

bool FormulaRows::mayReachLimit(const Instruction& it) const {
  const bool has_limit = it.code == Code::kDivide || it.code == Code::kTanh ||
                         it.code == Code::kExp ||
                         (it.code >= Code::kLog && it.code <= Code::kAtan2);
  const int of = it.operands[it.code == Code::kDivide ? 1 : 0];
  return has_limit && grows_.count(of) > 0 && !program_.has_pole_[index(of)];
}

std::vector<expression::SeriesOperation> FormulaRows::resolved() const {
  std::set<int> made;
  for (const int n : in_series_) {
    made.insert(program_.instructions_[index(n)].result);
  }
  std::vector<expression::SeriesOperation> list;
  for (expression::SeriesOperation it : program_.resolved()) {
    if (made.count(it.result) == 0) continue;
    if (it.kind == expression::kSeriesTable) {
      it.state = piece_of_row_.at(it.result);
      if (it.b < 0) it.f = 1.0;  // the piece's six coefficients lie next to each other here
    } else if (it.kind == expression::kSeriesEither || it.kind == expression::kSeriesOther) {
      it.state = mode_of_state_.at(it.state);
    }
    list.push_back(it);
  }
  return list;
}

std::string FormulaRows::statementOf(const Instruction& it) {
  if (it.code == Code::kTable) return tableOf(it);
  if (it.code == Code::kTable2) return tableOfTwo(it);
  if (it.code == Code::kAbs || (it.code >= Code::kMin && it.code <= Code::kSelect)) {
    mode_of_state_.try_emplace(it.state, modes_++);
  }
  const std::string call = compute(it);
  if (it.ends < expression::SeriesProgram::kNoDegree || !mayReachLimit(it)) return call;
  const std::string y = row(it.result);
  const int of = it.operands[it.code == Code::kDivide ? 1 : 0];
  return "if (vs_is_at_limit(" + row(of) + ", " + y + ", n)) " + y + "[n] = 0.0;\n  else " + call;
}

std::string FormulaRows::number(double value, std::size_t /*place*/) const {
  return literalOf(value);
}

std::string FormulaRows::mode(const Instruction& it) const {
  return "s + " + std::to_string(mode_of_state_.at(it.state));
}

std::string FormulaRows::define(const std::string& type, const std::string& origin,
                                const std::vector<std::vector<double>>& points,
                                const std::vector<double>& pieces) {
  std::string counts;
  std::string names;
  std::string text;
  for (std::size_t n = 0; n < points.size(); ++n) {
    const std::string name = "NAME_" + std::string(1, static_cast<char>('x' + n));
    text += "static const double " + name + "[] = {\n    " + listOf(points[n]) + "};\n";
    counts += std::to_string(points[n].size()) + ", ";
    names += name + ", ";
  }
  text += "static const double NAME_pieces[] = {\n    " + listOf(pieces) + "};\n";
  std::string& name = table_names_[text];
  if (!name.empty()) return name;
  name = "table_" + std::to_string(table_names_.size());
  text = "\n/* " + harmless(origin) + " */\n" + text + "static const vs_" + type + " NAME = {" +
         counts + names + "NAME_pieces};\n";
  replaceAll(text, "NAME", name);
  tables_ += text;
  return name;
}

std::string FormulaRows::tableOf(const Instruction& it) {
  const Piece& piece = program_.pieces_[index(it.state)];
  constexpr int kRows = 3;
  constexpr int kModes = 3;
  std::vector<double> pieces;
  forEachPiece(piece.table->points(), [&](double x, double inside) {
    for (int i = 0; i <= Table::kDegree; ++i) {
      const int n = piece.order[0] + i;
      const bool is_none = n > Table::kDegree;
      pieces.push_back((is_none ? 0.0 : piece.table->derivative(n, n < 3 ? x : inside)) /
                       kFactorial[i]);
    }
  });
  const std::string name = define("table", piece.table->origin(), {piece.table->points()}, pieces);
  std::string text = "vs_look_up(" + row(it.result) + ", r + " + std::to_string(rows_) + ", " +
                     row(it.operands[0]) + ", &" + name + ", s + " + std::to_string(modes_) +
                     ", a + " + std::to_string(pieces_) + ", n);";
  piece_of_row_[it.result] = pieces_;
  rows_ += kRows;
  modes_ += kModes;
  pieces_ += Table::kDegree + 1;
  return text;
}

std::string FormulaRows::tableOfTwo(const Instruction& it) {
  const Piece& piece = program_.pieces_[index(it.state)];
  const Table2& table = *piece.table2;
  constexpr int kRows = 11;
  constexpr int kModes = 4;
  std::vector<double> pieces;
  forEachPiece(table.pointsX(), [&](double /*x*/, double inside_x) {
    forEachPiece(table.pointsY(), [&](double /*y*/, double inside_y) {
      for (int i = 0; i <= Table::kDegree; ++i) {
        for (int j = 0; j <= Table::kDegree; ++j) {
          const int m = piece.order[0] + i;
          const int n = piece.order[1] + j;
          const bool is_none = std::max(m, n) > Table::kDegree;
          pieces.push_back((is_none ? 0.0 : table.derivative({m, n}, inside_x, inside_y)) /
                           (kFactorial[i] * kFactorial[j]));
        }
      }
    });
  });
  const std::string name =
      define("table_of_two", table.origin(), {table.pointsX(), table.pointsY()}, pieces);
  std::string text = "vs_look_up_two(r + " + std::to_string(rows_) + ", " + row(it.operands[0]) +
                     ", " + row(it.operands[1]) + ", &" + name + ", s + " + std::to_string(modes_) +
                     ", a + " + std::to_string(pieces_) + ", n);\n  " + row(it.result) +
                     "[n] = " + row(rows_) + "[n];";
  rows_ += kRows;
  modes_ += kModes;
  piece_of_row_[it.result] = pieces_;
  pieces_ += (Table::kDegree + 1) * (Table::kDegree + 1);
  return text;
}

}  // namespace variator_sim
