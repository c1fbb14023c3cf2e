/* Elements that hold. Element h has a slip f(t, phi, omega), whose row C = df/domega is one of the
 * constraints' while it is stuck, and a torque T against the slip:
 *     stuck          f = 0,  T = -lambda of the reaction C' lambda,  lower <= T <= upper
 *     slides         side f > 0,  the applied torque -C' T with T(side), side = 1 or -1
 *     free           T = 0, where its level (a capacity) is not above 0, a gap is open or what
 * closes it is too fast A mode is discrete memory: it lasts while its conditions, series that are
 * made from rows of the motion, are not negative. Where one would become negative the modes of all
 * elements that are at rest are decided together: those in which all conditions hold a moment
 * later. That is read from the first coefficient that is more than rounding, so that neither ties
 * nor the torque that lets go, which is the one that slides, need a tolerance of their own. */

/* Losses of a constraint are such an element, too: its torque, and what it holds, is the larger of
 * two lines of the constraint's multiplier,
 *     T = s max_k M_k,  M_k = s slope_k lambda + base_k,  s = 1 or -1
 * Its modes are s with the first line, 3 s with the second, and stuck. */
enum { VS_SECOND_LINE = 3 };

enum { VS_CONDITIONS = 3 };
enum { VS_BEGINS_STUCK = 1, VS_BEGINS_SLIPPING };
enum { VS_OF_LEVEL, VS_OF_SLIP, VS_OF_TORQUE, VS_OF_GAP };

/* The part of its terms that rounding, and what the tolerance leaves open, moves a condition by. */
VS_FUNCTION_RARE double vs_noise(const scene_series* it) {
  (void)it;
  return seriesLarger(1e-3 * RELATIVE_TOLERANCE, 2e-13);
}

/* The size of the torques on a shaft, order n. */
VS_FUNCTION_RARE double vs_torque_size(const scene_series* it, int i, int n) {
  double size =
      fabs(it->row[torque_row[i]][n]) + vs_inertia(it, i, i) * fabs(it->row[ACCELERATION + i][n]);
  int p;
  for (p = 0; p < K; ++p) size += fabs(vs_direction(it, p, i) * it->row[TRANSMITTED + p][n]);
  return size;
}

/* The size of coefficient n of the torques on the shafts that element h acts on, and its limits. */
VS_FUNCTION_RARE double vs_sum_of_torques(const scene_series* it, int h, int n) {
  double size = fabs(it->row[upper_row[h]][n]) + fabs(it->row[lower_row[h]][n]);
  int i;
  for (i = 0; i < S; ++i) {
    const double C = fabs(vs_entry(it, CONSTRAINTS + h, i));
    if (C != 0.0) size += vs_torque_size(it, i, n) / C;
  }
  return size;
}

/* The size of coefficient n of a slip that is rounding: what a torque that is rounding makes of it,
 * f_n = unit/n C J^-1 C' T_{n-1}, and as much again: a torque that lets go, by more than rounding
 * or not, leaves a slip that does not turn back. */
VS_FUNCTION_RARE double vs_slip_noise(const scene_series* it, int h, int n) {
  double size = 0.0, mobility = 0.0;
  int i;
  for (i = 0; i < S; ++i) {
    const double C = fabs(vs_entry(it, CONSTRAINTS + h, i));
    size += C * fabs(it->row[VELOCITY + i][0]);
    mobility += C * C / vs_inertia(it, i, i);
  }
  if (n > 0) return 2.0 * vs_noise(it) * it->unit / n * mobility * vs_sum_of_torques(it, h, n - 1);
  return seriesLarger(1e-3 * ABSOLUTE_TOLERANCE, vs_noise(it) * size);
}

VS_FUNCTION_RARE double vs_condition_noise(const scene_series* it, int h, int kind, int n,
                                           const Real* c) {
  double size = 0.0;
  int i;
  switch (kind) {
    case VS_OF_SLIP:
      return vs_slip_noise(it, h, n);
    case VS_OF_TORQUE:
      return vs_noise(it) * vs_sum_of_torques(it, h, n);
    case VS_OF_GAP:
      if (n > 0) return it->unit / n * vs_slip_noise(it, h, n - 1);
      for (i = 0; i < S; ++i) size += fabs(it->row[ANGLE + i][0]);
      return 1e-3 * vs_tolerance(it, size);
    default:
      for (i = 0; i <= it->order; ++i) size = seriesLarger(size, fabs(c[i]));
      return vs_noise(it) * size;
  }
}

