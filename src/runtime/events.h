/* Events: where a formula changes its mode, a switching function (a row of the series) passes 0 or
 * a point of a table. */

typedef struct {
  double theta; /* of the step, in units */
  int guard;    /* -1: none; below SIGNS a switching function, from there on a table's argument */
  int jumps;    /* 1: a torque or a residual may jump there */
  double side;  /* the sign of the distance before it */
  double point; /* of a table */
} vs_event;

static const Real* vs_guard(const scene_series* it, int guard) {
  return it->row[guard < SIGNS ? sign_row[guard] : passage_row[guard - SIGNS]];
}

static double vs_first_sign(const double* c, int last) {
  int n;
  for (n = 0; n < last && c[n] == 0.0; ++n) continue;
  return c[n];
}

static void vs_meet(vs_event* found, const double* c, int last, int guard, double point) {
  /* A motion that begins on the edge of a jump leaves it at once. */
  const int jumps = guard < SIGNS && sign_jumps[guard];
  const double side = vs_first_sign(c, last);
  const int is_start = jumps && c[0] == 0.0 && side != 0.0;
  const double theta = is_start ? 0.0 : vs_first_root(c, last, found->theta);
  if (theta > found->theta || (found->guard >= 0 && theta == found->theta)) return;
  found->theta = theta;
  found->guard = guard;
  found->jumps = jumps;
  found->side = is_start ? 0.0 : side;
  found->point = point;
}

/* The points of a table's argument between which x lies, or on one of which it begins. */
static void vs_find_points(int table, double x, double* low, double* high, double* on) {
  const double* const points = passage_points[table];
  int above = 0;
  while (above < passage_count[table] && points[above] <= x) ++above;
  *high = above < passage_count[table] ? points[above] : INFINITY;
  *on = above > 0 && points[above - 1] == x ? x : INFINITY;
  if (*on == x) --above;
  *low = above > 0 ? points[above - 1] : -INFINITY;
}

/* The part of theta up to which a guard's last two terms are next to nothing beside the others: of
 * a guard that varies faster than the motion, or of a mode that is not taken, the series may have
 * ended too early. */
static double vs_known_part(const double* c, int last, double theta) {
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
    if (tail <= 1e-4 * largest) break;
  }
  return theta;
}

/* The distance that a guard stays away from its nearest point over a step, if what its last two
 * terms leave out is four times them at the most: above 0 for guards that need no search. */
static double vs_clearance(const double* c, int last, double theta, double low, double high) {
  double sum = 0.0, term = 0.0, before = 0.0, power = theta;
  int n;
  for (n = 1; n <= last; ++n, power *= theta) {
    before = term;
    term = fabs(c[n]) * power;
    sum += term;
  }
  return seriesSmaller(c[0] - low, high - c[0]) - (sum + 4.0 * (term + before));
}

/* The first event in a step of *theta units, or so shortly behind it that rounding might lead over
 * it. *theta becomes shorter where a guard that may pass is known for a part of it only. */
static vs_event vs_find_event(const scene_model* m, const scene_series* it, double* theta) {
  const double rounding = 8.0 * DBL_EPSILON * seriesLarger(1.0, m->now.time) / it->unit;
  vs_event found = {0.0, -1, 0, 0.0, 0.0};
  double points[SIGNS + TABLES + 1][3];
  char is_near[SIGNS + TABLES + 1];
  double c[VS_STRIDE];
  int g, k, n;
  for (g = 0; g < SIGNS + TABLES; ++g) {
    const Real* const x = vs_guard(it, g);
    double* const point = points[g];
    const double reach = *theta * (1.0 + 1e-12) + rounding;
    point[0] = x[0] >= 0.0 ? 0.0 : -INFINITY;
    point[1] = x[0] < 0.0 ? 0.0 : INFINITY;
    point[2] = x[0] == 0.0 ? 0.0 : INFINITY;
    if (g >= SIGNS) vs_find_points(g - SIGNS, x[0], &point[0], &point[1], &point[2]);
    is_near[g] = point[2] == x[0] || !(vs_clearance(x, it->order, reach, point[0], point[1]) > 0.0);
    if (is_near[g]) *theta = vs_known_part(x, it->order, *theta);
  }
  found.theta = *theta * (1.0 + 1e-12) + rounding;
  for (g = 0; g < SIGNS + TABLES; ++g) {
    if (!is_near[g]) continue;
    for (n = 0; n <= it->order; ++n) c[n] = vs_guard(it, g)[n];
    for (k = 0; k < 3; ++k) {
      if (!isfinite(points[g][k]) || (k < 2 && points[g][k] == points[g][2])) continue;
      c[0] = vs_guard(it, g)[0] - points[g][k];
      vs_meet(&found, c, it->order, g, points[g][k]);
    }
  }
  return found;
}

