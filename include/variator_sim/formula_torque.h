/// FormulaTorque, an older name of Torque.
#pragma once

#include "variator_sim/torque.h"
