/* A scene as the slave of a co-simulation, below the interfaces of FMI 2 and 3.
 *
 * Steps are made ahead of the communication point, which lies in the last one: values are those
 * inside that step, and inputs cut it, as the simulation of the package does. So no distance of
 * communication points changes one bit of the motion.
 *
 * The includer defines, beside the scene:
 *     FMU_STARTS, FMU_PARAMETERS, FMU_COMMANDS, FMU_ROWS   numbers of start values, of parameters
 *                      with them, of commanded inputs, and of rows
 *     fmu_parameter    angles, velocities, states, variables, and numbers of the scene
 *     fmu_allowed      what is allowed for these numbers
 *     fmu_number       the numbers of vs_numbers, from places FMU_CONSTANTS, .. on; those at
 *                      fmu_dependent follow from the parameters: number_j = factor_j prod p_i^e_ji
 *     fmu_operation    `resolved`, without its factors, which are numbers, too
 *     fmu_command      the scene's input of each commanded one
 *     fmu_row          rows of further outputs
 *     FMU_IS_SETTLED   1: initial_.. are a state to go on from; 0: the motion begins by itself
 *     given_acceleration   the scene's, or those of the state
 *     fmu_most_steps   steps in a second of the motion
 *     fmu_token        the instantiation token */

enum {
  FMU_VALUES = 1 + 6 * S + 2 * CONSTRAINTS + 4 * HOLDS + STATES + VARIABLES + FMU_ROWS,
  /* Value references: numbers in this order, with the time first; modes behind them. */
  FMU_FIRST_PARAMETER = FMU_VALUES,
  FMU_FIRST_COMMAND = FMU_FIRST_PARAMETER + FMU_PARAMETERS,
  FMU_FIRST_MODE = FMU_FIRST_COMMAND + FMU_COMMANDS,
  FMU_REFERENCES = FMU_FIRST_MODE + HOLDS
};
enum {
  FMU_INSTANTIATED = 1,
  FMU_INITIALIZING = 2,
  FMU_STEPPING = 4,
  FMU_EVENT = 8,
  FMU_ENDED = 16
};

/* All that a copy of an instance's state has. */
typedef struct {
  vs_host host;
  vs_numbers numbers; /* its arrays are `number`, `operation`, and constant ones */
  double number[FMU_NUMBERS];
  struct SeriesOperation operation[RESOLVED + 1];
  int phase;
  scene_status status;
  double start, stop;       /* s */
  double time;              /* the communication point, s */
  double begin, begin_rest; /* the start of the last step, s */
  int has_step, made_since;
  int is_start, is_begun;
  int is_event, is_told; /* at the end of the last step */
  double window;         /* s, from where on `made` counts steps */
  long made;
  long long instant, interval; /* ns: the last change of inputs, and since the one before */
  double expected;             /* s, the next change */
  double origin;               /* s, that ages of signals count to */
  scene_signal signal[SCENE_INPUTS + 1];
  double target[SCENE_INPUTS + 1], commanded_at[SCENE_INPUTS + 1];
  int is_new[SCENE_INPUTS + 1];
  double given[FMU_COMMANDS + 1], parameter[FMU_PARAMETERS + 1];
  int is_seen, mode[SCENE_HOLDS + 1];
  double value[FMU_VALUES];
  vs_exchange it; /* its arrays are those below */
  double state[3 * SCENE_SHAFTS], reaction[SCENE_SHAFTS];
  double multiplier[SCENE_CONSTRAINTS + SCENE_HOLDS + 1];
  double longest[SCENE_CONSTRAINTS + SCENE_HOLDS + 1];
  vs_exchanged_signal input[SCENE_INPUTS + 1];
  vs_exchanged_hold hold[SCENE_HOLDS + 1];
  int armed[SCENE_EVENTS + 1];
} fmu_motion;

static double fmu_resolution(double time) {
  return 4.0 * DBL_EPSILON * fabs(time);
}

