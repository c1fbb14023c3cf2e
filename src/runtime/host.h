/* A motion for a program that keeps the inputs itself, looks at any instant inside the last step
 * and goes on from any. */

typedef struct {
  scene_model model;
  scene_state before; /* the start of the last step */
  scene_series seen;  /* of the instant that was looked at */
  int taken;          /* the series of the last step */
  double made;        /* its length, s; 0: there is none */
  double event;       /* from where on, s, its end stands for all */
  vs_past* past;      /* of delayed formulas */
} vs_host;

VS_FUNCTION void vs_host_prepare(vs_host* h) {
  const scene_model* const m = &h->model;
  int n;
  vs_set_constants(&h->model);
  (void)m;
  for (n = 0; n < CONSTANTS; ++n) h->seen.row[constant_row[n]][0] = constant_value[n];
}

/* ---- delay(x, T) is an input whose closed form is a piece of x's past: it changes where a piece
        ends, and its value jumps where x has jumped T ago. Before the start x has the value that it
        has there. ---- */

VS_FUNCTION double* vs_piece(const vs_past* past, int n) {
  return past->pieces + (size_t)past->stride * (size_t)((past->first + n) % past->capacity);
}

/* The time, s, from the start of a piece to `delay` before the present. */
VS_FUNCTION double vs_age(const scene_model* m, const double* piece, double delay) {
  return (m->now.time - piece[VS_START] - delay) + (m->now.time_rest - piece[VS_START_REST]);
}

VS_FUNCTION double vs_time_noise(const scene_model* m) {
  return 16.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
}

/* True where a piece goes on as a series of the present does, with their rates, over `made` s to
 * within a hundredth of the tolerance. */
VS_FUNCTION int vs_continues(const scene_model* m, const scene_series* it, const double* piece,
                             const Real* c, double made) {
  const double most = 64.0; /* units: the powers of a polynomial overflow in the end */
  const double age = vs_age(m, piece, 0.0), theta = made / it->unit;
  Real u[VS_STRIDE];
  double power = 1.0, off = 0.0;
  int n;
  if (!(age + made <= most * piece[VS_UNIT])) return 0;
  vs_expand_piece(piece, age, it->unit, SCENE_ORDER, u);
  for (n = 0; n <= SCENE_ORDER; ++n, power *= theta)
    off += (n + 1) * fabs(u[n] - (n <= it->order ? c[n] : vs_zero)) * power;
  return off <= 0.01 * vs_tolerance(it, c[0]);
}

/* Adds the last step, from h->before, to the past. A piece that goes on as the step did only
 * becomes longer: steps end where pieces do, and each such end would be one of a piece again. */
VS_FUNCTION scene_status vs_host_record(vs_host* h) {
  scene_model* const m = &h->model;
  const scene_series* const it = &m->series[h->taken];
  const scene_state end = m->now;
  scene_status status = SCENE_OK;
  int d, n;
  m->now = h->before;
  for (d = 0; d < DELAYS; ++d) {
    vs_past* const past = h->past + d;
    const Real* const c = it->row[delayed_row[d]];
    double* piece = vs_piece(past, 0);
    while (past->count > 1 && vs_age(m, piece, delay_of[d]) > piece[VS_LENGTH] + vs_time_noise(m)) {
      past->first = (past->first + 1) % past->capacity;
      --past->count;
      piece = vs_piece(past, 0);
    }
    piece = vs_piece(past, past->count - 1);
    if (vs_continues(m, it, piece, c, h->made)) {
      piece[VS_LENGTH] = vs_age(m, piece, 0.0) + h->made;
      continue;
    }
    past->is_full = past->count == past->capacity;
    if (past->is_full) {
      status = SCENE_TOO_MANY_STEPS;
      break;
    }
    piece = vs_piece(past, past->count++);
    piece[VS_START] = m->now.time;
    piece[VS_START_REST] = m->now.time_rest;
    piece[VS_LENGTH] = h->made;
    piece[VS_UNIT] = it->unit;
    piece[VS_LAST] = it->order;
    for (n = 0; n <= it->order; ++n) piece[VS_PIECE + n] = c[n];
  }
  m->now = end;
  return status;
}

