#include "interval_program.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Interval kEverything{-kInfinity, kInfinity};
constexpr double kHalfPi = 1.5707963267948966;

bool contains(const Interval& a, double x) {
  return a.low <= x && x <= a.high;
}
/// Replaces NaN by the unbounded interval.
Interval orEverything(const Interval& a) {
  return a.low <= a.high ? a : kEverything;
}
Interval hull(double a, double b) {
  return {std::min(a, b), std::max(a, b)};
}
Interval negate(const Interval& a) {
  return {-a.high, -a.low};
}
Interval add(const Interval& a, const Interval& b) {
  return {a.low + b.low, a.high + b.high};
}
Interval subtract(const Interval& a, const Interval& b) {
  return {a.low - b.high, a.high - b.low};
}
/// Returns 0 for 0 times an infinite end, which is never reached.
double productOf(double a, double b) {
  return a == 0.0 || b == 0.0 ? 0.0 : a * b;
}
Interval multiply(const Interval& a, const Interval& b) {
  const double p[] = {productOf(a.low, b.low), productOf(a.low, b.high), productOf(a.high, b.low),
                      productOf(a.high, b.high)};
  return {std::min({p[0], p[1], p[2], p[3]}), std::max({p[0], p[1], p[2], p[3]})};
}
Interval divide(const Interval& a, const Interval& b) {
  if (contains(b, 0.0)) return kEverything;
  return multiply(a, hull(1.0 / b.high, 1.0 / b.low));
}
/// Encloses x^n for an integer n.
Interval integerPower(const Interval& a, double n) {
  if (n < 0.0) return divide({1.0, 1.0}, integerPower(a, -n));
  const double low = std::pow(a.low, n);
  const double high = std::pow(a.high, n);
  if (std::fmod(n, 2.0) != 0.0) return {low, high};
  return {contains(a, 0.0) ? 0.0 : std::min(low, high), std::max(low, high)};
}
Interval power(const Interval& a, const Interval& b) {
  if (b.low == b.high && b.low == std::floor(b.low) && std::isfinite(b.low)) {
    return integerPower(a, b.low);
  }
  if (!(a.low >= 0.0)) return kEverything;
  // monotone in either argument: the corners hold the extremes
  const double p[] = {std::pow(a.low, b.low), std::pow(a.low, b.high), std::pow(a.high, b.low),
                      std::pow(a.high, b.high)};
  for (const double value : p) {
    if (std::isnan(value)) return kEverything;
  }
  Interval all{std::min({p[0], p[1], p[2], p[3]}), std::max({p[0], p[1], p[2], p[3]})};
  if (a.low == 0.0 && b.low <= 0.0) all.high = kInfinity;
  return all;
}
/// Encloses cos over [low, high].
Interval cosine(const Interval& a) {
  if (!(a.high - a.low < 4.0 * kHalfPi) || !(std::abs(a.low) < 1e15)) return {-1.0, 1.0};
  const double first = std::cos(a.low);
  const double last = std::cos(a.high);
  Interval all = hull(first, last);
  // An interval that ends within rounding of an extreme includes it.
  const double slack = 1e-15 * (1.0 + std::abs(a.low) + std::abs(a.high));
  const auto hasMultiple = [&](double offset) {  // offset + 2 pi k within
    const double k = std::ceil((a.low - slack - offset) / (4.0 * kHalfPi));
    return offset + 4.0 * kHalfPi * k <= a.high + slack;
  };
  if (hasMultiple(0.0)) all.high = 1.0;
  if (hasMultiple(2.0 * kHalfPi)) all.low = -1.0;
  return all;
}
Interval tangent(const Interval& a) {
  if (!(a.high - a.low < 2.0 * kHalfPi) || !(std::abs(a.low) < 1e15)) return kEverything;
  const Interval c = cosine(a);
  if (contains(c, 0.0)) return kEverything;
  return hull(std::tan(a.low), std::tan(a.high));
}
/// Encloses an operation that increases with its only operand.
Interval increasing(Operation operation, const Interval& a) {
  return orEverything(
      {evaluateOperation(operation, &a.low), evaluateOperation(operation, &a.high)});
}
Interval absolute(const Interval& a) {
  if (a.low >= 0.0) return a;
  if (a.high <= 0.0) return negate(a);
  return {0.0, std::max(-a.low, a.high)};
}
Interval select(const Interval& left, const Interval& right, const Interval& yes,
                const Interval& no) {
  if (left.high <= right.low) return yes;
  if (left.low > right.high) return no;
  return {std::min(yes.low, no.low), std::max(yes.high, no.high)};
}

