// What every emitted program has: projections, edges, jumps and steps (dynamics/projection.h,
// dynamics/jump.h, integrate/integrator.h tell the ideas).
#include "emit_c/c_text.h"

namespace variator_sim {

const char* const kProjectionCode = R"c(
/* ---- Onto the constraints ---- */

/* Newton's iteration: the correction that was made to S values is small enough. */
static int has_converged(const double *values, const double *change, double *previous)
{
  double size = 0.0;
  double length = 0.0;
  int i, ends;
  for (i = 0; i < S; ++i) {
    size = fmax(size, fabs(change[i]));
    length = fmax(length, fabs(values[i]));
    if (!isfinite(values[i])) return 0;
  }
  ends = size <= 1e-8 * length || size == 0.0;
  /* Rounding keeps corrections to tiny values from shrinking. */
  ends = ends || (size >= 0.5 * *previous && size <= 1e-12 * (length + 1.0));
  *previous = size;
  return ends;
}

/* Moves the velocities onto f = 0 of the constraints of order 1, and `values`, which are the
   accelerations, onto psi = 0 or f' = 0: x = -J^-1 C' (C J^-1 C')^-1 psi. */
static scene_status project_onto(scene_model *m, double *values, int low, int high)
{
  const int *const residual = high == 1 ? velocity_residual_row : residual_row;
  double previous = INFINITY;
  double x[SIZE];
  int i, round;
  for (round = 0; round < 25; ++round) {
    enter_state(m);
    if (high == 1) at_once(m->row, m->branch, m->piece, 0);
    if (!factor(m, low, high)) return SCENE_SINGULAR;
    for (i = 0; i < SIZE; ++i) x[i] = 0.0;
    for (i = 0; i < K; ++i) {
      if (is_counted(i, low, high)) x[S + i] = -m->row[residual[i]][0];
    }
    solve(m, SIZE, x);
    for (i = 0; i < S; ++i) values[i] += x[i];
    if (has_converged(values, x, &previous)) return SCENE_OK;
  }
  return SCENE_NOT_CONVERGED;
}

static scene_status project_velocities(scene_model *m)
{
  return HAS_ORDER_1 ? project_onto(m, m->now.velocity, 1, 1) : SCENE_OK;
}

/* The accelerations of least reaction, J epsilon + n - Q = C' lambda and psi = 0, by Newton's
   iteration from those of the state and `lambda`. */
static scene_status find_least_reaction(scene_model *m, double *lambda)
{
  double previous = INFINITY;
  double x[SIZE];
  int i, p, round;
  for (round = 0; round < 50; ++round) {
    enter_state(m);
    if (!factor_curved(m, lambda, 1, 2)) return SCENE_SINGULAR;
    reaction(m, x);
    for (i = 0; i < S; ++i) x[i] = -x[i];
    for (p = 0; p < K; ++p) {
      x[S + p] = 0.0;
      if (!is_counted(p, 1, 2)) continue;
      for (i = 0; i < S; ++i) x[i] += m->row[entry_row[S * p + i]][0] * lambda[p];
      x[S + p] = -m->row[residual_row[p]][0];
    }
    solve(m, SIZE, x);
    for (i = 0; i < S; ++i) m->now.acceleration[i] += x[i];
    for (p = 0; p < K; ++p) lambda[p] += x[S + p];
    if (has_converged(m->now.acceleration, x, &previous)) return SCENE_OK;
  }
  return SCENE_NOT_CONVERGED;
}

/* R' = C' Lambda: what no C has a part of is a constant of R (with J(phi) of R / sqrt(J)). It is
   taken from the applied torque, which the state tells, and not from the accelerations. */
static void note_reaction(scene_model *m)
{
  int i;
  enter_inputs(m, 1.0, 0);
  enter_state(m);
  reaction(m, m->now.reaction);
  for (i = 0; i < S && INERTIA_VARIES; ++i) m->now.reaction[i] /= sqrt(inertia(m, i, i));
}

static scene_status restore_reaction(scene_model *m)
{
  double x[SIZE];
  int i;
  enter_state(m);
  if (!factor(m, 1, 3)) return SCENE_SINGULAR;
  reaction(m, x);
  for (i = 0; i < S; ++i) {
    const double scale = INERTIA_VARIES ? sqrt(inertia(m, i, i)) : 1.0;
    x[i] = is_neutral[i] ? scale * m->now.reaction[i] - x[i] : 0.0;
  }
  for (i = 0; i < K; ++i) x[S + i] = 0.0;
  solve(m, SIZE, x);
  for (i = 0; i < S; ++i) m->now.acceleration[i] += x[i];
  return SCENE_OK;
}

/* The accelerations of a state: those that the principle gives, or its own, on psi = 0. */
static scene_status settle_accelerations(scene_model *m)
{
  if (IS_CLASSICAL) return find_least_reaction(m, m->now.multiplier);
  return HAS_RESIDUAL ? project_onto(m, m->now.acceleration, 1, 2) : SCENE_OK;
}
)c";

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

