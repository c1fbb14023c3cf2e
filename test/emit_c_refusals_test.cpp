// Laws that call opaque functions cannot be written as C and are refused by name.

#include "emit_c/emit_c.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"
#include "variator_sim/torque.h"

namespace variator_sim {
namespace {

class Square : public OpaqueFunction {
 public:
  Square() : OpaqueFunction(1) {}
  double value(const double* x) const override { return x[0] * x[0]; }
  void calcGradient(const double* x, double* gradient) const override { gradient[0] = 2.0 * x[0]; }
};

class OpaqueDrag : public Torque {
  void build(LawContext& scene) override {
    const Shaft shaft = scene.shaftAt(0);
    scene.apply(shaft, -scene.function(std::make_shared<Square>(), {shaft.velocity}));
  }
};

class Factory : public BuiltinComponentFactory {
 public:
  TorquePtr createTorque(const std::string& type) override {
    if (type == "test/OpaqueDrag") return std::make_shared<OpaqueDrag>();
    return BuiltinComponentFactory::createTorque(type);
  }
};

constexpr const char* kFormulaTorque =
    "{type: variator_sim/ExpressionTorque, shaft: a, torque: \"1-w1\"}";
constexpr const char* kFormulaConstraint =
    "{type: variator_sim/ExpressionConstraint, order: 2, expression: \"e2-e1\"}";

Simulation make(const std::string& torque, const std::string& constraint) {
  Factory factory;
  return Simulation(readScene(
      readYamlText("shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\n"
                   "torques: [the_torque]\nthe_torque: " +
                       torque + "\nconstraints: [the_constraint]\nthe_constraint: " + constraint +
                       "\ninitial: {velocity: [1, 1]}\n",
                   "test"),
      factory));
}

std::string refusalOf(const std::string& torque, const std::string& constraint) {
  Simulation simulation = make(torque, constraint);
  return test::messageOf([&] { emitScene(simulation, "it", "it.yaml"); });
}

TEST(EmitCRefusals, NothingOfFormulas) {
  EXPECT_EQ(refusalOf(kFormulaTorque, kFormulaConstraint), "");
  const std::string type = "{type: variator_sim/ExpressionConstraint, ";
  EXPECT_EQ(refusalOf(kFormulaTorque, type + "order: 1, expression: \"w2-max(w1,0.5*w1)\"}"), "");
}

TEST(EmitCRefusals, OpaqueFunctions) {
  const std::string refusal = refusalOf("{type: test/OpaqueDrag}", kFormulaConstraint);
  EXPECT_NE(refusal.find("the_torque: cannot be written as C: it calls a function of its plugin"),
            std::string::npos)
      << refusal;
  EXPECT_NE(refusal.find("OpaqueFunction"), std::string::npos) << refusal;
}

TEST(EmitCRefusals, NamesForC) {
  EXPECT_EQ(nameForC("config/ship.yaml"), "ship");
  EXPECT_EQ(nameForC("/a.b/3 shafts-x.yaml"), "scene_3_shafts_x");
  EXPECT_EQ(nameForC("main.yaml"), "scene_main");
  EXPECT_EQ(nameForC("math"), "scene_math");
  EXPECT_EQ(nameForC(std::string(250, 'a') + ".yaml"), std::string(100, 'a'));
  EXPECT_EQ(nameForC("VS_ZERO.yaml"), "scene_VS_ZERO");  // VS_ZERO_ORDER is a hold
}

}  // namespace
}  // namespace variator_sim
