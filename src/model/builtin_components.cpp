#include <cstddef>
#include <memory>

#include "variator_sim/component_factory.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

template <class Base>
struct Maker {
  const char* type;
  std::shared_ptr<Base> (*make)();
};

template <class Base, class Law>
std::shared_ptr<Base> make() {
  return std::make_shared<Law>();
}

#define VARIATOR_SIM_CONSTRAINT(name) {"variator_sim/" #name, make<Constraint, name>},
constexpr Maker<Constraint> kConstraints[] = {VARIATOR_SIM_CONSTRAINTS(VARIATOR_SIM_CONSTRAINT)};
#undef VARIATOR_SIM_CONSTRAINT
#define VARIATOR_SIM_TORQUE(name) {"variator_sim/" #name, make<Torque, name>},
constexpr Maker<Torque> kTorques[] = {VARIATOR_SIM_TORQUES(VARIATOR_SIM_TORQUE)};
#undef VARIATOR_SIM_TORQUE

template <class Base, std::size_t count>
std::shared_ptr<Base> create(const Maker<Base> (&makers)[count], const std::string& type) {
  for (const auto& maker : makers) {
    if (type == maker.type) return maker.make();
  }
  return nullptr;
}

template <class Base, std::size_t count>
std::vector<std::string> listTypes(const Maker<Base> (&makers)[count]) {
  std::vector<std::string> types;
  for (const auto& maker : makers) types.emplace_back(maker.type);
  return types;
}

}  // namespace

ConstraintPtr BuiltinComponentFactory::createConstraint(const std::string& type) {
  return create(kConstraints, type);
}

TorquePtr BuiltinComponentFactory::createTorque(const std::string& type) {
  return create(kTorques, type);
}

std::vector<std::string> BuiltinComponentFactory::constraintTypes() {
  return listTypes(kConstraints);
}

std::vector<std::string> BuiltinComponentFactory::torqueTypes() {
  return listTypes(kTorques);
}

}  // namespace variator_sim
