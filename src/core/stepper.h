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
#include <type_traits>

#include "projection.h"
#include "step_control.h"

namespace variator_sim {

/// True for systems that know the applied torque by its rate only: the accelerations are part of
/// their state, and x' has Q' in it.
template <class System, class = void>
inline constexpr bool kIntegratesTorque = false;
template <class System>
inline constexpr bool kIntegratesTorque<System, std::enable_if_t<System::kIntegratesTorque>> = true;

/// A state of a motion and its derivative.
template <class System>
struct StepNode {
  using State = typename System::State;
  using Torque = std::array<double, static_cast<std::size_t>(System::kShafts)>;
  double time = 0.0;
  State x{};
  State dxdt{};
  Torque torque{};       ///< Q there, N m, where StepChecks has written it
  Torque torque_rate{};  ///< Q' there, N m/s, likewise
};

/// What the torque rates at the stages of a step add up to.
template <class System>
struct TorqueGain {
  typename StepNode<System>::Torque change{};        ///< h sum b_i Q'_i, N m
  typename StepNode<System>::Torque largest_rate{};  ///< max |Q'_i|, N m/s
  void add(double h, double weight, const double* rate) {
    for (std::size_t i = 0; i < change.size(); ++i) {
      change[i] += h * weight * rate[i];
      largest_rate[i] = std::max(largest_rate[i], std::abs(rate[i]));
    }
  }
  /// Of a step of an explicit scheme: its weights b, and Q' at its stages.
  template <class Weights, std::size_t kStages>
  void addStages(double h, const Weights& b,
                 const std::array<typename StepNode<System>::Torque, kStages>& rates) {
    for (std::size_t i = 0; i < kStages; ++i) add(h, b[i], rates[i].data());
  }
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
  using Node = StepNode<System>;

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

  /// For a stepper whose `step` has no estimate: the error of its last step, from x' at the end.
  /// In units of the tolerance; 0 when `step` gave the estimate already. [loop]
  virtual double estimateFromEnd(const Node& /*from*/, const Node& /*to*/) const { return 0.0; }

  /// What the last step, which went from `from` to `to` (x' there is not known yet), takes for the
  /// change of Q. By default from the inside of the step, at the points of Radau's quadrature of
  /// order 5. [loop]
  virtual void calcTorqueGain(System& system, const Node& from, const Node& to,
                              TorqueGain<System>& gain) {
    if constexpr (kIntegratesTorque<System>) {
      constexpr double kPoints[] = {0.15505102572168219, 0.64494897427831781, 1.0};
      constexpr double kWeights[] = {0.37640306270046728, 0.51248582618842162, 1.0 / 9.0};
      const double h = to.time - from.time;
      for (int i = 0; i < 3; ++i) {
        State x = to.x;
        if (i < 2) interpolate(system, from.time + kPoints[i] * h, from, to, x);
        gain.add(h, kWeights[i], system.calcTorqueRate(from.time + kPoints[i] * h, x));
      }
    }
  }

  /// |h lambda| of the last step over the bound of the scheme's stability, estimated from x' at its
  /// end; about 1 where stability, not accuracy, limits the step. 0 when there is no estimate.
  virtual double stiffness(const State& /*x_new*/, const State& /*dxdt_new*/) const { return 0.0; }

  /// True when `interpolate` gives the motion inside the last step to the order of its error
  /// estimate.
  virtual bool hasDenseOutput() const { return false; }
  /// x at `time` inside the last step made, which went from `from` to `to`. False where that is not
  /// within the tolerance: a shorter step has to get there. [loop]
  virtual bool interpolate(System& /*system*/, double /*time*/, const Node& /*from*/,
                           const Node& /*to*/, State& /*x*/) {
    return false;
  }

  /// True when `interpolate` itself finds out how good it is, x' included.
  virtual bool checksDenseOutput() const { return false; }
  /// x' of the dense output at `time`, of an implicit stepper that keeps constraints. [loop]
  virtual void calcSlope(double /*time*/, const Node& /*from*/, const Node& /*to*/,
                         State& /*slope*/) const {}
  /// The estimated error of x at the end of the last step, component by component.
  const State& error() const { return error_; }

