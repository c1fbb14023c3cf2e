/* Implicit steps, for motions whose fastest components have died away: Radau IIA (radau_tables.h).
 * Stage j, at t + c_j h, has the unknowns y = (epsilon, mu, z'), and
 *     omega_j = omega + h sum_k A_jk epsilon_k,  phi_j = phi + h sum_k A_jk omega_k,
 *     z_j = z + h sum_k A_jk z'_k,  z'_j = rate_j,
 *     psi_j = 0, of order 3 C eta_j + c_0 = 0 with the slope eta of epsilon's polynomial,
 *     R_j = D_j' mu_j of gauss,
 *     R_j = R + h sum_k A_jk P_k of generalized_gauss,  P = C' mu + 1/2 J' omega J^-1 R,
 * with R = J epsilon + n - Q, less D' times the integral of mu for constraints with a direction of
 * their own. No derivative of a torque is needed, and stages satisfy psi = 0 however stiff it is.
 * Newton's iteration has the exact derivatives by the state at the beginning; they are coefficients
 * 1 of the rows along each direction. With A = T diag(g / h) T^-1 it is one real system and some
 * complex ones of the size of y, with omega = g epsilon, phi = g^2 epsilon, z = g z'.
 *
 * A step's polynomials through the stages take the place of its series: all that follows (events,
 * samples, the step's end) reads rows. */

/* The number of unknowns of a stage, and of directions that residuals are differentiated along. */
#define UNKNOWNS (SIZE + STATES)
#define DIRECTIONS (3 * S + STATES)

/* The order of series along a step that was made by other means. */
enum { VS_ALONG = 8 };

#ifndef VS_WORK
#define VS_WORK(m) (m)->work
#define VS_PIVOTS(m) (m)->pivot
#endif

/* The arrays of a step, which are in the model's memory. */
typedef struct {
  const vs_radau* method;
  double h;                   /* s */
  double *y, *residual, *sum; /* stages x unknowns */
  double *R, *P;              /* R and its rate, stages + 1 (the first: of the begin) x S */
  double* input;              /* rows of inputs, stages x INPUT_ROW_COUNT */
  double* slope;              /* of residuals, directions x unknowns */
  double* pull_slope;         /* of P, directions x S */
  double* values;             /* of all rows at three stages */
  double* noise;              /* of accelerations, by rounding; S */
  double *real, *pair[VS_MOST_PAIRS];
  int *real_pivot, *pair_pivot[VS_MOST_PAIRS];
} vs_stages;

VS_FUNCTION_RARE void vs_lay_out(scene_model* m, int which, vs_stages* of) {
  double* next = VS_WORK(m);
  int* pivot = VS_PIVOTS(m);
  int p;
  (void)m;
  of->method = &vs_radau_of[which];
#define VS_PLACE(field, count) of->field = next, next += (count)
  VS_PLACE(y, VS_MOST_STAGES * UNKNOWNS);
  VS_PLACE(residual, VS_MOST_STAGES * UNKNOWNS);
  VS_PLACE(sum, VS_MOST_STAGES * UNKNOWNS);
  VS_PLACE(R, (VS_MOST_STAGES + 1) * S);
  VS_PLACE(P, (VS_MOST_STAGES + 1) * S);
  VS_PLACE(input, VS_MOST_STAGES * INPUT_ROW_COUNT);
  VS_PLACE(slope, DIRECTIONS * UNKNOWNS);
  VS_PLACE(pull_slope, DIRECTIONS * S);
  VS_PLACE(values, 3 * SCENE_ROWS);
  VS_PLACE(noise, S);
  VS_PLACE(real, UNKNOWNS * UNKNOWNS);
  for (p = 0; p < VS_MOST_PAIRS; ++p) VS_PLACE(pair[p], 2 * UNKNOWNS * UNKNOWNS);
#undef VS_PLACE
  of->real_pivot = pivot;
  for (p = 0; p < VS_MOST_PAIRS; ++p) of->pair_pivot[p] = pivot + 3 * (p + 1) * UNKNOWNS;
}

/* ---- Stages ---- */

