// The jerk at the start of scenes against four other ways to it: the full KKT system, the paper's
// [12] with [15], the null-space form [10], and the stationarity of S1 [16].
#include <Eigen/Dense>
#include <random>

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::plainly;

// For matrices of at most so many rows Eigen compiles loops and no blocked products: in a third of
// the time.
constexpr int kMost = 16;
template <class Scalar>
using Small = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
template <class Scalar>
using SmallColumn = Eigen::Matrix<Scalar, Eigen::Dynamic, 1, 0, kMost, 1>;
using Matrix = Small<long double>;
using Vector = SmallColumn<long double>;

/// One random problem: J, C, c0 and the applied torques' rate.
struct Problem {
  Small<double> J;
  Small<double> C;
  SmallColumn<double> c0;
  SmallColumn<double> torque_rate;
};

Problem makeProblem(std::mt19937& random, int s, int k, bool coupled) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Problem problem{Small<double>::Zero(s, s), Small<double>(k, s), SmallColumn<double>(k),
                  SmallColumn<double>(s)};
  for (int i = 0; i < s; ++i) problem.J(i, i) = std::pow(10.0, uniform(random));
  if (coupled) {
    Small<double> half(s, s);
    for (int i = 0; i < s * s; ++i) half.data()[i] = 0.3 * uniform(random);
    problem.J += half * half.transpose();
  }
  for (int i = 0; i < s * k; ++i) problem.C.data()[i] = 5.0 * uniform(random);
  for (int m = 0; m < k; ++m) problem.c0(m) = 10.0 * uniform(random);
  for (int i = 0; i < s; ++i) problem.torque_rate(i) = 10.0 * uniform(random);
  return problem;
}

/// The scene of a problem: constraints C eta + c0 = 0 and torques that begin with their rates.
std::string sceneOf(const Problem& problem) {
  std::string shafts;
  std::string coupling;
  std::vector<std::string> elements;
  const auto S = static_cast<int>(problem.J.rows());
  const auto name = [](int i) { return std::string("s") + std::to_string(i); };
  for (int i = 0; i < S; ++i) {
    shafts += (i > 0 ? ", " : "") + name(i) + " " + plainly(problem.J(i, i));
    elements.push_back("q" + std::to_string(i) + " on " + name(i) + ": t*(" +
                       plainly(problem.torque_rate(i)) + ")");
    for (int n = 0; n < i; ++n) {
      if (problem.J(i, n) == 0.0) continue;
      coupling += (coupling.empty() ? "[" : ", [") + name(n) + ", " + name(i) + ", " +
                  plainly(problem.J(i, n)) + "]";
    }
  }
  for (int m = 0; m < problem.C.rows(); ++m) {
    std::string row = plainly(problem.c0(m));
    for (int i = 0; i < S; ++i) {
      row += "+(" + plainly(problem.C(m, i)) + ")*j" + std::to_string(i + 1);
    }
    elements.push_back("c" + std::to_string(m) + " of order 3: " + row);
  }
  return test::sceneText(shafts, elements,
                         "verify_derivatives: false\n" +
                             (coupling.empty() ? "" : "inertia_coupling: [" + coupling + "]\n"));
}

/// eta and Lambda by the code under test. False where the motion does not begin.
bool solve(const Problem& problem, Vector* eta, Vector* Lambda) {
  Simulation simulation(test::sceneFromText(sceneOf(problem)));
  const Sample& sample = simulation.sample();
  if (!simulation.status().ok()) return false;
  const auto S = static_cast<int>(problem.J.rows());
  const auto k = static_cast<int>(problem.C.rows());
  SmallColumn<double> torque_rate = problem.torque_rate;  // and that of the reaction
  for (int i = 0; i < S; ++i) torque_rate(i) += sample.reaction_torque_rate[i];
  *eta = Small<double>(problem.J.inverse() * torque_rate).cast<long double>();
  Lambda->resize(k);
  for (int m = 0; m < k; ++m) (*Lambda)(m) = sample.multiplier[m];
  return true;
}

