/// Nonholonomic constraints: the base class of constraint plugins.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/guard.h"
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

class Constraint;
using ConstraintPtr = std::shared_ptr<Constraint>;

/// One constraint, of order 1, 2 or 3:
///     order 1   f(t, phi, omega, u) = 0             (kinematic variators)
///     order 2   psi(t, phi, omega, epsilon, u) = 0  [11]
///     order 3   C eta + c0 = 0, given directly      [1]
/// The motion obeys its third-order form C eta + c0 = 0 [12]: psi differentiated once, f twice. All
/// forms of one constraint have the same C: df/domega = df'/depsilon = df''/deta.
///
/// A plugin of order 2 writes psi and its partial derivatives; from them are composed here
///     C = dpsi/depsilon,   c0 = dpsi/dt + dpsi/dphi omega + dpsi/domega epsilon + dpsi/du u'.
/// A plugin that can do it in fewer operations overrides doCalcRow as well. A plugin of order 1
/// writes f and its partial derivatives and must override doCalcRow, which needs second
/// derivatives; one of order 3 needs doCalcRow only.
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

  /// 1, 2 or 3.
  int order() const { return doOrder(); }

  /// What is to be zero: f (order 1) or psi (order 2), in the constraint's own unit. Not for order
  /// 3, whose residual C eta + c0 needs the jerk.
  double calcResidual(const StateView& state) const { return doCalcResidual(state); }
  /// Order 1 only: f and C = df/domega (s values, all written).
  double calcVelocityResidualAndJacobian(const StateView& state, double* C) const {
    return doCalcVelocityResidualAndJacobian(state, C);
  }
  /// Orders 1 and 2: the second-order form, f' or psi, and its C = d/depsilon (s values, all
  /// written).
  double calcResidualAndJacobian(const StateView& state, double* C) const {
    return doCalcResidualAndJacobian(state, C);
  }
  /// C (s values, all written) and c0 of C eta + c0 = 0 [12].
  void calcRow(const StateView& state, double* C, double* c0) const { doCalcRow(state, C, c0); }
  /// dpsi/du of all inputs (input_count values, all written): what a jump of u does to psi.
  void calcInputJacobian(const StateView& state, int input_count, double* Cu) const {
    doCalcInputJacobian(state, input_count, Cu);
  }
  /// Orders 1 and 2: the partial derivatives of f or psi, all of them.
  void calcPartials(const StateView& state, ConstraintPartials& partials) const {
    partials = {};
    doCalcPartials(state, partials);
  }
  /// The parts of dC/dt = D + H eta: D (s values) and H = dC/depsilon (s x s values, row by row),
  /// all written. Only the classical Gauss principle asks for them.
  void calcJacobianRate(const StateView& state, double* D, double* H) const {
    doCalcJacobianRate(state, D, H);
  }
  /// H = dC/depsilon (s x s values, row by row, all written): for psi its second derivatives. It
  /// steers Newton's iteration for the accelerations of least reaction.
  void calcHessian(const StateView& state, double* H) const { doCalcHessian(state, H); }
  /// d(C, c0)/d(phi, omega, epsilon): 3s directions, the first s by the angles; all written.
  /// dC_i/dx_q to dC[q * s + i], dc0/dx_q to dc0[q]. Only stiff steppers ask for it.
  void calcRowDerivatives(const StateView& state, double* dC, double* dc0) const {
    doCalcRowDerivatives(state, dC, dc0);
  }
  /// What f or psi and its derivatives depend on.
  Dependence dependence() const { return doDependence(); }
  /// True when C is the same at every state: it is factored once.
  bool hasConstantJacobian() const { return doHasConstantJacobian(); }
  /// True when C does not depend on epsilon: a jump is then one exact linear projection.
  bool isLinearInAcceleration() const { return doIsLinearInAcceleration(); }
  /// The accelerations that the second-order form reads otherwise than with constant coefficients,
  /// bit i for shaft i: the least reaction is looked for over these alone.
  unsigned nonlinearAccelerations() const { return doNonlinearAccelerations(); }
  /// The degree of the second-order form as a polynomial of the accelerations; -1 where it is none,
  /// or nobody knows.
  int accelerationDegree() const { return doAccelerationDegree(); }
  /// Functions of the state at whose zeros psi, though continuous, has a kink in epsilon (abs, min,
  /// max of accelerations), each as a constraint of order 2. The least reaction may lie there.
  const std::vector<ConstraintPtr>& kinks() const { return doKinks(); }
  /// True when psi reads a commanded input.
  bool readsInputs() const { return doReadsInputs(); }
  /// Where this law changes its branch, see Guard: a step ends there, for the error estimate of one
  /// that runs over a kink knows little of it. Asked for once, after `configure`.
  std::vector<GuardPtr> guards() const;
  /// The instants, s, at which this law or a derivative of it that counts is not smooth (the points
  /// of a table over time, say), in any order: steps end there.
  std::vector<double> instants() const { return doInstants(); }
  /// What this constraint tells beside its residual ("slip"), named as elements are. Asked for
  /// once, after `configure`.
  std::vector<std::string> outputNames() const { return doOutputNames(); }
  /// Their values, outputNames().size() of them, all written. Only for samples, and only while
  /// somebody wants to see them.
  void calcOutputs(const StateView& state, double* values) const { doCalcOutputs(state, values); }

 protected:
  Constraint() = default;
  /// One that is made by another and not configured.
  Constraint(std::string name, int shaft_count)
      : name_(std::move(name)), shaft_count_(shaft_count) {}
  virtual void doConfigure(ComponentContext& context) = 0;
  virtual int doOrder() const { return 2; }
  virtual double doCalcResidual(const StateView& state) const = 0;
  /// Partial derivatives of f or psi. Adds nothing to entries that are zero: `partials` arrives
  /// zeroed.
  virtual void doCalcPartials(const StateView& state, ConstraintPartials& partials) const = 0;

  virtual double doCalcVelocityResidualAndJacobian(const StateView& state, double* C) const;
  virtual double doCalcResidualAndJacobian(const StateView& state, double* C) const;
  virtual void doCalcRow(const StateView& state, double* C, double* c0) const;
  virtual void doCalcInputJacobian(const StateView& state, int input_count, double* Cu) const;
  /// By default central differences of C.
  virtual void doCalcHessian(const StateView& state, double* H) const;
  /// By default central differences of C along the motion, and doCalcHessian.
  virtual void doCalcJacobianRate(const StateView& state, double* D, double* H) const;
  /// By default central differences of doCalcRow.
  virtual void doCalcRowDerivatives(const StateView& state, double* dC, double* dc0) const;
  virtual Dependence doDependence() const { return {}; }
  virtual bool doHasConstantJacobian() const { return false; }
  virtual bool doIsLinearInAcceleration() const { return false; }
  /// By default none where psi is linear in them, all otherwise.
  virtual unsigned doNonlinearAccelerations() const;
  virtual int doAccelerationDegree() const { return isLinearInAcceleration() ? 1 : -1; }
  /// By default none.
  virtual const std::vector<ConstraintPtr>& doKinks() const;
  virtual bool doReadsInputs() const { return false; }
  /// How many switches this law has: functions of the state that are zero where f, psi or c0 has a
  /// kink.
  virtual int doSwitchCount() const { return 0; }
  /// Their values, doSwitchCount() of them, all written.
  virtual void doCalcSwitches(const StateView& /*state*/, double* /*values*/) const {}
  /// True when the law itself jumps at the zeros of a switch, and not only a derivative of it.
  virtual bool doSwitchJumps(int /*index*/) const { return false; }
  /// Guards beside those of the switches.
  virtual std::vector<GuardPtr> doGuards() const { return {}; }
  virtual std::vector<double> doInstants() const { return {}; }
  virtual std::vector<std::string> doOutputNames() const { return {}; }
  virtual void doCalcOutputs(const StateView& /*state*/, double* /*values*/) const {}

 private:
  std::string name_;
  int shaft_count_ = 0;
};

}  // namespace variator_sim
