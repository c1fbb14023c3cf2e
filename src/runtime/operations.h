/* Power series along a motion: coefficient n of a function from those of its operands up to n and
 * its own below n.
 *
 * A row holds the coefficients c_0 .. c_N of one intermediate result, c_k being that of ((t - t_n)
 * / unit)^k. Each function below computes coefficient n of its results; n = 0 is the value itself.
 * A compiler unrolls the sums if n is a constant. (Moore; Jorba and Zou: A software package for
 * the numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics
 * 14 (2005) 99-117.)
 *
 * This is the one text of these recurrences: the interpreter reads it as C++, kernels and emitted
 * programs as C99. The includer defines VS_STRIDE, the places of a row. Coefficients leave
 * the last place free: it keeps a number of the recurrence, the reciprocal of a divisor, from order
 * 0 on. It may define
 *     VS_FUSES            a b + c is rounded once: its processor has an instruction for that
 *     VS_ORDER_VARIES     n is no constant: loops stay loops */

#if defined(__GNUC__)
#define VS_INLINE static inline __attribute__((always_inline, unused))
#define VS_RARE static __attribute__((noinline, unused))
#define SERIES_INLINE inline __attribute__((always_inline, unused))
#define SERIES_RARE __attribute__((noinline, unused))
#else
#define VS_INLINE static inline
#define VS_RARE static
#define SERIES_INLINE inline
#define SERIES_RARE
#endif
/* The storage class of functions that read a scene's constants: members, in an interpreter. */
#ifndef VS_FUNCTION
#define VS_FUNCTION static
#define VS_FUNCTION_INLINE VS_INLINE
#define VS_FUNCTION_RARE VS_RARE
#endif
#if defined(__GNUC__) && !defined(__clang__) && !defined(VS_ORDER_VARIES)
#define VS_UNROLL _Pragma("GCC unroll 32")
#else
#define VS_UNROLL
#endif
#ifndef VS_TANGENTS
typedef double Real;
#endif
/* Programs that carry derivatives define these: numbers are equal with all of them, a value changes
 * without them, and an instant of a step, theta, has those of its event. */
#ifndef VS_IS_SAME
#define VS_IS_SAME(a, b) ((a) == (b))
#define VS_SET_VALUE(x, to) ((x) = (to))
#define VS_INSTANT(m, at, theta) ((void)(at), (theta))
#define VS_PLAIN(array, count) (array)
#define VS_CONVERGED 1e-8
#define VS_CONVERGES_LATE 0
#define VS_JUDGED(x, n, part, allowed) (fabs((x)[n]) * (allowed))
#define VS_MAY_END_EARLY 1
#endif
typedef Real vs_row[VS_STRIDE];
enum { VS_KEPT = VS_STRIDE - 1 };
static const Real vs_zero = {0.0};

/* Sums of products go by fours, in the same order with vectors and without. */
#if defined(__GNUC__) && !defined(VS_TANGENTS)
typedef double vs_four __attribute__((vector_size(32), aligned(8), may_alias));
#define VS_HAS_FOURS
#if !defined(__cplusplus)
/* series_resolution.inc sums by them, too. */
#define SERIES_HAS_FOURS
#define Four vs_four
#define load(from) (*(const vs_four*)(from))
#define store(to, values) (*(vs_four*)(to) = (values))
#endif
#if defined(__clang__)
#define VS_REVERSED(v) __builtin_shufflevector(v, v, 3, 2, 1, 0)
#else
typedef long long vs_places __attribute__((vector_size(32)));
static const vs_places vs_reversed = {3, 2, 1, 0};
#define VS_REVERSED(v) __builtin_shuffle(v, vs_reversed)
#endif
#endif

/* a b + c */
#if !defined(VS_FUSES)
VS_INLINE Real vs_fuse(Real a, Real b, Real c) {
  return a * b + c;
}
#define vs_fuse_four(a, b, c) ((a) * (b) + (c))
#elif defined(__clang__)
VS_INLINE Real vs_fuse(Real a, Real b, Real c) {
#pragma clang fp contract(fast)
  return a * b + c;
}
VS_INLINE vs_four vs_fuse_four(vs_four a, vs_four b, vs_four c) {
#pragma clang fp contract(fast)
  return a * b + c;
}
#else
#if defined(__x86_64__)
#define vs_fuse_four(a, b, c) ((vs_four)__builtin_ia32_vfmaddpd256(a, b, c))
#else
VS_INLINE vs_four vs_fuse_four(vs_four a, vs_four b, vs_four c) {
  int j;
  for (j = 0; j < 4; ++j) c[j] = __builtin_fma(a[j], b[j], c[j]);
  return c;
}
#endif
VS_INLINE Real vs_fuse(Real a, Real b, Real c) {
  return __builtin_fma(a, b, c);
}
#endif

