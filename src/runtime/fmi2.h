/* The functions of FMI 2.0 for co-simulation. */

typedef void* fmi2Component;
typedef void* fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char* fmi2String;
typedef char fmi2Byte;
typedef int fmi2Status;
typedef void (*fmi2CallbackLogger)(void*, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
  fmi2CallbackLogger logger;
  void* (*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void*);
  void (*stepFinished)(void*, fmi2Status);
  void* componentEnvironment;
} fmi2CallbackFunctions;

#define FMI2(type) __attribute__((visibility("default"))) type

static void fmi2_tell(const fmu_instance* f, int status, const char* message) {
  const fmi2CallbackFunctions* const functions = f->functions;
  if (functions == NULL || functions->logger == NULL) return;
  functions->logger(functions->componentEnvironment, f->name, status,
                    status == FMU_DISCARD ? "logStatusDiscard" : "logStatusError", "%s", message);
}

FMI2(const char*) fmi2GetTypesPlatform(void) {
  return "default";
}
FMI2(const char*) fmi2GetVersion(void) {
  return "2.0";
}
FMI2(fmi2Status)
fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String* categories) {
  (void)on, (void)count, (void)categories;
  return c == NULL ? FMU_ERROR : FMU_OK;
}

FMI2(fmi2Component)
fmi2Instantiate(fmi2String name, int type, fmi2String token, fmi2String resources,
                const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean logs) {
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
FMI2(void) fmi2FreeInstance(fmi2Component c) {
  free(c);
}

FMI2(fmi2Status)
fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                    fmi2Boolean has_end, fmi2Real end) {
  const int status = fmu_check(c, FMU_INSTANTIATED, __func__);
  (void)has_tolerance, (void)tolerance, (void)has_end, (void)end;
  return status == FMU_OK ? fmu_check_start(c, start, __func__) : status;
}
FMI2(fmi2Status) fmi2EnterInitializationMode(fmi2Component c) {
  return fmu_enter_initialization(c, __func__);
}
FMI2(fmi2Status) fmi2ExitInitializationMode(fmi2Component c) {
  return fmu_exit_initialization(c, __func__);
}
FMI2(fmi2Status) fmi2Terminate(fmi2Component c) {
  return fmu_go(c, FMU_STEPPING, FMU_ENDED, __func__);
}
FMI2(fmi2Status) fmi2Reset(fmi2Component c) {
  if (c == NULL) return FMU_ERROR;
  fmu_reset(&((fmu_instance*)c)->motion);
  return FMU_OK;
}

FMI2(fmi2Status)
fmi2GetReal(fmi2Component c, const fmi2ValueReference* vr, size_t n, fmi2Real* value) {
  return fmu_get_numbers(c, vr, n, value, __func__);
}
FMI2(fmi2Status)
fmi2SetReal(fmi2Component c, const fmi2ValueReference* vr, size_t n, const fmi2Real* value) {
  return fmu_set_numbers(c, vr, n, value, __func__);
}
FMI2(fmi2Status)
fmi2GetInteger(fmi2Component c, const fmi2ValueReference* vr, size_t n, fmi2Integer* value) {
  size_t i;
  int status = FMU_OK;
  for (i = 0; i < n && status == FMU_OK; ++i) status = fmu_get_mode(c, vr[i], &value[i], __func__);
  return status;
}

/* Types that no variable has. */
#define FMI2_ABSENT(name, Values)                                                                \
  FMI2(fmi2Status) name(fmi2Component c, const fmi2ValueReference* vr, size_t n, Values value) { \
    (void)vr, (void)value;                                                                       \
    return n == 0 ? FMU_OK : fmu_fail(c, FMU_ERROR, __func__, "no variable is of this type");    \
  }
FMI2_ABSENT(fmi2GetBoolean, fmi2Boolean*)
FMI2_ABSENT(fmi2GetString, fmi2String*)
FMI2_ABSENT(fmi2SetInteger, const fmi2Integer*)
FMI2_ABSENT(fmi2SetBoolean, const fmi2Boolean*)
FMI2_ABSENT(fmi2SetString, const fmi2String*)

FMI2(fmi2Status) fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return fmu_copy_state(c, state, __func__);
}
FMI2(fmi2Status) fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  return fmu_take_state(c, state, __func__);
}
FMI2(fmi2Status) fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* state) {
  (void)c;
  return fmu_free_state(state);
}
FMI2(fmi2Status) fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t* size) {
  (void)c, (void)state;
  *size = FMU_SUM + sizeof(fmu_motion);
  return FMU_OK;
}
FMI2(fmi2Status)
fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte* bytes, size_t size) {
  return fmu_serialize(c, state, bytes, size, __func__);
}
FMI2(fmi2Status)
fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte* bytes, size_t size, fmi2FMUstate* state) {
  return fmu_deserialize(c, bytes, size, state, __func__);
}

FMI2(fmi2Status)
fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference* unknown, size_t unknowns,
                             const fmi2ValueReference* known, size_t knowns, const fmi2Real* seed,
                             fmi2Real* value) {
  (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)seed, (void)value;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}
FMI2(fmi2Status)
fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference* vr, size_t n,
                            const fmi2Integer* order, const fmi2Real* value) {
  (void)vr, (void)n, (void)order, (void)value;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}
FMI2(fmi2Status)
fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference* vr, size_t n,
                             const fmi2Integer* order, fmi2Real* value) {
  (void)vr, (void)n, (void)order, (void)value;
  return fmu_fail(c, FMU_ERROR, __func__, "not provided");
}

FMI2(fmi2Status)
fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real length, fmi2Boolean keeps_no_state) {
  (void)keeps_no_state;
  return fmu_do_step(c, from, length, __func__);
}
FMI2(fmi2Status) fmi2CancelStep(fmi2Component c) {
  return fmu_fail(c, FMU_ERROR, __func__, "no step runs by itself");
}
FMI2(fmi2Status) fmi2GetRealStatus(fmi2Component c, int kind, fmi2Real* value) {
  enum { LAST_SUCCESSFUL_TIME = 2 };
  if (c == NULL || kind != LAST_SUCCESSFUL_TIME)
    return fmu_fail(c, FMU_DISCARD, __func__, "no such status");
  *value = ((fmu_instance*)c)->motion.time;
  return FMU_OK;
}
FMI2(fmi2Status) fmi2GetBooleanStatus(fmi2Component c, int kind, fmi2Boolean* value) {
  enum { TERMINATED = 3 };
  if (c == NULL || kind != TERMINATED) return fmu_fail(c, FMU_DISCARD, __func__, "no such status");
  *value = ((fmu_instance*)c)->motion.status != SCENE_OK;
  return FMU_OK;
}
FMI2(fmi2Status) fmi2GetStatus(fmi2Component c, int kind, fmi2Status* value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
FMI2(fmi2Status) fmi2GetIntegerStatus(fmi2Component c, int kind, fmi2Integer* value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
FMI2(fmi2Status) fmi2GetStringStatus(fmi2Component c, int kind, fmi2String* value) {
  (void)kind, (void)value;
  return fmu_fail(c, FMU_DISCARD, __func__, "no step runs by itself");
}