/* An instant, too, is known up to rounding, and with it each derivative. */
VS_FUNCTION_RARE int vs_is_noise(const scene_series* it, int h, int kind, int n, const Real* c) {
  const double resolution = 8.0 * DBL_EPSILON * seriesLarger(1.0, it->row[TIME][0]) / it->unit;
  const double size = fabs(c[n]);
  if (n < it->order && size <= resolution * (n + 1) * fabs(c[n + 1])) return 1;
  return size <= vs_condition_noise(it, h, kind, n, c);
}

/* c = factor x + other y */
VS_FUNCTION_RARE void vs_combine(Real* c, int last, double factor, const Real* x, double other,
                                 const Real* y) {
  int n;
  for (n = 0; n <= last; ++n) c[n] = factor * x[n] + (other == 0.0 ? 0.0 : other * y[n]);
}

/* True for the losses of a constraint. */
VS_FUNCTION_RARE int vs_is_loss(const scene_series* it, int h) {
  (void)it;
  return load_of[h] >= 0;
}

/* M_line of side s less the torque that holds, up to order `last`. */
VS_FUNCTION_RARE void vs_margin(const scene_series* it, int h, int s, int line, int last, Real* c) {
  const Real* const slope = it->row[slope_row[2 * h + line]];
  const Real* const base = it->row[base_row[2 * h + line]];
  int n;
  for (n = 0; n <= last; ++n) {
    const Real load = vs_convolve(slope, it->row[TRANSMITTED + load_of[h]], n, 0, 0);
    c[n] = s * (load + it->row[TRANSMITTED + CONSTRAINTS + h][n]) + base[n];
  }
}

/* M_line less the other line. */
VS_FUNCTION_RARE void vs_lead(const scene_series* it, int h, int s, int line, int last, Real* c) {
  Real other[VS_STRIDE];
  int n;
  vs_margin(it, h, s, line, last, c);
  vs_margin(it, h, s, 1 - line, last, other);
  for (n = 0; n <= last; ++n) c[n] -= other[n];
}

/* The larger line. */
VS_FUNCTION_RARE int vs_line(const scene_series* it, int h, int s, int last) {
  Real c[VS_STRIDE];
  int n;
  vs_lead(it, h, s, 0, last, c);
  for (n = 0; n <= last && vs_is_noise(it, h, VS_OF_TORQUE, n, c); ++n) c[n] = 0.0;
  return vs_first_sign(c, last) < 0.0;
}

VS_FUNCTION_RARE int vs_mode_of_line(int s, int line) {
  return line == 0 ? s : VS_SECOND_LINE * s;
}

VS_FUNCTION_RARE int vs_side_of(int mode) {
  return mode > 0 ? 1 : -1;
}

/* The mode as a user sees it: of losses 1 where the first shaft drives, -1 where the second does.
 */
VS_FUNCTION_RARE int vs_told_mode(const scene_series* it, int h, int mode) {
  if (!vs_is_loss(it, h) || mode == VS_STUCK || mode == VS_FREE) return mode;
  return mode == vs_side_of(mode) ? 1 : -1;
}

/* Condition k of the present mode of element h, without the coefficients at its begin that are
 * rounding. False where the mode has no such condition. */
