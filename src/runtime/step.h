/* A step: the series of the present, how far it holds, and the state there, from which the next
 * series begins. */

#ifndef VS_INTERPRETED
/* (An interpreter has schemes of its own beside.) */
VS_FUNCTION scene_status vs_expand_by_stages(scene_model* m, double limit) {
  return vs_expand_implicitly(m, limit);
}
#endif

/* The longest that the inputs let a step be, s. */
VS_FUNCTION double vs_limit(scene_model* m, double left) {
  double limit = seriesSmaller(left, vs_longest(m));
  int i;
  vs_end_inputs(m);
  for (i = 0; i < INPUTS; ++i) {
    const scene_signal* const s = &m->now.input[i];
    limit = seriesSmaller(limit, s->end - s->age);
    if (m->now.silence[i] >= 0.0 && timeout_of[i] > 0.0) {
      limit = seriesSmaller(limit, timeout_of[i] - m->now.silence[i]);
    }
  }
  for (i = 0; i < DELAYS; ++i) limit = seriesSmaller(limit, delay_of[i]);
  return seriesLarger(limit, 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time));
}

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
  vs_settle_implicitly(m, &m->series[1 - m->present], theta);
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
VS_FUNCTION scene_status vs_land(scene_model* m, const vs_event* at, double* theta, double* defect,
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

/* True unless a guard may do up to theta what its polynomial through stages does not show: of a
 * function that is not seen into only values between the stages tell. */
VS_FUNCTION_RARE int vs_are_guards_shown(scene_model* m, const vs_event* at, double theta) {
  enum { VS_POINTS = 7 };
  const scene_series* const it = vs_series(m);
  scene_series* const w = &m->series[1 - m->present];
  const scene_state base = m->now;
  vs_law_values unused;
  int g, n, are_shown = 1;
  for (n = 0; n < VS_POINTS && are_shown && SIGNS + TABLES > 0; ++n) {
    const double part = theta * (n + 0.5) / VS_POINTS;
    vs_look_from(m, w, &base, at, part, &unused);
    for (g = 0; g < SIGNS + TABLES; ++g) {
      const Real* const c = vs_guard(it, g);
      const double x = vs_guard(w, g)[0], off = fabs(x - vs_evaluate(c, it->order, part));
      double low, high;
      vs_find_range(it, g, c[0] == 0.0 && g < SIGNS ? vs_first_sign(c, it->order) : (double)c[0],
                    &low, &high);
      if (off <= 1e-3 * vs_tolerance(it, x)) continue;
      are_shown = are_shown && seriesSmaller(x - low, high - x) > 2.0 * off;
    }
  }
  m->now = base;
  return are_shown;
}

/* Series in place of the stages of a stepper by name. The unit of the next ones is the length of
 * these. */
VS_FUNCTION scene_status vs_expand_instead(scene_model* m, double limit) {
  scene_status status;
  m->is_begun = 0;
  m->choice.ahead = 0.0;
  if (m->choice.by_series > 0.0) m->usual = m->choice.by_series;
  status = vs_expand(m, limit);
  if (status == SCENE_OK) m->choice.by_series = m->usual;
  return status;
}

/* Polynomials of a step by stages, or, where there is none, series. */
VS_FUNCTION scene_status vs_expand_either(scene_model* m, double limit) {
  const scene_status status = vs_expand_by_stages(m, limit);
  if (status == SCENE_OK || !HAS_SERIES) return status;
  if (!CHOOSES_METHOD) return vs_expand_instead(m, limit);
  vs_give_up_implicit(m);
  return vs_expand(m, limit);
}

/* Polynomials of a step of at most `limit` s, by the method that was chosen. */
VS_FUNCTION scene_status vs_find_polynomials(scene_model* m, double limit) {
  /* (Series make a step that is no longer than theirs.) */
  const int is_chosen =
      CHOOSES_METHOD && m->choice.method == VS_IMPLICIT && limit > m->choice.by_series;
  scene_status status;
  if (SERIES_LEAD && m->choice.ahead == 0.0 && m->fixed == 0.0) {
    /* A first step by series tells how long those of a stepper by name may be. */
    status = vs_expand_instead(m, limit);
    if (status == SCENE_OK) m->choice.ahead = seriesSmaller(limit, m->usual);
  } else {
    status = BY_STAGES || is_chosen ? vs_expand_either(m, limit) : vs_expand(m, limit);
  }
  if (!HAS_SERIES || !(CHOOSES_METHOD || BY_STAGES) || status != SCENE_NOT_FINITE) return status;
  if (CHOOSES_METHOD) vs_go_around(m);
  status = vs_expand_by_stages(m, limit);
  return status == SCENE_TOO_MANY_STEPS ? SCENE_NOT_FINITE : status;
}

/* Moves polynomials through stages, where formulas have series, off the first event: series lead
 * over that, and steps by stages end before. 0 where there are no series here. */
VS_FUNCTION int vs_leave_to_series(scene_model* m, double limit, double* theta) {
  enum { VS_MOST_ROUNDS = 10 };
  const double further = 1.02, ahead = 0.999;
  const double soon = 1e-6 * seriesLarger(1.0, m->now.time); /* s */
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
  scene_status status;
  int round, halvings = 0;
  for (round = 0; round < VS_MOST_ROUNDS; ++round) {
    const double unit = vs_series(m)->unit, whole = further * *theta;
    double end = whole, h;
    const vs_event at = vs_find_event(m, vs_series(m), &end, -1, 1);
    const int is_met = at.guard >= 0 || at.element >= 0;
    const double reach = is_met ? seriesSmaller(at.theta, *theta) : *theta;
    const int is_shown = reach * unit <= 2.0 * least ||
                         ((is_met || end == whole) && vs_are_guards_shown(m, &at, reach));
    const int is_close =
        m->fixed > 0.0 || vs_series(m)->method == VS_EXPLICIT || at.theta * unit <= soon;
    if (is_shown && (!is_met || ahead * at.theta > *theta)) return 1;
    if (is_shown ? is_close : halvings++ >= 2) break;
    h = (is_shown ? ahead : 0.5) * reach * unit;
    if (!is_shown) ++m->rejections;
    m->choice.ahead = h;
    if (vs_expand_by_stages(m, h) != SCENE_OK) break;
    *theta = seriesSmaller(h, m->usual) / vs_series(m)->unit;
  }
  status = vs_expand_instead(m, limit);
  *theta = seriesSmaller(limit, m->usual) / vs_series(m)->unit;
  return status == SCENE_OK;
}

/* The first event up to *theta. The formulas behind it are others: the polynomials of an implicit
 * step, some stages of which were behind it, are made anew up to it, and tell of elements only when
 * no guard passes before. They are known a little further. */
VS_FUNCTION vs_event vs_find_first(scene_model* m, double limit, double* theta,
                                   scene_status* status) {
  enum { VS_MOST_ROUNDS = 10 };
  const double further = 1.02, ahead = 0.999;
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time); /* s */
  int has_elements = !HOLDS, round = 0, halvings = 0;
  vs_event at = {0.0, -1, 0, 0.0, 0.0, -1, 0, 0, -1};
  *status = SCENE_OK;
  if (SERIES_LEAD && vs_series(m)->method != VS_BY_SERIES) {
    const double length = *theta * vs_series(m)->unit;
    if (vs_leave_to_series(m, limit, theta)) {
      if (vs_series(m)->method != VS_BY_SERIES) return at;
    } else {
      *status = vs_expand_by_stages(m, length);
      if (*status != SCENE_OK) return at;
      *theta = m->usual / vs_series(m)->unit;
    }
  }
  if (vs_series(m)->method == VS_BY_SERIES) return vs_find_event(m, vs_series(m), theta, -1, 1);
  for (;;) {
    double end = further * *theta, h, reach;
    int is_met, is_inside;
    at = vs_find_event(m, vs_series(m), &end, -1, has_elements);
    is_met = at.guard >= 0 || at.element >= 0;
    h = at.theta * vs_series(m)->unit * (at.guard >= 0 ? ahead : 1.0);
    is_inside =
        is_met && h >= least && (at.guard >= 0 ? at.theta <= *theta : at.theta < *theta / further);
    reach = is_met && h > 2.0 * least ? seriesSmaller(at.theta, *theta) : *theta;
    if (!HAS_SERIES && reach * vs_series(m)->unit > 2.0 * least && halvings < 40 &&
        !vs_are_guards_shown(m, &at, reach)) {
      h = m->choice.ahead = 0.5 * reach * vs_series(m)->unit;
      ++m->rejections;
      ++halvings;
      is_inside = 1;
      round = 0;
    }
    if (is_inside && round++ < VS_MOST_ROUNDS) {
      *status = vs_expand_either(m, h);
      if (*status != SCENE_OK) return at;
      *theta = seriesSmaller(h, m->usual) / vs_series(m)->unit;
      if (vs_series(m)->method == VS_BY_SERIES) return vs_find_event(m, vs_series(m), theta, -1, 1);
    } else if (!has_elements) {
      has_elements = 1;
    } else {
      /* (No further than inputs go on.) */
      if (is_met)
        *theta =
            seriesLarger(*theta, seriesSmaller(end, vs_limit(m, INFINITY) / vs_series(m)->unit));
      return at;
    }
  }
}

