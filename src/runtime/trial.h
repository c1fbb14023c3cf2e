/* The trial of a step: the state at its end, from which the next series begins, and its error. */

/* The series of the state that was reached: all formulas, the orders that need no other, and inputs
 * up to `order`. */
VS_FUNCTION scene_status vs_arrive(scene_model* m, scene_series* next, double unit, int order) {
  scene_status status;
  vs_forget_polynomials(next);
  next->unit = unit;
  vs_enter_inputs(m, next, order);
  status = vs_project_velocities(m, next);
  if (status != SCENE_OK) return status;
  if (IS_CLASSICAL)
    status = vs_settle(m, next, VS_LEAST_REACTION, m->now.multiplier, 0, 0.0, 50);
  else
    status = vs_settle(m, next, HAS_NEUTRAL ? VS_RESTORES : VS_ONTO_CONSTRAINTS, vs_transmitted(m),
                       0, 0.0, 25);
  if (status != SCENE_OK) return status;
  if (!vs_begin(next, m->now.multiplier, 1)) return SCENE_SINGULAR;
  return vs_is_finite(next) ? SCENE_OK : SCENE_NOT_FINITE;
}

/* True where a guard is off a point, at theta, by no more than rounding of what it is made of. */
VS_FUNCTION_RARE int vs_is_rounding(scene_model* m, int guard, double point, double theta) {
  scene_series* const next = &m->series[1 - m->present];
  const double ulps = 8.0 * DBL_EPSILON;
  const scene_state base = m->now;
  int i, is_known = 1;
  double value, moved;
  if (theta > 0.0) {
    vs_go(m, theta);
    vs_settle_implicitly(m, next, theta);
    is_known = vs_arrive(m, next, vs_series(m)->unit, 0) == SCENE_OK;
  } else {
    vs_enter_inputs(m, next, 0);
    vs_enter_state(m, next);
  }
  m->now = base;
  value = vs_guard(next, guard)[0];
  for (i = ANGLE; i < STATE + STATES; ++i) {
    /* (Modes are no quantities. Of several sizes, lest changes of a difference cancel.) */
    if (HOLDS && i >= side_row[0] && i < STATE) continue;
    next->row[i][0] *= 1.0 + (i % 2 ? ulps : -ulps) * (1.0 + 0.3 * (i % 3));
  }
  vs_enter_formulas(next);
  moved = fabs(vs_guard(next, guard)[0] - value);
  return is_known && fabs(value - point) <= 4.0 * (moved + DBL_EPSILON * fabs(point));
}

/* Finds the guards that stay on a jump up to theta by all but rounding: speeds that a lock couples,
 * the reaction on a shaft without a constraint. They are no events: the formulas go on as at their
 * first value. (Stages leave a part of the tolerance of what is to be 0; in a short step what moves
 * with time seems to rest.) */
VS_FUNCTION void vs_note_resting(scene_model* m, double theta) {
  scene_series* const it = vs_series(m);
  const double part = it->method == VS_BY_SERIES ? 1e-3 : 1.0;
  const int is_short = theta * it->unit < 1e-9 * seriesLarger(1.0, m->now.time);
  double points[3];
  int g, k, n, rests;
  for (g = 0; g < SIGNS + TABLES; ++g) {
    const Real* const c = vs_guard(it, g);
    VS_RESTS(it, g) = 0.0;
    if (is_short || !(g < SIGNS ? sign_jumps[g] : passage_jumps[g - SIGNS])) continue;
    points[0] = points[1] = points[2] = 0.0;
    if (g >= SIGNS) vs_find_points(it, g - SIGNS, c[0], &points[0], &points[1], &points[2]);
    for (k = 0, rests = 0; k < 3 && !rests; ++k) {
      rests = isfinite(points[k]) && vs_rests(it, c, theta, points[k], part);
      for (n = 0; n < 3 && rests; ++n) rests = vs_is_rounding(m, g, points[k], 0.5 * n * theta);
    }
    VS_RESTS(it, g) = rests;
  }
}

