// The controller's interface of an emitted program.
#include <cctype>

#include "emit_c/c_text.h"

namespace variator_sim {

const char* const kHeaderTypes = R"c(
typedef enum {
  SCENE_OK = 0,
  SCENE_BAD_ARGUMENT,   /* a time step that is negative or not finite, an input there is not */
  SCENE_SINGULAR,       /* the constraints' derivatives by the accelerations have lost rank */
  SCENE_NOT_CONVERGED,  /* no state on the constraints was found */
  SCENE_NOT_FINITE,     /* a value is not finite here, or has no power series (sqrt(x) at x = 0) */
  SCENE_TOO_MANY_STEPS, /* SCENE_MOST_STEPS parts of a step, or parts below the resolution of time */
  SCENE_CHATTERING,     /* a formula jumps where the motion turns back at once: no branch goes on */
  SCENE_NO_MOTION,      /* a jump leads to no state on the constraints */
  SCENE_INCONSISTENT    /* the first commands contradict the scene's initial values */
} scene_status;

/* All there is to see at one instant. Torques are generalized: positive ones accelerate. */
typedef struct {
  double time;                                   /* s */
  double angle[SCENE_SHAFTS];                    /* rad */
  double velocity[SCENE_SHAFTS];                 /* rad/s */
  double acceleration[SCENE_SHAFTS];             /* rad/s^2 */
  double applied_torque[SCENE_SHAFTS];           /* N m */
  double reaction_torque[SCENE_SHAFTS];          /* N m, of the constraints */
  double reaction_torque_rate[SCENE_SHAFTS];     /* N m/s */
  double residual[SCENE_CONSTRAINTS + 1];        /* what is left of the constraint, its own unit */
  double multiplier[SCENE_CONSTRAINTS + 1];      /* Lambda of R' = C' Lambda; of gauss, R = C' lambda */
} scene_sample;

/* The rest is private; its place is here for a model to need no memory but its own. */
typedef struct {
  int form;
  double start, target, slope, inverse_tau, linear, age, end;
} scene_signal;

/* All that the motion goes on from: a copy of it is a state to come back to. */
typedef struct {
  double time, time_rest, goal, goal_rest;
  double angle[SCENE_SHAFTS];
  double velocity[SCENE_SHAFTS];
  double acceleration[SCENE_SHAFTS];
  double multiplier[SCENE_CONSTRAINTS + 1];
  double reaction[SCENE_SHAFTS]; /* at the start */
  scene_signal input[SCENE_INPUTS + 1];
  double silence[SCENE_INPUTS + 1]; /* s since the last command; -1: there was none */
} scene_state;

typedef struct {
  scene_state now;
  double command[SCENE_INPUTS + 1];
  int is_commanded[SCENE_INPUTS + 1];
  int has_moved;
  scene_status status;
  double unit, usual;
  int order, crossings;
  double row[SCENE_ROWS][SCENE_ORDER + 2]; /* coefficients of every formula */
  double kept[SCENE_ROWS];
  int branch[SCENE_BRANCHES];
  double piece[SCENE_PIECES];
  double matrix[SCENE_SHAFTS + SCENE_CONSTRAINTS][SCENE_SHAFTS + SCENE_CONSTRAINTS];
  double scale[SCENE_SHAFTS + SCENE_CONSTRAINTS];
  int place[SCENE_SHAFTS + SCENE_CONSTRAINTS];
  double length[SCENE_CONSTRAINTS + 1];
  double longest[SCENE_CONSTRAINTS + 1]; /* that a row of C has been, squared */
} scene_model;
)c";

const char* const kHeaderFunctions = R"c(
/* None of these allocates, locks, reads a clock or keeps anything outside of the model. */

/* Time 0, the scene's initial state with consistent accelerations. */
void scene_init(scene_model *model);
/* A command at the present: it acts from here on, by the input's hold. Those of one present act
   together; of two to one input the last counts. Values are clamped to the input's limits; those
   that are not finite are refused. At time 0 a zero_order command sets the initial value. */
scene_status scene_command(scene_model *model, int input, double value);
/* Moves on by dt s. After anything but SCENE_OK the model stays at its last good state and says
   the same until scene_init. */
scene_status scene_step(scene_model *model, double dt);
/* The same up to a time, s; nothing happens where that is over. */
scene_status scene_advance_to(scene_model *model, double time);
/* The present, after its commands. */
scene_status scene_read(scene_model *model, scene_sample *sample);
/* The present, s. */
double scene_time(const scene_model *model);
/* A status as a word. */
const char *scene_status_text(scene_status status);
/* Names, as the scene has them; of inputs the topic. */
extern const char *const scene_shaft_name[SCENE_SHAFTS];
extern const char *const scene_constraint_name[SCENE_CONSTRAINTS + 1];
extern const char *const scene_input_name[SCENE_INPUTS + 1];
)c";

