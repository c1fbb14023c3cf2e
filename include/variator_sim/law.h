/// The part that torques and constraints have in common.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// An element of a scene that states its law as formulas, or by an OpaqueFunction.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw: they run in the
/// real-time loop. A value that does not exist is NaN and stops the motion by name. One instance is
/// evaluated by one thread at a time.
class Law {
 public:
  virtual ~Law() = default;
  Law(const Law&) = delete;
  Law& operator=(const Law&) = delete;

  /// Builds the law. Called once, before any evaluation. Throws SceneError.
  void configure(LawContext& law);
  const std::string& name() const { return name_; }
  int shaftCount() const { return shaft_count_; }

  expression::Graph& graph() const { return *graph_; }
  /// Returns the formulas that the law states: Q of each shaft; f, psi, or C eta + c0.
  const std::vector<expression::Node>& formulas() const { return formulas_; }
  bool callsOpaqueFunction() const { return graph_->hasOpaque(formulas_); }
  /// Returns the ways in which the element holds; most have none.
  const std::vector<Holding>& holdings() const { return holdings_; }
  /// Returns the name of one of them in the scene.
  std::string nameOf(const Holding& it) const {
    return name_ + (it.part.empty() ? "" : "/" + it.part);
  }
  /// Returns the outputs that the law names ("slip"), formulas that may read accelerations.
  const std::vector<std::pair<std::string, expression::Node>>& outputs() const { return outputs_; }

 protected:
  Law() = default;
  Law(std::string name, int shaft_count, std::shared_ptr<expression::Graph> graph)
      : name_(std::move(name)), shaft_count_(shaft_count), graph_(std::move(graph)) {}

  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;
  /// Derives what follows from the law as stated. Throws SceneError.
  virtual void derive(const LawContext& law) = 0;
  void setFormulas(std::vector<expression::Node> formulas) { formulas_ = std::move(formulas); }
  const std::shared_ptr<expression::Graph>& sharedGraph() const { return graph_; }

 private:
  std::string name_;
  int shaft_count_ = 0;
  std::shared_ptr<expression::Graph> graph_;
  std::vector<expression::Node> formulas_;
  std::vector<Holding> holdings_;
  std::vector<std::pair<std::string, expression::Node>> outputs_;
};

}  // namespace variator_sim