VS_FUNCTION_RARE int vs_condition(const scene_model* m, const scene_series* it, int h, int k,
                                  Real* c) {
  const Real* const f = it->row[slip_row[h]];
  const Real* const tau = it->row[TRANSMITTED + CONSTRAINTS + h];
  const Real* const level = it->row[level_row[h]];
  const int mode = m->now.mode[h], last = it->order;
  const int s = k == 2 ? -1 : 1;
  int kind = VS_OF_LEVEL, n;
  if (mode == VS_FREE) {
    const int nears = closes_below[h] > 0.0 && level[0] > 0.0;
    if (k > 0) return 0;
    if (has_gap[h]) {
      kind = VS_OF_GAP;
      vs_combine(c, last, 1.0, it->row[gap_row[h]], 0.0, f);
    } else if (nears) {
      vs_combine(c, last, f[0] < 0.0 ? -1.0 : 1.0, f, 0.0, f);
      c[0] -= closes_below[h];
    } else {
      vs_combine(c, last, -1.0, level, 0.0, f);
    }
  } else if (k == 0) {
    if (!has_level[h]) return 0;
    vs_combine(c, last, 1.0, level, 0.0, f);
  } else if (vs_is_loss(it, h) && (mode == VS_STUCK ? m->now.counts[h] : k == 2)) {
    kind = VS_OF_TORQUE;
    if (mode == VS_STUCK)
      vs_margin(it, h, s, vs_line(it, h, s, last), last, c);
    else
      vs_lead(it, h, vs_side_of(mode), mode != vs_side_of(mode), last, c);
  } else if (mode != VS_STUCK || !m->now.counts[h]) {
    if (mode != VS_STUCK && k == 2) return 0;
    kind = VS_OF_SLIP;
    vs_combine(c, last, mode == VS_STUCK ? s : vs_side_of(mode), f, 0.0, f);
  } else {
    if (k == 1 ? !has_upper[h] : !has_lower[h]) return 0;
    kind = VS_OF_TORQUE;
    if (k == 1)
      vs_combine(c, last, 1.0, it->row[upper_row[h]], 1.0, tau);
    else
      vs_combine(c, last, -1.0, it->row[lower_row[h]], -1.0, tau);
  }
  for (n = 0; n <= last && vs_is_noise(it, h, kind, n, c); ++n) c[n] = 0.0;
  return 1;
}

/* ---- The decision ---- */

/* Takes the rows of stuck elements into the algebra but those that others of it imply: the motion
 * is the same without them. False where the constraints themselves have lost rank. */
VS_FUNCTION_RARE int vs_choose_rows(scene_model* m, scene_series* it) {
  int h, round;
  for (round = 0; round < 2; ++round) {
    for (h = 0; h < HOLDS; ++h) {
      it->counts[h] = round == 0 && m->now.mode[h] == VS_STUCK;
    }
    if (vs_factor(it, 1, 3)) break;
    if (round == 1) return 0;
  }
  for (h = 0; h < HOLDS && round == 1; ++h) {
    int* const counts = &it->counts[h];
    *counts = m->now.mode[h] == VS_STUCK;
    if (*counts && !vs_factor(it, 1, 3)) *counts = 0;
  }
  for (h = 0; h < HOLDS; ++h) {
    m->now.counts[h] = it->counts[h];
    if (!m->now.counts[h]) m->now.multiplier[CONSTRAINTS + h] = 0.0;
  }
  return 1;
}

/* The motion in the present modes from the state `from`: its accelerations, what the constraints
 * transmit, and the first coefficients of all series. */
VS_FUNCTION_RARE scene_status vs_take_sides(scene_model* m, scene_series* it,
                                            const scene_state* from) {
  const int orders = 5 < SCENE_ORDER ? 5 : SCENE_ORDER;
  scene_status status;
  memcpy(m->now.velocity, from->velocity, sizeof from->velocity);
  memcpy(m->now.acceleration, from->acceleration, sizeof from->acceleration);
  memcpy(m->now.multiplier, from->multiplier, sizeof from->multiplier);
  it->unit = vs_unit_of(m->usual > 0.0 ? seriesSmaller(m->usual, 1.0) : 1e-3);
  vs_enter_inputs(m, it, SCENE_ORDER);
  vs_enter_state(m, it);
  if (!vs_choose_rows(m, it)) return SCENE_SINGULAR;
  status = vs_project_velocities(m, it);
  if (status == SCENE_OK) status = vs_settle(m, it, VS_DECIDED, m->now.multiplier, 0, 0.0, 25);
  if (status != SCENE_OK) return status;
  if (!vs_begin(it, m->now.multiplier, 1)) return SCENE_SINGULAR;
  while (it->order < orders) vs_extend(it);
  return SCENE_OK;
}

