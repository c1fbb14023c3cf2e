/* Implicit steps (stages.h): the error of the stages, and polynomials through them. */

/* The first guess of the stages: the polynomials of the last step, `past` to be added to theta = c
 * h / unit, or the values at the begin. */
VS_FUNCTION_RARE void vs_guess_stages(const scene_series* it, const scene_series* last, double past,
                                      const vs_stages* of) {
  int i, j;
  for (i = 0; i < UNKNOWNS; ++i) {
    const int row = i < S ? ACCELERATION + i : i < SIZE ? MULTIPLIER + i - S : rate_row[i - SIZE];
    const double begin = it->row[row][0];
    double off = 0.0;
    if (last != 0) off = begin - vs_evaluate(last->row[row], last->order, past);
    for (j = 0; j < of->method->stages; ++j) {
      const double theta = past + of->method->point[j] * of->h / (last != 0 ? last->unit : 1.0);
      of->y[UNKNOWNS * j + i] =
          last != 0 ? vs_evaluate(last->row[row], last->order, theta) + off : begin;
    }
  }
}

/* Coefficient n + 1, of theta^(n + 1), of the polynomial through the values of a row. */
VS_FUNCTION_INLINE double vs_coefficient(const vs_stages* of, int n, const Real* row) {
  const double* const B = of->method->B[n];
  double sum = 0.0;
  int j;
  for (j = 0; j < of->method->stages; ++j) sum += B[j] * (row[j + 1] - row[0]);
  return sum;
}

/* x = the changes of (epsilon, mu, z') in an implicit step of g that changes the state along q by
 * `by` before them, and R by x. */
VS_FUNCTION_RARE void vs_damp(const vs_stages* of, double* by, double* x) {
  const double g = of->h / of->method->real;
  int i, l, q;
  for (q = S; q < DIRECTIONS; ++q) {
    const int unknown = vs_unknown_along(q);
    for (l = link_begin[unknown]; l < link_begin[unknown + 1]; ++l) {
      i = linked[l];
      x[i] -= of->slope[UNKNOWNS * q + i] * by[q];
      if (i < S && !IS_CLASSICAL) x[i] += g * of->pull_slope[S * q + i] * by[q];
    }
  }
  vs_solve_stage(of, x);
  for (i = 0; i < S; ++i) {
    by[S + i] += g * x[i];
    by[2 * S + i] += g * g * x[i];
  }
  for (i = 0; i < STATES; ++i) by[3 * S + i] += g * x[SIZE + i];
}

/* The size of the last term of a row's polynomial through the stages alone. (That through the
 * begin, too, shows also what the begin is off the motion of slow components, which no step
 * lessens.) */
VS_FUNCTION_RARE double vs_last_term(const vs_stages* of, const Real* row) {
  const double* const c = of->method->point;
  const int s = of->method->stages;
  double sum = 0.0, size = 1.0;
  int j, k;
  for (j = 0; j < s; ++j) {
    double product = 1.0;
    for (k = 0; k < s; ++k) product *= k == j ? 1.0 : c[j] - c[k];
    sum += row[j + 1] / product;
    if (j < s - 1) size *= c[j];
  }
  return fabs(sum) * size;
}

/* True where formulas jump between the begin and a stage, whose values are in the rows. */
VS_FUNCTION_RARE int vs_jumps_inside(const scene_series* it, int stages) {
  int g, j;
  for (g = 0; g < SIGNS + TABLES; ++g) {
    const Real* const c = vs_guard(it, g);
    double low, high;
    if (!(g < SIGNS ? sign_jumps[g] : passage_jumps[g - SIGNS])) continue;
    vs_find_range(it, g, c[0], &low, &high);
    for (j = 1; j <= stages; ++j) {
      if (!(c[j] > low && c[j] < high) && c[j] != c[0]) return 1;
    }
  }
  return 0;
}

/* The defect x' - p'(0) of a step's polynomials at the begin, times g: `by`, and of R and
 * constraints of order 3 the right-hand side x. */
