#include "dynamics/scene_program.h"

#include "model/formula_laws.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;

SceneProgram::SceneProgram(const Scene& scene, const SceneProgram* like)
    : scene_(scene), S(scene.shaftCount()) {
  if (like != nullptr) {
    torque_ = like->torque_;
    rate_ = like->rate_;
    rows_ = like->rows_;
    velocity_level_ = like->velocity_level_;
    acceleration_level_ = like->acceleration_level_;
    return;
  }
  requireOwnFormulas(scene);
  Graph& graph = *scene.graph;
  torque_ = expression::Tape(graph, sumTorques(scene, &Torque::torques));
  rate_ = expression::Tape(graph, sumTorques(scene, &Torque::rates));
  makeRows();
}

void SceneProgram::makeRows() {
  Graph& graph = *scene_.graph;
  std::vector<Node> rows;
  std::vector<Node> velocities;
  std::vector<Node> accelerations;
  for (const ConstraintPtr& constraint : scene_.constraints) {
    const std::vector<Node>& row = constraint->row();
    // f or psi, and C
    const auto add_level = [&row](Node residual, std::vector<Node>& level) {
      level.push_back(residual);
      level.insert(level.end(), row.begin(), row.end() - 1);
    };
    if (constraint->order() == 1) add_level(constraint->function(), velocities);
    if (constraint->order() < 3) add_level(constraint->secondOrder(), accelerations);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  rows_ = expression::Tape(graph, rows);
  velocity_level_ = expression::Tape(graph, velocities);
  acceleration_level_ = expression::Tape(graph, accelerations);
}

}  // namespace variator_sim
