/* The formulas at a state, and the linear systems of a motion,
 *     J epsilon - D' mu = a,   C epsilon = g
 * which orders of a series, projections, jumps and first accelerations solve. */

/* Methods of steps: series, stages of Radau IIA, a scheme of the host. */
enum { VS_BY_SERIES, VS_IMPLICIT, VS_EXPLICIT };

/* Modes of elements that hold. A sliding one has a torque with the sign of its slip, one that is
 * stuck a constraint. */
enum { VS_BACKWARD = -1, VS_STUCK = 0, VS_FORWARD = 1, VS_FREE = 2 };
/* Sides of an event of the scene, beside modes: its function is below 0, above 0. */
enum { VS_BELOW = 3, VS_ABOVE = 4 };

/* The mode of an element by its law: of losses 1 where the first shaft drives, -1 where the second
 * does. */
VS_FUNCTION int vs_plain_mode(int h, int mode) {
  if (load_of[h] < 0 || mode == VS_STUCK || mode == VS_FREE) return mode;
  return mode == 1 || mode == -1 ? 1 : -1;
}

VS_FUNCTION double vs_tolerance(const scene_series* it, double size) {
  (void)it;
  return ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * fabs(size);
}

VS_FUNCTION void vs_set_constants(scene_model* m) {
  int i;
  for (i = 0; i < CONSTANTS; ++i) {
    m->series[0].row[constant_row[i]][0] = constant_value[i];
    m->series[1].row[constant_row[i]][0] = constant_value[i];
  }
  m->series[0].unit = m->series[1].unit = 1.0;
}

/* All formulas at the state that is in the rows. */
VS_FUNCTION_RARE void vs_enter_formulas(scene_series* it) {
  vs_given(it, 0);
  vs_tried(it, 0);
  vs_rest(it, 0);
}

/* All formulas at the present state, with the inputs that were entered. */
VS_FUNCTION void vs_enter_state(const scene_model* m, scene_series* it) {
  int i;
  it->row[TIME][0] = m->now.time;
  for (i = 0; i < S; ++i) {
    it->row[ANGLE + i][0] = m->now.angle[i];
    it->row[VELOCITY + i][0] = m->now.velocity[i];
    it->row[ACCELERATION + i][0] = m->now.acceleration[i];
  }
  for (i = 0; i < K; ++i) it->row[MULTIPLIER + i][0] = m->now.multiplier[i];
  for (i = 0; i < K && TRANSMITS; ++i) it->row[TRANSMITTED + i][0] = m->now.multiplier[i];
  for (i = 0; i < HOLDS; ++i) {
    it->counts[i] = m->now.counts[i];
    it->row[side_row[i]][0] = m->now.side[i];
    it->row[mode_row[i]][0] = m->now.told[i];
    it->row[counts_row[i]][0] = m->now.counts[i];
  }
  vs_enter_formulas(it);
}

VS_FUNCTION Real vs_entry(const scene_series* it, int p, int i) {
  return it->row[entry_row[S * p + i]][0];
}

/* D, along which the reaction of a constraint acts: C but of those with a direction of their own.
 */
VS_FUNCTION Real vs_direction(const scene_series* it, int p, int i) {
  return it->row[direction_row[S * p + i]][0];
}

VS_FUNCTION Real vs_inertia(const scene_series* it, int i, int j) {
  if (IS_GENERAL) return it->row[pair_row[S * i + j]][0];
  return i == j ? it->row[inertia_row[i]][0] : coupling[S * i + j];
}

/* C J^-1 C' of one constraint, of J its diagonal. */
VS_FUNCTION double vs_row_length(const scene_series* it, int p) {
  double length = 0.0;
  int e;
  for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
    const int i = entry_shaft[e];
    length += vs_entry(it, p, i) * vs_entry(it, p, i) / vs_inertia(it, i, i);
  }
  return length;
}

