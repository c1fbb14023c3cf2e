// Inputs, matrices and series of every emitted program, with the equations of
// dynamics/motion_series.h.
#include "emit_c/c_text.h"

namespace variator_sim {

const char* const kInputCode = R"c(
/* ---- Commanded inputs: a closed form between two events, age s after the last command. ---- */

enum { ZERO_ORDER, FIRST_ORDER_LAG, RATE_LIMIT, FIRST_ORDER_HOLD, SECOND_ORDER_LAG };
enum { CONSTANT, RAMP, EXPONENTIAL, CRITICAL };

static double input_value(const scene_signal *s)
{
  const double x = s->age * s->inverse_tau;
  if (s->form == RAMP) {
    const double u = s->start + s->slope * s->age;
    if (s->age >= s->end) return s->target;
    return s->slope > 0.0 ? fmin(u, s->target) : fmax(u, s->target);
  }
  if (s->form == EXPONENTIAL) return s->start - (s->target - s->start) * expm1(-x);
  if (s->form == CRITICAL) {
    return s->start + (s->start - s->target) * expm1(-x) + s->linear * x * exp(-x);
  }
  return s->start;
}

static double input_rate(const scene_signal *s)
{
  const double x = s->age * s->inverse_tau;
  const double a = s->start - s->target;
  if (s->form == RAMP) return s->slope;
  if (s->form == EXPONENTIAL) return -a * s->inverse_tau * exp(-x);
  if (s->form == CRITICAL) return (s->linear - a - s->linear * x) * s->inverse_tau * exp(-x);
  return 0.0;
}

static void hold_constant(scene_signal *s, double value)
{
  s->form = CONSTANT;
  s->start = s->target = value;
  s->slope = s->inverse_tau = s->linear = s->age = 0.0;
  s->end = INFINITY;
}

/* True when the value itself jumps. */
static int command_signal(scene_signal *s, int hold, double parameter, double target)
{
  const double settled = 50.0; /* time constants: exp(-50) of the way is less than rounding */
  const double present = input_value(s);
  const double rate = input_rate(s);
  hold_constant(s, present);
  s->target = target;
  if (hold == SECOND_ORDER_LAG) {
    if (target == present && rate == 0.0) return 0;
    s->form = CRITICAL;
    s->inverse_tau = 1.0 / parameter;
    s->linear = present - target + parameter * rate;
    s->end = settled * parameter;
    return 0;
  }
  if (target == present) return 0;
  if (hold == ZERO_ORDER) {
    hold_constant(s, target);
    return 1;
  }
  if (hold == FIRST_ORDER_LAG) {
    s->form = EXPONENTIAL;
    s->inverse_tau = 1.0 / parameter;
    s->end = settled * parameter;
    return 0;
  }
  s->form = RAMP;
  if (hold == RATE_LIMIT) {
    s->slope = target > present ? parameter : -parameter;
    s->end = (target - present) / s->slope;
  } else {
    s->slope = (target - present) / parameter;
    s->end = parameter;
  }
  return 0;
}

/* u up to `order`, in powers of (t - now) / unit */
static void expand_input(const scene_signal *s, double unit, int order, double *u)
{
  int n;
  for (n = 0; n <= order; ++n) u[n] = 0.0;
  u[0] = input_value(s);
  if (s->form == RAMP) u[1] = unit * s->slope;
  if (s->form == EXPONENTIAL || s->form == CRITICAL) {
    /* d^n/dx^n (a + b x) exp(-x) = (-1)^n (a + b x - n b) exp(-x) */
    const double x = s->age * s->inverse_tau;
    const double a = s->start - s->target;
    const double b = s->form == CRITICAL ? s->linear : 0.0;
    double factor = exp(-x);
    for (n = 1; n <= order; ++n) {
      factor *= -unit * s->inverse_tau / n;
      u[n] = (a + b * x - n * b) * factor;
    }
  }
}
)c";

const char* const kMatrixCode = R"c(
/* ---- State and formulas ---- */

