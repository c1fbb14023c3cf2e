// Power series in C. Each function makes coefficient n of its result from those of its operands up
// to n and of itself below n, order 0 included (series_program.h has the recurrences).
#include <iterator>

#include "emit_c/c_text.h"

namespace variator_sim {

namespace {

struct SeriesFunction {
  const char* name;
  const char* needs[3];  ///< other functions, null behind the last one
  const char* text;
};

/// Functions come after those they need.
constexpr SeriesFunction kFunctions[] = {
    {"convolve", {}, R"c(
/* sum of a[j] b[n-j] for low <= j <= high */
static double convolve(const double *a, const double *b, int n, int low, int high)
{
  double sum = 0.0;
  int j;
  for (j = low; j <= high; ++j) sum += a[j] * b[n - j];
  return sum;
}
)c"},
    {"chain", {}, R"c(
/* 1/n sum of j x[j] w[n-j] for 1 <= j <= last: of y' = x' w */
static double chain(const double *x, const double *w, int n, int last)
{
  double sum = 0.0;
  int j;
  for (j = 1; j <= last; ++j) sum += j * x[j] * w[n - j];
  return sum / n;
}
)c"},
    {"at_limit", {}, R"c(
/* 1/(1 + exp(x)) and its like, where exp(x) has overflowed, stay at their limit */
static int at_limit(const double *x, const double *y, int n)
{
  return n > 0 && isinf(x[0]) && isfinite(y[0]);
}
)c"},
    {"scale", {}, R"c(
static void scale(double *y, const double *a, double factor, int n)
{
  y[n] = factor * a[n];
}
)c"},
    {"shift", {}, R"c(
static void shift(double *y, const double *a, double by, int n)
{
  y[n] = n == 0 ? a[0] + by : a[n];
}
)c"},
    {"add", {}, R"c(
static void add(double *y, const double *a, const double *b, int n)
{
  y[n] = a[n] + b[n];
}
)c"},
    {"subtract", {}, R"c(
static void subtract(double *y, const double *a, const double *b, int n)
{
  y[n] = a[n] - b[n];
}
)c"},
    {"multiply", {"convolve"}, R"c(
static void multiply(double *y, const double *a, const double *b, int n)
{
  y[n] = convolve(a, b, n, 0, n);
}
)c"},
    {"divide", {"convolve"}, R"c(
static void divide(double *y, const double *a, const double *b, int n)
{
  y[n] = (a[n] - convolve(b, y, n, 1, n)) / b[0];
}
)c"},
    {"exponential", {"chain"}, R"c(
static void exponential(double *y, const double *a, int n)
{
  y[n] = n == 0 ? exp(a[0]) : chain(a, y, n, n);
}
)c"},
    {"logarithm", {"chain"}, R"c(
static void logarithm(double *y, const double *a, int n)
{
  y[n] = n == 0 ? log(a[0]) : (a[n] - chain(y, a, n, n - 1)) / a[0];
}
)c"},
    {"sine_cosine", {"chain"}, R"c(
static void sine_cosine(double *s, double *c, const double *a, int n)
{
  s[n] = n == 0 ? sin(a[0]) : chain(a, c, n, n);
  c[n] = n == 0 ? cos(a[0]) : -chain(a, s, n, n);
}
)c"},
    {"sinh_cosh", {"chain"}, R"c(
static void sinh_cosh(double *s, double *c, const double *a, int n)
{
  s[n] = n == 0 ? sinh(a[0]) : chain(a, c, n, n);
  c[n] = n == 0 ? cosh(a[0]) : chain(a, s, n, n);
}
)c"},
    {"tangent", {"chain", "convolve"}, R"c(
/* w = 1 + y^2 */
static void tangent(double *y, double *w, const double *a, int n)
{
  y[n] = n == 0 ? tan(a[0]) : chain(a, w, n, n);
  w[n] = n == 0 ? 1.0 / (cos(a[0]) * cos(a[0])) : convolve(y, y, n, 0, n);
}
)c"},
    {"tangent_hyperbolic", {"chain", "convolve"}, R"c(
/* w = 1 - y^2 */
static void tangent_hyperbolic(double *y, double *w, const double *a, int n)
{
  y[n] = n == 0 ? tanh(a[0]) : chain(a, w, n, n);
  w[n] = n == 0 ? 1.0 / (cosh(a[0]) * cosh(a[0])) : -convolve(y, y, n, 0, n);
}
)c"},
    {"arc_tangent", {"chain", "convolve"}, R"c(
/* y' w = a', w = 1 + a^2 */
static void arc_tangent(double *y, double *w, const double *a, int n)
{
  w[n] = convolve(a, a, n, 0, n) + (n == 0 ? 1.0 : 0.0);
  y[n] = n == 0 ? atan(a[0]) : (a[n] - chain(y, w, n, n - 1)) / w[0];
}
)c"},
    {"square_root", {"convolve"}, R"c(
static void square_root(double *y, const double *a, int n)
{
  y[n] = n == 0 ? sqrt(a[0]) : (a[n] - convolve(y, y, n, 1, n - 1)) / (2.0 * y[0]);
}
)c"},
    {"one_minus_square_root", {"convolve"}, R"c(
/* w = sqrt(1 - a^2) */
static void one_minus_square_root(double *w, const double *a, int n)
{
  const double square = convolve(a, a, n, 0, n);
  w[n] = n == 0 ? sqrt(1.0 - square) : (-square - convolve(w, w, n, 1, n - 1)) / (2.0 * w[0]);
}
)c"},
    {"arc_sine", {"chain", "one_minus_square_root"}, R"c(
/* y' w = a' */
static void arc_sine(double *y, double *w, const double *a, int n)
{
  one_minus_square_root(w, a, n);
  y[n] = n == 0 ? asin(a[0]) : (a[n] - chain(y, w, n, n - 1)) / w[0];
}
)c"},
    {"arc_cosine", {"chain", "one_minus_square_root"}, R"c(
/* y' w = -a' */
static void arc_cosine(double *y, double *w, const double *a, int n)
{
  one_minus_square_root(w, a, n);
  y[n] = n == 0 ? acos(a[0]) : (-a[n] - chain(y, w, n, n - 1)) / w[0];
}
)c"},
    {"arc_tangent_of_two", {"chain", "convolve"}, R"c(
/* y' w = b a' - a b', w = a^2 + b^2 */
static void arc_tangent_of_two(double *y, double *w, const double *a, const double *b, int n)
{
  w[n] = convolve(a, a, n, 0, n) + convolve(b, b, n, 0, n);
  y[n] = n == 0 ? atan2(a[0], b[0])
                : (chain(a, b, n, n) - chain(b, a, n, n) - chain(y, w, n, n - 1)) / w[0];
}
)c"},
    {"power", {"chain", "convolve"}, R"c(
/* a^k: a y' = k a' y */
static void power(double *y, const double *a, double k, int n)
{
  y[n] = n == 0 ? pow(a[0], k) : ((k + 1.0) * chain(a, y, n, n) - convolve(a, y, n, 1, n)) / a[0];
}
)c"},
    {"side_of", {}, R"c(
/* The branch of a < b, and of the direction in which a - b goes where both are equal: that stays
   from the first order which tells it. */
static int side_of(int *side, double a, double b, int n)
{
  if (n == 0) *side = 0;
  if (*side == 0) *side = a < b ? -1 : a > b ? 1 : 0;
  return *side;
}
)c"},
    {"absolute", {"side_of"}, R"c(
static void absolute(double *y, const double *a, int *side, int n)
{
  y[n] = side_of(side, a[n], 0.0, n) * a[n];
}
)c"},
    {"sign_of", {}, R"c(
static void sign_of(double *y, const double *a, int n)
{
  y[n] = n > 0 ? 0.0 : a[0] > 0.0 ? 1.0 : a[0] < 0.0 ? -1.0 : a[0];
}
)c"},
    {"minimum", {"side_of"}, R"c(
/* (NaN where the two cannot be compared) */
static void minimum(double *y, const double *a, const double *b, int *side, int n)
{
  y[n] = (side_of(side, a[n], b[n], n) <= 0 ? a : b)[n];
  if (n == 0 && (isnan(a[0]) || isnan(b[0]))) y[0] = NAN;
}
)c"},
    {"maximum", {"side_of"}, R"c(
/* (NaN where the two cannot be compared) */
static void maximum(double *y, const double *a, const double *b, int *side, int n)
{
  y[n] = (side_of(side, a[n], b[n], n) >= 0 ? a : b)[n];
  if (n == 0 && (isnan(a[0]) || isnan(b[0]))) y[0] = NAN;
}
)c"},
    {"choose", {"side_of"}, R"c(
/* a <= b ? yes : no; on the edge of a jump it is what it says there */
static void choose(double *y, const double *a, const double *b, const double *yes,
                   const double *no, int *side, int n)
{
  if (side_of(side, a[n], b[n], n) == 0 && yes[0] != no[0]) *side = -1;
  y[n] = (*side <= 0 ? yes : no)[n];
  if (n == 0 && (isnan(a[0]) || isnan(b[0]))) y[0] = NAN;
}
)c"},
    {"where_finite", {}, R"c(
/* b, but 0 where a is infinite */
static void where_finite(double *y, const double *a, const double *b, int n)
{
  y[n] = isinf(a[0]) ? 0.0 : isnan(a[0]) ? a[0] : b[n];
}
)c"},
    {"place", {}, R"c(
/* The piece of a table in which a row lies, and goes on where it lies on a point: its number, and
   behind it whether that is known. True when it has just become another one. */
static int place(int *piece, const double *points, int count, const double *x, int n)
{
  if (n == 0) {
    piece[1] = 0;
    for (piece[0] = 0; piece[0] < count && !(x[0] < points[piece[0]]); ++piece[0]) continue;
    return 0;
  }
  if (piece[1] || x[n] == 0.0) return 0;
  piece[1] = 1;
  if (!(x[n] < 0.0 && piece[0] > 0 && x[0] == points[piece[0] - 1])) return 0;
  --piece[0];
  return 1;
}
)c"},
    {"take_derivative", {}, R"c(
/* c: a polynomial of degree 5 in x; in its place that derivative of it at x + by */
static void take_derivative(double *c, int stride, int order, double by)
{
  int i, k;
  for (; order > 0; --order) {
    for (i = 0; i < 5; ++i) c[stride * i] = (i + 1) * c[stride * (i + 1)];
    c[stride * 5] = 0.0;
  }
  for (k = 0; k < 5; ++k) {
    for (i = 4; i >= k; --i) c[stride * i] += by * c[stride * (i + 1)];
  }
}
)c"},
    {"look_up", {"convolve", "place", "take_derivative"}, R"c(
/* A derivative of a table at x; h[i] = a_i + (x - x_0) h[i+1], h[0] the result. */
typedef struct {
  int count;               /* of points */
  const double *points;
  const double *pieces;    /* 6 coefficients for each of count + 1 pieces, from its lower point on */
} table_of_one;
static void look_up(row *h, const double *x, const table_of_one *table, int order, int *piece,
                    double *a, int n)
{
  int i;
  if (place(piece, table->points, table->count, x, n) || n == 0) {
    const int low = piece[0] > 0 ? piece[0] - 1 : 0;
    for (i = 0; i < 6; ++i) a[i] = table->pieces[6 * piece[0] + i];
    take_derivative(a, 1, order, x[0] - table->points[low]);
    for (i = 0; i < 6; ++i) h[i][0] = a[i];
  }
  if (n == 0) return;
  h[5][n] = 0.0;
  for (i = 4; i >= 0; --i) h[i][n] = convolve(x, h[i + 1], n, 1, n);
}
)c"},
    {"look_up_two", {"convolve", "place", "take_derivative"}, R"c(
/* The same of two variables: q_i = sum of a_ij (y - y_0)^j, h[i] = q_i + (x - x_0) h[i+1], with
   the powers of y - y_0 behind the h. */
typedef struct {
  int count_x, count_y;
  const double *points_x, *points_y;
  const double *pieces;  /* 6 times 6 coefficients for each piece, by x and then by y */
} table_of_two;
static void cut_out(double *a, const table_of_two *table, const int *piece, double x, double y,
                    int order_x, int order_y)
{
  const int low_x = piece[0] > 0 ? piece[0] - 1 : 0;
  const int low_y = piece[2] > 0 ? piece[2] - 1 : 0;
  const double *from = table->pieces + 36 * (piece[0] * (table->count_y + 1) + piece[2]);
  int i;
  for (i = 0; i < 36; ++i) a[i] = from[i];
  for (i = 0; i < 6; ++i) take_derivative(a + i, 6, order_x, x - table->points_x[low_x]);
  for (i = 0; i < 6; ++i) take_derivative(a + 6 * i, 1, order_y, y - table->points_y[low_y]);
}
static void look_up_two(row *h, const double *x, const double *y, const table_of_two *table,
                        int order_x, int order_y, int *piece, double *a, int n)
{
  row *const p = h + 6; /* p[j]: (y - y_0)^(j+1) */
  const int has_moved_x = place(piece, table->points_x, table->count_x, x, n);
  const int has_moved_y = place(piece + 2, table->points_y, table->count_y, y, n);
  const int begin = has_moved_x || has_moved_y ? 0 : n;
  int i, j, m;
  if (begin < n || n == 0) cut_out(a, table, piece, x[0], y[0], order_x, order_y);
  for (m = begin; m <= n; ++m) {
    for (j = 0; j < 5; ++j) {
      p[j][m] = m == 0 ? 0.0 : j == 0 ? y[m] : convolve(y, p[j - 1], m, 1, m);
    }
    for (i = 5; i >= 0; --i) {
      double sum = m == 0 ? a[6 * i] : 0.0;
      for (j = 1; j < 6; ++j) sum += a[6 * i + j] * p[j - 1][m];
      if (i < 5 && m > 0) sum += convolve(x, h[i + 1], m, 1, m);
      h[i][m] = sum;
    }
  }
}
)c"},
};

}  // namespace

std::string writeSeriesFunctions(std::set<std::string> used) {
  for (auto it = std::rbegin(kFunctions); it != std::rend(kFunctions); ++it) {
    if (used.count(it->name) == 0) continue;
    for (const char* const need : it->needs) {
      if (need != nullptr) used.insert(need);
    }
  }
  std::string text;
  for (const SeriesFunction& function : kFunctions) {
    if (used.count(function.name) > 0) text += function.text;
  }
  return text;
}

}  // namespace variator_sim
