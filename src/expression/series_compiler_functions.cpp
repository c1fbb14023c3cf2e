// Instructions of functions, branches and tables: a row, and the rows that its recurrence needs.
#include <algorithm>
#include <stdexcept>
#include <vector>

#include "expression/opaque_slope.h"
#include "expression/series_compiler.h"

namespace variator_sim::expression {

int SeriesCompiler::rate(int x) {
  int& row = rate_of_.try_emplace(x, -1).first->second;
  if (row >= 0) return row;
  Instruction it;
  it.code = Code::kRate;
  it.operands[0] = x;
  const bool is_polynomial = degree(x) < SeriesProgram::kNoDegree;
  row = append(it, {}, is_polynomial ? std::max(0, degree(x) - 1) : SeriesProgram::kNoDegree);
  return row;
}

int SeriesCompiler::exponential(int x) {
  Instruction it;
  it.code = Code::kExp;
  it.operands[0] = x;
  it.operands[1] = rate(x);
  return append(it, {}, SeriesProgram::kNoDegree);
}

int SeriesCompiler::pair(Code code, int x, bool second) {
  auto& rows = pair_of_.try_emplace({code, x}, std::pair<int, int>{-1, -1}).first->second;
  if (rows.first < 0) {
    Instruction it;
    it.code = code;
    it.operands[0] = x;
    it.operands[1] = rate(x);
    int other = -1;
    rows.first = append(it, {&other}, SeriesProgram::kNoDegree);
    made_.instructions_.back().aux[0] = rows.second = other;
  }
  return second ? rows.second : rows.first;
}

int SeriesCompiler::tangent(Code code, int x) {
  Instruction it;
  it.code = code;
  it.operands[0] = x;
  it.operands[1] = rate(x);
  int w = -1;
  const int row = append(it, {&w}, SeriesProgram::kNoDegree);
  made_.instructions_.back().aux[0] = w;
  return row;
}

int SeriesCompiler::primitive(Code code, int x, int y) {
  Instruction it;
  it.code = code;
  it.operands[0] = x;
  it.operands[1] = y;
  it.constant = code == Code::kAcos ? -1.0 : 1.0;
  Form one;
  one.constant = 1.0;
  const auto square = [this](int row) { return single(product(row, row)); };
  switch (code) {
    case Code::kLog:
      it.operands[2] = rate(x);
      it.operands[3] = x;
      break;
    case Code::kAtan: {
      Form w = combine(one, 1.0, square(x), 1.0);
      it.operands[2] = rate(x);
      it.operands[3] = rowOf(w);
      break;
    }
    case Code::kAsin:
    case Code::kAcos: {
      Form w = combine(one, 1.0, square(x), -1.0);
      it.operands[2] = rate(x);
      it.operands[3] = root(rowOf(w));
      break;
    }
    case Code::kAtan2: {
      // (x y' ..): the rate of atan2(x, y) is (y x' - x y') / (x^2 + y^2)
      Instruction wronskian;
      wronskian.code = Code::kWronskian;
      wronskian.operands[0] = y;
      wronskian.operands[1] = x;
      wronskian.operands[2] = rate(y);
      wronskian.operands[3] = rate(x);
      it.operands[2] = append(wronskian, {}, SeriesProgram::kNoDegree);
      Form w = combine(square(x), 1.0, square(y), 1.0);
      it.operands[3] = rowOf(w);
      break;
    }
    default:
      break;
  }
  int q = -1;
  const int row = append(it, {&q}, SeriesProgram::kNoDegree);
  made_.instructions_.back().aux[0] = q;
  return row;
}

int SeriesCompiler::root(int x) {
  Instruction it;
  it.code = Code::kSqrt;
  it.operands[0] = x;
  return append(it, {}, SeriesProgram::kNoDegree);
}

SeriesCompiler::Form SeriesCompiler::function(const Graph::Entry& entry) {
  const int a = rowOf(entry.operands[0]);
  switch (entry.operation) {
    case Operation::kSin:
    case Operation::kCos:
      return single(pair(Code::kSinCos, a, entry.operation == Operation::kCos));
    case Operation::kSinh:
    case Operation::kCosh:
      return single(pair(Code::kSinhCosh, a, entry.operation == Operation::kCosh));
    case Operation::kTan:
      return single(tangent(Code::kTan, a));
    case Operation::kTanh:
      return single(tangent(Code::kTanh, a));
    case Operation::kExp:
      return single(exponential(a));
    case Operation::kLog:
      return single(primitive(Code::kLog, a, -1));
    case Operation::kAtan:
      return single(primitive(Code::kAtan, a, -1));
    case Operation::kAsin:
      return single(primitive(Code::kAsin, a, -1));
    case Operation::kAcos:
      return single(primitive(Code::kAcos, a, -1));
    case Operation::kAtan2:
      return single(primitive(Code::kAtan2, a, rowOf(entry.operands[1])));
    case Operation::kSqrt:
      return single(root(a));
    case Operation::kTable:
    case Operation::kTable2:
      return single(table(entry, a));
    case Operation::kOpaque:
      return single(opaque(entry, a));
    default:
      return single(branch(entry, a));
  }
}

int SeriesCompiler::branch(const Graph::Entry& entry, int a) {
  Instruction it;
  switch (entry.operation) {
    case Operation::kAbs:
      it.code = Code::kAbs;
      break;
    case Operation::kSign:
      it.code = Code::kSign;
      break;
    case Operation::kMin:
      it.code = Code::kMin;
      break;
    case Operation::kMax:
      it.code = Code::kMax;
      break;
    case Operation::kSelect:
      it.code = Code::kSelect;
      break;
    case Operation::kWhereFinite:
      it.code = Code::kWhereFinite;
      break;
    default:
      throw std::invalid_argument("a function without a series");
  }
  it.operands[0] = a;
  int highest = degree(a);
  for (int k = 1; k < operandCount(entry.operation); ++k) {
    it.operands[k] = rowOf(entry.operands[k]);
    highest = std::max(highest, degree(it.operands[k]));
  }
  it.state = addState();
  return append(it, {}, entry.operation == Operation::kSign ? 0 : highest);
}

int SeriesCompiler::table(const Graph::Entry& entry, int a) {
  SeriesProgram::Piece piece;
  const bool has_two = entry.operation == Operation::kTable2;
  Instruction it;
  it.operands[0] = a;
  piece.order[0] = entry.order[0];
  piece.order[1] = entry.order[1];
  const int degree = has_two ? graph_.table2Of(entry)->degree() : graph_.tableOf(entry)->degree();
  piece.degree[0] = degree - entry.order[0];
  piece.degree[1] = has_two ? degree - entry.order[1] : 0;
  bool is_accelerated = made_.isAccelerated(a);
  if (has_two) {
    it.code = Code::kTable2;
    it.operands[1] = rowOf(entry.operands[1]);
    is_accelerated = is_accelerated || made_.isAccelerated(it.operands[1]);
    piece.table2 = graph_.table2Of(entry);
  } else {
    it.code = Code::kTable;
    piece.table = graph_.tableOf(entry);
  }
  it.state = static_cast<int>(made_.pieces_.size());
  made_.pieces_.push_back(piece);
  // (A held value is no constant: the next piece has another one.)
  const bool is_polynomial = !has_two && made_.degree(a) <= 4;
  it.result =
      addRow(is_polynomial ? std::max(1, degree * made_.degree(a)) : SeriesProgram::kNoDegree,
             is_accelerated);
  return place(it, {it.result});
}

int SeriesCompiler::opaque(const Graph::Entry& entry, int a) {
  SeriesProgram::Piece piece;
  piece.function = graph_.opaqueOf(entry);
  if (entry.order[0] > 0) {
    piece.function = std::make_shared<const OpaqueSlope>(piece.function, entry.order[0]);
  }
  Instruction it;
  it.code = Code::kOpaque;
  it.operands[0] = a;
  for (int k = 1; k < piece.function->argumentCount(); ++k) {
    it.operands[k] = rowOf(entry.operands[k]);
  }
  it.state = static_cast<int>(made_.pieces_.size());
  made_.pieces_.push_back(piece);
  return append(it, {}, SeriesProgram::kNoDegree);
}

}  // namespace variator_sim::expression
