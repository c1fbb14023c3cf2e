/// The part that torques and constraints have in common.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/rates.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// The outputs that a law names (LawContext::output), computed for samples only, and only on
/// request.
class NamedOutputs {
 public:
  NamedOutputs() = default;
  explicit NamedOutputs(const LawContext& law);

  const std::vector<std::string>& names() const { return names_; }
  /// Returns one node of the scene's graph for each name.
  const std::vector<expression::Node>& nodes() const { return nodes_; }
  /// Writes one value for each name. [loop]
  void evaluate(const StateView& state, double* values) const { tape_.evaluate(state, values); }

 private:
  std::vector<std::string> names_;
  std::vector<expression::Node> nodes_;
  expression::Tape tape_;
};

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
  void configure(ComponentContext& context);
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
  /// Returns the number of the law's switching functions. Steps end at their zeros, because an
  /// error estimate across a kink is unreliable.
  std::size_t switchingFunctions() const { return switching_functions_; }
  /// Returns the named outputs of this element ("slip"). `state.acceleration` may be read.
  const NamedOutputs& outputs() const { return outputs_; }

 protected:
  Law() = default;
  Law(std::string name, int shaft_count, std::shared_ptr<expression::Graph> graph)
      : name_(std::move(name)), shaft_count_(shaft_count), graph_(std::move(graph)) {}

  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;
  /// Derives what follows from the law as stated. Throws SceneError.
  virtual void derive(const LawContext& law, const ComponentContext& context) = 0;
  void setFormulas(std::vector<expression::Node> formulas) { formulas_ = std::move(formulas); }
  const std::shared_ptr<expression::Graph>& sharedGraph() const { return graph_; }

 private:
  std::string name_;
  int shaft_count_ = 0;
  std::shared_ptr<expression::Graph> graph_;
  std::vector<expression::Node> formulas_;
  std::size_t switching_functions_ = 0;
  std::vector<Holding> holdings_;
  NamedOutputs outputs_;
};

}  // namespace variator_sim
