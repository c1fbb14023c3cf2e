// Formulas as machine code: the bits of every operation and of whole motions are those of the
// interpreter.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/drivetrain.h"
#include "dynamics/program.h"
#include "dynamics/scene_program.h"
#include "expression/c_code.h"
#include "machine_code/kernel_library.h"
#include "support/machine_code_folder.h"
#include "support/played.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;
using expression::Tape;
using test::hex;
using test::kShafts;
using test::play;

class MachineCodeBits : public test::MachineCodeFolder {};

// --- operations ------------------------------------------------------------------------------

bool areSameBits(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0;
}

/// Outputs by the tape and by machine code, at states of one's choice.
class Comparison {
 public:
  Comparison(const Graph& graph, const std::vector<Node>& outputs)
      : tape_(graph, outputs), expected_(outputs.size()), computed_(outputs.size()) {
    EXPECT_TRUE(isWritable(graph, outputs));
    std::string reason;
    library_ =
        KernelLibrary::load(expression::prelude() + writeFunction(graph, "outputs", outputs, 0),
                            KernelLibrary::Missing::kCompile, &reason);
    if (library_ == nullptr) {
      ADD_FAILURE() << reason;
      return;
    }
    kernel_ = reinterpret_cast<Kernel>(library_->find("outputs"));
    for (const auto& table : graph.tables()) tables_.push_back(table.get());
    for (const auto& table : graph.tables2()) tables2_.push_back(table.get());
    addStructure(graph, outputs, &structure_);
    host_ = {structure_.constants.data(), tables_.data(), tables2_.data(),
             [](const void* table, int order, double x) {
               return static_cast<const Table*>(table)->derivative(order, x);
             },
             [](const void* table, int order_x, int order_y, double x, double y) {
               return static_cast<const Table2*>(table)->derivative({order_x, order_y}, x, y);
             }};
  }

  /// With these two as w1 and w2, and made of them all other variables.
  void compare(double a, double b) {
    if (::testing::Test::HasFatalFailure()) return;  // one is enough
    ASSERT_NE(kernel_, nullptr);
    const double w[2] = {a, b};
    const double p[2] = {b, 0.5 * a};
    const double e[2] = {a - b, a};
    const double u[2] = {0.25 * b, a};
    const StateView state{b, p, w, e, u, u + 1, w + 1};
    tape_.evaluate(state, expected_.data());
    kernel_(b, p, w, e, u, u + 1, w + 1, &host_, computed_.data());
    for (std::size_t k = 0; k < expected_.size(); ++k) {
      ASSERT_TRUE(areSameBits(computed_[k], expected_[k]))
          << "output " << k << " at " << hex(a) << ", " << hex(b) << ": " << hex(computed_[k])
          << " instead of " << hex(expected_[k]);
    }
  }
  /// At pairs of special values, and of random ones small and large.
  void compareEverywhere() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const double special[] = {0.0,     0.5,       1.0,  2.0,    3.0,  1e-310,
                              1e-160,  0x1p-52,   16.0, 710.5,  1e15, 1e160,
                              1.7e308, kInfinity, M_PI, M_PI_2, 4.5,  17.0};
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> values = {nan};
    for (const double value : special) values.insert(values.end(), {value, -value});
    for (const double a : values) {
      for (const double b : values) compare(a, b);
    }
    std::mt19937_64 random(17);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (const double scale : {1e-6, 1.0, 3.0, 30.0, 1e4}) {
      for (int n = 0; n < 4000; ++n) compare(scale * unit(random), scale * unit(random));
    }
  }

 private:
  Tape tape_;
  std::shared_ptr<KernelLibrary> library_;
  Kernel kernel_ = nullptr;
  expression::CodeStructure structure_;
  std::vector<const void*> tables_;
  std::vector<const void*> tables2_;
  KernelTables host_{};
  std::vector<double> expected_;
  std::vector<double> computed_;
};

struct Variables {
  explicit Variables(Graph& graph)
      : a(graph.variable(slotOf(Source::kVelocity, 0))),
        b(graph.variable(slotOf(Source::kVelocity, 1))) {}
  Node a;
  Node b;
};

