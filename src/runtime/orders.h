/* The motion as power series of (t - t_n) / unit: with c_k unit^-k the coefficients of t,
 *     omega_{n+1} = unit/(n+1) epsilon_n,  phi_{n+1} = unit/(n+1) omega_n
 *     z_{n+1} = unit/(n+1) rate_n
 *     J epsilon_n - D' mu_n = a_n,  C epsilon_n = g_n
 * where a_n and g_n follow from the formulas, whose coefficients n are first made with epsilon_n =
 * 0 and then corrected. gauss: mu = lambda of J epsilon + n - Q = D' lambda; generalized: n mu_n =
 * unit Lambda_{n-1} of R' = C' Lambda + 1/2 J' omega J^-1 R, or, of constraints with a direction D
 * of their own, R' = (D' lambda)' + .. with lambda' = Lambda. Of gauss with a constraint of order 3
 * these are all constraints, D = C, and R' has no other part. */

/* a_n */
VS_FUNCTION_INLINE Real vs_force_rest(const scene_series* it, int i, int n) {
  const vs_row* const r = it->row;
  Real sum = r[torque_row[i]][n];
  int j;
  if (IS_GENERAL) {
    sum -= r[inertial_row[i]][n];
    for (j = 0; j < S; ++j)
      sum -= vs_convolve(r[pair_row[S * i + j]], r[ACCELERATION + j], n, 1, 0);
  } else if (INERTIA_VARIES) {
    sum -= r[inertial_row[i]][n] + vs_convolve(r[inertia_row[i]], r[ACCELERATION + i], n, 1, 0);
  }
  for (j = 0; j < S && IS_GENERAL && HAS_CONNECTION; ++j)
    sum += it->unit * (1.0 / n) * vs_convolve(r[turn_row[S * i + j]], r[PULL + j], n - 1, 0, 0);
  if (HAS_CONNECTION && !IS_GENERAL)
    sum += it->unit * (1.0 / n) * vs_convolve(r[connection_row[i]], r[PULL + i], n - 1, 0, 0);
  return sum;
}

/* Adds to a_n the products of the multipliers' lower coefficients with those of D, for constraint
 * p. */
VS_FUNCTION_INLINE void vs_add_pulls(const scene_series* it, int p, int n, Real* a) {
  const vs_row* const r = it->row;
  int e;
  for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
    const Real* const D = r[direction_row[S * p + entry_shaft[e]]];
    Real* const sum = a + entry_shaft[e];
    if (!entry_varies[e]) continue;
    if (IS_CLASSICAL)
      *sum += vs_convolve(D, r[MULTIPLIER + p], n, 1, 0);
    else if (has_direction[p])
      *sum += vs_convolve(D, r[TRANSMITTED + p], n, 1, 0);
    else
      *sum += it->unit * (1.0 / n) * vs_convolve(D, r[MULTIPLIER + p], n - 1, 1, 0);
  }
}

/* g_n: -psi_n, and of order 3, where C eta + c_0 = 0, -1/n (unit c_0,n-1 + sum_j (n-j) C_j
 * epsilon_{n-j}) */
VS_FUNCTION_INLINE Real vs_constraint_rest(const scene_series* it, int p, int n) {
  const vs_row* const r = it->row;
  Real sum;
  int e, j;
  if (order_of[p] < 3) return -r[residual_row[p]][n];
  sum = it->unit * r[residual_row[p]][n - 1];
  for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
    const int i = entry_shaft[e];
    const Real* const C = r[entry_row[S * p + i]];
    for (j = 1; j < n && entry_varies[e]; ++j) sum += (n - j) * C[j] * r[ACCELERATION + i][n - j];
  }
  return -sum * (1.0 / n);
}

