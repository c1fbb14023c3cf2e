/* The functions that both versions have. FMI(name) is the name of one, FMI_STATE(before, behind) of
 * one of states, and FMI_READ what is before it where bytes are read. */

FMI_EXPORT int FMI(SetDebugLogging)(void* c, int on, size_t count, const char* const* categories) {
  (void)on, (void)count, (void)categories;
  return c == NULL ? FMU_ERROR : FMU_OK;
}
FMI_EXPORT void FMI(FreeInstance)(void* c) {
  free(c);
}
FMI_EXPORT int FMI(ExitInitializationMode)(void* c) {
  fmu_instance* const f = c;
  const int status = fmu_check(f, FMU_INITIALIZING, __func__);
  if (status != FMU_OK) return status;
  fmu_look(&f->motion);
  if (f->motion.status != SCENE_OK) return fmu_stop(f, FMU_ERROR, __func__);
  f->motion.phase = f->uses_events ? FMU_EVENT : FMU_STEPPING;
  return FMU_OK;
}
FMI_EXPORT int FMI(Terminate)(void* c) {
  return fmu_go(c, FMU_STEPPING | FMU_EVENT, FMU_ENDED, __func__);
}
FMI_EXPORT int FMI(Reset)(void* c) {
  if (c == NULL) return FMU_ERROR;
  fmu_reset(&((fmu_instance*)c)->motion);
  return FMU_OK;
}

/* ---- Copies of the state ---- */

FMI_EXPORT int FMI_STATE(Get, )(void* c, void** state) {
  fmu_instance* const f = c;
  if (f == NULL || state == NULL) return fmu_fail(f, FMU_ERROR, __func__, "no place for the state");
  if (*state == NULL) *state = malloc(sizeof f->motion);
  if (*state == NULL) return fmu_fail(f, FMU_ERROR, __func__, "no memory");
  memcpy(*state, &f->motion, sizeof f->motion);
  return FMU_OK;
}
FMI_EXPORT int FMI_STATE(Set, )(void* c, const void* state) {
  fmu_instance* const f = c;
  if (f == NULL || state == NULL) return fmu_fail(f, FMU_ERROR, __func__, "no state");
  memcpy(&f->motion, state, sizeof f->motion);
  fmu_aim(&f->motion);
  return FMU_OK;
}
FMI_EXPORT int FMI_STATE(Free, )(void* c, void** state) {
  (void)c;
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

FMI_EXPORT int FMI_STATE(Serialized, Size)(void* c, const void* state, size_t* size) {
  (void)c, (void)state;
  *size = FMU_SUM + sizeof(fmu_motion);
  return FMU_OK;
}
FMI_EXPORT int FMI_STATE(Serialize, )(void* c, const void* state, char* bytes, size_t size) {
  unsigned long long sum;
  if (c == NULL || state == NULL || bytes == NULL || size < FMU_SUM + sizeof(fmu_motion))
    return fmu_fail(c, FMU_ERROR, __func__, "no state, or too few bytes for it");
  sum = fmu_sum(state, sizeof(fmu_motion));
  memcpy(bytes, &sum, sizeof sum);
  memcpy(bytes + FMU_SUM, state, sizeof(fmu_motion));
  return FMU_OK;
}
FMI_EXPORT int FMI_STATE(FMI_READ, )(void* c, const char* bytes, size_t size, void** state) {
  unsigned long long sum;
  if (c == NULL || bytes == NULL || size != FMU_SUM + sizeof(fmu_motion))
    return fmu_fail(c, FMU_ERROR, __func__, "not the bytes of a state of this FMU");
  memcpy(&sum, bytes, sizeof sum);
  if (sum != fmu_sum((const unsigned char*)bytes + FMU_SUM, sizeof(fmu_motion)))
    return fmu_fail(c, FMU_ERROR, __func__, "damaged bytes, or those of another FMU");
  if (FMI_STATE(Get, )(c, state) != FMU_OK) return FMU_ERROR;
  memcpy(*state, bytes + FMU_SUM, sizeof(fmu_motion));
  return FMU_OK;
}
