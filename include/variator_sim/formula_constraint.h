/// FormulaConstraint, an older name of Constraint.
#pragma once

#include "variator_sim/constraint.h"
