// Functions that formulas call and cannot see into: their values and derivatives in programs, the
// motion of scenes with them against that of the same formulas, what they cannot do, and that a
// wrong gradient is caught by name.
#include "variator_sim/expression/opaque_function.h"

#include <stdexcept>

#include "expression/opaque_slope.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/linear_model.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::Node;
using expression::OpaqueSlope;
using expression::slotOf;
using expression::Source;
using expression::Tape;

/// x^2 y + sin z, or a part of it; counts its calls.
class Polynomial : public OpaqueFunction {
 public:
  explicit Polynomial(int count = 3, double wrong = 1.0) : OpaqueFunction(count), wrong_(wrong) {}
  double value(const double* x) const override {
    ++values;
    return x[0] * x[0] * y(x) + std::sin(z(x));
  }
  void calcGradient(const double* x, double* gradient) const override {
    ++gradients;
    gradient[0] = 2.0 * x[0] * y(x);
    if (argumentCount() > 1) gradient[1] = wrong_ * x[0] * x[0];
    if (argumentCount() > 2) gradient[2] = std::cos(z(x));
  }
  mutable int values = 0;
  mutable int gradients = 0;

 private:
  double y(const double* x) const { return argumentCount() > 1 ? x[1] : 1.0; }
  double z(const double* x) const { return argumentCount() > 2 ? x[2] : 0.0; }
  double wrong_;
};

constexpr int kW1 = slotOf(Source::kVelocity, 0);
constexpr int kW2 = slotOf(Source::kVelocity, 1);
constexpr int kPhi1 = slotOf(Source::kAngle, 0);

struct Point {
  double angle[2] = {0.3, -0.4};
  double velocity[2] = {2.0, 3.0};
  double acceleration[2] = {0.5, -0.7};
  StateView view() const { return {0.1, angle, velocity, acceleration, nullptr, nullptr, nullptr}; }
};

TEST(OpaqueFunction, HasItsValueAndItsDerivativesInAProgram) {
  Graph graph;
  const auto f = std::make_shared<Polynomial>();
  const Node x[4] = {graph.variable(kW1), graph.multiply(graph.constant(2.0), graph.variable(kW2)),
                     graph.variable(kPhi1)};
  const Node value = graph.opaque(f, x);
  EXPECT_EQ(graph.opaque(f, x), value);
  EXPECT_TRUE(graph.hasOpaque({graph.add(value, x[0])}));
  EXPECT_FALSE(graph.hasOpaque({x[0], x[1]}));

  std::vector<Node> outputs = {value};
  for (const int slot : {kW1, kW2, kPhi1}) outputs.push_back(graph.differentiate(value, slot));
  const Tape tape(graph, outputs);
  double values[4];
  tape.evaluate(Point().view(), values);
  EXPECT_EQ(values[0], 2.0 * 2.0 * 6.0 + std::sin(0.3));
  EXPECT_EQ(values[1], 2.0 * 2.0 * 6.0);
  EXPECT_EQ(values[2], 2.0 * 2.0 * 2.0);
  EXPECT_EQ(values[3], std::cos(0.3));
  EXPECT_EQ(f->values, 1);
  EXPECT_EQ(f->gradients, 3);
  // One of them alone, in another order than its arguments.
  const Tape last(graph, {outputs[3], outputs[1]});
  last.evaluate(Point().view(), values);
  EXPECT_EQ(values[0], std::cos(0.3));
  EXPECT_EQ(values[1], 2.0 * 2.0 * 6.0);
  EXPECT_EQ(f->values, 1);
}

TEST(OpaqueFunction, IsAConstantOfConstantsAndReadsWhatItNeeds) {
  Graph graph;
  const auto f = std::make_shared<Polynomial>(2);
  const Node constants[4] = {graph.constant(3.0), graph.constant(5.0)};
  EXPECT_TRUE(graph.isConstant(graph.opaque(f, constants), 45.0));
  EXPECT_TRUE(graph.isConstant(graph.opaque(std::make_shared<OpaqueSlope>(f, 2), constants), 9.0));
  const Node mixed[4] = {graph.constant(3.0), graph.variable(kW1)};
  const Node value = graph.opaque(f, mixed);
  EXPECT_TRUE(graph.dependsOn(value, kW1));
  EXPECT_FALSE(graph.dependsOn(value, kW2));
  EXPECT_TRUE(graph.isConstant(graph.differentiate(value, kW2), 0.0));
  EXPECT_THROW(Polynomial(0), std::invalid_argument);
  EXPECT_THROW(Polynomial(5), std::invalid_argument);
}

