/// Registers the built-in components with pluginlib: the only file that does, so that the files of
/// the components know no plugin library.
#include <pluginlib/class_list_macros.hpp>

#include "variator_sim/laws.h"

#define VARIATOR_SIM_CONSTRAINT(name) \
  PLUGINLIB_EXPORT_CLASS(variator_sim::name, variator_sim::Constraint)
#define VARIATOR_SIM_TORQUE(name) PLUGINLIB_EXPORT_CLASS(variator_sim::name, variator_sim::Torque)
VARIATOR_SIM_CONSTRAINTS(VARIATOR_SIM_CONSTRAINT)
VARIATOR_SIM_TORQUES(VARIATOR_SIM_TORQUE)