const char* const kInterfaceCode = R"c(
/* ---- Commands ---- */

/* The accelerations at time 0, after commands have set the first inputs. */
static scene_status start(scene_model *m)
{
  double lambda[K + 1] = {0.0};
  double given_values[S];
  scene_status status;
  int i;
  enter_inputs(m, 1.0, 0);
  for (i = 0; i < S; ++i) given_values[i] = m->now.velocity[i];
  status = project_velocities(m);
  for (i = 0; i < S && !MAY_PROJECT; ++i) {
    const double moved = fabs(m->now.velocity[i] - given_values[i]);
    if (!(moved <= 1e-9 * fmax(1.0, fabs(given_values[i])))) return SCENE_INCONSISTENT;
  }
  if (status != SCENE_OK) return status;
  if (IS_CLASSICAL) return settle_accelerations(m);
  if (!HAS_GIVEN_ACCELERATIONS) return find_least_reaction(m, lambda, 0, 0.0, 50);
  for (i = 0; i < S; ++i) given_values[i] = m->now.acceleration[i];
  status = settle_accelerations(m);
  for (i = 0; i < S && !MAY_PROJECT; ++i) {
    const double moved = fabs(m->now.acceleration[i] - given_values[i]);
    if (!(moved <= 1e-9 * fmax(1.0, fabs(given_values[i])))) return SCENE_INCONSISTENT;
  }
  return status;
}

static scene_status apply_commands(scene_model *m)
{
  const scene_state before = m->now;
  double u[INPUTS + 1], du[INPUTS + 1], dQ[S];
  scene_status status = SCENE_OK;
  int jumps = 0;
  int is_new = 0;
  int i;
  for (i = 0; i < INPUTS; ++i) {
    is_new = is_new || (m->is_commanded[i] && m->command[i] != m->now.input[i].target);
    u[i] = input_value(&m->now.input[i]);
  }
  if (!is_new) {
    for (i = 0; i < INPUTS; ++i) m->is_commanded[i] = 0;
    return SCENE_OK;
  }
  enter_inputs(m, 1.0, 0);
  enter_state(m);
  for (i = 0; i < S; ++i) dQ[i] = -m->row[torque_row[i]][0];
  for (i = 0; i < INPUTS; ++i) {
    if (m->is_commanded[i] && m->command[i] != m->now.input[i].target) {
      scene_signal *const s = &m->now.input[i];
      jumps = command_signal(s, hold_of[i], parameter_of[i], m->command[i]) || jumps;
    }
    m->is_commanded[i] = 0;
    du[i] = input_value(&m->now.input[i]) - u[i];
  }
  if (!m->has_moved) {
    status = start(m);
  } else if (jumps && IS_CLASSICAL) {
    enter_inputs(m, 1.0, 0);
    status = follow_least_reaction(m);
  } else if (jumps) {
    enter_inputs(m, 1.0, 0);
    enter_state(m);
    for (i = 0; i < S; ++i) dQ[i] += m->row[torque_row[i]][0];
    status = jump(m, u, du, dQ, 0);
    if (status == SCENE_OK && HAS_RESIDUAL) {
      enter_inputs(m, 1.0, 0);
      status = settle_accelerations(m);
    }
  }
  if (status != SCENE_OK) m->now = before;
  m->crossings = 0;
  return status;
}

/* Inputs whose command is overdue fall back. */
static void apply_timeouts(scene_model *m)
{
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

void scene_init(scene_model *m)
{
  int i;
  memset(m, 0, sizeof *m);
  for (i = 0; i < CONSTANTS; ++i) m->row[constant_row[i]][0] = constant_value[i];
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = initial_angle[i];
    m->now.velocity[i] = initial_velocity[i];
    m->now.acceleration[i] = initial_acceleration[i];
  }
  for (i = 0; i < K; ++i) m->now.multiplier[i] = initial_multiplier[i];
  for (i = 0; i < INPUTS; ++i) {
    hold_constant(&m->now.input[i], initial_input[i]);
    m->now.silence[i] = -1.0;
  }
}

scene_status scene_command(scene_model *m, int input, double value)
{
  if (input < 0 || input >= INPUTS || !isfinite(value)) return SCENE_BAD_ARGUMENT;
  m->command[input] = fmin(maximum_of[input], fmax(minimum_of[input], value));
  m->is_commanded[input] = 1;
  m->now.silence[input] = 0.0;
  return SCENE_OK;
}

