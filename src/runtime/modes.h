/* The modes of elements that hold (conditions.h), which are decided together. */

/* The order of the series by which modes are decided. (Of opaque functions, in torques, order 1 is
 * the last that is true, and a slip follows from a torque by an order more.) */
VS_FUNCTION_RARE int vs_decides_by(void) {
  return !HAS_SERIES ? 2 : 5 < SCENE_ORDER ? 5 : SCENE_ORDER;
}

/* Takes the rows of stuck elements into the algebra but those that others of it imply: the motion
 * is the same without them. What has no limits comes first, what is nearly implied last. False
 * where the constraints themselves have lost rank. */
VS_FUNCTION_RARE int vs_choose_rows(scene_model* m, scene_series* it) {
  enum { VS_LIMITLESS, VS_LIMITED, VS_NEAR };
  const double near = 1e-4; /* the square of a distance, as a part of the row's length */
  double distance;
  int h, has_all, takes;
  for (h = 0; h < HOLDS; ++h) it->counts[h] = m->now.mode[h] == VS_STUCK;
  has_all = vs_factor(it, 1, 3) && it->distance > near;
  for (h = 0; h < HOLDS && !has_all; ++h) it->counts[h] = 0;
  if (!has_all && !vs_factor(it, 1, 3)) return 0;
  distance = it->distance;
  for (takes = VS_LIMITLESS; takes <= VS_NEAR && !has_all; ++takes) {
    for (h = 0; h < HOLDS; ++h) {
      const int is_limited = has_upper[h] || has_lower[h];
      if (it->counts[h] || m->now.mode[h] != VS_STUCK || takes < is_limited) continue;
      it->counts[h] = 1;
      it->counts[h] = vs_factor(it, 1, 3);
      if (takes < VS_NEAR && it->distance < seriesSmaller(near, 0.5 * distance)) it->counts[h] = 0;
      if (it->counts[h]) distance = it->distance;
    }
  }
  for (h = 0; h < HOLDS; ++h) {
    m->now.counts[h] = it->counts[h];
    if (!m->now.counts[h]) m->now.multiplier[CONSTRAINTS + h] = 0.0;
  }
  return 1;
}

/* True where the accelerations of a first state are those of least reaction, to which constraints
 * of order 3 of generalized_gauss have nothing to say. (Later these keep C epsilon.) */
VS_FUNCTION_RARE int vs_leaves_order_3(const scene_model* m) {
  int has_order_3 = 0, p;
  for (p = 0; p < CONSTRAINTS && !IS_GAUSS; ++p) has_order_3 = has_order_3 || order_of[p] == 3;
  return has_order_3 && m->is_first;
}

/* The motion in the present modes from the state `from`: its accelerations, what the constraints
 * transmit, and the first coefficients of all series. */
VS_FUNCTION_RARE scene_status vs_take_sides(scene_model* m, scene_series* it,
                                            const scene_state* from) {
  const int is_least = vs_leaves_order_3(m);
  const int what = is_least ? VS_LEAST_REACTION : VS_DECIDED;
  scene_status status;
  memcpy(m->now.velocity, from->velocity, sizeof from->velocity);
  memcpy(m->now.acceleration, from->acceleration, sizeof from->acceleration);
  memcpy(m->now.multiplier, from->multiplier, sizeof from->multiplier);
  vs_forget_polynomials(it);
  it->unit = vs_unit_of(m->usual > 0.0 ? seriesSmaller(m->usual, 1.0) : 1e-3);
  vs_enter_inputs(m, it, SCENE_ORDER);
  vs_enter_state(m, it);
  if (!vs_choose_rows(m, it)) return SCENE_SINGULAR;
  status = vs_project_velocities(m, it);
  if (status == SCENE_OK) status = vs_settle(m, it, what, m->now.multiplier, 0, 0.0, 25);
  if (status != SCENE_OK) return status;
  if (!vs_begin(it, m->now.multiplier, !is_least)) return SCENE_SINGULAR;
  /* A step's whole series may contradict modes that fewer orders decided at this instant. */
  while (it->order < (m->crossings == 0 || !HAS_SERIES ? vs_decides_by() : SCENE_ORDER))
    vs_extend(it);
  return SCENE_OK;
}

/* The same with the sides of elements that slide: one that has come to its limit at rest, where
 * others hold it, transmits the limit, and what it slides with once it moves. */
