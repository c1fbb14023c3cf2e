// A motion that is not the least one is told, by how much, and on which side of the constraints.
#include "analysis/principle_check.h"

#include "support/scenes.h"

namespace variator_sim {
namespace {

using Eigen::VectorXd;

constexpr char kScene[] = R"(
shafts: [a, b, c]
a: {inertia: {mean: 2.0, harmonics: [{order: 2, cos: 0.3, sin: 0.1}]}}
b: {inertia: 1.5}
c: {inertia: 1.0}
inertia_coupling: [[a, b, 0.1]]
torques: [q]
q: {type: variator_sim/ExpressionTorque, shaft: a, torque: "5*sin(3*t) - 0.3*w_a"}
constraints: [v]
v: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e_b^2 + 2*e_a*e_c + 0.1*w_a - 4"}
initial: {velocity: [1, 2, 3]}
)";

TEST(PrincipleCheck, TellsMotionsThatAreNotTheLeast) {
  Simulation simulation(test::sceneFromText(kScene));
  PrincipleCheck check(simulation.scene());
  for (const double time : {0.0, 0.4, 1.1}) {
    ASSERT_TRUE(simulation.advanceTo(time).ok());
    const PrincipleSystem system = check.calc(simulation.operatingPoint());
    const VectorXd own = check.ownOf(simulation.sample());
    const LeastChange least = PrincipleCheck::compare(system, own);
    EXPECT_NEAR(least.measure, least.least, 1e-12 * least.scale) << time;
    EXPECT_LT(least.off, 1e-12 * std::sqrt(least.scale)) << time;

    // Along an admissible direction of unit length Z rises by the half square of the way, and the
    // constraints hold.
    const Eigen::MatrixXd directions = system.admissibleDirections();
    ASSERT_EQ(directions.cols(), 2);
    for (const double way : {-0.5, 0.2}) {
      const VectorXd aside = own + way * system.J * directions.col(1);
      const LeastChange change = PrincipleCheck::compare(system, aside);
      EXPECT_NEAR(change.measure - change.least, 0.5 * way * way, 1e-10 * least.scale);
      EXPECT_LT(change.off, 1e-12 * std::sqrt(least.scale));
    }
    // Across them the constraints are left, by the whole way, and Z may even fall.
    PrincipleSystem still = system;  // x of F = C^T
    still.g.setZero();
    const VectorXd row = system.C.row(0).transpose();
    const VectorXd across = 0.1 / std::sqrt(row.dot(still.unknownsOf(row))) * row;
    const LeastChange change = PrincipleCheck::compare(system, own + across);
    EXPECT_NEAR(change.off, 0.1, 1e-10 * std::sqrt(least.scale));
  }
}

TEST(PrincipleCheck, OtherDerivationsGiveTheSameJerk) {
  Simulation simulation(test::sceneFromText(kScene));
  PrincipleCheck check(simulation.scene());
  ASSERT_TRUE(simulation.advanceTo(0.7).ok());
  const PrincipleSystem system = check.calc(simulation.operatingPoint());
  const VectorXd eta = system.unknownsOf(check.ownOf(simulation.sample()));
  for (const VectorXd& other : {system.solveByNullSpace(), system.solveByStationarity()}) {
    EXPECT_LT((other - eta).norm(), 1e-12 * eta.norm());
  }
}

}  // namespace
}  // namespace variator_sim
