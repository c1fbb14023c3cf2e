// Formulas for reading: what is printed has the value of what it was made from, and a scene is
// explained in full.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "expression/term_maker.h"
#include "tools/scene_equations.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::Names;
using expression::Node;
using expression::slotOf;
using expression::Source;
using expression::Terms;

/// Formulas of w1, w2 and a.
class Printed : public ::testing::Test {
 protected:
  Printed() {
    const std::map<std::string, int> slots = {{"w1", slotOf(Source::kVelocity, 0)},
                                              {"w2", slotOf(Source::kVelocity, 1)},
                                              {"a", slotOf(Source::kInput, 0)}};
    for (const auto& [name, slot] : slots) {
      symbols_[name] = graph_.variable(slot);
      names_.variables[slot] = {name, name};
    }
    names_.taken = {"a", "a1"};
  }

  Node read(const std::string& text) { return parse(text, symbols_, graph_); }
  std::string print(const std::string& text) {
    const Terms terms = makeTerms(graph_, {read(text)}, names_);
    return toText(*terms.roots[0]);
  }
  std::string printLatex(const std::string& text) {
    const Terms terms = makeTerms(graph_, {read(text)}, names_);
    return toLatex(*terms.roots[0]);
  }

  /// `nodes` as printed and read again, with their shared parts.
  std::vector<Node> readBack(const std::vector<Node>& nodes) {
    const Terms terms = makeTerms(graph_, nodes, names_);
    expression::SymbolTable symbols = symbols_;
    for (const auto& [name, term] : terms.shared) {
      symbols[name.text] = parse(toText(*term), symbols, graph_);
    }
    std::vector<Node> back;
    for (const auto& root : terms.roots) back.push_back(parse(toText(*root), symbols, graph_));
    return back;
  }

  Graph graph_;
  expression::SymbolTable symbols_;
  Names names_;
};

double evaluate(const Graph& graph, Node node, const double* w, double a) {
  const double zero[2] = {};
  const StateView state{0.3, zero, w, zero, &a, zero};
  double value = 0.0;
  expression::Tape(graph, {node}).evaluate(state, &value);
  return value;
}

TEST_F(Printed, HasAsFewParenthesesAsNeeded) {
  EXPECT_EQ(print("w1 + (w2 - a)"), "w1 + w2 - a");
  EXPECT_EQ(print("w1 - (w2 - a)"), "w1 + a - w2");
  EXPECT_EQ(print("-(w1*w2)"), "-w1*w2");
  EXPECT_EQ(print("(w1 + w2)*a"), "a*(w1 + w2)");
  EXPECT_EQ(print("w1/(w2*a)"), "w1/(a*w2)");
  EXPECT_EQ(print("w1/w2/a"), "w1/(w2*a)");
  EXPECT_EQ(print("w1/(w2/a)"), "w1*a/w2");
  EXPECT_EQ(print("(-w1)^2"), "w1^2");
  EXPECT_EQ(print("(-w1)^0.7"), "(-w1)^0.7");
  EXPECT_EQ(print("(w1^2)^w2"), "(w1^2)^w2");
  EXPECT_EQ(print("w1^(w2^a)"), "w1^(w2^a)");
  EXPECT_EQ(print("2^-w1"), "2^(-w1)");
  EXPECT_EQ(print("exp(-(w1 - w2))"), "exp(w2 - w1)");
  EXPECT_EQ(print("if(w1 <= w2, w1, -a)"), "if(w1 <= w2, w1, -a)");
}

TEST_F(Printed, IsSimplifiedAsOnPaper) {
  EXPECT_EQ(print("w1*w1*w1"), "w1^3");
  EXPECT_EQ(print("2*(3*w1)"), "6*w1");
  EXPECT_EQ(print("w1 + 2*w1 - 5*w2"), "3*w1 - 5*w2");
  EXPECT_EQ(print("w1*w2 + a*w1 + w2*w1"), "2*w1*w2 + a*w1");
  EXPECT_EQ(print("w1^2/w1"), "w1");
  EXPECT_EQ(print("-w1 + w2"), "w2 - w1");
}

