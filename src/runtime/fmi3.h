/* The functions of FMI 3.0 for co-simulation. */
#include <stdbool.h>
#include <stdint.h>

#define FMI(name) fmi3##name
#define FMI_STATE(before, behind) FMI3_STATE(before, behind)
#define FMI3_STATE(before, behind) fmi3##before##FMUState##behind
#define FMI_READ Deserialize

typedef uint8_t fmi3Byte;
typedef const fmi3Byte* fmi3Binary;
typedef bool fmi3Clock;
typedef void (*fmi3LogMessageCallback)(void*, int, const char*, const char*);
typedef void (*fmi3AnyCallback)(void);

typedef const uint32_t* fmi3References;

static void fmi3_tell(const fmu_instance* f, int status, const char* message) {
  if (f->log != NULL)
    f->log(f->environment, status, status == FMU_DISCARD ? "logStatusDiscard" : "logStatusError",
           message);
}

FMI_EXPORT const char* fmi3GetVersion(void) {
  return "3.0";
}

/* ---- The life of an instance ---- */

FMI_EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token,
                                             const char* resources, bool visible, bool logs,
                                             bool uses_events, bool returns_early,
                                             fmi3References intermediate, size_t count,
                                             void* environment, fmi3LogMessageCallback log,
                                             fmi3AnyCallback update) {
  fmu_instance like;
  memset(&like, 0, sizeof like);
  like.tell = fmi3_tell;
  like.log = log;
  like.environment = environment;
  like.uses_events = uses_events;
  like.returns_early = returns_early;
  (void)resources, (void)visible, (void)logs, (void)intermediate, (void)count, (void)update;
  return fmu_instantiate(name, token, &like);
}
FMI_EXPORT void* fmi3InstantiateModelExchange(const char* name, const char* token,
                                              const char* resources, bool visible, bool logs,
                                              void* environment, fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logs;
  if (log != NULL) log(environment, FMU_ERROR, "logStatusError", "co-simulation only");
  return NULL;
}
FMI_EXPORT void* fmi3InstantiateScheduledExecution(const char* name, const char* token,
                                                   const char* resources, bool visible, bool logs,
                                                   void* environment, fmi3LogMessageCallback log,
                                                   fmi3AnyCallback update, fmi3AnyCallback lock,
                                                   fmi3AnyCallback unlock) {
  (void)update, (void)lock, (void)unlock;
  return fmi3InstantiateModelExchange(name, token, resources, visible, logs, environment, log);
}

FMI_EXPORT int fmi3EnterInitializationMode(void* c, bool has_tolerance, double tolerance,
                                           double start, bool has_end, double end) {
  const int status = fmu_begin_at(c, start, has_end ? end : INFINITY, __func__);
  (void)has_tolerance, (void)tolerance;
  return status == FMU_OK ? fmu_enter_initialization(c, __func__) : status;
}
FMI_EXPORT int fmi3EnterEventMode(void* c) {
  const fmu_instance* const f = c;
  if (f != NULL && !f->uses_events)
    return fmu_fail(f, FMU_ERROR, __func__, "this instance was made without event mode");
  return fmu_go(c, FMU_STEPPING, FMU_EVENT, __func__);
}
FMI_EXPORT int fmi3EnterStepMode(void* c) {
  return fmu_go(c, FMU_EVENT, FMU_STEPPING, __func__);
}

/* Values follow inputs and switches at once: there is no second iteration. */
FMI_EXPORT int fmi3UpdateDiscreteStates(void* c, bool* needs_update, bool* ends, bool* nominals,
                                        bool* values, bool* has_next, double* next) {
  fmu_instance* const f = c;
  const int status = fmu_check(f, FMU_EVENT, __func__);
  if (status != FMU_OK) return status;
  fmu_look(&f->motion);
  *needs_update = *nominals = *values = *has_next = false;
  *ends = f->motion.status != SCENE_OK;
  *next = 0.0;
  return *ends ? fmu_stop(f, FMU_DISCARD, __func__) : FMU_OK;
}

/* True at an event that the importer has not been told of. */
static int fmi3_takes_event(fmu_motion* m) {
  const int is_there = m->is_event && !m->is_told && m->time >= m->it.time;
  m->is_told = m->is_told || is_there;
  return is_there;
}

