/// Applied generalized torques Q(t, phi, omega, u): the base class of torque plugins.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "variator_sim/law.h"

namespace variator_sim {

/// One torque element. `build` states the torques Q that it applies (positive accelerates); their
/// total rate Q' = dQ/dt + dQ/dphi omega + dQ/domega epsilon + dQ/du u', its derivatives,
/// dependences and switching functions follow from them.
class Torque : public Law {
 public:
  /// A formula of the scene's graph and the shaft that it belongs to.
  using ShaftNode = std::pair<int, expression::Node>;

  /// Returns Q, N m, each shaft once.
  const std::vector<ShaftNode>& torques() const { return torques_; }
  /// Returns Q', N m/s, of those shafts; 0 left out.
  const std::vector<ShaftNode>& rates() const { return rates_; }
  /// Returns the shafts, by index, that this element acts on, ascending. Not for the loop.
  std::vector<int> shafts() const;

  /// Q += this element's torques, N m, s values. `state.acceleration` is not read.
  void addTorque(const StateView& state, double* torque) const;
  /// Q' += the total rate of this element's torques, N m/s, s values.
  void addTorqueRate(const StateView& state, double* torque_rate) const;

 private:
  void derive(const LawContext& law) override;

  std::vector<ShaftNode> torques_;
  std::vector<ShaftNode> rates_;
  expression::Tape torque_;  ///< torques_
  expression::Tape rate_;    ///< rates_
};

using TorquePtr = std::shared_ptr<Torque>;

}  // namespace variator_sim