/* Coefficients of inputs and their first and second rates, up to `order`. */
static void enter_inputs(scene_model *m, double unit, int order)
{
  double u[LENGTH + 2];
  int i, n;
  for (i = 0; i < INPUTS; ++i) {
    row *const r = m->row + INPUT + 3 * i;
    expand_input(&m->now.input[i], unit, order + 2, u);
    for (n = 0; n <= order; ++n) {
      r[0][n] = u[n];
      r[1][n] = (n + 1) * u[n + 1] / unit;
      r[2][n] = (n + 2) * (n + 1) * u[n + 2] / (unit * unit);
    }
  }
}

/* All formulas at the present state, with the inputs that were entered. */
static void enter_state(scene_model *m)
{
  int i;
  m->row[TIME][0] = m->now.time;
  for (i = 0; i < S; ++i) {
    m->row[ANGLE + i][0] = m->now.angle[i];
    m->row[VELOCITY + i][0] = m->now.velocity[i];
    m->row[ACCELERATION + i][0] = m->now.acceleration[i];
  }
  for (i = 0; i < K; ++i) m->row[MULTIPLIER + i][0] = m->now.multiplier[i];
  given(m->row, m->branch, m->piece, 0);
  accelerated(m->row, m->branch, m->piece, 0);
}

static double inertia(const scene_model *m, int i, int j)
{
  return i == j ? m->row[inertia_row[i]][0] : coupling[S * i + j];
}

/* J v */
static void apply_inertia(const scene_model *m, const double *v, double *y)
{
  int i, j;
  for (i = 0; i < S; ++i) {
    y[i] = 0.0;
    for (j = 0; j < S; ++j) y[i] += inertia(m, i, j) * v[j];
  }
}

/* ---- The matrix [J -C'; C 0]: jerks, projections, jumps and first accelerations solve it. ---- */

static int is_counted(int constraint, int low, int high)
{
  return order_of[constraint] >= low && order_of[constraint] <= high;
}

/* With the rows of the constraints of orders low to high, all formulas being those of the state.
   Eliminating the accelerations leaves C J^-1 C', whose pivots tell the rank. */
static int factor(scene_model *m, int low, int high)
{
  double (*const M)[SIZE] = m->matrix;
  double diagonal[SIZE];
  int i, j, p;
  for (i = 0; i < SIZE; ++i) {
    m->place[i] = i;
    m->scale[i] = 1.0;
    for (j = 0; j < SIZE; ++j) M[i][j] = 0.0;
    diagonal[i] = 0.0;
  }
  for (i = 0; i < S; ++i) {
    for (j = 0; j < S; ++j) M[i][j] = inertia(m, i, j);
  }
  for (p = 0; p < K; ++p) {
    if (!is_counted(p, low, high)) {
      M[S + p][S + p] = 1.0;
      continue;
    }
    for (i = 0; i < S; ++i) {
      M[S + p][i] = m->row[entry_row[S * p + i]][0];
      M[i][S + p] = -M[S + p][i];
    }
  }
  for (p = 0; p < SIZE; ++p) {
    if (p == S) {
      for (i = S; i < SIZE; ++i) diagonal[i] = M[i][i];
    }
    if (p >= S && !(M[p][p] > 1e-12 * diagonal[p])) return 0;
    for (i = p + 1; i < SIZE; ++i) {
      M[i][p] /= M[p][p];
      for (j = p + 1; j < SIZE; ++j) M[i][j] -= M[i][p] * M[p][j];
    }
  }
  for (i = S; i < SIZE; ++i) m->length[i - S] = diagonal[i];
  return 1;
}

/* The first `size` unknowns of what was factored; S of them are J alone. */
static void solve(const scene_model *m, int size, double *x)
{
  double b[SIZE] = {0.0};
  int i, j;
  for (i = 0; i < size; ++i) b[i] = m->scale[m->place[i]] * x[m->place[i]];
  for (i = 0; i < size; ++i) {
    for (j = 0; j < i; ++j) b[i] -= m->matrix[i][j] * b[j];
  }
  for (i = size - 1; i >= 0; --i) {
    for (j = i + 1; j < size; ++j) b[i] -= m->matrix[i][j] * b[j];
    b[i] /= m->matrix[i][i];
  }
  for (i = 0; i < size; ++i) x[i] = m->scale[i] * b[i];
}

/* Where psi is not linear in the accelerations: J less the sum of lambda d2psi/depsilon2 in the
   place of J, after `factor` has told rank and scale. */