VS_FUNCTION_RARE scene_status vs_take_modes(scene_model* m, scene_series* it,
                                            const scene_state* from) {
  scene_status status;
  int h, moved;
  for (h = 0; h < HOLDS; ++h) {
    const int mode = m->now.mode[h];
    m->now.side[h] = mode == VS_FREE ? 0.0 : mode;
  }
  memcpy(m->now.velocity, from->velocity, sizeof from->velocity);
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (h = 0; h < HOLDS; ++h) {
    const Real limit = it->row[(m->now.side[h] > 0.0 ? upper_row : lower_row)[h]][0];
    const Real slides = it->row[slide_row[h]][0];
    const int has_limit = m->now.side[h] > 0.0 ? has_upper[h] : has_lower[h];
    const int is_at_rest = fabs(it->row[slip_row[h]][0]) <= vs_slip_noise(it, h, 0);
    if (m->now.side[h] != 0.0 && has_limit && is_at_rest && limit / slides > 1.0)
      m->now.side[h] *= limit / slides;
  }
  for (;;) {
    status = vs_take_sides(m, it, from);
    moved = HOLDS;
    for (h = 0; h < HOLDS && moved == HOLDS && status == SCENE_OK; ++h) {
      if (!vs_is_loss(it, h) && fabs(m->now.side[h]) > 1.0 && !vs_stays(it, h, it->order))
        moved = h;
    }
    if (moved == HOLDS) return status;
    m->now.side[moved] = m->now.mode[moved];
  }
}

/* The first element with a condition that does not hold, and which one, `kept` after all others;
 * HOLDS if there is none. */
VS_FUNCTION_RARE int vs_find_wrong(const scene_model* m, const scene_series* it, int kept, int* k) {
  Real c[VS_STRIDE];
  int n;
  for (n = 0; n <= HOLDS; ++n) {
    const int h = n < HOLDS ? n : kept;
    if (n == kept || h == HOLDS) continue;
    for (*k = 0; *k < VS_CONDITIONS; ++*k) {
      if (vs_condition(m, it, h, *k, c) && vs_first_sign(c, it->order) < 0.0) return h;
    }
  }
  return HOLDS;
}

VS_FUNCTION_RARE int vs_mode_by_slip(const scene_series* it, int h) {
  const double f = it->row[slip_row[h]][0];
  return fabs(f) <= vs_slip_noise(it, h, 0) ? VS_STUCK : f > 0.0 ? VS_FORWARD : VS_BACKWARD;
}

/* The mode that the state alone says; stuck where it says none. */
VS_FUNCTION_RARE int vs_guess_mode(const scene_model* m, const scene_series* it, int h) {
  const int by_slip = vs_mode_by_slip(it, h);
  if (has_gap[h]) {
    const Real gap = it->row[gap_row[h]][0];
    const int is_open = gap > vs_condition_noise(it, h, VS_OF_GAP, 0, &gap);
    return is_open || by_slip == VS_FORWARD ? VS_FREE : VS_STUCK;
  }
  if (closes_below[h] > 0.0) return m->meets[h] ? VS_STUCK : VS_FREE;
  if (has_level[h] && !(it->row[level_row[h]][0] > 0.0)) return VS_FREE;
  if (vs_is_loss(it, h) && by_slip != VS_STUCK)
    return vs_mode_of_line(by_slip, vs_line(it, h, by_slip, 0));
  return by_slip == VS_BACKWARD && !slides_backward[h] ? VS_STUCK : by_slip;
}

/* True where the scene asks for an element that slides from its rest. */
VS_FUNCTION_RARE int vs_begins_slipping(const scene_model* m, int h) {
  return !m->has_moved && begins_in[h] == VS_BEGINS_SLIPPING;
}

/* The mode that element h goes to where condition k of its present one does not hold. What would
 * be stuck while it moves meets in an impact first: its distance was 0 by rounding. */