constexpr Operation kOfOne[] = {
    Operation::kNegate, Operation::kSin,  Operation::kCos,  Operation::kTan,  Operation::kAsin,
    Operation::kAcos,   Operation::kAtan, Operation::kSinh, Operation::kCosh, Operation::kTanh,
    Operation::kExp,    Operation::kLog,  Operation::kSqrt, Operation::kAbs,  Operation::kSign};
constexpr Operation kOfTwo[] = {Operation::kAdd,    Operation::kSubtract, Operation::kMultiply,
                                Operation::kDivide, Operation::kPower,    Operation::kAtan2,
                                Operation::kMin,    Operation::kMax,      Operation::kWhereFinite};

TEST_F(MachineCodeBits, OfEveryOperationAreTheInterpreters) {
  Graph graph;
  const Variables v(graph);
  std::vector<Node> outputs;
  for (const Operation operation : kOfOne) outputs.push_back(graph.make(operation, v.a));
  for (const Operation operation : kOfTwo) outputs.push_back(graph.make(operation, v.a, v.b));
  outputs.push_back(graph.select(v.a, v.b, v.b, graph.variable(slotOf(Source::kTime))));
  // Operations that a compiler might fuse.
  outputs.push_back(graph.add(graph.multiply(v.a, v.b), graph.multiply(v.b, v.b)));
  outputs.push_back(graph.subtract(graph.multiply(v.a, v.a), v.b));
  for (const Source source : {Source::kAngle, Source::kAcceleration, Source::kInput}) {
    outputs.push_back(graph.multiply(v.a, graph.variable(slotOf(source, 0))));
    outputs.push_back(graph.variable(slotOf(source, 1)));
  }
  outputs.push_back(graph.variable(slotOf(Source::kInputRate)));
  outputs.push_back(graph.variable(slotOf(Source::kInputSecondRate)));
  outputs.push_back(graph.constant(-0.0));
  outputs.push_back(graph.constant(-std::numeric_limits<double>::infinity()));
  outputs.push_back(graph.constant(std::numeric_limits<double>::quiet_NaN()));
  outputs.push_back(graph.multiply(graph.constant(0.1), v.a));
  outputs.push_back(graph.subtract(v.a, graph.constant(-1e-310)));
  Comparison(graph, outputs).compareEverywhere();
}

TEST_F(MachineCodeBits, OfPowersAreTheInterpreters) {
  Graph graph;
  const Variables v(graph);
  std::vector<Node> outputs;
  for (int n = -18; n <= 18; ++n) outputs.push_back(graph.power(v.a, graph.constant(n)));
  for (const double c : {0.5, -0.5, 1.5, 2.5, 1.0 / 3.0, 0.25, -1.7, 1e3}) {
    outputs.push_back(graph.power(v.a, graph.constant(c)));
    outputs.push_back(graph.power(graph.constant(c), v.a));
  }
  for (const double c : {2.0, 10.0, M_E}) outputs.push_back(graph.power(graph.constant(c), v.b));
  Comparison(graph, outputs).compareEverywhere();
}

TEST_F(MachineCodeBits, OfDerivativesAreTheInterpreters) {
  Graph graph;
  const Variables v(graph);
  std::vector<Node> outputs;
  const Node inner = graph.add(graph.multiply(v.a, v.b), graph.constant(0.3));
  std::vector<Node> values;
  for (const Operation operation : kOfOne) values.push_back(graph.make(operation, inner));
  for (const Operation operation : kOfTwo) values.push_back(graph.make(operation, inner, v.b));
  values.push_back(graph.power(inner, graph.constant(2.5)));
  values.push_back(graph.select(inner, v.b, inner, graph.make(Operation::kSin, v.b)));
  for (const Node value : values) {
    for (const int index : {0, 1}) {
      outputs.push_back(graph.differentiate(value, slotOf(Source::kVelocity, index)));
    }
  }
  Comparison(graph, outputs).compareEverywhere();
}

