/* A foreign master: couples an engine and a vehicle (FMI 3.0) by c (w_engine - w_gearbox), which it
 * exchanges at each communication point. Prints the angles at the end, and what was allocated in
 * between.
 *     master ENGINE.so TOKEN LOAD THROTTLE SPEED ANGLE  VEHICLE.so TOKEN DRIVE SPEED ANGLE  STEPS H
 * LOAD .. are value references. */
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if !defined(__SANITIZE_ADDRESS__)
extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
static long allocations;
void* malloc(size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
#else
static const long allocations = 0;
#endif

typedef void (*logger)(void*, int, const char*, const char*);
typedef struct {
  void* instance;
  int (*set)(void*, const uint32_t*, size_t, const double*, size_t);
  int (*get)(void*, const uint32_t*, size_t, double*, size_t);
  int (*step)(void*, double, double, bool, bool*, bool*, bool*, double*);
  int (*copy)(void*, void**);
  int (*take)(void*, void*);
  int (*release)(void*, void**);
  void (*free)(void*);
} slave;

static void check(int status, const char* what) {
  if (status == 0) return;
  fprintf(stderr, "%s: status %d\n", what, status);
  exit(1);
}

static void tell(void* environment, int status, const char* category, const char* message) {
  (void)environment;
  fprintf(stderr, "%d %s: %s\n", status, category, message);
}

static void* find(void* library, const char* name) {
  void* const found = dlsym(library, name);
  if (found == NULL) check(1, name);
  return found;
}

static slave load(const char* path, const char* token) {
  void* const library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  slave s;
  void* (*create)(const char*, const char*, const char*, bool, bool, bool, bool, const uint32_t*,
                  size_t, void*, logger, void*);
  int (*enter)(void*, bool, double, double, bool, double);
  int (*leave)(void*);
  if (library == NULL) check(1, dlerror());
  *(void**)&create = find(library, "fmi3InstantiateCoSimulation");
  *(void**)&enter = find(library, "fmi3EnterInitializationMode");
  *(void**)&leave = find(library, "fmi3ExitInitializationMode");
  *(void**)&s.set = find(library, "fmi3SetFloat64");
  *(void**)&s.get = find(library, "fmi3GetFloat64");
  *(void**)&s.step = find(library, "fmi3DoStep");
  *(void**)&s.copy = find(library, "fmi3GetFMUState");
  *(void**)&s.take = find(library, "fmi3SetFMUState");
  *(void**)&s.release = find(library, "fmi3FreeFMUState");
  *(void**)&s.free = find(library, "fmi3FreeInstance");
  s.instance = create(path, token, "", false, false, false, false, NULL, 0, NULL, tell, NULL);
  if (s.instance == NULL) check(1, "instantiation");
  check(enter(s.instance, false, 0.0, 0.0, false, 0.0), "initialization");
  check(leave(s.instance), "initialization");
  return s;
}

static double get(slave* s, uint32_t reference) {
  double value = 0.0;
  check(s->get(s->instance, &reference, 1, &value, 1), "get");
  return value;
}
static void set(slave* s, uint32_t reference, double value) {
  check(s->set(s->instance, &reference, 1, &value, 1), "set");
}
static void step(slave* s, double from, double length) {
  bool event, ends, early;
  double reached;
  check(s->step(s->instance, from, length, true, &event, &ends, &early, &reached), "step");
}

int main(int count, char** word) {
  slave engine, vehicle;
  void *of_engine = NULL, *of_vehicle = NULL;
  uint32_t at[14];
  long before, steps, k;
  double length;
  int n;
  if (count != 14) return 2;
  for (n = 0; n < 14; ++n) at[n] = (uint32_t)strtoul(word[n], NULL, 10);
  engine = load(word[1], word[2]);
  vehicle = load(word[7], word[8]);
  steps = strtol(word[12], NULL, 10);
  length = strtod(word[13], NULL);
  set(&engine, at[4], 0.8);
  check(engine.copy(engine.instance, &of_engine), "copy");
  check(vehicle.copy(vehicle.instance, &of_vehicle), "copy");
  before = allocations;
  for (n = 0; n < 2; ++n) { /* twice the same, from copies of the state */
    check(engine.take(engine.instance, of_engine), "take");
    check(vehicle.take(vehicle.instance, of_vehicle), "take");
    for (k = 0; k < steps; ++k) {
      const double torque = 2.0 * (get(&engine, at[5]) - get(&vehicle, at[10]));
      set(&engine, at[3], torque);
      set(&vehicle, at[9], torque);
      step(&engine, (double)k * length, length);
      step(&vehicle, (double)k * length, length);
    }
    printf("%.17g %.17g %ld\n", get(&engine, at[6]), get(&vehicle, at[11]), allocations - before);
    before = allocations;
  }
  check(engine.release(engine.instance, &of_engine), "release");
  check(vehicle.release(vehicle.instance, &of_vehicle), "release");
  engine.free(engine.instance);
  vehicle.free(vehicle.instance);
  return 0;
}
