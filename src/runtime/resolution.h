/* The check that series show all that their functions do along a step: a bump that is narrower than
 * the step is in no coefficient. series_resolution.inc and series_ranges.inc go before, and the
 * table `resolved` of the scene's operations. */

/* True if no torque, constraint or inertia differs from its series by more than the tolerance
 * allows, up to theta. */
static int vs_is_resolved(const scene_series* it, double theta) {
  struct SeriesRange ranges[SCENE_ROWS];
  int velocity[S], acceleration[S], i;
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
                                        theta * it->unit};
  struct SeriesResolution asked = {resolved,  RESOLVED, it->row[0], VS_STRIDE, it->mode,
                                   it->piece, ranges,   SCENE_ROWS, &outputs,  {0, 0, 0},
                                   it->order, theta,    {0.0}};
  for (i = 0; i < S; ++i) {
    velocity[i] = VELOCITY + i;
    acceleration[i] = ACCELERATION + i;
  }
  return seriesIsResolved(&asked);
}
