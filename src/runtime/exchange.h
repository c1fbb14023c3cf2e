/* Steps of a motion whose state another program keeps. */

VS_FUNCTION scene_signal vs_signal_of(const vs_exchanged_signal* from) {
  scene_signal s;
  s.form = from->form;
  s.start = from->start;
  s.target = from->target;
  s.slope = from->slope;
  s.inverse_tau = from->inverse_tau;
  s.linear = from->linear;
  s.age = from->age;
  s.end = from->end;
  return s;
}

VS_FUNCTION void vs_describe_signal(const scene_signal* s, vs_exchanged_signal* to) {
  to->form = s->form;
  to->start = s->start;
  to->target = s->target;
  to->slope = s->slope;
  to->inverse_tau = s->inverse_tau;
  to->linear = s->linear;
  to->age = s->age;
  to->end = s->end;
}

VS_FUNCTION void vs_take_over(scene_model* m, const vs_exchange* from) {
  int i;
  m->now.time = from->time;
  m->now.time_rest = from->time_rest;
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = from->state[i];
    m->now.velocity[i] = from->state[S + i];
    m->now.acceleration[i] = from->state[2 * S + i];
    m->now.reaction[i] = from->reaction[i];
  }
  for (i = 0; i < K; ++i) m->now.multiplier[i] = from->multiplier[i];
  for (i = 0; i < INPUTS; ++i) {
    m->now.input[i] = vs_signal_of(&from->input[i]);
    m->now.silence[i] = -1.0;
  }
  for (i = 0; i < K; ++i) m->longest[i] = 0.0;
  m->usual = from->usual;
  m->is_begun = 0;
  m->has_moved = 1;
  m->crossings = 0;
  m->status = SCENE_OK;
}

/* One step of at most `left` s. */
VS_FUNCTION int vs_advance(scene_model* m, double left, vs_exchange* to) {
  const scene_series *taken, *next;
  const long rejections = m->rejections;
  int i, p, is_smooth;
  m->status = vs_make_step(m, left, &to->made);
  to->rejections = m->rejections - rejections;
  if (m->status != SCENE_OK) return m->status;
  is_smooth = m->is_begun;
  taken = &m->series[is_smooth ? 1 - m->present : m->present];
  to->passed = m->passed;
  to->is_event = !is_smooth;
  to->event = m->event * taken->unit;
  if (!is_smooth) {
    m->present = 1 - m->present;
    if (!vs_begin_here(m, vs_unit_of(m->usual))) return m->status = SCENE_SINGULAR;
  }
  next = vs_series(m);
  to->time = m->now.time;
  to->time_rest = m->now.time_rest;
  to->usual = m->usual;
  to->last = taken->order;
  to->unit = taken->unit;
  for (i = 0; i < S; ++i) {
    const Real* const Q = next->row[torque_row[i]];
    to->state[i] = m->now.angle[i];
    to->state[S + i] = m->now.velocity[i];
    to->state[2 * S + i] = m->now.acceleration[i];
    to->torque[i] = Q[0];
    to->torque_rate[i] = IS_CLASSICAL ? 0.0 : Q[1] / next->unit;
    to->jerk[i] = IS_CLASSICAL ? 0.0 : next->row[ACCELERATION + i][1] / next->unit;
    for (p = 0; p < K; ++p) to->entry[S * p + i] = vs_entry(next, p, i);
    m->coefficients[i] = taken->row[ANGLE + i];
    m->coefficients[S + i] = taken->row[VELOCITY + i];
    m->coefficients[2 * S + i] = taken->row[ACCELERATION + i];
    m->coefficients[3 * S + i] = taken->row[torque_row[i]];
  }
  to->rows = m->coefficients;
  for (p = 0; p < K; ++p) {
    to->multiplier[p] = m->now.multiplier[p];
    to->size[p] = next->size[p];
  }
  return m->status;
}
