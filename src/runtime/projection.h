/* States on the constraints: velocities on f = 0, accelerations on psi = 0 or of least reaction. */

/* Newton's iteration: the correction that was made to S values is small enough. */
VS_FUNCTION int vs_has_converged(const Real* values, const Real* change, double* previous) {
  double size = 0.0;
  double length = 0.0;
  int i, ends;
  if (*previous < 0.0) return 1; /* the round that derivatives took beyond */
  for (i = 0; i < S; ++i) {
    size = seriesLarger(size, fabs(change[i]));
    length = seriesLarger(length, fabs(values[i]));
    if (!isfinite(values[i])) return 0;
  }
  ends = size <= VS_CONVERGED * length || size == 0.0;
  /* Rounding keeps corrections to tiny values from shrinking, or lets them do so without end. */
  ends = ends || (size >= 0.5 * *previous && size <= 1e-12 * (length + 1.0)) || size <= 1e-30;
  *previous = ends && VS_CONVERGES_LATE ? -1.0 : size;
  return ends && !VS_CONVERGES_LATE;
}

/* Adds a correction. What comes to rest would come to 0 by ever smaller ones, each the rounding of
 * the last, until they underflow: such a rest is left to the next one. */
VS_FUNCTION void vs_correct(Real* values, const Real* change) {
  double size = 0.0;
  int i;
  for (i = 0; i < S; ++i) size = seriesLarger(size, fabs(change[i]));
  for (i = 0; i < S; ++i) {
    values[i] += change[i];
    if (fabs(values[i]) <= 1e-8 * size) VS_SET_VALUE(values[i], 0.0);
  }
}

/* Moves the velocities onto f = 0 of the constraints of order 1: x = -J^-1 C' (C J^-1 C')^-1 f. */
VS_FUNCTION scene_status vs_project_velocities(scene_model* m, scene_series* it) {
  double previous = INFINITY;
  Real x[MOST_SIZE];
  int i, round;
  for (round = 0; round < 25 && HAS_ORDER_1; ++round) {
    vs_enter_state(m, it);
    vs_at_once(it, 0);
    if (!vs_factor(it, 1, 1)) return SCENE_SINGULAR;
    for (i = 0; i < S; ++i) x[i] = 0.0;
    for (i = 0; i < K; ++i)
      x[S + i] = order_of[i] == 1 ? -it->row[velocity_residual_row[i]][0] : vs_zero;
    vs_solve(it, x);
    vs_correct(m->now.velocity, x);
    if (vs_has_converged(m->now.velocity, x, &previous)) return SCENE_OK;
  }
  return HAS_ORDER_1 ? SCENE_NOT_CONVERGED : SCENE_OK;
}

enum {
  VS_ONTO_CONSTRAINTS = 0, /* epsilon moves as little as psi = 0 asks for: J dx = C' mu */
  VS_LEAST_REACTION = 1,   /* J epsilon + n - Q = D' lambda */
  VS_RESTORES = 2,         /* dx moves the part of R that no C spans back to that at the start */
  VS_DECIDED = 3           /* J epsilon + n - Q = memory + D' lambda */
};

/* The right-hand side a, g of a correction; order 3 has nothing that could be 0. */
VS_FUNCTION void vs_find_rest(const scene_model* m, const scene_series* it, int what,
                              const Real* lambda, Real* x) {
  Real R[MOST_SHAFTS];
  int e, i, p;
  if (what != VS_ONTO_CONSTRAINTS) vs_reaction(it, R);
  for (i = 0; i < S; ++i) {
    x[i] = 0.0;
    if (what == VS_LEAST_REACTION || what == VS_DECIDED) x[i] = -R[i];
    if (what == VS_DECIDED) x[i] += m->memory[i];
    if (what == VS_RESTORES && is_neutral[i]) {
      x[i] = (INERTIA_VARIES ? sqrt(vs_inertia(it, i, i)) : (Real)1.0) * m->now.reaction[i] - R[i];
    }
  }
  for (p = 0; p < K; ++p) {
    x[S + p] = order_of[p] < 3 ? -it->row[residual_row[p]][0] : vs_zero;
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      const int is_base =
          TRANSMITS && (what == VS_DECIDED || (what == VS_RESTORES && is_neutral[entry_shaft[e]]));
      if (is_base || (what == VS_LEAST_REACTION && order_of[p] < 3))
        x[entry_shaft[e]] += vs_direction(it, p, entry_shaft[e]) * lambda[p];
    }
  }
}