/* The rows of inputs at each stage of a step from `from`. */
VS_FUNCTION_RARE void vs_enter_stage_inputs(scene_model* m, scene_series* w,
                                            const scene_state* from, const vs_stages* of) {
  int i, j, k;
  for (j = 0; j < of->method->stages; ++j) {
    const double at = of->method->point[j] * of->h;
    for (i = 0; i < INPUTS; ++i) {
      scene_signal* const s = &m->now.input[i];
      const int has_arrived = from->input[i].age + at >= s->end * (1.0 - 1e-14);
      s->age = has_arrived ? s->end : from->input[i].age + at;
    }
    vs_enter_inputs(m, w, 0);
    for (k = 0; k < INPUT_ROW_COUNT; ++k)
      of->input[INPUT_ROW_COUNT * j + k] = w->row[input_row[k]][0];
  }
  for (i = 0; i < INPUTS; ++i) m->now.input[i].age = from->input[i].age;
}

/* sum_k A_jk y_k of n unknowns from the first one on. */
VS_FUNCTION_INLINE double vs_sum_of_stages(const vs_stages* of, const double* weight, int n) {
  double sum = weight[0] * of->y[n];
  int k;
  for (k = 1; k < of->method->stages; ++k) sum += weight[k] * of->y[UNKNOWNS * k + n];
  return sum;
}

/* The state at stage j. */
VS_FUNCTION_INLINE void vs_enter_stage_state(scene_series* w, const scene_state* from,
                                             const vs_stages* of, int j) {
  const double* const y = of->y + UNKNOWNS * j;
  const double* const weight = of->method->A[j];
  const double at = of->method->point[j] * of->h;
  int i;
  for (i = 0; i < S; ++i) {
    w->row[ACCELERATION + i][0] = y[i];
    w->row[VELOCITY + i][0] = from->velocity[i] + of->h * vs_sum_of_stages(of, weight, i);
    w->row[ANGLE + i][0] = from->angle[i] + at * from->velocity[i] +
                           of->h * of->h * vs_sum_of_stages(of, of->method->A2[j], i);
  }
  for (i = 0; i < K; ++i) {
    w->row[MULTIPLIER + i][0] = y[S + i];
    if (TRANSMITS && !IS_CLASSICAL)
      w->row[TRANSMITTED + i][0] =
          from->multiplier[i] + of->h * vs_sum_of_stages(of, weight, S + i);
  }
  for (i = 0; i < STATES; ++i)
    w->row[STATE + i][0] =
        from->input[state_input[i]].start + of->h * vs_sum_of_stages(of, weight, SIZE + i);
}

/* All formulas at stage j. */
VS_FUNCTION_RARE void vs_enter_stage(scene_series* w, const scene_state* from, const vs_stages* of,
                                     int j) {
  int k;
  w->row[TIME][0] = from->time + (from->time_rest + of->method->point[j] * of->h);
  for (k = 0; k < INPUT_ROW_COUNT; ++k)
    w->row[input_row[k]][0] = of->input[INPUT_ROW_COUNT * j + k];
  vs_enter_stage_state(w, from, of, j);
  vs_enter_formulas(w);
}

/* R, and P = C' Lambda + 1/2 J' omega J^-1 R, of the state that was entered. With a direction of
 * its own, D' lambda of a constraint is no part of R. */
VS_FUNCTION_INLINE int vs_find_reaction(scene_series* w, double* R, double* P) {
  int e, i, p;
  if (HAS_CONNECTION) {
    if (!vs_factor_inertia(w)) return 0;
    vs_note_pull(w, 0);
  }
  vs_reaction(w, R);
  for (i = 0; i < S; ++i) P[i] = HAS_CONNECTION ? (double)vs_connection(w, i) : 0.0;
  for (p = 0; p < K; ++p) {
    const int is_own = IS_CLASSICAL || has_direction[p];
    const double transmitted = w->row[TRANSMITTED + p][0], Lambda = w->row[MULTIPLIER + p][0];
    for (e = entry_begin[p]; e < entry_begin[p + 1] && vs_is_on(w, p); ++e) {
      i = entry_shaft[e];
      if (is_own)
        R[i] -= vs_direction(w, p, i) * transmitted;
      else
        P[i] += vs_entry(w, p, i) * Lambda;
    }
  }
  return 1;
}

/* The residuals of all stages, with the rows of stage j noted as coefficients j + 1 of the step's.
 */