/* Forgets what lies behind the present. */
VS_FUNCTION void vs_host_trim(vs_host* h) {
  int d;
  for (d = 0; d < DELAYS; ++d) {
    vs_past* const past = h->past + d;
    double* piece = vs_piece(past, past->count - 1);
    while (past->count > 1 && vs_age(&h->model, piece, 0.0) <= 0.0)
      piece = vs_piece(past, --past->count - 1);
    piece[VS_LENGTH] = seriesSmaller(piece[VS_LENGTH], vs_age(&h->model, piece, 0.0));
  }
}

/* Lets delayed inputs go on with the pieces of the present, however it was reached. *jumps: the
 * value of one jumps. */
VS_FUNCTION scene_status vs_host_enter_past(vs_host* h, int* jumps) {
  scene_model* const m = &h->model;
  scene_signal next[MOST_INPUTS + 1];
  int d, i, n;
  *jumps = 0;
  for (i = 0; i < INPUTS; ++i) next[i] = m->now.input[i];
  for (d = 0; d < DELAYS; ++d) {
    const vs_past* const past = h->past + d;
    const int is_first = m->now.input[delay_input[d]].piece == 0;
    scene_signal* const s = next + delay_input[d];
    const double before = is_first ? 0.0 : (double)vs_input_value(s);
    double after;
    for (n = 0; n < past->count; ++n) {
      s->piece = vs_piece(past, n);
      s->age = vs_age(m, s->piece, delay_of[d]);
      if (s->piece[VS_LENGTH] - s->age > vs_time_noise(m)) break;
    }
    s->form = VS_DELAYED;
    s->age = seriesLarger(s->age, 0.0);
    s->end = s->piece[VS_LENGTH];
    after = vs_input_value(s);
    *jumps = *jumps || (!is_first && fabs(after - before) > vs_tolerance(vs_series(m), after));
  }
  if (*jumps) return vs_change_inputs(m, next);
  for (i = 0; i < INPUTS; ++i) m->now.input[i] = next[i];
  if (DELAYS > 0) m->is_begun = 0;
  return SCENE_OK;
}

/* The past before the present: one value. */
VS_FUNCTION void vs_begin_past(const scene_model* m, vs_past* past, double delay, double value) {
  double* const piece = past->pieces;
  past->first = past->is_full = 0;
  past->count = 1;
  piece[VS_START] = m->now.time - delay;
  piece[VS_START_REST] = m->now.time_rest;
  piece[VS_LENGTH] = delay;
  piece[VS_UNIT] = vs_unit_of(delay);
  piece[VS_LAST] = 0.0;
  piece[VS_PIECE] = value;
}

/* The first state (vs_start) and the values of delayed formulas there, which it may depend on. */
VS_FUNCTION scene_status vs_host_start(vs_host* h, scene_series* it, int are_given, int may_move) {
  enum { VS_MOST_ROUNDS = 50 };
  scene_model* const m = &h->model;
  const scene_state given = m->now;
  scene_signal signal[MOST_INPUTS + 1];
  scene_status status = SCENE_OK;
  int d, round, jumps, moves = 1;
  for (d = 0; d < DELAYS; ++d) vs_begin_past(m, h->past + d, delay_of[d], 0.0);
  if (DELAYS > 0) status = vs_host_enter_past(h, &jumps);
  for (round = 0; DELAYS > 0 && moves && status == SCENE_OK; ++round) {
    if (round == VS_MOST_ROUNDS) return SCENE_NOT_CONVERGED;
    moves = round == 0;
    vs_enter_inputs(m, it, 0);
    vs_enter_state(m, it);
    for (d = 0; d < DELAYS; ++d) {
      const double value = it->row[delayed_row[d]][0];
      if (!isfinite(value)) return SCENE_NOT_FINITE;
      moves = moves || !(fabs(value - h->past[d].pieces[VS_PIECE]) <= 1e-14 * fabs(value));
      vs_begin_past(m, h->past + d, delay_of[d], value);
    }
    if (!moves) return SCENE_OK;
    for (d = 0; d < INPUTS; ++d) signal[d] = m->now.input[d];
    m->now = given;
    for (d = 0; d < INPUTS; ++d) m->now.input[d] = signal[d];
    status = vs_start(m, it, are_given, may_move);
  }
  return DELAYS > 0 ? status : vs_start(m, it, are_given, may_move);
}