/* b = J^-1 R of order n, of the connection 1/2 J' omega b, or B b, in R' */
VS_FUNCTION void vs_note_pull(scene_series* it, int n) {
  vs_row* const r = it->row;
  Real b[MOST_SHAFTS] = {0.0}, y[MOST_SHAFTS];
  int i, j, k;
  for (i = 0; i < S; ++i) {
    b[i] = r[inertial_row[i]][n] - r[torque_row[i]][n];
    for (j = VS_FIRST_COUPLED(i); j < VS_END_COUPLED(i); ++j)
      b[i] += vs_inertia(it, i, j) * r[ACCELERATION + j][n];
    for (k = IS_GENERAL ? 0 : i; k < (IS_GENERAL ? S : i + 1); ++k) {
      const Real* const J = r[IS_GENERAL ? pair_row[S * i + k] : inertia_row[i]];
      for (j = 1; j <= n; ++j) b[i] += J[j] * (r[ACCELERATION + k][n - j] - r[PULL + k][n - j]);
    }
  }
  vs_move(it, b, y);
  for (i = 0; i < S; ++i) r[PULL + i][n] = y[i];
}

/* 1/2 J' omega J^-1 R, or B J^-1 R: R' less its covariant form G */
VS_FUNCTION Real vs_connection(const scene_series* it, int i) {
  Real sum = 0.0;
  int j;
  for (j = 0; j < S && IS_GENERAL; ++j)
    sum += it->row[turn_row[S * i + j]][0] * it->row[PULL + j][0];
  if (INERTIA_VARIES && !IS_GENERAL) sum = it->row[connection_row[i]][0] * it->row[PULL + i][0];
  return sum;
}

/* Coefficients n of time and state. */
VS_FUNCTION_INLINE void vs_integrate(scene_series* it, int n) {
  vs_row* const r = it->row;
  const Real q = it->unit * (1.0 / n);
  int i;
  r[TIME][n] = n == 1 ? it->unit : 0.0;
  for (i = 0; i < S; ++i) {
    r[VELOCITY + i][n] = q * r[ACCELERATION + i][n - 1];
    r[ANGLE + i][n] = q * r[VELOCITY + i][n - 1];
    r[ACCELERATION + i][n] = 0.0;
  }
  for (i = 0; i < STATES; ++i) r[STATE + i][n] = q * r[rate_row[i]][n - 1];
}

/* The unknowns of order n, and the formulas that constraints read. */
VS_FUNCTION_INLINE void vs_solve_order(scene_series* it, int n) {
  vs_row* const r = it->row;
  const Real q = it->unit * (1.0 / n);
  Real x[MOST_SIZE];
  int i;
  for (i = 0; i < S; ++i) x[i] = vs_force_rest(it, i, n);
  for (i = 0; i < K; ++i) {
    vs_add_pulls(it, i, n, x);
    x[S + i] = vs_constraint_rest(it, i, n);
  }
  vs_solve(it, x);
  for (i = 0; i < S; ++i) r[ACCELERATION + i][n] = x[i];
  for (i = 0; i < K; ++i) {
    if (IS_CLASSICAL)
      r[MULTIPLIER + i][n] = x[S + i];
    else
      r[MULTIPLIER + i][n - 1] = x[S + i] / q;
    if (TRANSMITS) r[TRANSMITTED + i][n] = x[S + i];
  }
  vs_corrected(it, n, x);
}

/* Coefficients n of all rows; along a path, whose time and state are known, of the formulas. */
VS_FUNCTION_INLINE void vs_order(scene_series* it, int n) {
  if (!it->is_path) vs_integrate(it, n);
  vs_given(it, n);
  vs_tried(it, n);
  if (!it->is_path) vs_solve_order(it, n);
  vs_rest(it, n);
  if (!it->is_path && HAS_CONNECTION) vs_note_pull(it, n);
}

/* A function for each order, whose sums a compiler unrolls; scenes of very many formulas have one
 * for all. Compilers that share the work define a part of them each (VS_ORDERS_HERE). */
#ifdef VS_EACH_ORDER
#ifndef VS_ORDERS_HERE
#define VS_ORDERS_HERE(X) VS_EACH_ORDER(X)
#define VS_ORDER_STORAGE VS_FUNCTION_RARE
#endif
#define VS_ORDER_DECLARATION(n) VS_ORDER_STORAGE void vs_order_##n(scene_series* it);
VS_EACH_ORDER(VS_ORDER_DECLARATION)
#define VS_ORDER_FUNCTION(n)                             \
  VS_ORDER_STORAGE void vs_order_##n(scene_series* it) { \
    vs_order(it, n);                                     \
  }