/// Derivatives of what grows are made in a scale of their own (graph.h).
TEST_F(Printed, ShowsNoScale) {
  const Node growing = read("if(w1 < 2, exp(3*w1), 0) + a*exp(w2 + w1)");
  const Terms terms =
      makeTerms(graph_, {graph_.differentiate(growing, slotOf(Source::kVelocity, 0))}, names_);
  EXPECT_EQ(toText(*terms.roots[0]), "if(2 <= w1, 0, 3*exp(3*w1)) + a*exp(w1 + w2)");
}

TEST_F(Printed, HasShortNumbers) {
  EXPECT_EQ(print("(0.1 + 0.2)*w1"), "0.3*w1");
  EXPECT_EQ(print("w1/3"), "w1/3");
  EXPECT_EQ(print("2*w1/3"), "2*w1/3");
  EXPECT_EQ(print("w1/0.25"), "4*w1");
  EXPECT_EQ(print("2*pi*w1"), "2*pi*w1");
  EXPECT_EQ(print("w1 + 1/3"), "1/3 + w1");
  EXPECT_EQ(print("w1^(1/3)"), "w1^(1/3)");
  EXPECT_EQ(print("1e-9*w1 + 1e20"), "1e20 + 1e-9*w1");
}

TEST_F(Printed, IsLatex) {
  EXPECT_EQ(printLatex("tanh(w1)^2/(w1 + w2)"), "\\frac{\\tanh^{2}\\left(w1\\right)}{w1 + w2}");
  EXPECT_EQ(printLatex("abs(w1)*sqrt(w2)"), "\\left|w1\\right| \\, \\sqrt{w2}");
  EXPECT_EQ(printLatex("1e-9*w1"), "10^{-9} \\, w1");
  EXPECT_EQ(printLatex("(w1 + w2)/((w1 - a)*(w2 - a))"),
            "\\frac{w1 + w2}{\\left(w1 - a\\right) \\, \\left(w2 - a\\right)}");
  EXPECT_EQ(printLatex("if(w1 <= 0, w1, w2)"),
            "\\left(\\begin{cases} w1 & \\text{if } w1 \\le 0 \\\\ w2 & \\text{else} "
            "\\end{cases}\\right)");
}

TEST_F(Printed, NamesWhatOccursRepeatedly) {
  names_.nodes[read("w1 - a*w2").index] = {"slip", "s"};
  const Terms terms =
      makeTerms(graph_,
                {read("tanh(w1*w2 + 1) + w1"), read("(w1 - a*w2)^2 + 2*(w1 - a*w2)"),
                 read("1 - tanh(w1*w2 + 1)^2"), read("sin(w1)*cos(w2)")},
                names_);
  ASSERT_EQ(terms.shared.size(), 2U);
  std::map<std::string, std::string> shared;
  for (const auto& [name, term] : terms.shared) shared[name.text] = toText(*term);
  EXPECT_EQ(shared.at("a2"), "tanh(1 + w1*w2)") << "a and a1 are taken";
  EXPECT_EQ(shared.at("slip"), "w1 - a*w2");
  EXPECT_EQ(toText(*terms.roots[1]), "slip^2 + 2*slip");
}

TEST_F(Printed, ReadsBackToTheSameValues) {
  const char* const formulas[] = {
      "12*((50-w1)/50)/(((50-w1)/50)^2+0.04)",
      "0.2*(w2-(0.6+0.2*sin(0.7*a))*w1)*(1+0.05*(w1^2+w2^2)) + w2-(0.6+0.2*sin(0.7*a))*w1",
      "exp(-(w1/3)^2)*atan2(w1, w2) - log(1 + w2^2)/7",
      "if(w1 > w2, min(w1, a), max(w2, a)) + clamp(w1, -1, 1)*sign(w2) - abs(a)^1.5",
      "1/(1 + exp(2*w1 - w2)) + cosh(w1/5) - 2^-w1^2",
      "(w1 - w2)^-3 + (1 + w1^2)^0.7 - (1 + w2^2)^-(a^2)",
      "sqrt(1 + w1^2)*tan(w2/9)/(3*a) - 2*pi/7*w1 + asin(w1/20)*acos(w2/20) - atan(a)"};
  std::vector<Node> nodes;
  for (const char* formula : formulas) {
    nodes.push_back(read(formula));
    for (const int slot : {slotOf(Source::kVelocity, 0), slotOf(Source::kInput, 0)}) {
      nodes.push_back(graph_.differentiate(nodes.back(), slot));
    }
  }
  const std::vector<Node> back = readBack(nodes);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> draw(-3.0, 3.0);
  for (int n = 0; n < 50; ++n) {
    const double w[2] = {draw(random), draw(random)};
    const double a = draw(random);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double expected = evaluate(graph_, nodes[i], w, a);
      const double found = evaluate(graph_, back[i], w, a);
      if (std::isnan(expected) && std::isnan(found)) continue;
      EXPECT_NEAR(found, expected, 1e-11 * (1.0 + std::abs(expected)))
          << "of formula " << formulas[i / 3] << ", node " << i % 3;
    }
  }
}