/* sum_{k=from..to} a_k b_{n-k} */
#ifndef VS_TANGENTS
VS_INLINE Real vs_total(const Real* a, const Real* b, int n, int from, int to) {
  Real sum = vs_zero;
  int k = from;
  if (to - from >= 3) {
#if defined(VS_HAS_FOURS)
    vs_four part = {0.0, 0.0, 0.0, 0.0};
    VS_UNROLL
    for (; k + 3 <= to; k += 4) {
      const vs_four reversed = *(const vs_four*)(b + n - k - 3);
      part = vs_fuse_four(*(const vs_four*)(a + k), VS_REVERSED(reversed), part);
    }
#else
    Real part[4] = {vs_zero, vs_zero, vs_zero, vs_zero};
    VS_UNROLL
    for (; k + 3 <= to; k += 4) {
      int j;
      for (j = 0; j < 4; ++j) part[j] = vs_fuse(a[k + j], b[n - k - j], part[j]);
    }
#endif
    sum = (part[0] + part[2]) + (part[1] + part[3]);
  }
  VS_UNROLL
  for (; k <= to; ++k) sum = vs_fuse(a[k], b[n - k], sum);
  return sum;
}
#endif

/* sum_{k<count} a_k b_k */
VS_INLINE Real vs_dot(const Real* a, const Real* b, int count) {
  Real sum = vs_zero;
  int k = 0;
  if (count >= 4) {
#if defined(VS_HAS_FOURS)
    vs_four part = {0.0, 0.0, 0.0, 0.0};
    VS_UNROLL
    for (; k + 4 <= count; k += 4) {
      part = vs_fuse_four(*(const vs_four*)(a + k), *(const vs_four*)(b + k), part);
    }
#else
    Real part[4] = {vs_zero, vs_zero, vs_zero, vs_zero};
    VS_UNROLL
    for (; k + 4 <= count; k += 4) {
      int j;
      for (j = 0; j < 4; ++j) part[j] = vs_fuse(a[k + j], b[k + j], part[j]);
    }
#endif
    sum = (part[0] + part[2]) + (part[1] + part[3]);
  }
  VS_UNROLL
  for (; k < count; ++k) sum = vs_fuse(a[k], b[k], sum);
  return sum;
}

/* y_j = sum_k a_k b_{j+k} with j and k of 0 to last. y has room for a multiple of four, and b, up
 * to 2 last + 3, is finite. */
VS_INLINE void vs_correlate(const Real* a, const double* b, int last, Real* y) {
  int j, k;
#if defined(VS_HAS_FOURS)
  for (j = 0; j <= last; j += 4) {
    vs_four part = {0.0, 0.0, 0.0, 0.0};
    for (k = 0; k <= last; ++k) {
      const vs_four one = {a[k], a[k], a[k], a[k]};
      part = vs_fuse_four(one, *(const vs_four*)(b + j + k), part);
    }
    *(vs_four*)(y + j) = part;
  }
#else
  for (j = 0; j <= last; ++j) {
    y[j] = vs_zero;
    for (k = 0; k <= last; ++k) y[j] = vs_fuse(a[k], b[j + k], y[j]);
  }
#endif
}

/* sum_{k=low..n-up} a_k b_{n-k} for low and up of 0 or 1. The coefficients of order n were stored
 * just now: they are read as single numbers, since a vector would wait for their stores. */
VS_INLINE Real vs_convolve(const Real* a, const Real* b, int n, int low, int up) {
  Real sum = vs_zero;
  if (n == 0) {
    if (low == 0 && up == 0) sum = a[0] * b[0];
    return sum;
  }
  sum = vs_total(a, b, n, 1, n - 1);
  if (low == 0) sum = vs_fuse(a[0], b[n], sum);
  if (up == 0) sum = vs_fuse(a[n], b[0], sum);
  return sum;
}

/* sum_{k=low..n-low} a_k a_{n-k} = 2 sum_{low<=k<n/2} a_k a_{n-k} + a_{n/2}^2 */
VS_INLINE Real vs_convolve_self(const Real* a, int n, int low) {
  Real sum = vs_zero;
  if (n == 0) {
    if (low == 0) sum = a[0] * a[0];
    return sum;
  }
  sum = 2.0 * vs_total(a, a, n, 1, (n - 1) / 2);
  if (n % 2 == 0) sum = vs_fuse(a[n / 2], a[n / 2], sum);
  if (low == 0) sum = vs_fuse(2.0 * a[0], a[n], sum);
  return sum;
}