/* True where the last step itself shows what is `at` s behind its start, and not its end. */
VS_FUNCTION int vs_host_is_inside(const vs_host* h, double at) {
  return h->made > 0.0 && at < h->event && at < h->made;
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
  (void)vs_settle_implicitly(m, &h->seen, at / unit);
  m->present = present;
  return vs_arrive(m, &h->seen, unit, 1);
}

/* The motion begins (see vs_exchange). */
VS_FUNCTION int vs_host_begin(vs_host* h, const vs_exchange* from) {
  scene_model* const m = &h->model;
  scene_series* const it = &m->series[1 - m->present];
  int e, jumps, p;
  vs_take_over(m, from);
  for (p = 0; p < K; ++p) m->longest[p] = from->longest[p];
  for (p = 0; p < HOLDS; ++p) {
    m->now.mode[p] = from->hold[p].mode;
    m->now.told[p] = vs_plain_mode(p, m->now.mode[p]);
    m->now.counts[p] = from->hold[p].counts;
    m->now.side[p] = from->hold[p].side;
    m->now.heat[p] = from->hold[p].heat;
  }
  for (e = 0; e < EVENTS; ++e) m->now.armed[e] = from->begin == 0 ? from->armed[e] : 0;
  vs_host_forget_step(h);
  h->past = from->past;
  if (from->begin == 0) {
    m->status = vs_host_enter_past(h, &jumps);
    if (HOLDS > 0 && vs_begin_here(m, vs_unit_of(1e-3))) {
      while (vs_series(m)->order < vs_decides_by()) vs_extend(vs_series(m));
      vs_tell_modes(m, vs_series(m));
    }
    m->is_begun = 0;
    return m->status;
  }
  m->has_moved = from->begin != 1;
  m->status = vs_host_start(h, it, from->are_given, from->may_move);
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
  to->choice = m->choice;
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
  const long rejections = m->rejections, corrections = m->corrections;
  double rest;
  int i, jumps = 0;
  if (!m->has_moved && HAS_NEUTRAL) vs_note_reaction(m, &m->series[1 - m->present]);
  m->events = 0;
  m->status = vs_apply_events(m);
  m->has_moved = 1;
  vs_end_inputs(m);
  h->before = m->now;
  if (m->status == SCENE_OK) m->status = vs_make_step(m, left, &h->made);
  h->taken = m->is_begun ? 1 - m->present : m->present;
  to->is_event = !m->is_begun;
  if (m->status == SCENE_OK && DELAYS > 0) m->status = vs_host_record(h);
  if (m->status == SCENE_OK && (EVENTS > 0 || DELAYS > 0)) {
    m->present = 1 - h->taken; /* the other series is free */
    m->status = vs_host_enter_past(h, &jumps);
    if (m->status == SCENE_OK) {
      const scene_state end = m->now;
      const long events = m->events;
      m->status = vs_apply_events(m);
      if (m->status != SCENE_OK) {
        /* Nothing goes on behind what they set: the next step begins with them, and stops there. */
        m->status = SCENE_OK;
        m->now = end;
        m->events = events;
        m->is_begun = 0;
      }
    }
    if (jumps || m->has_set) to->is_event = 1;
  }
  rest = 0.0 * (m->now.time + m->now.time_rest);
  for (i = 0; i < S; ++i)
    rest += 0.0 * (m->now.angle[i] + m->now.velocity[i] + m->now.acceleration[i]);
  if (m->status == SCENE_OK && rest != 0.0) m->status = SCENE_NOT_FINITE;
  to->rejections = m->rejections - rejections;
  to->corrections = m->corrections - corrections;
  to->is_implicit = m->series[h->taken].method == VS_IMPLICIT;
  to->passed = m->passed;
  to->rounding = m->rounding;
  to->error = m->fixed > 0.0 ? m->error : 0.0;
  if (m->status != SCENE_OK) {
    to->stopped = m->now.time;
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
  to->choice = m->choice;
  to->usual = m->usual;
  vs_host_tell_events(m, to);
  to->time = m->now.time;
  to->time_rest = m->now.time_rest;
  to->is_still = m->at_rest > 0.0;
  h->event = to->is_event ? m->event * m->series[h->taken].unit : h->made;
  /* An instant that rounding does not tell from an event shows the modes behind it. */
  if ((HOLDS || EVENTS) && to->is_event)
    h->event -= 8.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time);
  to->event = h->event;
  return m->status;
}

