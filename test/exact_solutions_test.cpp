// Motions whose solution is known in closed form (acceleration circle, linear constraints), the
// invariant of constant C, and the jump map.

#include <Eigen/Dense>
#include <unsupported/Eigen/MatrixFunctions>

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kTolerance = 1e-11;

class ExactSolutions : public testing::TestWithParam<StepperKind> {
 protected:
  Simulation simulate(const std::string& yaml) const {
    Scene scene = test::withTolerance(test::sceneFromText(yaml), kTolerance);
    scene.solver.stepper = GetParam();
    return Simulation(std::move(scene));
  }
};

// psi = eps1^2 + eps2^2 - a^2, J1 = J2 = J, M1' = m, M2' = 0. With kappa = m / (a J),
// z = kappa t + z0, z0 = atanh(eps1(0) / a):
//   eps1 = a tanh z, eps2 = a sech z,
//   omega1 - omega1(0) = a / kappa (ln cosh z - ln cosh z0),
//   omega2 - omega2(0) = a / kappa (gd z - gd z0), gd z = 2 atan tanh(z / 2).
TEST_P(ExactSolutions, AccelerationCircle) {
  const double a = 2.0;
  const double J = 1.5;
  const double m = 3.0;
  const double z0 = std::atanh(1.2 / a);
  const double kappa = m / (a * J);
  Simulation simulation = simulate(
      test::sceneText("drive 1.5, load 1.5", {"motor on drive: 3*t", "variator: e1^2+e2^2-4"},
                      "initial: {velocity: [0.5, -0.25], acceleration: [1.2, 1.6]}"));
  const auto gd = [](double z) { return 2.0 * std::atan(std::tanh(z / 2.0)); };
  for (double t : {0.1, 0.7, 2.0, 5.0}) {
    ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
    const Sample& sample = simulation.sample();
    const double z = kappa * t + z0;
    EXPECT_NEAR(sample.acceleration[0], a * std::tanh(z), 1e-9);
    EXPECT_NEAR(sample.acceleration[1], a / std::cosh(z), 1e-9);
    EXPECT_NEAR(sample.velocity[0],
                0.5 + a / kappa * (std::log(std::cosh(z)) - std::log(std::cosh(z0))), 1e-9);
    EXPECT_NEAR(sample.velocity[1], -0.25 + a / kappa * (gd(z) - gd(z0)), 1e-9);
    // R' = J eta - Q': eta1 = a kappa sech^2 z, eta2 = -a kappa sech z tanh z
    EXPECT_NEAR(sample.reaction_torque_rate[0], J * a * kappa / std::pow(std::cosh(z), 2) - m,
                1e-9);
    EXPECT_NEAR(sample.reaction_torque_rate[1], -J * a * kappa * std::tanh(z) / std::cosh(z), 1e-9);
  }
}

// A torque jump Delta_M1 on the circle: tan(theta+ / 2) = tan(theta- / 2) exp(-Delta_M1 / (a J)).
TEST_P(ExactSolutions, TorqueJumpOnTheAccelerationCircle) {
  const double a = 2.0;
  const double J = 1.5;
  for (double jump : {-7.0, -1.0, 0.3, 4.0, 25.0}) {
    Simulation simulation = simulate(
        test::sceneText("drive 1.5, load 1.5",
                        {"motor on drive from torque, hold: zero_order", "variator: e1^2+e2^2-4"},
                        "initial: {acceleration: [1.2, 1.6]}"));
    simulation.advanceTo(0.5);  // without torque rates nothing changes but the velocities
    const Sample before = simulation.sample();
    ASSERT_NEAR(before.acceleration[0], 1.2, 1e-12);
    simulation.command(0, jump);
    const Sample& after = simulation.sample();
    ASSERT_TRUE(simulation.status().ok()) << simulation.describeStatus();
    const double theta =
        2.0 * std::atan(std::tan(0.5 * std::atan2(1.6, 1.2)) * std::exp(-jump / (a * J)));
    EXPECT_NEAR(after.acceleration[0], a * std::cos(theta), 1e-11) << jump;
    EXPECT_NEAR(after.acceleration[1], a * std::sin(theta), 1e-11) << jump;
    // frozen: up to the rounding between dense output and the step that a command continues from
    EXPECT_NEAR(after.velocity[0], before.velocity[0], 1e-14);
    EXPECT_NEAR(after.velocity[1], before.velocity[1], 1e-14);
    EXPECT_NEAR(after.angle[0], before.angle[0], 1e-14);
    // R jumps by J Delta_eps - Delta_Q
    EXPECT_NEAR(after.reaction_torque[0] - before.reaction_torque[0],
                J * (after.acceleration[0] - before.acceleration[0]) - jump, 1e-11);
    EXPECT_EQ(simulation.statistics().jumps, 1u);
  }
}

