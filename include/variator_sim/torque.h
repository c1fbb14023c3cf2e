/// Applied generalized torques Q(t, phi, omega, u): the base class of torque plugins.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/guard.h"
#include "variator_sim/law_context.h"
#include "variator_sim/named_outputs.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// One torque element. `build` states the torques Q that it applies (positive accelerates); their
/// total rate Q' = dQ/dt + dQ/dphi omega + dQ/domega epsilon + dQ/du u', its derivatives,
/// dependences and switching functions (guards) follow from them.
///
///     class Brake : public variator_sim::Torque {
///       void build(variator_sim::LawContext& scene) override {
///         const variator_sim::Shaft wheel = scene.shaft("shaft");
///         scene.apply(wheel, -scene.quantity("torque") * tanh(wheel.velocity / 0.1));
///       }
///     };
///
/// A law that is no formula calls an OpaqueFunction.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw: they run in the
/// real-time loop. A value that does not exist is NaN and stops the motion by name. One instance is
/// evaluated by one thread at a time.
class Torque {
 public:
  /// A formula of the scene's graph and the shaft that it belongs to.
  using ShaftNode = std::pair<int, expression::Node>;

  virtual ~Torque() = default;
  Torque(const Torque&) = delete;
  Torque& operator=(const Torque&) = delete;

  /// Builds the law. Called once, before any evaluation. Throws SceneError.
  void configure(ComponentContext& context);
  /// Returns the element's name in the scene.
  const std::string& name() const { return name_; }
  /// Returns the number of shafts s of the scene.
  int shaftCount() const { return shaft_count_; }

  expression::Graph& graph() const { return *graph_; }
  /// Returns Q, N m, each shaft once.
  const std::vector<ShaftNode>& torques() const { return torques_; }
  /// Returns Q', N m/s, of those shafts; 0 left out.
  const std::vector<ShaftNode>& rates() const { return rates_; }
  /// True when the law calls an OpaqueFunction.
  bool callsOpaqueFunction() const;
  /// Returns the shafts, by index, that this element acts on, ascending. Not for the loop.
  std::vector<int> shafts() const;

  /// Q += this element's torques, N m, s values. `state.acceleration` is not read.
  void addTorque(const StateView& state, double* torque) const;
  /// Q' += the total rate of this element's torques, N m/s, s values.
  void addTorqueRate(const StateView& state, double* torque_rate) const;
  /// Adds dQ'_i/dx_q to derivatives[q * s + i], x = (phi, omega, epsilon): 3s directions of s
  /// values each, the first s by the angles. Only stiff steppers need it.
  void addTorqueRateDerivatives(const StateView& state, double* derivatives) const;

  /// Tell whether Q and Q' read the time and the angles. An elastic coupling's torque reads the
  /// angles, its rate does not.
  Dependence torqueDependence() const { return torque_dependence_; }
  Dependence rateDependence() const { return rate_dependence_; }
  /// Returns the law's switching functions. Steps end at their zeros, because an error estimate
  /// across a kink is unreliable.
  const std::vector<GuardPtr>& guards() const { return guards_; }
  /// Returns the instants, s, in any order, at which this law or a derivative of it that counts is
  /// not smooth (the points of a table over time, say): steps end there.
  const std::vector<double>& instants() const { return instants_; }
  /// Returns the named outputs of this element ("slip"). `state.acceleration` may be read.
  const NamedOutputs& outputs() const { return outputs_; }

 protected:
  Torque() = default;
  /// States the law. Called once. Throws SceneError.
  virtual void build(LawContext& scene) = 0;

 private:
  std::string name_;
  int shaft_count_ = 0;
  std::shared_ptr<expression::Graph> graph_;
  std::vector<ShaftNode> torques_;
  std::vector<ShaftNode> rates_;
  expression::Tape torque_;                        ///< torques_
  expression::Tape rate_;                          ///< rates_
  expression::StateDerivatives rate_derivatives_;  ///< derivatives of rates_
  Dependence torque_dependence_;
  Dependence rate_dependence_;
  std::vector<GuardPtr> guards_;
  std::vector<double> instants_;  ///< s
  NamedOutputs outputs_;
};

using TorquePtr = std::shared_ptr<Torque>;
/// An older name of the class.
using FormulaTorque = Torque;

}  // namespace variator_sim
