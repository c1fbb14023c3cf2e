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
  const double least = 1e-100; /* An absolute tolerance of 0 would leave none to a value of 0. */
  (void)it;
  return ABSOLUTE_TOLERANCE + least + RELATIVE_TOLERANCE * fabs(size);
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

/* The shafts j of the elements J_ij that may not be 0. */
#define VS_FIRST_COUPLED(i) (IS_COUPLED ? 0 : (i))
#define VS_END_COUPLED(i) (IS_COUPLED ? S : (i) + 1)

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
    for (j = VS_FIRST_COUPLED(i); j < VS_END_COUPLED(i); ++j)
      R[i] += vs_inertia(it, i, j) * it->row[ACCELERATION + j][0];
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
      const double part = fabs(pivot / size[p - first]);
      if (!(fabs(pivot) > 1e-12 * fabs(size[p - first]))) return 0;
      /* (A row that others imply leaves rounding over their own distance.) */
      if (HOLDS && !(part * *distance > 1e-14)) return 0;
      *distance = seriesSmaller(*distance, part);
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

/* (J^-1 f)_i */
VS_FUNCTION_INLINE Real vs_moved(const scene_series* it, const Real* f, int i) {
  Real y = (IS_COUPLED ? it->mobility[S * i] * f[0] : it->mobility[i] * f[i]);
  int j;
  for (j = 1; j < S && IS_COUPLED; ++j) y += it->mobility[S * i + j] * f[j];
  return y;
}

/* y = J^-1 f */
VS_FUNCTION_INLINE void vs_move(const scene_series* it, const Real* f, Real* y) {
  int i;
  for (i = 0; i < S; ++i) y[i] = vs_moved(it, f, i);
}

/* Shafts that constraints or inertia join, and these constraints, are a block: the systems of
 * blocks have nothing in common. A block's unknowns are its shafts, then its constraints; its
 * matrix stands alone at its place. Blocks without a constraint are listed where inverses of the
 * whole system are asked for. */
#define VS_BLOCK_SIZE(b) (block_begin[(b) + 1] - block_begin[b])
#define VS_UNKNOWN_OF(b, i) (BLOCKS == 1 ? (i) : block_unknown[block_begin[b] + (i)])
#define VS_CONSTRAINT_OF(b, i) \
  (BLOCKS == 1 ? (i) : block_unknown[block_begin[b] + block_shafts[b] + (i)] - S)

/* [J -D'; C 0] of a block with the constraints that are in; mu_p = g_p for others. */
VS_FUNCTION void vs_write_whole(scene_series* it, int b) {
  Real* const M = it->inverse + block_matrix[b];
  const int n = VS_BLOCK_SIZE(b), shafts = block_shafts[b];
  int e, i, j;
  for (i = 0; i < n * n; ++i) M[i] = 0.0;
  for (i = 0; i < shafts; ++i) {
    for (j = VS_FIRST_COUPLED(i); j < (IS_COUPLED ? shafts : i + 1); ++j)
      M[n * i + j] = vs_inertia(it, VS_UNKNOWN_OF(b, i), VS_UNKNOWN_OF(b, j));
  }
  for (i = shafts; i < n; ++i) {
    const int p = VS_CONSTRAINT_OF(b, i - shafts);
    if (!it->is_in[p]) M[n * i + i] = 1.0;
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e) {
      M[n * i + entry_place[e]] = vs_entry(it, p, entry_shaft[e]);
      M[n * entry_place[e] + i] = -vs_direction(it, p, entry_shaft[e]);
    }
  }
}

/* Its inverse, beside elements that hold: what is stuck stands still to the bit by it, and by the
 * solution for the multipliers to rounding, which decisions of modes would take for motion. */
VS_FUNCTION int vs_factor_whole(scene_series* it) {
  int b, i;
  for (b = 0; b < BLOCKS; ++b) {
    Real* const M = it->inverse + block_matrix[b];
    Real size[MOST_CONSTRAINTS + 1];
    const int n = VS_BLOCK_SIZE(b), shafts = block_shafts[b];
    vs_write_whole(it, b);
    if (!vs_invert(M, n, 0, shafts, VS_POSITIVE, 0, &it->distance)) return 0;
    for (i = shafts; i < n; ++i)
      it->size[VS_CONSTRAINT_OF(b, i - shafts)] = size[i - shafts] = M[n * i + i];
    if (!vs_invert(M, n, shafts, n, VS_RANKED, size, &it->distance)) return 0;
  }
  it->is_whole = 1;
  return 1;
}

/* A^-1 with A = C J^-1 D' of the constraints of orders low to high, or the whole inverse. False
 * where C has lost rank. */
