/* An instance of a slave, and what the interfaces of FMI 2 and 3 have in common. A status is one of
 * theirs, which have the same numbers. Memory is taken by instances and copies of their state only.
 */

#define FMI_EXPORT __attribute__((visibility("default")))

enum { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR, FMU_FATAL };

/* The memory of derivatives (fmu_derivatives.h). */
typedef struct {
  fmu_motion at;
  double slope[FMU_VALUES], before[FMU_VALUES], best[FMU_VALUES];
  double doubt[FMU_VALUES]; /* the difference from the next best; INFINITY: there is none */
} fmu_derivatives;

typedef struct fmu_instance {
  fmu_motion motion;
  fmu_derivatives* derivatives;
  void (*tell)(const struct fmu_instance*, int status, const char* message);
  const void* functions;                                    /* of FMI 2 */
  void (*log)(void*, int status, const char*, const char*); /* of FMI 3 */
  void* environment;
  const char* name;
  int uses_events, returns_early;
} fmu_instance;

static int fmu_fail(const fmu_instance* f, int status, const char* function, const char* why) {
  char message[300];
  if (f == NULL) return FMU_ERROR;
  snprintf(message, sizeof message, "%s: %s", function, why);
  f->tell(f, status, message);
  return status;
}

/* Refuses a call in a phase that the standard does not allow it in. */
static int fmu_check(const fmu_instance* f, int phases, const char* function) {
  if (f != NULL && (f->motion.phase & phases)) return FMU_OK;
  return fmu_fail(f, FMU_ERROR, function, "not allowed in this state of the instance");
}

static int fmu_has_processor(void) {
#if defined(__FMA__) && defined(__x86_64__) && defined(__GNUC__)
  return __builtin_cpu_supports("fma") && __builtin_cpu_supports("avx2");
#else
  return 1;
#endif
}

static fmu_instance* fmu_instantiate(const char* name, const char* token,
                                     const fmu_instance* like) {
  const char* const shown = name != NULL ? name : "";
  fmu_instance* f;
  if (token == NULL || strcmp(token, fmu_token) != 0) {
    (void)fmu_fail(like, FMU_ERROR, "instantiation", "another FMU's token");
    return NULL;
  }
  if (!fmu_has_processor()) {
    (void)fmu_fail(like, FMU_ERROR, "instantiation",
                   "this binary is for processors with AVX2 and FMA; compile the sources anew");
    return NULL;
  }
  f = calloc(1, sizeof *f + sizeof *f->derivatives + strlen(shown) + 1);
  if (f == NULL) return NULL;
  *f = *like;
  f->derivatives = (fmu_derivatives*)(f + 1);
  f->name = strcpy((char*)(f->derivatives + 1), shown);
  fmu_reset(&f->motion);
  return f;
}

/* ---- The life of an instance ---- */

static int fmu_enter_initialization(fmu_instance* f, const char* function) {
  const int status = fmu_check(f, FMU_INSTANTIATED, function);
  if (status == FMU_OK) f->motion.phase = FMU_INITIALIZING;
  return status;
}

/* The scene's time begins at `start`, s, and goes no further than `stop`. */
static int fmu_begin_at(fmu_instance* f, double start, double stop, const char* function) {
  const int status = fmu_check(f, FMU_INSTANTIATED, function);
  char why[200];
  if (status != FMU_OK) return status;
  snprintf(why, sizeof why,
           "the start time is %.17g s; allowed: from 0 to 1e9 (laws that are to read an earlier "
           "time: t less a constant in the scene's formulas)",
           start);
  if (!(start >= 0.0 && start <= 1e9)) return fmu_fail(f, FMU_ERROR, function, why);
  if (!(stop >= start))
    return fmu_fail(f, FMU_ERROR, function, "the stop time is before the start time");
  fmu_set_times(&f->motion, start, stop);
  return FMU_OK;
}

static int fmu_stop(const fmu_instance* f, int status, const char* function) {
  char why[200];
  if (f->motion.status == SCENE_INCONSISTENT)
    snprintf(why, sizeof why, "the initial values, or the first inputs, contradict each other");
  else
    snprintf(why, sizeof why, "the motion stops at %.17g s: %s", f->motion.time,
             vs_status_text(f->motion.status));
  return fmu_fail(f, status, function, why);
}

static int fmu_go(fmu_instance* f, int from, int to, const char* function) {
  const int status = fmu_check(f, from, function);
  if (status == FMU_OK) f->motion.phase = to;
  return status;
}