/* The multipliers of generalized_gauss that corrections of the accelerations move: with elements
 * that hold, what these transmit is a part of the state. */
VS_FUNCTION Real* vs_transmitted(scene_model* m) {
  return TRANSMITS ? m->now.multiplier : 0;
}

/* Newton's iteration for the accelerations (and lambda, where it is not 0), from those of the
 * state. `share` of `left` may remain. Afterwards all formulas are those of the state. A last
 * correction, whose square is below rounding, is added to the formulas by their slopes. */
VS_FUNCTION scene_status vs_settle(scene_model* m, scene_series* it, int what, Real* lambda,
                                   const Real* left, double share, int rounds) {
  const int high = what == VS_LEAST_REACTION ? 2 : 3;
  double previous = INFINITY;
  Real x[MOST_SIZE];
  int i;
  vs_enter_state(m, it);
  for (; rounds > 0; --rounds, ++m->corrections) {
    const int is_regular = what == VS_LEAST_REACTION || IS_FORMAL
                               ? vs_factor_curved(it, lambda, 1, high)
                               : vs_factor(it, 1, high);
    if (!is_regular) return SCENE_SINGULAR;
    vs_find_rest(m, it, what, lambda, x);
    for (i = 0; i < SIZE && share > 0.0; ++i) x[i] -= share * left[i];
    vs_solve(it, x);
    vs_correct(m->now.acceleration, x);
    for (i = 0; i < S; ++i) it->row[ACCELERATION + i][0] = m->now.acceleration[i];
    for (i = 0; i < K && lambda != 0; ++i) lambda[i] += x[S + i];
    for (i = 0; i < K; ++i) it->row[MULTIPLIER + i][0] = m->now.multiplier[i];
    for (i = 0; i < K && TRANSMITS; ++i) it->row[TRANSMITTED + i][0] = m->now.multiplier[i];
    if (vs_has_converged(m->now.acceleration, x, &previous)) {
      vs_corrected(it, 0, x);
      vs_rest(it, 0);
      return SCENE_OK;
    }
    vs_tried(it, 0);
    vs_rest(it, 0);
  }
  return SCENE_NOT_CONVERGED;
}

/* The accelerations of least reaction after a jump: by parts of it, each so short that the
 * iteration hardly has to search, for the motion to stay on its branch. */
VS_FUNCTION scene_status vs_follow_least_reaction(scene_model* m, scene_series* it) {
  Real left[MOST_SIZE];
  double done = 0.0;
  double part = 1.0;
  vs_enter_state(m, it);
  vs_find_rest(m, it, VS_LEAST_REACTION, m->now.multiplier, left);
  while (done < 1.0) {
    const scene_state before = m->now;
    const double next = seriesSmaller(1.0, done + part);
    if (vs_settle(m, it, VS_LEAST_REACTION, m->now.multiplier, left, 1.0 - next, 5) == SCENE_OK) {
      done = next;
      part *= 2.0;
      continue;
    }
    m->now = before;
    part *= 0.25;
    if (!(part > 1e-6)) return SCENE_NO_MOTION;
  }
  return SCENE_OK;
}

/* The accelerations of a state: those that the principle gives, or its own, on psi = 0. */
VS_FUNCTION scene_status vs_settle_accelerations(scene_model* m, scene_series* it) {
  if (IS_CLASSICAL) return vs_settle(m, it, VS_LEAST_REACTION, m->now.multiplier, 0, 0.0, 50);
  if (!HAS_RESIDUAL && !IS_FORMAL) return SCENE_OK;
  return vs_settle(m, it, IS_FORMAL ? VS_RESTORES : VS_ONTO_CONSTRAINTS, vs_transmitted(m), 0, 0.0,
                   25);
}

/* R' = C' Lambda: what no C has a part of is a constant of R (with J(phi) of R / sqrt(J)). It is
 * taken from the applied torque, which the state tells, and not from the accelerations. */
