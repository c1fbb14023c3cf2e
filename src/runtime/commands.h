/* Commands and starts change the state; residuals and reaction rates are read from it. */

/* True where `values` are those that were given. */
VS_FUNCTION int vs_are_given(const Real* values, const Real* given) {
  int i;
  for (i = 0; i < S; ++i) {
    const double moved = fabs(values[i] - given[i]);
    if (!(moved <= 1e-9 * fmax(1.0, fabs(given[i])))) return 0;
  }
  return 1;
}

/* The accelerations of a first state, which was `given`; see vs_start. */
VS_FUNCTION scene_status vs_start_accelerations(scene_model* m, scene_series* it,
                                                const scene_state* given, int are_given,
                                                int may_move) {
  Real lambda[MOST_CONSTRAINTS + 1] = {0.0};
  scene_status status;
  if (!are_given && !IS_CLASSICAL) {
    Real* const least = IS_FORMAL ? m->now.multiplier : lambda;
    status = vs_settle(m, it, VS_LEAST_REACTION, least, 0, 0.0, 50);
    if (status != SCENE_OK || !IS_FORMAL) return status;
  }
  status = vs_settle_accelerations(m, it);
  if (IS_CLASSICAL || !are_given || may_move) return status;
  return vs_are_given(m->now.acceleration, given->acceleration) ? status : SCENE_INCONSISTENT;
}

/* The modes and the accelerations of a first state. are_given: those of the state are to be kept;
 * may_move: if not they nor the velocities satisfy the constraints, the nearest that do are taken.
 */
VS_FUNCTION scene_status vs_start(scene_model* m, scene_series* it, int are_given, int may_move) {
  const scene_state given = m->now;
  scene_status status;
  vs_forget_modes(m);
  vs_enter_inputs(m, it, 0);
  status = vs_project_velocities(m, it);
  if (!may_move && !vs_are_given(m->now.velocity, given.velocity)) return SCENE_INCONSISTENT;
  if (status != SCENE_OK) return status;
  if (IS_FORMAL || !TRANSMITS) {
    status = vs_start_accelerations(m, it, &given, are_given, may_move);
    if (status != SCENE_OK || !HOLDS) return status;
  }
  return vs_decide_first(m);
}

/* The inputs become `next`: the accelerations jump where the value of one does (all of them
 * together, on the straight line between the old and the new values), unless nothing has moved yet.
 */
VS_FUNCTION scene_status vs_change_inputs(scene_model* m, const scene_signal* next) {
  scene_series* const it = vs_series(m);
  const scene_state before = m->now;
  Real u[MOST_INPUTS + 1], du[MOST_INPUTS + 1], dQ[MOST_SHAFTS];
  scene_status status = SCENE_OK;
  int jumps = 0;
  int i;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  for (i = 0; i < S; ++i) dQ[i] = -it->row[torque_row[i]][0];
  for (i = 0; i < INPUTS; ++i) {
    u[i] = vs_input_value(&m->now.input[i]);
    m->now.input[i] = next[i];
    du[i] = vs_input_value(&m->now.input[i]) - u[i];
    jumps = jumps || fabs(du[i]) > 1e-14 * (fabs(u[i]) + fabs(u[i] + du[i])) ||
            (du[i] == 0.0 && !VS_IS_SAME(du[i], 0.0));
  }
  if (!m->has_moved) {
    status = vs_start(m, it, HAS_GIVEN_ACCELERATIONS, MAY_PROJECT);
  } else if (jumps) {
    vs_enter_inputs(m, it, 0);
    vs_enter_state(m, it);
    for (i = 0; i < S; ++i) dQ[i] += it->row[torque_row[i]][0];
    status = IS_CLASSICAL ? vs_follow_least_reaction(m, it) : vs_jump(m, it, u, du, dQ, 0);
    vs_enter_inputs(m, it, 0);
    if (status == SCENE_OK && !IS_CLASSICAL) status = vs_settle_accelerations(m, it);
  }
  if (TRANSMITS && m->has_moved && status == SCENE_OK) {
    /* Modes are decided in the other series: that of the last step is still looked at. */
    m->present = 1 - m->present;
    status = vs_decide(m, 0);
    m->present = 1 - m->present;
  }
  if (status != SCENE_OK) m->now = before;
  m->is_begun = 0;
  if (SERIES_LEAD) m->choice.ahead = 0.0;
  /* Lags begin anew with each command: the first implicit step behind it is no longer than the one
     behind the last command proved to be. */
  m->choice.is_first = 1;
  if (m->choice.first > 0.0) m->choice.ahead = seriesSmaller(m->choice.ahead, m->choice.first);
  m->at_rest = 0.0;
  m->crossings = 0;
  return status;
}

VS_FUNCTION_RARE const char* vs_status_text(scene_status status) {
  static const char* const texts[] = {"ok",
                                      "bad argument",
                                      "singular constraint",
                                      "no state on the constraints was found",
                                      "a value is not finite or has no power series",
                                      "too many steps",
                                      "chattering",
                                      "a jump leads to no state on the constraints",
                                      "the first commands contradict the initial values",
                                      "no modes of the elements that hold go on",
                                      "a step of fixed length is too long"};
  return status >= SCENE_OK && status <= SCENE_STEP_TOO_LARGE ? texts[status] : "?";
}

/* The residual of a constraint: f, psi, or C eta + c_0 of order 3. */
VS_FUNCTION Real vs_residual(const scene_series* it, int p) {
  Real left = it->row[(order_of[p] == 1 ? velocity_residual_row : residual_row)[p]][0];
  int i;
  for (i = 0; i < S && order_of[p] == 3; ++i) {
    left += vs_entry(it, p, i) * it->row[ACCELERATION + i][1] / it->unit;
  }
  return left;
}

/* R' = C' Lambda + 1/2 J' omega J^-1 R; of gauss, or along D, D' lambda' + (dD/dt)' lambda */
VS_FUNCTION Real vs_reaction_rate(const scene_series* it, int i) {
  Real rate = 0.0;
  int p;
  for (p = 0; p < K; ++p) {
    const Real* const D = it->row[direction_row[S * p + i]];
    const Real* const l = it->row[MULTIPLIER + p];
    rate += IS_CLASSICAL ? (D[0] * l[1] + D[1] * l[0]) / it->unit : D[0] * l[0];
    if (has_direction[p] && !IS_CLASSICAL) rate += D[1] * it->row[TRANSMITTED + p][0] / it->unit;
  }
  return HAS_CONNECTION ? rate + vs_connection(it, i) : rate;
}