/* R = J epsilon + n - Q */
VS_FUNCTION void vs_reaction(const scene_series* it, Real* R) {
  int i, j;
  for (i = 0; i < S; ++i) {
    R[i] = it->row[inertial_row[i]][0] - it->row[torque_row[i]][0];
    for (j = 0; j < S; ++j) {
      if (i == j || IS_COUPLED) R[i] += vs_inertia(it, i, j) * it->row[ACCELERATION + j][0];
    }
  }
}

/* False for the rows of elements that do not hold at present. */
VS_FUNCTION int vs_is_on(const scene_series* it, int constraint) {
  return constraint < CONSTRAINTS || it->counts[constraint - CONSTRAINTS];
}

VS_FUNCTION int vs_is_counted(const scene_series* it, int constraint, int low, int high) {
  return order_of[constraint] >= low && order_of[constraint] <= high && vs_is_on(it, constraint);
}

/* Pivots of an elimination: above 0, as those of an inertia are; above a part of the diagonal that
 * the matrix began with; or sought in their columns. */
enum { VS_POSITIVE, VS_RANKED, VS_SOUGHT };

/* Gauss and Jordan's elimination in an n x n matrix, of the columns from `first` on; of all, it
 * leaves the inverse. *distance: the least pivot as a part of its diagonal element, where they are
 * ranked, the square of how far apart rows are. */
VS_FUNCTION_INLINE int vs_invert(Real* M, int n, int first, int end, int pivots, const Real* size,
                                 double* distance) {
  int best[MOST_SIZE], i, j, p;
  for (p = first; p < end; ++p) {
    Real pivot;
    best[p] = p;
    for (i = p + 1; i < n && pivots == VS_SOUGHT; ++i) {
      if (fabs(M[n * i + p]) > fabs(M[n * best[p] + p])) best[p] = i;
    }
    pivot = M[n * best[p] + p];
    if (pivots == VS_POSITIVE && !(pivot > 0.0)) return 0;
    if (pivots == VS_SOUGHT && !(fabs(pivot) > 1e-14)) return 0;
    if (pivots == VS_RANKED) {
      if (!(fabs(pivot) > 1e-12 * fabs(size[p - first]))) return 0;
      *distance = seriesSmaller(*distance, fabs(pivot / size[p - first]));
    }
    M[n * best[p] + p] = M[n * p + p];
    M[n * p + p] = 1.0;
    for (j = 0; j < n; ++j) {
      const Real kept = j == p ? (Real)1.0 : M[n * best[p] + j];
      if (j != p) M[n * best[p] + j] = M[n * p + j];
      M[n * p + j] = kept / pivot;
    }
    for (i = 0; i < n; ++i) {
      const Real factor = M[n * i + p];
      if (i == p || VS_IS_SAME(factor, 0.0)) continue;
      M[n * i + p] = 0.0;
      for (j = 0; j < n; ++j) M[n * i + j] -= factor * M[n * p + j];
    }
  }
  for (p = n - 1; p >= 0 && pivots == VS_SOUGHT; --p) {
    for (i = 0; i < n; ++i) {
      const Real kept = M[n * i + p];
      M[n * i + p] = M[n * i + best[p]];
      M[n * i + best[p]] = kept;
    }
  }
  return 1;
}

/* J^-1, which a constant inertia has once. */
VS_FUNCTION int vs_factor_inertia(scene_series* it) {
  double unused;
  int i, j;
  if (it->has_mobility && !INERTIA_VARIES) return 1;
  for (i = 0; i < S; ++i) {
    if (!IS_COUPLED && !(vs_inertia(it, i, i) > 0.0)) return 0;
    if (!IS_COUPLED) it->mobility[i] = 1.0 / vs_inertia(it, i, i);
    for (j = 0; j < S && IS_COUPLED; ++j) it->mobility[S * i + j] = vs_inertia(it, i, j);
  }
  it->has_mobility = !IS_COUPLED || vs_invert(it->mobility, S, 0, S, VS_POSITIVE, 0, &unused);
  return it->has_mobility;
}

