// Functions that may be flat: as in expression/series_misses.cpp.
#include "emit_c/c_text.h"

namespace variator_sim {

const char* const kFlatCode = R"c(
/* ---- What a function that is flat here does where its argument goes, no coefficient shows. ---- */

enum { EXPONENTIAL_ROW, TANH_ROW, COSH_ROW, QUOTIENT_ROW, POWER_ROW };

static double evaluate(const double *c, int last, double theta)
{
  double sum = c[last];
  int n;
  for (n = last - 1; n >= 0; --n) sum = sum * theta + c[n];
  return sum;
}

/* True when function i at theta is not what its series says. */
static int is_missed_at(const scene_model *m, int i, double theta)
{
  const double x = evaluate(m->row[flat_argument[i]], m->order, theta);
  const double series = evaluate(m->row[flat_row[i]], m->order, theta);
  double value = 0.0;
  switch (flat_kind[i]) {
    case EXPONENTIAL_ROW: value = exp(x); break;
    case TANH_ROW: value = tanh(x); break;
    case COSH_ROW: value = cosh(x); break;
    case POWER_ROW: value = pow(x, flat_exponent[i]); break;
    default: value = evaluate(m->row[flat_numerator[i]], m->order, theta) / x; break;
  }
  return !(fabs(series - value) <= fmax(1e-3 * fabs(value), RELATIVE_TOLERANCE));
}

/* An exponent that moves by r makes coefficients r^n / n!, of which those of the last order are
   seen; a denominator has to come near to 0. */
static int moves_far(const scene_model *m, int i, double theta)
{
  const double *const x = m->row[flat_argument[i]];
  const int divides = flat_kind[i] == QUOTIENT_ROW || flat_kind[i] == POWER_ROW;
  double reach = 0.0;
  double power = 1.0;
  int n;
  for (n = 1; n <= m->order; ++n) reach += fabs(x[n]) * (power *= theta);
  return reach > (divides ? 0.9 * fabs(x[0]) : (double)m->order);
}

/* Looks at eight points between 0 and theta, and where the argument turns. */
static int misses(const scene_model *m, double theta)
{
  enum { POINTS = 8 };
  int i, j;
  for (i = 0; i < FLATS; ++i) {
    double at[POINTS + 1];
    if (!moves_far(m, i, theta)) continue;
    at[0] = m->row[flat_argument[i]][0];
    for (j = 1; j <= POINTS; ++j) {
      if (is_missed_at(m, i, theta * j / POINTS)) return 1;
      at[j] = evaluate(m->row[flat_argument[i]], m->order, theta * j / POINTS);
    }
    for (j = 1; j < POINTS; ++j) {
      const double before = at[j] - at[j - 1];
      const double after = at[j + 1] - at[j];
      if (before * after > 0.0 || before == after) continue;
      if (is_missed_at(m, i, theta * (j - 0.5 * (after + before) / (after - before)) / POINTS)) {
        return 1;
      }
    }
  }
  return 0;
}
)c";

}  // namespace variator_sim
