/* Events: where a formula changes its mode, a switching function (a row of the series) passes 0 or
 * a point of a table; where an element that holds or slides ends that, a condition of it does. */

typedef struct {
  double theta; /* of the step, in units */
  int guard;    /* -1: none; below SIGNS a switching function, from there on a table's argument */
  int jumps;    /* 1: a torque or a residual may jump there */
  double side;  /* the sign of the distance before it */
  double point; /* of a table */
  int element;  /* that holds, whose mode ends there; -1: none */
  int condition;
  int lands; /* 1: the state comes to a stop on the jump itself, and the formulas there go on */
  int lost;  /* the guard of a jump that the state has passed, though its polynomial has no root */
} vs_event;

VS_FUNCTION const Real* vs_guard(const scene_series* it, int guard) {
  return it->row[guard < SIGNS ? sign_row[guard] : passage_row[guard - SIGNS]];
}

/* 1: the guard stays on a jump by all but rounding (vs_note_resting). */
#define VS_RESTS(it, guard) (it)->mode[SCENE_MODES - SIGNS - TABLES + (guard)]

/* In the place of a guard that is left out: all are searched behind the begin alone. */
enum { VS_BEHIND_BEGIN = -2 };

/* Roots that are `close` are one event, and a jump among them is what is to be crossed. */
VS_FUNCTION void vs_meet(vs_event* found, const Real* c, int last, int guard, double point,
                         double close, int but) {
  /* A motion that begins on the edge of a jump, or of a kink of a speed, leaves it at once. */
  const int jumps = guard < SIGNS ? sign_jumps[guard] : passage_jumps[guard - SIGNS];
  const double side = vs_first_sign(c, last);
  const int is_start =
      (jumps || HAS_ORDER_1) && c[0] == 0.0 && side != 0.0 && but != VS_BEHIND_BEGIN;
  const int is_other = found->guard >= 0 && jumps != found->jumps;
  const double end = found->theta + (is_other ? (jumps - found->jumps) * close : 0.0);
  const double theta = is_start || !(end > 0.0) ? 0.0 : (double)vs_first_root(c, last, end);
  if (theta > end || (found->guard >= 0 && theta == end)) return;
  found->theta = theta;
  found->guard = guard;
  found->jumps = jumps;
  found->side = is_start ? 0.0 : side;
  found->point = point;
  found->element = -1;
}

/* The end of a mode: the first root of a condition that was not negative, or a level that is 0. */
VS_FUNCTION void vs_meet_end(const scene_model* m, const scene_series* it, vs_event* found) {
  Real c[VS_STRIDE];
  int h, k;
  for (h = 0; h < HOLDS; ++h) {
    for (k = 0; k < VS_CONDITIONS; ++k) {
      double side, theta;
      if (!vs_condition(m, it, h, k, c)) continue;
      side = vs_first_sign(c, it->order);
      theta = side < 0.0 || (side == 0.0 && k == 0 && m->now.mode[h] != VS_FREE)
                  ? 0.0
                  : (double)vs_first_root(c, it->order, found->theta);
      if (theta > found->theta || (found->element >= 0 && theta == found->theta)) continue;
      found->theta = theta;
      found->element = h;
      found->condition = k;
    }
  }
}

/* The points of a table's argument between which x lies, or on one of which it begins. */
VS_FUNCTION void vs_find_points(const scene_series* it, int table, double x, double* low,
                                double* high, double* on) {
  const Real* const points = passage_points[table];
  int above = vs_count_below(points, passage_count[table], x);
  (void)it;
  *high = above < passage_count[table] ? (double)points[above] : INFINITY;
  *on = above > 0 && points[above - 1] == x ? x : INFINITY;
  if (*on == x) --above;
  *low = above > 0 ? (double)points[above - 1] : -INFINITY;
}

/* The points between which a guard has the value x; of a sign that is 0 they are one. */
VS_FUNCTION void vs_find_range(const scene_series* it, int guard, double x, double* low,
                               double* high) {
  double on;
  *low = x < 0.0 ? -INFINITY : 0.0;
  *high = x > 0.0 ? INFINITY : 0.0;
  if (guard >= SIGNS) vs_find_points(it, guard - SIGNS, x, low, high, &on);
}

/* The part of theta up to which a guard's last two terms are next to nothing beside the others: of
 * a guard that varies faster than the motion, or of a mode that is not taken, the series may have
 * ended too early. Terms of the size of `noise` tell nothing. */
VS_FUNCTION double vs_known_part(const Real* c, int last, double theta, double noise) {
  int halvings, n;
  for (halvings = 0; halvings < 60; ++halvings, theta *= 0.5) {
    double power = 1.0;
    double largest = 0.0;
    double tail = 0.0;
    for (n = 0; n <= last; ++n, power *= theta) {
      const double term = fabs(c[n]) * power;
      if (n < last - 1)
        largest = seriesLarger(largest, term);
      else
        tail = seriesLarger(tail, term);
    }
    if (tail <= 1e-4 * largest || tail <= noise) break;
  }
  return theta;
}