TEST(OpaqueFunction, HasFurtherDerivativesByDifferences) {
  Graph graph;
  const auto f = std::make_shared<Polynomial>();
  const Node x[4] = {graph.variable(kW1), graph.multiply(graph.constant(2.0), graph.variable(kW2)),
                     graph.variable(kPhi1)};
  const Node value = graph.opaque(f, x);
  const Node slope = graph.differentiate(value, kW1);
  EXPECT_TRUE(graph.isConstant(graph.differentiate(graph.variable(kW1), kW2), 0.0));
  EXPECT_FALSE(graph.hasDifference({value, slope}));
  const Node second = graph.differentiate(slope, kW2);
  EXPECT_TRUE(graph.hasDifference({second}));
  EXPECT_EQ(graph.differentiate(slope, kW2), second);
  const Node third = graph.differentiate(second, kW1);
  const Node sine = graph.differentiate(graph.differentiate(value, kPhi1), kPhi1);
  double values[3];
  Tape(graph, {second, third, sine}).evaluate(Point().view(), values);
  // w1^2 2 w2 + sin(phi1)
  EXPECT_NEAR(values[0], 4.0 * 2.0, 1e-10);
  EXPECT_NEAR(values[1], 4.0, 1e-6);
  EXPECT_NEAR(values[2], -std::sin(0.3), 1e-11);
}

/// A law of the shafts with x^2 y + sin z; as a formula, or as an opaque function.
struct Case {
  const char* name;
  Expression (*law)(LawContext& scene, const std::vector<Shaft>& s, bool is_opaque);
};

Expression sample(LawContext& scene, bool is_opaque, const Expression& x, const Expression& y,
                  const Expression& z) {
  if (is_opaque) return scene.function(std::make_shared<Polynomial>(), {x, y, z});
  return x * x * y + sin(z);
}

const Case kTorques[] = {
    {"smooth",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       return -0.05 * sample(scene, is_opaque, s[0].velocity, tanh(s[1].velocity), s[0].angle);
     }},
    {"with a command",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       return -0.05 * sample(scene, is_opaque, s[0].velocity, scene.command(), scene.time());
     }},
    {"behind kinks",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Expression f = sample(scene, is_opaque, s[0].velocity, 1.0, s[0].angle);
       return -0.2 * min(f, 4.0) - 0.1 * where(f < 9.0, 0.0, f - 9.0);
     }},
    {"with a jump",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Expression f = sample(scene, is_opaque, s[0].velocity, 1.0, s[0].angle);
       return -0.1 * f - where(f < 6.0, 0.0, 0.7);
     }},
    {"into a table",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Table table =
           Table::through({0.0, 4.0, 6.0, 20.0}, {0.0, -1.0, -3.0, -4.0}, Table::Beyond::kLinear);
       return scene.lookUp(table, sample(scene, is_opaque, s[0].velocity, 1.0, s[0].angle));
     }},
};

const Case kConstraints[] = {
    {"linear in the accelerations",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Expression i =
           0.6 + 0.01 * sample(scene, is_opaque, s[0].velocity, scene.time(), s[1].angle);
       return 0.2 * (s[1].acceleration - i * s[0].acceleration) + s[1].velocity - i * s[0].velocity;
     }},
    {"nonlinear in the accelerations",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Expression f = sample(scene, is_opaque, s[0].acceleration, 0.05, s[0].velocity);
       return 0.2 * (s[1].acceleration - 0.6 * s[0].acceleration + f) + s[1].velocity -
              0.6 * s[0].velocity;
     }},
    {"of order 3",
     [](LawContext& scene, const std::vector<Shaft>& s, bool is_opaque) {
       const Expression f = sample(scene, is_opaque, s[1].acceleration, 1.0, s[0].velocity);
       return s[1].jerk + 0.1 * f;
     }},
};

class TorqueOf : public Torque {
 public:
  TorqueOf(const Case& of, bool is_opaque) : case_(of), is_opaque_(is_opaque) {}

 private:
  void build(LawContext& scene) override {
    const std::vector<Shaft> s = {scene.shaftAt(0), scene.shaftAt(1)};
    scene.applyBetween(s[0], s[1], case_.law(scene, s, is_opaque_));
  }
  const Case& case_;
  bool is_opaque_;
};

class ConstraintOf : public Constraint {
 public:
  ConstraintOf(const Case& of, bool is_opaque) : case_(of), is_opaque_(is_opaque) {}

 private:
  void build(LawContext& scene) override {
    scene.constrain(case_.law(scene, {scene.shaftAt(0), scene.shaftAt(1)}, is_opaque_));
  }
  const Case& case_;
  bool is_opaque_;
};

