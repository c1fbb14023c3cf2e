#include "expression/series_program.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "expression/series_dot.h"

namespace variator_sim::expression {

namespace {

constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

bool hasFusedProducts() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0 && __builtin_cpu_supports("avx2") != 0;
#elif defined(__aarch64__)
  return true;
#else
  return false;
#endif
}

bool is_fusing = hasFusedProducts();

}  // namespace

bool fusesProducts() {
  return is_fusing;
}
void fuseProducts(bool on) {
  is_fusing = on && hasFusedProducts();
}
const char* arithmeticOfCode() {
  return is_fusing ? "#define VS_FUSES\n" : "";
}

namespace plain {
#include "expression/series_interpreter.inc"
void begin(SeriesProgram& program, SeriesProgram::Part part) {
  SeriesInterpreter(program).begin(part);
}
void extend(SeriesProgram& program, int n, bool corrects, AccelerationSolver& solver) {
  SeriesInterpreter(program).extend(n, corrects, solver);
}
}  // namespace plain

VARIATOR_SIM_BEGIN_FUSED
namespace fused {
#include "expression/series_interpreter.inc"
void begin(SeriesProgram& program, SeriesProgram::Part part) {
  SeriesInterpreter(program).begin(part);
}
void extend(SeriesProgram& program, int n, bool corrects, AccelerationSolver& solver) {
  SeriesInterpreter(program).extend(n, corrects, solver);
}
}  // namespace fused
VARIATOR_SIM_END_FUSED

void SeriesProgram::begin(Part part) {
  if (part == Part::kGiven) noteLimit(false);
  if (fusesProducts()) {
    fused::begin(*this, part);
  } else {
    plain::begin(*this, part);
  }
}

void SeriesProgram::extend(int n, bool corrects, AccelerationSolver& solver) {
  if (fusesProducts()) {
    fused::extend(*this, n, corrects, solver);
  } else {
    plain::extend(*this, n, corrects, solver);
  }
}

void SeriesProgram::clear() {
  std::fill(rows_.begin(), rows_.end(), 0.0);
  for (int series = 0; series < 2; ++series) {
    for (const auto& [row, value] : constants_) write(row, 0, value);
    turn();
  }
}

std::array<int, 2> SeriesProgram::limitingOperands(const Instruction& it) {
  if (it.code == Code::kDivide) return {it.operands[1], -1};
  if (it.code < Code::kExp || it.code > Code::kPower) return {-1, -1};
  return {it.operands[0], it.code == Code::kAtan2 ? it.operands[1] : -1};
}

bool SeriesProgram::isAtLimit(const Instruction& it) const {
  for (const int of : limitingOperands(it)) {
    if (of >= 0 && std::isinf(forward(of)[0]) && std::isfinite(forward(it.result)[0]) &&
        !has_pole_[static_cast<std::size_t>(of)]) {
      return true;
    }
  }
  return false;
}

void SeriesProgram::placePiece(const Instruction& it, Piece& piece, int order) {
  const bool left_of_x = piece.side[0] < 0;
  const bool left_of_y = piece.side[1] < 0;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double* const a = states_.data() + piece.a;
  const double x0 = forward(it.operands[0])[0];
  const double x = left_of_x ? std::nextafter(x0, -kInfinity) : x0;
  const int most_x = order == 0 ? 0 : piece.degree[0];
  if (piece.table != nullptr) {
    for (int i = 0; i <= most_x; ++i) {
      const int n = piece.order[0] + i;
      a[6 * i] = piece.table->derivative(n, n < piece.table->smoothness() ? x0 : x) / kFactorial[i];
    }
    return;
  }
  const double y0 = forward(it.operands[1])[0];
  const double y = left_of_y ? std::nextafter(y0, -kInfinity) : y0;
  const int most_y = order == 0 ? 0 : piece.degree[1];
  for (int i = 0; i <= most_x; ++i) {
    for (int j = 0; j <= most_y; ++j) {
      a[6 * i + j] = piece.table2->derivative({piece.order[0] + i, piece.order[1] + j}, x, y) /
                     (kFactorial[i] * kFactorial[j]);
    }
  }
}

}  // namespace variator_sim::expression