// Linear psi with constant coefficients and torques linear in t, phi and omega: with the KKT system
// x' = M x, x = (phi, omega, eps, 1), the motion is a matrix exponential.
TEST_P(ExactSolutions, LinearConstraintIsAMatrixExponential) {
  Simulation simulation =
      simulate(test::sceneText("a 0.7, b 1.9, c 0.4",
                               {"ta on a: 2*t-0.5*w1+0.1*w3-2*phi1", "tb on b: 1-0.3*w2",
                                "tc on c: -0.2*t-0.4*w3+0.2*w1-0.3*phi3",
                                "variator: 0.3*(e2-0.6*e1+0.1*e3)+w2-0.6*w1+0.5*phi3-0.2*t"},
                               "inertia_coupling: [[a, b, 0.2]]\n"
                               "initial: {angle: [0.1, 0, -0.2], velocity: [3, 1.5, -1]}"));
  Eigen::Matrix3d J;
  J << 0.7, 0.2, 0, 0.2, 1.9, 0, 0, 0, 0.4;
  Eigen::Matrix3d by_angle;  // dQ/dphi
  by_angle << -2, 0, 0, 0, 0, 0, 0, 0, -0.3;
  Eigen::Matrix3d by_velocity;  // dQ/domega
  by_velocity << -0.5, 0, 0.1, 0, -0.3, 0, 0.2, 0, -0.4;
  const Eigen::Vector3d by_time(2, 0, -0.2);
  const Eigen::RowVector3d C(-0.18, 0.3, 0.03);
  const Eigen::RowVector3d psi_velocity(-0.6, 1, 0);
  const Eigen::RowVector3d psi_angle(0, 0, 0.5);
  const double psi_time = -0.2;
  // [J -C^T; C 0] (eta, Lambda) = (Q', -c0), a linear map of x.
  Eigen::Matrix4d kkt = Eigen::Matrix4d::Zero();
  kkt.topLeftCorner<3, 3>() = J;
  kkt.topRightCorner<3, 1>() = -C.transpose();
  kkt.bottomLeftCorner<1, 3>() = C;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(4, 10);
  right.block<3, 3>(0, 3) = by_angle;
  right.block<3, 3>(0, 6) = by_velocity;
  right.block<3, 1>(0, 9) = by_time;
  right.block<1, 3>(3, 3) = -psi_angle;
  right.block<1, 3>(3, 6) = -psi_velocity;
  right(3, 9) = -psi_time;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 10, 10>;
  Square M = Square::Zero(10, 10);
  M.block<6, 6>(0, 3).setIdentity();
  M.block<3, 10>(6, 0) = (kkt.inverse() * right).topRows(3);

  Eigen::VectorXd x(10);
  const Sample start = simulation.sample();
  for (int i = 0; i < 3; ++i) {
    x(i) = start.angle[i];
    x(3 + i) = start.velocity[i];
    x(6 + i) = start.acceleration[i];
  }
  x(9) = 1.0;
  for (double t : {0.4, 1.3, 4.0}) {
    ASSERT_TRUE(simulation.advanceTo(t).ok());
    const Sample& sample = simulation.sample();
    const Eigen::VectorXd exact = Square(M * t).exp() * x;
    const double scale = exact.cwiseAbs().maxCoeff();
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(sample.angle[i], exact(i), 1e-9 * scale);
      EXPECT_NEAR(sample.velocity[i], exact(3 + i), 1e-9 * scale);
      EXPECT_NEAR(sample.acceleration[i], exact(6 + i), 1e-9 * scale);
    }
  }
}

