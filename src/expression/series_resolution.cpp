// Finds the operations that a program's rows follow from, for the check that the rows resolve them
// along a step, and the instructions.
#include <algorithm>
#include <iterator>
#include <map>
#include <set>

#include "expression/series_program.h"

namespace variator_sim::expression {

/// Returns the operations of an instruction that its result follows from, the last one first;
/// instructions of recurrences alone have none.
std::vector<SeriesOperation> SeriesProgram::operationsOf(const Instruction& it) const {
  constexpr int kKinds[] = {kSeriesNone,
#define VARIATOR_SIM_KIND(code, kind, call) kind,
                            VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_KIND)
#undef VARIATOR_SIM_KIND
                                kSeriesTable,
                            kSeriesTable, kSeriesOpaque};
  SeriesOperation made = {kSeriesSum, it.result, -1, it.operands[0], -1, 0, it.mode,
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
    made.state = it.piece;
    made.f = made.b < 0 ? 1.0 : Table::kDegree + 1.0;  // from a power of a to the next
  }
  if (made.kind == kSeriesNone) made.a = -1;

  std::vector<SeriesOperation> operations;
  if (it.code == Code::kLinear) {
    made.degree = 0;
    for (int n = (it.aux[1] - 1) / 2 * 2; n >= 0; n -= 2) {
      const Term* const term = terms_.data() + it.aux[0] + n;
      const bool has_two = n + 1 < it.aux[1];
      made.kind = n == 0 ? kSeriesSum : kSeriesMore;
      made.a = term[0].row;
      made.f = term[0].factor;
      made.b = has_two ? term[1].row : -1;
      made.g = has_two ? term[1].factor : 0.0;
      operations.push_back(made);
    }
  } else if (it.code == Code::kOpaque) {
    for (const int n : {2, 0}) {
      made.a = it.operands[n];
      made.b = it.operands[n + 1];
      made.state = it.piece + 1 + n;
      if (made.a >= 0) operations.push_back(made);
    }
  } else if (made.a >= 0) {
    operations.push_back(made);
  }
  return operations;
}

void SeriesProgram::listResolved() {
  std::set<int> needed(outputs_.begin(), outputs_.end());
  for (auto it = instructions_.rbegin(); it != instructions_.rend(); ++it) {
    const std::vector<SeriesOperation> operations = operationsOf(*it);
    if (needed.count(it->result) == 0 &&
        (operations.empty() || needed.count(operations[0].second) == 0)) {
      continue;
    }
    for (const SeriesOperation& made : operations) {
      needed.insert(made.a);
      if (made.b >= 0) needed.insert(made.b);
      if (it->part != Part::kAtOnce) resolved_.push_back(made);
    }
  }
  std::reverse(resolved_.begin(), resolved_.end());
  notePowers();
}

void SeriesProgram::notePowers() {
  // Time is the first of the variables.
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

std::vector<int> SeriesProgram::rowsReadBy(const Instruction& it) const {
  std::vector<int> rows;
  std::copy_if(std::begin(it.operands), std::end(it.operands), std::back_inserter(rows),
               [](int row) { return row >= 0; });
  if (it.code == Code::kLinear) {
    const Term* const terms = terms_.data() + it.aux[0];
    for (int n = 0; n < it.aux[1]; ++n) rows.push_back(terms[n].row);
  }
  return rows;
}

std::vector<bool> SeriesProgram::findNeeded(std::size_t count) const {
  std::vector<int> open(outputs_.begin(), outputs_.begin() + static_cast<std::ptrdiff_t>(count));
  std::map<int, std::size_t> producer;
  for (std::size_t n = 0; n < instructions_.size(); ++n) {
    const Instruction& it = instructions_[n];
    producer[it.result] = n;
    if (it.code != Code::kLinear && it.aux[0] >= 0) producer[it.aux[0]] = n;
  }
  std::vector<bool> needed(instructions_.size(), false);
  while (!open.empty()) {
    const auto found = producer.find(open.back());
    open.pop_back();
    if (found == producer.end() || needed[found->second]) continue;
    needed[found->second] = true;
    const std::vector<int> read = rowsReadBy(instructions_[found->second]);
    open.insert(open.end(), read.begin(), read.end());
  }
  return needed;
}

void SeriesProgram::findPlaces(std::size_t tried, std::size_t series) {
  const std::vector<bool> is_tried = findNeeded(tried);
  const std::vector<bool> is_series = findNeeded(series);
  std::vector<bool> grows(degree_.size());
  for (std::size_t n = 0; n < instructions_.size(); ++n) {
    Instruction& it = instructions_[n];
    // A rate is written one order after its operand.
    it.ends = degree(it.result) + (it.code == Code::kRate ? 1 : 0);
    it.last = it.operands[1] < 0 ? 0 : degree(it.operands[1]);
    it.part = !is_series[n]               ? Part::kAtOnce
              : !isAccelerated(it.result) ? Part::kGiven
              : is_tried[n]               ? Part::kTried
                                          : Part::kRest;
    parts_[static_cast<std::size_t>(it.part)].push_back(&it);
    const std::vector<int> read = rowsReadBy(it);
    const bool may_grow = it.code == Code::kExp || it.code == Code::kSinhCosh ||
                          std::any_of(read.begin(), read.end(), [&](int row) {
                            return grows[static_cast<std::size_t>(row)];
                          });
    grows[static_cast<std::size_t>(it.result)] = may_grow;
    if (it.code == Code::kSinhCosh) grows[static_cast<std::size_t>(it.aux[0])] = true;
    it.limit = limitOf(it, grows);
    if (it.table < 0) continue;
    it.rows = rows_;
    rows_ += it.code == Code::kTable2 ? 11 : 3;
  }
}

int SeriesProgram::limitOf(const Instruction& it, const std::vector<bool>& grows) const {
  const bool has_limit = it.code == Code::kDivide || it.code == Code::kTanh ||
                         it.code == Code::kExp ||
                         (it.code >= Code::kLog && it.code <= Code::kAtan2);
  const int of = it.operands[it.code == Code::kDivide ? 1 : 0];
  const bool may_stay = has_limit && it.ends >= kNoDegree && grows[static_cast<std::size_t>(of)] &&
                        !has_pole_[static_cast<std::size_t>(of)];
  return may_stay ? of : -1;
}

}  // namespace variator_sim::expression