class Factory : public BuiltinComponentFactory {
 public:
  Factory(const Case& torque, const Case& constraint, bool is_opaque)
      : torque_(torque), constraint_(constraint), is_opaque_(is_opaque) {}
  TorquePtr createTorque(const std::string& type) override {
    if (type != "test/It") return BuiltinComponentFactory::createTorque(type);
    return std::make_shared<TorqueOf>(torque_, is_opaque_);
  }
  ConstraintPtr createConstraint(const std::string& /*type*/) override {
    return std::make_shared<ConstraintOf>(constraint_, is_opaque_);
  }

 private:
  const Case& torque_;
  const Case& constraint_;
  bool is_opaque_;
};

Scene sceneOf(const Case& torque, const Case& constraint, bool is_opaque,
              const std::string& rest = "", double tolerance = 1e-10,
              const std::string& more_torques = "") {
  Factory factory(torque, constraint, is_opaque);
  const std::string keys = std::string(torque.name) == "with a command"
                               ? ", topic: u, hold: first_order_lag, time_constant: 0.2, initial: 1"
                               : "";
  return test::withTolerance(
      readScene(
          readYamlText("shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [it, push" +
                           more_torques + "]\nit: {type: test/It" + keys +
                           "}\npush: {type: variator_sim/ExpressionTorque, shaft: a, torque: "
                           "\"3*sin(2*t)\"}\nconstraints: [c]\nc: {type: test/It}\n"
                           "initial: {velocity: [3, 1.8], " +
                           (more_torques.empty() ? "acceleration: [0.4, 0.2], " : "") +
                           "project: true}\n" + rest,
                       "test"),
          factory),
      tolerance);
}

/// The sample after 2 s, with a step of the command at 0.5 s.
Sample endOf(const Scene& scene) {
  Simulation simulation(scene);
  EXPECT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();
  if (scene.inputCount() > 0) simulation.command(0, 2.0);
  EXPECT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
  return simulation.sample();
}

void expectSameMotion(const Case& torque, const Case& constraint, const std::string& rest) {
  SCOPED_TRACE(std::string(torque.name) + ", " + constraint.name + ", " + rest);
  const Sample formula = endOf(sceneOf(torque, constraint, false, rest));
  const Sample opaque = endOf(sceneOf(torque, constraint, true, rest));
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(opaque.velocity[i], formula.velocity[i], 3e-8) << i;
    EXPECT_NEAR(opaque.acceleration[i], formula.acceleration[i], 3e-7) << i;
    EXPECT_NEAR(opaque.reaction_torque[i], formula.reaction_torque[i], 3e-7) << i;
  }
}

TEST(OpaqueFunction, MovesAsItsFormula) {
  for (const Case& torque : kTorques) expectSameMotion(torque, kConstraints[0], "");
  for (const Case& constraint : kConstraints) {
    for (const char* principle : {"gauss", "generalized_gauss"}) {
      for (const char* stepper : {"fehlberg78", "radau"}) {
        expectSameMotion(
            kTorques[0], constraint,
            std::string("principle: ") + principle + "\nsolver: {stepper: " + stepper + "}\n");
      }
    }
  }
}

/// Steps through 10 s with a step of the command at 2.5 s, against the formula's motion.
void expectSameSteps(const Case& torque, const Case& constraint, const std::string& principle,
                     double tolerance, const std::string& more_torques = "",
                     const std::string& rest = "") {
  SCOPED_TRACE(std::string(torque.name) + ", " + constraint.name + ", " + principle + rest);
  const std::string keys = "principle: " + principle + "\n" + rest;
  Simulation formula(sceneOf(torque, constraint, false, keys, 1e-12, more_torques));
  Simulation opaque(sceneOf(torque, constraint, true, keys, tolerance, more_torques));
  EXPECT_STREQ(opaque.stepperName(), "radau");
  for (int n = 1; n <= 20; ++n) {
    for (Simulation* it : {&formula, &opaque}) {
      ASSERT_TRUE(it->advanceTo(0.5 * n).ok()) << it->describeStatus();
      if (n == 5 && it->scene().inputCount() > 0) it->command(0, 2.0);
    }
    for (int i = 0; i < 2; ++i) {
      const auto expectNear = [&](const double* a, const double* b, double factor) {
        EXPECT_NEAR(a[i], b[i], factor * tolerance * (1.0 + std::abs(b[i]))) << n << ", " << i;
      };
      expectNear(opaque.sample().velocity, formula.sample().velocity, 10.0);
      expectNear(opaque.sample().acceleration, formula.sample().acceleration, 50.0);
      expectNear(opaque.sample().reaction_torque, formula.sample().reaction_torque, 100.0);
    }
  }
  EXPECT_STREQ(opaque.stepperName(), "radau");
  EXPECT_LT(opaque.statistics().steps, 2000U);
}

