#include "dynamics/scene_program.h"

#include "model/formula_laws.h"
#include "variator_sim/expression/state_derivatives.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;

SceneProgram::SceneProgram(const Scene& scene, const SceneProgram* like)
    : scene_(scene), S(scene.shaftCount()) {
  if (like != nullptr) {
    torque_ = like->torque_;
    rate_ = like->rate_;
    rows_ = like->rows_;
    rate_and_rows_ = like->rate_and_rows_;
    velocity_level_ = like->velocity_level_;
    acceleration_level_ = like->acceleration_level_;
    rate_and_level_ = like->rate_and_level_;
    partials_program_ = like->partials_program_;
    partials_ = like->partials_;
    has_partials_ = like->has_partials_;
    return;
  }
  requireOwnFormulas(scene);
  Graph& graph = *scene.graph;
  const std::vector<Node> rate = sumTorques(scene, &Torque::rates);
  torque_ = expression::Tape(graph, sumTorques(scene, &Torque::torques));
  rate_ = expression::Tape(graph, rate);
  makeRows(rate);
  makePartials(rate);
}

void SceneProgram::makeRows(const std::vector<Node>& rate) {
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
  std::vector<Node> rate_and_rows = rate;
  rate_and_rows.insert(rate_and_rows.end(), rows.begin(), rows.end());
  rows_ = expression::Tape(graph, rows);
  rate_and_rows_ = expression::Tape(graph, rate_and_rows);
  velocity_level_ = expression::Tape(graph, velocities);
  acceleration_level_ = expression::Tape(graph, accelerations);
  std::vector<Node> rate_and_level = rate;
  rate_and_level.insert(rate_and_level.end(), accelerations.begin(), accelerations.end());
  rate_and_level_ = expression::Tape(graph, rate_and_level);
}

void SceneProgram::makePartials(const std::vector<Node>& rate) {
  Graph& graph = *scene_.graph;
  using Kind = Partial::Kind;
  std::vector<Node> functions = rate;
  std::vector<Partial> partial_of;
  partial_of.reserve(static_cast<std::size_t>(S));
  for (int i = 0; i < S; ++i) partial_of.push_back({Kind::kRate, 0, i, 0});
  for (int m = 0; m < scene_.constraintCount(); ++m) {
    const ConstraintPtr& constraint = scene_.constraints[static_cast<std::size_t>(m)];
    if (constraint->order() == 3) return;
    functions.insert(functions.end(), constraint->row().begin(), constraint->row().end() - 1);
    functions.push_back(constraint->secondOrder());
    for (int i = 0; i < S; ++i) partial_of.push_back({Kind::kEntry, m, i, 0});
    partial_of.push_back({Kind::kResidual, m, 0, 0});
  }
  using expression::StateDerivatives;
  const auto entries = StateDerivatives::list(graph, functions, S);
  if (!entries) return;
  const std::vector<Node> outputs = StateDerivatives::nodesOf(*entries);
  if (graph.hasOpaque(outputs)) return;
  partials_program_ = expression::Tape(graph, outputs);
  for (const StateDerivatives::Entry& entry : *entries) {
    partials_.push_back(partial_of[static_cast<std::size_t>(entry.node)]);
    partials_.back().q = entry.q;
  }
  has_partials_ = true;
}

}  // namespace variator_sim