VS_FUNCTION_RARE int vs_find_residuals(scene_series* it, scene_series* w, const scene_state* from,
                                       const vs_stages* of) {
  const int s = of->method->stages;
  int e, i, j, k, p, r;
  for (j = 0; j < s; ++j) {
    double* const F = of->residual + UNKNOWNS * j;
    vs_enter_stage(w, from, of, j);
    if (!vs_find_reaction(w, of->R + S * (j + 1), of->P + S * (j + 1))) return 0;
    for (p = 0; p < K; ++p) {
      F[S + p] = vs_is_on(w, p) ? w->row[residual_row[p]][0] : w->row[MULTIPLIER + p][0];
      for (e = entry_begin[p]; e < entry_begin[p + 1] && order_of[p] == 3; ++e) {
        double eta = 0.0;
        i = entry_shaft[e];
        for (k = 0; k < s; ++k)
          eta += of->method->inverse[j][k] * (of->y[UNKNOWNS * k + i] - from->acceleration[i]);
        F[S + p] += vs_entry(w, p, i) * eta / of->h;
      }
    }
    for (i = 0; i < STATES; ++i)
      F[SIZE + i] = of->y[UNKNOWNS * j + SIZE + i] - w->row[rate_row[i]][0];
    for (r = 0; r < SHOWN; ++r) it->row[shown_row[r]][j + 1] = w->row[shown_row[r]][0];
  }
  for (j = 0; j < s; ++j) {
    for (i = 0; i < S; ++i) {
      double* const F = of->residual + UNKNOWNS * j + i;
      *F = of->R[S * (j + 1) + i];
      if (IS_CLASSICAL) continue;
      *F -= of->R[i];
      for (k = 0; k < s; ++k) *F -= of->h * of->method->A[j][k] * of->P[S * (k + 1) + i];
    }
  }
  return 1;
}

/* ---- Newton's iteration ---- */

/* The unknown that moves the state along a direction, and the row of what is moved: epsilon, omega,
 * phi of each shaft, then z. */
VS_FUNCTION_INLINE int vs_unknown_along(int q) {
  return q < 3 * S ? q % S : SIZE + q - 3 * S;
}
VS_FUNCTION_INLINE int vs_row_along(int q) {
  if (q >= 3 * S) return STATE + q - 3 * S;
  return (q < S ? ACCELERATION : q < 2 * S ? VELOCITY : ANGLE) + q % S;
}

/* The derivatives of residuals, and of P, along direction q, which are coefficients 1 of the rows.
 */
VS_FUNCTION_RARE void vs_note_slopes(const scene_series* w, const scene_state* from,
                                     const vs_stages* of, int q) {
  const int unknown = vs_unknown_along(q);
  double* const slope = of->slope + UNKNOWNS * q;
  double* const pull = of->pull_slope + S * q;
  int e, i, j, l, p;
  for (l = link_begin[unknown]; l < link_begin[unknown + 1]; ++l) {
    const int row = linked[l];
    if (row < S) {
      slope[row] = w->row[inertial_row[row]][1] - w->row[torque_row[row]][1];
      for (j = 0; j < S && IS_GENERAL; ++j)
        slope[row] += w->row[pair_row[S * row + j]][1] * from->acceleration[j];
      if (INERTIA_VARIES && !IS_GENERAL)
        slope[row] += w->row[inertia_row[row]][1] * from->acceleration[row];
      continue;
    }
    if (row >= SIZE) {
      slope[row] = -w->row[rate_row[row - SIZE]][1];
      continue;
    }
    p = row - S;
    if (!vs_is_on(w, p)) continue;
    slope[row] = w->row[residual_row[p]][1];
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      i = entry_shaft[e];
      if (IS_CLASSICAL || has_direction[p])
        slope[i] -= w->row[direction_row[S * p + i]][1] * w->row[TRANSMITTED + p][0];
      else
        pull[i] += w->row[entry_row[S * p + i]][1] * w->row[MULTIPLIER + p][0];
    }
  }
}

/* The derivatives of the residuals by the state that was entered in w, along each of epsilon,
 * omega, phi and z: along a group of directions at once. Slopes that are not finite, as that of a
 * root at 0, become 0: Newton's iteration converges by itself in a step that is short enough. */
