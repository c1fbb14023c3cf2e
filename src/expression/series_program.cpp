#include "expression/series_program.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "expression/series_dot.h"

namespace variator_sim::expression {

namespace {

constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

}  // namespace

double SeriesProgram::convolveInside(int a, int b, int n) const {
  const int low = std::max(1, n - degree(b));
  const int high = std::min(n - 1, degree(a));
  return low > high ? 0.0 : dot(forward(a) + low, backward(b) - n + low, high - low + 1);
}

double SeriesProgram::convolve(int a, int b, int n) const {
  if (n == 0) return forward(a)[0] * forward(b)[0];
  return convolveInside(a, b, n) + (forward(a)[0] * forward(b)[n] + forward(a)[n] * forward(b)[0]);
}

double SeriesProgram::convolveOld(int a, int b, int n) const {
  const int high = std::min(n, degree(a));
  return high < 1 ? 0.0 : dot(forward(a) + 1, backward(b) - (n - 1), high);
}

double SeriesProgram::sumOfRates(int rate, int w, int n) const {
  const double sum = dot(forward(rate), backward(w) - (n - 1), std::min(n - 1, degree(rate) + 1));
  return n - 1 > degree(rate) ? sum : sum + forward(rate)[n - 1] * forward(w)[0];
}

double SeriesProgram::square(int a, int n) const {
  // 2 a_0 a_n + 2 sum_{0 < j < n/2} a_j a_{n-j} + a_{n/2}^2
  const double* const x = forward(a);
  if (n == 0) return x[0] * x[0];
  double sum = 2.0 * dot(x + 1, backward(a) - (n - 1), (n - 1) / 2);
  if (n % 2 == 0) sum += x[n / 2] * x[n / 2];
  return sum + 2.0 * (x[0] * x[n]);
}

void SeriesProgram::clear() {
  std::fill(rows_.begin(), rows_.end(), 0.0);
  for (int series = 0; series < 2; ++series) {
    for (const auto& [row, value] : constants_) write(row, 0, value);
    turn();
  }
}

void SeriesProgram::run(const std::vector<int>& program, int n) {
  for (const int index : program) carryOut(instructions_[static_cast<std::size_t>(index)], n);
}

void SeriesProgram::correct(int n) {
  for (const int row : accelerations_) change(row) = forward(row)[n];
  for (const int index : programs_[static_cast<std::size_t>(Part::kAccelerated)]) {
    const Instruction& it = instructions_[static_cast<std::size_t>(index)];
    if (!it.is_tried) {
      carryOut(it, n);
      continue;
    }
    const double before = forward(it.result)[n];
    const int a = it.operands[0];
    const int b = it.code == Code::kSquare ? a : it.operands[1];
    switch (it.code) {
      case Code::kMultiply:
      case Code::kSquare:
        change(it.result) = (isAccelerated(a) ? change(a) * forward(b)[0] : 0.0) +
                            (isAccelerated(b) ? forward(a)[0] * change(b) : 0.0);
        write(it.result, n, before + change(it.result));
        break;
      case Code::kSinCos:
      case Code::kSinhCosh: {
        const double second = forward(it.aux[0])[n];
        carryOut(it, n);
        change(it.result) = forward(it.result)[n] - before;
        change(it.aux[0]) = forward(it.aux[0])[n] - second;
        break;
      }
      default:
        carryOut(it, n);
        change(it.result) = forward(it.result)[n] - before;
        break;
    }
  }
}

// Longer than a screen, as the list of instructions is.
void SeriesProgram::carryOut(const Instruction& it, int n) {
  const int a = it.operands[0];
  const int b = it.operands[1];
  switch (it.code) {
    case Code::kLinear: {
      const Term* term = terms_.data() + it.aux[0];
      const Term* const end = term + it.aux[1];
      double sum = term->factor * forward(term->row)[n];
      for (++term; term != end; ++term) sum += term->factor * forward(term->row)[n];
      if (n == 0) sum += it.constant;
      write(it.result, n, sum);
      return;
    }
    case Code::kMultiply:
      write(it.result, n, convolve(a, b, n));
      return;
    case Code::kSquare:
      write(it.result, n, square(a, n));
      return;
    case Code::kDivide:
      if (n == 0) {
        state(it) = 1.0 / forward(b)[0];
        write(it.result, 0, forward(a)[0] / forward(b)[0]);
        has_limit_ = has_limit_ || isAtLimit(b, it.result);
        return;
      }
      if (isAtLimit(b, it.result)) {
        write(it.result, n, 0.0);
        return;
      }
      write(it.result, n,
            (forward(a)[n] -
             (convolveInside(b, it.result, n) + forward(b)[n] * forward(it.result)[0])) *
                state(it));
      return;
    case Code::kRate:
      if (n > 0) forward(it.result)[n - 1] = n * forward(a)[n];
      return;
    case Code::kAbs:
    case Code::kSign:
    case Code::kMin:
    case Code::kMax:
    case Code::kSelect:
    case Code::kWhereFinite:
      continueBranch(it, n);
      return;
    case Code::kTable:
      continueTable(it, n);
      return;
    case Code::kTable2:
      continueTable2(it, n);
      return;
    default:
      continueFunction(it, n);
      if (n == 0) {
        has_limit_ = has_limit_ || isAtLimit(a, it.result) ||
                     (it.begin == Begin::kAtan2 && isAtLimit(b, it.result));
      }
      return;
  }
}

bool SeriesProgram::isAtLimit(int operand, int result) const {
  return std::isinf(forward(operand)[0]) && std::isfinite(forward(result)[0]) &&
         !has_pole_[static_cast<std::size_t>(operand)];
}

double SeriesProgram::beginPrimitive(const Instruction& it) const {
  const double x = forward(it.operands[0])[0];
  switch (it.begin) {
    case Begin::kLog:
      return std::log(x);
    case Begin::kAtan:
      return std::atan(x);
    case Begin::kAsin:
      return std::asin(x);
    case Begin::kAcos:
      return std::acos(x);
    case Begin::kAtan2:
      break;
  }
  return std::atan2(x, forward(it.operands[1])[0]);
}

// Longer than a screen, as the list of functions is.
void SeriesProgram::continueFunction(const Instruction& it, int n) {
  const int a = it.operands[0];
  const int y = it.result;
  const double x = forward(a)[0];
  const auto chain = [&](int rate, int w) { return sumOfRates(rate, w, n) * (1.0 / n); };
  const bool is_limit =
      isAtLimit(a, y) || (it.begin == Begin::kAtan2 && isAtLimit(it.operands[1], y));
  if (n > 0 && is_limit) {
    write(y, n, 0.0);
    return;
  }
  switch (it.code) {
    case Code::kExp:
      write(y, n, n == 0 ? std::exp(x) : chain(it.operands[1], y));
      return;
    case Code::kSinCos:
    case Code::kSinhCosh: {
      const bool is_circular = it.code == Code::kSinCos;
      const int z = it.aux[0];
      if (n == 0) {
        write(y, 0, is_circular ? std::sin(x) : std::sinh(x));
        write(z, 0, is_circular ? std::cos(x) : std::cosh(x));
        return;
      }
      const double sine = chain(it.operands[1], z);
      const double cosine = chain(it.operands[1], y);
      write(y, n, sine);
      write(z, n, is_circular ? -cosine : cosine);
      return;
    }
    case Code::kTan:
    case Code::kTanh: {
      const double sign = it.code == Code::kTan ? 1.0 : -1.0;
      const int w = it.aux[0];
      write(y, n,
            n > 0                   ? chain(it.operands[1], w)
            : it.code == Code::kTan ? std::tan(x)
                                    : std::tanh(x));
      // w = 1 + y^2, 1 - y^2 (near 1 as 1 / cosh^2)
      if (n == 0) {
        const double cosine = it.code == Code::kTan ? std::cos(x) : std::cosh(x);
        write(w, 0, 1.0 / (cosine * cosine));
        return;
      }
      write(w, n, sign * square(y, n));
      return;
    }
    case Code::kPrimitive: {
      // q_{n-1} = (p_{n-1} - sum_{j=1..n-1} w_j q_{n-1-j}) / w_0
      if (n == 0) {
        write(y, 0, beginPrimitive(it));
        return;
      }
      const int p = it.operands[2];
      const int w = it.operands[3];
      const int q = it.aux[0];
      const double value =
          (forward(p)[n - 1] - (n > 1 ? convolveOld(w, q, n - 1) : 0.0)) / forward(w)[0];
      write(q, n - 1, value);
      write(y, n, it.constant * value * (1.0 / n));
      return;
    }
    case Code::kWronskian:
      // a b' - b a', coefficient n - 1
      if (n == 0) return;
      forward(y)[n - 1] =
          (sumOfRates(it.operands[3], a, n) - sumOfRates(it.operands[2], it.operands[1], n));
      return;
    case Code::kSqrt:
      if (n == 0) {
        write(y, 0, std::sqrt(x));
        return;
      }
      write(y, n,
            (forward(a)[n] - dot(forward(y) + 1, backward(y) - (n - 1), n - 1)) /
                (2.0 * forward(y)[0]));
      return;
    case Code::kPower: {
      // x_0 y_n = (k + 1)/n sum_{j=1..n} j x_j y_{n-j} - sum_{j=1..n} x_j y_{n-j}
      if (n == 0) {
        write(y, 0, std::pow(x, it.constant));
        return;
      }
      const double sum = (it.constant + 1.0) * chain(it.operands[1], y) -
                         (convolveInside(a, y, n) + forward(a)[n] * forward(y)[0]);
      write(y, n, sum / x);
      return;
    }
    default:
      return;
  }
}

void SeriesProgram::continueBranch(const Instruction& it, int n) {
  const double a = forward(it.operands[0])[n];
  const double b = it.operands[1] < 0 ? 0.0 : forward(it.operands[1])[n];
  const int y = it.result;
  if (n == 0) state(it) = 0.0;
  double& side = state(it);
  switch (it.code) {
    case Code::kAbs:
      // On the edge the first coefficient that is not 0 tells where the motion goes.
      if (side == 0.0) side = a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a;
      write(y, n, side * a);
      return;
    case Code::kSign:
      write(y, n, n == 0 ? signOf(a) : 0.0);
      return;
    case Code::kMin:
    case Code::kMax: {
      if (side == 0.0) side = a < b ? -1.0 : a > b ? 1.0 : a - b;
      const bool is_first = it.code == Code::kMin ? side <= 0.0 : side >= 0.0;
      write(y, n, std::isnan(side) ? side : is_first ? a : b);
      return;
    }
    case Code::kSelect: {
      if (side == 0.0) side = a < b ? -1.0 : a > b ? 1.0 : a - b;
      // On the edge of a jump it is what the formula says there, and stays that.
      const bool is_jump = forward(it.operands[2])[0] != forward(it.operands[3])[0];
      if (side == 0.0 && is_jump) side = -1.0;
      const double chosen = forward(it.operands[side <= 0.0 ? 2 : 3])[n];
      write(y, n, std::isnan(side) ? side : chosen);
      return;
    }
    default:
      // b where a is finite
      if (n == 0) side = whereFinite(a, 1.0);
      write(y, n, side == 0.0 ? 0.0 : side * b);
      return;
  }
}

void SeriesProgram::placePiece(const Instruction& it, Piece& piece) {
  const bool left_of_x = piece.side[0] < 0;
  const bool left_of_y = piece.side[1] < 0;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double* const a = states_.data() + piece.a;
  const double x0 = forward(it.operands[0])[0];
  const double x = left_of_x ? std::nextafter(x0, -kInfinity) : x0;
  if (piece.table != nullptr) {
    for (int i = 0; i <= piece.degree[0]; ++i) {
      const int order = piece.order[0] + i;
      a[6 * i] = piece.table->derivative(order, order < 3 ? x0 : x) / kFactorial[i];
    }
    return;
  }
  const double y0 = forward(it.operands[1])[0];
  const double y = left_of_y ? std::nextafter(y0, -kInfinity) : y0;
  for (int i = 0; i <= piece.degree[0]; ++i) {
    for (int j = 0; j <= piece.degree[1]; ++j) {
      a[6 * i + j] = piece.table2->derivative({piece.order[0] + i, piece.order[1] + j}, x, y) /
                     (kFactorial[i] * kFactorial[j]);
    }
  }
}

void SeriesProgram::continueTable(const Instruction& it, int n) {
  Piece& piece = pieces_[static_cast<std::size_t>(it.state)];
  const double* const a = states_.data() + piece.a;
  const int x = it.operands[0];
  if (n == 0) {
    piece.side[0] = 0;
    placePiece(it, piece);
    write(it.result, 0, a[0]);
    return;
  }
  // A motion that begins at a point goes on in the piece on its left when it falls.
  if (piece.side[0] == 0 && forward(x)[n] != 0.0) {
    piece.side[0] = forward(x)[n] < 0.0 ? -1 : 1;
    if (piece.side[0] < 0) placePiece(it, piece);
  }
  // (x - x_0)^i = (x - x_0) (x - x_0)^(i-1)
  double sum = a[6] * forward(x)[n];
  int before = x;
  for (int i = 2; i <= std::min(piece.degree[0], n); ++i) {
    const int power = piece.powers_x[i];
    const int count = n - i + 1;  // x_1 .. x_{n-i+1}
    const double value = dot(forward(x) + 1, backward(before) - (n - 1), count);
    write(power, n, value);
    sum += a[6 * i] * value;
    before = power;
  }
  write(it.result, n, sum);
}

double SeriesProgram::sumAlongY(const Piece& piece, int i, int y, int n) const {
  const double* const a = states_.data() + piece.a;
  double sum = a[6 * i + 1] * forward(y)[n];
  for (int j = 2; j <= std::min(piece.degree[1], n); ++j) {
    sum += a[6 * i + j] * forward(piece.powers_y[j])[n];
  }
  return sum;
}

void SeriesProgram::continueTable2(const Instruction& it, int n) {
  Piece& piece = pieces_[static_cast<std::size_t>(it.state)];
  const double* const a = states_.data() + piece.a;
  const int x = it.operands[0];
  const int y = it.operands[1];
  if (n == 0) {
    piece.side[0] = piece.side[1] = 0;
    placePiece(it, piece);
    for (int i = 1; i <= piece.degree[0]; ++i) write(piece.sums[i], 0, a[6 * i]);
    write(it.result, 0, a[0]);
    return;
  }
  // Either axis by itself: one of the two may move at a higher order only.
  bool has_moved = false;
  for (const auto& [axis, row] : {std::pair{0, x}, {1, y}}) {
    if (piece.side[axis] != 0 || forward(row)[n] == 0.0) continue;
    piece.side[axis] = forward(row)[n] < 0.0 ? -1 : 1;
    has_moved = has_moved || piece.side[axis] < 0;
  }
  if (has_moved) {
    placePiece(it, piece);
    for (int i = 1; i <= piece.degree[0]; ++i) {
      write(piece.sums[i], 0, a[6 * i]);
      for (int m = 1; m < n; ++m) write(piece.sums[i], m, sumAlongY(piece, i, y, m));
    }
  }
  const auto raise = [&](int base, const int* powers, int degree) {
    int before = base;
    for (int i = 2; i <= std::min(degree, n); ++i) {
      write(powers[i], n, dot(forward(base) + 1, backward(before) - (n - 1), n - i + 1));
      before = powers[i];
    }
  };
  raise(x, piece.powers_x, piece.degree[0]);
  raise(y, piece.powers_y, piece.degree[1]);
  // sum_i (x - x_0)^i sum_j a_ij (y - y_0)^j
  double sum = 0.0;
  for (int i = 0; i <= piece.degree[0]; ++i) {
    const double inner = sumAlongY(piece, i, y, n);
    if (i == 0) {
      sum += inner;
      continue;
    }
    write(piece.sums[i], n, inner);
    if (n >= i) {
      const int power = i == 1 ? x : piece.powers_x[i];
      sum += dot(forward(power) + i, backward(piece.sums[i]) - (n - i), n - i + 1);
    }
  }
  write(it.result, n, sum);
}

}  // namespace variator_sim::expression
