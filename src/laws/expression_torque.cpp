// A torque Q(t, phi, omega) on one shaft that the scene states as a formula; its rate is exact.
#include "variator_sim/expression/parser.h"
#include "variator_sim/laws.h"

namespace variator_sim {

void ExpressionTorque::build(LawContext& scene) {
  scene.keys({"shaft", "reaction_on", "torque", "parameters"});
  ParameterReader& parameters = scene.parameters();
  expression::Graph& graph = *scene.graph();
  const Shaft shaft = scene.shaft("shaft");
  const expression::Node node =
      readFormula(scene, "torque", expression::FormulaKind::kTorque, graph);
  const Expression torque(graph, node);
  scene.tellOf("torque");
  if (!parameters.has("reaction_on")) {
    scene.apply(shaft, torque);
    return;
  }
  const Shaft other = scene.shaft("reaction_on");
  if (other.index == shaft.index) {
    throw parameters.error(
        "reaction_on", inQuotes(parameters.text("reaction_on")) +
                           " is the shaft that the torque acts on, too: the two cancel; allowed: "
                           "another shaft");
  }
  scene.applyBetween(shaft, other, torque);
}

}  // namespace variator_sim
