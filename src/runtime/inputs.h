/* Commanded inputs: a closed form between two events, age s after the last command. */

enum { VS_ZERO_ORDER, VS_FIRST_ORDER_LAG, VS_RATE_LIMIT, VS_FIRST_ORDER_HOLD, VS_SECOND_ORDER_LAG };
enum { VS_CONSTANT, VS_RAMP, VS_EXPONENTIAL, VS_CRITICAL, VS_DELAYED };

/* A piece of the past of a delayed formula: its start, as a sum, its length and unit, s, the order
 * of its polynomial in time / unit, and the coefficients. */
enum { VS_START, VS_START_REST, VS_LENGTH, VS_UNIT, VS_LAST, VS_PIECE };

/* The polynomial of a piece, from `age` s behind its start, in powers of time / unit. */
VS_FUNCTION void vs_expand_piece(const double* piece, double age, double unit, int order, Real* u) {
  const int last = (int)piece[VS_LAST];
  const double theta = age / piece[VS_UNIT], ratio = unit / piece[VS_UNIT];
  double c[VS_STRIDE], power = 1.0;
  int i, n;
  for (n = 0; n <= last; ++n) c[n] = piece[VS_PIECE + n];
  for (i = 0; i < last && theta != 0.0; ++i) {
    for (n = last - 1; n >= i; --n) c[n] += theta * c[n + 1];
  }
  for (n = 0; n <= order; ++n, power *= ratio) u[n] = n <= last ? c[n] * power : 0.0;
}

/* u up to `order`, in powers of time / unit: with x = age / tau,
       d^n/dx^n (a + b x) exp(-x) = (-1)^n (a + b x - n b) exp(-x) */
VS_FUNCTION void vs_expand_input(const scene_signal* s, double unit, int order, Real* u) {
  const int is_lag = s->form == VS_EXPONENTIAL || s->form == VS_CRITICAL;
  const Real x = s->age * s->inverse_tau;
  const Real a = s->start - s->target;
  const Real b = s->form == VS_CRITICAL ? s->linear : vs_zero;
  const Real decay = is_lag ? expm1(-x) : vs_zero;
  Real factor = is_lag ? 1.0 + decay : vs_zero;
  int n;
  if (s->form == VS_DELAYED) {
    vs_expand_piece(s->piece, s->age, unit, order, u);
    return;
  }
  u[0] = s->start + a * decay + b * x * factor;
  for (n = 1; n <= order; ++n) {
    factor *= -unit * s->inverse_tau * (1.0 / n);
    u[n] = (a + b * x - n * b) * factor;
  }
  if (s->form != VS_RAMP) return;
  u[0] = s->start + s->slope * s->age;
  if (s->age >= s->end || (s->slope > 0.0 ? u[0] > s->target : u[0] < s->target))
    VS_SET_VALUE(u[0], s->target);
  u[1] = unit * s->slope;
}

VS_FUNCTION Real vs_input_value(const scene_signal* s) {
  Real u[2];
  vs_expand_input(s, 1.0, 1, u);
  return u[0];
}

VS_FUNCTION void vs_hold_constant(scene_signal* s, Real value) {
  s->form = VS_CONSTANT;
  s->start = s->target = value;
  s->slope = s->inverse_tau = s->linear = s->age = 0.0;
  s->end = INFINITY;
}

/* True when the value itself jumps. */
VS_FUNCTION int vs_command_signal(scene_signal* s, int hold, Real parameter, Real target) {
  const double settled = 50.0; /* time constants: exp(-50) of the way is less than rounding */
  Real u[2], present, rate;
  vs_expand_input(s, 1.0, 1, u);
  present = u[0];
  rate = u[1];
  vs_hold_constant(s, present);
  s->target = target;
  if (hold == VS_SECOND_ORDER_LAG) {
    if (VS_IS_SAME(target, present) && VS_IS_SAME(rate, 0.0)) return 0;
    s->form = VS_CRITICAL;
    s->inverse_tau = 1.0 / parameter;
    s->linear = present - target + parameter * rate;
    s->end = settled * parameter;
    return 0;
  }
  if (VS_IS_SAME(target, present)) return 0;
  if (hold == VS_ZERO_ORDER || (hold == VS_RATE_LIMIT && target == present)) {
    vs_hold_constant(s, target);
    return 1;
  }
  if (hold == VS_FIRST_ORDER_LAG) {
    s->form = VS_EXPONENTIAL;
    s->inverse_tau = 1.0 / parameter;
    s->end = settled * parameter;
    return 0;
  }
  s->form = VS_RAMP;
  if (hold == VS_RATE_LIMIT) {
    s->slope = target > present ? parameter : -parameter;
    s->end = (target - present) / s->slope;
  } else {
    s->slope = (target - present) / parameter;
    s->end = parameter;
  }
  return 0;
}

/* Coefficients up to `order` of the rows of inputs and of their rates. */
VS_FUNCTION void vs_enter_inputs(const scene_model* m, scene_series* it, int order) {
  Real u[VS_STRIDE] = {0.0};
  int k, n, i = -1;
  for (k = 0; k < INPUT_ROW_COUNT; ++k) {
    Real* const row = it->row[input_row[k]];
    const int is_new = input_of_row[k] != i;
    const int moves = m->now.input[input_of_row[k]].form != VS_CONSTANT;
    i = input_of_row[k];
    if (!moves && !it->moves[i]) {
      if (input_rate_of_row[k] == 0) row[0] = m->now.input[i].start;
      continue;
    }
    if (is_new) vs_expand_input(&m->now.input[i], it->unit, order + 2, u);
    for (n = 0; n <= order; ++n) {
      const Real rate = (n + 1) * u[n + 1] / it->unit;
      const Real second = (n + 2) * (n + 1) * u[n + 2] / (it->unit * it->unit);
      row[n] = input_rate_of_row[k] == 0 ? u[n] : input_rate_of_row[k] == 1 ? rate : second;
    }
  }
  for (k = 0; k < INPUT_ROW_COUNT; ++k) {
    int* const moves = &it->moves[input_of_row[k]];
    *moves = m->now.input[input_of_row[k]].form != VS_CONSTANT || (order == 0 && *moves);
  }
}

/* True where a lag has come so near to its target that it is the target, and stays it. */
VS_FUNCTION int vs_has_settled(const scene_signal* s) {
  const double early = 30.0; /* time constants: exp(-30) of the way is more than rounding */
  Real u[2];
  if (s->form != VS_EXPONENTIAL && s->form != VS_CRITICAL) return 0;
  if (s->age * s->inverse_tau < early) return 0;
  vs_expand_input(s, 1.0, 1, u);
  return VS_IS_SAME(u[0], s->target) &&
         fabs(u[1]) <= 4.0 * DBL_EPSILON * fabs(s->target) * s->inverse_tau;
}

/* Inputs whose closed form has ended hold its value: at the end itself the rate is still that of
 * the form. */
VS_FUNCTION void vs_end_inputs(scene_model* m) {
  int i;
  (void)delay_input; /* (Only hosts ask for it.) */
  for (i = 0; i < INPUTS; ++i) {
    scene_signal* const s = &m->now.input[i];
    if ((s->age >= s->end && s->form != VS_DELAYED) || vs_has_settled(s))
      vs_hold_constant(s, s->target);
  }
}