/* 1/n sum_{k<n} rate_k w_{n-1-k}, the coefficient n > 0 of the integral of rate w; rate_k is 0 for
 * k > last */
VS_INLINE Real vs_chain(const Real* rate, const Real* w, int last, int n) {
  if (last == 0) return rate[0] * w[n - 1] * (1.0 / n);
  return vs_convolve(rate, w, n - 1, 0, 0) * (1.0 / n);
}

/* 1 / (1 + exp(x)) and the like keep their limit where exp(x) has overflowed. */
VS_INLINE int vs_overflows(Real x, Real y) {
  return isinf(x) && isfinite(y);
}
VS_INLINE int vs_is_at_limit(const Real* x, const Real* y, int n) {
  return n > 0 && vs_overflows(x[0], y[0]);
}

/* y = a b */
VS_INLINE void vs_multiply(Real* y, const Real* a, const Real* b, int n) {
  y[n] = vs_convolve(a, b, n, 0, 0);
}

/* y = a^2 */
VS_INLINE void vs_square(Real* y, const Real* a, int n) {
  y[n] = vs_convolve_self(a, n, 0);
}

/* y = a / b: y_n = (a_n - sum_{k<n} y_k b_{n-k}) / b_0 */
VS_INLINE void vs_divide(Real* y, const Real* a, const Real* b, int n) {
  if (n == 0) {
    y[0] = a[0] / b[0];
    y[VS_KEPT] = 1.0 / b[0];
    return;
  }
  y[n] = (a[n] - vs_convolve(y, b, n, 0, 1)) * y[VS_KEPT];
}

/* rate = x', coefficients n - 1: rate_{n-1} = n x_n */
VS_INLINE void vs_differentiate(Real* rate, const Real* x, int n) {
  if (n > 0) rate[n - 1] = n * x[n];
}

/* y = exp(x): y' = x' y. In all that follow, `rate` is x' and `last` its last coefficient. */
VS_INLINE void vs_exponential(Real* y, const Real* x, const Real* rate, int last, int n) {
  if (n == 0) {
    y[0] = exp(x[0]);
    return;
  }
  y[n] = vs_chain(rate, y, last, n);
}

/* s = sin(x), c = cos(x): s' = x' c, c' = -x' s */
VS_INLINE void vs_sine_cosine(Real* s, Real* c, const Real* x, const Real* rate, int last, int n) {
  if (n == 0) {
    s[0] = sin(x[0]);
    c[0] = cos(x[0]);
    return;
  }
  s[n] = vs_chain(rate, c, last, n);
  c[n] = -vs_chain(rate, s, last, n);
}

/* s = sinh(x), c = cosh(x): s' = x' c, c' = x' s */
VS_INLINE void vs_sinh_cosh(Real* s, Real* c, const Real* x, const Real* rate, int last, int n) {
  if (n == 0) {
    s[0] = sinh(x[0]);
    c[0] = cosh(x[0]);
    return;
  }
  s[n] = vs_chain(rate, c, last, n);
  c[n] = vs_chain(rate, s, last, n);
}

/* y = tan(x), w = 1 + y^2 = 1 / cos(x)^2: y' = x' w */
VS_INLINE void vs_tangent(Real* y, Real* w, const Real* x, const Real* rate, int last, int n) {
  if (n == 0) {
    const Real cosine = cos(x[0]);
    y[0] = tan(x[0]);
    w[0] = 1.0 / (cosine * cosine);
    return;
  }
  y[n] = vs_chain(rate, w, last, n);
  w[n] = vs_convolve_self(y, n, 0);
}

/* y = tanh(x) = (1 - q) / (1 + q) and w = 1 / cosh(x)^2 = 4 q / (1 + q)^2, q = exp(-2 |x|) */
VS_INLINE void vs_find_tanh(Real x, Real* y, Real* w) {
  const Real exponent = -2.0 * fabs(x);
  Real q, less, part; /* less: q - 1 */
  if (exponent < -0.7) {
    q = exp(exponent);
    less = q - 1.0;
  } else {
    less = expm1(exponent);
    q = 1.0 + less;
  }
  part = 1.0 / (2.0 + less);
  *y = x < 0.0 ? less * part : -less * part;
  *w = 4.0 * q * part * part;
}

/* y = tanh(x), w = 1 - y^2 = 1 / cosh(x)^2: y' = x' w. (Where q underflows, w and all
 * coefficients but the first are 0.) */
