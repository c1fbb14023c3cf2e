/* Elements that hold. Element h has a slip f(t, phi, omega), whose row C = df/domega is one of the
 * constraints' while it is stuck, and a torque T against the slip:
 *     stuck          f = 0,  T = -lambda of the reaction C' lambda,  lower <= T <= upper
 *     slides         side f > 0,  the applied torque -C' T with T(side), side = 1 or -1
 *     free           T = 0, where its level (a capacity) is not above 0, a gap is open or what
 * closes it is too fast A mode is discrete memory: it lasts while its conditions, series that are
 * made from rows of the motion, are not negative. Where one would become negative the modes of all
 * elements that are at rest are decided together: those in which all conditions hold a moment
 * later. That is read from the first coefficient that is more than rounding, so that neither ties
 * nor the torque that lets go, which is the one that slides, need a tolerance of their own. */

/* Losses of a constraint are such an element, too: its torque, and what it holds, is the larger of
 * two lines of the constraint's multiplier,
 *     T = s max_k M_k,  M_k = s slope_k lambda + base_k,  s = 1 or -1
 * Its modes are s with the first line, 3 s with the second, and stuck. */
enum { VS_SECOND_LINE = 3 };

enum { VS_CONDITIONS = 3 };
enum { VS_BEGINS_STUCK = 1, VS_BEGINS_SLIPPING };
enum { VS_OF_LEVEL, VS_OF_SLIP, VS_OF_TORQUE, VS_OF_GAP };

/* The part of its terms that rounding, and what the tolerance leaves open, moves a condition by:
 * more of it, up to the end of the next step, where no modes go on without (vs_find_modes). */
VS_FUNCTION_RARE double vs_noise(const scene_series* it) {
  return (1.0 + it->slack) * seriesLarger(1e-3 * RELATIVE_TOLERANCE, 2e-13);
}

/* The size of the torques on a shaft, order n, each by itself. */
VS_FUNCTION_RARE double vs_torque_size(const scene_series* it, int i, int n) {
  double size = vs_own_size(it, i, n);
  int p;
  for (p = 0; p < K; ++p) {
    const double D = fabs(vs_direction(it, p, i));
    if (D != 0.0) size += D * vs_row_size(it, p, n);
  }
  return size;
}

/* The size of coefficient n of the torques on the shafts of row p, as a multiplier of it. */
VS_FUNCTION_RARE double vs_size_along(const scene_series* it, int p, int n) {
  double size = 0.0;
  int i;
  for (i = 0; i < S; ++i) {
    const double C = fabs(vs_entry(it, p, i));
    if (C != 0.0) size += vs_torque_size(it, i, n) / C;
  }
  return size;
}

/* The size of coefficient n of the torque of element h that is noise: a part of the torques on the
 * shafts that it acts on, or whose load it loses a part of, and of its limits; and rounding of all
 * others, which the rows couple. */
VS_FUNCTION_RARE double vs_torque_noise(const scene_series* it, int h, int n) {
  const double rounding = (1.0 + it->slack) * 2e-14;
  const int p = CONSTRAINTS + h;
  double size =
      fabs(it->row[upper_row[h]][n]) + fabs(it->row[lower_row[h]][n]) + vs_size_along(it, p, n);
  double C = 0.0;
  int e;
  if (load_of[h] >= 0) size += vs_size_along(it, load_of[h], n);
  for (e = entry_begin[p]; e < entry_begin[p + 1]; ++e)
    C = seriesLarger(C, fabs(vs_entry(it, p, entry_shaft[e])));
  return vs_noise(it) * size +
         (C > 0.0 ? rounding * (n > 0 ? vs_size_of_all(it, n) : it->all_torques) / C : 0.0);
}

/* The bound |f_k+1| (|f_k+1| / |f_k|)^(n-k-1) of coefficient n of a slip that rounding left and
 * that a constraint makes die away, as that of SlipRatio does: f_k is the first that is not 0. Its
 * rate is no more than some 1/unit, which steps resolve; for n < 2, or a faster one, it is 0. */
VS_FUNCTION_RARE double vs_decayed_slip(const Real* f, int n) {
  const double most_rate = 8.0; /* 1/unit */
  double rate, bound;
  int k = 0;
  if (n < 2) return 0.0;
  while (k < n - 2 && f[k] == 0.0) ++k;
  rate = fabs(f[k + 1] / f[k]);
  if (!(rate <= most_rate)) return 0.0;
  bound = fabs(f[k + 1]);
  for (k += 2; k <= n && bound > 0.0; ++k) bound *= rate;
  return bound;
}

/* The size of coefficient n of a slip that is rounding: what a torque that is rounding makes of it,
 * f_n = unit/n C J^-1 C' T_{n-1}, and as much again: a torque that lets go, by more than rounding
 * or not, leaves a slip that does not turn back. */
