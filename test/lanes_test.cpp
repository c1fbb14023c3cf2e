// Steps of several motions made at once (series_lanes.h): each has the bits that it has alone.
#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "io/text_file.h"
#include "python/row_fibers.h"
#include "support/machine_code_folder.h"
#include "support/scenes.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

/// Counts the steps that are made together, and passes them on.
class CountedSteps final : public StepsTogether {
 public:
  explicit CountedSteps(StepsTogether& steps) : steps_(steps) {}
  bool make(MotionSeries& series) override {
    ++count_;
    return steps_.make(series);
  }
  void fetch(MotionSeries& series, int begin, int end) override {
    ++fetched_;
    steps_.fetch(series, begin, end);
  }
  int count() const { return count_; }
  int fetched() const { return fetched_; }

 private:
  StepsTogether& steps_;
  int count_ = 0;
  int fetched_ = 0;
};

/// Motions that differ in inertias, in where they start and in their commands.
constexpr int kMotions = SeriesLanes::kLanes + 2;
Scene variant(const Scene& like, int n) {
  Scene scene = like;
  scene.solver.machine_code = MachineCode::kAlways;
  scene.solver.maximum_step = 10.0;
  // (One that depends on an angle is a formula.)
  if (scene.inertia_harmonics.empty()) scene.inertia *= 1.0 + 0.11 * n;
  for (double& velocity : scene.initial.velocity) velocity *= 1.0 + 0.03 * n;
  scene.initial.acceleration.clear();
  return scene;
}

std::string hex(const double* values, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    char number[64];
    std::snprintf(number, sizeof number, "%a ", values[i]);
    text += number;
  }
  return text;
}

std::string play(Simulation& simulation, int n) {
  const int s = simulation.scene().shaftCount();
  const int inputs = simulation.scene().inputCount();
  std::string text;
  for (int sample = 1; sample <= 30; ++sample) {
    simulation.advanceTo(sample * (0.11 + 0.013 * n));
    if (inputs > 0 && sample % 7 == n % 7) simulation.command(sample % inputs, 1.0 + 0.1 * sample);
    const Sample& at = simulation.sample();
    for (const double* values : {at.angle, at.velocity, at.acceleration, at.reaction_torque_rate}) {
      text += hex(values, s);
    }
    text += "\n";
  }
  const Statistics& statistics = simulation.statistics();
  return text + simulation.describeStatus() + " " + std::to_string(statistics.steps) + " " +
         std::to_string(statistics.rejected_steps);
}

using MachineCodeLanes = test::MachineCodeFolder;
class Lanes : public test::MachineCodeFolder,
              public testing::WithParamInterface<std::pair<const char*, double>> {};

void expectBitsOfMotionsAlone(Scene scene, double tolerance) {
  scene.solver.relative_tolerance = scene.solver.absolute_tolerance = tolerance;
  Simulation first(variant(scene, 0));
  ASSERT_TRUE(first.loadMachineCode(true)) << first.machineCode();
  const std::shared_ptr<SeriesLanes> lanes = first.loadLanes(true);
  ASSERT_NE(lanes, nullptr);

  std::vector<std::string> alone;
  for (int n = 0; n < kMotions; ++n) {
    Simulation simulation(variant(scene, n), first);
    EXPECT_TRUE(simulation.hasMachineCode());
    alone.push_back(play(simulation, n));
  }
  python::RowFibers fibers;
  fibers.setLanes(lanes);
  CountedSteps counted(fibers);
  std::vector<std::string> together(kMotions);
  int next = 0;
  fibers.run([&] {
    while (next < kMotions) {
      const int n = next++;
      Simulation simulation(variant(scene, n), first);
      simulation.makeStepsWith(&counted);
      together[static_cast<std::size_t>(n)] = play(simulation, n);
    }
  });
  EXPECT_EQ(together, alone);
  EXPECT_GT(counted.count(), 2 * kMotions) << "few steps were made together";
  EXPECT_GT(counted.fetched(), kMotions);
}

std::string pathOf(const std::string& file) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/../" + file;
}

TEST_P(Lanes, HaveTheBitsOfMotionsAlone) {
  const auto [file, tolerance] = GetParam();
  expectBitsOfMotionsAlone(test::sceneFromFile(pathOf(file)), tolerance);
}

/// Some arguments have left the reach of the vector's sine then, one lane after the other.
TEST_F(MachineCodeLanes, HaveSinesOfFarArguments) {
  std::string text;
  ASSERT_EQ(readTextFile(pathOf("benchmark/scenes/ship.yaml"), &text), "");
  const std::string near = "sin(0.7*t)";
  const std::string far = "sin(0.7*t+1048574.5)";
  for (std::size_t at = text.find(near); at != std::string::npos;
       at = text.find(near, at + far.size())) {
    text.replace(at, near.size(), far);
  }
  expectBitsOfMotionsAlone(test::sceneFromText(text), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Lanes,
                         testing::Values(std::pair{"benchmark/scenes/ship.yaml", 1e-3},
                                         std::pair{"benchmark/scenes/ship.yaml", 1e-10},
                                         std::pair{"benchmark/scenes/four_shafts.yaml", 1e-6},
                                         std::pair{"benchmark/scenes/crank.yaml", 1e-8},
                                         std::pair{"benchmark/scenes/order1.yaml", 1e-6},
                                         std::pair{"benchmark/scenes/order3.yaml", 1e-7},
                                         std::pair{"benchmark/scenes/smooth_linear.yaml", 1e-3}),
                         [](const auto& of) { return "Scene" + std::to_string(of.index); });

/// A motion that ends or stops leaves the others alone, and so does one without such lanes.
TEST(RowFibers, GoOnWhereOneThrows) {
  python::RowFibers fibers;
  int runs = 0;
  EXPECT_THROW(fibers.run([&] {
    if (++runs == 2) throw std::runtime_error("the second");
  }),
               std::runtime_error);
  EXPECT_EQ(runs, SeriesLanes::kLanes);
}

}  // namespace
}  // namespace variator_sim