VS_FUNCTION_RARE void vs_find_defect(const scene_series* it, const vs_stages* of, double g,
                                     double* by, double* x) {
  int e, i, p;
  for (i = 0; i < UNKNOWNS; ++i) x[i] = 0.0;
  for (i = 0; i < S; ++i) {
    const Real *const omega = it->row[VELOCITY + i], *const phi = it->row[ANGLE + i];
    by[S + i] = g * (it->row[ACCELERATION + i][0] - vs_coefficient(of, 0, omega) / of->h);
    by[2 * S + i] = g * (omega[0] - vs_coefficient(of, 0, phi) / of->h + by[S + i]);
  }
  for (i = 0; i < STATES; ++i)
    by[3 * S + i] =
        g * (it->row[rate_row[i]][0] - vs_coefficient(of, 0, it->row[STATE + i]) / of->h);
  for (i = 0; i < S && !IS_CLASSICAL; ++i) x[i] = by[i] = g * (of->P[i] - of->R[S + i] / of->h);
  for (p = 0; p < K; ++p) {
    if (order_of[p] < 3) continue;
    x[S + p] = -it->row[residual_row[p]][0];
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      i = entry_shaft[e];
      x[S + p] -= vs_entry(it, p, i) * vs_coefficient(of, 0, it->row[ACCELERATION + i]) / of->h;
    }
  }
}

/* The error of a step in tolerances: its defect, damped by an implicit step of g, twice at a first
 * step and after a rejection (Hairer and Wanner, (IV.8.20)). */
VS_FUNCTION_RARE double vs_stage_error(const scene_series* it, const vs_stages* of, int is_first) {
  const double g = of->h / of->method->real;
  double* const x = of->sum;
  double* const by = of->residual;
  /* the largest |theta (theta - c_1) .. (theta - c_s)| */
  const double between = of->method->stages == 3 ? 0.018 : 0.0011;
  /* (Accelerations that follow from the state jump with their formulas, in any step.) */
  const int has_jump = IS_CLASSICAL && vs_jumps_inside(it, of->method->stages);
  double norm = 0.0, rest = 0.0;
  int i, p;
  vs_find_defect(it, of, g, by, x);
  vs_damp(of, by, x);
  /* (What is stuck has no error but that of the torque by which it lets go.) */
  for (p = 0; p < K && TRANSMITS && !IS_CLASSICAL; ++p) {
    const double allowed = vs_tolerance(it, it->row[TRANSMITTED + p][0]);
    norm = seriesLarger(norm, fabs(g * x[S + p]) / allowed);
  }
  if (is_first) { /* and again: R has changed by by + g C' x */
    for (i = 0; i < S && !IS_CLASSICAL; ++i) {
      for (p = 0; p < K; ++p) by[i] += g * vs_direction(it, p, i) * x[S + p];
    }
    for (i = 0; i < S; ++i) {
      x[i] = IS_CLASSICAL ? 0.0 : by[i];
      by[2 * S + i] += g * by[S + i];
    }
    for (i = S; i < UNKNOWNS; ++i) x[i] = 0.0;
    vs_damp(of, by, x);
  }
  for (i = 0; i < S; ++i) {
    const double allowed = vs_tolerance(it, it->row[ACCELERATION + i][0]);
    norm = seriesLarger(norm, fabs(by[S + i]) / vs_tolerance(it, it->row[VELOCITY + i][0]));
    if (FIRST_JUDGED == 0)
      norm = seriesLarger(norm, fabs(by[2 * S + i]) / vs_tolerance(it, it->row[ANGLE + i][0]));
    if (has_jump)
      x[i] = 0.0;
    else if (IS_CLASSICAL)
      x[i] = seriesSmaller(
          fabs(between * vs_coefficient(of, of->method->stages - 1, it->row[ACCELERATION + i])),
          vs_last_term(of, it->row[ACCELERATION + i]));
    /* (A shorter step has as much rounding. Under `auto` series may take over.) */
    norm = seriesLarger(norm, SERIES_LEAD ? (fabs(x[i]) - of->noise[i]) / allowed
                                          : fabs(x[i]) / (allowed + of->noise[i]));
    rest += 0.0 * x[i];
  }
  for (i = 0; i < STATES; ++i) {
    norm = seriesLarger(norm, fabs(by[3 * S + i]) / vs_tolerance(it, it->row[STATE + i][0]));
    rest += 0.0 * by[3 * S + i];
  }
  return norm + rest;
}

/* R by its rate, which the stages' accelerations tell to the error of Newton's iteration times the
 * rate of a fast component only, becomes a polynomial: R[n + 1] of theta^(n + 1). */