VS_FUNCTION_RARE int vs_next_mode(scene_model* m, const scene_series* it, int h, int k) {
  const int mode = m->now.mode[h], is_dog = closes_below[h] > 0.0;
  if (mode == VS_FREE && m->moves[h]) m->meets[h] = 1;
  if (mode == VS_FREE) return has_gap[h] || is_dog ? VS_STUCK : vs_mode_by_slip(it, h);
  if (k == 0 || (mode == VS_STUCK && has_gap[h])) return VS_FREE;
  if (is_dog) return VS_STUCK;
  if (vs_is_loss(it, h) && mode != VS_STUCK && k == 2)
    return vs_mode_of_line(vs_side_of(mode), mode == vs_side_of(mode));
  if (vs_is_loss(it, h) && mode == VS_STUCK) {
    const int s = (k == 1) == (m->now.counts[h] != 0) ? 1 : -1;
    return vs_mode_of_line(s, vs_line(it, h, s, it->order));
  }
  if (mode == VS_FORWARD && slides_backward[h] && vs_begins_slipping(m, h)) return VS_BACKWARD;
  if (mode != VS_STUCK) return VS_STUCK;
  return (k == 1) == (m->now.counts[h] != 0) ? VS_FORWARD
         : slides_backward[h]                ? VS_BACKWARD
                                             : VS_STUCK;
}

/* All combinations of modes of the elements at rest, and of lines of losses, one after the other;
 * false behind the last one. `first`: those to begin with. */
VS_FUNCTION_RARE int vs_count_modes(scene_model* m, const int* is_open, const int* first) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    int* const mode = &m->now.mode[h];
    const int is_first_line = load_of[h] >= 0 && *mode == vs_side_of(*mode);
    if (!is_open[h]) continue;
    if (*mode == VS_STUCK) {
      *mode = has_gap[h] ? VS_FREE : VS_FORWARD;
      return 1;
    }
    if (is_first_line) {
      *mode *= VS_SECOND_LINE;
      return 1;
    }
    if (*mode > 0 && *mode != VS_FREE && slides_backward[h] && first[h] == VS_STUCK) {
      *mode = VS_BACKWARD;
      return 1;
    }
    *mode = first[h];
  }
  return 0;
}

VS_FUNCTION_RARE int vs_all_hold(scene_model* m, scene_series* it, const scene_state* from) {
  int k;
  return vs_take_modes(m, it, from) == SCENE_OK && vs_find_wrong(m, it, HOLDS, &k) == HOLDS;
}

/* True where an impact has to come first. */
VS_FUNCTION_RARE int vs_has_met(const scene_model* m) {
  int h;
  for (h = 0; h < HOLDS && !(m->meets[h] && m->moves[h]); ++h) continue;
  return h < HOLDS;
}

/* Exchanges modes whose conditions do not hold, but that of `kept`, until all do, which ends for
 * limits that do not depend on the mode (Murty's least index). False if they never do. */
VS_FUNCTION_RARE int vs_exchange_modes(scene_model* m, scene_series* it, const scene_state* from,
                                       int* first, int* is_open, int kept) {
  int h, k, round;
  for (round = 0; round < 5 * HOLDS + 5; ++round) {
    if (vs_take_modes(m, it, from) != SCENE_OK) return 0;
    h = vs_find_wrong(m, it, kept, &k);
    if (h == HOLDS || h == kept) return h == HOLDS;
    m->now.mode[h] = vs_next_mode(m, it, h, k);
    if (vs_has_met(m)) return 0;
    if (m->now.mode[h] == VS_FREE || first[h] == VS_FREE) {
      first[h] = m->now.mode[h];
      is_open[h] = has_gap[h] || first[h] == VS_STUCK;
    }
  }
  return 0;
}

VS_FUNCTION_RARE void vs_find_static(scene_series* it, int* is_static) {
  int h;
  for (h = 0; h < HOLDS; ++h) it->row[side_row[h]][0] = 1.0;
  vs_enter_formulas(it);
  for (h = 0; h < HOLDS; ++h)
    is_static[h] = has_upper[h] && it->row[upper_row[h]][0] > it->row[slide_row[h]][0];
}

/* Elements that would hold more at rest than they transmit while they slide may do either: those
 * that can stick do, though others, not of their kind, let go. Modes hold before and behind. */
VS_FUNCTION_RARE void vs_stick(scene_model* m, scene_series* it, const scene_state* from,
                               const int* first, const int* is_open) {
  int is_static[MOST_HOLDS + 1], begins[MOST_HOLDS + 1], may_change[MOST_HOLDS + 1];
  int h, i, trials = 0, successes = 0;
  for (h = 0; h < HOLDS; ++h) {
    const scene_state before = m->now;
    int sticks;
    if (first[h] != VS_STUCK || before.mode[h] == VS_STUCK || before.mode[h] == VS_FREE) continue;
    if (vs_begins_slipping(m, h)) continue;
    if (trials++ == 0) vs_find_static(it, is_static);
    memcpy(begins, first, sizeof begins);
    memcpy(may_change, is_open, sizeof may_change);
    m->now.mode[h] = VS_STUCK;
    sticks = is_static[h] ? vs_exchange_modes(m, it, from, begins, may_change, h)
                          : vs_all_hold(m, it, from);
    for (i = 0; i < HOLDS; ++i)
      if (is_static[i] && before.mode[i] == VS_STUCK && m->now.mode[i] != VS_STUCK) sticks = 0;
    if (sticks && ++successes <= HOLDS) {
      h = -1; /* another one may be able to now */
      continue;
    }
    memcpy(m->now.mode, before.mode, sizeof before.mode);
    (void)vs_take_modes(m, it, from);
  }
}