// Constant C: R(t) - R(0) stays in range(C^T), i.e. c2 R1 - c1 R2 is constant. With torques linear
// in t and omega that is a linear invariant, which Runge-Kutta steps and the projection keep to
// round-off, at any tolerance, across torque steps too.
TEST_P(ExactSolutions, InvariantOfConstantC) {
  Scene scene = test::withTolerance(
      test::sceneFromText(
          "drive 0.8, load 2",
          {"motor on drive from torque, hold: zero_order, initial: 3",
           "brake on load: -0.4*w2+0.3*t", "variator: 0.5*(e2-0.7*e1)+w2-0.7*w1+0.01*sin(t)*w1^2"},
          "initial: {velocity: [5, 2], acceleration: [1, 0], project: true}"),
      1e-5);
  scene.solver.stepper = GetParam();
  Simulation simulation(std::move(scene));
  const double c1 = -0.35;
  const double c2 = 0.5;
  const auto invariant = [&](const Sample& s) {
    return c2 * s.reaction_torque[0] - c1 * s.reaction_torque[1];
  };
  const double start = invariant(simulation.sample());
  ASSERT_GT(std::abs(start), 0.1);  // the initial reaction is not in range(C^T)
  // Implicit stages end where Newton's iteration ends, a small part of the tolerance away.
  const double bound = GetParam() == StepperKind::kRadau ? 1e-2 * 1e-5 : 1e-11;
  for (int k = 1; k <= 50; ++k) {
    ASSERT_TRUE(simulation.advanceTo(0.1 * k).ok()) << simulation.describeStatus();
    if (k % 10 == 0) simulation.command(0, k % 20 == 0 ? 3.0 : 8.0);
    EXPECT_NEAR(invariant(simulation.sample()), start, bound) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Steppers, ExactSolutions,
                         testing::Values(StepperKind::kAuto, StepperKind::kDopri5,
                                         StepperKind::kFehlberg78, StepperKind::kRadau,
                                         StepperKind::kTaylor),
                         [](const auto& test) { return std::string(toString(test.param)); });

// Commands of one instant move together, whatever their order, and back again: what one sends to a
// topic before its last word counts for nothing.
TEST(JumpMap, DependsOnOldAndNewInputsOnly) {
  const Scene scene = test::sceneFromText(
      "drive 0.5, load 1.2",
      {"engine on drive from drive_torque", "brake on load from load_torque, gain: -1",
       "friction on load: -0.3*w2", "variator: 0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"},
      "initial: {velocity: [10, 8]}\n"
      "solver: {relative_tolerance: 1e-12, absolute_tolerance: 1e-12}");
  Simulation one(scene);
  Simulation other(scene);
  one.advanceTo(0.3);
  const Sample before = one.sample();
  one.command(0, 9.0);
  one.command(1, 5.0);
  other.advanceTo(0.3);
  other.command(0, -70.0);
  other.command(1, 5.0);
  other.command(0, 9.0);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(one.sample().acceleration[i], other.sample().acceleration[i]);
    EXPECT_GT(std::abs(one.sample().acceleration[i] - before.acceleration[i]), 0.1);
  }
  one.command(1, 0.0);
  one.command(0, 0.0);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(one.sample().acceleration[i], before.acceleration[i], 1e-10);
  }
}

// Along the jump the motion obeys dR in range(C^T): for a constraint that is linear in the
// accelerations the jump is one projection, Delta_eps = J^-1 (Delta_Q + C^T Lambda), C Delta_eps =
// 0.
TEST(JumpMap, IsOneProjectionForALinearConstraint) {
  Simulation simulation(test::sceneFromText(
      "drive 0.5, load 1.2",
      {"engine on drive from torque, hold: zero_order", "variator: e2-(0.8+0.1*sin(t))*e1+w2-w1"}));
  simulation.advanceTo(0.7);
  const Sample before = simulation.sample();
  simulation.command(0, 10.0);
  const Sample& after = simulation.sample();
  const double c1 = -(0.8 + 0.1 * std::sin(0.7));
  const double de1 = after.acceleration[0] - before.acceleration[0];
  const double de2 = after.acceleration[1] - before.acceleration[1];
  EXPECT_NEAR(c1 * de1 + de2, 0.0, 1e-14);
  // (J Delta_eps - Delta_Q) . h = 0 with h = (1, -c1), C h = 0
  EXPECT_NEAR((0.5 * de1 - 10.0) - c1 * 1.2 * de2, 0.0, 1e-13);
}

}  // namespace
}  // namespace variator_sim