VS_ORDERS_HERE(VS_ORDER_FUNCTION)
#define VS_CASE(n)    \
  case n:             \
    vs_order_##n(it); \
    break;
VS_FUNCTION void vs_extend(scene_series* it) {
  switch (++it->order) {
    VS_EACH_ORDER(VS_CASE)
    default:
      break;
  }
}
#else
VS_FUNCTION void vs_extend(scene_series* it) {
  vs_order(it, ++it->order);
}
#endif

/* Coefficients 1 of all formulas along a path whose own coefficients 1 are in the rows. */
VS_FUNCTION void vs_extend_path(scene_series* it) {
  it->is_path = 1;
  it->order = 0;
  vs_extend(it);
  it->is_path = 0;
}

/* True if no formula does along a path of theta units, whose time and state are in the rows up to
 * `last`, what its series there does not show. at: see vs_is_resolved_in_ranges. */
VS_FUNCTION_RARE int vs_is_path_resolved(scene_series* it, int last, double theta,
                                         const double* const* at) {
  double rest = 0.0; /* 0 * finite = 0 */
  int is_resolved, n, r;
  it->is_path = 1;
  for (it->order = 0; it->order < last;) vs_extend(it);
  it->is_path = 0;
  is_resolved = vs_is_resolved_in_ranges(it, theta, at);
  for (r = 0; r < SCENE_ROWS; ++r) {
    for (n = 0; n <= last; ++n) rest += 0.0 * it->row[r][n];
  }
  /* Sums by fours read what lies behind the last coefficient. */
  for (r = 0; r < SCENE_ROWS && rest != 0.0; ++r)
    memset(it->row[r] + 1, 0, sizeof it->row[r] - sizeof(Real));
  return is_resolved;
}

/* Polynomials of an implicit step leave no coefficients to the series that begins in their place:
 * those behind the degree of a formula stay 0. */
VS_FUNCTION_RARE void vs_forget_polynomials(scene_series* it) {
  int n, r;
  for (r = 0; r < SHOWN && it->method != VS_BY_SERIES; ++r) {
    for (n = 1; n <= it->order + 1; ++n) it->row[shown_row[r]][n] = 0.0;
  }
  it->method = VS_BY_SERIES;
}

/* The size of what a shaft has by itself: its applied torque and its inertial one, order n. */
VS_FUNCTION_INLINE double vs_own_size(const scene_series* it, int i, int n) {
  return fabs(it->row[torque_row[i]][n]) +
         vs_inertia(it, i, i) * fabs(it->row[ACCELERATION + i][n]);
}

/* The size of what row p transmits, and of what an element would while it slides. */
VS_FUNCTION_INLINE double vs_row_size(const scene_series* it, int p, int n) {
  double size = fabs(it->row[TRANSMITTED + p][n]);
  if (p >= CONSTRAINTS) size += fabs(it->row[slide_row[p - CONSTRAINTS]][n]);
  return size;
}

/* The size of coefficient n of all torques, each by itself. */
VS_FUNCTION_RARE double vs_size_of_all(const scene_series* it, int n) {
  double size = 0.0;
  int e, i, p;
  for (i = 0; i < S; ++i) size += vs_own_size(it, i, n);
  for (p = 0; p < K; ++p) {
    const double torque = vs_row_size(it, p, n);
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e)
      size += fabs(vs_direction(it, p, entry_shaft[e])) * torque;
  }
  return size;
}

/* Order 0 of all formulas is known. gauss: of the multipliers, too. is_factored: of the last
 * correction of the accelerations, which changes what matters only where C turns with them. */
VS_FUNCTION int vs_begin(scene_series* it, const Real* lambda, int is_factored) {
  it->order = 0;
  if (!is_factored || ENTRIES_TURN || IS_CURVED) {
    if (IS_GAUSS ? !vs_factor_curved(it, lambda, 1, 3) : !vs_factor(it, 1, 3)) return 0;
  }
  if (HAS_CONNECTION) vs_note_pull(it, 0);
  if (HOLDS) it->all_torques = vs_size_of_all(it, 0);
  if (!IS_CLASSICAL) vs_extend(it);
  return 1;
}

VS_FUNCTION scene_series* vs_series(scene_model* m) {
  return &m->series[m->present];
}

