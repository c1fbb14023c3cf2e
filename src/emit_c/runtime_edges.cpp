// Events and jumps in every emitted program (explained in integrate/guard_search.h and
// integrate/jump_map.h).
#include "emit_c/c_text.h"

namespace variator_sim {

const char* const kEdgeCode = R"c(
/* ---- Where a formula changes its branch ---- */

/* c0 + c1 (theta) + .. + R(theta): its value and, over +-radius, what it can move at the most. */
static double value_and_reach(const double *c, int last, double theta, double radius,
                              double *reach, double *slope, double *slope_reach)
{
  double shifted[LENGTH];
  double power = 1.0;
  int k, n;
  for (n = 0; n <= last; ++n) shifted[n] = c[n];
  for (k = 0; k < last; ++k) {
    for (n = last - 1; n >= k; --n) shifted[n] += theta * shifted[n + 1];
  }
  *reach = *slope_reach = 0.0;
  for (n = 1; n <= last; ++n) {
    if (n > 1) *slope_reach += n * fabs(shifted[n]) * power;
    power *= radius;
    *reach += fabs(shifted[n]) * power;
  }
  *slope = last > 0 ? shifted[1] : 0.0;
  return shifted[0];
}

/* The first theta in (0, end] at which a polynomial has the other sign than just behind 0; above
   `end` where there is none. */
static double find_sign_change(const double *c, int last, double end)
{
  double low = 0.0;
  double width = end;
  double side, value, reach, slope, slope_reach;
  int rounds;
  while (last > 0 && *c == 0.0) { /* of c / theta */
    ++c;
    --last;
  }
  side = *c;
  if (side == 0.0) return 2.0 * end;
  for (rounds = 0; rounds < 4000 && low < end; ++rounds) {
    const double high = fmin(low + width, end);
    const double radius = 0.5 * (high - low);
    value = value_and_reach(c, last, low + radius, radius, &reach, &slope, &slope_reach);
    if (fabs(value) > reach && value * side > 0.0) {
      low = high;
      width *= 2.0;
      continue;
    }
    if (fabs(slope) > slope_reach || high - low < 1e-13 * end) {
      /* one root at the most */
      if (evaluate(c, last, high) * side >= 0.0) {
        low = high;
        width *= 2.0;
        continue;
      }
      width = high;
      while (width - low > 1e-15 * end) {
        const double middle = 0.5 * (low + width);
        if (!(middle > low && middle < width)) break;
        if (evaluate(c, last, middle) * side < 0.0) width = middle;
        else low = middle;
      }
      return width;
    }
    width = 0.5 * (high - low);
  }
  return low < end ? low : 2.0 * end;
}

typedef struct {
  double theta;  /* of the step, in units */
  int guard;     /* -1: none */
  int jumps;
  double side;   /* the sign of the distance before it */
  double point;  /* of a table */
} edge;

static double first_sign(const double *c, int last)
{
  int n;
  for (n = 0; n < last && c[n] == 0.0; ++n) continue;
  return c[n];
}

static void meet(edge *found, const double *c, int last, int guard, int jumps, double point)
{
  /* A motion that begins on the edge of a jump leaves it at once. */
  const double side = first_sign(c, last);
  const int is_start = jumps && c[0] == 0.0 && side != 0.0;
  const double theta = is_start ? 0.0 : find_sign_change(c, last, found->theta);
  if (theta > found->theta || (found->guard >= 0 && theta == found->theta)) return;
  found->theta = theta;
  found->guard = guard;
  found->jumps = jumps;
  found->side = is_start ? 0.0 : side;
  found->point = point;
}

/* The part of theta up to which a guard's last two terms are next to nothing beside the others: of
   a guard that varies faster than the motion the series may have ended too early. */
static double known_part(const double *c, int last, double theta)
{
  int halvings, n;
  for (halvings = 0; halvings < 60; ++halvings, theta *= 0.5) {
    double power = 1.0;
    double largest = 0.0;
    double tail = 0.0;
    for (n = 0; n <= last; ++n, power *= theta) {
      const double term = fabs(c[n]) * power;
      if (n < last - 1) largest = fmax(largest, term);
      else tail = fmax(tail, term);
    }
    if (tail <= 1e-4 * largest) break;
  }
  return theta;
}

/* How much of a step of theta units may be looked through. */
static double known_to_guards(const scene_model *m, double theta)
{
  int g;
  for (g = 0; g < SIGNS; ++g) theta = known_part(m->row[sign_row[g]], m->order, theta);
  for (g = 0; g < TABLES; ++g) theta = known_part(m->row[passage_row[g]], m->order, theta);
  return theta;
}

/* The first edge in a step of theta units, or so shortly behind it that rounding might lead over
   it: signs first, then points of tables. */
static edge find_edge(const scene_model *m, double theta)
{
  edge found = {0.0, -1, 0, 0.0, 0.0};
  double c[LENGTH];
  int g, k, n;
  found.theta = theta * (1.0 + 1e-12) + 8.0 * DBL_EPSILON * fmax(1.0, m->now.time) / m->unit;
  for (g = 0; g < SIGNS; ++g) meet(&found, m->row[sign_row[g]], m->order, g, sign_jumps[g], 0.0);
  for (g = 0; g < TABLES; ++g) {
    const double *const x = m->row[passage_row[g]];
    int above = 0;
    while (above < passage_count[g] && passage_points[g][above] < x[0]) ++above;
    for (k = above - 1; k <= above + 1; ++k) {
      if (k < 0 || k >= passage_count[g]) continue;
      for (n = 0; n <= m->order; ++n) c[n] = x[n];
      c[0] -= passage_points[g][k];
      meet(&found, c, m->order, SIGNS + g, 0, passage_points[g][k]);
    }
  }
  return found;
}

/* The distance of the state that was entered from an edge. */
static double distance_to(const scene_model *m, const edge *at)
{
  const int guard = at->guard;
  return m->row[guard < SIGNS ? sign_row[guard] : passage_row[guard - SIGNS]][0] - at->point;
}

static int is_before(const scene_model *m, const edge *at)
{
  return distance_to(m, at) * at->side > 0.0;
}

static int is_beyond(const scene_model *m, const edge *at)
{
  const double distance = distance_to(m, at);
  return at->side == 0.0 ? distance != 0.0 : distance * at->side < 0.0;
}
)c";