/* The distance of the state that was entered from an event. */
static double vs_distance(const scene_series* it, const vs_event* at) {
  return vs_guard(it, at->guard)[0] - at->point;
}

static int vs_is_beyond(const scene_series* it, const vs_event* at) {
  const double distance = vs_distance(it, at);
  return at->side == 0.0 ? distance != 0.0 : distance * at->side < 0.0;
}

/* The state at theta of the present series. */
static void vs_go(scene_model* m, double theta) {
  const scene_series* const it = vs_series(m);
  const double h = theta * it->unit;
  const int last = vs_last(it);
  double rest, sum;
  int c, i;
  for (i = 0; i < S; ++i) {
    m->now.angle[i] = vs_evaluate(it->row[ANGLE + i], last, theta);
    m->now.velocity[i] = vs_evaluate(it->row[VELOCITY + i], last, theta);
    m->now.acceleration[i] = vs_evaluate(it->row[ACCELERATION + i], it->order, theta);
  }
  for (c = 0; c < K && IS_CLASSICAL; ++c) {
    m->now.multiplier[c] = vs_evaluate(it->row[MULTIPLIER + c], it->order, theta);
  }
  for (i = 0; i < INPUTS; ++i) {
    scene_signal* const s = &m->now.input[i];
    const int has_arrived = s->age + h >= s->end * (1.0 - 1e-14);
    s->age = has_arrived ? s->end : s->age + h;
    if (m->now.silence[i] >= 0.0) m->now.silence[i] += h;
  }
  /* time + time_rest is the sum, rounded once */
  rest = h + m->now.time_rest;
  sum = m->now.time + rest;
  m->now.time_rest = rest - (sum - m->now.time);
  m->now.time = sum;
}

/* Quantities that may jump at an event. */
typedef struct {
  double torque[S];
  double residual[K + 1]; /* f or psi; 0 of order 3 */
} vs_law_values;

/* The state at theta behind `base`, with all formulas in `it`. */
static void vs_look_from(scene_model* m, scene_series* it, const scene_state* base, double theta,
                         vs_law_values* found) {
  int i;
  m->now = *base;
  vs_go(m, theta);
  vs_enter_inputs(m, it, 0);
  vs_enter_state(m, it);
  vs_at_once(it, 0);
  for (i = 0; i < S; ++i) found->torque[i] = it->row[torque_row[i]][0];
  for (i = 0; i < K; ++i) {
    const int row = (order_of[i] == 1 ? velocity_residual_row : residual_row)[i];
    found->residual[i] = order_of[i] < 3 ? it->row[row][0] : 0.0;
  }
}

/* A jump of a constraint of order 1 or 2 has no motion. Its size is what it would move the
 * velocities or accelerations by. */
static int vs_has_gap(const scene_model* m, const scene_series* it, const vs_law_values* before,
                      const vs_law_values* after) {
  int i, p;
  for (p = 0; p < K; ++p) {
    const double l = (after->residual[p] - before->residual[p]) / it->size[p];
    const double* const x = order_of[p] == 1 ? m->now.velocity : m->now.acceleration;
    for (i = 0; i < S; ++i) {
      const double moved = vs_entry(it, p, i) * l / vs_inertia(it, i, i);
      if (!(fabs(moved) <= vs_tolerance(x[i]))) return 1;
    }
  }
  return 0;
}

