// Motions by machine code: their bits are those of the interpreter.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "machine_code/kernel_library.h"
#include "support/machine_code_folder.h"
#include "support/played.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::hex;
using test::kShafts;
using test::play;

class MachineCodeBits : public test::MachineCodeFolder {};

// --- motions ---------------------------------------------------------------------------------

void expectSameBits(const Scene& scene) {
  const std::string interpreted = play(scene, -1);
  EXPECT_EQ(play(scene, 0), interpreted);
  EXPECT_EQ(play(scene, 17), interpreted) << "switched in the middle";
}

TEST_F(MachineCodeBits, OfMotionsOfFilesAreTheInterpreters) {
  const std::string tests = VARIATOR_SIM_TEST_DIR;
  for (const char* name :
       {"/scenes/car.yaml", "/scenes/observed.yaml", "/scenes/stops.yaml",
        "/../config/acceleration_circle.yaml", "/../config/ratio_steps.yaml",
        "/../config/ship.yaml", "/../config/applications/diesel_locomotive.yaml",
        "/../config/applications/machine_tool.yaml", "/../config/applications/vbelt_vehicle.yaml",
        "/../config/applications/starting_system.yaml", "/modes/CoupledClutches.yaml",
        "/modes/OneWayClutch.yaml"}) {
    SCOPED_TRACE(name);
    expectSameBits(test::sceneFromFile(tests + name));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithEveryStepperAndPrincipleAreTheInterpreters) {
  const std::string scene = kShafts + R"yaml(
torques: [engine, drag]
engine: {type: variator_sim/CommandedTorque, shaft: drive, topic: u, hold: first_order_lag, time_constant: 0.2, initial: 4}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.3*w2*abs(w2) + sin(phi1)"}
constraints: [variator]
variator: {type: variator_sim/SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6}
)yaml";
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (const StepperKind stepper : {StepperKind::kAuto, StepperKind::kTaylor}) {
      SCOPED_TRACE(std::string(principle) + ", " + toString(stepper));
      const std::string text = scene + "principle: " + principle + "\n";
      expectSameBits(test::withStepper(test::sceneFromText(text), stepper));
    }
  }
}

TEST_F(MachineCodeBits, OfSeriesWithAnInertiaThatDependsOnAnglesAreTheInterpreters) {
  const std::string scene = R"yaml(
shafts: [crank, load, drum]
crank: {inertia: {mean: 1.0, harmonics: [{order: 1, cos: 0.2}, {order: 2, cos: 0.1, sin: -0.15}]}}
load: {inertia: 1.2}
drum: {inertia: {mean: 0.7, harmonics: [{order: 3, sin: 0.1}]}}
inertia_coupling: [[crank, load, 0.1]]
initial: {velocity: [10.0, 6.0, 3.0]}
torques: [drag]
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "3 - 0.3*w2 + sin(phi1)"}
constraints: [variator, drive]
variator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "0.2*(e2 - 0.6*e1) + w2 - 0.6*w1"}
drive: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e3 - 0.5*e2 + 0.01*w1*e1"}
)yaml";
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    SCOPED_TRACE(principle);
    const std::string text = scene + "principle: " + principle + "\n";
    expectSameBits(test::withStepper(test::sceneFromText(text), StepperKind::kTaylor));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithBranchesTablesAndHoldsAreTheInterpreters) {
  for (const char* hold :
       {"zero_order", "first_order_lag, time_constant: 0.2", "rate_limit, rate: 12",
        "first_order_hold, period: 0.3", "second_order_lag, time_constant: 0.1"}) {
    SCOPED_TRACE(hold);
    expectSameBits(test::sceneFromText(
        kShafts + "inputs: [lever]\nlever: {topic: lever, hold: " + hold + R"yaml(, initial: 1}
torques: [engine, drag, kinks, map]
tables: [of_speed, of_two]
of_speed: {x: [0, 5, 10, 20], values: [3, 4, 2, 0]}
of_two: {x: [0, 10, 20], y: [0, 10], values: [[0, 1], [2, 1], [3, 4]], beyond: linear}
engine: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "lever*of_speed(w1) + sign(sin(9*t))"}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.02*abs(w2)^1.7 - 0.01*w2^3 - 1/(1 + w2^2)^0.5"}
kinks: {type: variator_sim/ExpressionTorque, shaft: load, torque: "if(w2 < 5, 0.3, min(1, 0.2*w2)) - clamp(w1 - w2, -0.5, 0.5) + max(cos(3*t), 0.2)"}
map: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.3*of_two(w1, w2)"}
constraints: [variator]
variator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "0.2*(e2 - 0.6*e1) + w2 - 0.6*w1"}
)yaml"));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithOtherOrdersAreTheInterpreters) {
  for (const char* constraint : {"order: 1, expression: 'w2 - (0.6 + 0.05*sin(phi1))*w1'",
                                 "order: 3, expression: 'j2 + 3*e2 - 0.1*e1'",
                                 "order: 2, expression: 'e2 - 0.6*e1 + 0.01*e1^3 + w2 - 0.6*w1'"}) {
    SCOPED_TRACE(constraint);
    expectSameBits(test::sceneFromText(
        "shafts: [drive, load]\ndrive: {inertia: 0.5}\nload: {inertia: 1.2}\n"
        "initial: {velocity: [10.0, 6.0], project: true}\n"
        "torques: [drag]\nconstraints: [c]\nc: {type: variator_sim/ExpressionConstraint, " +
        std::string(constraint) +
        "}\ndrag: {type: variator_sim/ExpressionTorque, shaft: load, torque: '2*cos(t) - w2'}\n"));
  }
}

/// If tanh is 1 to all digits, its rate is 0, of either sign.
TEST_F(MachineCodeBits, OfFunctionsThatAreConstantToAllDigitsAreTheInterpreters) {
  for (const char* law :
       {"Friction, coulomb: 1, regularization_speed: 0.01}\nprinciple: generalized_gauss\n",
        "Friction, coulomb: 1, regularization_speed: 1e-5}\nprinciple: gauss\n",
        "ExpressionTorque, torque: '-tanh(w1/0.01)'}\nprinciple: gauss\n"}) {
    SCOPED_TRACE(law);
    expectSameBits(test::sceneFromText(
        "shafts: [drive]\ndrive: {inertia: 1}\ninitial: {velocity: [1]}\ntorques: [motor, "
        "law]\nmotor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "
        "'5*sin(t)'}\nlaw: {shaft: drive, type: variator_sim/" +
        std::string(law)));
  }
}

// --- scenes that differ in numbers alone -------------------------------------------------------

}  // namespace
}  // namespace variator_sim
