/// Trial steps. A stepper makes one step of given size and says what it thinks its error is; who
/// accepts, rejects and chooses sizes is the motion (motion_of.h). The controllers of Boost.Odeint
/// are not used: they accept a step whose error is NaN, and keep the derivative from before a jump.
#pragma once

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "projection.h"
#include "step_control.h"

namespace variator_sim {

/// A state of a motion and its derivative.
template <class State>
struct StepNode {
  double time = 0.0;
  State x{};
  State dxdt{};
};

/// What a stepper that projects its result found.
template <class State>
struct StepProjection {
  ProjectionResult result = ProjectionResult::kConverged;
  State moved{};  ///< by how much, per component
  std::uint64_t iterations = 0;
};

/// Steps x' = system(t, x). `System` has a type State and is called as system(x, dxdt, t).
template <class System>
class Stepper {
 public:
  using State = typename System::State;
  using Node = StepNode<State>;

  virtual ~Stepper() = default;
  /// The scheme's name, as in `solver/stepper`.
  virtual const char* name() const = 0;
  /// p of the error estimate h^p, which the step-size control rests on; 0: none, fixed steps.
  virtual int errorOrder() const = 0;
  /// What one step costs, in evaluations of the derivative.
  virtual double work() const = 0;
  /// True when `step` projects x_new onto the constraints itself and leaves x' there in dxdt_new
  /// (first same as last); `projection` then tells how that went.
  virtual bool projects() const { return false; }
  virtual const StepProjection<State>& projection() const { return projection_; }
  /// True for an implicit stepper: states that it makes are projected as `projectStiffly` does.
  virtual bool isImplicit() const { return false; }
  /// True when its stages hold psi = 0 where the system can (keepsConstraintsInStages).
  virtual bool keepsConstraints() const { return false; }

  /// Forgets what belongs to a state: inputs may have changed under it.
  virtual void restart() {}
  /// One step by h from `from`, whose derivative is known: x_new and, if it projects, dxdt_new.
  /// Returns the estimated local error: its largest component in units of the tolerance; NaN when
  /// any value is. [loop]
  virtual double step(System& system, const Node& from, double h, State& x_new,
                      State& dxdt_new) = 0;

  /// |h lambda| of the last step over the bound of the scheme's stability, estimated from x' at its
  /// end; about 1 where stability, not accuracy, limits the step. 0 when there is no estimate.
  virtual double stiffness(const State& /*x_new*/, const State& /*dxdt_new*/) const { return 0.0; }

  /// True when `interpolate` gives the motion inside the last step to the order of its error
  /// estimate.
  virtual bool hasDenseOutput() const { return false; }
  /// x at `time` inside the last step made, which went from `from` to `to`. [loop]
  virtual void interpolate(System& /*system*/, double /*time*/, const Node& /*from*/,
                           const Node& /*to*/, State& /*x*/) {}

 protected:
  explicit Stepper(Tolerance tolerance) : tolerance_(tolerance) {}
  Tolerance tolerance_;
  StepProjection<State> projection_;
};

/// Classical Runge-Kutta of order 4 with fixed steps.
template <class System>
class Rk4Stepper final : public Stepper<System> {
 public:
  using State = typename System::State;
  using Node = StepNode<State>;
  explicit Rk4Stepper(Tolerance tolerance) : Stepper<System>(tolerance) {}
  const char* name() const override { return "rk4"; }
  int errorOrder() const override { return 0; }
  double work() const override { return 4.0; }
  double step(System& system, const Node& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    scheme_.do_step(std::ref(system), from.x, from.dxdt, from.time, x_new, h);
    return 0.0;
  }

 private:
  boost::numeric::odeint::runge_kutta4<State, double, State, double,
                                       boost::numeric::odeint::array_algebra>
      scheme_;
};

/// Fehlberg 7(8), continued with the result of order 8 (NASA TR R-287, 1968).
///
/// Its own error estimate 41/840 h (k1 + k11 - k12 - k13) is blind to a pure quadrature x' = f(t):
/// the four stages stand at t, t + h, t, t + h. So a second estimate stands beside it, made from
/// two formulas embedded in the same stages,
///     e5 = h (k1/10 - k6 - k7/10 - k8/2 + k9/2 + k10)    of order h^6,
///     e3 = x_new - x - h (3/4 k10 + 1/4 k11)             of order h^4,
/// combined as in DOP853 (Hairer, Norsett, Wanner: Solving ODE I, II.10) to e5 |e5| / |e3|, which
/// is of order h^8. The larger of the two counts, component by component.
template <class System>
class Fehlberg78Stepper final : public Stepper<System> {
 public:
  using State = typename System::State;
  using Node = StepNode<State>;
  explicit Fehlberg78Stepper(Tolerance tolerance) : Stepper<System>(tolerance) {}
  const char* name() const override { return "fehlberg78"; }
  int errorOrder() const override { return 8; }
  double work() const override { return 13.0; }
  double step(System& system, const Node& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    Recorder recorder{system, stages_, 1};
    State error;
    scheme_.do_step(std::ref(recorder), from.x, from.dxdt, from.time, x_new, h, error);
    double size5 = 0.0;
    double size3 = 0.0;
    double size8 = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (std::size_t i = 0; i < error.size(); ++i) {
      const auto k = [&](int stage) { return stages_[static_cast<std::size_t>(stage - 1)][i]; };
      const double allowance = this->tolerance_.of(from.x[i], x_new[i]);
      const double e5 = h * (0.1 * (from.dxdt[i] - k(7)) - k(6) + 0.5 * (k(9) - k(8)) + k(10));
      const double e3 = x_new[i] - from.x[i] - h * (0.75 * k(10) + 0.25 * k(11));
      size5 = std::max(size5, std::abs(e5) / allowance);
      size3 = std::max(size3, std::abs(e3) / allowance);
      size8 = std::max(size8, std::abs(error[i]) / allowance);
      poison += 0.0 * (error[i] + x_new[i]);
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    return std::max(size8, kGuard * size5 * reduction) + poison;
  }

 private:
  /// Keeps the derivatives of the stages, which Boost.Odeint does not show.
  struct Recorder {
    System& system;
    std::array<State, 13>& stages;
    std::size_t next;
    void operator()(const State& x, State& dxdt, double t) {
      system(x, dxdt, t);
      if (next < stages.size()) stages[next++] = dxdt;
    }
  };
  static constexpr double kGuard = 0.1;  // sees quadratures; costs 8 % more steps where not needed
  std::array<State, 13> stages_{};
  boost::numeric::odeint::runge_kutta_fehlberg78<State, double, State, double,
                                                 boost::numeric::odeint::array_algebra>
      scheme_;
};

}  // namespace variator_sim