// Longer than a screen, as the list of operations is.
Interval encloseOperation(Operation operation, const Interval& a, const Interval& b,
                          const Interval& c, const Interval& d) {
  switch (operation) {
    case Operation::kConstant:
    case Operation::kVariable:
    case Operation::kTable:
    case Operation::kTable2:
    case Operation::kOpaque:
      break;
    case Operation::kNegate:
      return negate(a);
    case Operation::kAdd:
      return add(a, b);
    case Operation::kSubtract:
      return subtract(a, b);
    case Operation::kMultiply:
      return multiply(a, b);
    case Operation::kDivide:
      return divide(a, b);
    case Operation::kPower:
      return power(a, b);
    case Operation::kSin:
      return cosine({a.low - kHalfPi, a.high - kHalfPi});
    case Operation::kCos:
      return cosine(a);
    case Operation::kTan:
      return tangent(a);
    case Operation::kAcos:
      return orEverything({std::acos(a.high), std::acos(a.low)});
    case Operation::kAtan2: {
      // The extremes lie in the corners, except on the cut along the negative second operand.
      const bool is_off_cut = a.low > 0.0 || a.high < 0.0 || b.low > 0.0;
      if (!is_off_cut) return {-2.0 * kHalfPi, 2.0 * kHalfPi};
      const auto [least, largest] =
          std::minmax({std::atan2(a.low, b.low), std::atan2(a.low, b.high),
                       std::atan2(a.high, b.low), std::atan2(a.high, b.high)});
      return {least, largest};
    }
    case Operation::kCosh: {
      const Interval x = absolute(a);
      return {std::cosh(x.low), std::cosh(x.high)};
    }
    case Operation::kAbs:
      return absolute(a);
    case Operation::kAsin:
    case Operation::kAtan:
    case Operation::kSinh:
    case Operation::kTanh:
    case Operation::kExp:
    case Operation::kLog:
    case Operation::kSqrt:
    case Operation::kSign:
      return increasing(operation, a);
    case Operation::kMin:
      return {std::min(a.low, b.low), std::min(a.high, b.high)};
    case Operation::kMax:
      return {std::max(a.low, b.low), std::max(a.high, b.high)};
    case Operation::kSelect:
      return select(a, b, c, d);
    case Operation::kWhereFinite:
      return {std::min(b.low, 0.0), std::max(b.high, 0.0)};
  }
  return kEverything;
}

Interval variableOf(const StateBox& box, int slot) {
  const int index = indexOf(slot);
  switch (sourceOf(slot)) {
    case Source::kTime:
      return box.time;
    case Source::kAngle:
      return box.angle[index];
    case Source::kVelocity:
      return box.velocity[index];
    case Source::kAcceleration:
      return box.acceleration[index];
    case Source::kInput:
      return box.input == nullptr ? kEverything : box.input[index];
    default:
      return kEverything;
  }
}

}  // namespace

IntervalProgram::IntervalProgram(const Graph& graph, Node node) {
  const std::vector<int> reachable = graph.listReachable({node});
  for (const int i : reachable) {
    const Graph::Entry& entry = graph.entry({i});
    Step step{entry.operation, entry.slot, {-1, -1, -1, -1}, {}, {}, {}};
    for (int n = 0; n < operandCount(entry.operation); ++n) {
      const auto place = std::lower_bound(reachable.begin(), reachable.end(), entry.operands[n]);
      step.operands[n] = static_cast<int>(place - reachable.begin());
    }
    if (entry.operation == Operation::kTable) step.table = graph.tableOf(entry);
    if (entry.operation == Operation::kTable2) step.table2 = graph.table2Of(entry);
    step.order = {entry.order[0], entry.order[1]};
    steps_.push_back(step);
    registers_.push_back({entry.value, entry.value});
    if (entry.operation != Operation::kVariable) continue;
    const int source = static_cast<int>(sourceOf(entry.slot));
    const int part = kMaxShafts * (source - static_cast<int>(Source::kAngle)) + indexOf(entry.slot);
    if (part >= 0 && part < 3 * kMaxShafts) reads_.set(static_cast<std::size_t>(part));
    reads_time_ = reads_time_ || sourceOf(entry.slot) == Source::kTime;
    reads_inputs_ = reads_inputs_ || sourceOf(entry.slot) == Source::kInput;
  }
}

Interval IntervalProgram::evaluate(const StateBox& box, double rounding) const {
  const auto at = [&](int index) -> const Interval& {
    return registers_[static_cast<std::size_t>(index < 0 ? 0 : index)];
  };
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const Step& step = steps_[i];
    if (step.operation == Operation::kConstant) continue;
    const Interval& a = at(step.operands[0]);
    const Interval& b = at(step.operands[1]);
    switch (step.operation) {
      case Operation::kVariable:
        registers_[i] = variableOf(box, step.slot);
        break;
      case Operation::kTable:
        registers_[i] = orEverything(step.table->enclose(step.order.x, a));
        break;
      case Operation::kTable2:
        registers_[i] = orEverything(step.table2->enclose(step.order, a, b));
        break;
      default:
        registers_[i] = orEverything(
            encloseOperation(step.operation, a, b, at(step.operands[2]), at(step.operands[3])));
        break;
    }
    // (0 times infinity is NaN.)
    if (rounding > 0.0) {
      registers_[i].low -= rounding * std::abs(registers_[i].low);
      registers_[i].high += rounding * std::abs(registers_[i].high);
    }
  }
  return registers_.empty() ? kEverything : registers_.back();
}

}  // namespace variator_sim::expression
