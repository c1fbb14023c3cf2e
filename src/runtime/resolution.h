/* The check that series show all that their functions do along a step: a bump that is narrower than
 * the step is in no coefficient. series_resolution.inc and series_ranges.inc go before, and the
 * table `resolved` of the scene's operations. */

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
  int velocity[MOST_SHAFTS], acceleration[MOST_SHAFTS], i;
  const struct SeriesOutputs outputs = {S,
                                        K,
                                        velocity,
                                        acceleration,
                                        torque_row,
                                        residual_row,
                                        entry_row,
                                        order_of,
                                        S,
                                        0,
                                        inertia_row,
                                        inertial_row,
                                        connection_row,
                                        ABSOLUTE_TOLERANCE,
                                        RELATIVE_TOLERANCE,
                                        theta * it->unit,
                                        STATES,
                                        STATE,
                                        rate_row};
  struct SeriesResolution asked = {
      resolved,  RESOLVED,   VS_PLAIN(it->row[0], SCENE_ROWS * VS_STRIDE),
      VS_STRIDE, it->mode,   VS_PLAIN(it->piece, SCENE_PIECES),
      ranges,    SCENE_ROWS, &outputs,
      {0, 0, 0}, it->order,  theta,
      {0.0}};
  for (i = 0; i < S; ++i) {
    velocity[i] = VELOCITY + i;
    acceleration[i] = ACCELERATION + i;
  }
  for (i = 0; i < WATCHED; ++i) ranges[watched_row[i]].off = 0.0;
  for (i = 0; i < SIGNS; ++i) ranges[sign_row[i]].off = 0.0;
  for (i = 0; i < 3 && at != 0; ++i) asked.at[i] = at[i];
  if (!seriesIsResolved(&asked)) return 0;
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
