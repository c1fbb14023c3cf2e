/* The formulas of a motion along steps that another program makes. */

/* The series of a state, shown, as far as steps of `limit` s need them; 0 where there are none. */
VS_FUNCTION int vs_host_expand(vs_host* h, const vs_exchange* from, double limit, vs_shown* to) {
  const scene_series* it;
  scene_status status;
  int c;
  vs_take_over(&h->model, from);
  status = vs_expand(&h->model, limit);
  it = vs_series(&h->model);
  for (c = 0; c < 3 * S; ++c) to->rows[c] = it->row[ANGLE + c];
  for (c = 0; c < S; ++c) to->rows[3 * S + c] = it->row[torque_row[c]];
  to->last = it->order;
  to->unit = it->unit;
  to->length = h->model.usual;
  to->stiffness = status == SCENE_OK ? vs_stiffness(it, to->length / it->unit) : 0.0;
  return status == SCENE_OK;
}

/* The values of all rows at a state. */
VS_FUNCTION void vs_host_evaluate(vs_host* h, const vs_exchange* at, double* values) {
  scene_series* const it = &h->seen;
  int r;
  vs_take_over(&h->model, at);
  vs_enter_inputs(&h->model, it, 0);
  vs_enter_state(&h->model, it);
  for (r = 0; r < SCENE_ROWS; ++r) values[r] = it->row[r][0];
}
