/* A motion for a program that keeps the inputs itself, looks at any instant inside the last step
 * and goes on from any. */

typedef struct {
  scene_model model;
  scene_state before; /* the start of the last step */
  scene_series seen;  /* of the instant that was looked at */
  int taken;          /* the series of the last step */
  double made;        /* its length, s; 0: there is none */
  double event;       /* from where on, s, its end stands for all */
} vs_host;

VS_FUNCTION void vs_host_prepare(vs_host* h) {
  const scene_model* const m = &h->model;
  int n;
  vs_set_constants(&h->model);
  (void)m;
  for (n = 0; n < CONSTANTS; ++n) h->seen.row[constant_row[n]][0] = constant_value[n];
}

VS_FUNCTION void vs_host_forget_step(vs_host* h) {
  h->made = 0.0;
  h->model.is_begun = 0;
}

/* The state `at` s behind the start of the last step, on the constraints, and its formulas. */
VS_FUNCTION scene_status vs_host_go(vs_host* h, double at) {
  scene_model* const m = &h->model;
  const int present = m->present;
  const double unit = m->series[h->taken].unit;
  m->now = h->before;
  m->present = h->taken;
  vs_go(m, at / unit);
  m->present = present;
  return vs_arrive(m, &h->seen, unit);
}

/* The motion begins (see vs_exchange). */
VS_FUNCTION int vs_host_begin(vs_host* h, const vs_exchange* from) {
  scene_model* const m = &h->model;
  scene_series* const it = &m->series[1 - m->present];
  int e, p;
  vs_take_over(m, from);
  for (p = 0; p < K; ++p) m->longest[p] = from->longest[p];
  for (p = 0; p < HOLDS; ++p) {
    m->now.mode[p] = from->hold[p].mode;
    m->now.counts[p] = from->hold[p].counts;
    m->now.side[p] = from->hold[p].side;
    m->now.heat[p] = from->hold[p].heat;
  }
  for (e = 0; e < EVENTS; ++e) m->now.armed[e] = from->begin == 0 ? from->armed[e] : 0;
  vs_host_forget_step(h);
  if (from->begin == 0) return m->status;
  m->has_moved = from->begin != 1;
  m->status = vs_start(m, it, from->are_given, from->may_move);
  if (m->has_moved && HAS_NEUTRAL) vs_note_reaction(m, it);
  return m->status;
}

/* Writes all that the motion goes on from. */
VS_FUNCTION void vs_host_leave(vs_host* h, vs_exchange* to) {
  scene_model* const m = &h->model;
  int i, p;
  if (!m->has_moved && HAS_NEUTRAL) vs_note_reaction(m, &m->series[1 - m->present]);
  to->time = m->now.time;
  to->time_rest = m->now.time_rest;
  for (i = 0; i < S; ++i) {
    to->state[i] = m->now.angle[i];
    to->state[S + i] = m->now.velocity[i];
    to->state[2 * S + i] = m->now.acceleration[i];
    to->reaction[i] = m->now.reaction[i];
  }
  for (p = 0; p < K; ++p) {
    to->multiplier[p] = m->now.multiplier[p];
    to->longest[p] = m->longest[p];
  }
  for (i = 0; i < EVENTS; ++i) to->armed[i] = m->now.armed[i];
  for (i = 0; i < INPUTS; ++i) vs_describe_signal(&m->now.input[i], &to->input[i]);
  to->culprit = m->culprit;
  to->culprit_torque = m->culprit_torque;
  to->culprit_slip = m->culprit_slip;
  for (p = 0; p < HOLDS; ++p) {
    to->hold[p].mode = m->now.mode[p];
    to->hold[p].counts = m->now.counts[p];
    to->hold[p].side = m->now.side[p];
    to->hold[p].heat = m->now.heat[p];
  }
  to->usual = m->usual;
}

/* True when no angle, no velocity and no state that something reads leaves the tolerance around its
 * value in the last step. */
VS_FUNCTION int vs_host_is_still(const vs_host* h) {
  const scene_series* const it = &h->model.series[h->taken];
  const double theta = h->made / it->unit;
  int c, n;
  for (c = 0; c < 2 * S + STATES; ++c) {
    const Real* const x = it->row[c < 2 * S ? ANGLE + c : STATE + c - 2 * S];
    double power = theta, sum = 0.0;
    if (c >= 2 * S && !state_is_wanted[c - 2 * S]) continue;
    for (n = 1; n <= it->order; ++n, power *= theta) sum += fabs(x[n]) * power;
    if (!(sum <= vs_tolerance(it, x[0]))) return 0;
  }
  return 1;
}

