// Motions by machine code: their bits are those of the interpreter.

#include "machine_code/kernel_library.h"
#include "support/machine_code_folder.h"
#include "support/played.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::play;
using test::sceneText;
using test::twoShafts;

const std::string kVariator = "variator: 0.2*(e2 - 0.6*e1) + w2 - 0.6*w1";

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
  const std::string scene =
      twoShafts({"engine on drive from u, hold: first_order_lag, time_constant: 0.2, initial: 4",
                 "drag on load: -0.3*w2*abs(w2) + sin(phi1)",
                 "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6"});
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (const StepperKind stepper : {StepperKind::kAuto, StepperKind::kTaylor}) {
      SCOPED_TRACE(std::string(principle) + ", " + toString(stepper));
      const std::string text = scene + "principle: " + principle + "\n";
      expectSameBits(test::withStepper(test::sceneFromText(text), stepper));
    }
  }
}

TEST_F(MachineCodeBits, OfSeriesWithAnInertiaThatDependsOnAnglesAreTheInterpreters) {
  const std::string scene = sceneText(
      "crank, load 1.2, drum",
      {"drag on load: 3 - 0.3*w2 + sin(phi1)", kVariator, "drive: e3 - 0.5*e2 + 0.01*w1*e1"},
      "crank: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.2}, "
      "{order: 2, cos: 0.1, sin: -0.15}]}}\n"
      "drum: {inertia: {mean: 0.7, harmonics: [{order: 3, sin: 0.1}]}}\n"
      "inertia_coupling: [[crank, load, 0.1]]\ninitial: {velocity: [10, 6, 3]}");
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    SCOPED_TRACE(principle);
    const std::string text = scene + "principle: " + principle + "\n";
    expectSameBits(test::withStepper(test::sceneFromText(text), StepperKind::kTaylor));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithBranchesTablesAndHoldsAreTheInterpreters) {
  for (const std::string hold :
       {"zero_order", "first_order_lag, time_constant: 0.2", "rate_limit, rate: 12",
        "first_order_hold, period: 0.3", "second_order_lag, time_constant: 0.1"}) {
    SCOPED_TRACE(hold);
    expectSameBits(test::sceneFromText(twoShafts(
        {"engine on drive: lever*of_speed(w1) + sign(sin(9*t))",
         "drag on load: -0.02*abs(w2)^1.7 - 0.01*w2^3 - 1/(1 + w2^2)^0.5",
         "kinks on load: if(w2 < 5, 0.3, min(1, 0.2*w2)) - clamp(w1 - w2, -0.5, 0.5) + "
         "max(cos(3*t), 0.2)",
         "map on load: -0.3*of_two(w1, w2)", kVariator},
        "inputs: [lever]\nlever: {topic: lever, hold: " + hold + ", initial: 1}\n" +
            "tables: [of_speed, of_two]\nof_speed: {x: [0, 5, 10, 20], values: [3, 4, 2, 0]}\n"
            "of_two: {x: [0, 10, 20], y: [0, 10], values: [[0, 1], [2, 1], [3, 4]], "
            "beyond: linear}")));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithOtherOrdersAreTheInterpreters) {
  for (const char* constraint :
       {"c of order 1: w2 - (0.6 + 0.05*sin(phi1))*w1", "c of order 3: j2 + 3*e2 - 0.1*e1",
        "c of order 2: e2 - 0.6*e1 + 0.01*e1^3 + w2 - 0.6*w1"}) {
    SCOPED_TRACE(constraint);
    expectSameBits(test::sceneFromText("drive 0.5, load 1.2",
                                       {constraint, "drag on load: 2*cos(t) - w2"},
                                       "initial: {velocity: [10, 6], project: true}"));
  }
}

/// If tanh is 1 to all digits, its rate is 0, of either sign.
TEST_F(MachineCodeBits, OfFunctionsThatAreConstantToAllDigitsAreTheInterpreters) {
  using Row = std::pair<std::string, std::string>;
  for (const auto& [law, principle] :
       {Row{"law = Friction, shaft: drive, coulomb: 1, regularization_speed: 0.01",
            "generalized_gauss"},
        Row{"law = Friction, shaft: drive, coulomb: 1, regularization_speed: 1e-5", "gauss"},
        Row{"law on drive: -tanh(w1/0.01)", "gauss"}}) {
    SCOPED_TRACE(law);
    expectSameBits(test::sceneFromText("drive 1", {"motor on drive: 5*sin(t)", law},
                                       "initial: {velocity: [1]}\nprinciple: " + principle));
  }
}

}  // namespace
}  // namespace variator_sim