/* The error of a step of h s that the last terms do not show, in tolerances: x' at its end beside
 * that of the series, and the accelerations that were found there beside theirs. A kink that the
 * step ends on bends the accelerations, since when they have moved on for `behind` s at most. */
VS_FUNCTION double vs_defect(const scene_model* m, const scene_series* it, const scene_series* next,
                             const scene_state* expected, double theta, int is_kink,
                             double behind) {
  const double h = theta * it->unit;
  double defect = 0.0;
  int i, n;
  for (i = 0; i < S; ++i) {
    const Real* const x = it->row[ACCELERATION + i];
    double slope = 0.0; /* of the series at its end, times the unit */
    const double size = seriesLarger(fabs(x[0]), fabs(m->now.acceleration[i]));
    double moved = fabs(m->now.acceleration[i] - expected->acceleration[i]);
    const double compared =
        IS_CLASSICAL ? seriesLarger(fabs(it->row[VELOCITY + i][0]), fabs(m->now.velocity[i]))
                     : size;
    double missed = moved;
    for (n = it->order; n > 0 && !IS_CLASSICAL; --n) slope = slope * theta + n * x[n];
    if (!IS_CLASSICAL) {
      missed = fabs(next->row[ACCELERATION + i][1] / next->unit - slope / it->unit);
      if (is_kink) moved = seriesLarger(0.0, moved - missed * behind);
    } else if (is_kink && behind > 0.0) {
      moved = 0.0; /* (Those of gauss follow from the state, and nothing from them.) */
    }
    missed *= h / ((it->order + 1) * (vs_tolerance(it, compared) + m->noise[i]));
    moved /= vs_tolerance(it, size) + m->noise[i];
    defect = seriesLarger(defect, (IS_CLASSICAL ? 0.1 : 1.0) * moved);
    if (!is_kink || IS_CLASSICAL) defect = seriesLarger(defect, missed);
    if (!isfinite(missed)) return INFINITY;
  }
  for (i = 0; i < STATES && !is_kink; ++i) {
    const Real* const z = it->row[STATE + i];
    double slope = 0.0, missed;
    for (n = it->order + 1; n > 0; --n) slope = slope * theta + n * z[n];
    missed = fabs(next->row[rate_row[i]][0] - slope / it->unit) * h / (it->order + 1);
    defect = seriesLarger(defect, missed / vs_tolerance(it, next->row[STATE + i][0]));
    if (!isfinite(missed)) return INFINITY;
  }
  return defect;
}

/* No row of C has vanished, nor turned by more than a right angle in J^-1: then it vanished on the
 * way. */
VS_FUNCTION int vs_keeps_rank(scene_model* m, const scene_series* it, const scene_series* next) {
  int e, p;
  for (p = 0; p < K; ++p) {
    const double before = vs_row_length(it, p);
    double product = 0.0, length = 0.0;
    if (!vs_is_on(next, p)) continue;
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      const int i = entry_shaft[e];
      const double entry = vs_entry(next, p, i) / vs_inertia(next, i, i);
      product += vs_entry(it, p, i) * entry;
      length += vs_entry(next, p, i) * entry;
    }
    m->longest[p] = seriesLarger(m->longest[p], before);
    if (!(product > 0.0 && length > 1e-20 * m->longest[p])) return 0;
    /* (Stages of an implicit step may have been behind.) */
    if (it->method != VS_BY_SERIES && !(length > 0.04 * before && length < 25.0 * before)) return 0;
  }
  return 1;
}

/* Newton's iteration for the least reaction went to another branch than the series: theirs has
 * ended. (No step is too short for that, and the velocities do not show it.) A part of what the
 * accelerations change in a step is the series' own error. */
