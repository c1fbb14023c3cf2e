// Whether the rows of a program are its functions all along a step, of the interpreter's rows.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "expression/series_program.h"

namespace variator_sim::expression {

namespace {
using Real = double;
#include "expression/series_resolution.inc"
//
#include "expression/series_ranges.inc"
}  // namespace

/// The operation that states an instruction's function; those of recurrences alone have none.
SeriesOperation SeriesProgram::operationOf(const Instruction& it) const {
  SeriesOperation made = {kSeriesSum, it.result, -1, it.operands[0], -1, 0, it.state,
                          kNoDegree,  0.0,       0.0};
  made.degree = degree(it.result);
  const auto with = [&](int kind, int b = -1, int second = -1) {
    made.kind = kind;
    made.b = b;
    made.second = second;
    return made;
  };
  switch (it.code) {
    case Code::kMultiply:
      return with(kSeriesProduct, it.operands[1]);
    case Code::kSquare:
      return with(kSeriesProduct, it.operands[0]);
    case Code::kDivide:
      return with(kSeriesQuotient, it.operands[1]);
    case Code::kExp:
      return with(kSeriesExp);
    case Code::kSinCos:
      return with(kSeriesSine, -1, it.aux[0]);
    case Code::kSinhCosh:
      return with(kSeriesSinh, -1, it.aux[0]);
    case Code::kTan:
      return with(kSeriesTan, -1, it.aux[0]);
    case Code::kTanh:
      return with(kSeriesTanh, -1, it.aux[0]);
    case Code::kPrimitive:
      switch (it.begin) {
        case Begin::kLog:
          return with(kSeriesLog);
        case Begin::kAtan:
          return with(kSeriesAtan);
        case Begin::kAsin:
          return with(kSeriesAsin);
        case Begin::kAcos:
          return with(kSeriesAcos);
        case Begin::kAtan2:
          break;
      }
      return with(kSeriesAtan2, it.operands[1]);
    case Code::kSqrt:
      return with(kSeriesSqrt);
    case Code::kPower:
      made.f = it.constant;
      return with(kSeriesPower);
    case Code::kAbs:
      made.f = 1.0;
      return made;
    case Code::kMin:
      return with(kSeriesEither, it.operands[1]);
    case Code::kMax:
      return with(kSeriesOther, it.operands[1]);
    case Code::kSelect:
      made.a = it.operands[2];
      return with(kSeriesEither, it.operands[3]);
    case Code::kWhereFinite:
      return with(kSeriesFinite, it.operands[1]);
    case Code::kTable:
    case Code::kTable2:
      made.f = 6.0;
      made.state = pieces_[static_cast<std::size_t>(it.state)].a;
      return with(kSeriesTable, it.code == Code::kTable2 ? it.operands[1] : -1);
    case Code::kLinear:
    case Code::kSign:
    case Code::kRate:
    case Code::kWronskian:
      break;
  }
  made.a = -1;
  return made;
}

void SeriesProgram::listResolved() {
  std::vector<char> is_needed(degree_.size(), 0);
  for (const int row : outputs_) is_needed[static_cast<std::size_t>(row)] = 1;
  const auto isNeeded = [&](int row) {
    return row >= 0 && is_needed[static_cast<std::size_t>(row)];
  };
  const auto need = [&](int row) {
    if (row >= 0) is_needed[static_cast<std::size_t>(row)] = 1;
  };
  resolved_.clear();
  for (auto it = instructions_.rbegin(); it != instructions_.rend(); ++it) {
    SeriesOperation made = operationOf(*it);
    if (!isNeeded(it->result) && !isNeeded(made.second)) continue;
    // The last two terms first, as the list is turned around.
    for (int n = it->code == Code::kLinear ? (it->aux[1] - 1) / 2 * 2 : -1; n >= 0; n -= 2) {
      const Term* const term = terms_.data() + it->aux[0] + n;
      const bool has_two = n + 1 < it->aux[1];
      made = {n == 0 ? kSeriesSum : kSeriesMore,
              it->result,
              -1,
              term[0].row,
              -1,
              0,
              -1,
              kNoDegree,
              0.0,
              0.0};
      made.f = term[0].factor;
      if (has_two) {
        made.b = term[1].row;
        made.g = term[1].factor;
        need(made.b);
      }
      need(made.a);
      resolved_.push_back(made);
    }
    if (it->code == Code::kLinear || made.a < 0) continue;
    need(made.a);
    need(made.b);
    resolved_.push_back(made);
  }
  std::reverse(resolved_.begin(), resolved_.end());
  // Products of products of variables.
  std::vector<int> power(degree_.size(), kNoDegree);
  for (const int row : variables_) power[static_cast<std::size_t>(row)] = 1;
  for (const auto& [row, value] : constants_) power[static_cast<std::size_t>(row)] = 0;
  for (SeriesOperation& it : resolved_) {
    const int a = power[static_cast<std::size_t>(it.a)];
    const int b = it.b < 0 ? 0 : power[static_cast<std::size_t>(it.b)];
    const int before = it.kind == kSeriesMore ? power[static_cast<std::size_t>(it.result)] : 0;
    if (it.kind == kSeriesProduct) it.power = std::min(a + b, kNoDegree);
    if (it.kind == kSeriesSum || it.kind == kSeriesMore) it.power = std::max({a, b, before});
    power[static_cast<std::size_t>(it.result)] = it.power;
  }
  ranges_.assign(degree_.size(), SeriesRange{});
}

bool SeriesProgram::isResolved(double theta, int order, const SeriesOutputs& outputs,
                               const double* const* at) const {
  SeriesResolution asked = {resolved_.data(),
                            static_cast<int>(resolved_.size()),
                            rows(),
                            static_cast<int>(2 * width_),
                            states(),
                            states_.data(),
                            ranges_.data(),
                            rowCount(),
                            &outputs,
                            {},
                            order,
                            theta,
                            {}};
  if (at != nullptr) std::copy_n(at, 3, asked.at);
  return seriesIsResolved(&asked) != 0;
}

bool SeriesProgram::mayHideBetween(const double* here, const double* there, int power) const {
  // A part of the distance within which an operation's Taylor series converges, or 1 where that is
  // unbounded: an argument that moves no further shows its function at both ends.
  constexpr double kFar = 0.4;
  for (const SeriesOperation& it : resolved_) {
    if (it.kind <= kSeriesFinite || it.power <= power) continue;
    const auto first = [&](int row) { return here[row]; };
    const auto move = [&](int row) { return std::abs(there[row] - here[row]); };
    const double size = std::abs(first(it.a));
    const double moved = move(it.a);
    bool is_far = false;
    switch (it.kind) {
      case kSeriesProduct:
        is_far = moved > kFar * size || move(it.b) > kFar * std::abs(first(it.b));
        break;
      case kSeriesQuotient:
        is_far = move(it.b) > kFar * std::abs(first(it.b));
        break;
      case kSeriesTanh:
        is_far = moved > kFar && size - moved < 19.1;
        break;
      case kSeriesTan:
        is_far = moved * moved * first(it.second) > kFar * kFar;
        break;
      case kSeriesAsin:
      case kSeriesAcos:
        is_far = moved > kFar * (1.0 - size);
        break;
      case kSeriesAtan2:
        is_far = moved + move(it.b) > kFar * std::hypot(first(it.a), first(it.b));
        break;
      case kSeriesLog:
      case kSeriesSqrt:
        is_far = moved > kFar * size;
        break;
      case kSeriesPower:
        is_far = std::max(1.0, std::abs(it.f)) * moved > kFar * size;
        break;
      case kSeriesTable:  // whose pieces steps end at
        break;
      default:
        is_far = moved > kFar;
        break;
    }
    if (is_far) return true;
  }
  return false;
}

}  // namespace variator_sim::expression