/// A solution of A x = b. (One function, since the compiler takes seconds for each of these.)
Vector solveLinear(const Matrix& A, const Vector& b) {
  return A.fullPivLu().solve(b);
}

/// [J -C^T; C 0] (eta, Lambda) = (Q', -c0).
Vector solveKkt(const Problem& problem) {
  const Eigen::Index s = problem.J.rows();
  const Eigen::Index k = problem.C.rows();
  Matrix K = Matrix::Zero(s + k, s + k);
  Vector b(s + k);
  K.topLeftCorner(s, s) = problem.J.cast<long double>();
  K.topRightCorner(s, k) = -problem.C.transpose().cast<long double>();
  K.bottomLeftCorner(k, s) = problem.C.cast<long double>();
  b << problem.torque_rate.cast<long double>(), -problem.c0.cast<long double>();
  return solveLinear(K, b);
}

/// A basis h of the jerks with C h = 0, s x (s - k).
Matrix calcNullSpace(const Problem& problem) {
  return Matrix(problem.C.cast<long double>()).fullPivLu().kernel();
}

double calcTolerance(const Problem& problem, const Vector& eta) {
  // A's condition number amplifies rounding.
  const Small<double> A = problem.C * problem.J.inverse() * problem.C.transpose();
  const SmallColumn<double> values = A.selfadjointView<Eigen::Lower>().eigenvalues();
  const double condition = values.maxCoeff() / values.minCoeff();
  return 1e-14 * condition * (1.0 + static_cast<double>(eta.cwiseAbs().maxCoeff()));
}

void compareAllForms(int S, bool coupled) {
  std::mt19937 random(20260000U + static_cast<unsigned>(S) + (coupled ? 100U : 0U));
  for (int k = 1; k < S; ++k) {
    for (int trial = 0; trial < 8; ++trial) {
      const Problem problem = makeProblem(random, S, k, coupled);
      Vector eta;
      Vector Lambda;
      ASSERT_TRUE(solve(problem, &eta, &Lambda));
      const double tolerance = calcTolerance(problem, eta);
      SCOPED_TRACE(testing::Message() << "s = " << S << ", k = " << k << ", trial " << trial);

      const Vector kkt = solveKkt(problem);
      for (int i = 0; i < S; ++i) ASSERT_NEAR(double(eta(i)), double(kkt(i)), tolerance);
      const double lambda_scale = 1.0 + double(kkt.tail(k).cwiseAbs().maxCoeff());
      for (int m = 0; m < k; ++m) {
        ASSERT_NEAR(double(Lambda(m)), double(kkt(S + m)), tolerance * lambda_scale);
      }

      // [10]: (J eta - Q') . h = 0 for every h with C h = 0, and the constraint itself [12].
      const Matrix h = calcNullSpace(problem);
      const Matrix J = problem.J.cast<long double>();
      Matrix rows(S, S);
      Vector right(S);
      rows.topRows(S - k) = h.transpose() * J;
      right.head(S - k) = h.transpose() * problem.torque_rate.cast<long double>();
      rows.bottomRows(k) = problem.C.cast<long double>();
      right.tail(k) = -problem.c0.cast<long double>();
      const Vector null_space = solveLinear(rows, right);
      for (int i = 0; i < S; ++i) ASSERT_NEAR(double(eta(i)), double(null_space(i)), tolerance);

      // [16]: S1 = eta^T J eta / 2 - Q'^T eta, only evaluated, over eta = particular + h y. S1 is
      // quadratic in y, so its central differences of unit step are its exact derivatives.
      const Vector particular = solveLinear(problem.C.cast<long double>(), right.tail(k));
      const Vector rate = problem.torque_rate.cast<long double>();
      const auto S1 = [&](const Vector& y) {
        const Vector jerk = particular + h * y;
        return jerk.dot(J * jerk) / 2 - rate.dot(jerk);
      };
      const int l = S - k;
      Vector gradient(l);
      Matrix hessian(l, l);
      const Matrix unit = Matrix::Identity(l, l);
      for (int a = 0; a < l; ++a) {
        gradient(a) = (S1(unit.col(a)) - S1(-unit.col(a))) / 2;
        for (int b = 0; b < l; ++b) {
          hessian(a, b) = (S1(unit.col(a) + unit.col(b)) - S1(unit.col(a) - unit.col(b)) -
                           S1(unit.col(b) - unit.col(a)) + S1(-unit.col(a) - unit.col(b))) /
                          4;
        }
      }
      const Vector stationary = particular - h * solveLinear(hessian, gradient);
      for (int i = 0; i < S; ++i) ASSERT_NEAR(double(eta(i)), double(stationary(i)), tolerance);
    }
  }
}