// ------------------------------------------------------------------------------------------ scenes

std::vector<EquationSection> explain(const std::string& yaml, ComponentFactory& factory) {
  return writeEquations(Simulation(readScene(readYamlText(yaml, "scene"), factory)));
}

class Square final : public OpaqueFunction {
 public:
  Square() : OpaqueFunction(1) {}
  double value(const double* x) const override { return x[0] * x[0]; }
  void calcGradient(const double* x, double* gradient) const override { gradient[0] = 2.0 * x[0]; }
};

class OpaqueTorque final : public Torque {
  void build(LawContext& scene) override {
    const Shaft shaft = scene.shaft("shaft");
    scene.apply(shaft, -scene.function(std::make_shared<Square>(), {shaft.velocity}));
  }
};

class Factory final : public BuiltinComponentFactory {
 public:
  TorquePtr createTorque(const std::string& type) override {
    if (type == "test/Opaque") return std::make_shared<OpaqueTorque>();
    return BuiltinComponentFactory::createTorque(type);
  }
};

const char* const kScene = R"yaml(
shafts: [a, b]
a: {inertia: {mean: 2.0, harmonics: [{order: 2, cos: 0.3}]}}
b: {inertia: 3.0}
torques: [own, coupling, spring, constant]
own: {type: test/Opaque, shaft: a}
coupling: {type: variator_sim/ElasticCoupling, shafts: [a, b], stiffness: 50.0, damping: 2.0}
spring: {type: variator_sim/ExpressionTorque, shaft: b, torque: "map(w_b)"}
constant: {type: variator_sim/ExpressionTorque, shaft: b, torque: "5"}
tables: [map]
map: {x: [0, 1, 2], values: [0, 3, 4]}
constraints: [law]
law: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e_a*(1 + 0.01*w_a) - 1"}
initial: {acceleration: [1.0, 0.0]}
)yaml";

TEST(ExplainedScene, TellsOfEveryElement) {
  Factory factory;
  const std::string text = layOutText(explain(kScene, factory), "scene");
  const char* const expected[] = {"J_a = 2 + 0.3*cos(2*phi_a)",
                                  "Q_coupling_a  = -transmitted_torque",
                                  "Q_spring  = map(w_b)",
                                  "Q_spring' = e_b*map'(w_b)",
                                  "map(x): table through (0, 0), (1, 3), (2, 4), constant beyond",
                                  "Q_constant' is 0: the torque is constant",
                                  "C_b is 0: law does not read the acceleration of b",
                                  "3*j_b",
                                  "= Q_coupling_b' + Q_spring'\n"};
  for (const char* line : expected) EXPECT_NE(text.find(line), std::string::npos) << line << text;
}

TEST(ExplainedScene, IsBalancedLatex) {
  Factory factory;
  const std::string latex = layOutLatex(explain(kScene, factory), "a_scene");
  int braces = 0;
  for (std::size_t i = 0; i < latex.size(); ++i) {
    if (latex[i] == '\\') {
      ++i;  // \{ is none
    } else if (latex[i] == '{' || latex[i] == '}') {
      braces += latex[i] == '{' ? 1 : -1;
      ASSERT_GE(braces, 0);
    }
  }
  EXPECT_EQ(braces, 0);
  const auto count = [&latex](const std::string& word) {
    int found = 0;
    for (auto at = latex.find(word); at != std::string::npos; at = latex.find(word, at + 1)) {
      ++found;
    }
    return found;
  };
  EXPECT_EQ(count("\\left("), count("\\right)"));
  EXPECT_EQ(count("\\begin{"), count("\\end{"));
  EXPECT_NE(latex.find("\\section*{a\\_scene}"), std::string::npos);
}

}  // namespace
}  // namespace variator_sim
