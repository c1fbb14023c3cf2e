// Machine code that motions of the same formulas share.

#include "motion_program/motion_program.h"
#include "support/machine_code_folder.h"
#include "support/played.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::hex;
using test::play;

const std::string kVariator = "variator: 0.2*(e2 - 0.6*e1) + w2 - 0.6*w1";

std::string shipWith(const std::string& gain, const std::string& drag) {
  return test::twoShafts(
      {"engine = ExpressionTorque, shaft: drive, torque: \"g*(30 - w1) + sin(t)^2\", "
       "parameters: {g: " +
           gain + "}",
       "drag on load: " + drag, kVariator});
}

class SharedMachineCode : public test::MachineCodeFolder {
 protected:
  static Simulation interpreted(const std::string& text) {
    Scene scene = test::sceneFromText(text);
    // kAlways waits for a busy compiler.
    MachineCode& wanted = scene.solver.machine_code;
    if (wanted == MachineCode::kAuto) wanted = MachineCode::kAlways;
    return Simulation(std::move(scene));
  }
};

TEST_F(SharedMachineCode, OfOtherNumbersGivesTheBitsOfTheirInterpreter) {
  Simulation first = interpreted(shipWith("0.7", "-0.02*w2^2 - 0.1*abs(w2)^1.6"));
  ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
  for (const char* gain : {"0.3", "1.9", "-0.5"}) {
    SCOPED_TRACE(gain);
    const std::string scene = shipWith(gain, "-0.03*w2^2 - 0.25*abs(w2)^1.35");
    Simulation other = interpreted(scene);
    ASSERT_TRUE(other.shareMachineCode(first));
    EXPECT_EQ(other.machineCode(), "machine code, of another run");
    Simulation alone = interpreted(scene);
    other.advanceTo(3.0);
    alone.advanceTo(3.0);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(hex(other.sample().velocity[i]), hex(alone.sample().velocity[i]));
      EXPECT_EQ(hex(other.sample().acceleration[i]), hex(alone.sample().acceleration[i]));
    }
    // The same kernel is in the cache.
    EXPECT_TRUE(alone.loadMachineCode(false)) << alone.machineCode();
  }
}

/// Equal numbers are one: a formula in which two happen to be equal may be another one, and code is
/// shared only where it makes the very steps of the interpreter.
TEST_F(SharedMachineCode, IsRightForFormulasWhoseNumbersAreEqual) {
  const std::string drag = "0.04*cos(w2)";
  Simulation first = interpreted(shipWith("0.7", drag));
  ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
  for (const char* const number : {"0.04", "0.05"}) {
    Simulation other = interpreted(shipWith(number, drag));
    Simulation alone = interpreted(shipWith(number, drag));
    const bool is_shared = other.shareMachineCode(first);
    EXPECT_TRUE(is_shared || number == std::string("0.04"));
    other.advanceTo(3.0);
    alone.advanceTo(3.0);
    EXPECT_EQ(hex(other.sample().velocity[1]), hex(alone.sample().velocity[1])) << number;
  }
}

TEST_F(SharedMachineCode, IsThatOfTheSameFormulasOnly) {
  const std::string drag = "-0.02*w2^2";
  Simulation first = interpreted(shipWith("0.7", drag));
  Simulation without = interpreted(shipWith("0.7", drag));
  EXPECT_FALSE(first.shareMachineCode(without)) << "nothing to share";
  ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
  const char* const others[] = {"-0.02*w2^3",   "-0.02*w1^2",      "-0.02*w2^2 - 1.5",
                                "-1*w2^2",      "-0.02*w2^2*t",    "-0.02*exp(w2)",
                                "-0.02*w2^2.5", "0.02 - 0.3*w2^2", "-0.02/w2^2"};
  for (const char* other : others) {
    SCOPED_TRACE(other);
    EXPECT_FALSE(interpreted(shipWith("0.7", other)).shareMachineCode(first));
  }
  EXPECT_FALSE(interpreted(shipWith("1", drag)).shareMachineCode(first)) << "1 is written out";
  EXPECT_FALSE(interpreted(shipWith("0.7", drag) + "principle: gauss\n").shareMachineCode(first));
  EXPECT_FALSE(interpreted(shipWith("0.7", drag) + "solver: {relative_tolerance: 1.0e-5}\n")
                   .shareMachineCode(first));
  EXPECT_FALSE(interpreted(shipWith("0.7", drag) + "solver: {machine_code: never}\n")
                   .shareMachineCode(first));
}

/// The code for a moving inertia has only the entries of its pattern.
TEST_F(SharedMachineCode, IsThatOfTheSamePatternOfInertiaOnly) {
  const std::string diagonal = test::sceneText(
      "crank, load 1.2", {"drag on load: 3 + drag_of(w2)", kVariator},
      "crank: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.2}]}}\n"
      "initial: {velocity: [10, 6]}\n"
      "tables: [drag_of]\ndrag_of: {x: [0, 5, 20], values: [0, -1, -6], beyond: linear}");
  const std::string coupled = diagonal + "inertia_coupling: [[crank, load, 0.1]]\n";
  for (const auto& [one, other] : {std::pair{diagonal, coupled}, std::pair{coupled, diagonal}}) {
    Simulation first = interpreted(one);
    ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
    EXPECT_TRUE(interpreted(one).shareMachineCode(first));
    EXPECT_FALSE(interpreted(other).shareMachineCode(first));
  }
}

