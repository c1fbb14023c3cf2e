/// Trial steps. A stepper makes one step of given size and says what it thinks its error is; who
/// accepts, rejects and chooses sizes is the integrator (integrator.h). The controllers of
/// Boost.Odeint are not used: they accept a step whose error is NaN, and keep the derivative from
/// before a jump.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "dynamics/state_vector.h"
#include "dynamics/step_node.h"
#include "dynamics/system.h"
#include "dynamics/tolerance.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Sums the torque rates at the stages of a step.
struct TorqueGain {
  explicit TorqueGain(int shafts) : change(shafts), largest_rate(shafts) {}
  ShaftVector change;        ///< h sum b_i Q'_i, N m
  ShaftVector largest_rate;  ///< max |Q'_i|, N m/s
  void add(double h, double weight, const double* rate) {
    for (int i = 0; i < change.size(); ++i) {
      change[i] += h * weight * rate[i];
      largest_rate[i] = std::max(largest_rate[i], std::abs(rate[i]));
    }
  }
};

/// Steps x' = system(t, x).
class Stepper {
 public:
  virtual ~Stepper() = default;
  /// The scheme's name, as in `solver/stepper`.
  virtual const char* name() const = 0;
  /// p of the error estimate h^p of the last step, which the step-size control rests on; 0: none,
  /// fixed steps.
  virtual int errorOrder() const = 0;
  /// Returns the cost of one step, in evaluations of the derivative.
  virtual double work() const = 0;
  /// True for an implicit stepper: states that it makes are projected as `projectStiffly` does, and
  /// its stages hold psi = 0 where the system can (keepsConstraintsInStages).
  virtual bool isImplicit() const { return false; }
  /// How easily its last step was made, 1 at the most: what a next step that the error estimate
  /// allows is to be shortened by.
  virtual double ease() const { return 1.0; }

  /// Forgets what belongs to a state: inputs may have changed under it.
  virtual void restart() {}
  /// Forgets everything: the next steps are those of one that is new.
  virtual void forget() { restart(); }
  /// The step that a stepper would make from `from`, at most `limit`, where it knows before making
  /// it; 0 where it does not. [loop]
  virtual double chooseStep(System& /*system*/, const StepNode& /*from*/, double /*limit*/) {
    return 0.0;
  }
  /// One step by h from `from`, whose derivative is known. Returns the estimated local error: its
  /// largest component in units of the tolerance; NaN when any value is. [loop]
  virtual double step(System& system, const StepNode& from, double h, State& x_new) = 0;

  /// For a stepper whose `step` has no estimate: the error of its last step, from x' at the end.
  /// In units of the tolerance; 0 when `step` gave the estimate already. [loop]
  virtual double estimateFromEnd(const StepNode& /*from*/, const StepNode& /*to*/) const {
    return 0.0;
  }

  /// Adds the change of Q that the scheme's weights give for the last step, which went from `from`
  /// to `to` (x' there is not known yet). [loop]
  virtual void calcTorqueGain(System& system, const StepNode& from, const StepNode& to,
                              TorqueGain& gain) = 0;

  /// |h lambda| of the last step over the bound of the scheme's stability, estimated from x' at its
  /// end; about 1 where stability, not accuracy, limits the step. 0 when there is no estimate.
  virtual double stiffness(const State& /*x_new*/, const State& /*dxdt_new*/) const { return 0.0; }

  /// True where steps are made by the motion's series, and none is longer than they show all
  /// formulas.
  virtual bool stepsBySeries() const { return false; }
  /// x at `time` inside the last step made, which went from `from` to `to`, by dense output of the
  /// order of the error estimate. False where there is none: a shorter step has to get there.
  /// [loop]
  virtual bool interpolate(System& /*system*/, double /*time*/, const StepNode& /*from*/,
                           const StepNode& /*to*/, State& /*x*/) {
    return false;
  }

  /// x' of the dense output at the part `theta` of the last step, of length h, of an implicit
  /// stepper. [loop]
  virtual void calcSlope(double /*theta*/, double /*h*/, State& /*slope*/) const {}
  /// The estimated error of x at the end of the last step, component by component.
  const State& error() const { return error_; }

 protected:
  Stepper(int size, Tolerance tolerance) : tolerance_(tolerance), error_(size) {}
  Tolerance tolerance_;
  State error_;
};

/// The slope at (t, x) of a path that is no motion, such as that of a jump.
using PathSlope = std::function<void(const State& x, State& slope, double t)>;

/// Steps along such a path by Fehlberg 7(8).
class PathStepper {
 public:
  static constexpr int kErrorOrder = 8;
  virtual ~PathStepper() = default;
  /// See Stepper::step. [loop]
  virtual double step(const PathSlope& slope, const StepNode& from, double h, State& x_new) = 0;
};
std::unique_ptr<PathStepper> makePathStepper(int size, Tolerance tolerance);

/// The stepper of one kind, which is not kAuto, for the states of `system`.
std::unique_ptr<Stepper> makeStepper(StepperKind kind, const System& system, Tolerance tolerance);

// makeStepper chooses from these.
std::unique_ptr<Stepper> makeRk4Stepper(const System& system, Tolerance tolerance);
std::unique_ptr<Stepper> makeFehlberg78Stepper(const System& system, Tolerance tolerance);
std::unique_ptr<Stepper> makeDopri5Stepper(const System& system, Tolerance tolerance);
std::unique_ptr<Stepper> makeTaylorStepper(const System& system, Tolerance tolerance);
/// Radau IIA with 3, 5 or 7 stages, which goes down to 3 where Newton's iteration fails.
std::unique_ptr<Stepper> makeRadauStepper(const System& system, Tolerance tolerance,
                                          int most_stages);

}  // namespace variator_sim