VS_FUNCTION int vs_has_leapt(const scene_model* m, const scene_state* before,
                             const scene_state* expected) {
  int i;
  for (i = 0; i < S && IS_CLASSICAL && IS_CURVED; ++i) {
    const double moved = fabs(m->now.acceleration[i] - expected->acceleration[i]);
    const double size = seriesLarger(1.0, fabs(expected->acceleration[i]));
    const double change = fabs(expected->acceleration[i] - before->acceleration[i]);
    if (!(moved <= seriesSmaller(1e-3 * size, 0.1 * change) + 1e-9 * size)) return 1;
  }
  return 0;
}

/* Moves to theta, onto the constraints; *expected: the state before that. */
VS_FUNCTION scene_status vs_move_to(scene_model* m, const scene_state* before, const vs_event* at,
                                    double theta, scene_state* expected) {
  const double h = theta * vs_series(m)->unit;
  m->now = *before;
  vs_go(m, VS_INSTANT(m, at, theta));
  if (!vs_settle_implicitly(m, &m->series[1 - m->present], theta)) return SCENE_NOT_CONVERGED;
  *expected = m->now;
  return vs_arrive(m, &m->series[1 - m->present], vs_unit_of(seriesLarger(h, 0.25 * m->usual)),
                   SCENE_ORDER);
}

/* Moves to the first instant behind an event at which the state has passed it: mostly the root of
 * the guard's series, within its rounding. *theta: the step's end, which it becomes. */
VS_FUNCTION scene_status vs_move_behind(scene_model* m, const scene_state* before, vs_event* at,
                                        double* theta, scene_state* expected) {
  scene_series* const next = &m->series[1 - m->present];
  const double passed = vs_shortly_behind(m, at);
  vs_law_values unused;
  if (passed <= *theta && vs_move_to(m, before, at, passed, expected) == SCENE_OK &&
      vs_is_beyond(next, at)) {
    *theta = passed;
    return SCENE_OK;
  }
  m->now = *before;
  vs_bracket(m, next, before, at, theta, &unused, &unused);
  return vs_move_to(m, before, at, *theta, expected);
}

/* The accelerations at the end of a step, moved by `by` s and parts `part` of its state. */
VS_FUNCTION_RARE int vs_displace(scene_model* m, const scene_state* end, double by, double part,
                                 double* acceleration) {
  scene_series* const next = &m->series[1 - m->present];
  int i, is_found;
  m->now = *end;
  m->now.time += by;
  for (i = 0; i < S; ++i) { /* (Of several sizes, lest those of a difference cancel.) */
    const double change = (i % 2 ? part : -part) * (1.0 + 0.3 * (i % 3));
    m->now.angle[i] *= 1.0 + change;
    m->now.velocity[i] *= 1.0 + change;
  }
  is_found = vs_arrive(m, next, next->unit, 0) == SCENE_OK;
  for (i = 0; i < S; ++i)
    acceleration[i] = is_found ? (double)m->now.acceleration[i] : (double)end->acceleration[i];
  m->now = *end;
  return is_found;
}

/* Notes the accelerations that rounding makes at the end of a step, which no shorter one lessens:
 * that of the state, and that of times inside formulas, sin(t + 1e8), which departs from a line
 * over negligible times. True where they are a part of the tolerance, and more than they were. */
VS_FUNCTION_RARE int vs_note_rounding(scene_model* m) {
  const scene_state end = m->now;
  const double before = m->rounding, ulps = 4.0 * DBL_EPSILON;
  const double soon = 3e-9 + ulps * (double)end.time, ratio = 3.7;
  double moved[MOST_SHAFTS], early[MOST_SHAFTS], late[MOST_SHAFTS];
  int i;
  if (!vs_displace(m, &end, 0.0, ulps, moved) || !vs_displace(m, &end, soon, 0.0, early) ||
      !vs_displace(m, &end, ratio * soon, 0.0, late))
    return 0;
  for (i = 0; i < S; ++i) {
    const double here = (double)end.acceleration[i];
    const double size = seriesLarger(fabs(moved[i] - here),
                                     fabs((early[i] - here) - (late[i] - here) * (1.0 / ratio)));
    m->noise[i] = seriesLarger(m->noise[i], 2.0 * size);
    m->rounding = seriesLarger(m->rounding, size / vs_tolerance(vs_series(m), here));
  }
  return m->rounding > seriesLarger(0.05, before);
}

