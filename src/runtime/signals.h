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

VS_FUNCTION void vs_hold_constant(scene_signal* s, Real value) {
  s->form = VS_CONSTANT;
  s->start = s->target = value;
  s->slope = s->inverse_tau = s->linear = s->age = 0.0;
  s->end = INFINITY;
}

/* The form of the way from the start to the target that a hold with this parameter takes: of lags a
 * time constant, of a rate limit the rate, of a first-order hold its period. */
VS_FUNCTION void vs_set_form(scene_signal* s, int hold, Real parameter) {
  const double settled = 50.0; /* time constants: exp(-50) of the way is less than rounding */
  if (hold == VS_FIRST_ORDER_LAG || hold == VS_SECOND_ORDER_LAG) {
    s->form = hold == VS_FIRST_ORDER_LAG ? VS_EXPONENTIAL : VS_CRITICAL;
    s->inverse_tau = 1.0 / parameter;
    s->end = settled * parameter;
    return;
  }
  s->form = VS_RAMP;
  if (hold == VS_RATE_LIMIT) {
    s->slope = s->target > s->start ? parameter : -parameter;
    s->end = (s->target - s->start) / s->slope;
  } else {
    s->slope = (s->target - s->start) / parameter;
    s->end = parameter;
  }
}

/* True when the value itself jumps. */
VS_FUNCTION int vs_command_signal(scene_signal* s, int hold, Real parameter, Real target) {
  Real u[2], present, rate;
  vs_expand_input(s, 1.0, 1, u);
  present = u[0];
  rate = u[1];
  vs_hold_constant(s, present);
  s->target = target;
  if (VS_IS_SAME(target, present) && (hold != VS_SECOND_ORDER_LAG || VS_IS_SAME(rate, 0.0)))
    return 0;
  if (hold == VS_ZERO_ORDER || (hold == VS_RATE_LIMIT && target == present)) {
    vs_hold_constant(s, target);
    return 1;
  }
  vs_set_form(s, hold, parameter);
  if (hold == VS_SECOND_ORDER_LAG) s->linear = present - target + parameter * rate;
  return 0;
}