VS_FUNCTION int vs_factor(scene_series* it, int low, int high) {
  Real D[MOST_SHAFTS], size[MOST_CONSTRAINTS + 1];
  int b, e, i, k;
  for (i = 0; i < K; ++i) it->is_in[i] = vs_is_counted(it, i, low, high);
  it->distance = 1.0;
  it->is_whole = 0;
  if (!vs_factor_inertia(it)) return 0;
  if (HOLDS) return vs_factor_whole(it);
  for (i = 0; i < S; ++i) D[i] = 0.0;
  for (b = 0; b < BLOCKS; ++b) {
    Real* const A = it->inverse + block_matrix[b];
    const int n = VS_BLOCK_SIZE(b) - block_shafts[b];
    for (k = 0; k < n; ++k) {
      const int q = VS_CONSTRAINT_OF(b, k);
      for (e = entry_begin[q]; e < entry_begin[q + 1]; ++e)
        D[entry_shaft[e]] = vs_direction(it, q, entry_shaft[e]);
      for (i = 0; i < n; ++i) {
        const int p = VS_CONSTRAINT_OF(b, i);
        Real sum = 0.0;
        for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e)
          sum += vs_entry(it, p, entry_shaft[e]) * vs_moved(it, D, entry_shaft[e]);
        A[n * i + k] = it->is_in[p] && it->is_in[q] ? sum : (Real)(i == k);
      }
      it->size[q] = size[k] = A[n * k + k];
      for (e = entry_begin[q]; e < entry_begin[q + 1]; ++e) D[entry_shaft[e]] = 0.0;
    }
    if (!vs_invert(A, n, 0, n, VS_RANKED, size, &it->distance)) return 0;
  }
  return 1;
}

/* mu = A^-1 (g - C J^-1 a), epsilon = J^-1 (a + D' mu), in the place of a and g */
VS_FUNCTION_INLINE void vs_eliminate(const scene_series* it, Real* x) {
  Real b[MOST_SIZE], y[MOST_SHAFTS];
  const int is_whole = (HOLDS || IS_CURVED) && it->is_whole;
  int block, e, i, j, p;
  for (block = 0; block < BLOCKS && is_whole; ++block) {
    const int n = VS_BLOCK_SIZE(block);
    for (i = 0; i < n; ++i) b[i] = x[VS_UNKNOWN_OF(block, i)];
    for (i = 0; i < n; ++i) {
      const Real* const row = it->inverse + block_matrix[block] + n * i;
      Real sum = row[0] * b[0];
      for (j = 1; j < n; ++j) sum += row[j] * b[j];
      x[VS_UNKNOWN_OF(block, i)] = sum;
    }
  }
  if (is_whole) return;
  for (i = 0; i < SIZE; ++i) b[i] = x[i];
  vs_move(it, b, y);
  for (p = 0; p < K; ++p) {
    for (e = entry_begin[p]; e < entry_begin[p + 1] && it->is_in[p]; ++e)
      b[S + p] -= vs_entry(it, p, entry_shaft[e]) * y[entry_shaft[e]];
  }
  for (block = 0; block < BLOCKS; ++block) {
    const int n = VS_BLOCK_SIZE(block) - block_shafts[block];
    for (i = 0; i < n; ++i) {
      const Real* const row = it->inverse + block_matrix[block] + n * i;
      Real sum = row[0] * b[S + VS_CONSTRAINT_OF(block, 0)];
      for (j = 1; j < n; ++j) sum += row[j] * b[S + VS_CONSTRAINT_OF(block, j)];
      x[S + VS_CONSTRAINT_OF(block, i)] = sum;
    }
  }
  for (p = 0; p < K; ++p) {
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
    for (j = VS_FIRST_COUPLED(i); j < VS_END_COUPLED(i); ++j)
      left[i] -= vs_inertia(it, i, j) * x[j];
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
  int b, i, k;
  if (!vs_factor(it, low, high)) return 0;
  if (!IS_CURVED) return 1;
  vs_at_once(it, 0);
  for (b = 0; b < BLOCKS; ++b) {
    Real* const M = it->inverse + block_matrix[b];
    Real scale[MOST_SIZE];
    double unused;
    const int n = VS_BLOCK_SIZE(b), shafts = block_shafts[b];
    vs_write_whole(it, b);
    for (i = 0; i < n; ++i) {
      const int of = VS_UNKNOWN_OF(b, i);
      scale[i] = 1.0 / sqrt(i < shafts ? vs_inertia(it, of, of) : it->size[of - S]);
    }
    for (k = 0; k < n - shafts; ++k) {
      const int p = VS_CONSTRAINT_OF(b, k);
      const int* const bent = curvature_row + S * S * p;
      for (i = 0; i < shafts * shafts && it->is_in[p]; ++i) {
        const int at = S * VS_UNKNOWN_OF(b, i / shafts) + VS_UNKNOWN_OF(b, i % shafts);
        M[n * (i / shafts) + i % shafts] -= lambda[p] * it->row[bent[at]][0];
      }
    }
    for (i = 0; i < n * n; ++i) M[i] *= scale[i / n] * scale[i % n];
    if (!vs_invert(M, n, 0, n, VS_SOUGHT, 0, &unused)) return 0;
    for (i = 0; i < n * n; ++i) M[i] *= scale[i / n] * scale[i % n];
  }
  it->is_whole = 1;
  it->distance = 1.0;
  return 1;
}
