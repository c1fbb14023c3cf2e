#include <array>
#include <memory>

#include "variator_sim/component_factory.h"
#include "variator_sim/constraints/expression_constraint.h"
#include "variator_sim/torques/commanded_torque.h"
#include "variator_sim/torques/cutting_torque.h"
#include "variator_sim/torques/diesel_engine.h"
#include "variator_sim/torques/elastic_coupling.h"
#include "variator_sim/torques/expression_torque.h"
#include "variator_sim/torques/friction.h"
#include "variator_sim/torques/motor_curve.h"
#include "variator_sim/torques/propeller.h"
#include "variator_sim/torques/vehicle_resistance.h"

namespace variator_sim {
namespace {

template <typename Pointer>
struct Maker {
  const char* type;
  Pointer (*make)();
};

const std::array<Maker<ConstraintPtr>, 1> kConstraints{{
    {"variator_sim/ExpressionConstraint",
     []() -> ConstraintPtr { return std::make_shared<ExpressionConstraint>(); }},
}};

const std::array<Maker<TorquePtr>, 9> kTorques{{
    {"variator_sim/CommandedTorque",
     []() -> TorquePtr { return std::make_shared<CommandedTorque>(); }},
    {"variator_sim/CuttingTorque", []() -> TorquePtr { return std::make_shared<CuttingTorque>(); }},
    {"variator_sim/DieselEngine", []() -> TorquePtr { return std::make_shared<DieselEngine>(); }},
    {"variator_sim/ElasticCoupling",
     []() -> TorquePtr { return std::make_shared<ElasticCoupling>(); }},
    {"variator_sim/ExpressionTorque",
     []() -> TorquePtr { return std::make_shared<ExpressionTorque>(); }},
    {"variator_sim/Friction", []() -> TorquePtr { return std::make_shared<Friction>(); }},
    {"variator_sim/MotorCurve", []() -> TorquePtr { return std::make_shared<MotorCurve>(); }},
    {"variator_sim/Propeller", []() -> TorquePtr { return std::make_shared<Propeller>(); }},
    {"variator_sim/VehicleResistance",
     []() -> TorquePtr { return std::make_shared<VehicleResistance>(); }},
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