/* Lets the exchanged arrays and the numbers be those of this copy. */
static void fmu_aim(fmu_motion* m) {
  const double* const number = m->number;
  /* (In the order of vs_numbers, most of whose names the scene's text defines.) */
  const vs_numbers numbers = {number[0],
                              number[1],
                              number[2],
                              number[3],
                              number + FMU_CONSTANTS,
                              number + FMU_COUPLING,
                              number + FMU_CONSTANT_VALUE,
                              fmu_passage_points,
                              fmu_table,
                              fmu_table_of_two,
                              m->operation,
                              number + FMU_RESTITUTION,
                              number + FMU_CLOSES_BELOW,
                              number}; /* (no delays) */
  m->numbers = numbers;
  m->host.model.series[0].numbers = m->host.model.series[1].numbers = &m->numbers;
  m->host.seen.numbers = &m->numbers;
  m->it.state = m->state;
  m->it.multiplier = m->multiplier;
  m->it.reaction = m->reaction;
  m->it.longest = m->longest;
  m->it.input = m->input;
  m->it.hold = m->hold;
  m->it.armed = m->armed;
  m->it.events = m->host.model.event_of;
}

/* ---- Starts ---- */

static void fmu_describe_inputs(fmu_motion* m) {
  int i;
  for (i = 0; i < INPUTS; ++i) vs_describe_signal(&m->signal[i], &m->input[i]);
}

static void fmu_command_signal(fmu_motion* m, int i) {
  if (m->is_new[i] && m->signal[i].target != m->target[i])
    (void)vs_command_signal(&m->signal[i], fmu_hold_of[i], m->number[FMU_PARAMETER_OF + i],
                            m->target[i]);
}

/* True where no start value is another one than the scene's, nor the time. */
static int fmu_is_as_written(const fmu_motion* m) {
  int i, is_same = m->start == 0.0;
  for (i = 0; i < FMU_PARAMETERS; ++i) is_same &= m->parameter[i] == fmu_parameter[i];
  for (i = 0; i < INPUTS; ++i) is_same &= !m->is_new[i] || m->target[i] == fmu_initial_input[i];
  return is_same;
}

/* Computes the program's numbers from the parameters. */
static void fmu_enter_parameters(fmu_motion* m) {
  int d, k, n;
  memcpy(m->number, fmu_number, sizeof m->number);
  memcpy(m->operation, fmu_operation, sizeof m->operation);
  for (d = 0; d < FMU_DEPENDENTS; ++d) {
    double value = fmu_factor[d];
    for (k = fmu_power_begin[d]; k < fmu_power_begin[d + 1]; ++k) {
      const double base = m->parameter[FMU_STARTS + fmu_power_of[k]];
      for (n = 0; n < fmu_power[k]; ++n) value *= base;
      for (n = 0; n > fmu_power[k]; --n) value /= base;
    }
    m->number[fmu_dependent[d]] = value;
  }
  /* (The order is that for the scene's own tolerance.) */
  if (m->number[0] != fmu_number[0])
    m->number[3] = pow(fmax(m->number[0], 1e-16), 1.0 / SCENE_ORDER);
  for (n = 0; n < RESOLVED; ++n) {
    m->operation[n].f = m->number[FMU_FACTORS + n];
    m->operation[n].g = m->number[FMU_FACTORS + RESOLVED + n];
  }
}

