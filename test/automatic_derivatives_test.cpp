// Numbers that carry derivatives against long double differences and against each other, and
// constraints written with them against the formula component, whose derivatives are symbolic.
#include "variator_sim/automatic_derivatives.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/derivatives_by_state.h"
#include "variator_sim/constraints/automatic_constraint.h"
#include "variator_sim/constraints/expression_constraint.h"

namespace variator_sim {
namespace {

/// Every function there is, once for numbers with derivatives and once in long double.
struct Everything {
  template <class T>
  static std::vector<T> all(const T& x) {
    return {sin(x),
            cos(x),
            tan(x),
            asin(0.5 * x),
            acos(0.5 * x),
            atan(x),
            sinh(x),
            cosh(x),
            tanh(x),
            exp(x),
            expm1(x),
            log(x),
            log1p(x),
            sqrt(x),
            pow(x, 2.7),
            pow(x, x + 1.0),
            abs(x - 2.0),
            atan2(x, 1.0 - x),
            atan2(x - 2.0, -x),
            max(x * x, 0.1),
            max(x * x, 0.2 * x),
            min(x * x, 100.0),
            min(x * x, 4.0 * x),
            3.0 / x,
            x / 3.0,
            x / (1.0 + x),
            -(2.0 - x) * x + 1.0,
            +x - 1.0 + x * 3.0 + (1.0 + x) * (x - 0.5 * x)};
  }
};
long double pow2(long double a, long double b) {
  return std::pow(a, b);
}
std::vector<long double> allWide(long double x) {
  return {std::sin(x),
          std::cos(x),
          std::tan(x),
          std::asin(0.5L * x),
          std::acos(0.5L * x),
          std::atan(x),
          std::sinh(x),
          std::cosh(x),
          std::tanh(x),
          std::exp(x),
          std::expm1(x),
          std::log(x),
          std::log1p(x),
          std::sqrt(x),
          pow2(x, 2.7),
          pow2(x, x + 1.0L),
          std::abs(x - 2.0L),
          std::atan2(x, 1.0L - x),
          std::atan2(x - 2.0L, -x),
          x * x,
          x * x,
          x * x,
          x * x,
          3.0L / x,
          x / 3.0L,
          x / (1.0L + x),
          -(2.0L - x) * x + 1.0L,
          x - 1.0L + x * 3.0L + (1.0L + x) * (x - 0.5L * x)};
}

TEST(AutomaticDerivatives, OfEveryFunctionAreThoseOfTheFunction) {
  for (const double x : {0.7, 1.3}) {
    const long double h = 1e-4L;
    const auto value = allWide(x);
    const auto p1 = allWide(x + h);
    const auto m1 = allWide(x - h);
    const auto p2 = allWide(x + 2 * h);
    const auto m2 = allWide(x - 2 * h);

    Dual<2> dual(x);
    dual.derivative = {1.0, -3.0};
    Dual<1, Dual<1>> nested(x);
    nested.value.derivative[0] = 1.0;
    nested.derivative[0].value = 1.0;
    Curve<1> curve(x);  // x(t) = x + 2 t + 5 t^2 / 2
    curve.first = 2.0;
    curve.second = 5.0;
    curve.gradient[0] = 1.0;
    // along x + t + s at s = 0: the third derivative
    Dual<1, Curve<1>> third(x);
    third.value.first = 1.0;
    third.value.gradient[0] = 1.0;
    third.derivative[0].value = 1.0;
    const auto duals = Everything::all(dual);
    const auto nesteds = Everything::all(nested);
    const auto curves = Everything::all(curve);
    const auto thirds = Everything::all(third);
    const auto plain = Everything::all(Dual<0>(x));
    ASSERT_EQ(duals.size(), value.size());
    for (std::size_t n = 0; n < value.size(); ++n) {
      SCOPED_TRACE(std::to_string(n) + " at " + std::to_string(x));
      const auto first = static_cast<double>((m2[n] - 8 * m1[n] + 8 * p1[n] - p2[n]) / (12 * h));
      const auto second = static_cast<double>(
          (-m2[n] + 16 * m1[n] - 30 * value[n] + 16 * p1[n] - p2[n]) / (12 * h * h));
      const double scale = std::max({1.0, std::abs(first), std::abs(second)});
      const auto exact = static_cast<double>(value[n]);
      EXPECT_NEAR(plain[n].value, exact, 1e-14 * scale);
      EXPECT_NEAR(duals[n].value, exact, 1e-14 * scale);
      EXPECT_NEAR(duals[n].derivative[0], first, 1e-12 * scale);
      EXPECT_NEAR(duals[n].derivative[1], -3.0 * first, 1e-12 * scale);
      EXPECT_NEAR(nesteds[n].value.derivative[0], first, 1e-12 * scale);
      EXPECT_NEAR(nesteds[n].derivative[0].value, first, 1e-12 * scale);
      EXPECT_NEAR(nesteds[n].derivative[0].derivative[0], second, 1e-9 * scale);
      EXPECT_NEAR(curves[n].value, exact, 1e-14 * scale);
      EXPECT_NEAR(curves[n].first, 2.0 * first, 1e-12 * scale);
      EXPECT_NEAR(curves[n].second, 5.0 * first + 4.0 * second, 1e-8 * scale);
      EXPECT_NEAR(curves[n].gradient[0], first, 1e-12 * scale);
      const auto at = [&](int k) { return allWide(x + 1e-3L * k)[n]; };
      const auto expected_third = static_cast<double>(
          (at(-3) - 8 * at(-2) + 13 * at(-1) - 13 * at(1) + 8 * at(2) - at(3)) / 8e-9L);
      EXPECT_NEAR(thirds[n].derivative[0].value, first, 1e-12 * scale);
      EXPECT_NEAR(thirds[n].derivative[0].first, second, 1e-9 * scale);
      EXPECT_NEAR(thirds[n].derivative[0].gradient[0], second, 1e-9 * scale);
      EXPECT_NEAR(thirds[n].derivative[0].second, expected_third,
                  1e-7 * std::max(scale, std::abs(expected_third)));
    }
  }
}

TEST(AutomaticDerivatives, PowersExistAtZeroAndKinksGiveNoNan) {
  Dual<1> zero(0.0);
  zero.derivative[0] = 1.0;
  EXPECT_EQ(pow(zero, 0.0).derivative[0], 0.0);
  EXPECT_EQ(pow(zero, 1.0).derivative[0], 1.0);
  EXPECT_EQ(pow(zero, 2.0).derivative[0], 0.0);
  EXPECT_EQ(abs(zero).derivative[0], 0.0);
  Dual<1, Curve<1>> third(0.0);
  third.value.first = 1.0;
  third.derivative[0].value = 1.0;
  EXPECT_EQ(pow(third, 0.0).derivative[0].second, 0.0);
  EXPECT_EQ(pow(third, 1.0).derivative[0].second, 0.0);
  EXPECT_EQ(pow(third, 2.0).derivative[0].second, 0.0);
  EXPECT_EQ(pow(third, 3.0).derivative[0].second, 6.0);
}

TEST(AutomaticDerivatives, ComposeTakesAFunctionKnownAtAPoint) {
  Curve<1> x(0.4);
  x.first = 2.0;
  x.second = -1.0;
  x.gradient[0] = 3.0;
  const auto direct = sin(x);
  const auto composed = compose(x, std::sin(0.4), std::cos(0.4), -std::sin(0.4));
  EXPECT_EQ(composed.second, direct.second);
  EXPECT_EQ(composed.gradient[0], direct.gradient[0]);
  const double g[] = {std::sin(0.4), std::cos(0.4), -std::sin(0.4)};
  EXPECT_EQ(compose(x, g).second, direct.second);

  Dual<1, Curve<1>> y(0.4);
  y.value.first = 2.0;
  y.derivative[0].value = 1.0;
  EXPECT_EQ(compose(y, g[0], g[1], g[2], -g[1]).derivative[0].second, sin(y).derivative[0].second);
  EXPECT_TRUE(std::isnan(compose(y, g).derivative[0].second)) << "a third derivative of nothing";
}

// ---------------------------------------------------------------------------------- constraints

/// The same formula of every order, on shafts 3 and 1 of three.
template <int Order>
class Formula : public AutomaticConstraint<Formula<Order>, Order> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T* p = x.angle;
    const T* w = x.velocity;
    const T common = sin(x.time) * p[1] * w[0] * w[0] + exp(-p[0]) * w[1];
    if constexpr (Order == 1) return common;
    const T* e = x.acceleration;
    if constexpr (Order == 2) return common + e[0] * e[0] * e[1] * w[1] + tanh(e[1]) * x.time;
    const T* j = x.jerk;
    return common + e[0] * e[1] * j[0] + cos(w[0]) * j[1] + e[0] * e[0];
  }

