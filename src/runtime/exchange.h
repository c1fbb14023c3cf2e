/* The state and the inputs of another program. */

VS_FUNCTION scene_signal vs_signal_of(const vs_exchanged_signal* from) {
  scene_signal s;
  s.form = from->form;
  s.start = from->start;
  s.target = from->target;
  s.slope = from->slope;
  s.inverse_tau = from->inverse_tau;
  s.linear = from->linear;
  s.age = from->age;
  s.end = from->end;
  s.piece = 0;
  return s;
}

VS_FUNCTION void vs_describe_signal(const scene_signal* s, vs_exchanged_signal* to) {
  to->form = s->form;
  to->start = s->start;
  to->target = s->target;
  to->slope = s->slope;
  to->inverse_tau = s->inverse_tau;
  to->linear = s->linear;
  to->age = s->age;
  to->end = s->end;
}

VS_FUNCTION void vs_take_over(scene_model* m, const vs_exchange* from) {
  int i;
  m->now.time = from->time;
  m->now.time_rest = from->time_rest;
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = from->state[i];
    m->now.velocity[i] = from->state[S + i];
    m->now.acceleration[i] = from->state[2 * S + i];
    m->now.reaction[i] = from->reaction[i];
  }
  for (i = 0; i < K; ++i) m->now.multiplier[i] = from->multiplier[i];
  for (i = 0; i < INPUTS; ++i) {
    m->now.input[i] = vs_signal_of(&from->input[i]);
    m->now.silence[i] = -1.0;
  }
  for (i = 0; i < K; ++i) m->longest[i] = 0.0;
  /* (An implicit step would take up what was before.) */
  for (i = 0; i < 2; ++i) {
    vs_forget_polynomials(&m->series[i]);
    m->series[i].slack = 0.0;
  }
  vs_forget_rounding(m);
  m->usual = from->usual;
  m->at_rest = 0.0;
  m->choice = from->choice;
  if (BY_STAGES) m->choice.method = VS_IMPLICIT;
  m->is_begun = 0;
  m->has_moved = 1;
  m->crossings = 0;
  m->status = SCENE_OK;
}