TEST(Principle, AgreesWithAllFormsForDiagonalInertia) {
  compareAllForms(2, false);
  compareAllForms(3, false);
  compareAllForms(5, false);
  compareAllForms(8, false);
}

TEST(Principle, AgreesWithAllFormsForCoupledInertia) {
  compareAllForms(2, true);
  compareAllForms(4, true);
  compareAllForms(8, true);
}

// [15] multiplied by c2, so that c2 = 0 is a case like any other:
//   c2 J1 eta1 - c1 J2 eta2 = c2 M1' + c1 M2',   c1 eta1 + c2 eta2 = -c0,
// with Q1' = M1', Q2' = -M2'.
void expectEquation15(const Problem& problem) {
  Vector eta;
  Vector Lambda;
  ASSERT_TRUE(solve(problem, &eta, &Lambda));
  const long double c1 = problem.C(0, 0);
  const long double c2 = problem.C(0, 1);
  Matrix rows(2, 2);
  rows << c2 * problem.J(0, 0), -c1 * problem.J(1, 1), c1, c2;
  Vector right(2);
  right << c2 * problem.torque_rate(0) - c1 * problem.torque_rate(1), -problem.c0(0);
  const Vector paper = solveLinear(rows, right);
  const double scale = 1.0 + double(paper.cwiseAbs().maxCoeff());
  EXPECT_NEAR(double(eta(0)), double(paper(0)), 1e-13 * scale);
  EXPECT_NEAR(double(eta(1)), double(paper(1)), 1e-13 * scale);
}

TEST(Principle, IsEquation15ForTwoShafts) {
  std::mt19937 random(15);
  for (int trial = 0; trial < 50; ++trial) expectEquation15(makeProblem(random, 2, 1, false));
}

TEST(Principle, IsRegularWhereC2OrC1IsZero) {
  std::mt19937 random(16);
  for (int trial = 0; trial < 50; ++trial) {
    Problem problem = makeProblem(random, 2, 1, false);
    problem.C(0, trial % 2) = 0.0;
    expectEquation15(problem);
  }
}

// Multiplying psi by a constant may not change the motion.
TEST(Principle, DoesNotDependOnTheScaleOfTheConstraint) {
  std::mt19937 random(17);
  for (int trial = 0; trial < 20; ++trial) {
    const Problem problem = makeProblem(random, 4, 2, true);
    Vector eta;
    Vector Lambda;
    ASSERT_TRUE(solve(problem, &eta, &Lambda));
    for (double scale : {1e-12, 1e12}) {
      Problem scaled = problem;
      scaled.C.row(1) *= scale;
      scaled.c0(1) *= scale;
      Vector scaled_eta;
      ASSERT_TRUE(solve(scaled, &scaled_eta, &Lambda));
      const double tolerance = calcTolerance(problem, eta);
      for (int i = 0; i < 4; ++i) {
        EXPECT_NEAR(double(scaled_eta(i)), double(eta(i)), tolerance);
      }
    }
  }
}

TEST(Principle, RefusesDependentRows) {
  std::mt19937 random(18);
  Problem problem = makeProblem(random, 3, 2, false);
  problem.C.row(1) = -3.0 * problem.C.row(0);
  Vector eta;
  Vector Lambda;
  EXPECT_FALSE(solve(problem, &eta, &Lambda));
}

}  // namespace
}  // namespace variator_sim
