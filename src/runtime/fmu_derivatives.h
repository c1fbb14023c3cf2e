/* Derivatives of outputs by inputs at a communication point, and by parameters before the motion.
 *
 * They are those of the polynomial through the values at six abscissas x_k = u + d_k h,
 *     f'(u) = sum_k f(x_k) L_k'(u),   L_k'(u) = sum_i 1/(x_k - x_i) prod_j (u - x_j)/(x_k - x_j)
 * (i != k; j != i, k). The d_k are -5/2, .., 5/2, moved where a limit of the input is near: the
 * error is of order h^6, or h^5 there. Of several h that one counts for each output whose result
 * differs least from that of the h before. All x_k are other values than u, so that the rounding of
 * a change of inputs, which all f(x_k) contain, cancels. */

enum { FMU_ABSCISSAS = 6, FMU_LEVELS = 6 };

/* L_k'(0) for abscissas first + 1/2, first + 3/2, .. */
static double fmu_weight(int first, int k) {
  double sum = 0.0;
  int i, j;
  for (i = 0; i < FMU_ABSCISSAS; ++i) {
    double product = 1.0 / (k - i);
    if (i == k) continue;
    for (j = 0; j < FMU_ABSCISSAS; ++j)
      if (j != i && j != k) product *= -(first + 0.5 + j) / (k - j);
    sum += product;
  }
  return sum;
}

/* The derivatives of all values by one of the settable ones for one h; `at` is memory. */
static int fmu_differentiate(const fmu_motion* m, fmu_motion* at, unsigned known, double h,
                             int first, double* slope) {
  double u = 0.0;
  int k, n;
  (void)fmu_get(m, known, &u);
  for (n = 0; n < FMU_VALUES; ++n) slope[n] = 0.0;
  for (k = 0; k < FMU_ABSCISSAS; ++k) {
    const double weight = fmu_weight(first, k) / h;
    memcpy(at, m, sizeof *at);
    fmu_aim(at);
    (void)fmu_set(at, known, u + (first + 0.5 + k) * h);
    fmu_look(at);
    if (at->status != SCENE_OK) return 0;
    for (n = 0; n < FMU_VALUES; ++n) slope[n] += weight * at->value[n];
  }
  return 1;
}

/* The derivatives of all values by one of the settable ones. */
static void fmu_find_slopes(const fmu_motion* m, unsigned known, fmu_derivatives* d) {
  const int is_command = known >= FMU_FIRST_COMMAND;
  const int input = is_command ? fmu_command[known - FMU_FIRST_COMMAND] : -1;
  const double low = is_command ? fmu_minimum_of[input] : -INFINITY;
  const double high = is_command ? fmu_maximum_of[input] : INFINITY;
  double u = 0.0, h;
  int level, n, has_before = 0;
  (void)fmu_get(m, known, &u);
  h = is_command ? fmax(1.0, fabs(u)) : u != 0.0 ? fabs(u) : 1.0;
  h = 0.25 * fmin(h, 0.5 * (high - low));
  for (n = 0; n < FMU_VALUES; ++n) d->doubt[n] = INFINITY;
  for (level = 0; level < FMU_LEVELS && h > 0.0; ++level, h *= 0.25) {
    const int is_inside = u >= low && u <= high;
    int first = -FMU_ABSCISSAS / 2, is_done = has_before;
    while (is_inside && u + (first + 0.5) * h < low) ++first;
    while (is_inside && u + (first + FMU_ABSCISSAS - 0.5) * h > high) --first;
    if (!fmu_differentiate(m, &d->at, known, h, first, d->slope)) continue;
    for (n = 0; n < FMU_VALUES; ++n) {
      const double slope = d->slope[n], noise = 64.0 * DBL_EPSILON * fabs(m->value[n]) / h;
      const double doubt = has_before ? fabs(slope - d->before[n]) : INFINITY;
      if (doubt < d->doubt[n]) {
        d->doubt[n] = doubt;
        d->best[n] = fabs(slope) <= noise ? 0.0 : slope;
      }
      is_done = is_done && doubt <= 1e-12 * fabs(slope) + noise;
      d->before[n] = slope;
    }
    has_before = 1;
    if (is_done) return;
  }
}

/* True for a derivative that is known to eight digits, or as far as the values' rounding lets it.
 */
static int fmu_is_known(const fmu_motion* m, const fmu_derivatives* d, unsigned of) {
  return d->doubt[of] <= 1e-8 * fabs(d->best[of]) + 1e-9 * fabs(m->value[of]) ||
         d->doubt[of] <= 1e-12;
}

/* value_i = sum_j dy_i/du_j seed_j, or, adjoint, value_j = sum_i seed_i dy_i/du_j. */
static int fmu_get_derivatives(fmu_instance* f, const unsigned* unknown, size_t unknowns,
                               const unsigned* known, size_t knowns, const double* seed,
                               double* value, int is_adjoint, const char* function) {
  const int status = fmu_check(f, FMU_INITIALIZING | FMU_STEPPING | FMU_EVENT, function);
  fmu_derivatives* d;
  size_t i, j;
  if (status != FMU_OK) return status;
  d = f->derivatives;
  for (i = 0; i < unknowns; ++i) {
    if (unknown[i] == 0 || unknown[i] >= FMU_FIRST_PARAMETER)
      return fmu_fail(f, FMU_ERROR, function, "an unknown is no output");
  }
  for (j = 0; j < knowns; ++j) {
    if (!fmu_may_set(f, known[j]))
      return fmu_fail(f, FMU_ERROR, function, "no input, nor a parameter that may be set now");
  }
  fmu_look(&f->motion);
  if (f->motion.status != SCENE_OK) return fmu_stop(f, FMU_DISCARD, function);
  for (i = 0; i < (is_adjoint ? knowns : unknowns); ++i) value[i] = 0.0;
  for (j = 0; j < knowns; ++j) {
    fmu_find_slopes(&f->motion, known[j], d);
    for (i = 0; i < unknowns; ++i) {
      if (!fmu_is_known(&f->motion, d, unknown[i])) {
        return fmu_fail(f, FMU_DISCARD, function,
                        "an output has no derivative here: a mode or a branch changes too near");
      }
      if (is_adjoint)
        value[j] += seed[i] * d->best[unknown[i]];
      else
        value[i] += d->best[unknown[i]] * seed[j];
    }
  }
  return FMU_OK;
}
