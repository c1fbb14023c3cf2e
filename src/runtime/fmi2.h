/* The functions of FMI 2.0 for co-simulation. */

#define FMI(name) fmi2##name
#define FMI_STATE(before, behind) FMI2_STATE(before, behind)
#define FMI2_STATE(before, behind) fmi2##before##FMUstate##behind
#define FMI_READ DeSerialize

typedef void (*fmi2CallbackLogger)(void*, const char*, int, const char*, const char*, ...);
typedef struct {
  fmi2CallbackLogger logger;
  void* (*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void*);
  void (*stepFinished)(void*, int);
  void* componentEnvironment;
} fmi2CallbackFunctions;

static void fmi2_tell(const fmu_instance* f, int status, const char* message) {
  const fmi2CallbackFunctions* const functions = f->functions;
  if (functions == NULL || functions->logger == NULL) return;
  functions->logger(functions->componentEnvironment, f->name, status,
                    status == FMU_DISCARD ? "logStatusDiscard" : "logStatusError", "%s", message);
}

FMI_EXPORT const char* fmi2GetTypesPlatform(void) {
  return "default";
}
FMI_EXPORT const char* fmi2GetVersion(void) {
  return "2.0";
}

FMI_EXPORT void* fmi2Instantiate(const char* name, int type, const char* token,
                                 const char* resources, const fmi2CallbackFunctions* functions,
                                 int visible, int logs) {
  fmu_instance like;
  memset(&like, 0, sizeof like);
  like.tell = fmi2_tell;
  like.functions = functions;
  like.name = name != NULL ? name : "";
  (void)resources, (void)visible, (void)logs;
  if (type != 1) {
    (void)fmu_fail(&like, FMU_ERROR, __func__, "co-simulation only");
    return NULL;
  }
  return fmu_instantiate(name, token, &like);
}

FMI_EXPORT int fmi2SetupExperiment(void* c, int has_tolerance, double tolerance, double start,
                                   int has_end, double end) {
  (void)has_tolerance, (void)tolerance;
  return fmu_begin_at(c, start, has_end ? end : INFINITY, __func__);
}
FMI_EXPORT int fmi2EnterInitializationMode(void* c) {
  return fmu_enter_initialization(c, __func__);
}

FMI_EXPORT int fmi2GetReal(void* c, const unsigned* vr, size_t n, double* value) {
  return fmu_get_numbers(c, vr, n, value, __func__);
}
FMI_EXPORT int fmi2SetReal(void* c, const unsigned* vr, size_t n, const double* value) {
  return fmu_set_numbers(c, vr, n, value, __func__);
}
FMI_EXPORT int fmi2GetInteger(void* c, const unsigned* vr, size_t n, int* value) {
  size_t i;
  int status = FMU_OK;
  for (i = 0; i < n && status == FMU_OK; ++i) status = fmu_get_mode(c, vr[i], &value[i], __func__);
  return status;
}

/* Types that no variable has. */
#define FMI2_ABSENT(name, Values)                                                             \
  FMI_EXPORT int name(void* c, const unsigned* vr, size_t n, Values value) {                  \
    (void)vr, (void)value;                                                                    \
    return n == 0 ? FMU_OK : fmu_fail(c, FMU_ERROR, __func__, "no variable is of this type"); \
  }
FMI2_ABSENT(fmi2GetBoolean, int*)
FMI2_ABSENT(fmi2GetString, const char**)
FMI2_ABSENT(fmi2SetInteger, const int*)
FMI2_ABSENT(fmi2SetBoolean, const int*)
FMI2_ABSENT(fmi2SetString, const char* const*)

FMI_EXPORT int fmi2GetDirectionalDerivative(void* c, const unsigned* unknown, size_t unknowns,
                                            const unsigned* known, size_t knowns,
                                            const double* seed, double* value) {
  return fmu_get_derivatives(c, unknown, unknowns, known, knowns, seed, value, 0, __func__);
}
FMI_EXPORT int fmi2SetRealInputDerivatives(void* c, const unsigned* vr, size_t n, const int* order,
                                           const double* value) {
  (void)vr, (void)n, (void)order, (void)value;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}
FMI_EXPORT int fmi2GetRealOutputDerivatives(void* c, const unsigned* vr, size_t n, const int* order,
                                            double* value) {
  (void)vr, (void)n, (void)order, (void)value;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}

FMI_EXPORT int fmi2DoStep(void* c, double from, double length, int keeps_no_state) {
  (void)keeps_no_state;
  return fmu_do_step(c, from, length, __func__);
}
FMI_EXPORT int fmi2CancelStep(void* c) {
  return fmu_fail(c, FMU_ERROR, __func__, "no step runs by itself");
}
FMI_EXPORT int fmi2GetRealStatus(void* c, int kind, double* value) {
  enum { LAST_SUCCESSFUL_TIME = 2 };
  if (c == NULL || kind != LAST_SUCCESSFUL_TIME)
    return fmu_fail(c, FMU_DISCARD, __func__, "no such status");
  *value = ((fmu_instance*)c)->motion.time;
  return FMU_OK;
}
FMI_EXPORT int fmi2GetBooleanStatus(void* c, int kind, int* value) {
  enum { TERMINATED = 3 };
  if (c == NULL || kind != TERMINATED) return fmu_fail(c, FMU_DISCARD, __func__, "no such status");
  *value = ((fmu_instance*)c)->motion.status != SCENE_OK;
  return FMU_OK;
}
FMI_EXPORT int fmi2GetStatus(void* c, int kind, int* value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
FMI_EXPORT int fmi2GetIntegerStatus(void* c, int kind, int* value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
FMI_EXPORT int fmi2GetStringStatus(void* c, int kind, const char** value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