VS_FUNCTION_RARE void vs_find_slopes(scene_series* w, const scene_state* from,
                                     const vs_stages* of) {
  int has_endless = 0, g, i, k, l, n, q;
  for (i = ANGLE; i < STATE; ++i) w->row[i][1] = 0.0;
  for (k = 0; k < INPUT_ROW_COUNT; ++k) w->row[input_row[k]][1] = 0.0;
  w->row[TIME][1] = 0.0;
  for (q = 0; q < DIRECTIONS; ++q) {
    for (l = link_begin[vs_unknown_along(q)]; l < link_begin[vs_unknown_along(q) + 1]; ++l) {
      of->slope[UNKNOWNS * q + linked[l]] = 0.0;
      if (linked[l] < S) of->pull_slope[S * q + linked[l]] = 0.0;
    }
  }
  for (g = 0; g < GROUPS; ++g) {
    for (q = 0; q < DIRECTIONS; ++q) w->row[vs_row_along(q)][1] = group_of[q] == g;
    vs_extend_path(w);
    for (q = 0; q < DIRECTIONS; ++q) {
      if (group_of[q] == g) vs_note_slopes(w, from, of, q);
    }
  }
  for (q = 0; q < DIRECTIONS; ++q) w->row[vs_row_along(q)][1] = 0.0;
  for (q = 0; q < DIRECTIONS; ++q) {
    for (l = link_begin[vs_unknown_along(q)]; l < link_begin[vs_unknown_along(q) + 1]; ++l) {
      double* const slope = &of->slope[UNKNOWNS * q + linked[l]];
      double* const pull = &of->pull_slope[S * q + linked[l]];
      if (!isfinite(*slope)) has_endless = 1, *slope = 0.0;
      if (linked[l] < S && !isfinite(*pull)) *pull = 0.0;
    }
  }
  for (n = 0; n < SCENE_ROWS && has_endless; ++n)
    memset(w->row[n] + 1, 0, sizeof w->row[n] - sizeof(Real));
}

/* Entry (i, q) of the derivative of residual i by unknown q:
 *     f[0] + f[1] g + f[2] g^2 + f[3] g^3 + f[4] / g */
VS_FUNCTION_INLINE void vs_find_powers(const scene_series* w, const vs_stages* of, int i, int q,
                                       double* f) {
  int n;
  for (n = 0; n < 5; ++n) f[n] = 0.0;
  if (q < S) {
    for (n = 0; n < 3; ++n) f[n] = of->slope[UNKNOWNS * (S * n + q) + i];
    for (n = 0; n < 3 && i < S && !IS_CLASSICAL; ++n)
      f[n + 1] -= of->pull_slope[S * (S * n + q) + i];
    if (i < S) f[0] += i == q || IS_COUPLED ? (double)vs_inertia(w, i, q) : 0.0;
    if (i < S || i >= SIZE || !vs_is_on(w, i - S)) return;
    if (order_of[i - S] == 3)
      f[4] = vs_entry(w, i - S, q);
    else /* (the slope along epsilon, if it was found, is C, too) */
      f[0] = vs_entry(w, i - S, q);
  } else if (q < SIZE) {
    if (i == q && !vs_is_on(w, i - S)) f[0] = 1.0;
    if (i < S && vs_is_on(w, q - S)) f[!IS_CLASSICAL] = -vs_direction(w, q - S, i);
  } else {
    f[1] = of->slope[UNKNOWNS * (2 * S + q - K) + i];
    if (i < S && !IS_CLASSICAL) f[2] = -of->pull_slope[S * (2 * S + q - K) + i];
    if (i == q) f[0] = 1.0;
  }
}

/* A matrix of zeros, in the place of the last one, and the envelope of what will be in it. */
VS_FUNCTION_RARE void vs_begin_matrix(double* re, double* im, int* pivot) {
  const int n = UNKNOWNS;
  int *const begin = pivot + n, *const end = pivot + 2 * n;
  int i, j;
  for (i = 0; i < n; ++i) {
    for (j = begin[i]; j < end[i]; ++j) {
      re[n * i + j] = 0.0;
      if (im != 0) im[n * i + j] = 0.0;
    }
    begin[i] = envelope_begin[i];
    end[i] = envelope_end[i];
  }
}

