/* The functions of scene.h. */

/* ---- Commands ---- */

/* True where `values` are those that were given, if they have to be. */
static int vs_are_given(const double* values, const double* given) {
  int i;
  for (i = 0; i < S && !MAY_PROJECT; ++i) {
    const double moved = fabs(values[i] - given[i]);
    if (!(moved <= 1e-9 * fmax(1.0, fabs(given[i])))) return 0;
  }
  return 1;
}

/* The accelerations at time 0, after commands have set the first inputs. */
static scene_status vs_start(scene_model* m, scene_series* it) {
  const scene_state given = m->now;
  double lambda[K + 1] = {0.0};
  scene_status status;
  vs_enter_inputs(m, it, 0);
  status = vs_project_velocities(m, it);
  if (!vs_are_given(m->now.velocity, given.velocity)) return SCENE_INCONSISTENT;
  if (status != SCENE_OK) return status;
  if (IS_CLASSICAL) return vs_settle_accelerations(m, it);
  if (!HAS_GIVEN_ACCELERATIONS) return vs_settle(m, it, VS_LEAST_REACTION, lambda, 0, 0.0, 50);
  status = vs_settle_accelerations(m, it);
  return vs_are_given(m->now.acceleration, given.acceleration) ? status : SCENE_INCONSISTENT;
}

static scene_status vs_apply_commands(scene_model* m) {
  scene_series* const it = &m->series[1 - m->present];
  const scene_state before = m->now;
  double u[INPUTS + 1], du[INPUTS + 1], dQ[S];
  scene_status status = SCENE_OK;
  int jumps = 0;
  int is_new = 0;
  int i;
  for (i = 0; i < INPUTS; ++i) {
    is_new = is_new || (m->is_commanded[i] && m->command[i] != m->now.input[i].target);
    u[i] = vs_input_value(&m->now.input[i]);
  }
  for (i = 0; i < INPUTS && !is_new; ++i) m->is_commanded[i] = 0;
  if (!is_new) return SCENE_OK;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (i = 0; i < S; ++i) dQ[i] = -it->row[torque_row[i]][0];
  for (i = 0; i < INPUTS; ++i) {
    scene_signal* const s = &m->now.input[i];
    if (m->is_commanded[i] && m->command[i] != s->target) {
      jumps = vs_command_signal(s, hold_of[i], parameter_of[i], m->command[i]) || jumps;
    }
    m->is_commanded[i] = 0;
    du[i] = vs_input_value(s) - u[i];
  }
  if (m->has_moved && jumps) {
    vs_enter_inputs(m, it, 0);
    vs_enter_state(m, it);
    for (i = 0; i < S; ++i) dQ[i] += it->row[torque_row[i]][0];
    status = IS_CLASSICAL ? vs_follow_least_reaction(m, it) : vs_jump(m, it, u, du, dQ, 0);
    vs_enter_inputs(m, it, 0);
    if (status == SCENE_OK && !IS_CLASSICAL) status = vs_settle_accelerations(m, it);
  }
  if (!m->has_moved) status = vs_start(m, it);
  if (status != SCENE_OK) m->now = before;
  m->is_begun = 0;
  m->crossings = 0;
  return status;
}

/* Inputs whose command is overdue fall back. */
static void vs_apply_timeouts(scene_model* m) {
  int i;
  for (i = 0; i < INPUTS; ++i) {
    const double left = timeout_of[i] - m->now.silence[i];
    if (timeout_of[i] <= 0.0 || m->now.silence[i] < 0.0) continue;
    if (left > 4.0 * DBL_EPSILON * fmax(1.0, m->now.time)) continue;
    m->now.silence[i] = -1.0;
    if (!falls_to_zero[i]) continue;
    m->command[i] = fmin(maximum_of[i], fmax(minimum_of[i], 0.0));
    m->is_commanded[i] = 1;
  }
}

/* ---- What a controller calls ---- */

void scene_init(scene_model* m) {
  int i;
  memset(m, 0, sizeof *m);
  vs_set_constants(m);
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = initial_angle[i];
    m->now.velocity[i] = initial_velocity[i];
    m->now.acceleration[i] = initial_acceleration[i];
  }
  for (i = 0; i < K; ++i) m->now.multiplier[i] = initial_multiplier[i];
  for (i = 0; i < INPUTS; ++i) {
    vs_hold_constant(&m->now.input[i], initial_input[i]);
    m->now.silence[i] = -1.0;
  }
}

scene_status scene_command(scene_model* m, int input, double value) {
  if (input < 0 || input >= INPUTS || !isfinite(value)) return SCENE_BAD_ARGUMENT;
  m->command[input] = fmin(maximum_of[input], fmax(minimum_of[input], value));
  m->is_commanded[input] = 1;
  m->now.silence[input] = 0.0;
  return SCENE_OK;
}

