#include "runtime/slave.h"
/* */
#include "runtime/fmi3.h"
