#include <cmath>

#include "instruction_set.h"
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

double selectOf(double a, double b, double yes, double no) {
  const double operands[4] = {a, b, yes, no};
  return evaluateOperation(Operation::kSelect, operands);
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

// Computed goto, a language extension of GCC and Clang: every run jumps to the next one itself, so
// that the processor predicts each jump by its own history. With evaluations that depend on each
// other a switch in a loop took 1 to 6 % longer for right-hand sides of scenes of 2 to 8 shafts.
//
// Loads and jumps limit a long program, the latency of a result through memory a short one. Hence
// runs, fields in two words, and an order that serves both: together they took 3 to 5 % off the
// right-hand side of the ship of benchmark/kernel_benchmark.cpp, 9 % off that of four shafts with
// two variators, 19 % off that of eight with four.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"

#define VARIATOR_SIM_APPLY_0(x, y) ((x) + (y))
#define VARIATOR_SIM_APPLY_1(x, y) ((x) - (y))
#define VARIATOR_SIM_APPLY_2(x, y) ((x) * (y))
#define VARIATOR_SIM_APPLY_3(x, y) ((x) / (y))

// All labels, in the order of the codes of instruction_set.h.
// clang-format off
#define VARIATOR_SIM_PAIRS(X) X(0) X(1) X(2) X(3)
#define VARIATOR_SIM_TRIADS_OF(X, o1)                 \
  X(o1, 0, t + C) X(o1, 1, t - C) X(o1, 2, C - t)     \
  X(o1, 3, t * C) X(o1, 4, t / C) X(o1, 5, C / t)     \
  X(o1, 6, -t)
#define VARIATOR_SIM_TRIADS(X)                              \
  VARIATOR_SIM_TRIADS_OF(X, 0) VARIATOR_SIM_TRIADS_OF(X, 1) \
  VARIATOR_SIM_TRIADS_OF(X, 2) VARIATOR_SIM_TRIADS_OF(X, 3)
#define VARIATOR_SIM_QUADS_OF(X, o1, o2) X(o1, o2, 0) X(o1, o2, 1) X(o1, o2, 2) X(o1, o2, 3)
#define VARIATOR_SIM_QUADS_FROM(X, o1)                            \
  VARIATOR_SIM_QUADS_OF(X, o1, 0) VARIATOR_SIM_QUADS_OF(X, o1, 1) \
  VARIATOR_SIM_QUADS_OF(X, o1, 2) VARIATOR_SIM_QUADS_OF(X, o1, 3)
#define VARIATOR_SIM_QUADS(X)                                 \
  VARIATOR_SIM_QUADS_FROM(X, 0) VARIATOR_SIM_QUADS_FROM(X, 1) \
  VARIATOR_SIM_QUADS_FROM(X, 2) VARIATOR_SIM_QUADS_FROM(X, 3)
// clang-format on

#define VARIATOR_SIM_RUN_LABELS(name) &&name##_1, &&name##_2, &&name##_3, &&name##_4,
#define VARIATOR_SIM_PAIR_LABEL(o1) VARIATOR_SIM_RUN_LABELS(pair_##o1)
#define VARIATOR_SIM_TRIAD_LABEL(o1, form, value) VARIATOR_SIM_RUN_LABELS(triad_##o1##_##form)
#define VARIATOR_SIM_QUAD_LABEL(o1, o2, o3) VARIATOR_SIM_RUN_LABELS(quad_##o1##_##o2##_##o3)
#define VARIATOR_SIM_FUNCTION_LABEL(name, value) &&function_##name,

#define VARIATOR_SIM_ADVANCE \
  ++it;                      \
  head = it->head
#define VARIATOR_SIM_NEXT \
  VARIATOR_SIM_ADVANCE;   \
  goto* kLabels[fieldOf(head, kCodeField)]
// A run of four begins at its first label, a shorter one at a later label.
#define VARIATOR_SIM_RUN(name, body) \
  name##_4 : {                       \
    body;                            \
    VARIATOR_SIM_ADVANCE;            \
  }                                  \
  name##_3 : {                       \
    body;                            \
    VARIATOR_SIM_ADVANCE;            \
  }                                  \
  name##_2 : {                       \
    body;                            \
    VARIATOR_SIM_ADVANCE;            \
  }                                  \
  name##_1 : {                       \
    body;                            \
    VARIATOR_SIM_NEXT;               \
  }