/* Moves on to the goal, or to the last state from which the motion goes on. */
static scene_status vs_reach_goal(scene_model* m) {
  double left = (m->now.goal - m->now.time) + (m->now.goal_rest - m->now.time_rest);
  int steps;
  if (m->status == SCENE_OK) m->status = vs_apply_commands(m);
  for (steps = 0; m->status == SCENE_OK && left > 0.0; ++steps) {
    double made = 0.0;
    if (steps == SCENE_MOST_STEPS) {
      m->status = SCENE_TOO_MANY_STEPS;
      break;
    }
    if (!m->has_moved && HAS_NEUTRAL) vs_note_reaction(m, &m->series[1 - m->present]);
    m->has_moved = 1;
    m->status = vs_make_step(m, left, &made);
    vs_apply_timeouts(m);
    left = (m->now.goal - m->now.time) + (m->now.goal_rest - m->now.time_rest);
    /* At the goal itself they wait for what else comes there. */
    if (m->status == SCENE_OK && left > 0.0) m->status = vs_apply_commands(m);
  }
  return m->status;
}

scene_status scene_step(scene_model* m, double dt) {
  double sum, rest;
  if (!isfinite(dt) || dt < 0.0) return SCENE_BAD_ARGUMENT;
  rest = dt + m->now.goal_rest;
  sum = m->now.goal + rest;
  m->now.goal_rest = rest - (sum - m->now.goal);
  m->now.goal = sum;
  return vs_reach_goal(m);
}

scene_status scene_advance_to(scene_model* m, double time) {
  if (!isfinite(time)) return SCENE_BAD_ARGUMENT;
  if (time <= m->now.goal) return m->status;
  m->now.goal = time;
  m->now.goal_rest = 0.0;
  return vs_reach_goal(m);
}

/* The residual of a constraint: f, psi, or C eta + c_0 of order 3. */
static double vs_residual(const scene_series* it, int p) {
  double left = it->row[(order_of[p] == 1 ? velocity_residual_row : residual_row)[p]][0];
  int i;
  for (i = 0; i < S && order_of[p] == 3; ++i) {
    left += vs_entry(it, p, i) * it->row[ACCELERATION + i][1] / it->unit;
  }
  return left;
}

scene_status scene_read(scene_model* m, scene_sample* sample) {
  scene_series* const it = &m->series[m->present];
  double R[S];
  int i, p;
  if (m->status == SCENE_OK) m->status = vs_apply_commands(m);
  if (!vs_is_begun(m) && !vs_begin_here(m, 1.0 / 1024.0) && m->status == SCENE_OK) {
    m->status = SCENE_SINGULAR;
  }
  if (it->order < 1) vs_extend(it);
  if (!vs_is_finite(it) && m->status == SCENE_OK) m->status = SCENE_NOT_FINITE;
  vs_at_once(it, 0);
  vs_reaction(it, R);
  sample->time = m->now.time;
  for (i = 0; i < S; ++i) {
    double rate = 0.0;
    sample->angle[i] = m->now.angle[i];
    sample->velocity[i] = m->now.velocity[i];
    sample->acceleration[i] = m->now.acceleration[i];
    sample->applied_torque[i] = it->row[torque_row[i]][0];
    sample->reaction_torque[i] = R[i];
    /* R' = C' Lambda + 1/2 J' omega J^-1 R; of gauss C' lambda' + (dC/dt)' lambda */
    for (p = 0; p < K; ++p) {
      const double* const C = it->row[entry_row[S * p + i]];
      const double* const l = it->row[MULTIPLIER + p];
      rate += IS_CLASSICAL ? (C[0] * l[1] + C[1] * l[0]) / it->unit : C[0] * l[0];
    }
    if (!IS_CLASSICAL && INERTIA_VARIES)
      rate += it->row[connection_row[i]][0] * it->row[PULL + i][0];
    sample->reaction_torque_rate[i] = rate;
  }
  for (p = 0; p < K; ++p) {
    sample->residual[p] = vs_residual(it, p);
    sample->multiplier[p] = it->row[MULTIPLIER + p][0];
  }
  return m->status;
}

double scene_time(const scene_model* m) {
  return m->now.time;
}

const char* scene_status_text(scene_status status) {
  static const char* const texts[] = {"ok",
                                      "bad argument",
                                      "singular constraint",
                                      "no state on the constraints was found",
                                      "a value is not finite or has no power series",
                                      "too many steps",
                                      "chattering",
                                      "a jump leads to no state on the constraints",
                                      "the first commands contradict the initial values"};
  return status >= SCENE_OK && status <= SCENE_INCONSISTENT ? texts[status] : "?";
}