/* The motion goes on from `at` s behind the start of the last step. */
VS_FUNCTION int vs_host_cut(vs_host* h, double at) {
  scene_model* const m = &h->model;
  int jumps;
  if (vs_host_is_inside(h, at)) {
    const scene_state end = m->now;
    m->status = vs_host_go(h, at);
    if (m->status != SCENE_OK) m->now = end;
    vs_host_trim(h);
    if (m->status == SCENE_OK) m->status = vs_host_enter_past(h, &jumps);
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
  if (vs_host_is_inside(h, at)) {
    status = vs_host_go(h, at);
  } else {
    it->unit = vs_unit_of(m->usual > 0.0 ? m->usual : 1e-3);
    vs_enter_inputs(m, it, 1);
    vs_enter_state(m, it);
    if (!vs_begin(it, m->now.multiplier, 0)) status = SCENE_SINGULAR;
  }
  if (it->order < 1) vs_extend(it);
  if (!vs_is_finite(it) && status == SCENE_OK) status = SCENE_NOT_FINITE;
  vs_at_once(it, 0);
  vs_reaction(it, to->reaction);
  if (INERTIA_VARIES && !HAS_CONNECTION) vs_note_pull(it, 0);
  to->kinetic = 0.0;
  for (i = 0; i < S; ++i) {
    to->angle[i] = m->now.angle[i];
    to->velocity[i] = m->now.velocity[i];
    to->acceleration[i] = m->now.acceleration[i];
    to->torque[i] = it->row[torque_row[i]][0];
    to->reaction_rate[i] = vs_reaction_rate(it, i);
    to->covariant_rate[i] = to->reaction_rate[i] - vs_connection(it, i);
    if (to->jerk != 0) to->jerk[i] = it->row[ACCELERATION + i][1] / it->unit;
    for (j = VS_FIRST_COUPLED(i); j < VS_END_COUPLED(i); ++j)
      to->kinetic += 0.5 * vs_inertia(it, i, j) * to->velocity[i] * m->now.velocity[j];
  }
  for (p = 0; p < CONSTRAINTS; ++p) {
    to->residual[p] = vs_residual(it, p);
    to->multiplier[p] = it->row[TOLD_MULTIPLIER + p][0];
  }
  for (p = 0; p < HOLDS; ++p) {
    vs_seen_hold* const held = to->hold + p;
    held->mode = m->now.told[p];
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
  for (i = 0; i < INPUTS; ++i) {
    const scene_signal* const s = &m->now.input[i];
    Real* const u = to->input + 3 * i;
    u[0] = s->start; /* of states and variables; commanded inputs are the host's own */
    u[1] = u[2] = 0.0;
    if (s->form != VS_DELAYED) continue;
    vs_expand_input(s, 1.0, 2, u);
    u[2] *= 2.0;
  }
  m->now = end;
  return status;
}

/* The work, J, of the applied torques over the first `at` s of the last step, for each shaft
 *     sum_jk omega_j Q_k w_{j+k},  w_n = unit tau^(n+1) / (n+1),
 * up to the degree of the product; *through: the sum of the magnitudes. */
VS_FUNCTION double vs_host_work(const vs_host* h, double at, double* through) {
  const scene_series* const it = &h->model.series[h->taken];
  const double tau = seriesSmaller(at, h->made) / it->unit;
  const int last = it->order;
  double weight[2 * VS_STRIDE + 4] = {0.0}, power = it->unit * tau, sum = 0.0;
  int i, k;
  for (k = 0; k <= 2 * last; ++k, power *= tau) weight[k] = power / (k + 1);
  *through = 0.0;
  for (i = 0; i < S; ++i) {
    Real own[VS_STRIDE + 4], work;
    vs_correlate(it->row[torque_row[i]], weight, last, own);
    work = vs_dot(it->row[VELOCITY + i], own, last + 1);
    sum += work;
    *through += fabs(work);
  }
  return sum;
}

/* C `at` s behind the start of the last step, as its series tell. */
VS_FUNCTION void vs_host_look(const vs_host* h, double at, double* entry) {
  const scene_series* const it = &h->model.series[h->taken];
  const double theta = at / it->unit;
  int i;
  for (i = 0; i < S * K; ++i) entry[i] = vs_evaluate(it->row[entry_row[i]], it->order, theta);
}