/* y = J^-1 f */
VS_FUNCTION_INLINE void vs_move(const scene_series* it, const Real* f, Real* y) {
  int i, j;
  for (i = 0; i < S; ++i) {
    y[i] = (IS_COUPLED ? it->mobility[S * i] * f[0] : it->mobility[i] * f[i]);
    for (j = 1; j < S && IS_COUPLED; ++j) y[i] += it->mobility[S * i + j] * f[j];
  }
}

/* [J -D'; C 0] with the constraints that are in; mu_p = g_p for others. */
VS_FUNCTION void vs_write_whole(scene_series* it) {
  Real* const M = it->inverse;
  int e, i, j, p;
  for (i = 0; i < SIZE; ++i) {
    for (j = 0; j < SIZE; ++j)
      M[SIZE * i + j] = i < S && j < S && (i == j || IS_COUPLED) ? vs_inertia(it, i, j) : vs_zero;
  }
  for (p = 0; p < K; ++p) {
    if (!it->is_in[p]) M[SIZE * (S + p) + S + p] = 1.0;
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e) {
      M[SIZE * (S + p) + entry_shaft[e]] = vs_entry(it, p, entry_shaft[e]);
      M[SIZE * entry_shaft[e] + S + p] = -vs_direction(it, p, entry_shaft[e]);
    }
  }
}

/* Its inverse, beside elements that hold: what is stuck stands still to the bit by it, and by the
 * solution for the multipliers to rounding, which decisions of modes would take for motion. */
VS_FUNCTION int vs_factor_whole(scene_series* it) {
  int p;
  vs_write_whole(it);
  if (!vs_invert(it->inverse, SIZE, 0, S, VS_POSITIVE, 0, &it->distance)) return 0;
  for (p = 0; p < K; ++p) it->size[p] = it->inverse[SIZE * (S + p) + S + p];
  it->is_whole = 1;
  return vs_invert(it->inverse, SIZE, S, SIZE, VS_RANKED, it->size, &it->distance);
}

/* A^-1 with A = C J^-1 D' of the constraints of orders low to high, or the whole inverse. False
 * where C has lost rank. */
VS_FUNCTION int vs_factor(scene_series* it, int low, int high) {
  Real D[MOST_SHAFTS], y[MOST_SHAFTS];
  int e, i, p, q;
  for (q = 0; q < K; ++q) it->is_in[q] = vs_is_counted(it, q, low, high);
  it->distance = 1.0;
  it->is_whole = 0;
  if (!vs_factor_inertia(it)) return 0;
  if (HOLDS) return vs_factor_whole(it);
  for (q = 0; q < K; ++q) {
    for (i = 0; i < S; ++i) D[i] = 0.0;
    for (e = entry_begin[q]; e < entry_begin[q + 1]; ++e)
      D[entry_shaft[e]] = vs_direction(it, q, entry_shaft[e]);
    vs_move(it, D, y);
    for (p = 0; p < K; ++p) {
      Real sum = 0.0;
      for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e)
        sum += vs_entry(it, p, entry_shaft[e]) * y[entry_shaft[e]];
      it->inverse[K * p + q] = it->is_in[p] && it->is_in[q] ? sum : (Real)(p == q);
    }
    it->size[q] = it->inverse[K * q + q];
  }
  return vs_invert(it->inverse, K, 0, K, VS_RANKED, it->size, &it->distance);
}