/* Looks for modes in which all conditions hold: by exchanges; else among all. */
VS_FUNCTION_RARE scene_status vs_search_modes(scene_model* m, scene_series* it,
                                              const scene_state* from) {
  int first[MOST_HOLDS + 1], is_open[MOST_HOLDS + 1];
  int h, open = 0;
  for (h = 0; h < HOLDS; ++h) {
    first[h] = m->now.mode[h] = vs_guess_mode(m, it, h);
    is_open[h] = (first[h] == VS_STUCK && !(closes_below[h] > 0.0)) || vs_is_loss(it, h);
    open += is_open[h];
    if (is_open[h] && !has_gap[h] && vs_begins_slipping(m, h)) m->now.mode[h] = VS_FORWARD;
  }
  if (vs_exchange_modes(m, it, from, first, is_open, HOLDS)) {
    vs_stick(m, it, from, first, is_open);
    return SCENE_OK;
  }
  for (h = 0; h < HOLDS; ++h) {
    m->now.mode[h] = is_open[h] ? VS_STUCK : first[h];
    if (vs_is_loss(it, h) && first[h] != VS_STUCK) m->now.mode[h] = vs_side_of(first[h]);
  }
  if (open > 10 || vs_has_met(m)) return SCENE_NO_MODES;
  for (h = 0; h < HOLDS; ++h) first[h] = m->now.mode[h];
  do {
    if (vs_all_hold(m, it, from)) return SCENE_OK;
  } while (vs_count_modes(m, is_open, first));
  return SCENE_NO_MODES;
}

/* The same. The sizes that tell rounding differ between modes: what one takes for 0 may be a reason
 * against another, and none is left. Then it is taken for 0 by all. */
VS_FUNCTION_RARE scene_status vs_find_modes(scene_model* m, scene_series* it,
                                            const scene_state* from) {
  scene_status status = SCENE_NO_MODES;
  double slack;
  for (slack = 0.0; slack < 100.0 && status == SCENE_NO_MODES && !vs_has_met(m);
       slack = 10.0 * slack + 9.0) {
    m->series[0].slack = m->series[1].slack = slack;
    m->now = *from;
    vs_enter_state(m, it);
    status = vs_search_modes(m, it, from);
  }
  return status;
}

/* The torque of element h at the state that was entered. */
VS_FUNCTION_RARE Real vs_transmits(const scene_model* m, const scene_series* it, int h) {
  return it->row[slide_row[h]][0] - m->now.multiplier[CONSTRAINTS + h];
}

/* An element that others hold at rest stays there until modes are decided again. */
VS_FUNCTION_RARE void vs_tell_modes(scene_model* m, const scene_series* it) {
  int h;
  for (h = 0; h < HOLDS; ++h) m->now.told[h] = vs_told_mode(it, h, m->now.mode[h], it->order);
}

VS_FUNCTION_RARE void vs_note_events(scene_model* m, const scene_series* it, const int* before,
                                     const Real* impulse) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    scene_event* const event = &m->event_of[m->events % SCENE_MOST_EVENTS];
    event->from = before[h];
    event->to = m->now.told[h];
    if (event->to == event->from && impulse[h] == 0.0) continue;
    event->time = m->now.time;
    event->element = h;
    event->torque = vs_transmits(m, it, h);
    event->impulse = impulse[h];
    ++m->events;
  }
}

/* The modes behind the present instant, and the accelerations there: J epsilon + n - Q = memory +
 * D' multiplier, where the memory is none of gauss and at the start. */
