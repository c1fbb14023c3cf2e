#include "expression/series_arranger.h"

#include <cstddef>
#include <utility>

namespace variator_sim::expression {

SeriesArranger::Operation SeriesArranger::begin(int index, Kind kind) const {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  Operation made;
  made.kind = kind;
  made.instruction = index;
  made.result = place(it.result);
  made.rows[0] = it.result;
  return made;
}

SeriesArranger::Operation SeriesArranger::sum(int index) {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  const auto term = [&](int n) -> const SeriesProgram::Term& {
    return made_.terms_[static_cast<std::size_t>(it.aux[0]) + static_cast<std::size_t>(n)];
  };
  Operation made = begin(index, it.aux[1] == 1   ? Kind::kSumOfOne
                                : it.aux[1] == 2 ? Kind::kSumOfTwo
                                                 : Kind::kSum);
  if (it.aux[1] <= 2) {
    made.a = place(term(0).row);
    made.factors[0] = term(0).factor;
    if (it.aux[1] == 1) return made;
    made.b = place(term(1).row);
    made.factors[1] = term(1).factor;
    return made;
  }
  made.a = static_cast<int>(made_.placed_.size());
  for (int n = 0; n < it.aux[1]; ++n) {
    made_.placed_.push_back({place(term(n).row), term(n).factor});
  }
  made.b = static_cast<int>(made_.placed_.size());
  return made;
}

SeriesArranger::Operation SeriesArranger::arrange(int index) {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  const auto make = [&](Kind kind, int a, int b, int c = -1) {
    Operation made = begin(index, kind);
    made.a = place(a);
    made.b = place(b);
    made.c = place(c);
    if (a >= 0) made.limits[0] = made_.degree(a);
    if (b >= 0) made.limits[1] = made_.degree(b);
    made.factors[0] = it.constant;
    return made;
  };
  const int a = it.operands[0];
  const int b = it.operands[1];
  switch (it.code) {
    case Code::kLinear:
      return sum(index);
    case Code::kMultiply: {
      const bool ends =
          made_.degree(a) < SeriesProgram::kNoDegree || made_.degree(b) < SeriesProgram::kNoDegree;
      return make(ends ? Kind::kShortProduct : Kind::kProduct, a, b);
    }
    case Code::kSquare:
      return make(Kind::kSquare, a, -1);
    case Code::kDivide:
      return make(Kind::kQuotient, a, b, it.result);
    case Code::kRate:
      return make(Kind::kRate, a, -1);
    case Code::kExp:
      return make(Kind::kExp, b, it.result);
    case Code::kSinCos:
    case Code::kSinhCosh: {
      Operation made = make(Kind::kPair, b, it.aux[0]);
      made.factors[0] = it.code == Code::kSinCos ? -1.0 : 1.0;
      return made;
    }
    case Code::kTan:
    case Code::kTanh: {
      Operation made = make(Kind::kTangent, b, it.aux[0]);
      made.factors[0] = it.code == Code::kTan ? 1.0 : -1.0;
      return made;
    }
    case Code::kPower:
      return make(Kind::kPower, b, a);
    case Code::kSqrt:
      return make(Kind::kSqrt, a, -1);
    case Code::kPrimitive:
      return make(Kind::kPrimitive, it.operands[2], it.operands[3], it.aux[0]);
    case Code::kWronskian:
    case Code::kAbs:
    case Code::kSign:
    case Code::kMin:
    case Code::kMax:
    case Code::kSelect:
    case Code::kWhereFinite:
    case Code::kTable:
    case Code::kTable2:
      break;
  }
  return begin(index, Kind::kOther);
}

SeriesArranger::Operation SeriesArranger::changeOfProduct(int index) const {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  const int a = it.operands[0];
  const int b = it.code == Code::kSquare ? a : it.operands[1];
  Operation made = begin(index, !made_.isAccelerated(a)   ? Kind::kChangeOfSecond
                                : !made_.isAccelerated(b) ? Kind::kChangeOfFirst
                                                          : Kind::kChangeOfProduct);
  made.a = place(a);
  made.b = place(b);
  made.rows[1] = a;
  made.rows[2] = b;
  return made;
}

SeriesArranger::Operation SeriesArranger::changeOfSum(int index) {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  Operation made = begin(index, Kind::kChangeOfSum);
  made.a = static_cast<int>(made_.placed_.size());
  for (int n = it.aux[0]; n < it.aux[0] + it.aux[1]; ++n) {
    const SeriesProgram::Term& term = made_.terms_[static_cast<std::size_t>(n)];
    if (made_.isAccelerated(term.row)) made_.placed_.push_back({term.row, term.factor});
  }
  made.b = static_cast<int>(made_.placed_.size());
  return made;
}

SeriesArranger::Operation SeriesArranger::noteChange(Kind kind, int row) const {
  Operation made;
  made.kind = kind;
  made.a = place(row);
  made.rows[0] = row;
  return made;
}

void SeriesArranger::arrangeChange(int index, std::vector<Operation>* operations) {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  if (it.code == Code::kMultiply || it.code == Code::kSquare) {
    operations->push_back(changeOfProduct(index));
    return;
  }
  if (it.code == Code::kLinear) {
    operations->push_back(changeOfSum(index));
    return;
  }
  std::vector<int> written = {it.result};
  if (it.code == Code::kSinCos || it.code == Code::kSinhCosh) written.push_back(it.aux[0]);
  for (const int row : written) operations->push_back(noteChange(Kind::kBefore, row));
  operations->push_back(arrange(index));
  for (const int row : written) operations->push_back(noteChange(Kind::kAfter, row));
}

bool SeriesArranger::isWritten(int index, int order) const {
  const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
  // A rate is written one order after its operand.
  const int ends = made_.degree(it.result) + (it.code == Code::kRate ? 1 : 0);
  return order <= ends;
}

std::vector<SeriesArranger::Operation> SeriesArranger::arrangeOrder(int order) {
  using Part = SeriesProgram::Part;
  std::vector<Operation> operations;
  const auto program = [this](Part part) {
    return made_.programs_[static_cast<std::size_t>(part)];
  };
  for (const Part part : {Part::kGiven, Part::kTrial}) {
    for (const int index : program(part)) {
      if (isWritten(index, order)) operations.push_back(arrange(index));
    }
  }
  Operation solve;
  solve.kind = Kind::kSolve;
  operations.push_back(solve);
  for (const int row : made_.accelerations_) {
    operations.push_back(noteChange(Kind::kAppearing, row));
  }
  for (const int index : program(Part::kAccelerated)) {
    if (made_.instructions_[static_cast<std::size_t>(index)].is_tried) {
      arrangeChange(index, &operations);
    } else {
      operations.push_back(arrange(index));
    }
  }
  return operations;
}

void SeriesArranger::arrange() {
  made_.operations_[0] = arrangeOrder(1);
  made_.operations_[1] = arrangeOrder(SeriesProgram::kLongest + 1);
}

}  // namespace variator_sim::expression