static void fmu_start(fmu_motion* m) {
  const int is_settled = FMU_IS_SETTLED && fmu_is_as_written(m);
  int i;
  memset(&m->host, 0, sizeof m->host);
  fmu_enter_parameters(m);
  fmu_aim(m);
  vs_host_prepare(&m->host);
  memset(m->state, 0, sizeof m->state);
  memset(m->multiplier, 0, sizeof m->multiplier);
  memset(m->longest, 0, sizeof m->longest);
  memset(m->reaction, 0, sizeof m->reaction);
  for (i = 0; i < 2 * S; ++i) m->state[i] = m->parameter[i];
  for (i = 0; i < S; ++i) {
    m->state[2 * S + i] = given_acceleration[i]; /* or those that the search begins at */
    if (!is_settled) continue;
    m->state[2 * S + i] = initial_acceleration[i];
    m->state[i] = initial_angle[i];
    m->state[S + i] = initial_velocity[i]; /* moved onto the constraints, where the scene lets it */
    m->reaction[i] = initial_reaction[i];
  }
  for (i = 0; i < CONSTRAINTS && is_settled; ++i) {
    m->multiplier[i] = initial_multiplier[i];
    m->longest[i] = initial_longest[i];
  }
  for (i = 0; i < INPUTS; ++i) vs_hold_constant(&m->signal[i], fmu_initial_input[i]);
  for (i = 0; i < STATES; ++i)
    vs_hold_constant(&m->signal[state_input[i]], m->parameter[2 * S + i]);
  for (i = 0; i < VARIABLES; ++i)
    vs_hold_constant(&m->signal[variable_input[i]], m->parameter[2 * S + STATES + i]);
  for (i = 0; i < INPUTS; ++i) fmu_command_signal(m, i);
  fmu_describe_inputs(m);
  m->it.time = m->begin = m->start;
  m->it.time_rest = m->begin_rest = 0.0;
  m->it.usual = 1e-3; /* (The length of a first step is found from a series in this unit.) */
  m->it.begin = is_settled ? 0 : 1;
  m->it.are_given = HAS_GIVEN_ACCELERATIONS;
  m->it.may_move = MAY_PROJECT;
  m->status = (scene_status)vs_host_begin(&m->host, &m->it);
  m->is_begun = 1;
  m->is_seen = m->has_step = m->made_since = 0;
}

static void fmu_set_times(fmu_motion* m, double start, double stop) {
  m->stop = stop;
  m->start = m->time = m->origin = m->window = start;
  m->is_begun = 0;
}

static void fmu_reset(fmu_motion* m) {
  int i;
  memset(m, 0, sizeof *m);
  fmu_aim(m);
  m->phase = FMU_INSTANTIATED;
  m->is_start = 1;
  m->instant = -1;
  m->expected = m->stop = INFINITY;
  for (i = 0; i < FMU_PARAMETERS; ++i) m->parameter[i] = fmu_parameter[i];
  for (i = 0; i < FMU_COMMANDS; ++i) m->given[i] = fmu_initial_input[fmu_command[i]];
  for (i = 0; i < INPUTS; ++i) m->commanded_at[i] = INFINITY;
}

/* ---- Steps ---- */

/* How far a time lies behind the end of the last step, and behind its start, s. */
static double fmu_beyond(const fmu_motion* m, double time) {
  return (time - m->it.time) - m->it.time_rest;
}
static double fmu_inside(const fmu_motion* m) {
  return (m->time - m->begin) - m->begin_rest;
}

static void fmu_make_step(fmu_motion* m) {
  enum { MOST_BETWEEN = 64 }; /* steps between two beginnings, as the simulation has them */
  const double expected = fmu_beyond(m, m->expected);
  double left = fmin(m->number[2], 1e6);
  if (m->it.time + m->it.time_rest - m->window >= 1.0) {
    m->window = m->it.time + m->it.time_rest;
    m->made = 0;
  }
  if (++m->made > fmu_most_steps) {
    m->status = SCENE_TOO_MANY_STEPS;
    return;
  }
  if (m->made_since >= MOST_BETWEEN) {
    m->made_since = 0;
    vs_host_leave(&m->host, &m->it);
    m->it.begin = 0;
    (void)vs_host_begin(&m->host, &m->it);
  }
  if (expected > 2.0 * fmu_resolution(m->it.time + m->it.time_rest)) left = fmin(left, expected);
  m->begin = m->it.time;
  m->begin_rest = m->it.time_rest;
  m->status = (scene_status)vs_host_step(&m->host, left, &m->it);
  m->has_step = m->status == SCENE_OK;
  m->is_event = m->has_step && (m->it.is_event || m->it.event_count > 0);
  m->is_told = 0;
  ++m->made_since;
}