/// Equal tables are one.
TEST_F(SharedMachineCode, IsThatOfAsManyTablesOnly) {
  const auto scene = [](const std::string& values) {
    return test::sceneText("a 1, b 2", {"p on a: one(w1)", "q on b: two(w2)"},
                           "initial: {velocity: [10, 6]}\ntables: [one, two]\n"
                           "one: {x: [0, 5, 20], values: [0, -1, -6]}\n"
                           "two: {x: [0, 5, 20], values: " +
                               values + "}");
  };
  Simulation first = interpreted(scene("[0, -1, -6]"));
  ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
  EXPECT_TRUE(interpreted(scene("[0, -1, -6]")).shareMachineCode(first));
  EXPECT_FALSE(interpreted(scene("[0, -1, -5]")).shareMachineCode(first));
}

/// A scene whose numbers outside its formulas were changed gets the programs of another one.
TEST_F(SharedMachineCode, GoesAlongWithProgramsOfTheSameScene) {
  const std::string tests = VARIATOR_SIM_TEST_DIR;
  const auto withOtherNumbers = [](Scene scene) {
    scene.inertia *= 1.25;
    scene.solver.relative_tolerance *= 0.1;
    scene.initial.acceleration.clear();
    return scene;
  };
  bool is_odd = false;
  for (const char* name : {"/scenes/car.yaml", "/scenes/observed.yaml", "/scenes/stops.yaml",
                           "/cases/crank_elastic/scene.yaml", "/cases/first_order_ratio/scene.yaml",
                           "/../config/ratio_steps.yaml", "/../config/ship.yaml",
                           "/../config/applications/diesel_locomotive.yaml",
                           "/../config/applications/vbelt_vehicle.yaml"}) {
    is_odd = !is_odd;
    for (const Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      // A kernel takes seconds of the compiler: each scene has that of one principle.
      const bool may_have_code = is_odd == (principle == Principle::kGauss);
      for (const bool has_code : {false, true}) {
        if (has_code && !may_have_code) continue;
        SCOPED_TRACE(std::string(name) + (has_code ? ", machine code" : ""));
        Scene scene = test::sceneFromFile(tests + name);
        scene.principle = principle;
        scene.solver.machine_code = MachineCode::kAlways;
        scene.initial.acceleration.clear();
        Simulation like(scene);
        if (has_code) {
          EXPECT_TRUE(like.loadMachineCode(true)) << like.machineCode();
        }
        play(like, -1);  // it has a past
        // The kernel has orders for the tolerance; inertias are no part of it.
        Simulation same(scene, like);
        EXPECT_EQ(same.hasMachineCode(), has_code);
        EXPECT_EQ(play(same, -1), play(scene, -1));
        const Scene changed = withOtherNumbers(scene);
        Simulation other(changed, like);
        const std::string alone = play(changed, -1);
        EXPECT_EQ(play(other, -1), alone);
        // Not of the same scene: made as if there were no other.
        const Scene read_again = withOtherNumbers([&] {
          Scene again = test::sceneFromFile(tests + name);
          again.principle = principle;
          again.solver.machine_code = MachineCode::kAlways;
          again.initial.acceleration.clear();
          return again;
        }());
        Simulation independent(read_again, like);
        EXPECT_EQ(play(independent, -1), alone);
      }
    }
  }
}

/// Sources and what they are made from agree on which scenes are alike.
TEST_F(SharedMachineCode, IsAskedForWhereTheSourceIsTheSame) {
  std::vector<std::string> scenes;
  for (const char* gain : {"0.7", "0.9", "1"}) {
    for (const char* drag : {"-0.02*w2^2", "-0.02*abs(w2)^1.5", "-0.7*w2^2", "-w2", "-3.5"}) {
      scenes.push_back(shipWith(gain, drag));
    }
  }
  std::vector<std::string> sources;
  for (const std::string& text : scenes) {
    const Scene scene = test::sceneFromText(text);
    sources.push_back(MotionProgram(scene).writeKernel());
  }
  int alike = 0;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    Simulation owner = interpreted(scenes[i]);
    ASSERT_TRUE(owner.loadMachineCode(true)) << owner.machineCode();
    for (std::size_t j = 0; j < scenes.size(); ++j) {
      const bool is_shared = interpreted(scenes[j]).shareMachineCode(owner);
      EXPECT_EQ(is_shared, sources[i] == sources[j]) << scenes[i] << scenes[j];
      alike += is_shared && i != j ? 1 : 0;
    }
  }
  EXPECT_GT(alike, 8);
}

}  // namespace
}  // namespace variator_sim