/* Moves to theta or over the event there. *is_smooth: 0 where another series begins behind it. */
VS_FUNCTION scene_status vs_pass(scene_model* m, vs_event* at, double* theta, double* defect,
                                 scene_status* why, int* is_smooth) {
  /* An event at which nothing jumps is passed like any other step's end. */
  int is_crossed = at->guard >= 0 && (at->jumps || HAS_ORDER_1 || (IS_CLASSICAL && IS_CURVED));
  scene_status status = SCENE_OK;
  int round;
  *is_smooth = !is_crossed;
  if (HOLDS && at->element >= 0) {
    if (at->theta > 0.0) status = vs_land(m, at, theta, defect, why);
    if (at->theta == 0.0) *theta = 0.0;
    *is_smooth = 0;
    m->event = *theta;
    return status;
  }
  for (round = 0; round < 2; ++round) {
    if (is_crossed) {
      double crossed = *theta;
      *defect = 0.0;
      status = vs_cross(m, &m->series[1 - m->present], at, &crossed);
      *is_smooth = at->guard < 0;
      /* (Where it turns out not to be there, others may follow soon.) */
      *theta = *is_smooth ? seriesSmaller(*theta, crossed) : crossed;
    }
    if (*is_smooth) status = vs_try(m, at, theta, defect, why);
    if (!*is_smooth || status != SCENE_OK || at->lost < 0) break;
    vs_meet_lost(vs_series(m), &m->series[1 - m->present], at, *theta);
    is_crossed = 1;
  }
  m->event = at->theta;
  return status;
}

