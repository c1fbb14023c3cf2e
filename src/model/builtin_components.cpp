#include <memory>
#include <string>
#include <vector>

#include "variator_sim/component_factory.h"
#include "variator_sim/laws.h"

namespace variator_sim {

#define VARIATOR_SIM_MAKE(name) \
  if (type == "variator_sim/" #name) return std::make_shared<name>();
#define VARIATOR_SIM_TYPE(name) std::string("variator_sim/" #name),

ConstraintPtr BuiltinComponentFactory::createConstraint(const std::string& type) {
  VARIATOR_SIM_CONSTRAINTS(VARIATOR_SIM_MAKE)
  return nullptr;
}

TorquePtr BuiltinComponentFactory::createTorque(const std::string& type) {
  VARIATOR_SIM_TORQUES(VARIATOR_SIM_MAKE)
  return nullptr;
}

std::vector<std::string> BuiltinComponentFactory::constraintTypes() {
  return {VARIATOR_SIM_CONSTRAINTS(VARIATOR_SIM_TYPE)};
}

std::vector<std::string> BuiltinComponentFactory::torqueTypes() {
  return {VARIATOR_SIM_TORQUES(VARIATOR_SIM_TYPE)};
}

#undef VARIATOR_SIM_MAKE
#undef VARIATOR_SIM_TYPE

}  // namespace variator_sim