/* Moves to `end`, or to an event before it. */
static void fmu_move(fmu_motion* m, double end, int stops) {
  m->is_seen = 0;
  while (m->status == SCENE_OK && fmu_beyond(m, end) > 0.0) {
    if (stops && m->is_event && !m->is_told && m->it.time > m->time) {
      m->time = m->it.time;
      return;
    }
    fmu_make_step(m);
  }
  m->time = m->status == SCENE_OK ? end : fmax(m->time, m->it.time);
}

/* ---- Inputs ---- */

/* Two equal intervals between changes of inputs let a third be expected: a step ends there, and
 * need not be cut. Instants are whole nanoseconds; others have no rhythm. */
static void fmu_note_rhythm(fmu_motion* m) {
  const double last = 4503599.0; /* s: up to 2^52 ns a double holds halves of ns, too */
  const int is_countable = m->time >= 0.0 && m->time < last;
  long long instant = is_countable ? llround(m->time * 1e9) : -1, interval;
  if ((double)instant / 1e9 != m->time) instant = -1;
  if (instant == m->instant) return;
  interval = instant > m->instant && m->instant >= 0 ? instant - m->instant : 0;
  m->expected =
      interval > 0 && interval == m->interval ? (double)(instant + interval) / 1e9 : INFINITY;
  m->interval = interval;
  m->instant = instant;
}

static void fmu_change_inputs(fmu_motion* m) {
  double moved;
  int i;
  fmu_note_rhythm(m);
  if (m->has_step) m->status = (scene_status)vs_host_cut(&m->host, fmu_inside(m));
  m->has_step = m->is_event = 0;
  if (m->status != SCENE_OK) return;
  vs_host_leave(&m->host, &m->it);
  moved = m->time - m->origin;
  m->origin = m->time;
  for (i = 0; i < INPUTS; ++i) {
    scene_signal* const it = &m->signal[i];
    if (it->end - it->age <= moved) vs_hold_constant(it, it->target);
    it->age += moved;
    fmu_command_signal(m, i);
  }
  fmu_describe_inputs(m);
  m->status = (scene_status)vs_host_change(&m->host, &m->it);
  if (m->status == SCENE_OK) vs_host_leave(&m->host, &m->it);
}

/* Lets the commands of the present act, all of them together. */
static void fmu_settle(fmu_motion* m) {
  int i, any = 0;
  if (!m->is_begun) fmu_start(m);
  if (m->status != SCENE_OK) return;
  for (i = 0; i < INPUTS; ++i) any = any || (m->is_new[i] && m->signal[i].target != m->target[i]);
  if (any && !m->is_start) {
    m->is_seen = 0;
    fmu_change_inputs(m);
  }
  for (i = 0; i < INPUTS && !m->is_start; ++i) m->is_new[i] = 0;
}

static void fmu_command_input(fmu_motion* m, int command, double value) {
  const int i = fmu_command[command];
  m->given[command] = value;
  m->target[i] = fmin(fmu_maximum_of[i], fmax(fmu_minimum_of[i], value));
  m->is_new[i] = 1;
  m->commanded_at[i] = m->time;
  if (m->is_start) m->is_begun = 0;
}

static double fmu_timeout(const fmu_motion* m, int i) {
  return fmu_timeout_of[i] > 0.0 ? m->commanded_at[i] + fmu_timeout_of[i] : INFINITY;
}

/* Inputs whose command is overdue fall back. */
static void fmu_apply_timeouts(fmu_motion* m) {
  int i;
  for (i = 0; i < INPUTS; ++i) {
    if (fmu_timeout(m, i) > m->time + fmu_resolution(m->time)) continue;
    m->commanded_at[i] = INFINITY;
    if (!fmu_falls_to_zero[i]) continue;
    m->target[i] = fmin(fmu_maximum_of[i], fmax(fmu_minimum_of[i], 0.0));
    m->is_new[i] = 1;
  }
}