#define VARIATOR_SIM_PAIR(o1) VARIATOR_SIM_RUN(pair_##o1, RESULT = VARIATOR_SIM_APPLY_##o1(A, B))
#define VARIATOR_SIM_TRIAD(o1, form, value)                                             \
  VARIATOR_SIM_RUN(triad_##o1##_##form, const double t = VARIATOR_SIM_APPLY_##o1(A, B); \
                   RESULT = (value))
#define VARIATOR_SIM_QUAD(o1, o2, o3)                                              \
  VARIATOR_SIM_RUN(quad_##o1##_##o2##_##o3,                                        \
                   RESULT = VARIATOR_SIM_APPLY_##o2(VARIATOR_SIM_APPLY_##o1(A, B), \
                                                    VARIATOR_SIM_APPLY_##o3(C, D)))
#define VARIATOR_SIM_FUNCTION(name, value) \
  function_##name : {                      \
    RESULT = value;                        \
    VARIATOR_SIM_NEXT;                     \
  }
#define RESULT r[fieldOf(head, kResultField)]
#define A r[fieldOf(head, kAField)]
#define B r[fieldOf(head, kBField)]
#define C r[fieldOf(it->tail, kCField)]
#define D r[fieldOf(it->tail, kDField)]

const double* Tape::evaluate(const StateView& state) const {
  static const void* const kLabels[] = {
      // clang-format off
      VARIATOR_SIM_PAIRS(VARIATOR_SIM_PAIR_LABEL)
      VARIATOR_SIM_TRIADS(VARIATOR_SIM_TRIAD_LABEL)
      VARIATOR_SIM_QUADS(VARIATOR_SIM_QUAD_LABEL)
      VARIATOR_SIM_FUNCTIONS(VARIATOR_SIM_FUNCTION_LABEL)
      &&sine_and_cosine,
      &&table,
      &&table_of_two,
      &&opaque,
      &&copy,
      &&finish
      // clang-format on
  };
  static_assert(sizeof kLabels / sizeof kLabels[0] == kCodeCount, "one label per instruction code");

  double* const r = registers_.data();
  const Load* load = loads_.data();
  const auto take = [&](Source source, const double* from) {
    const Load* const end = loads_.data() + load_end_[static_cast<int>(source)];
    for (; load != end; ++load) {
      r[load->to] = from[load->index];
    }
  };
  take(Source::kTime, &state.time);
  take(Source::kAngle, state.angle);
  take(Source::kVelocity, state.velocity);
  take(Source::kAcceleration, state.acceleration);
  if (load != loads_.data() + loads_.size()) {
    take(Source::kInput, state.input);
    take(Source::kInputRate, state.input_rate);
    take(Source::kInputSecondRate, state.input_second_rate);
  }
  if (program_.empty()) return r;
  const Instruction* it = program_.data();
  std::uint64_t head = it->head;
  goto* kLabels[fieldOf(head, kCodeField)];

  // clang-format off
  VARIATOR_SIM_PAIRS(VARIATOR_SIM_PAIR)
  VARIATOR_SIM_TRIADS(VARIATOR_SIM_TRIAD)
  VARIATOR_SIM_QUADS(VARIATOR_SIM_QUAD)
  VARIATOR_SIM_FUNCTIONS(VARIATOR_SIM_FUNCTION)
  // clang-format on

sine_and_cosine:
  computeSinCos(A, &RESULT, &B);
  VARIATOR_SIM_NEXT;

table:
  RESULT =
      tables_[fieldOf(head, kBField)]->derivative(static_cast<int>(fieldOf(it->tail, kCField)), A);
  VARIATOR_SIM_NEXT;

table_of_two : {
  const auto orders = static_cast<int>(fieldOf(it->tail, kDField));
  RESULT = tables2_[fieldOf(it->tail, kCField)]->derivative({orders & 0xFF, orders >> 8}, A, B);
  VARIATOR_SIM_NEXT;
}

opaque:
  carryOut(calls_[fieldOf(head, kAField)]);
  VARIATOR_SIM_NEXT;

copy:
  RESULT = A;
  VARIATOR_SIM_NEXT;

finish:
  return r;
}

#undef RESULT
#undef A
#undef B
#undef C
#undef D
#pragma GCC diagnostic pop

}  // namespace variator_sim::expression