VS_FUNCTION void vs_note_reaction(scene_model* m, scene_series* it) {
  int i, p;
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  vs_reaction(it, m->now.reaction);
  for (i = 0; i < S && TRANSMITS; ++i) {
    for (p = 0; p < K; ++p) m->now.reaction[i] -= vs_direction(it, p, i) * m->now.multiplier[p];
  }
  for (i = 0; i < S && INERTIA_VARIES; ++i) m->now.reaction[i] /= sqrt(vs_inertia(it, i, i));
}

/* ---- Jumps: time, angles and velocities stay, the accelerations move along psi = 0 by
        J d(epsilon) = dQ + C' L,  C d(epsilon) + dpsi/du du + df' = 0. ---- */

/* A kink of constraints of order 1, the limit of ever sharper bends in which C and D turn from one
 * side to the other,
 *     C = C_before + theta dC,  df' = gap + dC (epsilon - epsilon_before) */
typedef struct {
  Real entry[MOST_CONSTRAINTS * MOST_SHAFTS + 1], direction[MOST_CONSTRAINTS * MOST_SHAFTS + 1];
  Real entry_turn[MOST_CONSTRAINTS * MOST_SHAFTS + 1];
  Real direction_turn[MOST_CONSTRAINTS * MOST_SHAFTS + 1];
  Real gap[MOST_CONSTRAINTS + 1], acceleration[MOST_SHAFTS];
  int turns;
} vs_kink;

/* Turns C and D of the state that was entered; x: what the turn adds to dQ, and -df'. */
VS_FUNCTION_RARE void vs_turn_rows(const scene_model* m, scene_series* it, const vs_kink* kink,
                                   double theta, Real* x) {
  int i, p;
  for (p = 0; p < K; ++p) {
    x[S + p] = order_of[p] == 1 ? -kink->gap[p] : vs_zero;
    for (i = 0; i < S && order_of[p] == 1; ++i) {
      const int n = S * p + i;
      it->row[entry_row[n]][0] = kink->entry[n] + theta * kink->entry_turn[n];
      it->row[direction_row[n]][0] = kink->direction[n] + theta * kink->direction_turn[n];
      x[S + p] -= kink->entry_turn[n] * (m->now.acceleration[i] - kink->acceleration[i]);
      if (has_direction[p]) x[i] += kink->direction_turn[n] * m->now.multiplier[p];
    }
  }
}

/* Adds to dQ what D turns by with the inputs: its coefficients 1 along their path. */
VS_FUNCTION_RARE void vs_turn_with_inputs(const scene_model* m, scene_series* it, const Real* du,
                                          Real* x) {
  int i, k, p;
  for (i = ANGLE; i < STATE; ++i) it->row[i][1] = 0.0;
  for (k = 0; k < INPUT_ROW_COUNT; ++k)
    it->row[input_row[k]][1] = input_rate_of_row[k] == 0 ? du[input_of_row[k]] : vs_zero;
  it->row[TIME][1] = 0.0;
  vs_extend_path(it);
  for (p = 0; p < K; ++p) {
    for (i = 0; i < S; ++i) x[i] += it->row[direction_row[S * p + i]][1] * m->now.multiplier[p];
  }
  for (i = 0; i < SCENE_ROWS; ++i) it->row[i][1] = 0.0; /* (Some series end before.) */
}

/* At theta of the path from the inputs u0 to u0 + du, or over a kink. */
VS_FUNCTION int vs_jump_rate(scene_model* m, scene_series* it, double theta, const Real* u0,
                             const Real* du, const Real* dQ, const vs_kink* kink, Real* x) {
  int i, k, p;
  for (k = 0; k < INPUT_ROW_COUNT; ++k) {
    i = input_of_row[k];
    if (input_rate_of_row[k] == 0)
      it->row[input_row[k]][0] = du == 0 ? u0[i] : u0[i] + theta * du[i];
  }
  vs_enter_state(m, it);
  for (i = 0; i < SIZE; ++i) x[i] = i < S ? dQ[i] : vs_zero;
  if (kink != 0) vs_turn_rows(m, it, kink, theta, x);
  if (!(IS_FORMAL ? vs_factor_curved(it, m->now.multiplier, 1, 3) : vs_factor(it, 1, 3))) return 0;
  if (du != 0) {
    vs_at_once(it, 0);
    for (p = 0; p < K; ++p) {
      for (i = 0; i < INPUTS; ++i) x[S + p] -= it->row[input_slope_row[INPUTS * p + i]][0] * du[i];
    }
    if (IS_FORMAL) vs_turn_with_inputs(m, it, du, x);
  }
  vs_solve(it, x);
  return 1;
}

