/// The constraints and torques of this package. The file of its name in src/laws states each one's
/// equations and sources; doc/scene.md has their keys.
#pragma once

#include "variator_sim/constraint.h"
#include "variator_sim/torque.h"

// The only lists of these types, which X(name) declares, makes or registers.
// clang-format off
#define VARIATOR_SIM_CONSTRAINTS(X)                                                            \
  X(AccelerationMagnitude) /* the accelerations of two shafts on a circle */                   \
  X(ExpressionConstraint)  /* stated by the scene as a formula */                              \
  X(ImposedJerk)           /* the jerk of a shaft over time: a kinematically controlled start */ \
  X(JerkLimit)             /* an acceleration that follows its target with limited jerk */     \
  X(KinematicRatio)        /* a variator without slip: an imposed ratio of two speeds */       \
  X(PowerFlow)             /* imposed power, or an efficiency, between two shafts' masses */   \
  X(SlipRatio)             /* a variator whose slip relaxes */                                 \
  X(TractionCurve)         /* a friction variator with its characteristic */                   \
  X(VBeltRatio)            /* an automatic V-belt variator */
#define VARIATOR_SIM_TORQUES(X)                                                                \
  X(Brake)             /* a brake against the ground that locks */                             \
  X(Clutch)            /* a friction clutch that locks */                                      \
  X(CommandedTorque)   /* commanded from outside */                                            \
  X(CuttingTorque)     /* a machine tool's cut */                                              \
  X(DieselEngine)      /* a Diesel engine in the mean over its cycles */                       \
  X(DogClutch)         /* a clutch of claws, open or closed */                                 \
  X(ElasticCoupling)   /* a massless elastic link with damping */                              \
  X(EndStop)           /* a shaft's lowest and highest angle */                                \
  X(ExpressionTorque)  /* stated by the scene as a formula */                                  \
  X(Friction)          /* Coulomb, Stribeck and viscous friction */                            \
  X(MotorCurve)        /* a motor by its torque over the speed */                              \
  X(OneWayClutch)      /* a freewheel */                                                       \
  X(Propeller)         /* a ship's propeller */                                                \
  X(VehicleResistance) /* running resistance of a vehicle */
// clang-format on

namespace variator_sim {

// NOLINTBEGIN(bugprone-macro-parentheses): names of classes
#define VARIATOR_SIM_LAW(name, Base)        \
  class name : public Base {                \
    void build(LawContext& scene) override; \
  };
// NOLINTEND(bugprone-macro-parentheses)
#define VARIATOR_SIM_CONSTRAINT(name) VARIATOR_SIM_LAW(name, Constraint)
#define VARIATOR_SIM_TORQUE(name) VARIATOR_SIM_LAW(name, Torque)
VARIATOR_SIM_CONSTRAINTS(VARIATOR_SIM_CONSTRAINT)
VARIATOR_SIM_TORQUES(VARIATOR_SIM_TORQUE)
#undef VARIATOR_SIM_CONSTRAINT
#undef VARIATOR_SIM_TORQUE
#undef VARIATOR_SIM_LAW

}  // namespace variator_sim