VS_FUNCTION_RARE void vs_integrate_reaction(const vs_stages* of) {
  const int s = of->method->stages;
  Real moved[VS_MOST_STAGES + 1] = {0.0}; /* since the begin */
  int i, j, k, n;
  for (i = 0; i < S && !IS_CLASSICAL; ++i) {
    for (j = 0; j < s; ++j) {
      moved[j + 1] = 0.0;
      for (k = 0; k < s; ++k) moved[j + 1] += of->h * of->method->A[j][k] * of->P[S * (k + 1) + i];
    }
    for (n = 0; n < s; ++n) of->R[S * (n + 1) + i] = vs_coefficient(of, n, moved);
  }
}

/* Notes the states of the stages in the rows. */
VS_FUNCTION_RARE void vs_note_stages(scene_series* it, scene_series* w, const scene_state* from,
                                     const vs_stages* of) {
  int j, r;
  for (j = 0; j < of->method->stages; ++j) {
    vs_enter_stage_state(w, from, of, j);
    for (r = ANGLE; r < STATE + STATES; ++r) {
      if (r < PULL || r >= PULL + S) it->row[r][j + 1] = w->row[r][0];
    }
  }
}

/* The values of rows at the stages become polynomials. */
VS_FUNCTION_RARE void vs_interpolate_stages(scene_series* it, const vs_stages* of, int method) {
  const int s = of->method->stages;
  const double ratio = it->unit / of->h;
  double scaled[VS_MOST_STAGES][VS_MOST_STAGES], power = ratio;
  int j, n, r;
  for (n = 0; n < s; ++n, power *= ratio) {
    for (j = 0; j < s; ++j) scaled[n][j] = of->method->B[n][j] * power;
  }
  for (r = 0; r < SHOWN; ++r) {
    Real* const c = it->row[shown_row[r]];
    double moved[VS_MOST_STAGES];
    for (j = 0; j < s; ++j) moved[j] = c[j + 1] - c[0];
    for (n = 0; n < s; ++n) {
      double sum = 0.0;
      for (j = 0; j < s; ++j) sum += scaled[n][j] * moved[j];
      c[n + 1] = sum;
    }
    c[s + 1] = 0.0;
  }
  it->order = s;
  it->method = method;
}

/* True if an operation may do between the stages, whose values are in the rows, what none of them
 * shows: its argument goes further than a part of its radius of convergence. */
VS_FUNCTION_RARE int vs_may_hide(const scene_series* it, int stages) {
  int n, j;
  for (n = 0; n < RESOLVED; ++n) {
    const struct SeriesOperation* const op = &resolved[n];
    const Real* const a = it->row[op->a];
    const Real* const b = op->b < 0 ? a : it->row[op->b];
    const double second = op->second < 0 ? (double)a[0] : (double)it->row[op->second][0];
    double moved = 0.0, other = 0.0;
    /* (A product may lead to an argument that turns back between the stages.) */
    const int known = op->kind == kSeriesProduct ? 1 : VS_ALONG;
    if (op->kind <= kSeriesFinite || op->kind == kSeriesTable || op->power <= known) continue;
    for (j = 1; j <= stages; ++j) {
      moved = seriesLarger(moved, fabs(a[j] - a[0]));
      other = seriesLarger(other, op->b < 0 ? 0.0 : fabs(b[j] - b[0]));
    }
    if (seriesHasGoneFar(op, a[0], b[0], second, moved, other)) return 1;
  }
  return 0;
}

/* Notes the values of all rows at the begin of a step, at a stage inside it and at the last one:
 * n = 0, 1, 2. */
VS_FUNCTION_RARE void vs_note_values(const scene_series* w, const vs_stages* of, int n) {
  int r;
  for (r = 0; r < SCENE_ROWS; ++r) of->values[SCENE_ROWS * n + r] = w->row[r][0];
}

/* True if no formula does along a step, the values of which are noted, what its series there does
 * not show. */
VS_FUNCTION_RARE int vs_is_step_resolved(scene_model* m, const scene_series* it, scene_series* w,
                                         const vs_stages* of) {
  const int last = VS_ALONG < (int)SCENE_ORDER ? VS_ALONG : SCENE_ORDER;
  const double* const at[3] = {of->values, of->values + SCENE_ROWS, of->values + 2 * SCENE_ROWS};
  int n, r;
  w->unit = it->unit;
  vs_enter_inputs(m, w, last);
  vs_enter_state(m, w);
  for (n = 1; n <= last; ++n) {
    w->row[TIME][n] = n == 1 ? w->unit : 0.0;
    for (r = ANGLE; r < STATE + STATES; ++r) w->row[r][n] = n <= it->order ? it->row[r][n] : 0.0;
  }
  return vs_is_path_resolved(w, last, of->h / w->unit, at);
}