/* One step of h of the path from theta, by the formulas of Dormand and Prince, A family of embedded
 * Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980) 19-26; its error in a tenth of the tolerance.
 * False where C has lost rank. */
VS_FUNCTION int vs_step_of_path(scene_model* m, scene_series* it, double theta, double h,
                                const Real* u0, const Real* du, const Real* dQ, const vs_kink* kink,
                                double* norm) {
  static const double a[6][6] = {
      {0.2, 0, 0, 0, 0, 0},
      {3.0 / 40, 9.0 / 40, 0, 0, 0, 0},
      {44.0 / 45, -56.0 / 15, 32.0 / 9, 0, 0, 0},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729, 0, 0},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656, 0},
      {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static const double c[6] = {0.2, 0.3, 0.8, 8.0 / 9, 1.0, 1.0};
  static const double e[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                              -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  Real k[7][MOST_SIZE];
  const scene_state begin = m->now;
  int i, j, n;
  if (!vs_jump_rate(m, it, theta, u0, du, dQ, kink, k[0])) return 0;
  for (n = 0; n < 6; ++n) {
    for (i = 0; i < (TRANSMITS ? SIZE : S); ++i) {
      Real sum = 0.0;
      for (j = 0; j <= n; ++j) sum += a[n][j] * k[j][i];
      if (i < S)
        m->now.acceleration[i] = begin.acceleration[i] + h * sum;
      else
        m->now.multiplier[i - S] = begin.multiplier[i - S] + h * sum;
    }
    if (!vs_jump_rate(m, it, theta + c[n] * h, u0, du, dQ, kink, k[n + 1])) return 0;
  }
  *norm = 0.0;
  for (i = 0; i < S; ++i) {
    double error = 0.0;
    for (j = 0; j < 7; ++j) error += e[j] * k[j][i];
    *norm = seriesLarger(*norm, fabs(h * error) / (0.1 * vs_tolerance(it, m->now.acceleration[i])));
    if (!isfinite(m->now.acceleration[i]) || !isfinite(error)) return 0;
  }
  return 1;
}

VS_FUNCTION scene_status vs_jump(scene_model* m, scene_series* it, const Real* u0, const Real* du,
                                 const Real* dQ, const vs_kink* kink) {
  double theta = 0.0;
  double h = 0.1;
  Real x[MOST_SIZE];
  int i, steps;
  /* C depends on no acceleration and no input. */
  if (JUMPS_STRAIGHT && !(kink != 0 && kink->turns)) {
    if (!vs_jump_rate(m, it, 1.0, u0, 0, dQ, kink, x)) return SCENE_SINGULAR;
    for (i = 0; i < S; ++i) m->now.acceleration[i] += x[i];
    for (i = 0; i < K && TRANSMITS; ++i) m->now.multiplier[i] += x[S + i];
    return SCENE_OK;
  }
  for (steps = 0; steps < 1000000 && theta < 1.0; ++steps) {
    const scene_state before = m->now;
    double norm = INFINITY;
    int is_good;
    h = seriesSmaller(h, 1.0 - theta);
    is_good = vs_step_of_path(m, it, theta, h, u0, du, dQ, kink, &norm);
    if (is_good && norm <= 1.0 && kink == 0 && HAS_RESIDUAL) {
      is_good = vs_settle(m, it, VS_ONTO_CONSTRAINTS, vs_transmitted(m), 0, 0.0, 25) == SCENE_OK;
    }
    if (is_good && norm <= 1.0)
      theta = h < 1.0 - theta ? theta + h : 1.0;
    else
      m->now = before;
    h *= is_good ? fmin(5.0, fmax(0.2, 0.9 * pow(norm + 1e-10, -0.2))) : 0.2;
    if (!(h > 1e-14)) return SCENE_NO_MOTION;
  }
  return theta < 1.0 ? SCENE_NO_MOTION : SCENE_OK;
}