 protected:
  void doConfigure(ComponentContext& /*context*/) override { this->useShafts({2, 0}); }
};

const char* const kFormulas[] = {"sin(t)*phi1*w3^2+exp(-phi3)*w1",
                                 "sin(t)*phi1*w3^2+exp(-phi3)*w1+e3^2*e1*w1+tanh(e1)*t",
                                 "sin(t)*phi1*w3^2+exp(-phi3)*w1+e3*e1*j3+cos(w3)*j1+e3^2"};

void configure(Constraint& constraint, const ParameterTree& tree) {
  ParameterReader reader(tree, "it");
  const std::vector<std::string> shafts{"a", "b", "c"};
  std::vector<CommandInputSettings> inputs;
  ComponentContext context("it", reader, shafts, inputs);
  constraint.configure(context);
}

template <int Order>
void expectSame() {
  Formula<Order> automatic;
  ExpressionConstraint symbolic;
  configure(automatic, ParameterTree::dictionary());
  configure(symbolic,
            ParameterTree::dictionary({{"order", ParameterTree::integer(Order)},
                                       {"expression", ParameterTree::text(kFormulas[Order - 1])}}));
  EXPECT_EQ(automatic.order(), Order);
  EXPECT_FALSE(automatic.readsInputs());
  const double angle[] = {0.3, 7.0, -0.8};
  const double velocity[] = {1.7, 7.0, -2.1};
  const double acceleration[] = {0.6, 7.0, 1.4};
  const StateView x{0.9, angle, velocity, acceleration, nullptr, nullptr};
  const auto expectEqual = [](const double* a, const double* b, int count, const char* what) {
    for (int i = 0; i < count; ++i) EXPECT_NEAR(a[i], b[i], 1e-13) << what << ' ' << i;
  };
  double C[2][3];
  double c0[2];
  automatic.calcRow(x, C[0], &c0[0]);
  symbolic.calcRow(x, C[1], &c0[1]);
  expectEqual(C[0], C[1], 3, "C");
  EXPECT_NEAR(c0[0], c0[1], 1e-12);
  double D[2][3];
  double H[2][9];
  automatic.calcHessian(x, H[0]);
  symbolic.calcHessian(x, H[1]);
  expectEqual(H[0], H[1], 9, "H");
  automatic.calcJacobianRate(x, D[0], H[0]);
  symbolic.calcJacobianRate(x, D[1], H[1]);
  expectEqual(D[0], D[1], 3, "D");
  expectEqual(H[0], H[1], 9, "H beside D");
  double dC[2][27];
  double dc0[2][9];
  automatic.calcRowDerivatives(x, dC[0], dc0[0]);
  symbolic.calcRowDerivatives(x, dC[1], dc0[1]);
  expectEqual(dC[0], dC[1], 27, "dC");
  for (int q = 0; q < 9; ++q) EXPECT_NEAR(dc0[0][q], dc0[1][q], 1e-12) << "dc0 " << q;
  if (Order == 3) return;
  EXPECT_NEAR(automatic.calcResidual(x), symbolic.calcResidual(x), 1e-14);
  EXPECT_NEAR(automatic.calcResidualAndJacobian(x, C[0]), symbolic.calcResidualAndJacobian(x, C[1]),
              1e-13);
  expectEqual(C[0], C[1], 3, "C beside the residual");
  if (Order == 1) {
    EXPECT_NEAR(automatic.calcVelocityResidualAndJacobian(x, C[0]),
                symbolic.calcVelocityResidualAndJacobian(x, C[1]), 1e-14);
    expectEqual(C[0], C[1], 3, "C beside f");
  }
  ConstraintPartials partials[2];
  automatic.calcPartials(x, partials[0]);
  symbolic.calcPartials(x, partials[1]);
  EXPECT_NEAR(partials[0].time, partials[1].time, 1e-14);
  expectEqual(partials[0].angle, partials[1].angle, 3, "angle");
  expectEqual(partials[0].velocity, partials[1].velocity, 3, "velocity");
  expectEqual(partials[0].acceleration, partials[1].acceleration, 3, "acceleration");
}

