/* The formulas at a state, and the linear systems of a motion,
 *     J epsilon - D' mu = a,   C epsilon = g
 * which orders of a series, projections, jumps and first accelerations solve. */

/* Modes of elements that hold. A sliding one has a torque with the sign of its slip, one that is
 * stuck a constraint. */
enum { VS_BACKWARD = -1, VS_STUCK = 0, VS_FORWARD = 1, VS_FREE = 2 };
/* Sides of an event of the scene, beside modes: its function is below 0, above 0. */
enum { VS_BELOW = 3, VS_ABOVE = 4 };

/* The mode as a user sees it: of losses 1 where the first shaft drives, -1 where the second does.
 */
VS_FUNCTION int vs_told_mode(int h, int mode) {
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
    it->row[mode_row[i]][0] = vs_told_mode(i, m->now.mode[i]);
    it->row[counts_row[i]][0] = m->now.counts[i];
  }
  vs_given(it, 0);
  vs_tried(it, 0);
  vs_rest(it, 0);
}

VS_FUNCTION double vs_entry(const scene_series* it, int p, int i) {
  return it->row[entry_row[S * p + i]][0];
}

/* D, along which the reaction of a constraint acts: C but of those with a direction of their own.
 */
VS_FUNCTION double vs_direction(const scene_series* it, int p, int i) {
  return it->row[direction_row[S * p + i]][0];
}

VS_FUNCTION double vs_inertia(const scene_series* it, int i, int j) {
  return i == j ? it->row[inertia_row[i]][0] : coupling[S * i + j];
}

