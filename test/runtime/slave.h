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

enum { FMU_PARAMETERS = 4, FMU_COMMANDS = 1, FMU_ROWS = 1, FMU_IS_SETTLED = 1 };
static const double fmu_parameter[] = {1.0, 0.0, 0.0, 0.0};
static const int fmu_command[] = {0}, fmu_row[] = {14};
static const long fmu_most_steps = 10000;
static const char fmu_token[] = "by hand";
static const double initial_reaction[] = {0.0, 0.0}, initial_longest[] = {0.0};

#include "runtime/fmu.h"
/* */
#include "runtime/fmu_instance.h"
