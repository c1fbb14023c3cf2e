/// Torques written as formulas: the base class of torque plugins that state their law once.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"
#include "variator_sim/named_outputs.h"
#include "variator_sim/torque.h"

namespace variator_sim {

/// A torque element that says in `build` which torques it applies; its rate, derivatives,
/// dependences and edges follow from them.
///
///     class Brake : public variator_sim::FormulaTorque {
///       void build(variator_sim::LawContext& scene) override {
///         const variator_sim::Shaft wheel = scene.shaft("shaft");
///         scene.apply(wheel, -scene.quantity("torque") * tanh(wheel.velocity / 0.1));
///       }
///     };
///
/// A law too large for the exact derivatives of its rate by the state (state_derivatives.h), or
/// with an opaque function, keeps Torque's central differences for them.
///
/// One instance is evaluated by one thread at a time.
class FormulaTorque : public Torque {
 public:
  /// A formula of the scene's graph and the shaft that it belongs to.
  using ShaftNode = std::pair<int, expression::Node>;

  expression::Graph& graph() const { return *graph_; }
  /// Q, N m, each shaft once.
  const std::vector<ShaftNode>& torques() const { return torques_; }
  /// Q', N m/s, of those shafts; 0 left out.
  const std::vector<ShaftNode>& rates() const { return rates_; }
  const NamedOutputs& namedOutputs() const { return outputs_; }

 protected:
  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;

  void doConfigure(ComponentContext& context) final;
  void doAddTorque(const StateView& state, double* torque) const final;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const final;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const final;
  Dependence doTorqueDependence() const final { return torque_dependence_; }
  Dependence doRateDependence() const final { return rate_dependence_; }
  std::vector<int> doShafts() const final;
  std::vector<GuardPtr> doGuards() const final { return guards_; }
  std::vector<double> doInstants() const final { return instants_; }
  std::vector<std::string> doOutputNames() const final { return outputs_.names(); }
  void doCalcOutputs(const StateView& state, double* values) const final {
    outputs_.evaluate(state, values);
  }

 private:
  std::shared_ptr<expression::Graph> graph_;
  std::vector<ShaftNode> torques_;
  std::vector<ShaftNode> rates_;
  expression::Tape torque_;  ///< of torques_
  expression::Tape rate_;    ///< of rates_
  /// Of rates_; empty when they are too large.
  std::optional<expression::StateDerivatives> rate_derivatives_;
  Dependence torque_dependence_;
  Dependence rate_dependence_;
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  NamedOutputs outputs_;
};

}  // namespace variator_sim
