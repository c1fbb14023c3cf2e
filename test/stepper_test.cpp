// Steppers by name: their orders, by the error of fixed steps and by the steps that tolerances
// take, and the tables of Radau IIA.
#include <complex>

#include "support/scenes.h"

namespace variator_sim {
namespace {

#include "runtime/radau_tables.h"

const std::string kShip = test::sceneText(
    "drive 0.8, load 2",
    {"motor on drive: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "propeller on load: -0.02*w2^2",
     "variator: 0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + "
     "w2-(0.6+0.2*sin(0.7*t))*w1"},
    "initial: {velocity: [5, 2]}");
constexpr double kEnd = 4.0;

struct Result {
  Sample sample;
  Statistics statistics;
};

Result run(Scene scene) {
  Simulation simulation(std::move(scene));
  EXPECT_TRUE(simulation.advanceTo(kEnd).ok()) << simulation.describeStatus();
  return {simulation.sample(), simulation.statistics()};
}
Result run(StepperKind stepper, double tolerance) {
  return run(
      test::withStepper(test::withTolerance(test::sceneFromText(kShip), tolerance), stepper));
}

double distance(const Sample& a, const Sample& b) {
  double largest = 0.0;
  for (int i = 0; i < 2; ++i) {
    largest = std::max({largest, std::abs(a.velocity[i] - b.velocity[i]),
                        std::abs(a.acceleration[i] - b.acceleration[i])});
  }
  return largest;
}

TEST(StepperOrder, OfRk4IsThatOfItsErrors) {
  const Sample exact = run(StepperKind::kTaylor, 1e-13).sample;
  std::vector<double> errors;
  for (const double step : {0.05, 0.025, 0.0125}) {
    Scene fixed =
        test::withStepper(test::withTolerance(test::sceneFromText(kShip), 1e-3), StepperKind::kRk4);
    fixed.solver.step = step;
    errors.push_back(distance(run(std::move(fixed)).sample, exact));
  }
  EXPECT_NEAR(std::log2(errors[1] / errors[2]), 4.0, 0.5);
}

// The error of a step is h^(order + 1): a thousandth of it takes 1000^(1 / (order + 1)) as many.
TEST(StepperOrder, OfSchemesIsThatOfTheirSteps) {
  const Sample exact = run(StepperKind::kTaylor, 1e-13).sample;
  struct Case {
    StepperKind stepper;
    double power;  // of the estimate
  };
  // (Between its nodes a step of Fehlberg78 is a polynomial of degree 5, which limits it here.)
  for (const Case& c : {Case{StepperKind::kDopri5, 5.0}, Case{StepperKind::kFehlberg78, 6.0},
                        Case{StepperKind::kRadau, 6.0}}) {
    const Result coarse = run(c.stepper, 1e-7);
    const Result fine = run(c.stepper, 1e-10);
    const double ratio =
        static_cast<double>(fine.statistics.steps) / static_cast<double>(coarse.statistics.steps);
    const double expected = std::pow(1000.0, 1.0 / c.power);
    EXPECT_GT(ratio, 0.75 * expected) << toString(c.stepper);
    EXPECT_LT(ratio, 1.35 * expected) << toString(c.stepper);
    EXPECT_LT(distance(coarse.sample, exact), 1e-6) << toString(c.stepper);
    EXPECT_LT(distance(fine.sample, exact), 1e-9) << toString(c.stepper);
  }
}

// A Radau IIA method is known by its order conditions: B(2s - 1) and C(s) (Hairer, Wanner: Solving
// ODE II, IV.5), and by where its stages lie, the last one at the end.
TEST(RadauTables, MeetTheOrderConditions) {
  for (const vs_radau& method : vs_radau_of) {
    const int s = method.stages;
    EXPECT_EQ(method.point[s - 1], 1.0);
    for (int i = 0; i < s; ++i) {
      const int order = i == s - 1 ? 2 * s - 1 : s;  // the last row is the weights
      for (int k = 1; k <= order; ++k) {
        double sum = 0.0;
        for (int j = 0; j < s; ++j) sum += method.A[i][j] * std::pow(method.point[j], k - 1);
        EXPECT_NEAR(sum, std::pow(method.point[i], k) / k, 1e-15) << s << ", " << k;
      }
    }
  }
}

// A^2, A^-1, and T^-1 A^-1 T, which is one real number and pairs.
TEST(RadauTables, TakeTheirStagesApart) {
  for (const vs_radau& method : vs_radau_of) {
    const int s = method.stages;
    const auto expected = [&](int a, int b) {
      if (a == 0 || b == 0) return a == b ? method.real : 0.0;
      if ((a - 1) / 2 != (b - 1) / 2) return 0.0;
      const double* const pair = method.pair[(a - 1) / 2];
      return a == b ? pair[0] : a < b ? -pair[1] : pair[1];
    };
    for (int a = 0; a < s; ++a) {
      for (int b = 0; b < s; ++b) {
        double block = 0.0;
        double unit = 0.0;
        double square = 0.0;
        for (int i = 0; i < s; ++i) {
          unit += method.A[a][i] * method.inverse[i][b];
          square += method.A[a][i] * method.A[i][b];
          for (int j = 0; j < s; ++j) {
            block += method.from_T[a][i] * method.inverse[i][j] * method.T[j][b];
          }
        }
        EXPECT_NEAR(block, expected(a, b), 1e-12) << s;
        EXPECT_NEAR(unit, a == b ? 1.0 : 0.0, 1e-13) << s;
        EXPECT_NEAR(square, method.A2[a][b], 1e-15) << s;
      }
    }
  }
}

// The coefficients have to reproduce a polynomial of degree s, inside the step and beyond.
TEST(RadauTables, LeadPolynomialsThroughTheStages) {
  for (const vs_radau& method : vs_radau_of) {
    const int s = method.stages;
    for (const double theta : {0.0, 0.3, 1.0, 1.7}) {
      double value = 0.0;
      for (int n = s - 1; n >= 0; --n) {
        double coefficient = 0.0;
        for (int j = 0; j < s; ++j) {
          coefficient += method.B[n][j] * std::pow(method.point[j], s);
        }
        value = (value + coefficient) * theta;
      }
      EXPECT_NEAR(value, std::pow(theta, s), 1e-11) << s;
    }
  }
}

}  // namespace
}  // namespace variator_sim