/* R = J epsilon + n - Q */
VS_FUNCTION void vs_reaction(const scene_series* it, double* R) {
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

/* Inverts an n x n matrix in place by Gauss and Jordan's elimination, with row pivots where it is
 * `curved`. Without, the rows from S on become C J^-1 D', whose diagonal is kept in `size`: its
 * pivots tell the rank. False where that is lost. *distance: the least pivot as a part of its
 * diagonal element, the square of how far apart the rows are. */
VS_FUNCTION_INLINE int vs_invert(Real* M, int n, Real* size, int curved, Real* distance) {
  int best[MOST_SIZE], i, j, p;
  *distance = 1.0;
  for (p = 0; p < n; ++p) {
    Real pivot, least = curved ? 1e-14 : 0.0;
    best[p] = p;
    for (i = p + 1; i < n && curved; ++i) {
      if (fabs(M[n * i + p]) > fabs(M[n * best[p] + p])) best[p] = i;
    }
    for (i = S; i < n && p == S && !curved; ++i) size[i - S] = M[n * i + i];
    if (p >= S && !curved) least = 1e-12 * fabs(size[p - S]);
    pivot = M[n * best[p] + p];
    if (!((curved || p >= S ? fabs(pivot) : pivot) > least)) return 0;
    if (p >= S && !curved) *distance = seriesSmaller(*distance, fabs(pivot / size[p - S]));
    M[n * best[p] + p] = M[n * p + p];
    M[n * p + p] = 1.0;
    for (j = 0; j < n; ++j) {
      const Real kept = j == p ? 1.0 : M[n * best[p] + j];
      if (j != p) M[n * best[p] + j] = M[n * p + j];
      M[n * p + j] = kept / pivot;
    }
    for (i = 0; i < n; ++i) {
      const Real factor = M[n * i + p];
      if (i == p) continue;
      M[n * i + p] = 0.0;
      for (j = 0; j < n; ++j) M[n * i + j] -= factor * M[n * p + j];
    }
  }
  for (p = n - 1; p >= 0 && curved; --p) {
    for (i = 0; i < n; ++i) {
      const Real kept = M[n * i + p];
      M[n * i + p] = M[n * i + best[p]];
      M[n * i + best[p]] = kept;
    }
  }
  return 1;
}

/* [J -D'; C 0] with the rows of the constraints of orders low to high; mu_p = g_p for others. */
VS_FUNCTION void vs_write_matrix(scene_series* it, int low, int high) {
  int i, j, p;
  for (i = 0; i < SIZE; ++i) {
    for (j = 0; j < SIZE; ++j)
      it->inverse[SIZE * i + j] = i < S && j < S ? vs_inertia(it, i, j) : 0.0;
  }
  for (p = 0; p < K; ++p) {
    const int is_in = vs_is_counted(it, p, low, high);
    if (!is_in) it->inverse[SIZE * (S + p) + S + p] = 1.0;
    for (i = 0; i < S && is_in; ++i) {
      it->inverse[SIZE * (S + p) + i] = vs_entry(it, p, i);
      it->inverse[SIZE * i + S + p] = -vs_direction(it, p, i);
    }
  }
}

/* X <- X + X (1 - M X), twice: elimination knows the inverse of rows that are a part d of their
 * length apart to rounding / d^2, of which this leaves rounding / d. */
VS_FUNCTION_RARE void vs_improve_inverse(scene_series* it, int low, int high) {
  double X[MOST_SIZE * MOST_SIZE], left[MOST_SIZE * MOST_SIZE];
  const double* const M = it->inverse;
  int round, i, j, k;
  for (i = 0; i < SIZE * SIZE; ++i) X[i] = it->inverse[i];
  vs_write_matrix(it, low, high);
  for (round = 0; round < 2; ++round) {
    for (i = 0; i < SIZE; ++i) {
      for (j = 0; j < SIZE; ++j) {
        double sum = i == j ? 1.0 : 0.0;
        for (k = 0; k < SIZE; ++k) sum -= M[SIZE * i + k] * X[SIZE * k + j];
        left[SIZE * i + j] = sum;
      }
    }
    for (i = 0; i < SIZE; ++i) {
      double row[MOST_SIZE];
      for (j = 0; j < SIZE; ++j) {
        row[j] = X[SIZE * i + j];
        for (k = 0; k < SIZE; ++k) row[j] += X[SIZE * i + k] * left[SIZE * k + j];
      }
      for (j = 0; j < SIZE; ++j) X[SIZE * i + j] = row[j];
    }
  }
  for (i = 0; i < SIZE * SIZE; ++i) it->inverse[i] = X[i];
}

/* Its inverse. False where C has lost rank. */
VS_FUNCTION int vs_factor(scene_series* it, int low, int high) {
  const double near = 1e-4;
  double distance;
  vs_write_matrix(it, low, high);
  if (!vs_invert(it->inverse, SIZE, it->size, 0, &distance)) return 0;
  if (distance < near) vs_improve_inverse(it, low, high);
  return 1;
}

/* x = [J -D'; C 0]^-1 x; 0 for constraints that are off. */
VS_FUNCTION_INLINE void vs_solve(const scene_series* it, double* x) {
  double b[MOST_SIZE];
  int i, j;
  for (i = 0; i < SIZE; ++i) b[i] = i < S || vs_is_on(it, i - S) ? x[i] : 0.0;
  for (i = 0; i < SIZE; ++i) {
    x[i] = it->inverse[SIZE * i] * b[0];
    for (j = 1; j < SIZE; ++j) x[i] += it->inverse[SIZE * i + j] * b[j];
  }
}

/* The same where psi is not linear in the accelerations: J less the sum of lambda d2psi/depsilon2
 * in the place of J. The system is scaled by 1/sqrt(J_ii) and 1/sqrt(C J^-1 C'). */
VS_FUNCTION int vs_factor_curved(scene_series* it, const double* lambda, int low, int high) {
  double* const M = it->inverse;
  double scale[MOST_SIZE], unused;
  int i, j, p;
  if (!vs_factor(it, low, high)) return 0;
  if (!IS_CURVED) return 1;
  vs_at_once(it, 0);
  vs_write_matrix(it, low, high);
  for (i = 0; i < SIZE; ++i) {
    scale[i] = 1.0 / sqrt(i < S ? vs_inertia(it, i, i) : it->size[i - S]);
    for (j = 0; j < S && i < S; ++j) {
      for (p = 0; p < K; ++p) {
        if (!vs_is_counted(it, p, low, high)) continue;
        it->inverse[SIZE * i + j] -= lambda[p] * it->row[curvature_row[S * S * p + S * i + j]][0];
      }
    }
  }
  for (i = 0; i < SIZE * SIZE; ++i) M[i] *= scale[i / SIZE] * scale[i % SIZE];
  if (!vs_invert(M, SIZE, 0, 1, &unused)) return 0;
  for (i = 0; i < SIZE * SIZE; ++i) M[i] *= scale[i / SIZE] * scale[i % SIZE];
  return 1;
}