FMI_EXPORT int fmi3DoStep(void* c, double from, double length, bool keeps_no_state, bool* event,
                          bool* ends, bool* is_early, double* reached) {
  fmu_instance* const f = c;
  const int status = fmu_do_step(f, from, length, __func__);
  (void)keeps_no_state;
  *event = *ends = *is_early = false;
  if (f == NULL || status == FMU_ERROR) return status;
  *reached = f->motion.time;
  *event = fmi3_takes_event(&f->motion) && f->uses_events;
  *ends = status != FMU_OK;
  *is_early = status == FMU_OK && f->motion.time < from + length;
  return status;
}

/* ---- Values ---- */

FMI_EXPORT int fmi3GetFloat64(void* c, fmi3References vr, size_t n, double* value, size_t values) {
  if (n != values) return fmu_fail(c, FMU_ERROR, __func__, "another number of values");
  return fmu_get_numbers(c, vr, n, value, __func__);
}
FMI_EXPORT int fmi3SetFloat64(void* c, fmi3References vr, size_t n, const double* value,
                              size_t values) {
  if (n != values) return fmu_fail(c, FMU_ERROR, __func__, "another number of values");
  return fmu_set_numbers(c, vr, n, value, __func__);
}
/* (Of enumerations.) */
FMI_EXPORT int fmi3GetInt64(void* c, fmi3References vr, size_t n, int64_t* value, size_t values) {
  int status = FMU_OK, mode = 0;
  size_t i;
  if (n != values) return fmu_fail(c, FMU_ERROR, __func__, "another number of values");
  for (i = 0; i < n && status == FMU_OK; ++i) {
    status = fmu_get_mode(c, vr[i], &mode, __func__);
    if (status == FMU_OK) value[i] = mode;
  }
  return status;
}

/* Types that no variable has. */
#define FMI3_ABSENT(name, Values)                                                             \
  FMI_EXPORT int name(void* c, fmi3References vr, size_t n, Values value, size_t m) {         \
    (void)vr, (void)value, (void)m;                                                           \
    return n == 0 ? FMU_OK : fmu_fail(c, FMU_ERROR, __func__, "no variable is of this type"); \
  }