/* False where the last coefficients are not finite. */
VS_FUNCTION int vs_is_finite(const scene_series* it) {
  double rest = 0.0;
  int i;
  for (i = 0; i < S; ++i) rest += 0.0 * it->row[ACCELERATION + i][it->order];
  for (i = 0; i < K && IS_CLASSICAL; ++i) rest += 0.0 * it->row[MULTIPLIER + i][it->order];
  for (i = 0; i < STATES; ++i) rest += 0.0 * it->row[rate_row[i]][it->order];
  return rest == 0.0;
}

/* A power of two of at least `length` s. */
VS_FUNCTION double vs_unit_of(double length) {
  int exponent;
  frexp(length, &exponent);
  return ldexp(1.0, exponent);
}

/* True where the present series is that of the state. */
VS_FUNCTION int vs_is_begun(const scene_model* m) {
  const scene_state *const a = &m->now, *const b = &m->begun;
  int same = m->is_begun && a->time == b->time && a->time_rest == b->time_rest, i;
  for (i = 0; i < S; ++i) {
    same = same && a->angle[i] == b->angle[i] && a->velocity[i] == b->velocity[i] &&
           a->acceleration[i] == b->acceleration[i];
  }
  for (i = 0; i < HOLDS; ++i) same = same && a->mode[i] == b->mode[i];
  for (i = 0; i < INPUTS; ++i) {
    same = same && a->input[i].form == b->input[i].form && a->input[i].age == b->input[i].age &&
           a->input[i].start == b->input[i].start && a->input[i].target == b->input[i].target;
  }
  return same;
}

/* The series of the state, up to the orders that need no other. */
VS_FUNCTION int vs_begin_here(scene_model* m, double unit) {
  scene_series* const it = vs_series(m);
  m->begun = m->now;
  vs_forget_polynomials(it);
  it->unit = unit;
  vs_enter_inputs(m, it, SCENE_ORDER);
  vs_enter_state(m, it);
  m->is_begun = vs_begin(it, m->now.multiplier, 0);
  return m->is_begun;
}

/* Angles, velocities and, where they are a state, accelerations, up to this order. */
VS_FUNCTION int vs_last(const scene_series* it) {
  return IS_CLASSICAL ? it->order + 1 : it->order;
}

/* Coefficients N + 1 of angles, velocities and states, which follow from those of order N. */
VS_FUNCTION void vs_integrate_last(scene_series* it) {
  const int n = it->order;
  int i;
  for (i = 0; i < 2 * S; ++i)
    it->row[ANGLE + i][n + 1] = it->unit / (n + 1) * it->row[VELOCITY + i][n];
  for (i = 0; i < STATES; ++i)
    it->row[STATE + i][n + 1] = it->unit / (n + 1) * it->row[rate_row[i]][n];
}

/* True when the last terms are a small part of the tolerance for a step of theta units, and of the
 * terms before. */
VS_FUNCTION int vs_is_nothing(const scene_series* it, double theta) {
  const int last = vs_last(it);
  double power = theta;
  int c, n;
  for (n = 1; n < last; ++n) power *= theta;
  for (c = 0; c < WATCHED; ++c) {
    const Real* const x = it->row[watched_row[c]];
    const double term = fabs(x[it->order]) * (IS_CLASSICAL ? power / theta : power);
    if (!(term <= 1e-3 * vs_tolerance(it, x[0]))) return 0;
    if (!(term <= 1e-6 * seriesLarger(fabs(x[0]), fabs(x[1]) * theta))) return 0;
  }
  for (c = FIRST_JUDGED; c < COMPONENTS + STATES; ++c) {
    const Real* const x = it->row[c < COMPONENTS ? ANGLE + c : STATE + c - COMPONENTS];
    const double term = fabs(x[last]) * power;
    if (!(term <= 1e-3 * vs_tolerance(it, x[0]))) return 0;
    if (!(term <= 1e-6 * seriesLarger(fabs(x[0]), fabs(x[1]) * theta))) return 0;
  }
  return 1;
}

/* The largest theta at which the last two terms of the judged rows are a part of the tolerance:
 * the last of degree n within 1/part of it, the one before, which may vanish by accident less
 * often than a single one does, within the part that it has where coefficients decay as the
 * tolerance asks for. */