TEST(AutomaticConstraint, IsTheFormulaOfOrder1) {
  expectSame<1>();
}
TEST(AutomaticConstraint, IsTheFormulaOfOrder2) {
  expectSame<2>();
}
TEST(AutomaticConstraint, IsTheFormulaOfOrder3) {
  expectSame<3>();
}

/// f = w2 - sin(w1) phi1, sin with or without its third derivative.
class Composed : public AutomaticConstraint<Composed, 1> {
 public:
  explicit Composed(bool knows_third) : knows_third_(knows_third) {}
  template <class T>
  T residual(const GenericState<T>& x) const {
    const double w = realPart(x.velocity[0]);
    const T sine =
        knows_third_ ? compose(x.velocity[0], std::sin(w), std::cos(w), -std::sin(w), -std::cos(w))
                     : compose(x.velocity[0], std::sin(w), std::cos(w), -std::sin(w));
    return x.velocity[1] - sine * x.angle[0];
  }

 protected:
  void doConfigure(ComponentContext& /*context*/) override {}

 private:
  bool knows_third_;
};

TEST(AutomaticConstraint, TakesDifferencesWhereAThirdDerivativeIsMissing) {
  Composed exact(true);
  Composed differences(false);
  configure(exact, ParameterTree::dictionary());
  configure(differences, ParameterTree::dictionary());
  const double angle[] = {0.3, 7.0, -0.8};
  const double velocity[] = {1.7, 7.0, -2.1};
  const double acceleration[] = {0.6, 7.0, 1.4};
  const StateView x{0.9, angle, velocity, acceleration, nullptr, nullptr};
  test::expectRowDerivatives(exact, x, 1e-2, 1e-12);
  test::expectRowDerivatives(differences, x, 1e-2, 1e-8);
}

class Wrong : public AutomaticConstraint<Wrong> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    return x.acceleration[0] - x.acceleration[1];
  }

 protected:
  void doConfigure(ComponentContext& /*context*/) override { useShafts({0, 1, 2}); }
};

TEST(AutomaticConstraint, RefusesAnotherNumberOfShafts) {
  Wrong constraint;
  EXPECT_THROW(configure(constraint, ParameterTree::dictionary()), std::logic_error);
}

}  // namespace
}  // namespace variator_sim
