// The constraint and the torque that a scene states as formulas: what they compute, and what they
// say about formulas and parameters that are wrong.
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A component named "it", of its keys in YAML.
template <typename Component>
std::shared_ptr<Component> configured(const std::string& keys,
                                      const std::vector<std::string>& shafts = {"drive", "load"}) {
  const ParameterTree tree = readYamlText("{" + keys + "}", "test");
  ParameterReader reader(tree, "it");
  std::vector<CommandInputSettings> inputs;
  LawContext context("it", reader, shafts, inputs);
  auto component = std::make_shared<Component>();
  component->configure(context);
  reader.finish();
  return component;
}

/// `more`: further keys, behind a comma.
std::shared_ptr<ExpressionConstraint> constraintOf(const std::string& formula,
                                                   const std::string& more = "", int order = 2,
                                                   const std::vector<std::string>& shafts = {
                                                       "drive", "load"}) {
  return configured<ExpressionConstraint>(
      "order: " + std::to_string(order) + ", expression: \"" + formula + "\"" + more, shafts);
}

std::shared_ptr<ExpressionTorque> torqueOf(const std::string& formula, const std::string& more = "",
                                           const std::string& shaft = "load") {
  return configured<ExpressionTorque>("shaft: " + shaft + ", torque: \"" + formula + "\"" + more);
}

/// A state of two shafts with nothing special about it.
struct State {
  double angle[2] = {0.7, -0.4};
  double velocity[2] = {5.0, 2.9};
  double acceleration[2] = {8.78, 6.02};
  StateView view = {1.3, angle, velocity, acceleration, nullptr, nullptr};
};

const char* const kShip =
    "tau*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + w2-(0.6+0.2*sin(0.7*t))*w1";

// -------------------------------------------------------------------------------------- constraint

TEST(ExpressionConstraint, ComputesTheRowOfAVariator) {
  const auto constraint = constraintOf(kShip, ", parameters: {tau: 0.2}");
  const State s;
  const double tau = 0.2;
  const double u = 0.6 + 0.2 * std::sin(0.7 * 1.3);
  const double u_rate = 0.2 * 0.7 * std::cos(0.7 * 1.3);
  const double e1 = s.acceleration[0];
  const double e2 = s.acceleration[1];
  const double slip_rate = e2 - u * e1;
  const double stiffening = 1.0 + 0.05 * (e1 * e1 + e2 * e2);
  const double psi = tau * slip_rate * stiffening + s.velocity[1] - u * s.velocity[0];
  const double c1 = tau * (-u * stiffening + slip_rate * 0.1 * e1);
  const double c2 = tau * (stiffening + slip_rate * 0.1 * e2);
  const double psi_t = -tau * u_rate * e1 * stiffening - u_rate * s.velocity[0];
  const double c0_expected = psi_t - u * e1 + e2;

  EXPECT_NEAR(constraint->calcResidual(s.view), psi, 1e-14);
  double C[2] = {kNan, kNan};
  double c0 = kNan;
  constraint->calcRow(s.view, C, &c0);
  EXPECT_NEAR(C[0], c1, 1e-14);
  EXPECT_NEAR(C[1], c2, 1e-14);
  EXPECT_NEAR(c0, c0_expected, 1e-14);
  double C_again[2] = {kNan, kNan};
  EXPECT_EQ(constraint->calcResidualAndJacobian(s.view, C_again), constraint->calcResidual(s.view));
  EXPECT_NEAR(C_again[0], c1, 1e-14);
  EXPECT_NEAR(C_again[1], c2, 1e-14);
  EXPECT_EQ(constraint->nonlinearAccelerations(), 3U);
  EXPECT_FALSE(constraint->readsInputs());

  // H = d2psi/de2 of tau (e2 - u e1)(1 + 0.05 (e1^2 + e2^2))
  double H[4] = {kNan, kNan, kNan, kNan};
  constraint->calcHessian(s.view, H);
  EXPECT_NEAR(H[0], tau * (-u * 0.2 * e1 + 0.1 * slip_rate), 1e-14);
  EXPECT_NEAR(H[1], tau * (-u * 0.1 * e2 + 0.1 * e1), 1e-14);
  EXPECT_EQ(H[1], H[2]);
  EXPECT_NEAR(H[3], tau * (0.2 * e2 + 0.1 * slip_rate), 1e-14);
}