/* 1 when nothing that something reads leaves the tolerance around its value in a step to theta, 2
 * when it does not change at all. (Angles that nothing reads turn on.) */
VS_FUNCTION int vs_is_still(const scene_series* it, double theta) {
  double most = 0.0;
  int c, n;
  for (c = FIRST_JUDGED; c < 2 * S + STATES; ++c) {
    const Real* const x = it->row[c < 2 * S ? ANGLE + c : STATE + c - 2 * S];
    double power = theta, sum = 0.0;
    if (c >= 2 * S && !state_is_wanted[c - 2 * S]) continue;
    for (n = 1; n <= it->order; ++n, power *= theta) sum += fabs(x[n]) * power;
    if (!(sum <= vs_tolerance(it, x[0]))) return 0;
    most = seriesLarger(most, sum);
  }
  return most > 0.0 ? 1 : 2;
}

/* The step to theta, of h s, has been made. */
VS_FUNCTION scene_status vs_accept(scene_model* m, const vs_event* at, double theta, double h,
                                   int is_smooth) {
  const int is_long = h >= seriesSmaller(1.0, 0.99 * MAXIMUM_STEP);
  const int is_asked = RESTS && is_smooth && (is_long || m->at_rest > 0.0);
  const int rest = is_asked ? vs_is_still(vs_series(m), theta) : 0;
  vs_choose_method(m, vs_series(m), h);
  if (rest == 0)
    m->at_rest = 0.0;
  else if (is_long) /* (Rounding drives a longer one.) */
    m->at_rest =
        seriesLarger(m->at_rest, rest > 1 ? 1e6 : seriesSmaller(2.0 * h, 100.0 * MAXIMUM_STEP));
  if (is_smooth) {
    m->present = 1 - m->present;
    m->begun = m->now;
  }
  m->is_begun = is_smooth;
  if (SERIES_LEAD && (at->guard >= 0 || !is_smooth)) m->choice.ahead = 0.0;
  m->reached = theta;
  m->passed = at->guard;
  ++m->steps;
  if (h > 1e-9 * seriesLarger(1.0, m->now.time)) m->series[0].slack = m->series[1].slack = 0.0;
  return TRANSMITS && !is_smooth ? vs_decide(m, 0) : SCENE_OK;
}

