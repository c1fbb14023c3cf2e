// The motion of linear constraints in closed form, and the invariant of constant C. (cases_test.cpp
// and test/known_motions.yaml have the acceleration circle.)

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

}  // namespace
}  // namespace variator_sim
