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

static double slope_of(const double *c, int last, double theta)
{
  double sum = last * c[last];
  int n;
  for (n = last - 1; n > 0; --n) sum = sum * theta + n * c[n];
  return sum;
}

static double reach_of(const double *c, int last, double theta)
{
  double sum = 0.0;
  int n;
  for (n = last; n > 0; --n) sum = (sum + fabs(c[n])) * theta;
  return sum;
}

/* Where c (or its slope) changes its sign between low and high. */
static double find_zero(double (*of)(const double *c, int last, double theta), const double *c,
                        int last, double low, double high)
{
  const int rises = (*of)(c, last, low) < 0.0;
  for (;;) {
    const double middle = 0.5 * (low + high);
    double there;
    if (!(low < middle && middle < high)) return middle;
    there = (*of)(c, last, middle);
    if (there == 0.0) return middle;
    if ((there < 0.0) == rises) {
      low = middle;
    } else {
      high = middle;
    }
  }
}

/* True when function i at theta, or where its argument is nearer to 0 by unknown, is not what its
   series says. */
static int is_missed_at(const scene_model *m, int i, double theta, double unknown)
{
  double x = evaluate(m->row[flat_argument[i]], m->order, theta);
  const double series = evaluate(m->row[flat_row[i]], m->order, theta);
  double value = 0.0;
  x = x < 0.0 ? fmin(0.0, x + unknown) : fmax(0.0, x - unknown);
  switch (flat_kind[i]) {
    case EXPONENTIAL_ROW: value = exp(x); break;
    case TANH_ROW: value = tanh(x); break;
    case COSH_ROW: value = cosh(x); break;
    case POWER_ROW: value = pow(x, flat_exponent[i]); break;
    default: value = evaluate(m->row[flat_numerator[i]], m->order, theta) / x; break;
  }
  if (series == value) return 0; /* be it infinite */
  return !(fabs(series - value) <=
           (isfinite(value) ? fmax(1e-3 * fabs(value), RELATIVE_TOLERANCE) : 0.0));
}

/* An exponent that moves by r makes coefficients r^n / n!, of which those of the last order are
   seen; a denominator has to come near to 0. */
static int moves_far(const scene_model *m, int i, double theta)
{
  const double *const x = m->row[flat_argument[i]];
  const int divides = flat_kind[i] == QUOTIENT_ROW || flat_kind[i] == POWER_ROW;
  return reach_of(x, m->order, theta) > (divides ? 0.9 * fabs(x[0]) : (double)m->order);
}

/* Looks at eight points between 0 and theta, where the argument turns, and for 1/cosh where it
   passes 0. */
static int misses(const scene_model *m, double theta)
{
  enum { POINTS = 8 };
  int i, j;
  for (i = 0; i < FLATS; ++i) {
    const double *const x = m->row[flat_argument[i]];
    const int last = m->order;
    double unknown, low = 0.0;
    if (!moves_far(m, i, theta)) continue;
    unknown = 8.0 * DBL_EPSILON * (fabs(x[0]) + reach_of(x, last, theta)) +
              (fabs(x[last]) * theta + fabs(x[last - 1])) * pow(theta, last - 1);
    for (j = 1; j <= POINTS; ++j) {
      const double high = theta * j / POINTS;
      if (is_missed_at(m, i, high, 0.0)) return 1;
      if (slope_of(x, last, low) * slope_of(x, last, high) < 0.0 &&
          is_missed_at(m, i, find_zero(slope_of, x, last, low, high), unknown)) {
        return 1;
      }
      if (flat_kind[i] == COSH_ROW && evaluate(x, last, low) * evaluate(x, last, high) < 0.0 &&
          is_missed_at(m, i, find_zero(evaluate, x, last, low, high), unknown)) {
        return 1;
      }
      low = high;
    }
  }
  return 0;
}
)c";

}  // namespace variator_sim