VS_FUNCTION_RARE scene_status vs_decide(scene_model* m, int is_start) {
  scene_series* const it = &m->series[1 - m->present];
  const scene_state before = m->now;
  scene_state ahead, from;
  Real impulse[MOST_HOLDS + 1];
  scene_status status;
  int told[MOST_HOLDS + 1];
  int i, p;
  m->is_first = is_start;
  for (i = 0; i < S; ++i) m->memory[i] = 0.0;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (i = 0; i < HOLDS; ++i) told[i] = m->now.told[i];
  if (!IS_CLASSICAL && !is_start) vs_reaction(it, m->memory);
  for (i = 0; i < S && !IS_CLASSICAL && !is_start; ++i) {
    double size = vs_own_size(it, i, 0);
    for (p = 0; p < K; ++p) {
      const Real torque = vs_direction(it, p, i) * m->now.multiplier[p];
      m->memory[i] -= torque;
      size += fabs(torque);
    }
    /* (Behind an impact no torque may be left that it would be rounding of.) */
    if (fabs(m->memory[i]) <= vs_noise(it) * size) VS_SET_VALUE(m->memory[i], 0.0);
  }
  for (i = 0; i < HOLDS; ++i) m->meets[i] = 0;
  ahead = m->now;
  do {
    m->now = ahead;
    status = vs_collide(m, it, impulse);
    vs_find_moving(m, it);
    from = m->now;
    if (status == SCENE_OK) status = vs_find_modes(m, it, &from);
  } while (vs_has_met(m));
  m->is_begun = 0;
  if (status != SCENE_OK) m->now = before;
  if (status == SCENE_OK) vs_tell_modes(m, it);
  if (status == SCENE_OK && !is_start) vs_note_events(m, it, told, impulse);
  return status;
}

/* Before the modes of a start are decided, no element transmits anything. */
VS_FUNCTION_RARE void vs_forget_modes(scene_model* m) {
  int i;
  for (i = 0; i < HOLDS; ++i) {
    m->now.mode[i] = m->now.told[i] = VS_FREE;
    m->now.side[i] = 0.0;
    m->now.counts[i] = 0;
    m->now.heat[i] = 0.0;
  }
  for (i = 0; i < K && TRANSMITS; ++i) m->now.multiplier[i] = 0.0;
}

/* The modes at the start. An element that is not in the one that the scene asks for, or beyond its
 * stop, is the model's culprit, with the torque that it would have to hold. */
VS_FUNCTION_RARE scene_status vs_decide_first(scene_model* m) {
  const double most = 1e-6; /* rad, of what angles are given with */
  scene_series* const it = &m->series[1 - m->present];
  scene_status status;
  int h;
  m->culprit = -1;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (h = 0; h < HOLDS; ++h) {
    if (!has_gap[h] || !(it->row[gap_row[h]][0] < -most)) continue;
    m->culprit = h;
    m->culprit_slip = it->row[gap_row[h]][0];
    m->now.mode[h] = VS_STUCK;
    return SCENE_INCONSISTENT;
  }
  status = vs_decide(m, 1);
  for (h = 0; h < HOLDS && status == SCENE_OK && !m->has_moved; ++h) {
    const scene_state from = m->now;
    const int is_stuck = m->now.mode[h] == VS_STUCK;
    if (begins_in[h] != (is_stuck ? VS_BEGINS_SLIPPING : VS_BEGINS_STUCK)) continue;
    m->culprit = h;
    m->culprit_slip = it->row[slip_row[h]][0];
    m->now.mode[h] = VS_STUCK;
    (void)vs_take_modes(m, it, &from);
    m->culprit_torque = vs_transmits(m, it, h);
    return SCENE_INCONSISTENT;
  }
  return status;
}

/* The torque, N m, that element h would hold beyond the one it holds. */
VS_FUNCTION_RARE Real vs_reserve(const scene_model* m, const scene_series* it, int h) {
  const Real T = vs_transmits(m, it, h);
  Real c[VS_STRIDE];
  if (vs_is_loss(it, h) && m->now.mode[h] == VS_STUCK) {
    Real least = INFINITY;
    int s;
    for (s = -1; s <= 1; s += 2) {
      vs_margin(it, h, s, vs_line(it, h, s, 0), 0, c);
      least = seriesSmaller(least, c[0]);
    }
    return least;
  }
  const Real upper = has_upper[h] ? it->row[upper_row[h]][0] - T : (Real)INFINITY;
  const Real lower = has_lower[h] ? T - it->row[lower_row[h]][0] : (Real)INFINITY;
  return m->now.mode[h] == VS_STUCK ? fmin(lower, upper) : vs_zero;
}