VS_FUNCTION_INLINE double vs_log_length(const scene_series* it, int first, int count, int n,
                                        double part) {
  const double decay = DECAY;
  double last = 0.0, before = 0.0;
  int c;
  for (c = first; c < first + count; ++c) {
    const Real* const x = it->row[c];
    const double allowed = part / vs_tolerance(it, x[0]);
    last = seriesLarger(last, VS_JUDGED(x, n, part, allowed));
    before = seriesLarger(before, VS_JUDGED(x, n - 1, part, allowed));
  }
  return seriesSmaller(-log(last) / n, -log(before * decay) / (n - 1));
}

/* The longest step, s, for which the last terms are within the tolerance. The accelerations of
 * gauss are an output, whose own tolerance the step's end is asked for (vs_defect). Up to limit,
 * s, no function does what its series does not show. */
VS_FUNCTION double vs_choose_length(const scene_series* it, double limit) {
  const double kept =
      6.0; /* part of the tolerance for the last term; those behind it are unknown */
  const int last = vs_last(it);
  const double longest_rates =
      vs_log_length(it, ACCELERATION, S, it->order, IS_CLASSICAL ? 0.4 : kept);
  const double longest_values =
      vs_log_length(it, ANGLE + FIRST_JUDGED, 2 * S - FIRST_JUDGED, last, kept);
  double theta = exp(seriesSmaller(longest_rates, longest_values));
  int halvings, c;
  for (c = 0; c < WATCHED; ++c) {
    theta = seriesSmaller(theta, exp(vs_log_length(it, watched_row[c], 1, it->order, 0.4)));
  }
  if (STATES > 0)
    theta = seriesSmaller(theta, exp(vs_log_length(it, STATE, STATES, it->order + 1, kept)));
  for (c = 0; c < DELAYS; ++c)
    theta = seriesSmaller(theta, exp(vs_log_length(it, delayed_row[c], 1, it->order, kept)));
  for (halvings = 0; halvings < 60; ++halvings) {
    const double taken = seriesSmaller(theta, limit / it->unit);
    if (vs_is_resolved(it, taken)) break;
    theta = 0.5 * taken;
  }
  return theta * it->unit;
}

/* The longest step, s: twice the last one of a motion that is still. */
VS_FUNCTION double vs_longest(const scene_model* m) {
  return seriesLarger(m->at_rest, MAXIMUM_STEP);
}

/* The series of the state as far as steps of `limit` s need them, and how long a step may be. */
VS_FUNCTION scene_status vs_expand(scene_model* m, double limit) {
  scene_series* const it = vs_series(m);
  double unit = m->usual > 0.0 ? seriesSmaller(m->usual, limit) : limit;
  const int is_short = VS_MAY_END_EARLY && limit < 0.5 * m->usual;
  int trial, i;
  for (trial = 0; trial < 12; ++trial, unit *= 1.0 / 64.0) {
    int small = 0, is_resolved = 0;
    double theta;
    if ((trial > 0 || !vs_is_begun(m)) && !vs_begin_here(m, vs_unit_of(unit)))
      return SCENE_SINGULAR;
    theta = limit / it->unit;
    while (it->order < SCENE_ORDER && !(is_resolved && small > 2)) {
      /* An order of the formulas shows in the next term of the state. */
      is_resolved = small >= 2 && it->order > 3 && vs_is_resolved(it, theta);
      vs_extend(it);
      if (!is_short) continue;
      vs_integrate_last(it);
      small = vs_is_nothing(it, theta) ? small + 1 : 0;
    }
    if (!vs_is_finite(it)) { /* too long a unit overflows; else nothing helps */
      for (i = 0; i < SCENE_ROWS; ++i) memset(it->row[i] + 1, 0, sizeof it->row[i] - sizeof(Real));
      continue;
    }
    vs_integrate_last(it);
    /* A motion that is a polynomial allows any length, but its powers must not overflow. */
    m->usual = seriesSmaller(m->fixed > 0.0 ? m->fixed : vs_choose_length(it, limit),
                             seriesSmaller(vs_longest(m), seriesSmaller(1e6, 1e8 * it->unit)));
    return SCENE_OK;
  }
  return SCENE_NOT_FINITE;
}
