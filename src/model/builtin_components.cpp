#include <array>
#include <memory>

#include "variator_sim/component_factory.h"
#include "variator_sim/constraints/acceleration_magnitude.h"
#include "variator_sim/constraints/expression_constraint.h"
#include "variator_sim/constraints/imposed_jerk.h"
#include "variator_sim/constraints/jerk_limit.h"
#include "variator_sim/constraints/kinematic_ratio.h"
#include "variator_sim/constraints/power_flow.h"
#include "variator_sim/constraints/slip_ratio.h"
#include "variator_sim/constraints/traction_curve.h"
#include "variator_sim/constraints/v_belt_ratio.h"
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

const std::array<Maker<ConstraintPtr>, 9> kConstraints{{
    {"variator_sim/AccelerationMagnitude",
     []() -> ConstraintPtr { return std::make_shared<AccelerationMagnitude>(); }},
    {"variator_sim/ExpressionConstraint",
     []() -> ConstraintPtr { return std::make_shared<ExpressionConstraint>(); }},
    {"variator_sim/ImposedJerk", []() -> ConstraintPtr { return std::make_shared<ImposedJerk>(); }},
    {"variator_sim/JerkLimit", []() -> ConstraintPtr { return std::make_shared<JerkLimit>(); }},
    {"variator_sim/KinematicRatio",
     []() -> ConstraintPtr { return std::make_shared<KinematicRatio>(); }},
    {"variator_sim/PowerFlow", []() -> ConstraintPtr { return std::make_shared<PowerFlow>(); }},
    {"variator_sim/SlipRatio", []() -> ConstraintPtr { return std::make_shared<SlipRatio>(); }},
    {"variator_sim/TractionCurve",
     []() -> ConstraintPtr { return std::make_shared<TractionCurve>(); }},
    {"variator_sim/VBeltRatio", []() -> ConstraintPtr { return std::make_shared<VBeltRatio>(); }},
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
