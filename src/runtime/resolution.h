/* Whether the series show all that their functions do along a step: a bump that is narrower than
 * the step is in no coefficient. series_resolution.inc and series_ranges.inc go before, and the
 * table `resolved` of the scene's operations. */

/* True if no torque, constraint or inertia differs from its series by more than the tolerance
 * allows, up to theta. */
static int vs_is_resolved(const scene_series* it, double theta) {
  struct SeriesRange ranges[SCENE_ROWS];
  struct SeriesOutputs outputs;
  struct SeriesResolution asked;
  int velocity[S], acceleration[S], i;
  for (i = 0; i < S; ++i) {
    velocity[i] = VELOCITY + i;
    acceleration[i] = ACCELERATION + i;
  }
  outputs.shafts = S;
  outputs.constraints = K;
  outputs.velocity = velocity;
  outputs.acceleration = acceleration;
  outputs.torque = torque_row;
  outputs.residual = residual_row;
  outputs.entry = entry_row;
  outputs.order = order_of;
  outputs.entry_stride = S;
  outputs.inertia = 0;
  outputs.inertia_row = inertia_row;
  outputs.inertial_torque = inertial_row;
  outputs.connection = connection_row;
  outputs.absolute = ABSOLUTE_TOLERANCE;
  outputs.relative = RELATIVE_TOLERANCE;
  outputs.length = theta * it->unit;
  asked.operations = resolved;
  asked.count = RESOLVED;
  asked.rows = it->row[0];
  asked.stride = VS_STRIDE;
  asked.states = it->mode;
  asked.pieces = it->piece;
  asked.ranges = ranges;
  asked.row_count = SCENE_ROWS;
  asked.outputs = &outputs;
  asked.at[0] = asked.at[1] = asked.at[2] = 0;
  asked.last = it->order;
  asked.theta = theta;
  return seriesIsResolved(&asked);
}
