#include "dynamics/scene_program.h"

#include "variator_sim/formula_constraint.h"
#include "variator_sim/formula_torque.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::Tape;

SceneProgram::SceneProgram(const Scene& scene) {
  Graph& graph = *scene.graph;
  const auto s = static_cast<std::size_t>(scene.shaftCount());
  const std::vector<Node> nothing(s, graph.constant(0.0));
  // An element of another graph (made for itself, not by the scene's reader) is one of its own.
  const auto is_here = [&graph](const auto* law) {
    return law != nullptr && &law->graph() == &graph;
  };

  std::vector<Node> torque = nothing;
  std::vector<Node> rate = nothing;
  const auto add = [&graph](const std::vector<FormulaTorque::ShaftNode>& terms,
                            std::vector<Node>& sums) {
    for (const auto& [shaft, term] : terms) {
      Node& sum = sums[static_cast<std::size_t>(shaft)];
      sum = graph.isConstant(sum, 0.0) ? term : graph.add(sum, term);
    }
  };
  for (const TorquePtr& element : scene.torques) {
    const auto* law = dynamic_cast<const FormulaTorque*>(element.get());
    if (!is_here(law)) {
      opaque_torques_.push_back(element.get());
      continue;
    }
    add(law->torques(), torque);
    add(law->rates(), rate);
  }

  std::vector<Node> rows;
  for (const ConstraintPtr& constraint : scene.constraints) {
    const auto* law = dynamic_cast<const FormulaConstraint*>(constraint.get());
    if (is_here(law)) {
      rows.insert(rows.end(), law->row().begin(), law->row().end());
    } else {
      opaque_rows_.push_back(static_cast<int>(rows.size() / (s + 1)));
      rows.insert(rows.end(), s + 1, graph.constant(0.0));
    }
  }
  std::vector<Node> rate_and_rows = rate;
  rate_and_rows.insert(rate_and_rows.end(), rows.begin(), rows.end());
  torque_ = Tape(graph, torque);
  rate_ = Tape(graph, rate);
  rows_ = Tape(graph, rows);
  rate_and_rows_ = Tape(graph, rate_and_rows);
}

}  // namespace variator_sim
