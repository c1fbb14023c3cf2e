// Projections and steps of every emitted program (explained in dynamics/projection.h and
// integrate/integrator.h).
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
   accelerations, onto psi = 0 or f' = 0: x = -J^-1 C' (C J^-1 C')^-1 psi. Rows of order 3 that are
   counted have nothing to be zero: C x = 0. */
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
      if (is_counted(i, low, high) && order_of[i] < 3) x[S + i] = -m->row[residual[i]][0];
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

/* What is left of J epsilon + n - Q = C' lambda and psi = 0, negated. */
static void least_reaction_rest(scene_model *m, const double *lambda, double *x)
{
  int i, p;
  enter_state(m);
  reaction(m, x);
  for (i = 0; i < S; ++i) x[i] = -x[i];
  for (p = 0; p < K; ++p) {
    x[S + p] = 0.0;
    if (!is_counted(p, 1, 2)) continue;
    for (i = 0; i < S; ++i) x[i] += m->row[entry_row[S * p + i]][0] * lambda[p];
    x[S + p] = -m->row[residual_row[p]][0];
  }
}

/* The accelerations of least reaction by Newton's iteration from those of the state and `lambda`;
   `share` of `rest` may be left. */
static scene_status find_least_reaction(scene_model *m, double *lambda, const double *rest,
                                        double share, int rounds)
{
  double previous = INFINITY;
  double x[SIZE];
  int i;
  for (; rounds > 0; --rounds) {
    least_reaction_rest(m, lambda, x);
    for (i = 0; i < SIZE && share > 0.0; ++i) x[i] -= share * rest[i];
    if (!factor_curved(m, lambda, 1, 2)) return SCENE_SINGULAR;
    solve(m, SIZE, x);
    for (i = 0; i < S; ++i) m->now.acceleration[i] += x[i];
    for (i = 0; i < K; ++i) lambda[i] += x[S + i];
    if (has_converged(m->now.acceleration, x, &previous)) return SCENE_OK;
  }
  return SCENE_NOT_CONVERGED;
}

/* The same after a jump: by parts of it, each so short that the iteration hardly has to search,
   for the motion to stay on its branch. */
static scene_status follow_least_reaction(scene_model *m)
{
  double rest[SIZE];
  double done = 0.0;
  double part = 1.0;
  least_reaction_rest(m, m->now.multiplier, rest);
  while (done < 1.0) {
    const scene_state before = m->now;
    const double next = fmin(1.0, done + part);
    if (find_least_reaction(m, m->now.multiplier, rest, 1.0 - next, 5) == SCENE_OK) {
      done = next;
      part *= 2.0;
      continue;
    }
    m->now = before;
    part *= 0.25;
    if (!(part > 1e-6)) return SCENE_NO_MOTION;
  }
  return SCENE_OK;
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
  if (IS_CLASSICAL) return find_least_reaction(m, m->now.multiplier, 0, 0.0, 50);
  return HAS_RESIDUAL ? project_onto(m, m->now.acceleration, 1, 2) : SCENE_OK;
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

/* The state of `base` at theta, with all formulas. */
static void look_from(scene_model *m, const scene_state *base, double theta, law_values *found)
{
  int i;
  m->now = *base;
  for (i = 0; i < ROWS; ++i) m->row[i][0] = m->kept[i];
  look(m, theta, found);
}

/* Where f bends in time or angles, f' jumps: the accelerations go after it, C of the others turning
   with them. */
static scene_status follow_kink(scene_model *m)
{
  double dQ[S], df[K + 1], u[INPUTS + 1];
  int i;
  enter_state(m);
  for (i = 0; i < S; ++i) dQ[i] = 0.0;
  for (i = 0; i < K; ++i) df[i] = order_of[i] == 1 ? m->row[residual_row[i]][0] : 0.0;
  for (i = 0; i < INPUTS; ++i) u[i] = input_value(&m->now.input[i]);
  return jump(m, u, 0, dQ, df);
}

/* Over an edge, to the state shortly behind it. *theta: where the step is to end, and has ended. The
   guard's polynomial is off by what the step is: where the state itself passes is tried. Where that
   is behind the step's end, the guard is -1 and nothing has happened. */
static scene_status cross(scene_model *m, edge *at, double *theta)
{
  const scene_state base = m->now;
  const double least = 4.0 * DBL_EPSILON * fmax(1.0, base.time) / m->unit;
  const double end = *theta * (1.0 + 2e-12) + 4.0 * least;
  double ahead = fmax(1e-14 * at->theta, least);
  double back = ahead;
  double low = 0.0;
  double u[INPUTS + 1];
  law_values before, after;
  scene_status status;
  int i, trial;
  /* (Every look at a state overwrites the coefficients of order 0.) */
  for (i = 0; i < ROWS; ++i) m->kept[i] = m->row[i][0];
  for (trial = 0; trial < 60; ++trial, back *= 2.0) {
    low = fmax(0.0, at->theta - back);
    look_from(m, &base, low, &before);
    if (low == 0.0 || is_before(m, at)) break;
  }
  for (trial = 0; trial < 40; ++trial, ahead *= 2.0) {
    *theta = fmin(at->theta + ahead, end);
    look_from(m, &base, *theta, &after);
    if (is_beyond(m, at)) break;
    if (*theta == end) {
      m->now = base;
      for (i = 0; i < ROWS; ++i) m->row[i][0] = m->kept[i];
      at->guard = -1;
      return SCENE_OK;
    }
  }
  while (*theta - low > fmax(2e-14 * at->theta, least)) {
    const double middle = 0.5 * (low + *theta);
    law_values found;
    look_from(m, &base, middle, &found);
    if (is_beyond(m, at)) {
      *theta = middle;
    } else if (is_before(m, at)) {
      low = middle;
      before = found;
    } else {
      break; /* on the edge itself */
    }
  }
  look_from(m, &base, *theta, &after);
  if (!factor(m, 1, 3)) return SCENE_SINGULAR;
  if (at->jumps && has_gap(m, &before, &after)) return SCENE_NO_MOTION;
  status = project_velocities(m);
  if (status == SCENE_OK && IS_CLASSICAL) status = follow_least_reaction(m);
  if (status == SCENE_OK && !IS_CLASSICAL && HAS_ORDER_1) status = follow_kink(m);
  if (status == SCENE_OK && !IS_CLASSICAL && HAS_RESIDUAL) {
    status = project_onto(m, m->now.acceleration, 1, HAS_ORDER_1 ? 3 : 2);
  }
  if (status != SCENE_OK || IS_CLASSICAL || !at->jumps) return status;
  enter_state(m);
  for (i = 0; i < S; ++i) after.torque[i] -= before.torque[i];
  for (i = 0; i < INPUTS; ++i) u[i] = input_value(&m->now.input[i]);
  return jump(m, u, 0, after.torque, 0);
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

/* The rows of C, K of S each, are kept and compared in J^-1. */
static void keep_rows(scene_model *m, double *rows)
{
  int i, p;
  for (p = 0; p < K; ++p) {
    double length = 0.0;
    for (i = 0; i < S; ++i) {
      const double entry = m->row[entry_row[S * p + i]][0];
      rows[S * p + i] = entry;
      length += entry * entry / inertia(m, i, i);
    }
    m->longest[p] = fmax(m->longest[p], length);
  }
}

/* No row has vanished, nor turned by more than a right angle: then it vanished on the way. */
static int keeps_rank(const scene_model *m, const double *rows)
{
  int i, p;
  for (p = 0; p < K; ++p) {
    double product = 0.0;
    double length = 0.0;
    for (i = 0; i < S; ++i) {
      const double entry = m->row[entry_row[S * p + i]][0] / inertia(m, i, i);
      product += rows[S * p + i] * entry;
      length += m->row[entry_row[S * p + i]][0] * entry;
    }
    if (!(product > 0.0 && length > 1e-20 * m->longest[p])) return 0;
  }
  return 1;
}

/* Newton's iteration for the least reaction went to another branch than the series: theirs has
   ended. (No step is too short for that, and the velocities do not show it.) A part of what the
   accelerations change in a step is the series' own error. */
static int has_leapt(const scene_model *m, const double *begin, const double *of_series)
{
  int i;
  for (i = 0; i < S && IS_CLASSICAL; ++i) {
    const double moved = fabs(m->now.acceleration[i] - of_series[i]);
    const double size = fmax(1.0, fabs(of_series[i]));
    const double change = fabs(of_series[i] - begin[i]);
    if (!(moved <= fmin(1e-3 * size, 0.1 * change) + 1e-9 * size)) return 1;
  }
  return 0;
}

/* One step of at most `left` s; *made: how long it was. */
static scene_status make_step(scene_model *m, double left, double *made)
{
  double limit = fmin(left, MAXIMUM_STEP);
  scene_status status = SCENE_OK;
  scene_state before;
  int loses_rank = 0;
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
    double slope[S], sides[SIGNS + 1], rows[K * S + 1];
    double defect = 0.0;
    double theta, h;
    edge at;
    int last, c;
    status = expand(m, limit);
    if (status != SCENE_OK) return status;
    keep_rows(m, rows);
    theta = known_to_guards(m, fmin(limit, m->usual) / m->unit);
    at = find_edge(m, theta);
    for (i = 0; i < SIGNS; ++i) sides[i] = first_sign(m->row[sign_row[i]], m->order);
    if (at.guard >= 0) {
      double crossed = theta;
      status = cross(m, &at, &crossed);
      if (at.guard >= 0) theta = crossed;
    }
    h = theta * m->unit;
    if (at.guard >= 0) {
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
      loses_rank = status == SCENE_OK && !keeps_rank(m, rows);
      if (loses_rank || (status == SCENE_OK && has_leapt(m, before.acceleration, slope))) defect = INFINITY;
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
  if (loses_rank) return SCENE_SINGULAR;
  return status == SCENE_OK ? SCENE_TOO_MANY_STEPS : status;
}
)c";

}  // namespace variator_sim