/* The state, whose formulas were entered, lies on the other side. */
static int is_beyond(const scene_model *m, const edge *at)
{
  const int row_of_it = at->guard < SIGNS ? sign_row[at->guard] : passage_row[at->guard - SIGNS];
  const double distance = m->row[row_of_it][0] - at->point;
  return at->side == 0.0 ? distance != 0.0 : distance * at->side < 0.0;
}
)c";

const char* const kJumpCode = R"c(
/* ---- Jumps: time, angles and velocities stay, the accelerations move along psi = 0 by
        J d(epsilon) = dQ + C' L,  C d(epsilon) + dpsi/du du = 0. ---- */

/* At the state that was entered. */
static int jump_rate(scene_model *m, const double *dQ, const double *du, double *x)
{
  int i, p;
  if (!factor(m, 1, 3)) return 0;
  for (i = 0; i < S; ++i) x[i] = dQ[i];
  for (p = 0; p < K; ++p) x[S + p] = 0.0;
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
                     const double *dQ, double *x)
{
  int i;
  for (i = 0; i < INPUTS; ++i) {
    m->row[INPUT + 3 * i][0] = du == 0 ? u0[i] : u0[i] + theta * du[i];
  }
  enter_state(m);
  return jump_rate(m, dQ, du, x);
}

static scene_status jump(scene_model *m, const double *u0, const double *du, const double *dQ)
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
    is_good = path_rate(m, theta, u0, du, dQ, k[0]);
    for (n = 0; n < 6 && is_good; ++n) {
      for (i = 0; i < S; ++i) {
        double sum = 0.0;
        for (j = 0; j <= n; ++j) sum += a[n][j] * k[j][i];
        m->now.acceleration[i] = begin[i] + h * sum;
      }
      is_good = path_rate(m, theta + c[n] * h, u0, du, dQ, k[n + 1]);
    }
    for (i = 0; i < S && is_good; ++i) {
      double error = 0.0;
      for (j = 0; j < 7; ++j) error += e[j] * k[j][i];
      norm = fmax(norm, fabs(h * error) / (0.1 * tolerance_of(m->now.acceleration[i])));
      is_good = isfinite(m->now.acceleration[i]) && isfinite(error);
    }
    if (is_good && norm <= 1.0) {
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

const char* const kStepCode = R"c(
/* ---- Steps ---- */

static void go(scene_model *m, double theta)
{
  const double h = theta * m->unit;
  const int last = last_term(m);
  double rest, sum;
  int c, i;
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = evaluate(m->row[ANGLE + i], last, theta);
    m->now.velocity[i] = evaluate(m->row[VELOCITY + i], last, theta);
    m->now.acceleration[i] = evaluate(m->row[ACCELERATION + i], m->order, theta);
  }
  for (c = 0; c < K && IS_CLASSICAL; ++c) {
    m->now.multiplier[c] = evaluate(m->row[MULTIPLIER + c], m->order, theta);
  }
  for (i = 0; i < INPUTS; ++i) {
    scene_signal *const s = &m->now.input[i];
    const int has_arrived = s->age + h >= s->end * (1.0 - 1e-14);
    s->age = has_arrived ? s->end : s->age + h;
    if (m->now.silence[i] >= 0.0) m->now.silence[i] += h;
  }
  /* time + time_rest is the sum, rounded once */
  rest = h + m->now.time_rest;
  sum = m->now.time + rest;
  m->now.time_rest = rest - (sum - m->now.time);
  m->now.time = sum;
}

