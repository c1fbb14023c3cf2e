// Linear models against central differences of runs: of every shipped scene, and of every order and
// principle. Along a run the model changes with the state; its deviations are integrated by the
// classical Runge-Kutta method.
#include "variator_sim/linear_model.h"

#include <filesystem>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSteps = 32;
constexpr double kTolerance = 1e-6;

int indexOf(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// The scene with the state of `point` as its initial one.
Scene startAt(Scene scene, const OperatingPoint& point) {
  scene.initial = {point.angle, point.velocity, point.acceleration, true};
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    CommandInputSettings& input = scene.inputs[i];
    input.initial = point.input[i];
    // Pushed to both sides, and of a hold that is not linear only what it gives
    input.minimum = -std::numeric_limits<double>::infinity();
    input.maximum = -input.minimum;
    if (input.hold == Hold::kRateLimit) input.hold = Hold::kZeroOrder;
  }
  return scene;
}

/// Returns the point that the shipped commands reach after `time`.
OperatingPoint runTo(const Scene& scene, const std::string& commands_path, double time) {
  Simulation simulation(scene);
  if (std::filesystem::exists(commands_path)) {
    for (const TimedCommand& command : readCommandFile(commands_path)) {
      if (command.time > time) break;
      simulation.advanceTo(command.time);
      for (int i = 0; i < scene.inputCount(); ++i) {
        if (scene.inputs[static_cast<std::size_t>(i)].topic == command.topic) {
          simulation.command(i, command.value);
        }
      }
    }
  }
  EXPECT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
  return simulation.operatingPoint();
}

/// The perturbation of a run.
struct Push {
  int state = -1;  ///< of the minimal model, at the start
  int input = -1;  ///< a command at step kSteps / 4
};

class Comparison {
 public:
  /// From the start of `scene`, whose commands are `commands`.
  Comparison(Scene scene, std::vector<double> commands)
      : scene_(test::withTolerance(std::move(scene), 1e-12)), commands_(std::move(commands)) {
    Simulation simulation = begin(scene_);
    const OperatingPoint start = simulation.operatingPoint();
    minimal_ = linearize(scene_, start);
    // Projected, a push from a state that satisfies the constraints stays what it is.
    scene_.initial = {start.angle, start.velocity, start.acceleration, true};
    // Beside elements that hold they follow from the modes.
    if (!scene_.holdNames().empty()) scene_.initial.acceleration.clear();
    double fastest = 0.0;
    for (const auto& value : calcEigenvalues(minimal_)) {
      fastest = std::max(fastest, std::abs(value));
    }
    horizon_ = std::min(0.2, 1.0 / fastest);
    for (int n = 0; n <= 2 * kSteps; ++n) {
      EXPECT_TRUE(simulation.advanceTo(horizon_ * n / (2 * kSteps)).ok())
          << simulation.describeStatus();
      const OperatingPoint point = simulation.operatingPoint();
      along_full_.push_back(linearize(scene_, point, LinearForm::kFull));
      along_minimal_.push_back(linearize(scene_, point));
    }
  }

  const LinearModel& model() const { return minimal_; }

  void expectLikeRuns() {
    const int n = static_cast<int>(minimal_.states.size());
    for (int j = 0; j < n; ++j) {
      // Nothing sets the rate of an input.
      const std::string& name = minimal_.states[static_cast<std::size_t>(j)];
      if (name.size() > 5 && name.rfind("/rate") == name.size() - 5) continue;
      expectLikeRuns(Push{j, -1}, name);
    }
    for (int i = 0; i < scene_.inputCount(); ++i) {
      expectLikeRuns(Push{-1, i}, minimal_.inputs[static_cast<std::size_t>(i)]);
    }
  }

 private:
  Simulation begin(const Scene& scene) const {
    Simulation simulation(scene);
    for (int i = 0; i < scene.inputCount(); ++i) {
      simulation.command(i, commands_[static_cast<std::size_t>(i)]);
    }
    simulation.sample();
    return simulation;
  }

