/// The functions that a SeriesProgram has recurrences of.
#pragma once

#include <cstdint>

/// F(code, kind, call): the instruction, its kind in series_operation.inc (kSeriesNone if only
/// other recurrences read its result), and the function of runtime/operations.h that computes
/// coefficient n. In the call, y and z are the rows of the results, a to d those of the operands,
/// `last` is the last coefficient of b, a rate. The interpreter compiles these calls, and kernels
/// and emitted programs have them as text.
#define VARIATOR_SIM_SERIES_FUNCTIONS(F)                                                  \
  F(kMultiply, kSeriesProduct, vs_multiply(y, a, b, n))                                   \
  F(kSquare, kSeriesProduct, vs_square(y, a, n))                                          \
  F(kDivide, kSeriesQuotient, vs_divide(y, a, b, n))                                      \
  F(kRate, kSeriesNone, vs_differentiate(y, a, n))                                        \
  F(kWronskian, kSeriesNone, vs_wronskian(y, a, b, c, d, n))                              \
  F(kExp, kSeriesExp, vs_exponential(y, a, b, last, n))                                   \
  F(kSinCos, kSeriesSine, vs_sine_cosine(y, z, a, b, last, n))                            \
  F(kSinhCosh, kSeriesSinh, vs_sinh_cosh(y, z, a, b, last, n))                            \
  F(kTan, kSeriesTan, vs_tangent(y, z, a, b, last, n))                                    \
  F(kTanh, kSeriesTanh, vs_tangent_hyperbolic(y, z, a, b, last, n))                       \
  F(kLog, kSeriesLog,                                                                     \
    vs_integrate_quotient(y, z, n == 0 ? log(a[0]) : vs_zero, c, d, constant, n))         \
  F(kAtan, kSeriesAtan,                                                                   \
    vs_integrate_quotient(y, z, n == 0 ? atan(a[0]) : vs_zero, c, d, constant, n))        \
  F(kAsin, kSeriesAsin,                                                                   \
    vs_integrate_quotient(y, z, n == 0 ? asin(a[0]) : vs_zero, c, d, constant, n))        \
  F(kAcos, kSeriesAcos,                                                                   \
    vs_integrate_quotient(y, z, n == 0 ? acos(a[0]) : vs_zero, c, d, constant, n))        \
  F(kAtan2, kSeriesAtan2,                                                                 \
    vs_integrate_quotient(y, z, n == 0 ? atan2(a[0], b[0]) : vs_zero, c, d, constant, n)) \
  F(kSqrt, kSeriesSqrt, vs_square_root(y, a, n))                                          \
  F(kPower, kSeriesPower, vs_power(y, a, b, last, constant, n))                           \
  F(kAbs, kSeriesSum, vs_absolute(y, a, mode, n))                                         \
  F(kSign, kSeriesNone, vs_sign(y, a, n))                                                 \
  F(kMin, kSeriesEither, vs_choose(y, a, b, a, b, mode, n))                               \
  F(kMax, kSeriesOther, vs_choose(y, a, b, b, a, mode, n))                                \
  F(kSelect, kSeriesEither, vs_choose(y, a, b, c, d, mode, n))                            \
  F(kWhereFinite, kSeriesFinite, vs_where_finite(y, a, b, n))

namespace variator_sim::expression {

enum class SeriesCode : std::uint8_t {
  kLinear,
#define VARIATOR_SIM_CODE(code, kind, call) code,
  VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_CODE)
#undef VARIATOR_SIM_CODE
      kTable,
  kTable2,
  kOpaque
};

}  // namespace variator_sim::expression
