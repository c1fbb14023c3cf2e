/* The scene by hand as a slave, up to the functions of a version of FMI. */
#define VS_FUNCTION static __attribute__((unused))
#define VS_FUNCTION_INLINE VS_INLINE
#define VS_FUNCTION_RARE VS_RARE
#include "runtime/scene.c"
/* */
#include <stdio.h>
#include <stdlib.h>

#include "runtime/exchange_data.h"
/* */
#include "runtime/exchange.h"
/* */
#include "runtime/host.h"

enum { FMU_STARTS = 4, FMU_PARAMETERS = 5, FMU_COMMANDS = 1, FMU_ROWS = 1, FMU_IS_SETTLED = 1 };
static const double fmu_parameter[] = {1.0, 0.0, 0.0, 0.0, 0.5};
/* The numbers: tolerances and the longest step, the time constant, and the factors of sums */
enum {
  FMU_CONSTANTS = 4,
  FMU_COUPLING = 4,
  FMU_CONSTANT_VALUE = 4,
  FMU_RESTITUTION = 4,
  FMU_CLOSES_BELOW = 4,
  FMU_PARAMETER_OF = 4,
  FMU_FACTORS = 5,
  FMU_NUMBERS = FMU_FACTORS + 2 * RESOLVED,
  FMU_DEPENDENTS = 1
};
static const double fmu_number[FMU_NUMBERS] = {1e-12, 1e-12, 10.0, 0.21, 0.5, 0.0, 1.0, 1.0};
static const struct SeriesOperation fmu_operation[RESOLVED + 1] = {{0}};
static const int fmu_dependent[] = {FMU_PARAMETER_OF}, fmu_power_begin[] = {0, 1};
static const int fmu_power_of[] = {0}, fmu_power[] = {1};
static const double fmu_factor[] = {1.0};
typedef struct {
  double low, high;
  int has_low, has_high, is_never_zero;
  const char *path, *allowed;
} fmu_allowance;
static const fmu_allowance fmu_allowed[] = {{0.0, 1e9, 0, 1, 1, "motor/time_constant", "> 0"}};
static const vs_table fmu_table[] = {{0}};
static const vs_table_of_two fmu_table_of_two[] = {{0}};
static const double* const fmu_passage_points[] = {0};
static const int fmu_hold_of[] = {1}, fmu_falls_to_zero[] = {0};
static const double fmu_initial_input[] = {0.0}, fmu_minimum_of[] = {-1.0},
                    fmu_maximum_of[] = {1.0}, fmu_timeout_of[] = {0.0},
                    given_acceleration[] = {0.0, 0.0};
static const int fmu_command[] = {0}, fmu_row[] = {14};
static const long fmu_most_steps = 10000;
static const char fmu_token[] = "by hand";
static const double initial_reaction[] = {0.0, 0.0}, initial_longest[] = {0.0};

#include "runtime/fmu.h"
/* */
#include "runtime/fmu_instance.h"
/* */
#include "runtime/fmu_derivatives.h"