/* The factors of the matrices of a step of h. False where one is singular. */
VS_FUNCTION_RARE int vs_factor_stages(const scene_series* w, const vs_stages* of) {
  const int n = UNKNOWNS, pairs = of->method->stages / 2;
  const double g = of->h / of->method->real;
  double re[VS_MOST_PAIRS], im[VS_MOST_PAIRS], f[5];
  int l, p, q;
  for (p = 0; p < pairs; ++p) { /* h / (a + i b) */
    const double a = of->method->pair[p][0], b = of->method->pair[p][1];
    re[p] = of->h * a / (a * a + b * b);
    im[p] = -of->h * b / (a * a + b * b);
  }
  vs_begin_matrix(of->real, 0, of->real_pivot);
  for (p = 0; p < pairs; ++p) vs_begin_matrix(of->pair[p], of->pair[p] + n * n, of->pair_pivot[p]);
  for (q = 0; q < n; ++q) {
    for (l = link_begin[q]; l < link_begin[q + 1]; ++l) {
      const int at = n * place_of[linked[l]] + place_of[q];
      vs_find_powers(w, of, linked[l], q, f);
      of->real[at] = f[0] + g * (f[1] + g * (f[2] + g * f[3])) + f[4] / g;
      for (p = 0; p < pairs; ++p) {
        const double square = re[p] * re[p] + im[p] * im[p];
        double x = f[3], y = 0.0, z;
        int k;
        for (k = 2; k >= 0; --k) {
          z = x * re[p] - y * im[p] + f[k];
          y = x * im[p] + y * re[p];
          x = z;
        }
        of->pair[p][at] = x + f[4] * re[p] / square;
        of->pair[p][n * n + at] = y - f[4] * im[p] / square;
      }
    }
  }
  if (!vs_decompose(of->real, 0, n, of->real_pivot)) return 0;
  for (p = 0; p < pairs; ++p) {
    if (!vs_decompose(of->pair[p], of->pair[p] + n * n, n, of->pair_pivot[p])) return 0;
  }
  return 1;
}

/* True where rounding moves accelerations by more than their tolerance. */
VS_FUNCTION_RARE int vs_is_rounded(const scene_series* it, const double* noise) {
  int i;
  for (i = 0; i < S; ++i) {
    if (noise[i] > vs_tolerance(it, it->row[ACCELERATION + i][0])) return 1;
  }
  return 0;
}

/* Finds the part of each acceleration that rounding of the state makes, by the torques and by psi,
 * which moves the accelerations along J^-1 C'. Where the torques' is much, so does what they move
 * psi by, and rounding of the time inside formulas counts, too. */
VS_FUNCTION_RARE void vs_find_noise(const scene_series* it, scene_series* w, const vs_stages* of) {
  double changed[MOST_SIZE + MOST_INPUTS] = {0.0}; /* residuals, by the state as a whole */
  double own[MOST_SHAFTS];
  int e, i, l, p, q, is_rounded;
  for (q = 0; q < S; ++q) {
    for (l = link_begin[q]; l < link_begin[q + 1]; ++l)
      changed[linked[l]] +=
          fabs(of->slope[UNKNOWNS * (S + q) + linked[l]] * it->row[VELOCITY + q][0]) +
          fabs(of->slope[UNKNOWNS * (2 * S + q) + linked[l]] * it->row[ANGLE + q][0]);
  }
  for (i = 0; i < S; ++i) own[i] = 4.0 * DBL_EPSILON * changed[i] / vs_inertia(it, i, i);
  is_rounded = vs_is_rounded(it, own);
  if (is_rounded) {
    w->row[TIME][1] = 1.0;
    vs_extend_path(w);
    w->row[TIME][1] = 0.0;
    for (i = 0; i < S; ++i)
      own[i] += 2.0 * DBL_EPSILON * fabs(it->row[TIME][0] * w->row[torque_row[i]][1]) /
                vs_inertia(it, i, i);
  }
  for (i = 0; i < S; ++i) of->noise[i] = own[i];
  for (p = 0; p < K; ++p) {
    const double length = vs_row_length(it, p);
    double moved = order_of[p] == 2 ? DBL_EPSILON * changed[S + p] : 0.0;
    if (!vs_is_on(it, p)) continue;
    for (e = entry_begin[p]; e < entry_begin[p + 1] && is_rounded; ++e)
      moved += fabs(vs_entry(it, p, entry_shaft[e])) * own[entry_shaft[e]];
    for (e = entry_begin[p]; e < entry_begin[p + 1] && moved > 0.0; ++e) {
      i = entry_shaft[e];
      of->noise[i] += moved * fabs(vs_entry(it, p, i)) / (vs_inertia(it, i, i) * length);
    }
  }
}

/* Part of the tolerance that Newton's iteration may leave. */
#define VS_LEFT 0.02

/* x = the solution of the real system of a step. */
VS_FUNCTION_RARE void vs_solve_stage(const vs_stages* of, double* x) {
  double y[MOST_SIZE + MOST_INPUTS];
  int i;
  for (i = 0; i < UNKNOWNS; ++i) y[place_of[i]] = x[i];
  vs_substitute(of->real, 0, UNKNOWNS, of->real_pivot, y, 0);
  for (i = 0; i < UNKNOWNS; ++i) x[i] = y[place_of[i]];
}