/* Up to `end`, or, where it may, to the first event before it. */
static void fmu_advance(fmu_motion* m, double end, int stops) {
  int i;
  fmu_settle(m);
  m->is_start = 0;
  for (i = 0; i < INPUTS; ++i) m->is_new[i] = 0;
  while (m->status == SCENE_OK) {
    double timeout = INFINITY, goal;
    for (i = 0; i < INPUTS; ++i) timeout = fmin(timeout, fmu_timeout(m, i));
    goal = timeout <= end ? fmax(timeout, m->time) : end;
    fmu_move(m, goal, stops);
    if (m->status != SCENE_OK || m->time < goal || timeout > end) return;
    fmu_apply_timeouts(m);
    if (timeout < end) fmu_settle(m);
  }
}

/* ---- Values ---- */

/* Writes all values of the communication point. */
static void fmu_look(fmu_motion* m) {
  vs_seen_hold hold[MOST_HOLDS + 1];
  double on_shaft[MOST_HOLDS * MOST_SHAFTS + 1], input[3 * MOST_INPUTS + 3];
  double covariant_rate[MOST_SHAFTS];
  double* to = m->value;
  vs_seen seen;
  scene_status status;
  int i;
  fmu_settle(m);
  if (m->is_seen) return;
  *to++ = m->time;
  seen.angle = to;
  seen.velocity = to + S;
  seen.acceleration = to + 2 * S;
  seen.torque = to + 3 * S;
  seen.reaction = to + 4 * S;
  seen.reaction_rate = to + 5 * S;
  seen.covariant_rate = covariant_rate;
  seen.residual = to += 6 * S;
  seen.multiplier = to += CONSTRAINTS;
  to += CONSTRAINTS;
  seen.hold = hold;
  seen.on_shaft = on_shaft;
  seen.input = input;
  seen.jerk = 0;
  status = (scene_status)vs_host_see(&m->host, fmu_inside(m), &seen);
  if (m->status == SCENE_OK) m->status = status;
  for (i = 0; i < HOLDS; ++i) {
    m->mode[i] = hold[i].mode;
    *to++ = hold[i].torque;
    *to++ = hold[i].slip;
    *to++ = hold[i].reserve;
    *to++ = hold[i].heat;
  }
  for (i = 0; i < STATES; ++i) *to++ = input[3 * state_input[i]];
  for (i = 0; i < VARIABLES; ++i) *to++ = input[3 * variable_input[i]];
  for (i = 0; i < FMU_ROWS; ++i) *to++ = m->host.seen.row[fmu_row[i]][0];
  m->is_seen = 1;
}

/* False for a reference to no number. */
static int fmu_get(const fmu_motion* m, unsigned reference, double* value) {
  if (reference >= FMU_FIRST_MODE) return 0;
  *value = reference < FMU_FIRST_PARAMETER ? m->value[reference]
           : reference < FMU_FIRST_COMMAND ? m->parameter[reference - FMU_FIRST_PARAMETER]
                                           : m->given[reference - FMU_FIRST_COMMAND];
  return 1;
}

/* False for a reference to no input, nor to a parameter before the motion. */
static int fmu_set(fmu_motion* m, unsigned reference, double value) {
  if (reference < FMU_FIRST_PARAMETER || reference >= FMU_FIRST_MODE) return 0;
  if (reference >= FMU_FIRST_COMMAND) {
    fmu_command_input(m, (int)(reference - FMU_FIRST_COMMAND), value);
    return 1;
  }
  if (!(m->phase & (FMU_INSTANTIATED | FMU_INITIALIZING))) return 0;
  m->parameter[reference - FMU_FIRST_PARAMETER] = value;
  m->is_begun = 0;
  return 1;
}