/* One step of at most `left` s; *made: how long it was. */
VS_FUNCTION scene_status vs_make_step(scene_model* m, double left, double* made) {
  const double limit = vs_limit(m, left);
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
  const double most_rounding = 50.0; /* tolerances of accelerations that follow from the state */
  const int was_rounded = m->rounding > 1.0;
  const scene_state before = m->now;
  scene_status status = vs_find_polynomials(m, limit);
  double theta;
  scene_status why = SCENE_OK;
  int trial;
  if (status != SCENE_OK) return status;
  if (m->usual < least && m->usual < 1e-3 * limit) return SCENE_TOO_MANY_STEPS;
  theta = seriesSmaller(limit, m->usual) / vs_series(m)->unit;
  vs_forget_rounding(m);
  for (trial = 0; trial < 60; ++trial) {
    double defect = 0.0, h, part;
    int is_met, is_smooth;
    vs_event at = vs_find_first(m, limit, &theta, &status);
    if (status != SCENE_OK) return status;
    status = vs_pass(m, &at, &theta, &defect, &why, &is_smooth);
    h = theta * vs_series(m)->unit;
    is_met = at.guard >= 0 || at.element >= 0;
    if (h > 1e-9 * seriesLarger(1.0, m->now.time))
      m->crossings = 0;
    else if (is_met)
      ++m->crossings;
    if (status == SCENE_OK && m->crossings > 20) {
      if (at.guard >= 0) m->passed = at.guard;
      return SCENE_CHATTERING;
    }
    if (status == SCENE_OK && defect <= 1.0) {
      *made = h;
      status = vs_accept(m, &at, theta, h, is_smooth);
      if (status != SCENE_NO_MODES) return status;
    }
    if (status == SCENE_STEP_TOO_LARGE) return status;
    if (status == SCENE_NO_MOTION || status == SCENE_NO_MODES) {
      /* Nothing goes on behind the event: this step ends shortly before it, and the next one stops
         there. */
      m->now = before;
      if (!is_met || !(at.theta * vs_series(m)->unit > 1e-9 * seriesLarger(1.0, m->now.time)))
        return status;
      theta = at.theta * (1.0 - 4e-12) - 64.0 * least / vs_series(m)->unit;
      continue;
    }
    ++m->rejections;
    if ((trial % 4 == 2 || was_rounded || h < 1e-11 * seriesLarger(1.0, before.time)) &&
        status == SCENE_OK && isfinite(defect) && vs_note_rounding(m)) {
      m->now = before;
      if (IS_CLASSICAL && m->rounding > most_rounding) return SCENE_TOO_MANY_STEPS;
      continue;
    }
    m->now = before;
    part = isfinite(defect) && status == SCENE_OK
               ? 0.9 * pow(defect, -1.0 / (vs_series(m)->order + 1))
               : 0.5;
    theta *= part > 0.2 ? part : 0.2;
    h = theta * vs_series(m)->unit;
    if (!(h > seriesSmaller(1e-14 * seriesLarger(1.0, m->now.time), 1e-3 * limit))) break;
    /* (What stood in the way may have been at a stage, too.) */
    if (vs_series(m)->method != VS_BY_SERIES) {
      status = vs_find_polynomials(m, h);
      if (status != SCENE_OK) return status;
      theta = seriesSmaller(h, m->usual) / vs_series(m)->unit;
    }
  }
  if (why != SCENE_OK) return why;
  return status == SCENE_OK ? SCENE_TOO_MANY_STEPS : status;
}
