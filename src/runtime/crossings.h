/* Over events (events.h): the state itself tells where it passes one, and how it goes on behind. */

/* Quantities that may jump at an event. */
typedef struct {
  Real torque[MOST_SHAFTS];
  Real residual[MOST_CONSTRAINTS + 1]; /* f or psi; 0 of order 3 */
  Real entry[MOST_CONSTRAINTS * MOST_SHAFTS + 1], direction[MOST_CONSTRAINTS * MOST_SHAFTS + 1];
} vs_law_values;

/* The state at theta behind `base`, with all formulas in `it`. */
VS_FUNCTION void vs_look_from(scene_model* m, scene_series* it, const scene_state* base,
                              const vs_event* at, double theta, vs_law_values* found) {
  int i;
  m->now = *base;
  vs_go(m, VS_INSTANT(m, at, theta));
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  vs_at_once(it, 0);
  for (i = 0; i < S; ++i) found->torque[i] = it->row[torque_row[i]][0];
  for (i = 0; i < K; ++i) {
    const int row = (order_of[i] == 1 ? velocity_residual_row : residual_row)[i];
    found->residual[i] = order_of[i] < 3 ? it->row[row][0] : vs_zero;
  }
  for (i = 0; i < S * K && HAS_ORDER_1; ++i) {
    found->entry[i] = it->row[entry_row[i]][0];
    found->direction[i] = it->row[direction_row[i]][0];
  }
}

/* A jump of a constraint of order 1 or 2 has no motion. Its size is what it would move the
 * velocities or accelerations by. */
VS_FUNCTION int vs_has_gap(const scene_model* m, const scene_series* it,
                           const vs_law_values* before, const vs_law_values* after) {
  int i, p;
  for (p = 0; p < K; ++p) {
    const double l = (after->residual[p] - before->residual[p]) / it->size[p];
    const Real* const x = order_of[p] == 1 ? m->now.velocity : m->now.acceleration;
    for (i = 0; i < S && vs_is_on(it, p); ++i) {
      const double moved = vs_entry(it, p, i) * l / vs_inertia(it, i, i);
      if (!(fabs(moved) <= vs_tolerance(it, x[i]))) return 1;
    }
  }
  return 0;
}

/* f' jumps where f bends in time, angles or velocities, and C with it of the last. */
VS_FUNCTION scene_status vs_follow_kink(scene_model* m, scene_series* it,
                                        const vs_law_values* before) {
  Real dQ[MOST_SHAFTS], u[MOST_INPUTS + 1];
  vs_kink kink;
  int i;
  vs_enter_state(m, it);
  kink.turns = 0;
  for (i = 0; i < S * K; ++i) {
    kink.entry[i] = before->entry[i];
    kink.direction[i] = before->direction[i];
    kink.entry_turn[i] = it->row[entry_row[i]][0] - before->entry[i];
    kink.direction_turn[i] = it->row[direction_row[i]][0] - before->direction[i];
    kink.turns = kink.turns || (order_of[i / S] == 1 &&
                                fabs(kink.entry_turn[i]) + fabs(kink.direction_turn[i]) >
                                    1e-14 * (fabs(kink.entry[i]) + fabs(kink.direction[i])));
  }
  for (i = 0; i < S; ++i) {
    dQ[i] = 0.0;
    kink.acceleration[i] = m->now.acceleration[i];
  }
  for (i = 0; i < K; ++i) kink.gap[i] = it->row[residual_row[i]][0];
  for (i = 0; i < INPUTS; ++i) u[i] = vs_input_value(&m->now.input[i]);
  return vs_jump(m, it, u, 0, dQ, &kink);
}

/* Behind the event, the accelerations that go on from there. */
VS_FUNCTION scene_status vs_settle_beyond(scene_model* m, scene_series* it, const vs_event* at,
                                          const vs_law_values* before, vs_law_values* after) {
  Real u[MOST_INPUTS + 1];
  scene_status status;
  int i;
  if (!vs_factor(it, 1, 3)) return SCENE_SINGULAR;
  if (at->jumps && vs_has_gap(m, it, before, after)) return SCENE_NO_MOTION;
  status = vs_project_velocities(m, it);
  if (status == SCENE_OK && IS_CLASSICAL) status = vs_follow_least_reaction(m, it);
  if (status == SCENE_OK && !IS_CLASSICAL && HAS_ORDER_1) status = vs_follow_kink(m, it, before);
  if (status == SCENE_OK && !IS_CLASSICAL && !IS_FORMAL && HAS_RESIDUAL) {
    status = vs_settle_accelerations(m, it);
  }
  if (status == SCENE_OK && !IS_CLASSICAL && at->jumps) {
    for (i = 0; i < S; ++i) after->torque[i] -= before->torque[i];
    for (i = 0; i < INPUTS; ++i) u[i] = vs_input_value(&m->now.input[i]);
    status = vs_jump(m, it, u, 0, after->torque, 0);
  }
  /* (Shortly behind a steep edge the series is that of the edge.) */
  if (status != SCENE_OK || !HAS_NEUTRAL) return status;
  return vs_settle(m, it, VS_RESTORES, vs_transmitted(m), 0, 0.0, 25);
}