static int factor_curved(scene_model *m, const double *lambda, int low, int high)
{
  double (*const M)[SIZE] = m->matrix;
  int i, j, p;
  if (!factor(m, low, high)) return 0;
  if (!IS_CURVED) return 1;
  at_once(m->row, m->branch, m->piece, 0);
  for (i = 0; i < S; ++i) {
    m->scale[i] = 1.0 / sqrt(inertia(m, i, i));
    for (j = 0; j < S; ++j) {
      M[i][j] = inertia(m, i, j);
      for (p = 0; p < K; ++p) {
        if (!is_counted(p, low, high)) continue;
        M[i][j] -= lambda[p] * m->row[curvature_row[S * S * p + S * i + j]][0];
      }
    }
  }
  for (p = 0; p < K; ++p) {
    const int is_in = is_counted(p, low, high);
    m->scale[S + p] = is_in ? 1.0 / sqrt(m->length[p]) : 1.0;
    for (j = 0; j < K; ++j) M[S + p][S + j] = p == j && !is_in ? 1.0 : 0.0;
    for (i = 0; i < S; ++i) {
      M[S + p][i] = is_in ? m->row[entry_row[S * p + i]][0] : 0.0;
      M[i][S + p] = -M[S + p][i];
    }
  }
  for (i = 0; i < SIZE; ++i) {
    for (j = 0; j < SIZE; ++j) M[i][j] *= m->scale[i] * m->scale[j];
  }
  for (p = 0; p < SIZE; ++p) {
    int best = p;
    for (i = p + 1; i < SIZE; ++i) {
      if (fabs(M[i][p]) > fabs(M[best][p])) best = i;
    }
    if (!(fabs(M[best][p]) > 1e-14)) return 0;
    i = m->place[p];
    m->place[p] = m->place[best];
    m->place[best] = i;
    for (j = 0; j < SIZE; ++j) {
      const double swapped = M[p][j];
      M[p][j] = M[best][j];
      M[best][j] = swapped;
    }
    for (i = p + 1; i < SIZE; ++i) {
      M[i][p] /= M[p][p];
      for (j = p + 1; j < SIZE; ++j) M[i][j] -= M[i][p] * M[p][j];
    }
  }
  return 1;
}

/* R = J epsilon + n - Q */
static void reaction(const scene_model *m, double *R)
{
  int i;
  apply_inertia(m, m->now.acceleration, R);
  for (i = 0; i < S; ++i) {
    R[i] += m->row[inertial_row[i]][0] - m->row[torque_row[i]][0];
  }
}
)c";

const char* const kResolutionCode = R"c(
static double evaluate(const double *c, int last, double theta)
{
  double sum = c[last];
  int n;
  for (n = last - 1; n >= 0; --n) sum = sum * theta + c[n];
  return sum;
}

/* True where all formulas are what their series say, up to theta. */
static int is_resolved(const scene_model *m, double theta)
{
  struct SeriesRange range[ROWS];
  int velocity[S], acceleration[S], i;
  struct SeriesOutputs to;
  struct SeriesResolution it;
  for (i = 0; i < S; ++i) {
    velocity[i] = VELOCITY + i;
    acceleration[i] = ACCELERATION + i;
  }
  to.shafts = S;
  to.constraints = K;
  to.velocity = velocity;
  to.acceleration = acceleration;
  to.torque = torque_row;
  to.residual = residual_row;
  to.entry = entry_row;
  to.order = order_of;
  to.entry_stride = S;
  to.inertia = 0;
  to.inertia_row = inertia_row;
  to.inertial_torque = inertial_row;
  to.connection = connection_row;
  to.absolute = ABSOLUTE_TOLERANCE;
  to.relative = RELATIVE_TOLERANCE;
  to.length = theta * m->unit;
  it.operations = operation;
  it.count = OPERATIONS;
  it.rows = m->row[0];
  it.stride = LENGTH;
  it.states = m->branch;
  it.pieces = m->piece;
  it.ranges = range;
  it.row_count = ROWS;
  it.outputs = &to;
  it.at[0] = it.at[1] = it.at[2] = 0;
  it.last = m->order;
  it.theta = theta;
  return seriesIsResolved(&it);
}
)c";

const char* const kSeriesCode = R"c(
/* ---- The motion as power series of (t - now) / unit ---- */