/* True where R is off by more than the accelerations' tolerance and rounding leave open. */
VS_FUNCTION_RARE int vs_is_off(const scene_series* w, const vs_stages* of, const double* left) {
  int i;
  for (i = 0; i < S; ++i) {
    const double allowed = vs_tolerance(w, w->row[ACCELERATION + i][0]) + of->noise[i] / VS_LEFT;
    if (!(fabs(left[i]) <= vs_inertia(w, i, i) * allowed)) return 1;
  }
  return 0;
}

/* True where rounding is much and stages do not satisfy their equations, though the corrections of
 * Newton's iteration were small, and some more do not help: a law that is steep at the begin is
 * flat where its stages are. */
VS_FUNCTION_RARE int vs_are_stages_off(scene_series* it, scene_series* w, const scene_state* from,
                                       const vs_stages* of) {
  enum { VS_MORE_ROUNDS = 4 };
  double unused;
  int round, j, is_off = vs_is_rounded(it, of->noise);
  for (round = 0; round < VS_MORE_ROUNDS && is_off; ++round) {
    if (round > 0) (void)vs_correct_stages(it, of, &unused);
    if (!vs_find_residuals(it, w, from, of)) return 1;
    for (is_off = 0, j = 0; j < of->method->stages; ++j)
      is_off = is_off || vs_is_off(w, of, of->residual + UNKNOWNS * j);
  }
  return is_off;
}

/* The first guess of the stages where a law is so steep that any other one, off by the rounding of
 * the accelerations, lies beside it: the solution of the linearized equations of constant time. */
VS_FUNCTION_RARE void vs_guess_by_slopes(const scene_series* it, const vs_stages* of) {
  double unused;
  int i, j, q;
  vs_guess_stages(it, 0, 0.0, of);
  for (i = 0; i < UNKNOWNS; ++i) {
    const double* const slope = of->slope + i;
    double rate = i < S && !IS_CLASSICAL ? -of->P[i] : 0.0; /* of residual i */
    for (q = 0; q < S; ++q)
      rate += slope[UNKNOWNS * (S + q)] * it->row[ACCELERATION + q][0] +
              slope[UNKNOWNS * (2 * S + q)] * it->row[VELOCITY + q][0];
    for (q = 0; q < STATES; ++q) rate += slope[UNKNOWNS * (3 * S + q)] * it->row[rate_row[q]][0];
    for (j = 0; j < of->method->stages; ++j)
      of->residual[UNKNOWNS * j + i] = of->method->point[j] * of->h * rate;
  }
  (void)vs_correct_stages(it, of, &unused);
}

/* Tries stages of a step of of->h, by a first guess that is_known or is the begin. 0 where the
 * step's polynomials are in the rows, and *part is how much longer the next step may be; otherwise
 * the part of h for another trial, or -1 where a matrix is singular. */
VS_FUNCTION_RARE double vs_try_stages(scene_model* m, scene_series* it, scene_series* w,
                                      const scene_state* from, const vs_stages* of, int is_known,
                                      int is_first, double* part) {
  double error;
  int rounds, may_hide, is_found;
  it->unit = w->unit = vs_unit_of(of->h);
  if (!is_known) vs_guess_stages(it, 0, 0.0, of);
  if (!vs_factor_stages(w, of)) return -1.0;
  vs_enter_stage_inputs(m, w, from, of);
  /* (Far from the last step its polynomials may be worse than none.) */
  is_found = vs_find_stages(it, w, from, of, &rounds);
  if (is_found && vs_are_stages_off(it, w, from, of)) {
    vs_guess_by_slopes(it, of);
    is_found = vs_find_stages(it, w, from, of, &rounds) && !vs_are_stages_off(it, w, from, of);
  }
  if (!is_found) return is_known ? 1.0 : 0.25;
  vs_note_stages(it, w, from, of);
  vs_integrate_reaction(of);
  /* (Steps by a stepper's name are held to a part of the tolerance: nothing else judges them.) */
  error = (SERIES_LEAD ? 4.0 : 1.0) * vs_stage_error(it, of, is_first);
  *part = 0.9 * 17.0 / (16.0 + rounds) *
          pow(seriesLarger(error, 1e-8), -1.0 / (of->method->stages + 1));
  *part = seriesLarger(0.1, seriesSmaller(*part, 8.0));
  if (!(error <= 1.0)) return isfinite(error) ? seriesSmaller(*part, 0.9) : 0.1;
  may_hide = vs_may_hide(it, of->method->stages);
  vs_note_values(it, of, 0);
  vs_interpolate_stages(it, of, VS_IMPLICIT);
  if (!may_hide) return 0.0;
  vs_enter_stage(w, from, of, of->method->stages / 2);
  vs_note_values(w, of, 1);
  vs_enter_stage(w, from, of, of->method->stages - 1);
  vs_note_values(w, of, 2);
  return vs_is_step_resolved(m, it, w, of) ? 0.0 : 0.5;
}