// A compiler rounds a function of a constant better than the library does: none may be computed
// while compiling, also where a branch or a sign leaves a few constants only.
TEST_F(MachineCodeBits, OfFunctionsOfAFewConstantsAreTheInterpreters) {
  Graph graph;
  const Variables v(graph);
  std::vector<Node> outputs;
  for (int n = 1; n <= 12; ++n) {
    const Node some =
        graph.select(v.a, v.b, graph.constant(0.0777 * n), graph.constant(0.0533 * n));
    const Node sign = graph.multiply(graph.constant(0.0777 * n), graph.make(Operation::kSign, v.a));
    for (const Operation operation : kOfOne) {
      outputs.push_back(graph.make(operation, some));
      outputs.push_back(graph.make(operation, sign));
    }
    outputs.push_back(graph.power(some, graph.constant(1.7)));
    outputs.push_back(graph.make(Operation::kAtan2, some, graph.constant(0.3 * n)));
  }
  Comparison(graph, outputs).compareEverywhere();
}

TEST_F(MachineCodeBits, OfTablesAreTheInterpreters) {
  Graph graph;
  const Variables v(graph);
  std::vector<Node> outputs;
  for (const auto beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    const auto table = std::make_shared<Table>(
        Table::through({-2.0, -1.0, 0.5, 3.0}, {1.0, 2.0, -1.0, 0.25}, beyond));
    for (int order = 0; order <= Table::kDegree; ++order) {
      outputs.push_back(graph.table(table, v.a, order));
      outputs.push_back(graph.table(table, graph.multiply(v.a, v.b), order));
    }
  }
  Comparison(graph, outputs).compareEverywhere();
}

// --- motions ---------------------------------------------------------------------------------

void expectSameBits(const Scene& scene) {
  const std::string interpreted = play(scene, -1);
  EXPECT_EQ(play(scene, 0), interpreted);
  EXPECT_EQ(play(scene, 17), interpreted) << "switched in the middle";
}

TEST_F(MachineCodeBits, OfMotionsOfFilesAreTheInterpreters) {
  const std::string tests = VARIATOR_SIM_TEST_DIR;
  for (const char* name :
       {"/scenes/car.yaml", "/scenes/observed.yaml", "/scenes/stops.yaml",
        "/../config/acceleration_circle.yaml", "/../config/ratio_steps.yaml",
        "/../config/ship.yaml", "/../config/applications/diesel_locomotive.yaml",
        "/../config/applications/machine_tool.yaml", "/../config/applications/vbelt_vehicle.yaml",
        "/../config/applications/starting_system.yaml", "/modes/CoupledClutches.yaml",
        "/modes/OneWayClutch.yaml"}) {
    SCOPED_TRACE(name);
    expectSameBits(test::sceneFromFile(tests + name));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithEveryStepperAndPrincipleAreTheInterpreters) {
  const std::string scene = kShafts + R"yaml(
torques: [engine, drag]
engine: {type: variator_sim/CommandedTorque, shaft: drive, topic: u, hold: first_order_lag, time_constant: 0.2, initial: 4}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.3*w2*abs(w2) + sin(phi1)"}
constraints: [variator]
variator: {type: variator_sim/SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6}
)yaml";
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (const StepperKind stepper :
         {StepperKind::kAuto, StepperKind::kRk4, StepperKind::kDopri5, StepperKind::kFehlberg78,
          StepperKind::kTaylor, StepperKind::kRadau}) {
      SCOPED_TRACE(std::string(principle) + ", " + toString(stepper));
      const std::string text = scene + "principle: " + principle + "\n";
      expectSameBits(test::withStepper(test::sceneFromText(text), stepper));
    }
  }
}