/* The distance that a guard stays away from its nearest point over a step, if what its last two
 * terms leave out is four times them at the most: above 0 for guards that need no search. */
VS_FUNCTION double vs_clearance(const Real* c, int last, double theta, double low, double high) {
  double sum = 0.0, term = 0.0, before = 0.0, power = theta;
  int n;
  for (n = 1; n <= last; ++n, power *= theta) {
    before = term;
    term = fabs(c[n]) * power;
    sum += term;
  }
  return seriesSmaller(c[0] - low, high - c[0]) - (sum + 4.0 * (term + before));
}

/* Distances from a jump that are nothing. */
VS_FUNCTION double vs_least_distance(void) {
  return 1e-100;
}

/* True where a guard whose formulas jump at a point has died away to it for good. */
VS_FUNCTION int vs_has_died_away(const scene_series* it, const Real* x, double point) {
  const double fastest = 1e10; /* 1/s, that may have died away */
  double bound = vs_least_distance();
  int n;
  if (!(fabs(x[0] - point) <= bound)) return 0;
  for (n = 1; n <= it->order; ++n) {
    bound *= fastest * it->unit;
    if (!(fabs(x[n]) <= bound)) return 0;
  }
  return 1;
}

/* True where a guard stays on a point up to `reach`, but for what rounding and the tolerance make
 * of it: of speeds that a lock or a gear couples, say. Its modes are those of the point there, and
 * its series is noise, which has roots without end. */
VS_FUNCTION int vs_rests(const scene_series* it, const Real* x, double reach, double point,
                         double part) {
  const double noise = part * vs_tolerance(it, point);
  double sum = fabs(x[0] - point), power = reach;
  int n;
  for (n = 1; n <= it->order && sum <= noise; ++n, power *= reach) sum += fabs(x[n]) * power;
  return sum <= noise;
}

/* The error of a guard's polynomial up to `reach`, as the rounding of the guard's values at the
 * stages makes it. Where the polynomial comes so near to a point of the guard, the search takes it
 * for an event: the step ends before, and a series finds the event or finds none. */
VS_FUNCTION double vs_stage_rounding(const scene_series* it, const Real* c, double reach) {
  double sum = 0.0;
  int n;
  if (!SERIES_LEAD || it->method == VS_BY_SERIES) return 0.0;
  for (n = it->order; n >= 0; --n) sum = sum * reach + fabs(c[n]);
  return 16.0 * DBL_EPSILON * sum;
}

/* True unless a guard stays away from its points up to `reach`: those on both sides of it, and the
 * one on which it begins. */
VS_FUNCTION int vs_may_pass(const scene_series* it, int guard, double reach, double* points) {
  const Real* const x = vs_guard(it, guard);
  const int jumps = guard < SIGNS ? sign_jumps[guard] : passage_jumps[guard - SIGNS];
  int k;
  points[0] = x[0] >= 0.0 ? 0.0 : -INFINITY;
  points[1] = x[0] < 0.0 ? 0.0 : INFINITY;
  points[2] = x[0] == 0.0 ? 0.0 : INFINITY;
  if (guard >= SIGNS) vs_find_points(it, guard - SIGNS, x[0], &points[0], &points[1], &points[2]);
  if (points[2] != x[0] &&
      vs_clearance(x, it->order, reach, points[0], points[1]) > vs_stage_rounding(it, x, reach))
    return 0;
  if (VS_RESTS(it, guard) != 0.0) return 0;
  for (k = 0; k < 3; ++k) {
    if (!isfinite(points[k])) continue;
    if (jumps ? vs_has_died_away(it, x, points[k]) : vs_rests(it, x, reach, points[k], 1e-3))
      return 0;
  }
  return 1;
}

/* The first event in a step of *theta units, or so shortly behind it that rounding might lead over
 * it, but those of the guard `but`, and of elements only if these are asked for. *theta becomes
 * shorter where a guard that may pass is known for a part of it only. */
