/* An instance of a slave, and what the interfaces of FMI 2 and 3 have in common. A status is one of
 * theirs, which have the same numbers. Memory is taken by instances and copies of their state only.
 */

enum { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR, FMU_FATAL };

typedef struct fmu_instance {
  fmu_motion motion;
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
  f = calloc(1, sizeof *f + strlen(shown) + 1);
  if (f == NULL) return NULL;
  *f = *like;
  f->name = strcpy((char*)(f + 1), shown);
  fmu_reset(&f->motion);
  return f;
}

/* ---- The life of an instance ---- */

static int fmu_enter_initialization(fmu_instance* f, const char* function) {
  const int status = fmu_check(f, FMU_INSTANTIATED, function);
  if (status == FMU_OK) f->motion.phase = FMU_INITIALIZING;
  return status;
}

static int fmu_check_start(const fmu_instance* f, double start, const char* function) {
  return start == 0.0 ? FMU_OK : fmu_fail(f, FMU_ERROR, function, "the motion begins at time 0, s");
}

static int fmu_stop(const fmu_instance* f, int status, const char* function) {
  char why[200];
  snprintf(why, sizeof why, "the motion stops at %.17g s: %s", f->motion.time,
           fmu_status_text(f->motion.status));
  return fmu_fail(f, status, function, why);
}

static int fmu_exit_initialization(fmu_instance* f, const char* function) {
  const int status = fmu_check(f, FMU_INITIALIZING, function);
  if (status != FMU_OK) return status;
  fmu_look(&f->motion);
  if (f->motion.status != SCENE_OK) return fmu_stop(f, FMU_ERROR, function);
  f->motion.phase = f->uses_events ? FMU_EVENT : FMU_STEPPING;
  return FMU_OK;
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
  if (m->status == SCENE_OK) fmu_advance(m, from + length, f->returns_early);
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

/* All or none of them are set. */
static int fmu_set_numbers(fmu_instance* f, const unsigned* reference, size_t count,
                           const double* value, const char* function) {
  const int status =
      fmu_check(f, FMU_INSTANTIATED | FMU_INITIALIZING | FMU_STEPPING | FMU_EVENT, function);
  const int may_start = f != NULL && (f->motion.phase & (FMU_INSTANTIATED | FMU_INITIALIZING));
  size_t n;
  if (status != FMU_OK) return status;
  for (n = 0; n < count; ++n) {
    const unsigned first = may_start ? FMU_FIRST_PARAMETER : FMU_FIRST_COMMAND;
    if (reference[n] < first || reference[n] >= FMU_FIRST_MODE)
      return fmu_fail(f, FMU_ERROR, function, "no input, nor a parameter that may be set now");
    if (!isfinite(value[n])) return fmu_fail(f, FMU_DISCARD, function, "a value is not finite");
  }
  for (n = 0; n < count; ++n) fmu_set(&f->motion, reference[n], value[n]);
  return FMU_OK;
}

/* ---- Copies of the state ---- */

static int fmu_copy_state(fmu_instance* f, void** state, const char* function) {
  if (f == NULL || state == NULL) return fmu_fail(f, FMU_ERROR, function, "no place for the state");
  if (*state == NULL) *state = malloc(sizeof f->motion);
  if (*state == NULL) return fmu_fail(f, FMU_ERROR, function, "no memory");
  memcpy(*state, &f->motion, sizeof f->motion);
  return FMU_OK;
}

static int fmu_take_state(fmu_instance* f, const void* state, const char* function) {
  if (f == NULL || state == NULL) return fmu_fail(f, FMU_ERROR, function, "no state");
  memcpy(&f->motion, state, sizeof f->motion);
  fmu_aim(&f->motion);
  return FMU_OK;
}

static int fmu_free_state(void** state) {
  if (state == NULL) return FMU_OK;
  free(*state);
  *state = NULL;
  return FMU_OK;
}

/* FNV-1a of the token and of the bytes that follow. */
static unsigned long long fmu_sum(const unsigned char* bytes, size_t count) {
  unsigned long long sum = 14695981039346656037ULL;
  const char* c;
  size_t n;
  for (c = fmu_token; *c != '\0'; ++c) sum = (sum ^ (unsigned char)*c) * 1099511628211ULL;
  for (n = 0; n < count; ++n) sum = (sum ^ bytes[n]) * 1099511628211ULL;
  return sum;
}
enum { FMU_SUM = sizeof(unsigned long long) };

static int fmu_serialize(fmu_instance* f, const void* state, void* bytes, size_t size,
                         const char* function) {
  unsigned long long sum;
  if (f == NULL || state == NULL || bytes == NULL || size < FMU_SUM + sizeof f->motion)
    return fmu_fail(f, FMU_ERROR, function, "no state, or too few bytes for it");
  sum = fmu_sum(state, sizeof f->motion);
  memcpy(bytes, &sum, sizeof sum);
  memcpy((char*)bytes + FMU_SUM, state, sizeof f->motion);
  return FMU_OK;
}

static int fmu_deserialize(fmu_instance* f, const void* bytes, size_t size, void** state,
                           const char* function) {
  unsigned long long sum;
  if (f == NULL || bytes == NULL || size != FMU_SUM + sizeof f->motion)
    return fmu_fail(f, FMU_ERROR, function, "not the bytes of a state of this FMU");
  memcpy(&sum, bytes, sizeof sum);
  if (sum != fmu_sum((const unsigned char*)bytes + FMU_SUM, sizeof f->motion))
    return fmu_fail(f, FMU_ERROR, function, "damaged bytes, or those of another FMU");
  if (fmu_copy_state(f, state, function) != FMU_OK) return FMU_ERROR;
  memcpy(*state, (const char*)bytes + FMU_SUM, sizeof f->motion);
  return FMU_OK;
}
