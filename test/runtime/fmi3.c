#include "runtime/slave.h"
/* */
#include "runtime/fmi3.h"
/* */
#include "runtime/fmi.h"