VS_FUNCTION_INLINE void vs_forget_rounding(scene_model* m) {
  int i;
  if (m->rounding == 0.0) return;
  m->rounding = 0.0;
  for (i = 0; i < S; ++i) m->noise[i] = 0.0;
}

/* Moves to theta or behind an event. *defect: see vs_defect; *why: what makes it infinite. */
VS_FUNCTION scene_status vs_try(scene_model* m, vs_event* at, double* theta, double* defect,
                                scene_status* why) {
  const scene_series* const it = vs_series(m);
  scene_series* const next = &m->series[1 - m->present];
  const scene_state before = m->now;
  scene_state expected;
  /* (The instant of a kink is known up to its rounding.) */
  const double rounding = 4.0 * DBL_EPSILON * seriesLarger(1.0, before.time);
  const scene_status status = at->guard >= 0 ? vs_move_behind(m, &before, at, theta, &expected)
                                             : vs_move_to(m, &before, at, *theta, &expected);
  double behind;
  int i, is_kink;
  if (status != SCENE_OK) return status;
  behind = seriesLarger(0.0, *theta - at->theta) * it->unit + rounding;
  is_kink = at->guard >= 0;
  for (i = 0; i < INPUTS; ++i) {
    const scene_signal* const s = &m->now.input[i];
    is_kink = is_kink || (s->form == VS_RAMP && s->age >= s->end);
  }
  *defect =
      it->method != VS_BY_SERIES ? 0.0 : vs_defect(m, it, next, &expected, *theta, is_kink, behind);
  if (m->fixed > 0.0 && isfinite(*defect)) {
    /* It is no bound, unless little of the state is left. */
    if (it->method == VS_BY_SERIES) m->error = *defect;
    if (m->error * RELATIVE_TOLERANCE > 0.1) return SCENE_STEP_TOO_LARGE;
    *defect = 0.0;
  }
  *why = !vs_keeps_rank(m, it, next)           ? SCENE_SINGULAR
         : vs_has_leapt(m, &before, &expected) ? SCENE_NOT_CONVERGED
                                               : SCENE_OK;
  if (*why != SCENE_OK) *defect = INFINITY;
  at->lost = isfinite(*defect) ? vs_lost_side(it, next) : -1;
  if (at->lost < 0) return SCENE_OK;
  /* (Accelerations that follow from the state show the jump, too.) */
  if (*defect > 1.0 && *theta * it->unit > m->usual / 64.0) at->lost = -1;
  *defect = INFINITY;
  m->now = before;
  return SCENE_OK;
}

/* Moves to the end of an element's mode, where its condition is 0 by the state itself: the series
 * is off by what the step is. */
VS_FUNCTION scene_status vs_land(scene_model* m, vs_event* at, double* theta, double* defect,
                                 scene_status* why) {
  const scene_series* const it = vs_series(m);
  const scene_state before = m->now;
  const double end = *theta * (1.0 + 2e-12);
  vs_event none = *at;
  Real c[VS_STRIDE];
  int round, n;
  none.guard = -1;
  *theta = at->theta;
  for (round = 0; round < 5; ++round) {
    const scene_status status = vs_try(m, &none, theta, defect, why);
    double slope = 0.0, by, value;
    at->lost = none.lost;
    if (status != SCENE_OK || *defect > 1.0) return status;
    if (!vs_condition(m, &m->series[1 - m->present], at->element, at->condition, c)) break;
    value = c[0];
    if (value == 0.0 || round == 4) break;
    (void)vs_condition(m, it, at->element, at->condition, c);
    for (n = it->order; n > 0; --n) slope = slope * *theta + n * c[n];
    by = -value / slope;
    if (!(fabs(by) <= 0.01 * *theta) || !(*theta + by <= end)) break;
    *theta += by;
    m->now = before;
  }
  return SCENE_OK;
}