static void know_further(scene_model *m, int n)
{
  int i;
  for (i = 0; i < S; ++i) {
    m->row[VELOCITY + i][n + 1] = m->unit / (n + 1) * m->row[ACCELERATION + i][n];
    m->row[ANGLE + i][n + 1] = m->unit / (n + 1) * m->row[VELOCITY + i][n];
  }
}

/* Order 0. The accelerations are those of the state. False where C has lost rank. */
static int begin_series(scene_model *m, double unit)
{
  double b[S];
  int i;
  m->unit = unit;
  m->order = 0;
  m->row[TIME][1] = unit;
  enter_inputs(m, unit, ORDER);
  enter_state(m);
  if (IS_CLASSICAL ? !factor_curved(m, m->now.multiplier, 1, 3) : !factor(m, 1, 3)) return 0;
  if (!IS_CLASSICAL && INERTIA_VARIES) {
    reaction(m, b);
    solve(m, S, b);
    for (i = 0; i < S; ++i) m->row[PULL + i][0] = b[i];
  }
  know_further(m, 0);
  return 1;
}

/* b = J^-1 R of order n, of the connection 1/2 J' omega b in R' */
static void note_pull(scene_model *m, int n)
{
  double b[S];
  int i, j;
  for (i = 0; i < S; ++i) {
    const double *const J = m->row[inertia_row[i]];
    b[i] = m->row[inertial_row[i]][n] - m->row[torque_row[i]][n];
    for (j = 0; j < S; ++j) b[i] += inertia(m, i, j) * m->row[ACCELERATION + j][n];
    for (j = 1; j <= n; ++j) {
      b[i] += J[j] * (m->row[ACCELERATION + i][n - j] - m->row[PULL + i][n - j]);
    }
  }
  solve(m, S, b);
  for (i = 0; i < S; ++i) m->row[PULL + i][n] = b[i];
}

/* What J epsilon_n - C' mu_n is. */
static double force_rest(const scene_model *m, int i, int n)
{
  const int last = IS_CLASSICAL ? n : n - 1;
  double sum = m->row[torque_row[i]][n] - m->row[inertial_row[i]][n];
  double rest = 0.0;
  int j, p;
  if (INERTIA_VARIES) {
    for (j = 1; j <= n; ++j) sum -= m->row[inertia_row[i]][j] * m->row[ACCELERATION + i][n - j];
  }
  for (p = 0; p < K; ++p) {
    const double *const C = m->row[entry_row[S * p + i]];
    for (j = 1; j <= last; ++j) rest += C[j] * m->row[MULTIPLIER + p][last - j];
  }
  if (!IS_CLASSICAL && INERTIA_VARIES) {
    for (j = 0; j < n; ++j) {
      rest += m->row[connection_row[i]][j] * m->row[PULL + i][n - 1 - j];
    }
  }
  return sum + (IS_CLASSICAL ? rest : m->unit / n * rest);
}

/* What C epsilon_n is. */
static double constraint_rest(const scene_model *m, int p, int n)
{
  double sum;
  int i, j;
  if (order_of[p] < 3) return -m->row[residual_row[p]][n];
  sum = m->unit * m->row[residual_row[p]][n - 1];
  for (i = 0; i < S; ++i) {
    const double *const C = m->row[entry_row[S * p + i]];
    for (j = 1; j < n; ++j) sum += (n - j) * C[j] * m->row[ACCELERATION + i][n - j];
  }
  return -sum / n;
}

/* One order more. False where it is not finite. */
static int extend_series(scene_model *m)
{
  const int n = m->order + 1;
  double x[SIZE];
  int i;
  for (i = 0; i < S; ++i) m->row[ACCELERATION + i][n] = 0.0;
  given(m->row, m->branch, m->piece, n);
  accelerated(m->row, m->branch, m->piece, n);
  for (i = 0; i < S; ++i) x[i] = force_rest(m, i, n);
  for (i = 0; i < K; ++i) x[S + i] = constraint_rest(m, i, n);
  solve(m, SIZE, x);
  for (i = 0; i < SIZE; ++i) {
    if (!isfinite(x[i])) return 0;
  }
  for (i = 0; i < S; ++i) m->row[ACCELERATION + i][n] = x[i];
  for (i = 0; i < K; ++i) {
    m->row[MULTIPLIER + i][IS_CLASSICAL ? n : n - 1] = IS_CLASSICAL ? x[S + i]
                                                                    : x[S + i] * n / m->unit;
  }
  know_further(m, n);
  accelerated(m->row, m->branch, m->piece, n);
  if (!IS_CLASSICAL && INERTIA_VARIES) note_pull(m, n);
  m->order = n;
  return 1;
}

