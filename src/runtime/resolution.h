/* The check that series show all that their functions do along a step: a bump that is narrower than
 * the step is in no coefficient. series_resolution.inc and series_ranges.inc go before, and the
 * table `resolved` of the scene's operations. */

/* True if no output differs from its polynomial by more than the tolerance allows over h s. A
 * torque moves velocities by h Q / J and accelerations by Q / J; C epsilon = -psi, and of order 3
 * C eta = -c0, with epsilon moved by h eta. */
VS_FUNCTION_RARE int vs_are_outputs_resolved(const scene_series* it,
                                             const struct SeriesRange* ranges, double h) {
  int i, p;
  int is_resolved = 1;
#define SIZE_OF(r) fabs((double)it->row[r][0])
#define TOLERANCE_OF(r) vs_tolerance(it, (double)it->row[r][0])
#define ALLOW(r, allowed) is_resolved = is_resolved && ranges[r].off <= (allowed)
  for (i = 0; i < S; ++i) {
    const double J = SIZE_OF(inertia_row[i]);
    const double of_velocity = J * TOLERANCE_OF(VELOCITY + i) / h;
    const double of_acceleration = J * TOLERANCE_OF(ACCELERATION + i);
    const double allowed = seriesSmaller(
        of_velocity, seriesLarger(of_acceleration, RELATIVE_TOLERANCE * SIZE_OF(torque_row[i])));
    ALLOW(torque_row[i], allowed);
    ALLOW(inertia_row[i], RELATIVE_TOLERANCE * J);
    ALLOW(inertial_row[i], allowed);
    ALLOW(connection_row[i], RELATIVE_TOLERANCE * seriesLarger(SIZE_OF(connection_row[i]), J / h));
  }
  for (p = 0; p < K; ++p) {
    const int* const entry = entry_row + p * S;
    double size = 0.0, allowed = 0.0;
    for (i = 0; i < S; ++i) {
      size = seriesLarger(size, SIZE_OF(entry[i]));
      allowed = seriesLarger(allowed, SIZE_OF(entry[i]) * TOLERANCE_OF(ACCELERATION + i));
    }
    ALLOW(residual_row[p], order_of[p] == 3 ? allowed / h : allowed);
    for (i = 0; i < S; ++i) ALLOW(entry[i], RELATIVE_TOLERANCE * size);
  }
  for (i = 0; i < STATES; ++i) ALLOW(rate_row[i], TOLERANCE_OF(STATE + i) / h);
#undef SIZE_OF
#undef TOLERANCE_OF
#undef ALLOW
  return is_resolved;
}

/* True if no torque, constraint, inertia or limit of an element that holds differs from its series
 * by more than the tolerance allows, up to theta, by ranges over the step, where an operation may
 * have more unresolved than visible terms. at: the values of all rows at the step's start, middle
 * and end, or 0. */
VS_FUNCTION_RARE int vs_is_resolved_in_ranges(const scene_series* it, double theta,
                                              const double* const* at) {
#ifdef VS_RANGES
  struct SeriesRange* const ranges = VS_RANGES;
#else
  struct SeriesRange ranges[SCENE_ROWS];
#endif
  struct SeriesResolution asked = {
      resolved,  RESOLVED,   VS_PLAIN(it->row[0], SCENE_ROWS * VS_STRIDE),
      VS_STRIDE, it->mode,   VS_PLAIN(it->piece, SCENE_PIECES),
      ranges,    SCENE_ROWS, {0, 0, 0},
      it->order, theta,      {0.0}};
  int i;
  for (i = 0; i < 3 && at != 0; ++i) asked.at[i] = at[i];
  if (!seriesFollowAll(&asked)) return 1;
  if (!vs_are_outputs_resolved(it, ranges, theta * it->unit)) return 0;
  for (i = 0; i < WATCHED; ++i) {
    if (!(ranges[watched_row[i]].off <= vs_tolerance(it, it->row[watched_row[i]][0]))) return 0;
  }
  /* A switching function that is flat here (max(0, tanh(x)) at x = -200) may pass unseen. */
  for (i = 0; i < SIGNS; ++i) {
    const int row = sign_row[i];
    const struct SeriesRange* range = ranges + row;
    double low, high, size;
    if (!(range->off > 0.0)) continue;
    range = seriesRange(&asked, row);
    low = range->low;
    high = range->high;
    size = seriesSizeOf(range);
    if (at != 0) { /* its polynomial may be none */
      low = seriesSmaller(seriesSmaller(at[0][row], at[1][row]), at[2][row]) - range->off;
      high = seriesLarger(seriesLarger(at[0][row], at[1][row]), at[2][row]) + range->off;
      size = seriesLarger(fabs(low + range->off), fabs(high - range->off));
    }
    if (!(low <= 0.0 && high >= 0.0)) continue;
    /* (A kink within so little of its argument is none.) */
    if (!sign_jumps[i] && size + range->off <= 1e-3 * ABSOLUTE_TOLERANCE) continue;
    /* (A range without an end has no part that is little.) */
    if (!(range->off < INFINITY && range->off <= 1e-6 * size)) return 0;
  }
  return 1;
}

/* True if no torque, constraint, inertia or limit of an element that holds differs from its series
 * by more than the tolerance allows, up to theta. */
VS_FUNCTION int vs_is_resolved(const scene_series* it, double theta) {
  double powers[VS_STRIDE];
  double hidden;
  int k;
  powers[0] = 1.0;
  for (k = 1; k <= it->order; ++k) powers[k] = powers[k - 1] * theta;
  if (it->order == SCENE_ORDER)
    hidden = vs_hides(it, powers, SCENE_ORDER);
  else
    hidden = vs_hides(it, powers, it->order);
  return hidden == 0.0 || vs_is_resolved_in_ranges(it, theta, 0);
}