/* One correction of the stages. Its size in tolerances of the state at the begin, and *most_pushed:
 * that of what the multipliers' corrections make of R, which was found by those before. */
VS_FUNCTION_RARE double vs_correct_stages(const scene_series* it, const vs_stages* of,
                                          double* most_pushed) {
  const vs_radau* const method = of->method;
  const int s = method->stages, n = UNKNOWNS;
  double size = 0.0, rest = 0.0;
  int e, i, j, k, p;
  *most_pushed = 0.0;
  for (k = 0; k < s; ++k) {
    for (i = 0; i < n; ++i) {
      double sum = 0.0;
      for (j = 0; j < s; ++j) sum -= method->from_T[k][j] * of->residual[n * j + i];
      of->sum[n * k + place_of[i]] = sum;
    }
  }
  vs_substitute(of->real, 0, n, of->real_pivot, of->sum, 0);
  for (k = 1; k < s; k += 2)
    vs_substitute(of->pair[k / 2], of->pair[k / 2] + n * n, n, of->pair_pivot[k / 2],
                  of->sum + n * k, of->sum + n * (k + 1));
  for (j = 0; j < s; ++j) {
    for (i = 0; i < n; ++i) {
      double change = 0.0;
      for (k = 0; k < s; ++k) change += method->T[j][k] * of->sum[n * k + place_of[i]];
      of->residual[n * j + i] = change;
      of->y[n * j + i] += change;
      rest += 0.0 * change;
    }
  }
  for (j = 0; j < s; ++j) {
    double pushed[MOST_SHAFTS] = {0.0};
    for (p = 0; p < K && !IS_CLASSICAL; ++p) { /* (of gauss R follows from the multipliers) */
      double moved = 0.0;
      for (k = 0; k < s; ++k) moved += method->A[j][k] * of->residual[n * k + S + p];
      for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e)
        pushed[entry_shaft[e]] += of->h * moved * vs_direction(it, p, entry_shaft[e]);
    }
    for (i = 0; i < n; ++i) {
      double change = 0.0, allowed;
      const int row = i < S ? VELOCITY + i : i < SIZE ? TRANSMITTED + i - S : STATE + i - SIZE;
      if (i >= S && i < SIZE && (IS_CLASSICAL || !TRANSMITS)) continue;
      for (k = 0; k < s; ++k) change += method->A[j][k] * of->residual[n * k + i];
      change = fabs(of->h * change) / vs_tolerance(it, it->row[row][0]);
      size = seriesLarger(size, change);
      if (i >= S) continue;
      allowed = vs_tolerance(it, it->row[ACCELERATION + i][0]) + of->noise[i] / VS_LEFT;
      change = (IS_CLASSICAL ? 0.1 : 1.0) * fabs(of->residual[n * j + i]) / allowed;
      size = seriesLarger(size, change);
      *most_pushed = seriesLarger(*most_pushed, fabs(pushed[i] / (vs_inertia(it, i, i) * allowed)));
    }
  }
  return size + rest;
}

/* Newton's iterations, the number of which is *rounds. False where they do not converge. */
VS_FUNCTION_RARE int vs_find_stages(scene_series* it, scene_series* w, const scene_state* from,
                                    const vs_stages* of, int* rounds) {
  enum { VS_MOST_ROUNDS = 8 };
  double previous = 0.0, rate = 1.0;
  for (*rounds = 1; *rounds <= VS_MOST_ROUNDS; ++*rounds) {
    double size, pushed;
    if (!vs_find_residuals(it, w, from, of)) return 0;
    size = vs_correct_stages(it, of, &pushed);
    if (!isfinite(size)) return 0;
    /* (A first correction tells nothing of the rate at which others would become smaller.) */
    if (size <= (*rounds > 1 ? 0.1 : 1e-4) * VS_LEFT) return 1;
    if (*rounds > 1) {
      rate = size / previous;
      if (rate >= 1.0) return size <= VS_LEFT; /* rounding is all that is left */
      if (rate / (1.0 - rate) * size <= VS_LEFT && pushed <= VS_LEFT) return 1;
      if (*rounds > 3 && pow(rate, VS_MOST_ROUNDS - *rounds) / (1.0 - rate) * size > VS_LEFT)
        return 0;
    }
    previous = size;
  }
  return 0;
}
