#include <cmath>

#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

namespace {

/// Computes sine and cosine of one argument; glibc computes both in little more than the time of
/// one, with the bits of sin() and cos().
void computeSinCos(double x, double* sine, double* cosine) {
#if defined(__GLIBC__) && defined(_GNU_SOURCE)
  ::sincos(x, sine, cosine);
#else
  *sine = std::sin(x);
  *cosine = std::cos(x);
#endif
}

}  // namespace

void Tape::carryOut(const Call& call) const {
  double* const r = registers_.data();
  double x[OpaqueFunction::kMostArguments] = {};
  for (int i = 0; i < call.function->argumentCount(); ++i) x[i] = r[call.arguments[i]];
  if (call.results[0] >= 0) {
    r[call.results[0]] = call.function->value(x);
    return;
  }
  double gradient[OpaqueFunction::kMostArguments] = {};
  call.function->calcGradient(x, gradient);
  for (int i = 0; i < call.function->argumentCount(); ++i) {
    if (call.results[i + 1] >= 0) r[call.results[i + 1]] = gradient[i];
  }
}

// The cases of the operation `first` (a o1 b), alone and with each second one.
#define VARIATOR_SIM_ARITHMETIC(first, t) \
  case codeOf(first):                     \
    result = t;                           \
    break;                                \
  case codeOf(first, kPlus):              \
    result = (t) + c;                     \
    break;                                \
  case codeOf(first, kMinus):             \
    result = (t)-c;                       \
    break;                                \
  case codeOf(first, kFrom):              \
    result = c - (t);                     \
    break;                                \
  case codeOf(first, kTimes):             \
    result = (t)*c;                       \
    break;                                \
  case codeOf(first, kOver):              \
    result = (t) / c;                     \
    break;                                \
  case codeOf(first, kUnder):             \
    result = c / (t);                     \
    break;                                \
  case codeOf(first, kNegated):           \
    result = -(t);                        \
    break;

const double* Tape::evaluate(const StateView& state) const {
  double* const r = registers_.data();
  const double* const sources[] = {
      &state.time,      state.angle,      state.velocity,          state.acceleration,
      state.input,      state.input_rate, state.input_second_rate, nullptr,
      state.held_values};
  for (const Load& it : loads_) r[it.to] = sources[static_cast<int>(it.source)][it.index];
  for (const Instruction& it : program_) {
    const double a = r[it.operands[0]];
    const double b = r[it.operands[1]];
    const double c = r[it.operands[2]];
    double& result = r[it.result];
    switch (it.code) {
      VARIATOR_SIM_ARITHMETIC(Operation::kAdd, a + b)
      VARIATOR_SIM_ARITHMETIC(Operation::kSubtract, a - b)
      VARIATOR_SIM_ARITHMETIC(Operation::kMultiply, a * b)
      VARIATOR_SIM_ARITHMETIC(Operation::kDivide, a / b)
      case codeOf(Operation::kSin):
        if (it.order[0] != 0) {
          computeSinCos(a, &result, &r[it.operands[1]]);
        } else {
          result = std::sin(a);
        }
        break;
      case codeOf(Operation::kPower):
        result = it.order[0] != 0 ? powerOf(a, b) : std::pow(a, b);
        break;
      case codeOf(Operation::kTable):
        result = tables_[it.index]->derivative(it.order[0], a);
        break;
      case codeOf(Operation::kTable2):
        result = tables2_[it.index]->derivative({it.order[0], it.order[1]}, a, b);
        break;
      case codeOf(Operation::kOpaque):
        carryOut(calls_[it.index]);
        break;
      case codeOf(Operation::kVariable):
        result = a;
        break;
      default: {
        const double operands[4] = {a, b, c, r[it.operands[3]]};
        result = evaluateOperation(static_cast<Operation>(it.code), operands);
      }
    }
  }
  return r;
}
#undef VARIATOR_SIM_ARITHMETIC

}  // namespace variator_sim::expression