/* Angles, velocities and, where they are a state, accelerations, up to last_term(). */
static int last_term(const scene_model *m)
{
  return IS_CLASSICAL ? m->order + 1 : m->order;
}

static double tolerance_of(double size)
{
  return ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * fabs(size);
}

/* True when the last terms are a small part of the tolerance for a step of theta units. */
static int is_nothing(const scene_model *m, double theta)
{
  const int last = last_term(m);
  const double power = pow(theta, last);
  int c;
  for (c = FIRST_JUDGED; c < COMPONENTS; ++c) {
    const double *const x = m->row[ANGLE + c];
    const double term = fabs(x[last]) * power;
    if (!(term <= 1e-3 * tolerance_of(x[0]))) return 0;
    if (!(term <= 1e-6 * fmax(fabs(x[0]), fabs(x[1]) * theta))) return 0;
  }
  return 1;
}

/* The last term at theta is the largest: beyond the radius of convergence. */
static int is_growing(const scene_model *m, double theta)
{
  const int last = last_term(m);
  int c, n;
  for (c = FIRST_JUDGED; c < COMPONENTS; ++c) {
    const double *const x = m->row[ANGLE + c];
    double power = theta;
    double largest = 1e-6 * tolerance_of(x[0]);
    for (n = 1; n < last; ++n, power *= theta) largest = fmax(largest, fabs(x[n]) * power);
    if (fabs(x[last]) * power > largest) return 1;
  }
  return 0;
}

/* The longest step, s, for which the last terms are within the tolerance: three of them, as one
   may vanish by accident. Up to limit, s, no function does what its series does not show. */
static double choose_length(const scene_model *m, int terms, double limit)
{
  const int last = last_term(m);
  const double decay = pow(RELATIVE_TOLERANCE, 1.0 / ORDER);
  double theta = INFINITY;
  double part = 1.0;
  int c, n, halvings;
  for (n = last; n > last - terms; --n, part *= decay) {
    double term = 0.0;
    for (c = FIRST_JUDGED; c < COMPONENTS; ++c) {
      const double *const x = m->row[ANGLE + c];
      term = fmax(term, 2.0 * fabs(x[n]) * part / tolerance_of(x[0]));
    }
    if (term > 0.0) theta = fmin(theta, pow(term, -1.0 / n));
  }
  for (halvings = 0; halvings < 60; ++halvings) {
    const double taken = fmin(theta, limit / m->unit);
    if (isfinite(theta) && is_growing(m, theta)) {
      theta *= 0.5;
    } else if (!is_resolved(m, taken)) {
      theta = 0.5 * taken;
    } else {
      break;
    }
  }
  return theta * m->unit;
}

/* The series of the state as far as steps of `limit` s need them, and how long a step may be. */
static scene_status expand(scene_model *m, double limit)
{
  double unit = m->usual > 0.0 ? fmin(m->usual, limit) : limit;
  int trial;
  for (trial = 0; trial < 12; ++trial, unit *= 1.0 / 64.0) {
    int exponent;
    int small = 0;
    int goes_on = 1;
    int resolved = 0; /* up to an order that makes the next term */
    frexp(unit, &exponent);
    if (!begin_series(m, ldexp(1.0, exponent))) return SCENE_SINGULAR;
    while (goes_on && m->order < ORDER && !(resolved && small > 2)) {
      resolved = small >= 2 && m->order > 3 && is_resolved(m, limit / m->unit);
      goes_on = extend_series(m);
      small = goes_on && is_nothing(m, limit / m->unit) ? small + 1 : 0;
    }
    if (!goes_on) continue; /* too long a unit overflows; else nothing helps */
    m->usual = choose_length(m, small >= 2 ? 2 : 3, limit);
    return SCENE_OK;
  }
  return SCENE_NOT_FINITE;
}
)c";

}  // namespace variator_sim