VS_FUNCTION_RARE double vs_slip_noise(const scene_series* it, int h, int n) {
  double size = 0.0, mobility = 0.0;
  int i;
  for (i = 0; i < S; ++i) {
    const double C = fabs(vs_entry(it, CONSTRAINTS + h, i));
    size += C * fabs(it->row[VELOCITY + i][0]);
    mobility += C * C / vs_inertia(it, i, i);
  }
  if (n > 0)
    return seriesLarger(vs_decayed_slip(it->row[slip_row[h]], n),
                        2.0 * it->unit / n * mobility * vs_torque_noise(it, h, n - 1));
  return seriesLarger((1.0 + it->slack) * 1e-3 * ABSOLUTE_TOLERANCE, vs_noise(it) * size);
}

VS_FUNCTION_RARE double vs_condition_noise(const scene_series* it, int h, int kind, int n,
                                           const Real* c) {
  double size = 0.0;
  int i;
  switch (kind) {
    case VS_OF_SLIP:
      return vs_slip_noise(it, h, n);
    case VS_OF_TORQUE:
      return vs_torque_noise(it, h, n);
    case VS_OF_GAP:
      if (n > 0) return it->unit / n * vs_slip_noise(it, h, n - 1);
      for (i = 0; i < S; ++i) size += fabs(it->row[ANGLE + i][0]);
      return seriesLarger(1e-3 * vs_tolerance(it, size), vs_noise(it) * size);
    default:
      for (i = 0; i <= it->order; ++i) size = seriesLarger(size, fabs(c[i]));
      return vs_noise(it) * size;
  }
}

/* An instant, too, is known up to rounding, and with it each derivative. */
VS_FUNCTION_RARE double vs_instant_noise(const scene_series* it, int n, const Real* c) {
  const double resolution = 8.0 * DBL_EPSILON * seriesLarger(1.0, it->row[TIME][0]) / it->unit;
  if (n >= it->order) return 0.0;
  return resolution * (n + 1) * fabs(c[n + 1]);
}

VS_FUNCTION_RARE int vs_is_noise(const scene_series* it, int h, int kind, int n, const Real* c) {
  const double size = fabs(c[n]);
  return size <= vs_instant_noise(it, n, c) || size <= vs_condition_noise(it, h, kind, n, c);
}

/* c = factor x + other y */
VS_FUNCTION_RARE void vs_combine(Real* c, int last, double factor, const Real* x, double other,
                                 const Real* y) {
  int n;
  for (n = 0; n <= last; ++n) c[n] = factor * x[n] + (other == 0.0 ? vs_zero : other * y[n]);
}

/* True for the losses of a constraint. */
VS_FUNCTION_RARE int vs_is_loss(const scene_series* it, int h) {
  (void)it;
  return load_of[h] >= 0;
}

/* M_line of side s less the torque that holds, up to order `last`. */
VS_FUNCTION_RARE void vs_margin(const scene_series* it, int h, int s, int line, int last, Real* c) {
  const Real* const slope = it->row[slope_row[2 * h + line]];
  const Real* const base = it->row[base_row[2 * h + line]];
  int n;
  for (n = 0; n <= last; ++n) {
    const Real load = vs_convolve(slope, it->row[TRANSMITTED + load_of[h]], n, 0, 0);
    c[n] = s * (load + it->row[TRANSMITTED + CONSTRAINTS + h][n]) + base[n];
  }
}

/* M_line less the other line. */
VS_FUNCTION_RARE void vs_lead(const scene_series* it, int h, int s, int line, int last, Real* c) {
  Real other[VS_STRIDE];
  int n;
  vs_margin(it, h, s, line, last, c);
  vs_margin(it, h, s, 1 - line, last, other);
  for (n = 0; n <= last; ++n) c[n] -= other[n];
}

/* The lead as a mode's condition. lambda is off a change of lines by what C J^-1 D' divides, which
 * is another one in the other mode: it is scaled, and its rounding judged by both lines and the
 * torques on the shaft (lambda is 0 where gears without bearing torques change lines), for one mode
 * not to take for rounding what the other does not. True where its first coefficient is more
 * than rounding. */
VS_FUNCTION_RARE int vs_scaled_lead(const scene_series* it, int h, int mode, Real* c) {
  const int s = mode > 0 ? 1 : -1, p = load_of[h];
  double size = 0.0;
  int i, n;
  if (p < 0) return 0; /* no losses */
  for (i = 0; i < 2; ++i) {
    size += fabs(it->row[slope_row[2 * h + i]][0] * it->row[TRANSMITTED + p][0]) +
            fabs(it->row[base_row[2 * h + i]][0]);
  }
  vs_lead(it, h, s, mode != s, it->order, c);
  for (n = 0; n <= it->order; ++n) c[n] *= it->size[p] / vs_row_length(it, p);
  size = vs_noise(it) * size + vs_torque_noise(it, h, 0);
  if (fabs(c[0]) > size + vs_instant_noise(it, 0, c)) return 1;
  VS_SET_VALUE(c[0], 0.0);
  return 0;
}