TEST(ExpressionConstraint, RowIsComposedOfThePartials) {
  const auto constraint = constraintOf("e1*cos(phi1)*t^2 + a*phi2*w1*e2^3 + exp(0.1*w2) + e2*t",
                                       ", parameters: {a: 0.3}");
  const State s;
  using expression::Source;
  const auto partial = [&](Source source, int i = 0) {
    expression::Graph& graph = constraint->graph();
    const expression::Node slope = graph.differentiate(constraint->function(), slotOf(source, i));
    return expression::Tape(graph, {slope}).evaluate(s.view)[0];
  };
  const double t = s.view.time;
  const double e2 = s.acceleration[1];
  EXPECT_NEAR(partial(Source::kTime), 2 * t * s.acceleration[0] * std::cos(s.angle[0]) + e2, 1e-13);
  EXPECT_NEAR(partial(Source::kAngle, 0), -s.acceleration[0] * std::sin(s.angle[0]) * t * t, 1e-13);
  EXPECT_NEAR(partial(Source::kAngle, 1), 0.3 * s.velocity[0] * e2 * e2 * e2, 1e-12);
  EXPECT_NEAR(partial(Source::kVelocity, 0), 0.3 * s.angle[1] * e2 * e2 * e2, 1e-12);
  EXPECT_NEAR(partial(Source::kVelocity, 1), 0.1 * std::exp(0.1 * s.velocity[1]), 1e-14);

  double C[2] = {};
  double c0 = 0.0;
  constraint->calcRow(s.view, C, &c0);
  EXPECT_NEAR(C[0], std::cos(s.angle[0]) * t * t, 1e-13);
  EXPECT_NEAR(C[1], 0.9 * s.angle[1] * s.velocity[0] * e2 * e2 + t, 1e-12);
  double c0_composed = partial(Source::kTime);
  for (int i = 0; i < 2; ++i) {
    c0_composed += partial(Source::kAngle, i) * s.velocity[i] +
                   partial(Source::kVelocity, i) * s.acceleration[i];
  }
  EXPECT_NEAR(c0, c0_composed, 1e-10);
}

TEST(ExpressionConstraint, KnowsWhenItIsLinearInTheAcceleration) {
  const auto is_linear = [](const std::string& formula) {
    const auto constraint = constraintOf(formula);
    double H[4] = {kNan, kNan, kNan, kNan};
    constraint->calcHessian(State().view, H);
    for (const double entry : H) {
      EXPECT_TRUE(std::isfinite(entry));
      EXPECT_TRUE(entry == 0.0 || constraint->nonlinearAccelerations() != 0);
    }
    return constraint->nonlinearAccelerations() == 0;
  };
  EXPECT_TRUE(is_linear("e2 + 0.1*e1"));
  EXPECT_TRUE(is_linear("0.2*(e2 - sin(t)*e1*w1^2) + w2 - phi1*w1"));
  EXPECT_TRUE(is_linear("10*w1*e1 + 100*w2*e2 - 3*t"));
  EXPECT_FALSE(is_linear("e1^2 + e2^2 - 4"));
  EXPECT_FALSE(is_linear("e1*e2 - 1"));
  EXPECT_FALSE(is_linear("e1 + w1*sin(e2)"));
  // Linear in pieces only, though every second derivative is zero.
  for (const char* formula : {"e2 - abs(e1)", "e2 + max(e1, w1)", "e1 - min(e2, 3*e1)",
                              "e2 - e1*sign(e1 - 1)", "e2 + sign(e1)", "e2*sign(e1 + w1) - 1"}) {
    EXPECT_FALSE(is_linear(formula)) << formula;
  }
  EXPECT_TRUE(is_linear("e2 - abs(w1)*e1 + max(t, 1)"));
}

// A ratio that is switched by a steep logistic: its exp overflows long before, nearly overflows
// shortly before, and the row is that of the ratio in force.
TEST(ExpressionConstraint, HasARowWhereAnExponentialOverflows) {
  const auto constraint = constraintOf("w2-w1*(0.4+0.3/(1+exp(-(t-1)*1e6)))", "", 1);
  for (const double time : {0.0, 1.0 - 7.096e-4, 1.0 - 7.05e-4, 1.0 - 1e-4, 1.001, 3.0}) {
    State s;
    s.view.time = time;
    const double ratio = time < 1.0 ? 0.4 : 0.7;
    double C[2] = {};
    double c0 = 0.0;
    constraint->calcRow(s.view, C, &c0);
    EXPECT_NEAR(C[0], -ratio, 1e-14) << time;
    EXPECT_EQ(C[1], 1.0) << time;
    EXPECT_NEAR(c0, 0.0, 1e-20) << time;
  }
}

TEST(ExpressionConstraint, TakesNumbersAsTexts) {
  const auto constraint = constraintOf("a*e1 - w1", ", parameters: {a: '1e-3'}");
  EXPECT_NEAR(constraint->calcResidual(State().view), 1e-3 * 8.78 - 5.0, 1e-15);
}

TEST(ExpressionConstraint, KnowsItsKinksInTheAccelerations) {
  State s;
  const auto constraint =
      constraintOf("e2 - abs(e1 - w1) + max(e1, 2*e2) + abs(w1) + sign(e1) + abs(sign(e2))");
  ASSERT_EQ(constraint->kinks().size(), 2U);
  for (const ConstraintPtr& kink : constraint->kinks()) {
    double C[2] = {kNan, kNan};
    const double value = kink->calcResidualAndJacobian(s.view, C);
    const double e1 = s.view.acceleration[0];
    const double e2 = s.view.acceleration[1];
    if (C[1] == 0.0) {
      EXPECT_EQ(value, e1 - s.view.velocity[0]);
      EXPECT_EQ(C[0], 1.0);
    } else {
      EXPECT_EQ(value, e1 - 2.0 * e2);
      EXPECT_EQ(C[0], 1.0);
      EXPECT_EQ(C[1], -2.0);
    }
  }
}