/* mu = A^-1 (g - C J^-1 a), epsilon = J^-1 (a + D' mu), in the place of a and g */
VS_FUNCTION_INLINE void vs_eliminate(const scene_series* it, Real* x) {
  Real b[MOST_SIZE], y[MOST_SHAFTS];
  const int is_whole = (HOLDS || IS_CURVED) && it->is_whole;
  int e, i, j, p, q;
  for (i = 0; i < SIZE; ++i) b[i] = x[i];
  for (i = 0; i < SIZE && is_whole; ++i) {
    x[i] = it->inverse[SIZE * i] * b[0];
    for (j = 1; j < SIZE; ++j) x[i] += it->inverse[SIZE * i + j] * b[j];
  }
  if (is_whole) return;
  vs_move(it, b, y);
  for (p = 0; p < K; ++p) {
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e)
      b[S + p] -= vs_entry(it, p, entry_shaft[e]) * y[entry_shaft[e]];
  }
  for (p = 0; p < K; ++p) {
    x[S + p] = it->inverse[K * p] * b[S];
    for (q = 1; q < K; ++q) x[S + p] += it->inverse[K * p + q] * b[S + q];
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e)
      b[entry_shaft[e]] += vs_direction(it, p, entry_shaft[e]) * x[S + p];
  }
  vs_move(it, b, x);
}

/* The residuals of a solution: a - J epsilon + D' mu and g - C epsilon. */
VS_FUNCTION void vs_find_left(const scene_series* it, const Real* b, const Real* x, Real* left) {
  int e, i, j, p;
  for (i = 0; i < S; ++i) {
    left[i] = b[i];
    for (j = 0; j < S; ++j) {
      if (i == j || IS_COUPLED) left[i] -= vs_inertia(it, i, j) * x[j];
    }
  }
  for (p = 0; p < K; ++p) {
    left[S + p] = it->is_in[p] ? b[S + p] : vs_zero;
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e) {
      left[S + p] -= vs_entry(it, p, entry_shaft[e]) * x[entry_shaft[e]];
      left[entry_shaft[e]] += vs_direction(it, p, entry_shaft[e]) * x[S + p];
    }
  }
}

/* x = [J -D'; C 0]^-1 x; 0 for constraints that are off. Elimination knows the solution for rows
 * that are a part d of their length apart to rounding / d^2, of which two corrections leave
 * rounding / d. */
VS_FUNCTION_INLINE void vs_solve(const scene_series* it, Real* x) {
  const Real near = 1e-4;
  Real b[MOST_SIZE], left[MOST_SIZE];
  int i, round;
  for (i = 0; i < SIZE; ++i) b[i] = x[i] = i < S || vs_is_on(it, i - S) ? x[i] : vs_zero;
  vs_eliminate(it, x);
  for (round = 0; round < 2 && it->distance < near; ++round) {
    vs_find_left(it, b, x, left);
    vs_eliminate(it, left);
    for (i = 0; i < SIZE; ++i) x[i] += left[i];
  }
}

/* The whole inverse where psi is not linear in the accelerations: J less the sum of lambda
 * d2psi/depsilon2 in the place of J. The system is scaled by 1/sqrt(J_ii) and 1/sqrt(C J^-1 C'). */
VS_FUNCTION int vs_factor_curved(scene_series* it, const Real* lambda, int low, int high) {
  Real* const M = it->inverse;
  Real scale[MOST_SIZE];
  double unused;
  int i, p;
  if (!vs_factor(it, low, high)) return 0;
  if (!IS_CURVED) return 1;
  vs_at_once(it, 0);
  vs_write_whole(it);
  for (i = 0; i < SIZE; ++i) scale[i] = 1.0 / sqrt(i < S ? vs_inertia(it, i, i) : it->size[i - S]);
  for (p = 0; p < K; ++p) {
    for (i = 0; i < S * S && it->is_in[p]; ++i)
      M[SIZE * (i / S) + i % S] -= lambda[p] * it->row[curvature_row[S * S * p + i]][0];
  }
  for (i = 0; i < SIZE * SIZE; ++i) M[i] *= scale[i / SIZE] * scale[i % SIZE];
  if (!vs_invert(M, SIZE, 0, SIZE, VS_SOUGHT, 0, &unused)) return 0;
  for (i = 0; i < SIZE * SIZE; ++i) M[i] *= scale[i / SIZE] * scale[i % SIZE];
  it->is_whole = 1;
  it->distance = 1.0;
  return 1;
}
