// Motions by series and implicit steps of shipped scenes are those of another scheme.
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kEnd = 2.0;

/// Samples of all columns, with commands on the way.
std::vector<std::vector<double>> run(Simulation& simulation) {
  const Scene& scene = simulation.scene();
  const auto S = static_cast<std::size_t>(scene.shaftCount());
  std::vector<std::vector<double>> rows;
  simulation.trackEnergy(true);
  for (int n = 1; n <= 20; ++n) {
    simulation.advanceTo(kEnd * n / 20.0);
    if (n % 6 == 3 && scene.inputCount() > 0) {
      const CommandInputSettings& input =
          scene.inputs[static_cast<std::size_t>(n) % scene.inputs.size()];
      simulation.command(n % scene.inputCount(), input.initial + 0.02 * n);
    }
    const Sample& sample = simulation.sample();
    std::vector<double> row;
    for (const double* values : {sample.angle, sample.velocity, sample.acceleration,
                                 sample.applied_torque, sample.reaction_torque}) {
      row.insert(row.end(), values, values + S);
    }
    row.push_back(simulation.energy().kinetic);
    row.push_back(simulation.energy().applied);
    rows.push_back(row);
  }
  EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  return rows;
}

/// Expects equal columns within `tolerances` of the scene, relative to the largest of the column.
void expectClose(const std::vector<std::vector<double>>& a,
                 const std::vector<std::vector<double>>& b, double allowed) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t c = 0; c < a[0].size(); ++c) {
    double largest = 1.0;
    for (const auto& row : a) largest = std::max(largest, std::abs(row[c]));
    for (std::size_t n = 0; n < a.size(); ++n) {
      EXPECT_NEAR(a[n][c], b[n][c], allowed * largest) << "row " << n << ", column " << c;
    }
  }
}

class ProgramMotions : public testing::TestWithParam<const char*> {
 protected:
  Scene scene() const {
    return test::sceneFromFile(VARIATOR_SIM_TEST_DIR + std::string(GetParam()));
  }
};

TEST_P(ProgramMotions, AreThoseOfAnotherScheme) {
  const Scene exact = test::withTolerance(scene(), 1e-10);
  Simulation other(test::withStepper(exact, StepperKind::kDopri5));
  Simulation simulation(exact);
  expectClose(run(other), run(simulation), 1e-7);
}

INSTANTIATE_TEST_SUITE_P(
    OfFiles, ProgramMotions,
    testing::Values("/cases/torque_steps/scene.yaml", "/cases/crank_elastic/scene.yaml",
                    "/cases/first_order_ratio/scene.yaml", "/cases/slip_ship/scene.yaml",
                    "/cases/acceleration_circle/scene.yaml", "/../config/ship.yaml",
                    "/../config/ratio_steps.yaml", "/../config/applications/diesel_locomotive.yaml",
                    "/../config/applications/vbelt_vehicle.yaml",
                    "/../config/applications/starting_system.yaml"));

TEST(ProgramMotion, CountsTheInstantsAtWhichInputsJump) {
  const Scene scene = test::sceneFromFile(VARIATOR_SIM_TEST_DIR "/cases/torque_steps/scene.yaml");
  Simulation simulation(scene);
  for (int n = 1; n <= 5; ++n) {
    simulation.advanceTo(0.1 * n);
    simulation.command(0, n);
    simulation.command(1, -n);
    simulation.sample();
  }
  EXPECT_EQ(simulation.statistics().jumps, 5U);
}

}  // namespace
}  // namespace variator_sim