  VectorXd outputsOf(Simulation& simulation) const {
    const Sample& sample = simulation.sample();
    VectorXd y(static_cast<int>(minimal_.outputs.size()));
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      y.segment(5 * i, 5) << sample.angle[i], sample.velocity[i], sample.acceleration[i],
          sample.applied_torque[i], sample.reaction_torque[i];
    }
    simulation.calcQuantities(QuantityGroup::kOutputs, y.data() + 5 * scene_.shaftCount());
    return y;
  }

  /// The outputs at 1/4 (after the command), 1/2 and the end of a run pushed by `size`.
  MatrixXd run(const Push& push, double size) const {
    Scene scene = scene_;
    for (int i = 0; push.state >= 0 && i < scene.shaftCount(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      scene.initial.angle[s] += size * minimal_.C(5 * i, push.state);
      scene.initial.velocity[s] += size * minimal_.C(5 * i + 1, push.state);
      if (scene.initial.acceleration.empty()) continue;
      scene.initial.acceleration[s] += size * minimal_.C(5 * i + 2, push.state);
    }
    for (CommandInputSettings& input : scene.inputs) {
      const int state = indexOf(minimal_.states, "inputs/" + input.name);
      if (push.state == state) input.initial += size;
    }
    Simulation simulation = begin(scene);
    MatrixXd y(static_cast<int>(minimal_.outputs.size()), 3);
    int column = 0;
    for (const int step : {kSteps / 4, kSteps / 2, kSteps}) {
      EXPECT_TRUE(simulation.advanceTo(horizon_ * step / kSteps).ok())
          << simulation.describeStatus();
      if (column == 0 && push.input >= 0) {
        simulation.command(push.input, commands_[static_cast<std::size_t>(push.input)] + size);
      }
      y.col(column++) = outputsOf(simulation);
    }
    return y;
  }

  /// The same by a model, for a push of 1.
  MatrixXd predict(const Push& push, const std::vector<LinearModel>& models) const {
    const LinearModel& first = models.front();
    VectorXd z = VectorXd::Zero(first.A.rows());
    for (std::size_t j = 0; j < first.states.size() && push.state >= 0; ++j) {
      const std::string& name = first.states[j];
      const int output = indexOf(minimal_.outputs, name);
      const int row = static_cast<int>(j);
      if (output < static_cast<int>(minimal_.outputs.size())) {
        z(row) = minimal_.C(output, push.state);
      } else {
        z(row) = minimal_.states[static_cast<std::size_t>(push.state)] == name ? 1.0 : 0.0;
      }
    }
    VectorXd v = VectorXd::Zero(first.B.cols());
    MatrixXd y(static_cast<int>(first.outputs.size()), 3);
    const double h = horizon_ / kSteps;
    const auto rate = [&](int half_step, const VectorXd& at) -> VectorXd {
      const LinearModel& model = models[static_cast<std::size_t>(half_step)];
      return model.A * at + model.B * v;
    };
    int column = 0;
    for (int step = 0; step <= kSteps; ++step) {
      if (step == kSteps / 4 && push.input >= 0) v(push.input) = 1.0;
      if (step == kSteps / 4 || step == kSteps / 2 || step == kSteps) {
        const LinearModel& model = models[static_cast<std::size_t>(2 * step)];
        y.col(column++) = model.C * z + model.D * v;
      }
      if (step == kSteps) break;
      const VectorXd k1 = rate(2 * step, z);
      const VectorXd k2 = rate(2 * step + 1, z + 0.5 * h * k1);
      const VectorXd k3 = rate(2 * step + 1, z + 0.5 * h * k2);
      const VectorXd k4 = rate(2 * step + 2, z + h * k3);
      z += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    return y;
  }

  void expectLikeRuns(const Push& push, const std::string& name) {
    double h = 1e-4;
    if (push.state >= 0) h *= std::max(1.0, std::abs(minimal_.x(push.state)));
    if (push.input >= 0) h *= std::max(1.0, std::abs(minimal_.u(push.input)));
    // Small for the accelerations, too, which laws may be bent in.
    const MatrixXd first = predict(push, along_minimal_);
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      h = std::min(h, 0.02 / first.middleRows(5 * i, 3).cwiseAbs().maxCoeff());
    }
    const MatrixXd narrow = run(push, h) - run(push, -h);
    const MatrixXd wide = run(push, 2.0 * h) - run(push, -2.0 * h);
    const MatrixXd measured = (8.0 * narrow - wide) / (12.0 * h);
    // Error of the differences due to the tolerance of the runs
    const double noise = 1e-11 / h;
    for (const auto* models : {&along_full_, &along_minimal_}) {
      const bool is_same = std::all_of(models->begin(), models->end(), [&](const LinearModel& it) {
        return it.states == models->front().states;
      });
      ASSERT_TRUE(is_same);
      const MatrixXd predicted = predict(push, *models);
      for (int o = 0; o < measured.rows(); ++o) {
        // R is the difference of torques as large as Q.
        const bool is_reaction = o < 5 * scene_.shaftCount() && o % 5 == 4;
        const double largest = predicted.middleRows(is_reaction ? o - 1 : o, is_reaction ? 2 : 1)
                                   .cwiseAbs()
                                   .maxCoeff();
        const double size = std::max(1.0, std::abs(minimal_.y(o)));
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(measured(o, c), predicted(o, c),
                      kTolerance * std::max(1.0, largest) + noise * size)
              << minimal_.outputs[static_cast<std::size_t>(o)] << " after a push of " << name
              << ", instant " << c << (models == &along_full_ ? ", full" : ", minimal");
        }
      }
    }
  }

  Scene scene_;
  std::vector<double> commands_;
  double horizon_ = 0.0;
  LinearModel minimal_;
  std::vector<LinearModel> along_full_;
  std::vector<LinearModel> along_minimal_;
};