/* The larger line, by the coefficients of its lead up to `last`. */
VS_FUNCTION_RARE int vs_line(const scene_series* it, int h, int s, int last) {
  Real c[VS_STRIDE];
  int n;
  vs_lead(it, h, s, 0, it->order, c); /* (What is noise is told by the next one, too.) */
  for (n = 0; n <= last && vs_is_noise(it, h, VS_OF_TORQUE, n, c); ++n) c[n] = 0.0;
  return vs_first_sign(c, last) < 0.0;
}

VS_FUNCTION_RARE int vs_mode_of_line(int s, int line) {
  return line == 0 ? s : VS_SECOND_LINE * s;
}

VS_FUNCTION_RARE int vs_side_of(int mode) {
  return mode > 0 ? 1 : -1;
}

/* True where the slip stays 0, by its coefficients up to `last`. */
VS_FUNCTION_RARE int vs_stays(const scene_series* it, int h, int last) {
  const Real* const f = it->row[slip_row[h]];
  double rate = 0.0;
  int i, n;
  for (i = 0; i < S; ++i)
    rate += vs_entry(it, CONSTRAINTS + h, i) * it->row[ACCELERATION + i][0] * it->unit;
  if (fabs(f[0]) > vs_slip_noise(it, h, 0) || fabs(rate) > vs_slip_noise(it, h, 1)) return 0;
  for (n = 2; n <= last && vs_is_noise(it, h, VS_OF_SLIP, n, f); ++n) continue;
  return n > last;
}

/* The mode as a user sees it: of losses 1 where the first shaft drives, -1 where the second does.
 * An element that others hold at rest does not slide, though it transmits its limit. */
VS_FUNCTION_RARE int vs_told_mode(const scene_series* it, int h, int mode, int last) {
  if (mode == VS_STUCK || mode == VS_FREE) return mode;
  if (vs_stays(it, h, last)) return VS_STUCK;
  return vs_plain_mode(h, mode);
}

/* True where the level of element h is above 0 a moment later. */
VS_FUNCTION_RARE int vs_is_engaged(const scene_series* it, int h) {
  const Real* const level = it->row[level_row[h]];
  int n;
  for (n = 0; n < it->order && vs_is_noise(it, h, VS_OF_LEVEL, n, level); ++n) continue;
  return level[n] > 0.0;
}

/* Condition k of the present mode of element h, without the coefficients at its begin that are
 * rounding. False where the mode has no such condition. */
VS_FUNCTION_RARE int vs_condition(const scene_model* m, const scene_series* it, int h, int k,
                                  Real* c) {
  const Real* const f = it->row[slip_row[h]];
  const Real* const tau = it->row[TRANSMITTED + CONSTRAINTS + h];
  const Real* const level = it->row[level_row[h]];
  const int mode = m->now.mode[h], last = it->order;
  const int s = k == 2 ? -1 : 1;
  int kind = VS_OF_LEVEL, n;
  if (mode == VS_FREE) {
    const int nears = closes_below[h] > 0.0 && vs_is_engaged(it, h);
    if (k > 0) return 0;
    if (has_gap[h]) {
      kind = VS_OF_GAP;
      vs_combine(c, last, 1.0, it->row[gap_row[h]], 0.0, f);
    } else if (nears) {
      vs_combine(c, last, f[0] < 0.0 ? -1.0 : 1.0, f, 0.0, f);
      c[0] -= closes_below[h];
    } else {
      vs_combine(c, last, -1.0, level, 0.0, f);
    }
  } else if (k == 0) {
    if (!has_level[h]) return 0;
    vs_combine(c, last, 1.0, level, 0.0, f);
  } else if (vs_is_loss(it, h) && (mode == VS_STUCK ? m->now.counts[h] : k == 2)) {
    kind = VS_OF_TORQUE;
    if (mode == VS_STUCK)
      vs_margin(it, h, s, vs_line(it, h, s, last), last, c);
    else if (vs_scaled_lead(it, h, mode, c))
      return 1;
  } else if (mode != VS_STUCK || !m->now.counts[h]) {
    if (mode != VS_STUCK && k == 2) return 0;
    kind = VS_OF_SLIP;
    vs_combine(c, last, mode == VS_STUCK ? s : vs_side_of(mode), f, 0.0, f);
  } else {
    if (k == 1 ? !has_upper[h] : !has_lower[h]) return 0;
    kind = VS_OF_TORQUE;
    if (k == 1)
      vs_combine(c, last, 1.0, it->row[upper_row[h]], 1.0, tau);
    else
      vs_combine(c, last, -1.0, it->row[lower_row[h]], -1.0, tau);
  }
  for (n = 0; n <= last && vs_is_noise(it, h, kind, n, c); ++n) VS_SET_VALUE(c[n], 0.0);
  return 1;
}