 protected:
  explicit Stepper(Tolerance tolerance) : tolerance_(tolerance) {}
  State error_{};
  Tolerance tolerance_;
  StepProjection<State> projection_;
};

/// Keeps the derivatives of the stages that come after the first, which Boost.Odeint does not show.
template <class System, std::size_t kStages>
struct StageRecorder {
  using State = typename System::State;
  System& system;
  std::array<State, kStages>& stages;
  std::array<typename StepNode<System>::Torque, kStages>& torque_rates;
  std::size_t next = 1;
  void operator()(const State& x, State& dxdt, double t) {
    system(x, dxdt, t);
    if (next == stages.size()) return;
    if constexpr (kIntegratesTorque<System>) {
      std::copy_n(system.torqueRate(), torque_rates[next].size(), torque_rates[next].begin());
    }
    stages[next++] = dxdt;
  }
};

/// Classical Runge-Kutta of order 4 with fixed steps.
///
/// With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
/// h (k4 - k5) / 6 estimates the error; the fifth stage is the next step's first.
template <class System>
class Rk4Stepper final : public Stepper<System> {
 public:
  using State = typename System::State;
  using Node = StepNode<System>;
  explicit Rk4Stepper(Tolerance tolerance) : Stepper<System>(tolerance) {}
  const char* name() const override { return "rk4"; }
  int errorOrder() const override { return 0; }
  double work() const override { return 4.0; }
  double step(System& system, const Node& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    StageRecorder<System, 4> recorder{system, stages_, torque_rates_};
    scheme_.do_step(std::ref(recorder), from.x, from.dxdt, from.time, x_new, h);
    return 0.0;
  }
  void calcTorqueGain(System& /*system*/, const Node& from, const Node& to,
                      TorqueGain<System>& gain) override {
    constexpr double b[] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    torque_rates_[0] = from.torque_rate;
    gain.addStages(to.time - from.time, b, torque_rates_);
  }
  double estimateFromEnd(const Node& from, const Node& to) const override {
    State error;
    for (std::size_t i = 0; i < error.size(); ++i) {
      error[i] = (to.time - from.time) / 6.0 * (stages_[3][i] - to.dxdt[i]);
    }
    return calcErrorNorm(error, from.x, to.x, this->tolerance_);
  }

 private:
  std::array<State, 4> stages_{};
  std::array<typename Node::Torque, 4> torque_rates_{};
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
/// is of order h^8. Neither sees what happens after the last inner stage, at 5/6 of the step: a
/// kink there. So e5 is the larger one of that and of the sixth difference of the seven equidistant
/// stages, up to the one at the end,
///     e6 = h/20 (k1 - 6 k8 + 15 k10 - 20 k6 + 15 k9 - 6 k7 + k11).
template <class System>
class Fehlberg78Stepper final : public Stepper<System> {
 public:
  using State = typename System::State;
  using Node = StepNode<System>;
  explicit Fehlberg78Stepper(Tolerance tolerance) : Stepper<System>(tolerance) {}
  const char* name() const override { return "fehlberg78"; }
  int errorOrder() const override { return 8; }
  double work() const override { return 13.0; }
  double step(System& system, const Node& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    StageRecorder<System, 13> recorder{system, stages_, torque_rates_};
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
      const double e6 =
          0.05 * h *
          (from.dxdt[i] + k(11) - 6.0 * (k(8) + k(7)) + 15.0 * (k(10) + k(9)) - 20.0 * k(6));
      size5 = std::max({size5, std::abs(e5) / allowance, std::abs(e6) / allowance});
      size3 = std::max(size3, std::abs(e3) / allowance);
      size8 = std::max(size8, std::abs(error[i]) / allowance);
      poison += 0.0 * (error[i] + x_new[i]);
      this->error_[i] = std::max(std::abs(e5), std::abs(e6));
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    for (std::size_t i = 0; i < error.size(); ++i) {
      this->error_[i] = std::max(std::abs(error[i]), reduction * this->error_[i]);
    }
    return std::max(size8, kGuard * size5 * reduction) + poison;
  }
  void calcTorqueGain(System& /*system*/, const Node& from, const Node& to,
                      TorqueGain<System>& gain) override {
    // 34/105 k6 + 9/35 (k7 + k8) + 9/280 (k9 + k10) + 41/840 (k12 + k13)
    constexpr double b[] = {0.0,          0.0,          0.0,         0.0,         0.0,
                            34.0 / 105.0, 9.0 / 35.0,   9.0 / 35.0,  9.0 / 280.0, 9.0 / 280.0,
                            0.0,          41.0 / 840.0, 41.0 / 840.0};
    torque_rates_[0] = from.torque_rate;
    gain.addStages(to.time - from.time, b, torque_rates_);
  }

 private:
  static constexpr double kGuard = 0.1;  // sees quadratures; costs 8 % more steps where not needed
  std::array<State, 13> stages_{};
  std::array<typename Node::Torque, 13> torque_rates_{};
  boost::numeric::odeint::runge_kutta_fehlberg78<State, double, State, double,
                                                 boost::numeric::odeint::array_algebra>
      scheme_;
};

}  // namespace variator_sim
