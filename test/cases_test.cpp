// The reference cases: motions computed in multiple precision by an independent implementation,
// given to 20 digits. Every published quantity must agree to 1e-9 at tolerance 1e-11, of the crank
// and of multipliers to 1e-8.

#include <filesystem>
#include <tuple>

#include "support/scenes.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim {
namespace {

std::string casePath(const std::string& name) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/cases/" + name;
}

/// One column of a reference sample against ours, scaled by max(1, |value| over the shafts). The
/// references of the classical principle have no reaction rates and no multipliers.
void compareColumn(const ParameterTree& sample, const std::string& column, const double* values,
                   double tolerance, bool optional = false) {
  const auto entry = sample.asDictionary().find(column);
  if (optional && entry == sample.asDictionary().end()) return;
  ASSERT_NE(entry, sample.asDictionary().end()) << column;
  std::vector<double> reference;
  for (const ParameterTree& value : entry->second.asList()) {
    reference.push_back(ParameterReader::toNumber(value, column));
  }
  ASSERT_FALSE(reference.empty()) << column;
  double scale = 1.0;
  for (double value : reference) scale = std::max(scale, std::abs(value));
  for (std::size_t i = 0; i < reference.size(); ++i) {
    EXPECT_NEAR(values[i], reference[i], tolerance * scale) << column << "[" << i << "]";
  }
}

class Cases : public testing::TestWithParam<std::tuple<const char*, StepperKind>> {};

TEST_P(Cases, AgreeWithTheReference) {
  const auto [name, stepper] = GetParam();
  const std::string folder = casePath(name);
  const double allowed = std::string(name) == "crank_elastic" ? 1e-8 : 1e-9;
  Scene scene = test::withTolerance(test::sceneFromFile(folder + "/scene.yaml"), 1e-11);
  scene.solver.stepper = stepper;
  Simulation simulation(std::move(scene));

  std::vector<TimedCommand> commands;
  if (std::filesystem::exists(folder + "/commands.csv")) {
    commands = readCommandFile(folder + "/commands.csv");
    ASSERT_FALSE(commands.empty());
  }
  const auto inputOf = [&](const std::string& topic) {
    const auto& inputs = simulation.scene().inputs;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].topic == topic) return static_cast<int>(i);
    }
    return -1;
  };

  const ParameterTree reference = readYamlFile(folder + "/reference.json");
  const auto& samples = reference.asDictionary().at("samples").asList();
  ASSERT_FALSE(samples.empty());
  std::size_t next = 0;
  for (const ParameterTree& sample : samples) {
    const double time = ParameterReader::toNumber(sample.asDictionary().at("time"), "time");
    for (; next < commands.size() && commands[next].time <= time; ++next) {
      simulation.advanceTo(commands[next].time);
      ASSERT_EQ(simulation.command(inputOf(commands[next].topic), commands[next].value),
                CommandResult::kAccepted);
    }
    ASSERT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
    const Sample& ours = simulation.sample();
    SCOPED_TRACE(testing::Message() << "t = " << time);
    ASSERT_EQ(ours.time, time);
    compareColumn(sample, "angle", ours.angle, allowed);
    compareColumn(sample, "velocity", ours.velocity, allowed);
    compareColumn(sample, "acceleration", ours.acceleration, allowed);
    compareColumn(sample, "applied_torque", ours.applied_torque, allowed);
    compareColumn(sample, "reaction_torque", ours.reaction_torque, allowed);
    const bool classical = simulation.scene().principle == Principle::kGauss;
    compareColumn(sample, "reaction_torque_rate", ours.reaction_torque_rate, allowed, classical);
    compareColumn(sample, "multiplier", ours.multiplier, 1e-8, classical);
    compareColumn(sample, "residual", ours.residual, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(
    AllCases, Cases,
    testing::Combine(testing::Values("slip_ship", "acceleration_circle", "crank_elastic",
                                     "first_order_ratio", "torque_steps"),
                     testing::Values(StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kTaylor,
                                     StepperKind::kFehlberg78, StepperKind::kRadau)),
    [](const auto& test) {
      return std::get<0>(test.param) + std::string("_") + toString(std::get<1>(test.param));
    });

}  // namespace
}  // namespace variator_sim
