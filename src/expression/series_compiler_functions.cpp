// Instructions of functions, branches and tables: a row, and the rows that its recurrence needs.
#include <algorithm>
#include <map>

#include "expression/series_compiler.h"

namespace variator_sim::expression {

int SeriesCompiler::rate(int x) {
  int& row = rate_of_.try_emplace(x, -1).first->second;
  if (row >= 0) return row;
  const bool is_polynomial = degree(x) < SeriesProgram::kNoDegree;
  row = append(instruction(Code::kRate, {x}),
               is_polynomial ? std::max(0, degree(x) - 1) : SeriesProgram::kNoDegree);
  return row;
}

int SeriesCompiler::exponential(int x) {
  return append(instruction(Code::kExp, {x, rate(x)}), SeriesProgram::kNoDegree);
}

int SeriesCompiler::withSecond(const Instruction& it) {
  const int row = append(it, SeriesProgram::kNoDegree);
  made_.instructions_.back().aux[0] = addRow(SeriesProgram::kNoDegree, made_.isAccelerated(row));
  return row;
}

int SeriesCompiler::pair(Code code, int x, bool second) {
  auto& rows = pair_of_.try_emplace({code, x}, std::pair<int, int>{-1, -1}).first->second;
  if (rows.first < 0) {
    rows.first = withSecond(instruction(code, {x, rate(x)}));
    rows.second = made_.instructions_.back().aux[0];
  }
  return second ? rows.second : rows.first;
}

int SeriesCompiler::primitive(Code code, int x, int y) {
  Instruction it = instruction(code, {x, y});
  it.constant = code == Code::kAcos ? -1.0 : 1.0;
  Form one;
  one.constant = 1.0;
  const auto square = [this](int row) { return single(product(row, row)); };
  Form w;
  if (code == Code::kAtan2) {
    // (x y' ..): the rate of atan2(x, y) is (y x' - x y') / (x^2 + y^2)
    it.operands[2] =
        append(instruction(Code::kWronskian, {y, x, rate(y), rate(x)}), SeriesProgram::kNoDegree);
    w = combine(square(x), 1.0, square(y), 1.0);
  } else if (code == Code::kLog) {
    w = single(x);
  } else {
    w = combine(one, 1.0, square(x), code == Code::kAtan ? 1.0 : -1.0);
  }
  if (code != Code::kAtan2) it.operands[2] = rate(x);
  it.operands[3] = rowOf(w);
  if (code == Code::kAsin || code == Code::kAcos) it.operands[3] = root(it.operands[3]);
  return withSecond(it);
}

int SeriesCompiler::root(int x) {
  return append(instruction(Code::kSqrt, {x}), SeriesProgram::kNoDegree);
}

SeriesCompiler::Form SeriesCompiler::function(const Graph::Entry& entry) {
  static const std::map<Operation, Code> codes = {
      {Operation::kSin, Code::kSinCos},    {Operation::kCos, Code::kSinCos},
      {Operation::kTan, Code::kTan},       {Operation::kAsin, Code::kAsin},
      {Operation::kAcos, Code::kAcos},     {Operation::kAtan, Code::kAtan},
      {Operation::kAtan2, Code::kAtan2},   {Operation::kSinh, Code::kSinhCosh},
      {Operation::kCosh, Code::kSinhCosh}, {Operation::kTanh, Code::kTanh},
      {Operation::kExp, Code::kExp},       {Operation::kLog, Code::kLog},
      {Operation::kSqrt, Code::kSqrt},     {Operation::kAbs, Code::kAbs},
      {Operation::kSign, Code::kSign},     {Operation::kMin, Code::kMin},
      {Operation::kMax, Code::kMax},       {Operation::kTable, Code::kTable},
      {Operation::kTable2, Code::kTable2}, {Operation::kOpaque, Code::kOpaque},
      {Operation::kSelect, Code::kSelect}, {Operation::kWhereFinite, Code::kWhereFinite}};
  const int a = rowOf(entry.operands[0]);
  const Code code = codes.at(entry.operation);
  switch (code) {
    case Code::kSinCos:
      return single(pair(code, a, entry.operation == Operation::kCos));
    case Code::kSinhCosh:
      return single(pair(code, a, entry.operation == Operation::kCosh));
    case Code::kTan:
    case Code::kTanh:
      return single(withSecond(instruction(code, {a, rate(a)})));
    case Code::kExp:
      return single(exponential(a));
    case Code::kLog:
    case Code::kAtan:
    case Code::kAsin:
    case Code::kAcos:
      return single(primitive(code, a, -1));
    case Code::kAtan2:
      return single(primitive(code, a, rowOf(entry.operands[1])));
    case Code::kSqrt:
      return single(root(a));
    case Code::kTable:
    case Code::kTable2:
      return single(table(entry, a));
    case Code::kOpaque:
      return single(opaque(entry, a));
    default:
      return single(branch(code, entry, a));
  }
}

int SeriesCompiler::branch(Code code, const Graph::Entry& entry, int a) {
  Instruction it = instruction(code, {a});
  int highest = degree(a);
  for (int k = 1; k < operandCount(entry.operation); ++k) {
    it.operands[k] = rowOf(entry.operands[k]);
    highest = std::max(highest, degree(it.operands[k]));
  }
  it.state = made_.states_++;
  return append(it, code == Code::kSign ? 0 : highest);
}

int SeriesCompiler::table(const Graph::Entry& entry, int a) {
  SeriesProgram::Piece piece;
  piece.table = graph_.tableOf(entry);
  const bool has_two = entry.operation == Operation::kTable2;
  Instruction it = instruction(has_two ? Code::kTable2 : Code::kTable, {a});
  piece.order[0] = entry.order[0];
  piece.order[1] = entry.order[1];
  const int degree = piece.table->degree();
  piece.degree[0] = degree - entry.order[0];
  piece.degree[1] = has_two ? degree - entry.order[1] : 0;
  if (has_two) it.operands[1] = rowOf(entry.operands[1]);
  it.state = static_cast<int>(made_.pieces_.size());
  made_.pieces_.push_back(piece);
  // (A held value is no constant: the next piece has another one.)
  const bool is_polynomial = !has_two && made_.degree(a) <= 4;
  const int row =
      append(it, is_polynomial ? std::max(1, degree * made_.degree(a)) : SeriesProgram::kNoDegree);
  made_.has_pole_.back() = false;
  return row;
}

int SeriesCompiler::opaque(const Graph::Entry& entry, int a) {
  SeriesProgram::Piece piece;
  piece.function = graph_.opaqueOf(entry);
  Instruction it = instruction(Code::kOpaque, {a});
  for (int k = 1; k < piece.function->argumentCount(); ++k) {
    it.operands[k] = rowOf(entry.operands[k]);
  }
  it.state = static_cast<int>(made_.pieces_.size());
  made_.pieces_.push_back(piece);
  return append(it, SeriesProgram::kNoDegree);
}

}  // namespace variator_sim::expression
