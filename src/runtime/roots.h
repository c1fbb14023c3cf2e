/* Roots of polynomials p(x) = c_0 + c_1 x + .. + c_n x^n, isolated for certain (operations.h goes
 * before). */

VS_INLINE Real vs_evaluate(const Real* c, int n, Real x) {
  Real sum = c[n];
  int k;
  for (k = n - 1; k >= 0; --k) sum = sum * x + c[k];
  return sum;
}

/* True where both are above 0, or both below. (Their product underflows.) */
VS_INLINE int vs_have_one_sign(Real a, Real b) {
  return a > 0.0 ? b > 0.0 : a < 0.0 && b < 0.0;
}

/* The root of p between low and high, at whose ends it has different signs: Newton's iteration,
 * bisection where that leaves the interval. Returns the end on the far side of the root where the
 * two cannot be told apart. */
VS_RARE Real vs_refine_root(const Real* c, int n, Real low, Real high) {
  const int is_rising = vs_evaluate(c, n, high) > 0.0;
  Real x = 0.5 * (low + high);
  int round, k;
  for (round = 0; round < 100; ++round) {
    Real value = c[n], slope = 0.0, next;
    for (k = n - 1; k >= 0; --k) {
      slope = slope * x + value;
      value = value * x + c[k];
    }
    if (value == 0.0) return x;
    if ((value < 0.0) == is_rising)
      low = x;
    else
      high = x;
    next = x - value / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (fabs(next - x) <= 1e-15 * high) return next;
    x = next;
  }
  return high;
}

/* The number of sign changes, 0, 1 or 2 for more, of the Bernstein coefficients of p on [low, low +
 * width], which is at least that of p's roots there. They are b_j = sum_{i<=j} C(j,i) / C(n,i) d_i,
 * d_i = width^i / i! p^(i)(low). */
VS_RARE int vs_count_sign_changes(const Real* c, int n, Real low, Real width) {
  Real b[VS_STRIDE], power = 1.0, count = 1.0, last = 0.0;
  int i, j, changes = 0;
  for (i = 0; i <= n; ++i) b[i] = c[i];
  for (i = 0; i < n && low > 0.0; ++i) {
    for (j = n - 1; j >= i; --j) b[j] += low * b[j + 1];
  }
  for (i = 0; i <= n; ++i) {
    b[i] *= power / count;
    power *= width;
    count *= (Real)(n - i) / (i + 1);
  }
  for (i = 1; i <= n; ++i) {
    for (j = n; j >= i; --j) b[j] += b[j - 1];
  }
  for (j = 0; j <= n && changes < 2; ++j) {
    if (b[j] == 0.0) continue;
    changes += last != 0.0 && (b[j] < 0.0) != (last < 0.0);
    last = b[j];
  }
  return changes;
}

/* The first x in (0, end] behind which p has the other sign than just behind 0; above `end` where
 * there is none. A sum bound excludes most polynomials, monotone ones need the sign at the end,
 * others are divided until one change is left. */
static Real vs_first_root(const Real* c, int n, Real end) {
  Real sum = 0.0, bend = 0.0, power = end, low = 0.0, width = end, side;
  int k, rounds;
  while (n > 0 && *c == 0.0) { /* p / x */
    ++c;
    --n;
  }
  side = *c;
  for (k = 1; k <= n; ++k, power *= end) {
    const Real term = fabs(c[k]) * power;
    sum += term;
    if (k > 1) bend += k * term;
  }
  if (side == 0.0 || fabs(side) > sum) return 2.0 * end;
  if (n == 0 || fabs(c[1]) * end > bend) {
    return vs_have_one_sign(-vs_evaluate(c, n, end), side) ? vs_refine_root(c, n, 0.0, end)
                                                           : 2.0 * end;
  }
  for (rounds = 0; rounds < 4000 && low < end; ++rounds) {
    const Real high = low + width < end ? low + width : end;
    const Real value = vs_evaluate(c, n, high);
    const int changes = vs_count_sign_changes(c, n, low, high - low);
    if (changes == 1 && vs_have_one_sign(-value, side)) return vs_refine_root(c, n, low, high);
    /* (One change and no other sign: there is a root at `high`, but for rounding.) */
    if (value == 0.0 && high < end) {
      width = 0.7 * (high - low); /* no interval begins on a root */
    } else if (changes == 0 || high - low < 1e-13 * end) {
      if (vs_have_one_sign(-value, side)) return high;
      low = high;
      width *= 2.0;
    } else {
      width = 0.5 * (high - low);
    }
  }
  return low < end ? low : 2.0 * end;
}

/* The first coefficient that is not 0: it has the sign that p has just behind 0. */
VS_INLINE double vs_first_sign(const Real* c, int last) {
  int n;
  for (n = 0; n < last && c[n] == 0.0; ++n) continue;
  return c[n];
}
