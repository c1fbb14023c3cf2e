/* Events of the scene: instants at which a switching function passes 0, where formulas set
 * variables and states. */

/* The sign of an event's function just behind the present: that of its series as soon as it is
 * further from 0 than the instant is known. */
VS_FUNCTION int vs_side_of_event(const scene_model* m, const scene_series* it, int event) {
  const Real* const c = it->row[sign_row[FIRST_EVENT + event]];
  const double after = 64.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time) / it->unit;
  double value = c[0];
  if (it->order > 0) value += c[1] * after;
  if (value == 0.0) value = vs_first_sign(c, it->order);
  if (vs_rests(it, c, seriesLarger(after, m->usual / it->unit), 0.0, 1e-3)) return 0;
  return (value > 0.0) - (value < 0.0);
}

/* Sets what those set that have happened, in the order of the scene: their formulas read what those
 * before have set, and all of one event the values before it. */
VS_FUNCTION scene_status vs_set_values(scene_model* m, const int* happened) {
  scene_series* const it = vs_series(m);
  const scene_state before = m->now;
  const int crossings = m->crossings;
  scene_signal next[MOST_INPUTS + 1];
  scene_status status;
  int i, e, k;
  for (e = 0; e < EVENTS; ++e) {
    if (!happened[e]) continue;
    vs_enter_inputs(m, it, 0);
    vs_enter_state(m, it);
    vs_at_once(it, 0);
    for (k = set_begin[e]; k < set_begin[e + 1]; ++k) {
      const Real value = it->row[set_row[k]][0];
      if (!isfinite(value)) return SCENE_NOT_FINITE;
      vs_hold_constant(&m->now.input[set_input[k]], value);
    }
  }
  for (i = 0; i < INPUTS; ++i) {
    next[i] = m->now.input[i];
    m->now.input[i] = before.input[i];
  }
  status = vs_change_inputs(m, next);
  m->crossings = crossings;
  return status;
}

/* Tells of an event of the scene: its elements are those behind the ones that hold. */
VS_FUNCTION void vs_note_event(scene_model* m, int event, int side) {
  scene_event* const it = &m->event_of[m->events++ % SCENE_MOST_EVENTS];
  it->time = m->now.time;
  it->element = HOLDS + event;
  it->from = side > 0 ? VS_BELOW : VS_ABOVE;
  it->to = side > 0 ? VS_ABOVE : VS_BELOW;
  it->torque = it->impulse = 0.0;
}

/* The events of the present: those whose function has another sign behind it than it had, by the
 * motion, by commands, or by what other events have set. */
VS_FUNCTION scene_status vs_apply_events(scene_model* m) {
  enum { VS_MOST_ROUNDS = 100 };
  int happened[MOST_EVENTS + 1];
  scene_status status = SCENE_OK;
  int e, round, any = EVENTS > 0;
  m->has_set = 0;
  for (round = 0; any && status == SCENE_OK; ++round) {
    scene_series* it;
    if (round == VS_MOST_ROUNDS) return SCENE_CHATTERING;
    if (!m->is_begun && !vs_begin_here(m, m->usual > 0.0 ? vs_unit_of(m->usual) : 1.0 / 1024.0))
      return SCENE_SINGULAR;
    it = vs_series(m);
    if (it->order < 1) vs_extend(it);
    any = 0;
    for (e = 0; e < EVENTS; ++e) {
      const int side = vs_side_of_event(m, it, e);
      const int is_passed = m->has_moved && side * m->now.armed[e] < 0;
      happened[e] = is_passed && (event_direction[e] == 0 || event_direction[e] == side);
      if (side != 0) m->now.armed[e] = side;
      if (!happened[e]) continue;
      any = m->has_set = 1;
      m->passed = FIRST_EVENT + e;
      vs_note_event(m, e, side);
    }
    if (any) status = vs_set_values(m, happened);
  }
  return status;
}