/* True where the slip stays 0. */
VS_FUNCTION_RARE int vs_stays(const scene_series* it, int h) {
  const Real* const f = it->row[slip_row[h]];
  int n;
  for (n = 0; n <= it->order && vs_is_noise(it, h, VS_OF_SLIP, n, f); ++n) continue;
  return n > it->order;
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
    const double limit = it->row[(m->now.side[h] > 0.0 ? upper_row : lower_row)[h]][0];
    const double slides = it->row[slide_row[h]][0];
    const int has_limit = m->now.side[h] > 0.0 ? has_upper[h] : has_lower[h];
    const int is_at_rest = fabs(it->row[slip_row[h]][0]) <= vs_slip_noise(it, h, 0);
    if (m->now.side[h] != 0.0 && has_limit && is_at_rest && limit / slides > 1.0)
      m->now.side[h] *= limit / slides;
  }
  for (;;) {
    status = vs_take_sides(m, it, from);
    moved = HOLDS;
    for (h = 0; h < HOLDS && moved == HOLDS && status == SCENE_OK; ++h) {
      if (!vs_is_loss(it, h) && fabs(m->now.side[h]) > 1.0 && !vs_stays(it, h)) moved = h;
    }
    if (moved == HOLDS) return status;
    m->now.side[moved] = m->now.mode[moved];
  }
}

/* The first element with a condition that does not hold, and which one; HOLDS if there is none. */
VS_FUNCTION_RARE int vs_find_wrong(const scene_model* m, const scene_series* it, int* k) {
  Real c[VS_STRIDE];
  int h;
  for (h = 0; h < HOLDS; ++h) {
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
    const double gap = it->row[gap_row[h]][0];
    const int is_open = gap > vs_condition_noise(it, h, VS_OF_GAP, 0, &gap);
    return is_open || by_slip == VS_FORWARD ? VS_FREE : VS_STUCK;
  }
  if (has_level[h] && !(it->row[level_row[h]][0] > 0.0)) return VS_FREE;
  if (vs_is_loss(it, h) && by_slip != VS_STUCK)
    return vs_mode_of_line(by_slip, vs_line(it, h, by_slip, 0));
  if (closes_below[h] > 0.0) {
    const double slip = fabs(it->row[slip_row[h]][0]);
    return m->now.mode[h] == VS_STUCK || slip <= closes_below[h] ? VS_STUCK : VS_FREE;
  }
  return by_slip;
}

/* True where the scene asks for an element that slides from its rest. */
VS_FUNCTION_RARE int vs_begins_slipping(const scene_model* m, int h) {
  return !m->has_moved && begins_in[h] == VS_BEGINS_SLIPPING;
}

/* The mode that element h goes to where condition k of its present one does not hold. */
VS_FUNCTION_RARE int vs_next_mode(const scene_model* m, const scene_series* it, int h, int k) {
  const int mode = m->now.mode[h];
  if (mode == VS_FREE)
    return has_gap[h] || closes_below[h] > 0.0 ? VS_STUCK : vs_mode_by_slip(it, h);
  if (k == 0 || (mode == VS_STUCK && has_gap[h])) return VS_FREE;
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
  return vs_take_modes(m, it, from) == SCENE_OK && vs_find_wrong(m, it, &k) == HOLDS;
}

/* Elements that would hold more at rest than they transmit while they slide may do either: those
 * that can stick do. The modes all hold before and behind. */
VS_FUNCTION_RARE void vs_stick(scene_model* m, scene_series* it, const scene_state* from,
                               const int* first) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    const int mode = m->now.mode[h];
    if (first[h] != VS_STUCK || mode == VS_STUCK || mode == VS_FREE) continue;
    if (vs_begins_slipping(m, h)) continue;
    m->now.mode[h] = VS_STUCK;
    if (vs_all_hold(m, it, from)) {
      h = -1; /* another one may be able to now */
      continue;
    }
    m->now.mode[h] = mode;
    (void)vs_take_modes(m, it, from);
  }
}

/* Looks for modes in which all conditions hold: by exchanges of the first one that does not, which
 * ends for limits that do not depend on the mode (Murty's least index); else among all. */