// --- shipped scenes ------------------------------------------------------------------------------

std::vector<std::filesystem::path> shippedScenes() {
  std::vector<std::filesystem::path> paths;
  for (const char* const folder : {"/../config", "/../config/applications"}) {
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(VARIATOR_SIM_TEST_DIR) + folder)) {
      if (entry.path().extension() == ".yaml") paths.push_back(entry.path());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

class ShippedScenes : public ::testing::TestWithParam<std::filesystem::path> {};

TEST_P(ShippedScenes, AreLikeTheirRuns) {
  const Scene scene = test::sceneFromFile(GetParam().string());
  std::filesystem::path commands = GetParam();
  commands.replace_extension(".csv");
  // A state in the middle of things, from which the scene then starts
  const OperatingPoint point = runTo(scene, commands.string(), 4.3);
  Comparison comparison(startAt(scene, point), point.command);
  EXPECT_GT(comparison.model().states.size(), 0U);
  comparison.expectLikeRuns();
}

std::string nameOf(const ::testing::TestParamInfo<std::filesystem::path>& info) {
  return info.param.stem().string();
}
INSTANTIATE_TEST_SUITE_P(LinearModel, ShippedScenes, ::testing::ValuesIn(shippedScenes()), nameOf);

// --- orders and principles -----------------------------------------------------------------------

struct Case {
  const char* name;
  const char* principle;
  const char* constraints;  // their dictionaries, and `constraints`
  const char* inertia = "1.4";
  std::size_t states;  // of the minimal model
};

std::string sceneText(const Case& it) {
  return std::string(R"yaml(
shafts: [a, b, c]
a: {inertia: 0.8}
b: {inertia: )yaml") +
         it.inertia + R"yaml(}
c: {inertia: 0.5}
torques: [motor, lagged, spring, drag, bend]
motor: {type: variator_sim/ExpressionTorque, shaft: a, torque: "throttle*(30 - 0.5*w_a) + 0.2*throttle^2"}
lagged: {type: variator_sim/CommandedTorque, shaft: b, topic: lagged, hold: first_order_lag, time_constant: 0.3, initial: 0.5}
spring: {type: variator_sim/ElasticCoupling, shafts: [b, c], stiffness: 40.0, damping: 0.7}
drag: {type: variator_sim/ExpressionTorque, shaft: c, torque: "-0.05*w_c^2*(1 + 0.2*sin(phi_c))"}
bend: {type: variator_sim/ExpressionTorque, shaft: b, torque: "-0.1*w_b*throttle"}
inputs: [throttle, ratio]
throttle: {topic: throttle, initial: 0.7}
ratio: {topic: ratio, hold: second_order_lag, time_constant: 0.4, initial: 0.6}
outputs: [losses]
losses: {expression: "w_c*e_a + 0.1*phi_b*throttle"}
initial: {angle: [0.1, 0.3, 0.2], velocity: [9.0, 5.5, 5.0], project: true}
)yaml" + it.constraints +
         "\nprinciple: " + it.principle + "\n";
}

constexpr const char* kOrder1 =
    "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: 1, expression: "
    "\"w_b - ratio*w_a*(1 + 0.01*sin(phi_a))\"}";
constexpr const char* kOrder2 =
    "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: 2, expression: "
    "\"0.3*(e_b - ratio*e_a)*(1 + 0.02*e_a^2 + 0.03*throttle) + w_b - ratio*w_a\"}";
constexpr const char* kLinear2 =
    "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: 2, expression: "
    "\"0.3*(e_b - 0.6*e_a) + w_b - ratio*w_a + 0.1*throttle\"}";
constexpr const char* kOrder3 =
    "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: 3, expression: "
    "\"j_b - ratio*j_a + 0.2*(e_b - e_a) + 0.3*(w_b - 0.5*w_a)*w_a/9\"}";
constexpr const char* kMixed =
    "constraints: [v, w]\nv: {type: variator_sim/ExpressionConstraint, order: 3, expression: "
    "\"j_b - ratio*j_a + 0.2*(e_b - e_a) + 0.02*e_a*w_b\"}\n"
    "w: {type: variator_sim/ExpressionConstraint, order: 2, expression: "
    "\"0.3*(e_c - 0.9*e_b) + w_c - 0.9*w_b - 0.01*w_a\"}";
constexpr const char* kHarmonic = "{mean: 1.4, harmonics: [{order: 2, cos: 0.2, sin: 0.1}]}";

// phi, omega, epsilon, three states of lags; less what psi = 0 and the reactions take away
const Case kCases[] = {
    {"Order1Generalized", "generalized_gauss", kOrder1, "1.4", 9 - 2 - 1 + 3},
    {"Order1Gauss", "gauss", kOrder1, "1.4", 6 - 1 + 3},
    {"Order2Generalized", "generalized_gauss", kOrder2, "1.4", 9 - 1 - 1 + 3},
    {"Order2Gauss", "gauss", kOrder2, "1.4", 6 + 3},
    {"LinearGeneralized", "generalized_gauss", kLinear2, "1.4", 9 - 1 - 2 + 3},
    {"LinearGauss", "gauss", kLinear2, "1.4", 6 + 3},
    {"Order3Generalized", "generalized_gauss", kOrder3, "1.4", 9 - 1 + 3},
    {"Order3Gauss", "gauss", kOrder3, "1.4", 9 - 2 + 3},
    {"MixedGeneralized", "generalized_gauss", kMixed, "1.4", 9 - 1 + 3},
    {"MixedGauss", "gauss", kMixed, "1.4", 9 - 1 - 1 + 3},
    {"HarmonicOrder2Generalized", "generalized_gauss", kOrder2, kHarmonic, 9 - 1 - 1 + 3},
    {"CoupledHarmonicGeneralized", "generalized_gauss\ninertia_coupling: [[a, b, 0.2]]", kOrder2,
     kHarmonic, 9 - 1 + 3},
    {"HarmonicOrder1Gauss", "gauss", kOrder1, kHarmonic, 6 - 1 + 3},
    {"HarmonicOrder3Gauss", "gauss", kOrder3, kHarmonic, 9 - 2 + 3},
};

class OrdersAndPrinciples : public ::testing::TestWithParam<Case> {};

TEST_P(OrdersAndPrinciples, AreLikeTheirRuns) {
  const Scene scene = test::sceneFromText(sceneText(GetParam()));
  Simulation simulation(scene);
  Comparison comparison(startAt(scene, simulation.operatingPoint()), {0.7, 0.62, 0.8});
  EXPECT_EQ(comparison.model().states.size(), GetParam().states);
  comparison.expectLikeRuns();
}

std::string nameOfCase(const ::testing::TestParamInfo<Case>& info) {
  return info.param.name;
}
INSTANTIATE_TEST_SUITE_P(LinearModel, OrdersAndPrinciples, ::testing::ValuesIn(kCases), nameOfCase);

TEST(LinearModel, KeepsTheReactionOfAFreeShaftWithItsInertia) {
  // No constraint reads shaft c, so R_c / sqrt(J_c) stays what it is, here not 0.
  std::string text = sceneText(kCases[2]);
  const std::string constant = "c: {inertia: 0.5}";
  text.replace(text.find(constant), constant.size(),
               "c: {inertia: {mean: 0.5, harmonics: [{order: 2, cos: 0.1, sin: 0.1}]}}");
  const Scene scene = test::sceneFromText(text);
  OperatingPoint point = Simulation(scene).operatingPoint();
  point.acceleration[2] += 8.0;
  Comparison comparison(startAt(scene, point), {0.7, 0.62, 0.8});
  EXPECT_EQ(comparison.model().states.size(), kCases[2].states);
  comparison.expectLikeRuns();
}

// --- where there is none -------------------------------------------------------------------------

/// Two shafts and a gear between them: `keys` of the gear, and what drives.
Scene lossyGear(const std::string& keys, const std::string& on_a, const std::string& on_b,
                const std::string& rest) {
  return test::sceneFromText(
      "a 1, b 2",
      {"m on a: " + on_a, "l on b: " + on_b, "g = KinematicRatio, shafts: [a, b], " + keys},
      "inputs: [u]\nu: {topic: u, initial: 0.5}\n" + rest);
}

TEST(LinearModel, KnowsTheLossesOfTheSideThatDrives) {
  const std::string gauss = "principle: gauss\n";
  const std::string efficiencies = "efficiency: {driving: 0.9, driven: 0.8}, ";
  const std::string turns = "ratio: {times: [0, 1, 2], values: [0.5, 0.8, 0.6]}";
  const std::string forward = "initial: {velocity: [2, 1]}\n";
  const std::string motor = "5*u - 0.1*w_a";
  const std::string drag = "-0.4*w_b*abs(w_b)";
  for (const Scene& scene : {
           lossyGear(efficiencies + "ratio: 0.5", motor, drag, gauss + forward),
           lossyGear(efficiencies + "ratio: 0.5", "-0.3*w_a*w_a", "6*u - w_b", gauss + forward),
           lossyGear(efficiencies + "bearing: {driving: 0.2, driven: 0.1}, " + turns, motor, drag,
                     gauss + forward),
           lossyGear(efficiencies + "bearing: 0.2, " + turns, "0.3*w_a*w_a", "-6*u",
                     gauss + "initial: {velocity: [-2, -1]}\n"),
           lossyGear("efficiency: \"0.9 - 0.02*w_a\", ratio: 0.5", motor, drag, gauss + forward),
           lossyGear(efficiencies + "bearing: \"0.1 + 0.05*w_a\", ratio: 0.5", motor, drag,
                     forward),
       }) {
    Comparison(scene, {0.6}).expectLikeRuns();
  }
}

/// (J_a + 1/2 J_b 1/2 / 0.9) w' = 5 - (0.1 + 1/2 0.4 1/2 / 0.9) w
TEST(LinearModel, OfALossyGearDecaysAsItsMotion) {
  for (const char* const principle : {"principle: gauss\n", "principle: generalized_gauss\n"}) {
    const Scene scene = lossyGear("ratio: 0.5, efficiency: 0.9", "5 - 0.1*w_a", "-0.4*w_b",
                                  std::string(principle) + "initial: {velocity: [2, 1]}\n");
    const LinearModel model = linearize(scene, runTo(scene, "", 1.0));
    const auto eigenvalues = calcEigenvalues(model);
    EXPECT_NEAR(eigenvalues.back().real(), -(0.1 + 0.1 / 0.9) / (1.0 + 0.5 / 0.9), 1e-12);
  }
}

TEST(LinearModel, IsRefusedByNameForLossesThatTurnTheReaction) {
  const Scene scene = lossyGear("ratio: {times: [0, 2], values: [0.5, 0.8]}, efficiency: 0.9", "5",
                                "-w_b", "initial: {velocity: [2, 1]}\n");
  test::expectRefused("g", {"losses", "principle: gauss"},
                      [&] { linearize(scene, runTo(scene, "", 0.5)); });
}

TEST(LinearModel, IsRefusedWhereThereIsNone) {
  const Scene scene = test::sceneFromText(sceneText(kCases[2]));
  Simulation simulation(scene);
  OperatingPoint point = simulation.operatingPoint();
  point.acceleration[0] += 1.0;
  EXPECT_THROW(linearize(scene, point), SceneError);

  // Accelerations on a circle: at its centre C is 0.
  const Scene circle = test::sceneFromFile(std::string(VARIATOR_SIM_TEST_DIR) +
                                           "/../config/acceleration_circle.yaml");
  OperatingPoint centre = Simulation(circle).operatingPoint();
  centre.acceleration = {0.0, 0.0};
  EXPECT_THROW(linearize(circle, centre), SceneError);
}

TEST(LinearModel, HasExactZerosForUnreadVariables) {
  const Scene scene =
      test::sceneFromText("a 2", {"motor on a: u - 3*w_a"},
                          "inputs: [u]\nu: {topic: u, hold: first_order_lag, time_constant: 0.5}");
  Simulation simulation(scene);
  const LinearModel model = linearize(scene, simulation.operatingPoint());
  EXPECT_EQ(model.states, (std::vector<std::string>{"a/angle", "a/velocity", "inputs/u"}));
  const auto eigenvalues = calcEigenvalues(model);
  ASSERT_EQ(eigenvalues.size(), 3U);
  EXPECT_EQ(eigenvalues[0], 0.0);
  EXPECT_NEAR(eigenvalues[1].real(), -1.5, 1e-14);
  EXPECT_NEAR(eigenvalues[2].real(), -2.0, 1e-14);
  EXPECT_NEAR(model.B(2, 0), 2.0, 1e-14);
  EXPECT_NEAR(model.A(1, 2), 0.5, 1e-14);
}

// A defective 0 is as sensitive as a root of rounding: 1e-8 of the largest entry without deflation.
TEST(LinearModel, HasExactZerosForATrainThatNothingHolds) {
  for (const char* ratio : {"1", "0.01", "37.3"}) {
    for (const char* stiffness : {"0.7", "1e3", "9.1e8"}) {
      SCOPED_TRACE(std::string(ratio) + ", " + stiffness);
      const Scene scene =
          test::sceneFromText("a 4e4, b 0.3, c 7",
                              {std::string("ab = ElasticCoupling, shafts: [a, b], ratio: ") +
                                   ratio + ", stiffness: " + stiffness + ", damping: 3",
                               "bc = ElasticCoupling, shafts: [b, c], stiffness: 51"},
                              "principle: gauss");
      Simulation simulation(scene);
      int index = 0;
      const auto eigenvalues =
          calcEigenvalues(linearize(scene, simulation.operatingPoint()), &index);
      EXPECT_EQ(index, 2);
      ASSERT_EQ(eigenvalues.size(), 6U);
      EXPECT_EQ(eigenvalues[0], 0.0);
      EXPECT_EQ(eigenvalues[1], 0.0);
      for (std::size_t n = 2; n < 6; ++n) {
        EXPECT_LT(eigenvalues[n].real(), 1e-15 * std::abs(eigenvalues[5])) << n;
        EXPECT_GT(std::abs(eigenvalues[n]), 1e-3) << n;
      }
    }
  }
}

// The full model has the minimal one's eigenvalues, and zeros: what stays constant off the
// manifold. Its zeros are of several Jordan blocks, of which a deflation by rows that are all
// rounding takes the wrong ones.
TEST(LinearModel, HasTheSameEigenvaluesBesideTheZerosOfTheFullModel) {
  for (const char* const ratio : {"1.334", "-0.7"}) {
    for (const char* const inertia : {"1.7338", "0.3", "12.1"}) {
      for (const char* const coupled : {"0.0474", "0.08", "-0.05"}) {
        SCOPED_TRACE(std::string(ratio) + ", " + inertia + ", " + coupled);
        const Scene scene = test::sceneFromText(
            std::string("a 1.3609, b ") + inertia + ", c 1.4576",
            {std::string("ab = KinematicRatio, shafts: [a, b], ratio: ") + ratio,
             "ac = ElasticCoupling, shafts: [a, c], stiffness: 525.1745, damping: 4.1716",
             "drag on a: -1.2985*w_a"},
            std::string("inertia_coupling: [[a, c, ") + coupled +
                "]]\nprinciple: generalized_gauss");
        Simulation simulation(scene);
        const OperatingPoint point = simulation.operatingPoint();
        const auto minimal = calcEigenvalues(linearize(scene, point));
        const auto full = calcEigenvalues(linearize(scene, point, LinearForm::kFull));
        ASSERT_EQ(full.size(), 9U);
        ASSERT_GE(minimal.size(), 4U);
        for (std::size_t n = 1; n <= 3; ++n) {
          const auto expected = minimal[minimal.size() - n];
          EXPECT_NEAR(std::abs(full[9 - n] - expected), 0.0, 1e-9 * std::abs(expected)) << n;
        }
        for (std::size_t n = 0; n < 6; ++n) EXPECT_EQ(full[n], 0.0) << n;
      }
    }
  }
}

TEST(LinearModel, TakesNoSlowEigenvalueForAZero) {
  LinearModel model;
  model.A = Eigen::MatrixXd::Zero(3, 3);
  model.A << -1e-9, 1.0, 0.0, 0.0, -1e3, 2.0, 0.0, 0.0, -1e-14;
  int index = 7;
  const auto eigenvalues = calcEigenvalues(model, &index);
  EXPECT_EQ(index, 0);
  EXPECT_NEAR(eigenvalues[0].real(), -1e-14, 1e-20);
  EXPECT_NEAR(eigenvalues[1].real(), -1e-9, 1e-15);
  EXPECT_NEAR(eigenvalues[2].real(), -1e3, 1e-9);
}

TEST(LinearModel, CountsIntegratorsOneBehindTheOther) {
  // A Jordan block of three zeros and the eigenvalue -2, in other coordinates.
  Eigen::Matrix4d J = Eigen::Matrix4d::Zero();
  J(0, 1) = 1.0;
  J(1, 2) = 30.0;
  J(3, 3) = -2.0;
  const Eigen::Vector4d v(1.0, 2.0, 3.0, 4.0);
  const Eigen::Matrix4d T = Eigen::Matrix4d::Identity() - 2.0 / v.squaredNorm() * v * v.transpose();
  LinearModel model;
  model.A = T * J * T;
  int index = 0;
  const auto eigenvalues = calcEigenvalues(model, &index);
  EXPECT_EQ(index, 3);
  for (int n = 0; n < 3; ++n) EXPECT_EQ(eigenvalues[static_cast<std::size_t>(n)], 0.0);
  EXPECT_NEAR(eigenvalues[3].real(), -2.0, 1e-12);
}

}  // namespace
}  // namespace variator_sim