/* Polynomials of an implicit step of at most `limit` s from the state. */
VS_FUNCTION_RARE scene_status vs_expand_implicitly(scene_model* m, double limit) {
  scene_series* const it = vs_series(m);
  scene_series* const w = &m->series[1 - m->present];
  const scene_state from = m->now;
  /* (Series get over what shorter steps by a stepper's name do not.) */
  const double least = (SERIES_LEAD ? 1e-13 : 4.0 * DBL_EPSILON) * seriesLarger(1.0, from.time);
  const int is_begun = vs_is_begun(m);
  const scene_series* const known = !is_begun                    ? 0
                                    : it->method != VS_BY_SERIES ? it
                                    : w->method != VS_BY_SERIES  ? w
                                                                 : 0;
  const double past = known == w ? m->reached : 0.0;
  vs_stages of;
  const double h = m->choice.ahead > 0.0 ? m->choice.ahead : m->usual > 0.0 ? m->usual : 1e-3;
  int i, trial;
  if (!is_begun && !vs_begin_here(m, vs_unit_of(seriesSmaller(limit, h)))) return SCENE_SINGULAR;
  /* (Where a formula has no series, no rate of R exists.) */
  for (i = 0; i < K; ++i) {
    if (isfinite(it->row[MULTIPLIER + i][0])) continue;
    if (!HAS_SERIES) return SCENE_NOT_FINITE;
    VS_SET_VALUE(it->row[MULTIPLIER + i][0], 0.0);
  }
  vs_lay_out(m, RELATIVE_TOLERANCE <= 1e-5 ? 1 : 0, &of);
  of.h = seriesSmaller(h, limit);
  vs_guess_stages(it, known, past, &of);
  vs_forget_polynomials(w);
  w->unit = it->unit = vs_unit_of(of.h);
  vs_enter_inputs(m, w, 0);
  vs_enter_state(m, w);
  for (i = 0; i < K; ++i) w->row[MULTIPLIER + i][0] = it->row[MULTIPLIER + i][0];
  if (!vs_find_reaction(w, of.R, of.P)) return SCENE_SINGULAR;
  vs_find_slopes(w, &from, &of);
  vs_find_noise(it, w, &of);
  /* (From here on values at stages are in the rows, which are no coefficients.) */
  it->order = of.method->stages;
  it->method = VS_IMPLICIT;
  for (trial = 0; trial < 40 && of.h >= least; ++trial) {
    double part, shorter;
    if (trial > 0) {
      vs_enter_inputs(m, w, 0);
      vs_enter_state(m, w);
    }
    shorter = vs_try_stages(m, it, w, &from, &of, trial == 0 && known != 0, trial > 0 || known == 0,
                            &part);
    if (shorter < 0.0) break;
    if (shorter == 0.0) {
      if (of.h < limit || part * of.h > m->choice.ahead) m->choice.ahead = part * of.h;
      m->usual = m->damped = of.h;
      return SCENE_OK;
    }
    ++m->rejections;
    of.h *= shorter;
  }
  m->is_begun = 0;
  return SCENE_TOO_MANY_STEPS;
}