// Implicit steps from the beginning on, which need values and gradients alone.
TEST(OpaqueFunction, IsSteppedAsItsFormula) {
  for (const double tolerance : {1e-6, 1e-9}) {
    for (const char* principle : {"gauss", "generalized_gauss"}) {
      for (const Case& torque : kTorques) {
        expectSameSteps(torque, kConstraints[0], principle, tolerance);
      }
      expectSameSteps(kTorques[0], kConstraints[1], principle, tolerance);
    }
    expectSameSteps(kTorques[0], kConstraints[2], "generalized_gauss", tolerance);
  }
}

TEST(OpaqueFunction, IsSteppedBesideElementsWithMemory) {
  const char* const all[][2] = {
      {", brake", "brake: {type: variator_sim/Brake, shaft: b, capacity: 4}\n"},
      {", q",
       "states: [z]\nz: {rate: \"(w_b - z)/0.3\", initial: 0}\nq: {type: "
       "variator_sim/ExpressionTorque, shaft: b, torque: \"-z\"}\n"},
      {", q",
       "q: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"-0.5*delay(w_b, "
       "0.5)\"}\n"},
      {", q",
       "variables: [k]\nk: {initial: 1}\nevents: [ev]\nev: {when: \"w_a - 2\", set: {k: "
       "\"-k\"}}\nq: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"k\"}\n"}};
  for (const auto& [torques, keys] : all) {
    for (const char* principle : {"gauss", "generalized_gauss"}) {
      expectSameSteps(kTorques[0], kConstraints[0], principle, 1e-6, torques, keys);
    }
  }
}

TEST(OpaqueFunction, HasTheLinearModelOfItsFormula) {
  const auto compare = [](const Case& torque, const Case& constraint, const std::string& rest) {
    SCOPED_TRACE(std::string(torque.name) + ", " + constraint.name + ", " + rest);
    const Scene formula = sceneOf(torque, constraint, false, rest);
    const Scene opaque = sceneOf(torque, constraint, true, rest);
    const OperatingPoint point = Simulation(formula).operatingPoint();
    const LinearModel a = linearize(formula, point, LinearForm::kFull);
    const LinearModel b = linearize(opaque, point, LinearForm::kFull);
    // (Under `gauss` a torque is differentiated once.)
    const bool has_differences = rest.find("generalized") != std::string::npos;
    EXPECT_EQ(b.notes.size() > a.notes.size(), has_differences || &constraint == &kConstraints[1] ||
                                                   &constraint == &kConstraints[2]);
    ASSERT_EQ(a.states, b.states);
    for (const auto& [mine, other] : {std::pair(&a.A, &b.A), std::pair(&a.B, &b.B),
                                      std::pair(&a.C, &b.C), std::pair(&a.D, &b.D)}) {
      if (mine->size() == 0) continue;
      const double size = std::max(1.0, mine->cwiseAbs().maxCoeff());
      EXPECT_LE((*mine - *other).cwiseAbs().maxCoeff(), 1e-7 * size);
    }
  };
  for (const char* principle : {"gauss", "generalized_gauss"}) {
    const std::string rest = std::string("principle: ") + principle + "\n";
    for (const Case& torque : kTorques) compare(torque, kConstraints[0], rest);
    for (const Case& constraint : kConstraints) compare(kTorques[0], constraint, rest);
  }
}

std::string messageOf(const Case& torque, const Case& constraint) {
  return test::messageOf([&] { sceneOf(torque, constraint, true); });
}

TEST(OpaqueFunction, HasNoPlaceInAConstraintOfOrder1ThatNeedsTwoDerivatives) {
  const Case first{"order 1", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                     return s[1].velocity -
                            scene.function(std::make_shared<Polynomial>(1), {s[0].angle});
                   }};
  EXPECT_EQ(messageOf(kTorques[0], first),
            "c: a constraint of order 1 is differentiated twice, and the opaque function in it has "
            "first derivatives only; allowed: a function made of Expressions, or a constraint of "
            "order 2");
}

TEST(OpaqueFunction, TakesAsManyArgumentsAsItHas) {
  const Case few{"few", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                   return scene.function(std::make_shared<Polynomial>(), {s[0].velocity});
                 }};
  EXPECT_EQ(messageOf(few, kConstraints[0]), "it: its opaque function takes 3 arguments, not 1");
}