VS_INLINE void vs_tangent_hyperbolic(Real* y, Real* w, const Real* x, const Real* rate, int last,
                                     int n) {
  if (n == 0) {
    vs_find_tanh(x[0], y, w);
    return;
  }
  y[n] = vs_chain(rate, w, last, n);
  w[n] = -vs_convolve_self(y, n, 0);
}

/* y' = factor p / w, with q = p / w, from `value` on: log (p = x', w = x), atan (p = x',
 * w = 1 + x^2), asin, acos (w = sqrt(1 - x^2)), atan2(a, b) (p = b a' - a b', w = a^2 + b^2) */
VS_INLINE void vs_integrate_quotient(Real* y, Real* q, Real value, const Real* p, const Real* w,
                                     Real factor, int n) {
  if (n == 0) {
    y[0] = value;
    q[VS_KEPT] = 1.0 / w[0];
    return;
  }
  q[n - 1] = (p[n - 1] - vs_convolve(q, w, n - 1, 0, 1)) * q[VS_KEPT];
  y[n] = factor * q[n - 1] * (1.0 / n);
}

/* y = b' a - a' b, coefficients n - 1 */
VS_INLINE void vs_wronskian(Real* y, const Real* a, const Real* b, const Real* rate_a,
                            const Real* rate_b, int n) {
  if (n > 0) y[n - 1] = vs_convolve(rate_b, a, n - 1, 0, 0) - vs_convolve(rate_a, b, n - 1, 0, 0);
}

/* y = sqrt(x): y_n = (x_n - sum_{0<k<n} y_k y_{n-k}) / (2 y_0) */
VS_INLINE void vs_square_root(Real* y, const Real* x, int n) {
  if (n == 0) {
    y[0] = sqrt(x[0]);
    y[VS_KEPT] = 0.5 / y[0];
    return;
  }
  y[n] = (x[n] - vs_convolve_self(y, n, 1)) * y[VS_KEPT];
}

/* y = x^k: x y' = k x' y, so x_0 y_n = (k + 1)/n sum_{j>0} j x_j y_{n-j} - sum_{j>0} x_j y_{n-j};
 * at x_0 = 0 the derivatives below the k-th are 0, and the others no numbers */
VS_INLINE void vs_power(Real* y, const Real* x, const Real* rate, int last, Real k, int n) {
  if (n == 0) {
    y[0] = pow(x[0], k);
    y[VS_KEPT] = 1.0 / x[0];
    return;
  }
  if (x[0] == 0.0 && n < k) {
    y[n] = 0.0;
    return;
  }
  y[n] = vs_fuse(k + 1.0, vs_chain(rate, y, last, n), -vs_convolve(y, x, n, 0, 1)) * y[VS_KEPT];
}

/* ---- Formulas with modes. A mode is below 0, above 0, or 0 while the switching function a - b is
 * 0 to all known orders; the first coefficient that is not 0 decides it, which is the direction
 * that the motion takes. ---- */

VS_INLINE double vs_mode(double* mode, double a, double b, int n) {
  if (n == 0) *mode = 0.0;
  if (*mode == 0.0) *mode = a < b ? -1.0 : a > b ? 1.0 : a - b;
  return *mode;
}

/* |a| */
VS_INLINE void vs_absolute(Real* y, const Real* a, double* mode, int n) {
  y[n] = vs_mode(mode, a[n], 0.0, n) * a[n];
}

/* -1, 0, 1 or NaN */
VS_INLINE void vs_sign(Real* y, const Real* a, int n) {
  y[n] = n > 0 ? 0.0 : a[0] > 0.0 ? 1.0 : a[0] < 0.0 ? -1.0 : (double)a[0];
}

/* a <= b ? yes : no, and with a and b for these min(a, b) or max(a, b); NaN where the two cannot
 * be compared. On the edge of a jump the formula's own value decides, and stays. */
VS_INLINE void vs_choose(Real* y, const Real* a, const Real* b, const Real* yes, const Real* no,
                         double* mode, int n) {
  if (vs_mode(mode, a[n], b[n], n) == 0.0 && yes[0] != no[0]) *mode = -1.0;
  y[n] = *mode != *mode ? (Real)*mode : *mode <= 0.0 ? yes[n] : no[n];
}

/* b, but 0 where a is infinite */
VS_INLINE void vs_where_finite(Real* y, const Real* a, const Real* b, int n) {
  y[n] = isinf(a[0]) ? vs_zero : isnan(a[0]) ? a[0] : b[n];
}
