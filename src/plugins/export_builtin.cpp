/// Registers the built-in components with pluginlib: the only file that does, so that the files of
/// the components know no plugin library.
#include <pluginlib/class_list_macros.hpp>

#include "variator_sim/laws.h"

PLUGINLIB_EXPORT_CLASS(variator_sim::AccelerationMagnitude, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::ExpressionConstraint, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::ImposedJerk, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::JerkLimit, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::KinematicRatio, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::PowerFlow, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::SlipRatio, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::TractionCurve, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::VBeltRatio, variator_sim::Constraint)
PLUGINLIB_EXPORT_CLASS(variator_sim::CommandedTorque, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::CuttingTorque, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::DieselEngine, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::ElasticCoupling, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::ExpressionTorque, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::Friction, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::MotorCurve, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::Propeller, variator_sim::Torque)
PLUGINLIB_EXPORT_CLASS(variator_sim::VehicleResistance, variator_sim::Torque)
