/* The choice between steps by series and implicit ones, by the motion alone. */

/* Steps under suspicion before implicit ones are tried again, at most. */
enum { VS_LONGEST_WAIT = 1024 };
/* Implicit steps before series are tried again. */
enum { VS_LONGEST_RUN = 100 };

/* |lambda| of the exponential, or of the pair of them, that the last derivatives d_n = n! c_n are
 * of: d_n = lambda d_{n-1}, or d_n = a d_{n-1} + b d_{n-2}. 0 where they are of none: those of a
 * singularity at a distance R grow as n! / R^n. */
VS_FUNCTION_RARE double vs_exponential_rate(const Real* c, int last) {
  enum { VS_DERIVATIVES = 7 };
  const double match = 0.02; /* relative departure */
  double d[VS_DERIVATIVES];  /* the last first, over last! */
  double factor = 1.0, lambda, det, a, b, square;
  /* (The first coefficients are those of the slow motion.) */
  const int asked = last - 4 < 5 ? last - 4 : 5;
  int j, single = 1;
  if (last < VS_DERIVATIVES) return fabs(last * c[last] / c[last - 1]); /* too few to tell */
  d[0] = c[last];
  for (j = 1; j < VS_DERIVATIVES; ++j) {
    factor /= last - j + 1;
    d[j] = c[last - j] * factor;
  }
  lambda = d[0] / d[1];
  for (j = 1; j < asked; ++j)
    single = single && fabs(d[j] - lambda * d[j + 1]) <= match * fabs(d[j]);
  if (single) return fabs(lambda);
  det = d[1] * d[3] - d[2] * d[2];
  a = (d[0] * d[3] - d[1] * d[2]) / det;
  b = (d[1] * d[1] - d[0] * d[2]) / det;
  for (j = 2; j < asked; ++j) {
    const double first = a * d[j + 1], second = b * d[j + 2];
    if (!(fabs(d[j] - first - second) <= match * (fabs(first) + fabs(second)))) return 0.0;
  }
  square = 0.25 * a * a + b;
  return square < 0.0 ? sqrt(-b) : fabs(0.5 * a) + sqrt(square);
}

/* |h lambda| over the bound of stability, of a component that limits a step of theta units and has
 * died away itself: it is in the coefficients as delta lambda^n / n!, with delta of the tolerance's
 * size, and allows about |lambda h|^N / N! = 1. So does a singularity of size delta at a distance
 * R, which allows |h| < R. Of a motion that swings or turns so fast delta is far above the
 * tolerance. */
VS_FUNCTION_RARE double vs_stiffness_of(const Real* c, int last, double tolerance, double theta) {
  const double e = 2.718281828459045;
  const double faint = 100.0 * tolerance; /* the largest that has died away */
  const int early = last / 4 > 2 ? last / 4 : 2;
  double most = 2.0 * faint, rate, here, before = 0.0, delta;
  int k;
  /* Such a component has at most this in its early terms, x^m / m! at x = N / e. */
  for (k = 1; k <= early; ++k) most *= last / (e * k * theta);
  if (fabs(c[early]) > most) return 0.0;
  rate = vs_exponential_rate(c, last);
  if (rate > 0.0) {
    delta = seriesLarger(fabs(c[last]), fabs(c[last - 1]) * rate / last);
    for (k = 1; k <= last; ++k) delta *= k / rate;
    return delta <= faint ? rate * theta * e / last : 0.0;
  }
  if (last < 7) return 0.0;
  for (here = 0.0, k = 0; k < 3; ++k) { /* one of them may vanish by accident */
    here = seriesLarger(here, fabs(c[last - 2 + k]));
    before = seriesLarger(before, fabs(c[last - 6 + k]));
  }
  rate = sqrt(sqrt(here / before)); /* 1 / R */
  for (delta = here, k = 1; k < last; ++k) delta /= rate;
  return delta <= faint ? theta * rate : 0.0;
}

/* The same of the motion whose series limited a step of theta units. */
VS_FUNCTION_RARE double vs_stiffness(const scene_model* m, const scene_series* it, double theta) {
  const double limiting = 0.05; /* part of the largest last terms that limits steps, too */
  double size[3 * MOST_SHAFTS + MOST_INPUTS], largest = 0.0, stiffest = 0.0;
  int i;
  for (i = FIRST_JUDGED; i < COMPONENTS + STATES; ++i) {
    const int is_memory = i >= COMPONENTS;
    const int last = is_memory ? it->order + 1 : vs_last(it);
    const Real* const c = it->row[is_memory ? STATE + i - COMPONENTS : ANGLE + i];
    size[i] = seriesLarger(fabs(c[last]) * theta, fabs(c[last - 1])) / vs_tolerance(it, c[0]);
    largest = seriesLarger(largest, size[i]);
  }
  for (i = FIRST_JUDGED; i < COMPONENTS + STATES; ++i) {
    const int is_memory = i >= COMPONENTS;
    const Real* const c = it->row[is_memory ? STATE + i - COMPONENTS : ANGLE + i];
    const int last = is_memory ? it->order + 1 : vs_last(it);
    /* (Rounding of the accelerations keeps a fast component alive, and its steps shorter.) */
    const double noise = i >= 2 * S && !is_memory ? m->noise[i - 2 * S] : 0.0;
    const double tolerance = vs_tolerance(it, c[0]);
    double shorter = 1.0;
    if (!(size[i] >= limiting * largest)) continue;
    if (noise > 0.0) shorter = pow(1.0 + noise / tolerance, 1.0 / last);
    stiffest = seriesLarger(stiffest, shorter * vs_stiffness_of(c, last, tolerance + noise, theta));
  }
  return stiffest;
}