static int fmu_do_step(fmu_instance* f, double from, double length, const char* function) {
  fmu_motion* const m = &f->motion;
  const int status = fmu_check(f, FMU_STEPPING, function);
  if (status != FMU_OK) return status;
  if (!isfinite(from) || !(fabs(from - m->time) <= 1e-9 * fmax(1.0, fabs(m->time))))
    return fmu_fail(f, FMU_ERROR, function, "the step begins elsewhere than the last one ended");
  if (!isfinite(length) || length < 0.0)
    return fmu_fail(f, FMU_ERROR, function, "the length of the step is negative or not finite");
  if (from + length > m->stop + 1e-9 * fmax(1.0, fabs(m->stop)))
    return fmu_fail(f, FMU_ERROR, function, "the step ends behind the stop time");
  if (m->status == SCENE_OK) fmu_advance(m, from + length, f->uses_events && f->returns_early);
  return m->status == SCENE_OK ? FMU_OK : fmu_stop(f, FMU_DISCARD, function);
}

/* ---- Values ---- */

static int fmu_get_numbers(fmu_instance* f, const unsigned* reference, size_t count, double* value,
                           const char* function) {
  const int status =
      fmu_check(f, FMU_INITIALIZING | FMU_STEPPING | FMU_EVENT | FMU_ENDED, function);
  size_t n;
  if (status != FMU_OK) return status;
  if (f->motion.phase != FMU_ENDED) fmu_look(&f->motion);
  for (n = 0; n < count; ++n) {
    if (!fmu_get(&f->motion, reference[n], &value[n]))
      return fmu_fail(f, FMU_ERROR, function, "no such number");
    /* (Of a motion that has begun they are those of the last good state.) */
    if (reference[n] < FMU_FIRST_PARAMETER && f->motion.is_start && f->motion.status != SCENE_OK)
      return fmu_stop(f, FMU_DISCARD, function);
  }
  return FMU_OK;
}

static int fmu_get_mode(fmu_instance* f, unsigned reference, int* mode, const char* function) {
  double time;
  const unsigned first = FMU_FIRST_MODE;
  const int status = fmu_get_numbers(f, &(const unsigned){0}, 1, &time, function);
  if (status != FMU_OK) return status;
  if (reference < first || reference >= FMU_REFERENCES)
    return fmu_fail(f, FMU_ERROR, function, "no such mode");
  *mode = f->motion.mode[reference - first];
  return FMU_OK;
}

/* True for an input, and for a parameter before the motion. */
static int fmu_may_set(const fmu_instance* f, unsigned reference) {
  const int may_start = f->motion.phase & (FMU_INSTANTIATED | FMU_INITIALIZING);
  return reference < FMU_FIRST_MODE &&
         reference >= (unsigned)(may_start ? FMU_FIRST_PARAMETER : FMU_FIRST_COMMAND);
}

static int fmu_check_allowed(const fmu_instance* f, unsigned reference, double value,
                             const char* function) {
  const unsigned first = FMU_FIRST_PARAMETER + FMU_STARTS;
  char why[256];
  const fmu_allowance* a;
  if (!isfinite(value)) return fmu_fail(f, FMU_DISCARD, function, "a value is not finite");
  if (reference < first || reference >= FMU_FIRST_COMMAND) return FMU_OK;
  a = &fmu_allowed[reference - first];
  if ((a->has_low ? value >= a->low : value > a->low) &&
      (a->has_high ? value <= a->high : value < a->high) && !(a->is_never_zero && value == 0.0))
    return FMU_OK;
  snprintf(why, sizeof why, "scene/%.100s is %.17g; allowed: %.100s", a->path, value, a->allowed);
  return fmu_fail(f, FMU_ERROR, function, why);
}

/* All or none of them are set. */
static int fmu_set_numbers(fmu_instance* f, const unsigned* reference, size_t count,
                           const double* value, const char* function) {
  int status =
      fmu_check(f, FMU_INSTANTIATED | FMU_INITIALIZING | FMU_STEPPING | FMU_EVENT, function);
  size_t n;
  if (status != FMU_OK) return status;
  for (n = 0; n < count; ++n) {
    if (!fmu_may_set(f, reference[n]))
      return fmu_fail(f, FMU_ERROR, function, "no input, nor a parameter that may be set now");
    status = fmu_check_allowed(f, reference[n], value[n], function);
    if (status != FMU_OK) return status;
  }
  for (n = 0; n < count; ++n) fmu_set(&f->motion, reference[n], value[n]);
  return FMU_OK;
}
