/// Applied generalized torques Q(t, phi, omega, u): the base class of torque plugins.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/guard.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// One torque element. It adds to the applied torque Q of any shafts (positive accelerates) and to
/// its total rate Q' = dQ/dt + dQ/dphi omega + dQ/domega epsilon + dQ/du u'.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw: they run in the
/// real-time loop. A value that does not exist is returned as NaN and stops the motion by name.
class Torque {
 public:
  virtual ~Torque() = default;
  Torque(const Torque&) = delete;
  Torque& operator=(const Torque&) = delete;

  /// Reads the parameters. Called once, before any evaluation. Throws SceneError.
  void configure(ComponentContext& context) {
    name_ = context.name();
    shaft_count_ = context.shaftCount();
    doConfigure(context);
  }
  /// The element's name in the scene.
  const std::string& name() const { return name_; }
  /// Number of shafts s of the scene.
  int shaftCount() const { return shaft_count_; }

  /// Q += this element's torques, N m, s values. `state.acceleration` is not to be read.
  void addTorque(const StateView& state, double* torque) const { doAddTorque(state, torque); }
  /// Q' += the total rate of this element's torques, N m/s, s values.
  void addTorqueRate(const StateView& state, double* torque_rate) const {
    doAddTorqueRate(state, torque_rate);
  }
  /// dQ'/d(phi, omega, epsilon): 3s directions of s values each, the first s by the angles. Adds
  /// dQ'_i/dx_q to derivatives[q * s + i]. Only stiff steppers ask for it.
  void addTorqueRateDerivatives(const StateView& state, double* derivatives) const {
    doAddTorqueRateDerivatives(state, derivatives);
  }
  /// What Q and what Q' depend on. An elastic coupling's torque depends on the angles, its rate
  /// does not.
  Dependence torqueDependence() const { return doTorqueDependence(); }
  Dependence rateDependence() const { return doRateDependence(); }
  /// Where this law changes its branch, see Guard: a step ends there, for the error estimate of one
  /// that runs over a kink knows little of it. Asked for once, after `configure`.
  std::vector<GuardPtr> guards() const;
  /// The instants, s, at which this law or a derivative of it that counts is not smooth (the points
  /// of a table over time, say), in any order: steps end there.
  std::vector<double> instants() const { return doInstants(); }
  /// The shafts, by index, that this element acts on: it adds to no other's Q. Ascending. Throws
  /// SceneError when the scene has no such shaft. For the load only.
  std::vector<int> shafts() const;
  /// What this element tells beside its torques ("slip"), named as elements are. Asked for once,
  /// after `configure`.
  std::vector<std::string> outputNames() const { return doOutputNames(); }
  /// Their values, outputNames().size() of them, all written. Here `state.acceleration` may be
  /// read. Only for samples, and only while somebody wants to see them.
  void calcOutputs(const StateView& state, double* values) const { doCalcOutputs(state, values); }

 protected:
  Torque() = default;
  virtual void doConfigure(ComponentContext& context) = 0;
  virtual void doAddTorque(const StateView& state, double* torque) const = 0;
  virtual void doAddTorqueRate(const StateView& state, double* torque_rate) const = 0;
  /// By default central differences of doAddTorqueRate.
  virtual void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const;
  virtual Dependence doTorqueDependence() const { return {}; }
  virtual Dependence doRateDependence() const { return {}; }
  /// How many switches this law has: functions of the state that are zero where Q or Q' has a kink.
  virtual int doSwitchCount() const { return 0; }
  /// Their values, doSwitchCount() of them, all written.
  virtual void doCalcSwitches(const StateView& /*state*/, double* /*values*/) const {}
  /// True when the law itself jumps at the zeros of a switch, and not only a derivative of it.
  virtual bool doSwitchJumps(int /*index*/) const { return false; }
  /// Guards beside those of the switches.
  virtual std::vector<GuardPtr> doGuards() const { return {}; }
  virtual std::vector<double> doInstants() const { return {}; }
  /// By default all.
  virtual std::vector<int> doShafts() const;
  virtual std::vector<std::string> doOutputNames() const { return {}; }
  virtual void doCalcOutputs(const StateView& /*state*/, double* /*values*/) const {}

 private:
  std::string name_;
  int shaft_count_ = 0;
};

using TorquePtr = std::shared_ptr<Torque>;

}  // namespace variator_sim