/* f' jumps where f bends in time or angles: the accelerations follow it, C of the others turning
 * with them. */
static scene_status vs_follow_kink(scene_model* m, scene_series* it) {
  double dQ[S], df[K + 1], u[INPUTS + 1];
  int i;
  vs_enter_state(m, it);
  for (i = 0; i < S; ++i) dQ[i] = 0.0;
  for (i = 0; i < K; ++i) df[i] = order_of[i] == 1 ? it->row[residual_row[i]][0] : 0.0;
  for (i = 0; i < INPUTS; ++i) u[i] = vs_input_value(&m->now.input[i]);
  return vs_jump(m, it, u, 0, dQ, df);
}

/* Behind the event, the accelerations that go on from there. */
static scene_status vs_settle_beyond(scene_model* m, scene_series* it, const vs_event* at,
                                     const vs_law_values* before, vs_law_values* after) {
  double u[INPUTS + 1];
  scene_status status;
  int i;
  if (!vs_factor(it, 1, 3)) return SCENE_SINGULAR;
  if (at->jumps && vs_has_gap(m, it, before, after)) return SCENE_NO_MOTION;
  status = vs_project_velocities(m, it);
  if (status == SCENE_OK && IS_CLASSICAL) status = vs_follow_least_reaction(m, it);
  if (status == SCENE_OK && !IS_CLASSICAL && HAS_ORDER_1) status = vs_follow_kink(m, it);
  if (status == SCENE_OK && !IS_CLASSICAL && HAS_RESIDUAL) {
    status = vs_settle(m, it, VS_ONTO_CONSTRAINTS, 0, 0, 0.0, 25);
  }
  if (status != SCENE_OK || IS_CLASSICAL || !at->jumps) return status;
  for (i = 0; i < S; ++i) after->torque[i] -= before->torque[i];
  for (i = 0; i < INPUTS; ++i) u[i] = vs_input_value(&m->now.input[i]);
  return vs_jump(m, it, u, 0, after->torque, 0);
}

/* Over an event, to the state shortly behind it. *theta: where the step is to end, and has ended.
 * The guard's polynomial is off by what the step is: where the state itself passes is tried. Where
 * that is behind the step's end, the guard is -1 and nothing has happened. */
static scene_status vs_cross(scene_model* m, scene_series* it, vs_event* at, double* theta) {
  const scene_state base = m->now;
  const double least = 4.0 * DBL_EPSILON * seriesLarger(1.0, base.time) / vs_series(m)->unit;
  const double end = *theta * (1.0 + 2e-12) + 4.0 * least;
  double ahead = seriesLarger(1e-14 * at->theta, least);
  double back = ahead;
  double low = 0.0;
  vs_law_values before, after;
  int trial;
  for (trial = 0; trial < 60; ++trial, back *= 2.0) {
    low = seriesLarger(0.0, at->theta - back);
    vs_look_from(m, it, &base, low, &before);
    if (low == 0.0 || vs_distance(it, at) * at->side > 0.0) break;
  }
  for (trial = 0; trial < 40; ++trial, ahead *= 2.0) {
    *theta = seriesSmaller(at->theta + ahead, end);
    vs_look_from(m, it, &base, *theta, &after);
    if (vs_is_beyond(it, at)) break;
    if (*theta == end) {
      m->now = base;
      at->guard = -1;
      return SCENE_OK;
    }
  }
  while (*theta - low > seriesLarger(2e-14 * at->theta, least)) {
    const double middle = 0.5 * (low + *theta);
    vs_law_values found;
    vs_look_from(m, it, &base, middle, &found);
    if (vs_is_beyond(it, at)) {
      *theta = middle;
    } else if (vs_distance(it, at) * at->side > 0.0) {
      low = middle;
      before = found;
    } else {
      break; /* on the event itself */
    }
  }
  vs_look_from(m, it, &base, *theta, &after);
  return vs_settle_beyond(m, it, at, &before, &after);
}
