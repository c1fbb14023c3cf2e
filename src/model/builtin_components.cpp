#include <array>
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

constexpr std::array<Maker<Constraint>, 9> kConstraints{{
    {"variator_sim/AccelerationMagnitude", make<Constraint, AccelerationMagnitude>},
    {"variator_sim/ExpressionConstraint", make<Constraint, ExpressionConstraint>},
    {"variator_sim/ImposedJerk", make<Constraint, ImposedJerk>},
    {"variator_sim/JerkLimit", make<Constraint, JerkLimit>},
    {"variator_sim/KinematicRatio", make<Constraint, KinematicRatio>},
    {"variator_sim/PowerFlow", make<Constraint, PowerFlow>},
    {"variator_sim/SlipRatio", make<Constraint, SlipRatio>},
    {"variator_sim/TractionCurve", make<Constraint, TractionCurve>},
    {"variator_sim/VBeltRatio", make<Constraint, VBeltRatio>},
}};

constexpr std::array<Maker<Torque>, 9> kTorques{{
    {"variator_sim/CommandedTorque", make<Torque, CommandedTorque>},
    {"variator_sim/CuttingTorque", make<Torque, CuttingTorque>},
    {"variator_sim/DieselEngine", make<Torque, DieselEngine>},
    {"variator_sim/ElasticCoupling", make<Torque, ElasticCoupling>},
    {"variator_sim/ExpressionTorque", make<Torque, ExpressionTorque>},
    {"variator_sim/Friction", make<Torque, Friction>},
    {"variator_sim/MotorCurve", make<Torque, MotorCurve>},
    {"variator_sim/Propeller", make<Torque, Propeller>},
    {"variator_sim/VehicleResistance", make<Torque, VehicleResistance>},
}};

template <typename Makers>
auto create(const Makers& makers, const std::string& type) -> decltype(makers.front().make()) {
  for (const auto& maker : makers) {
    if (type == maker.type) return maker.make();
  }
  return nullptr;
}

template <typename Makers>
std::vector<std::string> listTypes(const Makers& makers) {
  std::vector<std::string> types;
  types.reserve(makers.size());
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
