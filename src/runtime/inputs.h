/* Commanded inputs: the rows of their closed forms (signals.h). */

VS_FUNCTION Real vs_input_value(const scene_signal* s) {
  Real u[2];
  vs_expand_input(s, 1.0, 1, u);
  return u[0];
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