/* To the goal, or to where nothing leads any further. */
static scene_status reach_goal(scene_model *m)
{
  double left = (m->now.goal - m->now.time) + (m->now.goal_rest - m->now.time_rest);
  int steps;
  if (m->status == SCENE_OK) m->status = apply_commands(m);
  for (steps = 0; m->status == SCENE_OK && left > 0.0; ++steps) {
    double made = 0.0;
    if (steps == SCENE_MOST_STEPS) {
      m->status = SCENE_TOO_MANY_STEPS;
      break;
    }
    if (!m->has_moved && HAS_NEUTRAL) note_reaction(m);
    m->has_moved = 1;
    m->status = make_step(m, left, &made);
    apply_timeouts(m);
    left = (m->now.goal - m->now.time) + (m->now.goal_rest - m->now.time_rest);
    /* At the goal itself they wait for what else comes there. */
    if (m->status == SCENE_OK && left > 0.0) m->status = apply_commands(m);
  }
  return m->status;
}

scene_status scene_step(scene_model *m, double dt)
{
  double sum, rest;
  if (!isfinite(dt) || dt < 0.0) return SCENE_BAD_ARGUMENT;
  rest = dt + m->now.goal_rest;
  sum = m->now.goal + rest;
  m->now.goal_rest = rest - (sum - m->now.goal);
  m->now.goal = sum;
  return reach_goal(m);
}

scene_status scene_advance_to(scene_model *m, double time)
{
  if (!isfinite(time)) return SCENE_BAD_ARGUMENT;
  if (time <= m->now.goal) return m->status;
  m->now.goal = time;
  m->now.goal_rest = 0.0;
  return reach_goal(m);
}

scene_status scene_read(scene_model *m, scene_sample *sample)
{
  double R[S];
  int i, p;
  if (m->status == SCENE_OK) m->status = apply_commands(m);
  enter_inputs(m, 1.0, 0);
  if (IS_CLASSICAL && m->status == SCENE_OK) m->status = settle_accelerations(m);
  if (!begin_series(m, 1.0 / 1024.0)) {
    if (m->status == SCENE_OK) m->status = SCENE_SINGULAR;
  } else if (!extend_series(m) && m->status == SCENE_OK) {
    m->status = SCENE_NOT_FINITE;
  }
  at_once(m->row, m->branch, m->piece, 0);
  reaction(m, R);
  sample->time = m->now.time;
  for (i = 0; i < S; ++i) {
    double rate = 0.0;
    sample->angle[i] = m->now.angle[i];
    sample->velocity[i] = m->now.velocity[i];
    sample->acceleration[i] = m->now.acceleration[i];
    sample->applied_torque[i] = m->row[torque_row[i]][0];
    sample->reaction_torque[i] = R[i];
    /* R' = C' Lambda + 1/2 J' omega J^-1 R; of gauss C' lambda' + (dC/dt)' lambda */
    for (p = 0; p < K; ++p) {
      const double *const C = m->row[entry_row[S * p + i]];
      const double *const l = m->row[MULTIPLIER + p];
      rate += IS_CLASSICAL ? (C[0] * l[1] + C[1] * l[0]) / m->unit : C[0] * l[0];
    }
    if (!IS_CLASSICAL && INERTIA_VARIES) {
      rate += m->row[connection_row[i]][0] * m->row[PULL + i][0];
    }
    sample->reaction_torque_rate[i] = rate;
  }
  for (p = 0; p < K; ++p) {
    double left = m->row[(order_of[p] == 1 ? velocity_residual_row : residual_row)[p]][0];
    if (order_of[p] == 3) {
      for (i = 0; i < S; ++i) {
        left += m->row[entry_row[S * p + i]][0] * m->row[ACCELERATION + i][1] / m->unit;
      }
    }
    sample->residual[p] = left;
    sample->multiplier[p] = m->row[MULTIPLIER + p][0];
  }
  return m->status;
}

double scene_time(const scene_model *m)
{
  return m->now.time;
}

const char *scene_status_text(scene_status status)
{
  static const char *const texts[] = {
      "ok", "bad argument", "singular constraint", "no state on the constraints was found",
      "a value is not finite or has no power series", "too many steps", "chattering",
      "a jump leads to no state on the constraints",
      "the first commands contradict the initial values"};
  return status >= SCENE_OK && status <= SCENE_INCONSISTENT ? texts[status] : "?";
}
)c";

std::string harmless(std::string text) {
  for (char& c : text) {
    const bool is_plain = c >= ' ' && c <= '~';
    // (A trigraph begins with question marks, and one of them is a backslash.)
    if (!is_plain || c == '*' || c == '\\' || c == '"' || c == '?') c = '_';
  }
  return text;
}

std::string inCapitals(std::string name) {
  for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return name;
}

void replaceAll(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
}

std::string withName(std::string text, const std::string& name) {
  replaceAll(text, "scene_", name + "_");
  replaceAll(text, "SCENE_", inCapitals(name) + "_");
  return text;
}

}  // namespace variator_sim