#define FMI3_ABSENT_TYPE(Type, Value) \
  FMI3_ABSENT(fmi3Get##Type, Value*)  \
  FMI3_ABSENT(fmi3Set##Type, Value const*)
FMI3_ABSENT_TYPE(Float32, float)
FMI3_ABSENT_TYPE(Int8, int8_t)
FMI3_ABSENT_TYPE(UInt8, uint8_t)
FMI3_ABSENT_TYPE(Int16, int16_t)
FMI3_ABSENT_TYPE(UInt16, uint16_t)
FMI3_ABSENT_TYPE(Int32, int32_t)
FMI3_ABSENT_TYPE(UInt32, uint32_t)
FMI3_ABSENT_TYPE(UInt64, uint64_t)
FMI3_ABSENT_TYPE(Boolean, bool)
FMI3_ABSENT_TYPE(String, const char*)
FMI3_ABSENT(fmi3SetInt64, const int64_t*)

/* ---- What the model description says that there is not: it refuses every call ---- */

#define FMI3_REFUSE(name, arguments, unused)                 \
  FMI_EXPORT int name arguments {                            \
    unused;                                                  \
    return fmu_fail(c, FMU_ERROR, __func__, "not provided"); \
  }
#define FMI3_REFUSE_1(name) FMI3_REFUSE(name, (void* c), (void)0)
#define FMI3_REFUSE_2(name, A) FMI3_REFUSE(name, (void* c, A p), (void)p)
#define FMI3_REFUSE_3(name, A, B) FMI3_REFUSE(name, (void* c, A p, B q), ((void)p, (void)q))
#define FMI3_REFUSE_4(name, A, B, C) \
  FMI3_REFUSE(name, (void* c, A p, B q, C r), ((void)p, (void)q, (void)r))
#define FMI3_REFUSE_5(name, A, B, C, D) \
  FMI3_REFUSE(name, (void* c, A p, B q, C r, D s), ((void)p, (void)q, (void)r, (void)s))
#define FMI3_REFUSE_6(name, A, B, C, D, E)              \
  FMI3_REFUSE(name, (void* c, A p, B q, C r, D s, E t), \
              ((void)p, (void)q, (void)r, (void)s, (void)t))
FMI3_REFUSE_1(fmi3EnterConfigurationMode)
FMI3_REFUSE_1(fmi3ExitConfigurationMode)
FMI3_REFUSE_1(fmi3EvaluateDiscreteStates)
FMI3_REFUSE_1(fmi3EnterContinuousTimeMode)
FMI3_REFUSE_2(fmi3SetTime, double)
FMI3_REFUSE_2(fmi3GetNumberOfEventIndicators, size_t*)
FMI3_REFUSE_2(fmi3GetNumberOfContinuousStates, size_t*)
FMI3_REFUSE_3(fmi3GetNumberOfVariableDependencies, uint32_t, size_t*)
FMI3_REFUSE_3(fmi3ActivateModelPartition, uint32_t, double)
FMI3_REFUSE_3(fmi3SetContinuousStates, const double*, size_t)
FMI3_REFUSE_3(fmi3GetContinuousStates, double*, size_t)
FMI3_REFUSE_3(fmi3GetContinuousStateDerivatives, double*, size_t)
FMI3_REFUSE_3(fmi3GetNominalsOfContinuousStates, double*, size_t)
FMI3_REFUSE_3(fmi3GetEventIndicators, double*, size_t)
FMI3_REFUSE_4(fmi3CompletedIntegratorStep, bool, bool*, bool*)
FMI3_REFUSE_4(fmi3GetClock, fmi3References, size_t, fmi3Clock*)
FMI3_REFUSE_4(fmi3SetClock, fmi3References, size_t, const fmi3Clock*)
FMI3_REFUSE_4(fmi3GetShiftDecimal, fmi3References, size_t, double*)
FMI3_REFUSE_4(fmi3SetShiftDecimal, fmi3References, size_t, const double*)
FMI3_REFUSE_4(fmi3SetIntervalDecimal, fmi3References, size_t, const double*)
FMI3_REFUSE_5(fmi3GetIntervalDecimal, fmi3References, size_t, double*, int*)
FMI3_REFUSE_5(fmi3GetShiftFraction, fmi3References, size_t, uint64_t*, uint64_t*)
FMI3_REFUSE_5(fmi3SetShiftFraction, fmi3References, size_t, const uint64_t*, const uint64_t*)
FMI3_REFUSE_5(fmi3SetIntervalFraction, fmi3References, size_t, const uint64_t*, const uint64_t*)
FMI3_REFUSE_6(fmi3GetIntervalFraction, fmi3References, size_t, uint64_t*, uint64_t*, int*)
FMI3_REFUSE_6(fmi3GetBinary, fmi3References, size_t, size_t*, fmi3Binary*, size_t)
FMI3_REFUSE_6(fmi3SetBinary, fmi3References, size_t, const size_t*, const fmi3Binary*, size_t)
FMI3_REFUSE_6(fmi3GetOutputDerivatives, fmi3References, size_t, const int32_t*, double*, size_t)
FMI_EXPORT int fmi3GetVariableDependencies(void* c, uint32_t dependent, size_t* of_dependent,
                                           uint32_t* independent, size_t* of_independent, int* kind,
                                           size_t count) {
  (void)dependent, (void)of_dependent, (void)independent, (void)of_independent, (void)kind;
  (void)count;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}
#define FMI3_DERIVATIVE(name, is_adjoint, of_seeds, of_values)                                \
  FMI_EXPORT int name(void* c, fmi3References unknown, size_t unknowns, fmi3References known, \
                      size_t knowns, const double* seed, size_t seeds, double* value,         \
                      size_t values) {                                                        \
    if (seeds != of_seeds || values != of_values)                                             \
      return fmu_fail(c, FMU_ERROR, __func__, "another number of values");                    \
    return fmu_get_derivatives(c, unknown, unknowns, known, knowns, seed, value, is_adjoint,  \
                               __func__);                                                     \
  }
FMI3_DERIVATIVE(fmi3GetDirectionalDerivative, 0, knowns, unknowns)
FMI3_DERIVATIVE(fmi3GetAdjointDerivative, 1, unknowns, knowns)