/* The guard of a jump that lies between the two, or -1. */
VS_FUNCTION int vs_lost_side(const scene_series* it, const scene_series* next) {
  double low, high, on;
  int g;
  for (g = 0; g < SIGNS; ++g) {
    const Real *const c = it->row[sign_row[g]], *const end = next->row[sign_row[g]];
    const double side = vs_first_sign(c, it->order);
    if (!sign_jumps[g] || VS_RESTS(it, g) != 0.0 || side == 0.0 || vs_have_one_sign(end[0], side))
      continue;
    if (seriesLarger(fabs(c[0]), fabs(end[0])) > vs_least_distance()) return g;
  }
  for (g = 0; g < TABLES; ++g) {
    const double x = next->row[passage_row[g]][0];
    vs_find_points(it, g, it->row[passage_row[g]][0], &low, &high, &on);
    if (passage_jumps[g] && !(VS_RESTS(it, SIGNS + g) != 0.0) && !(on < INFINITY) &&
        !(x > low && x < high))
      return SIGNS + g;
  }
  return -1;
}

/* The event of the guard at->lost, which the state passes up to theta, where `next` is. */
VS_FUNCTION void vs_meet_lost(const scene_series* it, const scene_series* next, vs_event* at,
                              double theta) {
  const Real* const c = vs_guard(it, at->lost);
  double low, high, on;
  at->theta = theta;
  at->guard = at->lost;
  at->jumps = 1;
  at->point = 0.0;
  at->side = vs_first_sign(c, it->order);
  at->element = -1;
  if (at->lost < SIGNS) return;
  vs_find_points(it, at->lost - SIGNS, c[0], &low, &high, &on);
  at->point = vs_guard(next, at->lost)[0] <= low ? low : high;
  at->side = c[0] - at->point;
}

/* How far behind an event rounding does not reach, in units: the first instant at which the state
 * is looked at there. */
VS_FUNCTION double vs_shortly_behind(const scene_model* m, const vs_event* at) {
  const double least =
      4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time) / m->series[m->present].unit;
  return at->theta + seriesLarger(1e-14 * at->theta, least);
}

/* From `base`, finds two instants, or one, between which the state itself passes an event: the
 * guard's polynomial is off by what the step is, and by the rounding of its coefficients. at->theta
 * becomes the first one, before all that jumps, *theta, where the step is to end, the second. Laws
 * there are in `before` and `after`. Where nothing has happened up to the step's end, the guard is
 * -1. */
VS_FUNCTION void vs_bracket(scene_model* m, scene_series* it, const scene_state* base, vs_event* at,
                            double* theta, vs_law_values* before, vs_law_values* after) {
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, base->time) / vs_series(m)->unit;
  const double end = vs_end_without(m, at, *theta);
  double ahead = vs_shortly_behind(m, at) - at->theta;
  double back = ahead;
  double low = 0.0;
  int trial;
  for (trial = 0; trial < 60; ++trial, back *= 2.0) {
    low = seriesLarger(0.0, at->theta - back);
    vs_look_from(m, it, base, at, low, before);
    if (low == 0.0) break;
    if (vs_have_one_sign(vs_distance(it, at), at->side) && vs_lost_side(vs_series(m), it) < 0)
      break;
  }
  for (trial = 0; trial < 40; ++trial, ahead *= 2.0) {
    *theta = seriesSmaller(at->theta + ahead, end);
    vs_look_from(m, it, base, at, *theta, after);
    if (vs_is_beyond(it, at)) break;
    if (*theta == end) {
      at->lands = at->jumps && vs_distance(it, at) == 0.0;
      if (at->lands) break;
      at->guard = -1;
      return;
    }
  }
  while (*theta - low > seriesLarger(2e-14 * at->theta, least)) {
    const double middle = 0.5 * (low + *theta);
    vs_law_values found;
    vs_look_from(m, it, base, at, middle, &found);
    if (vs_is_beyond(it, at)) {
      *theta = middle;
    } else if (vs_have_one_sign(vs_distance(it, at), at->side) &&
               vs_lost_side(vs_series(m), it) < 0) {
      low = middle;
      *before = found;
    } else {
      break; /* on the event itself, or between it and another one */
    }
  }
  at->theta = low;
}

/* Over an event, to the state shortly behind it, where its projection is behind, too. *theta: where
 * the step is to end, and has ended. Where the motion has only touched the event, by rounding, and
 * moves away from it again, the guard is -1. */
VS_FUNCTION scene_status vs_cross(scene_model* m, scene_series* it, vs_event* at, double* theta) {
  const scene_state base = m->now;
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, base.time) / vs_series(m)->unit;
  const double whole = *theta;
  const double end = seriesLarger(whole, at->theta + 64.0 * least); /* of what the series show */
  vs_law_values before, after;
  double distance = INFINITY;
  int trial, leaves = 0;
  vs_bracket(m, it, &base, at, theta, &before, &after);
  m->now = base;
  for (trial = 0; at->guard >= 0 && trial < 40; ++trial) {
    const double last = distance;
    scene_status status;
    vs_look_from(m, it, &base, at, *theta, &after);
    status = vs_settle_beyond(m, it, at, &before, &after);
    if (status != SCENE_OK) return status;
    vs_enter_state(m, it);
    if (vs_is_beyond(it, at)) break;
    distance = fabs(vs_distance(it, at));
    leaves = vs_have_one_sign(vs_distance(it, at), at->side) && distance > last ? leaves + 1 : 0;
    if (leaves == 4 || *theta > end) {
      m->now = base;
      *theta = vs_end_without(m, at, whole);
      at->guard = -1;
    } else {
      *theta = at->theta + 2.0 * (*theta - at->theta) + least;
    }
  }
  return trial < 40 ? SCENE_OK : SCENE_CHATTERING;
}
