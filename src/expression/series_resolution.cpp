// The operations of a program, for the check that its rows resolve them along a step.
#include <algorithm>

#include "expression/series_program.h"

namespace variator_sim::expression {

/// Returns the operation of an instruction's function; instructions of recurrences alone have none.
SeriesOperation SeriesProgram::operationOf(const Instruction& it) const {
  constexpr int kKinds[] = {kSeriesNone,
#define VARIATOR_SIM_KIND(code, kind, call) kind,
                            VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_KIND)
#undef VARIATOR_SIM_KIND
                                kSeriesTable,
                            kSeriesTable, kSeriesOpaque};
  SeriesOperation made = {kSeriesSum, it.result, -1, it.operands[0], -1, 0, it.state,
                          kNoDegree,  0.0,       0.0};
  made.kind = kKinds[static_cast<int>(it.code)];
  const bool is_of_two =
      made.kind <= kSeriesQuotient || made.kind == kSeriesAtan2 || made.kind == kSeriesTable;
  if (is_of_two) made.b = it.operands[1];
  made.degree = degree(it.result);
  if (it.code == Code::kSquare) made.b = made.a;
  if (made.kind >= kSeriesSine && made.kind <= kSeriesTanh) made.second = it.aux[0];
  if (it.code == Code::kPower) made.f = it.constant;
  if (it.code == Code::kAbs) made.f = 1.0;
  if (it.code == Code::kSelect) {
    made.a = it.operands[2];
    made.b = it.operands[3];
  }
  if (made.kind == kSeriesTable) {
    made.f = 6.0;
  }
  if (made.kind == kSeriesNone) made.a = -1;
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
    // The last two terms come first, as the list is reversed.
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
    for (int n = it->code == Code::kOpaque ? 2 : 0; n >= 0; n -= 2) {
      if (n > 0 && it->operands[n] < 0) continue;
      if (it->code == Code::kOpaque) {
        made.a = it->operands[n];
        made.b = it->operands[n + 1];
        made.state = n;
      }
      need(made.a);
      need(made.b);
      resolved_.push_back(made);
    }
  }
  std::reverse(resolved_.begin(), resolved_.end());
  // Along parabolas of the variables, time being the first of them: sums and products of these.
  std::vector<int> power(degree_.size(), kNoDegree);
  for (const int row : variables_) power[static_cast<std::size_t>(row)] = 2;
  power[static_cast<std::size_t>(variables_.front())] = 1;
  for (const auto& [row, value] : constants_) power[static_cast<std::size_t>(row)] = 0;
  for (SeriesOperation& it : resolved_) {
    const int a = power[static_cast<std::size_t>(it.a)];
    const int b = it.b < 0 ? 0 : power[static_cast<std::size_t>(it.b)];
    const int before = it.kind == kSeriesMore ? power[static_cast<std::size_t>(it.result)] : 0;
    if (it.kind == kSeriesProduct) it.power = std::min(a + b, kNoDegree);
    if (it.kind < kSeriesOpaque) it.power = std::max({a, b, before});
    power[static_cast<std::size_t>(it.result)] = it.power;
  }
}

}  // namespace variator_sim::expression