/* x' at the end of a step beside that of the series: the error that the last terms do not show. */
static scene_status measure_defect(scene_model *m, const double *slope, double h, int last,
                                   double *defect)
{
  int i;
  *defect = 0.0;
  if (!IS_CLASSICAL) {
    if (!begin_series(m, m->unit)) return SCENE_SINGULAR;
    if (!extend_series(m)) return SCENE_NOT_FINITE;
  }
  for (i = 0; i < S; ++i) {
    const double rate = IS_CLASSICAL ? m->now.acceleration[i]
                                     : m->row[ACCELERATION + i][1] / m->unit;
    const double size = IS_CLASSICAL ? m->now.velocity[i] : m->now.acceleration[i];
    *defect = fmax(*defect, h * fabs(rate - slope[i]) / ((last + 1) * tolerance_of(size)));
  }
  return SCENE_OK;
}

/* What may jump at an edge. */
typedef struct {
  double torque[S];
  double residual[K + 1]; /* f or psi; 0 of order 3 */
} law_values;

static void look(scene_model *m, double theta, law_values *found)
{
  int i;
  go(m, theta);
  enter_inputs(m, m->unit, 0);
  enter_state(m);
  at_once(m->row, m->branch, m->piece, 0);
  for (i = 0; i < S; ++i) found->torque[i] = m->row[torque_row[i]][0];
  for (i = 0; i < K; ++i) {
    const int *const residual = order_of[i] == 1 ? velocity_residual_row : residual_row;
    found->residual[i] = order_of[i] < 3 ? m->row[residual[i]][0] : 0.0;
  }
}

/* A jump of a constraint of order 1 or 2 has no motion. Its size is what it would move the
   velocities or accelerations by. */
static int has_gap(const scene_model *m, const law_values *before, const law_values *after)
{
  int i, p;
  for (p = 0; p < K; ++p) {
    const double l = (after->residual[p] - before->residual[p]) / m->length[p];
    const double *const x = order_of[p] == 1 ? m->now.velocity : m->now.acceleration;
    for (i = 0; i < S; ++i) {
      const double moved = m->row[entry_row[S * p + i]][0] * l / inertia(m, i, i);
      if (!(fabs(moved) <= tolerance_of(x[i]))) return 1;
    }
  }
  return 0;
}

/* Over an edge, to the state shortly behind it. *theta: where the step has ended. */
static scene_status cross(scene_model *m, const edge *at, double *theta)
{
  const scene_state base = m->now;
  double ahead = fmax(1e-13 * at->theta, 4.0 * DBL_EPSILON * fmax(1.0, base.time) / m->unit);
  double u[INPUTS + 1];
  law_values before, after;
  scene_status status;
  int i, trial;
  /* (Every look at a state overwrites the coefficients of order 0.) */
  for (i = 0; i < ROWS; ++i) m->kept[i] = m->row[i][0];
  look(m, fmax(0.0, at->theta - ahead), &before);
  for (trial = 0; trial < 40; ++trial, ahead *= 2.0) {
    m->now = base;
    for (i = 0; i < ROWS; ++i) m->row[i][0] = m->kept[i];
    *theta = at->theta + ahead;
    look(m, *theta, &after);
    if (is_beyond(m, at)) break;
  }
  if (!factor(m, 1, 3)) return SCENE_SINGULAR;
  if (has_gap(m, &before, &after)) return SCENE_NO_MOTION;
  status = project_velocities(m);
  if (status == SCENE_OK) status = settle_accelerations(m);
  if (status != SCENE_OK || IS_CLASSICAL || !at->jumps) return status;
  enter_state(m);
  for (i = 0; i < S; ++i) after.torque[i] -= before.torque[i];
  for (i = 0; i < INPUTS; ++i) u[i] = input_value(&m->now.input[i]);
  return jump(m, u, 0, after.torque);
}