TEST(OpaqueFunction, OfAWrongGradientIsCaughtByName) {
  const Case rate{"rate", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                    return scene.function(std::make_shared<Polynomial>(3, 1.01),
                                          {s[0].velocity, s[1].velocity, s[0].angle});
                  }};
  const std::string of_torque = messageOf(rate, kConstraints[0]);
  EXPECT_EQ(of_torque.rfind("it: d f/d x2 of an opaque function of torque 'it' is stated as ", 0),
            0U)
      << of_torque;
  const std::string wrong = "c: d f/d x2 of an opaque function of constraint 'c' is stated as ";
  const Case partial{"partial", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                       return s[1].acceleration - s[0].acceleration +
                              scene.function(std::make_shared<Polynomial>(2, 1.01),
                                             {s[0].velocity, s[1].velocity});
                     }};
  const std::string of_constraint = messageOf(kTorques[0], partial);
  EXPECT_EQ(of_constraint.rfind(wrong, 0), 0U) << of_constraint;
  const Case acceleration{"C", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                            return s[1].acceleration +
                                   scene.function(std::make_shared<Polynomial>(2, 1.01),
                                                  {s[0].velocity, s[0].acceleration});
                          }};
  const std::string of_jacobian = messageOf(kTorques[0], acceleration);
  EXPECT_EQ(of_jacobian.rfind(wrong, 0), 0U) << of_jacobian;
}

/// -x, throwing once the time, its other argument, is above 0.5 s.
class Throwing : public OpaqueFunction {
 public:
  Throwing(bool in_gradient, bool is_number)
      : OpaqueFunction(2), in_gradient_(in_gradient), is_number_(is_number) {}
  double value(const double* x) const override {
    if (!in_gradient_) failAfter(x[1]);
    return -x[0];
  }
  void calcGradient(const double* x, double* gradient) const override {
    if (in_gradient_) failAfter(x[1]);
    gradient[0] = -1.0;
  }

 private:
  void failAfter(double time) const {
    if (time <= 0.5) return;
    if (is_number_) throw 5;
    throw std::runtime_error("the sensor is off");
  }
  const bool in_gradient_;
  const bool is_number_;
};

template <bool kInGradient, bool kIsNumber>
Expression throwing(LawContext& scene, const std::vector<Shaft>& s, bool /*is_opaque*/) {
  return scene.function(std::make_shared<Throwing>(kInGradient, kIsNumber),
                        {s[0].velocity, scene.time()});
}

TEST(OpaqueFunction, ThatThrowsStopsItsMotionByName) {
  const std::string error = "the sensor is off";
  const std::string number = "an exception of type int, which is no std::exception";
  for (const auto& [torque, thrown] :
       {std::pair(Case{"value, error", &throwing<false, false>}, error),
        std::pair(Case{"value, number", &throwing<false, true>}, number),
        std::pair(Case{"gradient, error", &throwing<true, false>}, error),
        std::pair(Case{"gradient, number", &throwing<true, true>}, number)}) {
    SCOPED_TRACE(torque.name);
    Simulation simulation(sceneOf(torque, kConstraints[0], true));
    const MotionStatus status = simulation.advanceTo(2.0);
    ASSERT_FALSE(status.ok());
    EXPECT_NEAR(status.time, 0.5, 1e-3);
    const std::string text = simulation.describeStatus();
    EXPECT_NE(text.find("torque 'it', whose function threw: " + thrown + ";"), std::string::npos)
        << text;
    EXPECT_NE(text.find("; last good state: angle = "), std::string::npos) << text;
    EXPECT_TRUE(std::isfinite(simulation.sample().velocity[0]));
    simulation.reset();
    EXPECT_TRUE(simulation.advanceTo(0.4).ok()) << simulation.describeStatus();
  }
}

TEST(OpaqueFunction, ThatIsMissingOrThrowsAtConstantsIsRefusedByName) {
  const Case missing{"none", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
                       return scene.function(nullptr, {s[0].velocity});
                     }};
  EXPECT_EQ(messageOf(missing, kConstraints[0]),
            "it: its opaque function is a null pointer; allowed: an object of a class derived from "
            "variator_sim::OpaqueFunction");
  const Case constant{
      "constant", [](LawContext& scene, const std::vector<Shaft>& s, bool) {
        return s[0].velocity * scene.function(std::make_shared<Throwing>(false, true), {1, 2});
      }};
  EXPECT_EQ(messageOf(constant, kConstraints[0]),
            "it: its opaque function threw, at constant arguments: an exception of type int, which "
            "is no std::exception");
}

}  // namespace
}  // namespace variator_sim