VS_FUNCTION_RARE scene_status vs_find_modes(scene_model* m, scene_series* it,
                                            const scene_state* from) {
  int first[MOST_HOLDS + 1], is_open[MOST_HOLDS + 1];
  int h, k, open = 0, round;
  for (h = 0; h < HOLDS; ++h) {
    first[h] = m->now.mode[h] = vs_guess_mode(m, it, h);
    is_open[h] = (first[h] == VS_STUCK && !(closes_below[h] > 0.0)) || vs_is_loss(it, h);
    open += is_open[h];
    if (is_open[h] && !has_gap[h] && vs_begins_slipping(m, h)) m->now.mode[h] = VS_FORWARD;
  }
  for (round = 0; round < 5 * HOLDS + 5; ++round) {
    if (vs_take_modes(m, it, from) != SCENE_OK) break;
    h = vs_find_wrong(m, it, &k);
    if (h == HOLDS) {
      vs_stick(m, it, from, first);
      return SCENE_OK;
    }
    m->now.mode[h] = vs_next_mode(m, it, h, k);
    if (m->now.mode[h] == VS_FREE || first[h] == VS_FREE) {
      first[h] = m->now.mode[h];
      is_open[h] = has_gap[h] || first[h] == VS_STUCK;
    }
  }
  for (h = 0; h < HOLDS; ++h) {
    m->now.mode[h] = is_open[h] ? VS_STUCK : first[h];
    if (vs_is_loss(it, h) && first[h] != VS_STUCK) m->now.mode[h] = vs_side_of(first[h]);
  }
  if (open > 10) return SCENE_NO_MODES;
  for (h = 0; h < HOLDS; ++h) first[h] = m->now.mode[h];
  do {
    if (vs_all_hold(m, it, from)) return SCENE_OK;
  } while (vs_count_modes(m, is_open, first));
  return SCENE_NO_MODES;
}

/* The torque of element h at the state that was entered. */
VS_FUNCTION_RARE double vs_transmits(const scene_model* m, const scene_series* it, int h) {
  return it->row[slide_row[h]][0] - m->now.multiplier[CONSTRAINTS + h];
}

VS_FUNCTION_RARE void vs_note_events(scene_model* m, const scene_series* it, const int* before,
                                     const double* impulse) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    scene_event* const event = &m->event_of[m->events % SCENE_MOST_EVENTS];
    event->from = vs_told_mode(it, h, before[h]);
    event->to = vs_told_mode(it, h, m->now.mode[h]);
    if (event->to == event->from && impulse[h] == 0.0) continue;
    event->time = m->now.time;
    event->element = h;
    event->torque = vs_transmits(m, it, h);
    event->impulse = impulse[h];
    ++m->events;
  }
}

/* ---- Impacts: J dw = C' p of the rigid rows. Of those that only press one way p >= 0, and behind
        it f >= -e f of before. They pass constraints without losses: these would need to know how
        the speeds change within an impact. ---- */

/* True for elements that let no slip into one direction, or none at all, in their present place. */
VS_FUNCTION_RARE int vs_is_rigid(const scene_model* m, const scene_series* it, int h) {
  if (closes_below[h] > 0.0) return vs_guess_mode(m, it, h) == VS_STUCK;
  if (has_gap[h]) {
    const double gap = it->row[gap_row[h]][0];
    return gap <= vs_condition_noise(it, h, VS_OF_GAP, 0, &gap);
  }
  return !slides_backward[h];
}

/* Slower bounces than this, rad/s, end at rest. */
VS_FUNCTION_RARE double vs_slowest_bounce(const scene_series* it) {
  return 0.1 * sqrt(vs_tolerance(it, 1.0));
}