const char* const kJumpCode = R"c(
/* ---- Jumps: time, angles and velocities stay, the accelerations move along psi = 0 by
        J d(epsilon) = dQ + C' L,  C d(epsilon) + dpsi/du du + df' = 0. ---- */

/* At the state that was entered. df: how f' of the constraints of order 1 jumps, or 0. */
static int jump_rate(scene_model *m, const double *dQ, const double *du, const double *df,
                     double *x)
{
  int i, p;
  if (!factor(m, 1, 3)) return 0;
  for (i = 0; i < S; ++i) x[i] = dQ[i];
  for (p = 0; p < K; ++p) x[S + p] = df == 0 ? 0.0 : -df[p];
  if (du != 0) {
    at_once(m->row, m->branch, m->piece, 0);
    for (p = 0; p < K; ++p) {
      for (i = 0; i < INPUTS; ++i) {
        x[S + p] -= m->row[input_slope_row[INPUTS * p + i]][0] * du[i];
      }
    }
  }
  solve(m, SIZE, x);
  return 1;
}
)c";

const char* const kPathCode = R"c(
/* The path from the inputs u0 to u0 + du, theta from 0 to 1: C turns on it. Dormand and Prince,
   A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980) 19-26. */
static int path_rate(scene_model *m, double theta, const double *u0, const double *du,
                     const double *dQ, const double *df, double *x)
{
  int i;
  for (i = 0; i < INPUTS; ++i) {
    m->row[INPUT + 3 * i][0] = du == 0 ? u0[i] : u0[i] + theta * du[i];
  }
  enter_state(m);
  return jump_rate(m, dQ, du, df, x);
}

static scene_status jump(scene_model *m, const double *u0, const double *du, const double *dQ,
                         const double *df)
{
  static const double a[6][6] = {
      {0.2, 0, 0, 0, 0, 0},
      {3.0 / 40, 9.0 / 40, 0, 0, 0, 0},
      {44.0 / 45, -56.0 / 15, 32.0 / 9, 0, 0, 0},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729, 0, 0},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656, 0},
      {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static const double c[6] = {0.2, 0.3, 0.8, 8.0 / 9, 1.0, 1.0};
  static const double e[7] = {71.0 / 57600,     0, -71.0 / 16695, 71.0 / 1920,
                              -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  double k[7][SIZE];
  double begin[S];
  double theta = 0.0;
  double h = 0.1;
  int i, j, n, steps;
  for (steps = 0; steps < 20000 && theta < 1.0; ++steps) {
    double norm = 0.0;
    int is_good;
    h = fmin(h, 1.0 - theta);
    for (i = 0; i < S; ++i) begin[i] = m->now.acceleration[i];
    is_good = path_rate(m, theta, u0, du, dQ, df, k[0]);
    for (n = 0; n < 6 && is_good; ++n) {
      for (i = 0; i < S; ++i) {
        double sum = 0.0;
        for (j = 0; j <= n; ++j) sum += a[n][j] * k[j][i];
        m->now.acceleration[i] = begin[i] + h * sum;
      }
      is_good = path_rate(m, theta + c[n] * h, u0, du, dQ, df, k[n + 1]);
    }
    for (i = 0; i < S && is_good; ++i) {
      double error = 0.0;
      for (j = 0; j < 7; ++j) error += e[j] * k[j][i];
      norm = fmax(norm, fabs(h * error) / (0.1 * tolerance_of(m->now.acceleration[i])));
      is_good = isfinite(m->now.acceleration[i]) && isfinite(error);
    }
    if (is_good && norm <= 1.0 && df == 0) {
      is_good = !HAS_RESIDUAL || project_onto(m, m->now.acceleration, 1, 2) == SCENE_OK;
      norm = is_good ? norm : INFINITY;
    }
    if (is_good && norm <= 1.0) {
      theta = h < 1.0 - theta ? theta + h : 1.0;
    } else {
      for (i = 0; i < S; ++i) m->now.acceleration[i] = begin[i];
    }
    h *= is_good ? fmin(5.0, fmax(0.2, 0.9 * pow(norm + 1e-10, -0.2))) : 0.2;
    if (!(h > 1e-14)) return SCENE_NO_MOTION;
  }
  return theta < 1.0 ? SCENE_NO_MOTION : SCENE_OK;
}
)c";

}  // namespace variator_sim
