/* Impacts: J dw = C' p of the rigid rows. Of those that only press one way, and approach or touch,
 *     p >= 0,  f+ >= -e f-,  p (f+ + e f-) = 0
 * which have one solution. What moves apart takes no part: had it a share in an impact, this could
 * bring energy. It meets what the impact has sent back in another one, of the same instant, and so
 * do dogs that close, f+ = 0. Impacts pass constraints without losses: these would need to know how
 * the speeds change within one. */

/* True for elements that let no slip into one direction, or none at all, in their present place. */
VS_FUNCTION_RARE int vs_is_rigid(const scene_model* m, const scene_series* it, int h) {
  Real gap;
  if (closes_below[h] > 0.0 || m->meets[h]) return m->meets[h];
  if (!has_gap[h]) return !slides_backward[h];
  gap = it->row[gap_row[h]][0];
  return gap <= vs_condition_noise(it, h, VS_OF_GAP, 0, &gap);
}

/* Notes the dogs that are closed, or beyond doubt close: others do where no other modes go on. */
VS_FUNCTION_RARE void vs_note_closing(scene_model* m, const scene_series* it) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    const double level = it->row[level_row[h]][0], slip = fabs(it->row[slip_row[h]][0]);
    if (!(closes_below[h] > 0.0) || m->meets[h]) continue;
    m->meets[h] = m->now.mode[h] == VS_STUCK
                      ? level > -vs_noise(it)
                      : level > vs_noise(it) && slip < closes_below[h] - vs_slip_noise(it, h, 0);
  }
}

/* Slower bounces than this, rad/s, end at rest. */
VS_FUNCTION_RARE double vs_slowest_bounce(const scene_series* it) {
  return 0.1 * sqrt(vs_tolerance(it, 1.0));
}

enum { VS_TAKES_NO_PART, VS_PRESSES, VS_HOLDS_FAST };

/* The impulses x of the rows that count. *wrong: a row that should count, or should not; or -1.
 * False where a row is implied by others. */
VS_FUNCTION_RARE int vs_solve_impact(scene_series* it, const int* part, const Real* slip,
                                     const Real* after, Real* x, int* wrong) {
  double largest = 0.0;
  int h, i;
  *wrong = -1;
  if (!vs_factor(it, 1, 3)) return 0;
  for (i = 0; i < SIZE; ++i) x[i] = 0.0;
  for (h = 0; h < HOLDS; ++h) x[S + CONSTRAINTS + h] = after[h] - slip[h];
  vs_solve(it, x);
  for (h = 0; h < HOLDS; ++h)
    if (it->counts[h]) largest = seriesLarger(largest, fabs(x[S + CONSTRAINTS + h]));
  for (h = 0; h < HOLDS && *wrong < 0; ++h) {
    const double noise = vs_slip_noise(it, h, 0);
    double moved = slip[h] - after[h];
    for (i = 0; i < S; ++i) moved += vs_entry(it, CONSTRAINTS + h, i) * x[i];
    if (it->counts[h]) {
      if (part[h] == VS_PRESSES && x[S + CONSTRAINTS + h] < -1e-13 * largest) *wrong = h;
    } else if (part[h] != VS_TAKES_NO_PART) {
      if (part[h] == VS_PRESSES ? moved < -noise : fabs(moved) > noise) *wrong = h;
    }
  }
  return 1;
}

