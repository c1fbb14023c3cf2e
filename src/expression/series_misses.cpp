// What a series cannot show: exp(-x^2) far from 0 is nothing, and so are all its derivatives; a
// step may carry x to 0 and beyond. The series of x knows it, for x is smooth on a larger scale.
#include <algorithm>
#include <cmath>

#include "expression/series_program.h"

namespace variator_sim::expression {

namespace {

/// sum_k c_k theta^k, k <= order
double valueAt(const double* c, double theta, int order) {
  double sum = c[order];
  for (int k = order - 1; k >= 0; --k) sum = sum * theta + c[k];
  return sum;
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
  double reach = 0.0;
  double power = 1.0;
  for (int k = 1; k <= order; ++k) reach += std::abs(x[k]) * (power *= theta);
  const bool is_denominator = it.code == Code::kDivide || it.code == Code::kPower;
  return reach > (is_denominator ? kPart * std::abs(x[0]) : static_cast<double>(order));
}

bool SeriesProgram::differsAt(const Instruction& it, double theta, int order,
                              double tolerance) const {
  constexpr double kPart = 1e-3;
  const double x = valueAt(forward(argumentOf(it)), theta, order);
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
  const double allowed = std::max(kPart * std::abs(value), tolerance);
  return !(std::abs(valueAt(forward(row), theta, order) - value) <= allowed);
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
    double at[kPoints + 1] = {x[0]};
    for (int j = 1; j <= kPoints; ++j) {
      const double part = theta * j / kPoints;
      if (differsAt(it, part, order, tolerance)) return true;
      at[j] = valueAt(x, part, order);
    }
    // Where the argument turns between two of them, it may come near to where the function is not
    // flat: the turning point of the parabola through three.
    for (int j = 1; j < kPoints; ++j) {
      const double before = at[j] - at[j - 1];
      const double after = at[j + 1] - at[j];
      if (before * after > 0.0 || before == after) continue;
      const double turn = j - 0.5 * (after + before) / (after - before);
      if (differsAt(it, theta * turn / kPoints, order, tolerance)) return true;
    }
  }
  return false;
}

}  // namespace variator_sim::expression
