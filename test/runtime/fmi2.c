#include "runtime/slave.h"
/* */
#include "runtime/fmi2.h"
/* */
#include "runtime/fmi.h"