/* The changes of modes and the events at the end of a step or behind a change of inputs. */
VS_FUNCTION void vs_host_tell_events(const scene_model* m, vs_exchange* to) {
  /* More at one instant than there is room for leave the last ones, in no order. */
  to->event_count = m->events < SCENE_MOST_EVENTS ? (int)m->events : SCENE_MOST_EVENTS;
  to->events = m->event_of;
}

/* One step of at most `left` s. Without one the state stays. */
VS_FUNCTION int vs_host_step(vs_host* h, double left, vs_exchange* to) {
  scene_model* const m = &h->model;
  const long rejections = m->rejections;
  double rest;
  int i;
  if (!m->has_moved && HAS_NEUTRAL) vs_note_reaction(m, &m->series[1 - m->present]);
  m->events = 0;
  m->status = vs_apply_events(m);
  m->has_moved = 1;
  vs_end_inputs(m);
  h->before = m->now;
  if (m->status == SCENE_OK) m->status = vs_make_step(m, left, &h->made);
  h->taken = m->is_begun ? 1 - m->present : m->present;
  to->is_event = !m->is_begun;
  if (m->status == SCENE_OK && EVENTS > 0) {
    m->present = 1 - h->taken; /* the other series is free */
    m->status = vs_apply_events(m);
    if (m->has_set) to->is_event = 1;
  }
  rest = 0.0 * (m->now.time + m->now.time_rest);
  for (i = 0; i < S; ++i)
    rest += 0.0 * (m->now.angle[i] + m->now.velocity[i] + m->now.acceleration[i]);
  if (m->status == SCENE_OK && rest != 0.0) m->status = SCENE_NOT_FINITE;
  to->rejections = m->rejections - rejections;
  to->passed = m->passed;
  if (m->status != SCENE_OK) {
    m->now = h->before;
    vs_host_forget_step(h);
    return m->status;
  }
  for (i = 0; i < S; ++i) {
    to->state[i] = m->now.angle[i];
    to->state[S + i] = m->now.velocity[i];
    to->state[2 * S + i] = m->now.acceleration[i];
  }
  to->made = h->made;
  to->usual = m->usual;
  vs_host_tell_events(m, to);
  to->time = m->now.time;
  to->time_rest = m->now.time_rest;
  to->is_still = h->made >= 1.0 && vs_host_is_still(h);
  h->event = to->is_event ? m->event * m->series[h->taken].unit : h->made;
  /* An instant that rounding does not tell from an event shows the modes behind it. */
  if (HOLDS && to->is_event) h->event -= 8.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
  to->event = h->event;
  return m->status;
}

/* The motion goes on from `at` s behind the start of the last step. */
VS_FUNCTION int vs_host_cut(vs_host* h, double at) {
  scene_model* const m = &h->model;
  if (at < h->event && at < h->made) {
    const scene_state end = m->now;
    m->status = vs_host_go(h, at);
    if (m->status != SCENE_OK) m->now = end;
  }
  vs_host_forget_step(h);
  return m->status;
}

/* Inputs change at the present. */
VS_FUNCTION int vs_host_change(vs_host* h, vs_exchange* from) {
  scene_signal next[MOST_INPUTS + 1];
  scene_status status;
  int i;
  for (i = 0; i < INPUTS; ++i) {
    next[i] = takes_commands[i] ? vs_signal_of(&from->input[i]) : h->model.now.input[i];
  }
  vs_host_forget_step(h);
  h->model.events = 0;
  status = vs_change_inputs(&h->model, next);
  if (status == SCENE_OK) status = vs_apply_events(&h->model);
  vs_host_tell_events(&h->model, from);
  return status;
}