/* The accelerations, in tolerances, that alone would have to move for what is left of R and psi. */
VS_FUNCTION_RARE double vs_size_of_left(const scene_model* m, const scene_series* w,
                                        const double* left) {
  double largest = 0.0;
  int e, i, p;
  for (i = 0; i < S; ++i)
    largest = seriesLarger(
        largest, fabs(left[i]) / (vs_inertia(w, i, i) * vs_tolerance(w, m->now.acceleration[i])));
  for (p = 0; p < K; ++p) {
    double C = 0.0, least = INFINITY;
    for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      C = seriesLarger(C, fabs(vs_entry(w, p, entry_shaft[e])));
      least = seriesSmaller(least, vs_tolerance(w, m->now.acceleration[entry_shaft[e]]));
    }
    if (left[S + p] != 0.0) largest = seriesLarger(largest, fabs(left[S + p]) / (C * least));
  }
  return largest;
}

/* Moves the state, which m->now is, at theta of an implicit step as one of g to this instant would
 * be: there it satisfies the equations of a stage. (What R and psi are off would move the
 * accelerations alone by as much times the rate of a fast component: of gauss they follow from the
 * state, which is off between the stages by the error of its polynomials; of generalized_gauss R
 * does, which the motion keeps.) False where that fails: the stages were off, too. */
VS_FUNCTION_RARE int vs_settle_implicitly(scene_model* m, scene_series* w, double theta) {
  const scene_series* const it = vs_series(m);
  enum { VS_MOST_ROUNDS = 60 };
  vs_stages of;
  double rate[MOST_INPUTS + 1], reaction[MOST_SHAFTS];
  const double enough = IS_CLASSICAL ? 0.1 : 0.01; /* tolerances */
  const double most = 100.0;                       /* of them, that is no failure */
  double g, *x, moved = INFINITY, before = INFINITY;
  int i, n, round, stalls = 0;
  if (it->method != VS_IMPLICIT) return 1;
  vs_lay_out(m, it->order == vs_radau_of[1].stages, &of);
  of.h = m->damped;
  g = of.h / of.method->real;
  x = of.sum;
  for (i = 0; i < STATES; ++i) rate[i] = vs_evaluate(it->row[rate_row[i]], it->order, theta);
  for (i = 0; i < S; ++i) {
    reaction[i] = 0.0;
    for (n = IS_CLASSICAL ? -1 : it->order; n >= 0; --n)
      reaction[i] = reaction[i] * theta * it->unit / of.h + of.R[S * n + i];
  }
  vs_enter_inputs(m, w, 0);
  /* (C turns with time, and each round leaves a part of what psi is off.) */
  for (round = 0; round < VS_MOST_ROUNDS && moved > enough && stalls < 3; ++round) {
    vs_enter_state(m, w);
    if (!vs_find_reaction(w, x, of.P)) return 1;
    for (i = 0; i < S; ++i) x[i] = reaction[i] - x[i];
    for (i = 0; i < K; ++i)
      x[S + i] = vs_is_on(w, i) && order_of[i] < 3 ? -w->row[residual_row[i]][0] : 0.0;
    for (i = 0; i < STATES; ++i) {
      x[SIZE + i] = IS_CLASSICAL ? w->row[rate_row[i]][0] - rate[i] : (Real)0.0;
    }
    before = moved;
    moved = vs_size_of_left(m, w, x);
    vs_solve_stage(&of, x);
    for (i = 0; i < S; ++i) {
      m->now.acceleration[i] += x[i];
      m->now.velocity[i] += g * x[i];
      m->now.angle[i] += g * g * x[i];
      moved = seriesLarger(moved, fabs(x[i]) / vs_tolerance(it, m->now.acceleration[i]));
    }
    stalls += !(moved < 0.9 * before);
    for (i = 0; i < K; ++i) {
      if (IS_CLASSICAL)
        m->now.multiplier[i] += x[S + i];
      else if (TRANSMITS)
        m->now.multiplier[i] += g * x[S + i];
    }
    for (i = 0; i < STATES; ++i) {
      scene_signal* const s = &m->now.input[state_input[i]];
      s->start = s->target = s->start + g * x[SIZE + i];
      rate[i] += x[SIZE + i];
    }
    if (STATES > 0) vs_enter_inputs(m, w, 0);
  }
  if (moved <= most) return 1;
  vs_enter_state(m, w);
  if (!vs_find_reaction(w, x, of.P)) return 1;
  for (i = 0; i < S; ++i) x[i] -= reaction[i];
  return !vs_is_off(w, &of, x);
}
