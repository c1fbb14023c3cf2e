/// Trial steps. A stepper makes one step of given size and says what it thinks its error is; who
/// accepts, rejects and chooses sizes is the motion (motion_of.h). The Runge-Kutta schemes are
/// Boost.Odeint's, its controllers are not used: they accept a step whose error is NaN, and keep
/// the derivative from before a jump.
#pragma once

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>

#include "projection.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// What a stepper that projects its result found.
template <class State>
struct StepProjection {
  ProjectionResult result = ProjectionResult::kConverged;
  State moved{};  ///< by how much, per component
  std::uint64_t iterations = 0;
};

/// Steps x' = system(t, x). `System` is called as system(x, dxdt, t).
template <class State, class System>
class Stepper {
 public:
  virtual ~Stepper() = default;
  /// The scheme's name, as in `solver/stepper`.
  virtual const char* name() const = 0;
  /// p of the error estimate h^p, which the step-size control rests on; 0: none, fixed steps.
  virtual int errorOrder() const = 0;
  /// True when `step` projects x_new onto the constraints itself and leaves x' there in dxdt_new
  /// (first same as last); `projection` then tells how that went.
  virtual bool projects() const { return false; }
  virtual const StepProjection<State>& projection() const { return projection_; }
  /// One step from (t, x, dxdt) by h: x_new, `error` (estimated local error, per component) and,
  /// if it projects, dxdt_new. [loop]
  virtual void step(System& system, const State& x, const State& dxdt, double t, double h,
                    State& x_new, State& dxdt_new, State& error) = 0;
  /// True when `interpolate` gives the motion inside the last step to the order of its error
  /// estimate.
  virtual bool hasDenseOutput() const { return false; }
  /// x at `time` inside the last step made, from (t_old, x_old, dxdt_old) to t_new. [loop]
  virtual void interpolate(double /*time*/, const State& /*x_old*/, const State& /*dxdt_old*/,
                           double /*t_old*/, const State& /*dxdt_new*/, double /*t_new*/,
                           State& /*x*/) {}

 protected:
  StepProjection<State> projection_;
};

/// Classical Runge-Kutta of order 4 with fixed steps.
template <class State, class System>
class Rk4Stepper final : public Stepper<State, System> {
 public:
  const char* name() const override { return "rk4"; }
  int errorOrder() const override { return 0; }
  void step(System& system, const State& x, const State& dxdt, double t, double h, State& x_new,
            State& /*dxdt_new*/, State& error) override {
    scheme_.do_step(std::ref(system), x, dxdt, t, x_new, h);
    error.fill(0.0);
  }

 private:
  boost::numeric::odeint::runge_kutta4<State, double, State, double,
                                       boost::numeric::odeint::array_algebra>
      scheme_;
};

/// Dormand and Prince 5(4) with its dense output of order 4 (J. Comput. Appl. Math. 6, 1980).
///
/// Its last stage stands at the end of the step and is the first of the next one. The end is
/// projected before that stage is taken, so the next step starts from the derivative at the
/// projected state without another evaluation, and what a projection keeps is kept to round-off.
template <class State, class System>
class Dopri5Stepper final : public Stepper<State, System> {
 public:
  const char* name() const override { return "dopri5"; }
  int errorOrder() const override { return 5; }
  bool projects() const override { return true; }
  void step(System& system, const State& x, const State& dxdt, double t, double h, State& x_new,
            State& dxdt_new, State& error) override {
    End end{system, this->projection_, State{}, 0};
    scheme_.do_step(std::ref(end), x, dxdt, t, x_new, dxdt_new, h, error);
    x_new = end.x;
  }
  bool hasDenseOutput() const override { return true; }
  void interpolate(double time, const State& x_old, const State& dxdt_old, double t_old,
                   const State& dxdt_new, double t_new, State& x) override {
    scheme_.calc_state(time, x, x_old, dxdt_old, t_old, x_old, dxdt_new, t_new);
  }

 private:
  /// The system, with the last stage taken at the projected end.
  struct End {
    System& system;
    StepProjection<State>& projection;
    State x;
    int stage;
    void operator()(const State& stage_x, State& dxdt, double t) {
      if (++stage < 6) {
        system(stage_x, dxdt, t);
        return;
      }
      x = stage_x;
      projection.iterations = 0;
      projection.result = system.project(t, x, projection.moved, &projection.iterations);
      if (projection.result == ProjectionResult::kConverged) {
        system(x, dxdt, t);
      } else {
        dxdt.fill(std::numeric_limits<double>::quiet_NaN());
      }
    }
  };
  boost::numeric::odeint::runge_kutta_dopri5<State, double, State, double,
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
/// combined as in DOP853 (Hairer, Norsett, Wanner: Solving ODE I, II.5) to e5 |e5| / |e3|, which is
/// of order h^8. The larger of the two counts, component by component.
template <class State, class System>
class Fehlberg78Stepper final : public Stepper<State, System> {
 public:
  const char* name() const override { return "fehlberg78"; }
  int errorOrder() const override { return 8; }
  void step(System& system, const State& x, const State& dxdt, double t, double h, State& x_new,
            State& /*dxdt_new*/, State& error) override {
    Recorder recorder{system, stages_, 1};
    scheme_.do_step(std::ref(recorder), x, dxdt, t, x_new, h, error);
    double size5 = 0.0;
    double size3 = 0.0;
    State e5;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const auto k = [&](int stage) { return stages_[stage - 1][i]; };
      e5[i] = h * (0.1 * (dxdt[i] - k(7)) - k(6) + 0.5 * (k(9) - k(8)) + k(10));
      const double e3 = x_new[i] - x[i] - h * (0.75 * k(10) + 0.25 * k(11));
      size5 = std::max(size5, std::abs(e5[i]));
      size3 = std::max(size3, std::abs(e3));
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      error[i] = std::max(std::abs(error[i]), std::abs(e5[i]) * reduction * kGuard);
    }
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

/// The stepper that `settings` name.
template <class State, class System>
std::unique_ptr<Stepper<State, System>> makeStepper(const SolverSettings& settings) {
  switch (settings.stepper) {
    case StepperKind::kRk4:
      return std::make_unique<Rk4Stepper<State, System>>();
    case StepperKind::kFehlberg78:
      return std::make_unique<Fehlberg78Stepper<State, System>>();
    case StepperKind::kDopri5:
    case StepperKind::kAuto:
      break;
  }
  return std::make_unique<Dopri5Stepper<State, System>>();
}

}  // namespace variator_sim
