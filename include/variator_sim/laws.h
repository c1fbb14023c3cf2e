/// The constraints and torques of this package. The file of its name in src/laws states each one's
/// equations, units, keys and sources.
#pragma once

#include "variator_sim/constraint.h"
#include "variator_sim/torque.h"

namespace variator_sim {

/// The accelerations of two shafts on a circle.
class AccelerationMagnitude : public Constraint {
  void build(LawContext& scene) override;
};

/// A constraint that the scene states as a formula.
class ExpressionConstraint : public Constraint {
  void build(LawContext& scene) override;
};

/// The jerk of a shaft as a function of time: a kinematically controlled start.
class ImposedJerk : public Constraint {
  void build(LawContext& scene) override;
};

/// An acceleration that follows its target with limited jerk.
class JerkLimit : public Constraint {
  void build(LawContext& scene) override;
};

/// A variator without slip: an imposed ratio of two speeds.
class KinematicRatio : public Constraint {
  void build(LawContext& scene) override;
};

/// Imposed power, or an efficiency, between the masses of two shafts.
class PowerFlow : public Constraint {
  void build(LawContext& scene) override;
};

/// A variator whose slip relaxes.
class SlipRatio : public Constraint {
  void build(LawContext& scene) override;
};

/// A friction variator with its characteristic.
class TractionCurve : public Constraint {
  void build(LawContext& scene) override;
};

/// An automatic V-belt variator.
class VBeltRatio : public Constraint {
  void build(LawContext& scene) override;
};

/// A torque that is commanded from outside.
class CommandedTorque : public Torque {
  void build(LawContext& scene) override;
};

/// The torque of a machine tool's cut.
class CuttingTorque : public Torque {
  void build(LawContext& scene) override;
};

/// A Diesel engine in the mean over its cycles.
class DieselEngine : public Torque {
  void build(LawContext& scene) override;
};

/// A massless elastic link with damping.
class ElasticCoupling : public Torque {
  void build(LawContext& scene) override;
};

/// A torque that the scene states as a formula.
class ExpressionTorque : public Torque {
  void build(LawContext& scene) override;
};

/// Coulomb, Stribeck and viscous friction.
class Friction : public Torque {
  void build(LawContext& scene) override;
};

/// A motor by its torque over the speed.
class MotorCurve : public Torque {
  void build(LawContext& scene) override;
};

/// A ship's propeller.
class Propeller : public Torque {
  void build(LawContext& scene) override;
};

/// Running resistance of a vehicle.
class VehicleResistance : public Torque {
  void build(LawContext& scene) override;
};

}  // namespace variator_sim