/* All there is to see `at` s behind the start of the last step. */
VS_FUNCTION int vs_host_see(vs_host* h, double at, vs_seen* to) {
  scene_model* const m = &h->model;
  scene_series* const it = &h->seen;
  const scene_state end = m->now;
  scene_status status = SCENE_OK;
  int i, j, p;
  if (at < h->event && at < h->made) {
    status = vs_host_go(h, at);
  } else {
    it->unit = vs_unit_of(m->usual > 0.0 ? m->usual : 1e-3);
    vs_enter_inputs(m, it, SCENE_ORDER);
    vs_enter_state(m, it);
    if (!vs_begin(it, m->now.multiplier, 0)) status = SCENE_SINGULAR;
  }
  if (it->order < 1) vs_extend(it);
  if (!vs_is_finite(it) && status == SCENE_OK) status = SCENE_NOT_FINITE;
  vs_at_once(it, 0);
  vs_reaction(it, to->reaction);
  if (IS_CLASSICAL && INERTIA_VARIES) vs_note_pull(it, 0);
  to->kinetic = 0.0;
  for (i = 0; i < S; ++i) {
    to->angle[i] = m->now.angle[i];
    to->velocity[i] = m->now.velocity[i];
    to->acceleration[i] = m->now.acceleration[i];
    to->torque[i] = it->row[torque_row[i]][0];
    to->reaction_rate[i] = vs_reaction_rate(it, i);
    to->covariant_rate[i] = to->reaction_rate[i] - vs_connection(it, i);
    for (j = 0; j < S; ++j) {
      to->kinetic += 0.5 * vs_inertia(it, i, j) * to->velocity[i] * m->now.velocity[j];
    }
  }
  for (p = 0; p < CONSTRAINTS; ++p) {
    to->residual[p] = vs_residual(it, p);
    to->multiplier[p] = it->row[MULTIPLIER + p][0];
  }
  for (p = 0; p < HOLDS; ++p) {
    vs_seen_hold* const held = to->hold + p;
    held->mode = vs_told_mode(it, p, m->now.mode[p], 1);
    held->counts = m->now.counts[p];
    held->side = m->now.side[p];
    held->multiplier = m->now.multiplier[CONSTRAINTS + p];
    held->torque = vs_transmits(m, it, p);
    held->slip = it->row[slip_row[p]][0];
    held->reserve = vs_reserve(m, it, p);
    held->heat = m->now.heat[p];
    for (i = 0; i < S; ++i)
      to->on_shaft[S * p + i] = -vs_entry(it, CONSTRAINTS + p, i) * held->torque;
  }
  for (i = 0; i < INPUTS; ++i) to->input[i] = m->now.input[i].start;
  m->now = end;
  return status;
}

/* The work, J, of the applied torques over the first `at` s of the last step, for each shaft
 * sum_n p_n tau^(n+1) / (n+1), p_n = sum_k Q_k omega_n-k, up to the degree of the product;
 * *through: the sum of the magnitudes. */
VS_FUNCTION double vs_host_work(const vs_host* h, double at, double* through) {
  const scene_series* const it = &h->model.series[h->taken];
  const double tau = seriesSmaller(at, h->made) / it->unit;
  const int last = it->order;
  double sum = 0.0;
  int i, n;
  *through = 0.0;
  for (i = 0; i < S; ++i) {
    const Real* const Q = it->row[torque_row[i]];
    const Real* const omega = it->row[VELOCITY + i];
    double power = it->unit * tau, own = 0.0;
    for (n = 0; n <= 2 * last; ++n, power *= tau) {
      const int first = n > last ? n - last : 0;
      own += vs_total(Q, omega, n, first, n - first) * power / (n + 1);
    }
    sum += own;
    *through += fabs(own);
  }
  return sum;
}

/* C at the end of the last step, as its series tell. */
VS_FUNCTION void vs_host_look(const vs_host* h, double* entry) {
  const scene_series* const it = &h->model.series[h->taken];
  const double theta = h->made / it->unit;
  int i;
  for (i = 0; i < S * K; ++i) entry[i] = vs_evaluate(it->row[entry_row[i]], it->order, theta);
}

VS_FUNCTION void vs_host_show(const vs_host* h, vs_shown* to) {
  const scene_series* const it = &h->model.series[h->taken];
  int c;
  for (c = 0; c < 3 * S; ++c) to->rows[c] = it->row[ANGLE + c];
  for (c = 0; c < S; ++c) to->rows[3 * S + c] = it->row[torque_row[c]];
  to->last = it->order;
  to->unit = it->unit;
  to->length = h->model.usual;
}