/* An implicit step costs about as much as so many by series. */
VS_FUNCTION double vs_cost_of_implicit(void) {
  return 3.0;
}

VS_FUNCTION_RARE void vs_go_over(scene_model* m, int method) {
  m->choice.method = method;
  m->choice.suspicions = m->choice.quiet = m->choice.made = 0;
}

/* Behind a step of h s by series: implicit ones are tried where its stability has limited some
 * steps, or a guard, whose coefficients are those of a fast component, many after each other. */
VS_FUNCTION_RARE void vs_suspect(scene_model* m, const scene_series* it, double h) {
  enum { VS_SUSPICIONS = 3, VS_QUIET = 5, VS_CUT = 20 };
  scene_choice* const choice = &m->choice;
  const int is_cut = h < m->usual * (1.0 - 1e-9);
  const int is_stiff = vs_stiffness(m, it, h / it->unit) > (is_cut ? 0.3 : 0.7);
  choice->made = !is_cut ? 0 : choice->made + is_stiff;
  if (is_cut && choice->made < VS_CUT) return;
  if (!is_stiff) {
    if (++choice->quiet >= VS_QUIET) choice->suspicions = 0;
    return;
  }
  choice->quiet = 0;
  if (++choice->suspicions < (choice->wait > 0 ? choice->wait : VS_SUSPICIONS)) return;
  vs_go_over(m, VS_IMPLICIT);
  choice->by_series = h;
  choice->left = VS_LONGEST_RUN;
  choice->ahead = h * vs_cost_of_implicit() * 2.0;
}

/* Behind an implicit step: back to series where they got as far. The first steps damp what a
 * motion by series has left of the fast components. */
VS_FUNCTION_RARE void vs_reconsider(scene_model* m) {
  enum { VS_TRIAL = 4, VS_SHORT_STEPS = 3 };
  scene_choice* const choice = &m->choice;
  const int is_trial = ++choice->made <= VS_TRIAL;
  const int is_short = choice->ahead < choice->by_series * vs_cost_of_implicit();
  --choice->left;
  choice->quiet = is_short ? choice->quiet + 1 : 0;
  if (is_trial ? choice->made < VS_TRIAL || !is_short
               : choice->quiet < VS_SHORT_STEPS && choice->left > 0)
    return;
  if (is_trial)
    choice->wait = choice->wait > 0 ? choice->wait * 4 : 12;
  else
    choice->wait = 0;
  if (choice->wait > VS_LONGEST_WAIT) choice->wait = VS_LONGEST_WAIT;
  vs_go_over(m, VS_BY_SERIES);
  if (choice->by_series > 0.0) m->usual = choice->by_series;
}

/* A formula has no series here, as a root at 0 has none: some steps by stages, which need its
 * values alone, lead away from there. */
VS_FUNCTION_RARE void vs_go_around(scene_model* m) {
  enum { VS_STEPS_AROUND = 10 };
  vs_go_over(m, VS_IMPLICIT);
  m->choice.left = VS_STEPS_AROUND;
  m->choice.by_series = m->choice.ahead = 0.0;
}

/* No implicit step was found: series make the next ones. */
VS_FUNCTION_RARE void vs_give_up_implicit(scene_model* m) {
  vs_go_over(m, VS_BY_SERIES);
  m->choice.wait = VS_LONGEST_WAIT;
  if (m->choice.by_series > 0.0) m->usual = m->choice.by_series;
}

/* Chooses the method of the next step, the last one having been h s long. */
VS_FUNCTION void vs_choose_method(scene_model* m, const scene_series* it, double h) {
  if (m->choice.is_first && it->method == VS_IMPLICIT) m->choice.first = m->choice.ahead;
  m->choice.is_first = 0;
  if (!CHOOSES_METHOD || BY_STAGES) return;
  if (m->choice.method == VS_IMPLICIT)
    vs_reconsider(m);
  else
    vs_suspect(m, it, h);
}