/* No jump was stepped over unseen. */
static int keeps_sides(const scene_model *m, const double *sides)
{
  int g;
  for (g = 0; g < SIGNS; ++g) {
    if (!sign_jumps[g] || sides[g] == 0.0) continue;
    if (!(m->row[sign_row[g]][0] * sides[g] > 0.0)) return 0;
  }
  return 1;
}

/* One step of at most `left` s; *made: how long it was. */
static scene_status make_step(scene_model *m, double left, double *made)
{
  double limit = fmin(left, MAXIMUM_STEP);
  scene_status status = SCENE_OK;
  scene_state before;
  int i, trial;
  for (i = 0; i < INPUTS; ++i) {
    scene_signal *const s = &m->now.input[i];
    if (s->age >= s->end) hold_constant(s, s->target);
    limit = fmin(limit, m->now.input[i].end - m->now.input[i].age);
    if (m->now.silence[i] >= 0.0 && timeout_of[i] > 0.0) {
      limit = fmin(limit, timeout_of[i] - m->now.silence[i]);
    }
  }
  before = m->now;
  limit = fmax(limit, 4.0 * DBL_EPSILON * fmax(1.0, m->now.time));
  for (trial = 0; trial < 60; ++trial) {
    double slope[S], sides[SIGNS + 1];
    double defect = 0.0;
    double theta, h;
    edge at;
    int last, c;
    status = expand(m, limit);
    if (status != SCENE_OK) return status;
    theta = fmin(limit, m->usual) / m->unit;
    at = find_edge(m, theta);
    for (i = 0; i < SIGNS; ++i) sides[i] = first_sign(m->row[sign_row[i]], m->order);
    h = theta * m->unit;
    if (at.guard >= 0) {
      status = cross(m, &at, &theta);
      h = theta * m->unit;
      m->crossings = h <= 1e-9 * fmax(1.0, m->now.time) ? m->crossings + 1 : 0;
      if (status == SCENE_OK && m->crossings > 20) return SCENE_CHATTERING;
    } else {
      /* x' of the last component at the end */
      last = last_term(m);
      for (i = 0; i < S; ++i) {
        const double *const x = m->row[(IS_CLASSICAL ? VELOCITY : ACCELERATION) + i];
        slope[i] = last * x[last];
        for (c = last - 1; c > 0; --c) slope[i] = slope[i] * theta + c * x[c];
        slope[i] /= m->unit;
      }
      go(m, theta);
      enter_inputs(m, m->unit, 0);
      status = project_velocities(m);
      if (status == SCENE_OK) status = settle_accelerations(m);
      if (status == SCENE_OK && HAS_NEUTRAL) status = restore_reaction(m);
      if (status == SCENE_OK) status = measure_defect(m, slope, h, last, &defect);
      if (status == SCENE_OK && !keeps_sides(m, sides)) defect = INFINITY;
      m->crossings = 0;
    }
    if (status == SCENE_OK && defect <= 1.0) {
      *made = h;
      return SCENE_OK;
    }
    m->now = before;
    if (status == SCENE_NO_MOTION || status == SCENE_CHATTERING) return status;
    limit = 0.5 * h;
    if (!(limit > 1e-14 * fmax(1.0, m->now.time))) break;
  }
  return status == SCENE_OK ? SCENE_TOO_MANY_STEPS : status;
}
)c";

}  // namespace variator_sim
