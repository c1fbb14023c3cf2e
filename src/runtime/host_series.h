/* The formulas of a motion along steps that another program makes. */

/* The series of a state, shown, as far as steps of `limit` s need them; 0 where there are none. */
VS_FUNCTION int vs_host_expand(vs_host* h, const vs_exchange* from, double limit, vs_shown* to) {
  scene_status status;
  vs_take_over(&h->model, from);
  status = vs_expand(&h->model, limit);
  h->taken = h->model.present;
  vs_host_show(h, to);
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