VS_FUNCTION_RARE scene_status vs_collide(scene_model* m, scene_series* it, double* impulse) {
  double slip[MOST_HOLDS + 1], after[MOST_HOLDS + 1], x[MOST_SIZE];
  int hits = 0, h, i, round;
  for (h = 0; h < HOLDS; ++h) {
    if (vs_is_loss(it, h)) m->now.side[h] = 0.0;
  }
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (h = 0; h < HOLDS; ++h) {
    const double noise = vs_slip_noise(it, h, 0);
    const int rigid = vs_is_rigid(m, it, h);
    slip[h] = it->row[slip_row[h]][0];
    impulse[h] = 0.0;
    it->counts[h] = rigid && (closes_below[h] > 0.0 ? fabs(slip[h]) > noise : slip[h] < -noise);
    hits += it->counts[h];
    after[h] = slip[h] < -vs_slowest_bounce(it) ? -restitution[h] * slip[h] : 0.0;
  }
  for (round = 0; round < 5 * HOLDS + 5 && hits > 0; ++round) {
    int wrong = -1;
    if (!vs_factor(it, 1, 3)) { /* others may imply the last row; else it is wrong below */
      for (h = HOLDS - 1; h >= 0 && !it->counts[h]; --h) continue;
      if (h < 0) return SCENE_NO_MODES;
      it->counts[h] = 0;
      continue;
    }
    for (i = 0; i < SIZE; ++i) x[i] = 0.0;
    for (h = 0; h < HOLDS; ++h) x[S + CONSTRAINTS + h] = after[h] - slip[h];
    vs_solve(it, x);
    for (h = 0; h < HOLDS && wrong < 0; ++h) {
      double moved = slip[h];
      for (i = 0; i < S; ++i) moved += vs_entry(it, CONSTRAINTS + h, i) * x[i];
      if (it->counts[h]) {
        if (!(closes_below[h] > 0.0) && x[S + CONSTRAINTS + h] < 0.0) wrong = h;
      } else if (vs_is_rigid(m, it, h)) {
        const double noise = vs_slip_noise(it, h, 0);
        if (closes_below[h] > 0.0 ? fabs(moved) > noise : moved < after[h] - noise) wrong = h;
      }
    }
    if (wrong >= 0) {
      it->counts[wrong] = !it->counts[wrong];
      continue;
    }
    for (i = 0; i < S; ++i) m->now.velocity[i] += x[i];
    for (h = 0; h < HOLDS; ++h) {
      if (!it->counts[h]) continue;
      impulse[h] = x[S + CONSTRAINTS + h];
      m->now.heat[h] -= 0.5 * impulse[h] * (slip[h] + after[h]);
    }
    return SCENE_OK;
  }
  return hits > 0 ? SCENE_NO_MODES : SCENE_OK;
}

/* The modes behind the present instant, and the accelerations there: J epsilon + n - Q = memory +
 * D' multiplier, where the memory is none of gauss and at the start. */
VS_FUNCTION_RARE scene_status vs_decide(scene_model* m, int is_start) {
  scene_series* const it = &m->series[1 - m->present];
  const scene_state before = m->now;
  scene_state from;
  double impulse[MOST_HOLDS + 1];
  scene_status status;
  int i, p;
  for (i = 0; i < S; ++i) m->memory[i] = 0.0;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  if (!IS_CLASSICAL && !is_start) vs_reaction(it, m->memory);
  for (i = 0; i < S && !IS_CLASSICAL; ++i) {
    for (p = 0; p < K && !is_start; ++p)
      m->memory[i] -= vs_direction(it, p, i) * m->now.multiplier[p];
  }
  status = vs_collide(m, it, impulse);
  from = m->now;
  vs_enter_state(m, it);
  if (status == SCENE_OK) status = vs_find_modes(m, it, &from);
  m->is_begun = 0;
  if (status != SCENE_OK) m->now = before;
  if (status == SCENE_OK && !is_start) vs_note_events(m, it, before.mode, impulse);
  return status;
}

/* Before the modes of a start are decided, no element transmits anything. */
VS_FUNCTION_RARE void vs_forget_modes(scene_model* m) {
  int i;
  for (i = 0; i < HOLDS; ++i) {
    m->now.mode[i] = VS_FREE;
    m->now.side[i] = 0.0;
    m->now.counts[i] = 0;
    m->now.heat[i] = 0.0;
  }
  for (i = 0; i < K && TRANSMITS; ++i) m->now.multiplier[i] = 0.0;
}

/* The modes at the start. An element that is not in the one that the scene asks for is the model's
 * culprit, with the torque that it would have to hold. */
VS_FUNCTION_RARE scene_status vs_decide_first(scene_model* m) {
  scene_series* const it = &m->series[1 - m->present];
  const scene_status status = vs_decide(m, 1);
  int h;
  m->culprit = -1;
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
VS_FUNCTION_RARE double vs_reserve(const scene_model* m, const scene_series* it, int h) {
  const double T = vs_transmits(m, it, h);
  Real c[VS_STRIDE];
  if (vs_is_loss(it, h) && m->now.mode[h] == VS_STUCK) {
    double least = INFINITY;
    int s;
    for (s = -1; s <= 1; s += 2) {
      vs_margin(it, h, s, vs_line(it, h, s, 0), 0, c);
      least = seriesSmaller(least, c[0]);
    }
    return least;
  }
  const double upper = has_upper[h] ? it->row[upper_row[h]][0] - T : INFINITY;
  const double lower = has_lower[h] ? T - it->row[lower_row[h]][0] : INFINITY;
  return m->now.mode[h] == VS_STUCK ? fmin(lower, upper) : 0.0;
}
