// What a series cannot show: exp(-x^2) far from 0 is nothing, and so are all its derivatives; a
// step may carry x to 0 and beyond. The series of x knows it, for x is smooth on a larger scale.
#include <algorithm>
#include <cmath>
#include <limits>

#include "expression/series_program.h"

namespace variator_sim::expression {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// sum_k c_k theta^k, k <= order
double valueAt(const double* c, double theta, int order) {
  double sum = c[order];
  for (int k = order - 1; k >= 0; --k) sum = sum * theta + c[k];
  return sum;
}

/// sum_{k>0} |c_k| theta^k
double reachOf(const double* c, double theta, int order) {
  double sum = 0.0;
  for (int k = order; k > 0; --k) sum = (sum + std::abs(c[k])) * theta;
  return sum;
}

/// sum_k k c_k theta^(k-1)
double slopeAt(const double* c, double theta, int order) {
  double sum = order * c[order];
  for (int k = order - 1; k > 0; --k) sum = sum * theta + k * c[k];
  return sum;
}

/// Where `f` changes its sign between two numbers: to a rounding, for what is not flat there may be
/// as narrow.
template <class F>
double findZero(const F& f, double low, double high) {
  const bool rises = f(low) < 0.0;
  for (;;) {
    const double middle = 0.5 * (low + high);
    if (!(low < middle && middle < high)) return middle;
    const double there = f(middle);
    if (there == 0.0) return middle;
    ((there < 0.0) == rises ? low : high) = middle;
  }
}

}  // namespace

bool SeriesProgram::mayBeFlat(const Instruction& it) {
  return it.code == Code::kExp || it.code == Code::kTanh || it.code == Code::kSinhCosh ||
         it.code == Code::kDivide || (it.code == Code::kPower && it.constant < 0.0);
}

int SeriesProgram::argumentOf(const Instruction& it) {
  return it.operands[it.code == Code::kDivide ? 1 : 0];
}

/// An exponent that moves by r makes coefficients of r^n / n!, and those of order n are seen; what
/// a denominator makes grows by orders of magnitude where that comes near to 0 only.
bool SeriesProgram::movesFar(const Instruction& it, double theta, int order) const {
  constexpr double kPart = 0.9;
  const double* const x = forward(argumentOf(it));
  const double reach = reachOf(x, theta, order);
  const bool is_denominator = it.code == Code::kDivide || it.code == Code::kPower;
  return reach > (is_denominator ? kPart * std::abs(x[0]) : static_cast<double>(order));
}

bool SeriesProgram::differsAt(const Instruction& it, double theta, int order, double tolerance,
                              double unknown) const {
  constexpr double kPart = 1e-3;
  double x = valueAt(forward(argumentOf(it)), theta, order);
  x = std::copysign(std::max(0.0, std::abs(x) - unknown), x);
  double value = 0.0;
  int row = it.result;
  switch (it.code) {
    case Code::kExp:
      value = std::exp(x);
      break;
    case Code::kTanh:
      value = std::tanh(x);
      break;
    case Code::kSinhCosh:  // of the two the one whose inverse vanishes
      value = std::cosh(x);
      row = it.aux[0];
      break;
    case Code::kPower:
      value = std::pow(x, it.constant);
      break;
    default:
      value = valueAt(forward(it.operands[0]), theta, order) / x;
      break;
  }
  const double series = valueAt(forward(row), theta, order);
  if (series == value) return false;  // be it infinite
  const double allowed = std::isfinite(value) ? std::max(kPart * std::abs(value), tolerance) : 0.0;
  return !(std::abs(series - value) <= allowed);
}

bool SeriesProgram::hasAcceleratedFlatFunction() const {
  return std::any_of(flat_.begin(), flat_.end(), [this](int index) {
    return isAccelerated(instructions_[static_cast<std::size_t>(index)].result);
  });
}

std::vector<SeriesProgram::FlatFunction> SeriesProgram::listFlatFunctions() const {
  std::vector<FlatFunction> functions;
  for (const int index : flat_) {
    const Instruction& it = instructions_[static_cast<std::size_t>(index)];
    functions.push_back({argumentOf(it), it.code == Code::kDivide || it.code == Code::kPower});
  }
  return functions;
}

bool SeriesProgram::misses(double theta, int order, double tolerance) const {
  constexpr int kPoints = 8;
  for (const int index : flat_) {
    const Instruction& it = instructions_[static_cast<std::size_t>(index)];
    if (!movesFar(it, theta, order)) continue;
    const double* const x = forward(argumentOf(it));
    const auto value = [&](double part) { return valueAt(x, part, order); };
    const auto slope = [&](double part) { return slopeAt(x, part, order); };
    // Nearest to 0, as the argument is no better known than its terms and its end are.
    const double unknown =
        8.0 * kEpsilon * (std::abs(x[0]) + reachOf(x, theta, order)) +
        (std::abs(x[order]) * theta + std::abs(x[order - 1])) * std::pow(theta, order - 1);
    const auto differs = [&](double part) { return differsAt(it, part, order, tolerance, 0.0); };
    const auto differsNear = [&](double part) {
      return differsAt(it, part, order, tolerance, unknown);
    };
    double low = 0.0;
    for (int j = 1; j <= kPoints; ++j) {
      const double high = theta * j / kPoints;
      if (differs(high)) return true;
      // Where the argument turns it may come near to where the function is not flat; 1/cosh is not
      // where it passes 0.
      if (slope(low) * slope(high) < 0.0 && differsNear(findZero(slope, low, high))) return true;
      if (it.code == Code::kSinhCosh && value(low) * value(high) < 0.0 &&
          differsNear(findZero(value, low, high))) {
        return true;
      }
      low = high;
    }
  }
  return false;
}

}  // namespace variator_sim::expression
