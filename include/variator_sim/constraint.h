/// Nonholonomic constraints: the base class of constraint plugins.
#pragma once

#include <memory>
#include <string>

#include "variator_sim/component_context.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Partial derivatives of psi; s values per array. Zero when handed to a constraint, which writes
/// only those that are not zero.
struct ConstraintPartials {
  double time = 0.0;                     ///< dpsi/dt
  double angle[kMaxShafts] = {};         ///< dpsi/dphi
  double velocity[kMaxShafts] = {};      ///< dpsi/domega
  double acceleration[kMaxShafts] = {};  ///< dpsi/depsilon, the row of C
  double input[kMaxInputs] = {};         ///< dpsi/du of commanded inputs
};

/// One second-order constraint psi(t, phi, omega, epsilon, u) = 0 [11]. The motion obeys its
/// derivative C eta + c0 = 0 [12], with
///     C = dpsi/depsilon,   c0 = dpsi/dt + dpsi/dphi omega + dpsi/domega epsilon + dpsi/du u'.
///
/// A plugin writes psi and its partial derivatives; from them the row of C and c0 are composed
/// here. A plugin that can do it in fewer operations overrides doCalcRow as well.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw: they run in the
/// real-time loop. A value that does not exist is returned as NaN and stops the motion by name.
class Constraint {
 public:
  virtual ~Constraint() = default;
  Constraint(const Constraint&) = delete;
  Constraint& operator=(const Constraint&) = delete;

  /// Reads the parameters. Called once, before any evaluation. Throws SceneError.
  void configure(ComponentContext& context) {
    name_ = context.name();
    shaft_count_ = context.shaftCount();
    doConfigure(context);
  }
  /// The constraint's name in the scene.
  const std::string& name() const { return name_; }
  /// Number of shafts s of the scene.
  int shaftCount() const { return shaft_count_; }

  /// psi, in the constraint's own unit.
  double calcResidual(const StateView& state) const { return doCalcResidual(state); }
  /// psi and C = dpsi/depsilon (s values, all written).
  double calcResidualAndJacobian(const StateView& state, double* C) const {
    return doCalcResidualAndJacobian(state, C);
  }
  /// C (s values, all written) and c0 of C eta + c0 = 0 [12].
  void calcRow(const StateView& state, double* C, double* c0) const { doCalcRow(state, C, c0); }
  /// dpsi/du of all inputs (input_count values, all written): what a jump of u does to psi.
  void calcInputJacobian(const StateView& state, int input_count, double* Cu) const {
    doCalcInputJacobian(state, input_count, Cu);
  }
  /// d2psi/depsilon2 (s x s values, row by row, all written). It only steers Newton's iteration for
  /// the accelerations of least reaction, never the motion; not for the real-time loop.
  void calcHessian(const StateView& state, double* H) const { doCalcHessian(state, H); }
  /// True when C does not depend on epsilon: a jump is then one exact linear projection.
  bool isLinearInAcceleration() const { return doIsLinearInAcceleration(); }
  /// True when psi reads a commanded input.
  bool readsInputs() const { return doReadsInputs(); }

 protected:
  Constraint() = default;
  virtual void doConfigure(ComponentContext& context) = 0;
  virtual double doCalcResidual(const StateView& state) const = 0;
  /// Adds nothing to entries that are zero: `partials` arrives zeroed.
  virtual void doCalcPartials(const StateView& state, ConstraintPartials& partials) const = 0;

  virtual double doCalcResidualAndJacobian(const StateView& state, double* C) const;
  virtual void doCalcRow(const StateView& state, double* C, double* c0) const;
  virtual void doCalcInputJacobian(const StateView& state, int input_count, double* Cu) const;
  /// By default central differences of C.
  virtual void doCalcHessian(const StateView& state, double* H) const;
  virtual bool doIsLinearInAcceleration() const { return false; }
  virtual bool doReadsInputs() const { return false; }

 private:
  std::string name_;
  int shaft_count_ = 0;
};

using ConstraintPtr = std::shared_ptr<Constraint>;

}  // namespace variator_sim
