/* The functions of scene.h. */

/* ---- Commands ---- */

static scene_status vs_apply_commands(scene_model* m) {
  scene_signal next[INPUTS + 1];
  int is_new = 0;
  int i;
  for (i = 0; i < INPUTS; ++i) {
    next[i] = m->now.input[i];
    if (m->is_commanded[i] && m->command[i] != next[i].target) {
      (void)vs_command_signal(&next[i], hold_of[i], parameter_of[i], m->command[i]);
      is_new = 1;
    }
    m->is_commanded[i] = 0;
  }
  /* (Impacts have moved the velocities of a start.) */
  if (TRANSMITS && is_new && !m->has_moved)
    memcpy(m->now.velocity, initial_velocity, sizeof initial_velocity);
  return is_new ? vs_change_inputs(m, next) : SCENE_OK;
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
  for (i = 0; i < CONSTRAINTS; ++i) m->now.multiplier[i] = initial_multiplier[i];
  for (i = 0; i < INPUTS; ++i) {
    vs_hold_constant(&m->now.input[i], initial_input[i]);
    m->now.silence[i] = -1.0;
  }
  if (TRANSMITS) m->status = vs_start(m, &m->series[1], HAS_GIVEN_ACCELERATIONS, MAY_PROJECT);
}

scene_status scene_command(scene_model* m, int input, double value) {
  if (input < 0 || input >= INPUTS || !isfinite(value)) return SCENE_BAD_ARGUMENT;
  if (!takes_commands[input]) return SCENE_BAD_ARGUMENT;
  m->command[input] = fmin(maximum_of[input], fmax(minimum_of[input], value));
  m->is_commanded[input] = 1;
  m->now.silence[input] = 0.0;
  return SCENE_OK;
}

/* Commands act, and the events that they or the motion have led to. */
static void vs_act(scene_model* m) {
  if (m->status == SCENE_OK) m->status = vs_apply_commands(m);
  if (m->status == SCENE_OK) m->status = vs_apply_events(m);
}

/* Moves on to the goal, or to the last state from which the motion goes on. */
static scene_status vs_reach_goal(scene_model* m) {
  double left = (m->now.goal - m->now.time) + (m->now.goal_rest - m->now.time_rest);
  int steps;
  vs_act(m);
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
    if (left > 0.0)
      vs_act(m);
    else if (m->status == SCENE_OK)
      m->status = vs_apply_events(m);
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

scene_status scene_read(scene_model* m, scene_sample* sample) {
  scene_series* const it = &m->series[m->present];
  int i, p;
  vs_act(m);
  if (!vs_is_begun(m) && !vs_begin_here(m, 1.0 / 1024.0) && m->status == SCENE_OK) {
    m->status = SCENE_SINGULAR;
  }
  if (it->order < 1) vs_extend(it);
  if (!vs_is_finite(it) && m->status == SCENE_OK) m->status = SCENE_NOT_FINITE;
  vs_at_once(it, 0);
  vs_reaction(it, sample->reaction_torque);
  sample->time = m->now.time;
  for (i = 0; i < S; ++i) {
    sample->angle[i] = m->now.angle[i];
    sample->velocity[i] = m->now.velocity[i];
    sample->acceleration[i] = m->now.acceleration[i];
    sample->applied_torque[i] = it->row[torque_row[i]][0];
    sample->reaction_torque_rate[i] = vs_reaction_rate(it, i);
  }
  for (p = 0; p < CONSTRAINTS; ++p) {
    sample->residual[p] = vs_residual(it, p);
    sample->multiplier[p] = it->row[TOLD_MULTIPLIER + p][0];
  }
  for (i = 0; i < HOLDS; ++i) {
    sample->mode[i] = m->now.told[i];
    sample->torque[i] = vs_transmits(m, it, i);
    sample->slip[i] = it->row[slip_row[i]][0];
    sample->reserve[i] = vs_reserve(m, it, i);
    sample->heat[i] = m->now.heat[i];
  }
  for (i = 0; i < STATES; ++i) sample->state[i] = m->now.input[state_input[i]].start;
  for (i = 0; i < VARIABLES; ++i) sample->variable[i] = m->now.input[variable_input[i]].start;
  return m->status;
}

double scene_time(const scene_model* m) {
  return m->now.time;
}

const char* scene_status_text(scene_status status) {
  return vs_status_text(status);
}