TEST_F(MachineCodeBits, OfSeriesWithAnInertiaThatDependsOnAnglesAreTheInterpreters) {
  const std::string scene = R"yaml(
shafts: [crank, load, drum]
crank: {inertia: {mean: 1.0, harmonics: [{order: 1, cos: 0.2}, {order: 2, cos: 0.1, sin: -0.15}]}}
load: {inertia: 1.2}
drum: {inertia: {mean: 0.7, harmonics: [{order: 3, sin: 0.1}]}}
inertia_coupling: [[crank, load, 0.1]]
initial: {velocity: [10.0, 6.0, 3.0]}
torques: [drag]
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "3 - 0.3*w2 + sin(phi1)"}
constraints: [variator, drive]
variator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "0.2*(e2 - 0.6*e1) + w2 - 0.6*w1"}
drive: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e3 - 0.5*e2 + 0.01*w1*e1"}
)yaml";
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    SCOPED_TRACE(principle);
    const std::string text = scene + "principle: " + principle + "\n";
    expectSameBits(test::withStepper(test::sceneFromText(text), StepperKind::kTaylor));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithBranchesTablesAndHoldsAreTheInterpreters) {
  for (const char* hold :
       {"zero_order", "first_order_lag, time_constant: 0.2", "rate_limit, rate: 12",
        "first_order_hold, period: 0.3", "second_order_lag, time_constant: 0.1"}) {
    SCOPED_TRACE(hold);
    expectSameBits(test::sceneFromText(
        kShafts + "inputs: [lever]\nlever: {topic: lever, hold: " + hold + R"yaml(, initial: 1}
torques: [engine, drag, kinks, map]
tables: [of_speed, of_two]
of_speed: {x: [0, 5, 10, 20], values: [3, 4, 2, 0]}
of_two: {x: [0, 10, 20], y: [0, 10], values: [[0, 1], [2, 1], [3, 4]], beyond: linear}
engine: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "lever*of_speed(w1) + sign(sin(9*t))"}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.02*abs(w2)^1.7 - 0.01*w2^3 - 1/(1 + w2^2)^0.5"}
kinks: {type: variator_sim/ExpressionTorque, shaft: load, torque: "if(w2 < 5, 0.3, min(1, 0.2*w2)) - clamp(w1 - w2, -0.5, 0.5) + max(cos(3*t), 0.2)"}
map: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.3*of_two(w1, w2)"}
constraints: [variator]
variator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "0.2*(e2 - 0.6*e1) + w2 - 0.6*w1"}
)yaml"));
  }
}

TEST_F(MachineCodeBits, OfMotionsWithOtherOrdersAreTheInterpreters) {
  for (const char* constraint : {"order: 1, expression: 'w2 - (0.6 + 0.05*sin(phi1))*w1'",
                                 "order: 3, expression: 'j2 + 3*e2 - 0.1*e1'",
                                 "order: 2, expression: 'e2 - 0.6*e1 + 0.01*e1^3 + w2 - 0.6*w1'"}) {
    SCOPED_TRACE(constraint);
    expectSameBits(test::sceneFromText(
        "shafts: [drive, load]\ndrive: {inertia: 0.5}\nload: {inertia: 1.2}\n"
        "initial: {velocity: [10.0, 6.0], project: true}\n"
        "torques: [drag]\nconstraints: [c]\nc: {type: variator_sim/ExpressionConstraint, " +
        std::string(constraint) +
        "}\ndrag: {type: variator_sim/ExpressionTorque, shaft: load, torque: '2*cos(t) - w2'}\n"));
  }
}

/// If tanh is 1 to all digits, its rate is 0, of either sign.
TEST_F(MachineCodeBits, OfFunctionsThatAreConstantToAllDigitsAreTheInterpreters) {
  for (const char* law :
       {"Friction, coulomb: 1, regularization_speed: 0.01}\nprinciple: generalized_gauss\n",
        "Friction, coulomb: 1, regularization_speed: 1e-5}\nprinciple: gauss\n",
        "ExpressionTorque, torque: '-tanh(w1/0.01)'}\nprinciple: gauss\n"}) {
    SCOPED_TRACE(law);
    expectSameBits(test::sceneFromText(
        "shafts: [drive]\ndrive: {inertia: 1}\ninitial: {velocity: [1]}\ntorques: [motor, "
        "law]\nmotor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "
        "'5*sin(t)'}\nlaw: {shaft: drive, type: variator_sim/" +
        std::string(law)));
  }
}

// --- scenes that differ in numbers alone -------------------------------------------------------

}  // namespace
}  // namespace variator_sim