VS_FUNCTION vs_event vs_find_event(const scene_model* m, const scene_series* it, double* theta,
                                   int but, int has_elements) {
  const double rounding = 8.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time) / it->unit;
  /* (Implicit steps beside those by series are made where a motion hardly changes.) */
  const double noise = it->method == VS_BY_SERIES ? 0.0 : 1e-3 * ABSOLUTE_TOLERANCE;
  const int is_known_in_parts = it->method != VS_IMPLICIT || SERIES_LEAD;
  vs_event found = {0.0, -1, 0, 0.0, 0.0, -1, 0, 0, -1};
  double points[3], error;
  Real c[VS_STRIDE];
  int g, k, n, first = SIGNS + TABLES; /* the first guard that may pass */
  for (g = 0; g < SIGNS + TABLES; ++g) {
    const double reach = *theta * (1.0 + 1e-12) + rounding;
    if (g == but || !vs_may_pass(it, g, reach, points)) continue;
    if (is_known_in_parts) *theta = vs_known_part(vs_guard(it, g), it->order, *theta, noise);
    if (first > g) first = g;
  }
  for (g = 0; g < HOLDS; ++g) {
    for (k = 0; k < VS_CONDITIONS; ++k) {
      const double reach = *theta * (1.0 + 1e-12) + rounding;
      if (is_known_in_parts && vs_condition(m, it, g, k, c) &&
          !(vs_clearance(c, it->order, reach, 0.0, INFINITY) > 0.0))
        *theta = vs_known_part(c, it->order, *theta, 1e-3 * ABSOLUTE_TOLERANCE);
    }
  }
  found.theta = *theta * (1.0 + 1e-12) + rounding;
  if (has_elements) vs_meet_end(m, it, &found);
  for (g = first; g < SIGNS + TABLES; ++g) {
    if (g == but || !vs_may_pass(it, g, found.theta, points)) continue;
    for (n = 0; n <= it->order; ++n) c[n] = vs_guard(it, g)[n];
    error = vs_stage_rounding(it, c, found.theta);
    for (k = 0; k < 3; ++k) {
      if (!isfinite(points[k]) || (k < 2 && points[k] == points[2])) continue;
      c[0] = vs_guard(it, g)[0] - points[k];
      if (error > 0.0 && k < 2) c[0] *= seriesLarger(1e-3, 1.0 - error / fabs(c[0]));
      vs_meet(&found, c, it->order, g, points[k], rounding + 2e-14 * found.theta, but);
    }
  }
  return found;
}

/* The latest end, in units, of a step whose event turns out not to be there: it lies before the
 * events of other guards. Where guards begin on points and leave them so slowly that the state does
 * not show it, none of them is in the way of another. */
VS_FUNCTION double vs_end_without(const scene_model* m, const vs_event* at, double theta) {
  const scene_series* const it = &m->series[m->present];
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time) / it->unit;
  const int is_begin = at->theta == 0.0 && at->side == 0.0;
  double end = theta;
  const vs_event next = vs_find_event(m, it, &end, is_begin ? VS_BEHIND_BEGIN : at->guard, 1);
  if (next.guard >= 0 || next.element >= 0) {
    const double before = seriesSmaller(end, next.theta * (1.0 - 1e-9) - least);
    return seriesLarger(before, at->theta + 64.0 * least);
  }
  return end * (1.0 + 2e-12) + 4.0 * least;
}

/* The distance of the state that was entered from an event. */
VS_FUNCTION double vs_distance(const scene_series* it, const vs_event* at) {
  return vs_guard(it, at->guard)[0] - at->point;
}

VS_FUNCTION int vs_is_beyond(const scene_series* it, const vs_event* at) {
  const double distance = vs_distance(it, at);
  if (distance == 0.0) return at->lands;
  return at->side == 0.0 || vs_have_one_sign(-distance, at->side);
}

/* The heat of element h up to theta, J, the integral of T f. The product is taken up to its own
 * degree: the series end where angles and speeds are known, which is too early for it. */
VS_FUNCTION Real vs_heat(const scene_model* m, const scene_series* it, int h, Real theta) {
  const Real *const T = it->row[slide_row[h]], *const f = it->row[slip_row[h]];
  const int last = it->order;
  Real sum = 0.0;
  int k, n;
  if (m->now.mode[h] == VS_STUCK) return 0.0;
  for (n = 2 * last; n >= 0; --n) {
    Real p = 0.0;
    for (k = n > last ? n - last : 0; k <= n && k <= last; ++k) p += T[k] * f[n - k];
    sum = sum * theta + p / (n + 1);
  }
  return sum * theta * it->unit;
}

/* The state at theta of the present series. */
VS_FUNCTION void vs_go(scene_model* m, Real theta) {
  const scene_series* const it = vs_series(m);
  const Real h = theta * it->unit;
  const int last = vs_last(it);
  Real rest, sum;
  int c, i;
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = vs_evaluate(it->row[ANGLE + i], last, theta);
    m->now.velocity[i] = vs_evaluate(it->row[VELOCITY + i], last, theta);
    m->now.acceleration[i] = vs_evaluate(it->row[ACCELERATION + i], it->order, theta);
  }
  for (c = 0; c < K && (IS_CLASSICAL || TRANSMITS); ++c) {
    m->now.multiplier[c] = vs_evaluate(it->row[TRANSMITTED + c], it->order, theta);
  }
  for (c = 0; c < HOLDS; ++c) m->now.heat[c] += vs_heat(m, it, c, theta);
  for (i = 0; i < STATES; ++i) {
    scene_signal* const s = &m->now.input[state_input[i]];
    s->start = s->target = vs_evaluate(it->row[STATE + i], it->order + 1, theta);
  }
  for (i = 0; i < INPUTS; ++i) {
    scene_signal* const s = &m->now.input[i];
    const int has_arrived = s->age + h >= s->end * (1.0 - 1e-14);
    s->age += h;
    if (has_arrived) VS_SET_VALUE(s->age, s->end);
    if (m->now.silence[i] >= 0.0) m->now.silence[i] += h;
  }
  /* time + time_rest is the sum, rounded once */
  rest = h + m->now.time_rest;
  sum = m->now.time + rest;
  m->now.time_rest = rest - (sum - m->now.time);
  m->now.time = sum;
}