TEST(ExpressionConstraint, OfOrder3IsLinearInTheJerks) {
  for (const char* linear :
       {"sign(w1)*j2 - abs(e1)*j1 - min(w1, w2)", "-(j1 + 2*(j2 - t))/(1 + w1^2)",
        "j2^1 - pow(j1, 1)", "j1*exp(w2)/sin(t) - (j2 - e2*j1)*max(0, w1)", "j2 - j1^0",
        "j2 - if(w1 < w2, 2*j1, j1 + w1)"}) {
    EXPECT_NO_THROW(constraintOf(linear, "", 3)) << linear;
  }
}

TEST(ExpressionLaws, AreRefusedByPathAndWords) {
  test::expectFaultsOfElements("expression_laws", [](const std::string& text) {
    const std::size_t comma = text.find(", ");
    const std::string keys = text.substr(comma + 2);
    if (text.substr(0, comma) == "ExpressionTorque") {
      configured<ExpressionTorque>(keys);
    } else {
      configured<ExpressionConstraint>(keys);
    }
  });
  const auto one_shaft = [](const std::string&) { constraintOf("e1 + phi2", "", 2, {"only"}); };
  test::expectFault({"", "it/expression", {"the scene has 1 shaft: phi1"}}, one_shaft);
  // The place is shown.
  const auto misspelt = [](const std::string& formula) {
    constraintOf(formula, ", parameters: {tau: 0.2}");
  };
  test::expectFault({"e1 + taw*w1", "it/expression", {"\n  e1 + taw*w1\n       ^"}}, misspelt);
}

// ------------------------------------------------------------------------------------------ torque

TEST(ExpressionTorque, AddsToItsShaftOnly) {
  const auto torque = torqueOf("-k*w2^2", ", parameters: {k: 0.02}");
  const State s;
  double Q[2] = {1.0, 10.0};
  torque->addTorque(s.view, Q);
  EXPECT_EQ(Q[0], 1.0);
  EXPECT_NEAR(Q[1], 10.0 - 0.02 * 2.9 * 2.9, 1e-15);
  double rate[2] = {1.0, 10.0};
  torque->addTorqueRate(s.view, rate);
  EXPECT_EQ(rate[0], 1.0);
  EXPECT_NEAR(rate[1], 10.0 - 0.04 * 2.9 * 6.02, 1e-14);
}

TEST(ExpressionTorque, TakesAFormulaOfMoreValuesThanSixteenBitsCount) {
  std::string formula = "w2";
  double sum = 0;
  for (int i = 1; i < 70000; ++i) {
    formula += "+w1/" + std::to_string(3 + i);
    sum += 1.0 / (3 + i);
  }
  const auto torque = torqueOf(formula);
  const State s;
  double Q[2] = {};
  torque->addTorque(s.view, Q);
  EXPECT_NEAR(Q[1], 2.9 + 5.0 * sum, 1e-10);
}

TEST(ExpressionTorque, RateIsTheTotalDerivative) {
  const auto torque =
      torqueOf("12*((50-w1)/50)/(((50-w1)/50)^2+0.04) + t^2*sin(phi2) - w2*phi1", "", "drive");
  State s;
  double rate[2] = {};
  torque->addTorqueRate(s.view, rate);
  // The torque along phi(t) = phi + omega t + epsilon t^2/2, differentiated by differences.
  const auto along = [&s, &torque](double dt) {
    State at = s;
    for (int i = 0; i < 2; ++i) {
      at.angle[i] += s.velocity[i] * dt + 0.5 * s.acceleration[i] * dt * dt;
      at.velocity[i] += s.acceleration[i] * dt;
    }
    const StateView view = {s.view.time + dt, at.angle, at.velocity, nullptr, nullptr, nullptr};
    double Q[2] = {};
    torque->addTorque(view, Q);
    return Q[0];
  };
  const double h = 1e-3;
  const double expected =
      (8.0 * (along(h) - along(-h)) - (along(2 * h) - along(-2 * h))) / (12 * h);
  EXPECT_NEAR(rate[0], expected, 1e-8);
  EXPECT_GT(std::abs(expected), 1.0);
  EXPECT_EQ(rate[1], 0.0);
}

TEST(ExpressionTorque, OfAConstantHasNoRate) {
  const auto torque = torqueOf("-3.5");
  const StateView nothing = {kNan, nullptr, nullptr, nullptr, nullptr, nullptr};
  double Q[2] = {};
  torque->addTorque(nothing, Q);
  EXPECT_EQ(Q[1], -3.5);
  double rate[2] = {0.5, 0.25};
  torque->addTorqueRate(nothing, rate);
  EXPECT_EQ(rate[0], 0.5);
  EXPECT_EQ(rate[1], 0.25);
}

TEST(ExpressionTorque, PassesOnWhatIsNotANumber) {
  const auto torque = torqueOf("sqrt(w1 - 100)");
  double Q[2] = {};
  torque->addTorque(State().view, Q);
  EXPECT_TRUE(std::isnan(Q[1]));
}

}  // namespace
}  // namespace variator_sim