/* The impulses of an impact: by exchanges; else among all sets of rows. */
VS_FUNCTION_RARE int vs_find_impulses(scene_series* it, const int* part, const Real* slip,
                                      const Real* after, Real* x) {
  enum { VS_MOST_AMONG = 12 };
  int among[VS_MOST_AMONG], h, n = 0, round, wrong;
  unsigned set;
  for (h = 0; h < HOLDS; ++h) {
    const int takes_part = part[h] != VS_TAKES_NO_PART;
    it->counts[h] = takes_part && fabs(after[h] - slip[h]) > vs_slip_noise(it, h, 0);
    if (takes_part && n++ < VS_MOST_AMONG) among[n - 1] = h;
  }
  for (round = 0; round < 3 * HOLDS + 3; ++round) {
    if (!vs_solve_impact(it, part, slip, after, x, &wrong)) break;
    if (wrong < 0) return 1;
    it->counts[wrong] = !it->counts[wrong];
  }
  for (set = 1; n <= VS_MOST_AMONG && set < 1u << n; ++set) {
    for (h = 0; h < n; ++h) it->counts[among[h]] = (set >> h) & 1u;
    if (vs_solve_impact(it, part, slip, after, x, &wrong) && wrong < 0) return 1;
  }
  return 0;
}

/* All impacts of the present instant. */
VS_FUNCTION_RARE scene_status vs_collide(scene_model* m, scene_series* it, Real* impulse) {
  enum { VS_MOST_IMPACTS = 60, VS_BOUNCES = 20 };
  Real slip[MOST_HOLDS + 1], after[MOST_HOLDS + 1], x[MOST_SIZE];
  int part[MOST_HOLDS + 1];
  int h, i, round;
  for (h = 0; h < HOLDS; ++h) {
    if (vs_is_loss(it, h)) m->now.side[h] = 0.0;
    impulse[h] = 0.0;
  }
  vs_enter_inputs(m, it, 0);
  for (round = 0; round < VS_MOST_IMPACTS; ++round) {
    int approaches = 0, closes = 0;
    vs_enter_state(m, it);
    vs_note_closing(m, it);
    for (h = 0; h < HOLDS; ++h) {
      const double noise = vs_slip_noise(it, h, 0);
      const int is_dog = closes_below[h] > 0.0;
      slip[h] = it->row[slip_row[h]][0];
      part[h] = !vs_is_rigid(m, it, h) ? VS_TAKES_NO_PART
                : is_dog               ? VS_HOLDS_FAST
                : slip[h] <= noise     ? VS_PRESSES
                                       : VS_TAKES_NO_PART;
      approaches += part[h] == VS_PRESSES && slip[h] < -noise;
      closes += is_dog && part[h] == VS_HOLDS_FAST && fabs(slip[h]) > noise;
      after[h] = part[h] == VS_PRESSES && slip[h] < -vs_slowest_bounce(it) && round < VS_BOUNCES
                     ? -restitution[h] * slip[h]
                     : vs_zero;
    }
    if (approaches + closes == 0) return SCENE_OK;
    for (h = 0; h < HOLDS && approaches > 0; ++h) { /* (Dogs close behind other impacts.) */
      if (part[h] == VS_HOLDS_FAST && fabs(slip[h]) > vs_slip_noise(it, h, 0))
        part[h] = VS_TAKES_NO_PART;
    }
    if (!vs_find_impulses(it, part, slip, after, x)) return SCENE_NO_MODES;
    for (i = 0; i < S; ++i) m->now.velocity[i] += x[i];
    for (h = 0; h < HOLDS; ++h) {
      if (!it->counts[h]) continue;
      impulse[h] += x[S + CONSTRAINTS + h];
      m->now.heat[h] -= 0.5 * x[S + CONSTRAINTS + h] * (slip[h] + after[h]);
    }
  }
  return SCENE_NO_MODES;
}

/* Notes the elements that can be stuck behind an impact only, by the state that was entered. */
VS_FUNCTION_RARE void vs_find_moving(scene_model* m, const scene_series* it) {
  int h;
  for (h = 0; h < HOLDS; ++h) {
    const double slip = it->row[slip_row[h]][0], noise = vs_slip_noise(it, h, 0);
    m->moves[h] = !m->meets[h] && (closes_below[h] > 0.0 ? fabs(slip) > noise
                                                         : !slides_backward[h] && slip < -noise);
  }
}
