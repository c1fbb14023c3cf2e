/* A step: polynomials of the motion from the present on, the first event that they meet, and the
 * trial of the state there (trial.h). */

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
  /* (Series make a step that is no longer than theirs, and one behind a change of modes: what lets
     go begins with conditions that are 0, and their first coefficients decide their sides.) */
  const int is_chosen = CHOOSES_METHOD && m->choice.method == VS_IMPLICIT &&
                        limit > m->choice.by_series && !(HOLDS && m->choice.is_behind);
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
    if (at->lost < 0) return status;
    /* (A guard that the state passes with the mode comes first.) */
    vs_meet_lost(vs_series(m), &m->series[1 - m->present], at, *theta);
    is_crossed = 1;
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
  m->event = at->guard >= 0 ? at->theta : *theta;
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
  m->choice.is_behind = !is_smooth;
  if (SERIES_LEAD && (at->guard >= 0 || !is_smooth)) m->choice.ahead = 0.0;
  m->reached = theta;
  m->passed = at->guard;
  ++m->steps;
  if (h > 1e-9 * seriesLarger(1.0, m->now.time)) m->series[0].slack = m->series[1].slack = 0.0;
  return TRANSMITS && !is_smooth ? vs_decide(m, 0) : SCENE_OK;
}

/* Counts events between which no time passes. */
VS_FUNCTION void vs_count_crossing(scene_model* m, double h, int is_met) {
  if (h > 1e-9 * seriesLarger(1.0, m->now.time))
    m->crossings = 0;
  else if (is_met)
    ++m->crossings;
}

/* Shortens a rejected step to `part`. 0 where it would be too short, or where its polynomials,
 * which are made anew unless they are series, do not exist. (What stood in the way may have been at
 * a stage, too.) */
VS_FUNCTION int vs_shorten(scene_model* m, double limit, double part, double* theta,
                           scene_status* polynomials) {
  const double h = *theta * seriesLarger(part, 0.2) * vs_series(m)->unit;
  *theta *= seriesLarger(part, 0.2);
  *polynomials = SCENE_OK;
  if (!(h > seriesSmaller(1e-14 * seriesLarger(1.0, m->now.time), 1e-3 * limit))) return 0;
  if (vs_series(m)->method == VS_BY_SERIES) return 1;
  *polynomials = vs_find_polynomials(m, h);
  *theta = seriesSmaller(h, m->usual) / vs_series(m)->unit;
  return *polynomials == SCENE_OK;
}

/* One step of at most `left` s; *made: how long it was. */
VS_FUNCTION scene_status vs_make_step(scene_model* m, double left, double* made) {
  enum { VS_MOST_TRIALS = 60, VS_MOST_CROSSINGS = 20 };
  const double limit = vs_limit(m, left);
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
  const double most_rounding = 50.0; /* tolerances of accelerations that follow from the state */
  const int was_rounded = m->rounding > 1.0;
  const scene_state before = m->now;
  scene_status status = vs_find_polynomials(m, limit), why = SCENE_OK, polynomials;
  double theta;
  int trial;
  if (status != SCENE_OK) return status;
  if (m->usual < least && m->usual < 1e-3 * limit) return SCENE_TOO_MANY_STEPS;
  theta = seriesSmaller(limit, m->usual) / vs_series(m)->unit;
  vs_forget_rounding(m);
  for (trial = 0; trial < VS_MOST_TRIALS; ++trial) {
    double defect = 0.0, h, part = 0.5;
    int is_met, is_smooth;
    vs_event at;
    if (HAS_SERIES) vs_note_resting(m, theta);
    at = vs_find_first(m, limit, &theta, &status);
    if (status != SCENE_OK) return status;
    status = vs_pass(m, &at, &theta, &defect, &why, &is_smooth);
    h = theta * vs_series(m)->unit;
    is_met = at.guard >= 0 || at.element >= 0;
    vs_count_crossing(m, h, is_met);
    if (status == SCENE_OK && m->crossings > VS_MOST_CROSSINGS) {
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
    if (isfinite(defect) && status == SCENE_OK)
      part = 0.9 * pow(defect, -1.0 / (vs_series(m)->order + 1));
    if (!vs_shorten(m, limit, part, &theta, &polynomials)) {
      if (polynomials != SCENE_OK) return polynomials;
      break;
    }
  }
  if (why != SCENE_OK) return why;
  return status == SCENE_OK ? SCENE_TOO_MANY_STEPS : status;
}
