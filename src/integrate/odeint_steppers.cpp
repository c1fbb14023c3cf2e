/// The steppers whose schemes are Boost.Odeint's.
#include <algorithm>
#include <boost/numeric/odeint/algebra/range_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "integrate/stepper.h"

// How Boost.Odeint makes states of its own.
namespace boost::numeric::odeint {
template <>
struct is_resizeable<variator_sim::State> : boost::true_type {};
template <>
struct state_wrapper<variator_sim::State> {
  using state_wrapper_type = state_wrapper<variator_sim::State>;
  variator_sim::State m_v{0};
};
}  // namespace boost::numeric::odeint

namespace variator_sim {
namespace {

namespace odeint = boost::numeric::odeint;

/// Keeps the derivatives of the stages that come after the first, which Boost.Odeint does not show.
struct StageRecorder {
  System& system;
  std::vector<State>& stages;
  std::vector<ShaftVector>& torque_rates;
  std::size_t next = 1;
  void operator()(const State& x, State& dxdt, double t) {
    system(x, dxdt, t);
    if (next == stages.size()) return;
    if (system.integratesTorque()) {
      torque_rates[next].assign(system.torqueRate());
    }
    stages[next++] = dxdt;
  }
};

/// Classical Runge-Kutta of order 4 with fixed steps.
///
/// With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
/// h (k4 - k5) / 6 estimates the error; the fifth stage is the next step's first.
class Rk4Stepper final : public Stepper {
 public:
  Rk4Stepper(const System& system, Tolerance tolerance)
      : Stepper(system, tolerance),
        stages_(4, State(system.size())),
        torque_rates_(4, ShaftVector(system.shafts())) {}
  const char* name() const override { return "rk4"; }
  int errorOrder() const override { return 0; }
  double work() const override { return 4.0; }
  double step(System& system, const StepNode& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    StageRecorder recorder{system, stages_, torque_rates_};
    scheme_.do_step(std::ref(recorder), from.x, from.dxdt, from.time, x_new, h);
    return 0.0;
  }
  void calcTorqueGain(System& /*system*/, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    constexpr double b[] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    torque_rates_[0] = from.torque_rate;
    gain.addStages(to.time - from.time, b, torque_rates_);
  }
  double estimateFromEnd(const StepNode& from, const StepNode& to) const override {
    State error(from.x.size());
    for (int i = 0; i < error.size(); ++i) {
      error[i] = (to.time - from.time) / 6.0 * (stages_[3][i] - to.dxdt[i]);
    }
    return calcErrorNorm(error, from.x, to.x, tolerance_);
  }

 private:
  std::vector<State> stages_;
  std::vector<ShaftVector> torque_rates_;
  odeint::runge_kutta4<State, double, State, double, odeint::range_algebra> scheme_;
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
class Fehlberg78Stepper final : public Stepper {
 public:
  Fehlberg78Stepper(const System& system, Tolerance tolerance)
      : Stepper(system, tolerance),
        stages_(13, State(system.size())),
        torque_rates_(13, ShaftVector(system.shafts())) {}
  const char* name() const override { return "fehlberg78"; }
  int errorOrder() const override { return 8; }
  double work() const override { return 13.0; }
  double step(System& system, const StepNode& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    StageRecorder recorder{system, stages_, torque_rates_};
    State error(from.x.size());
    scheme_.do_step(std::ref(recorder), from.x, from.dxdt, from.time, x_new, h, error);
    double size5 = 0.0;
    double size3 = 0.0;
    double size8 = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int i = 0; i < error.size(); ++i) {
      const auto k = [&](int stage) { return stages_[static_cast<std::size_t>(stage - 1)][i]; };
      const double allowance = tolerance_.of(from.x[i], x_new[i]);
      const double e5 = h * (0.1 * (from.dxdt[i] - k(7)) - k(6) + 0.5 * (k(9) - k(8)) + k(10));
      const double e3 = x_new[i] - from.x[i] - h * (0.75 * k(10) + 0.25 * k(11));
      const double e6 =
          0.05 * h *
          (from.dxdt[i] + k(11) - 6.0 * (k(8) + k(7)) + 15.0 * (k(10) + k(9)) - 20.0 * k(6));
      size5 = std::max({size5, std::abs(e5) / allowance, std::abs(e6) / allowance});
      size3 = std::max(size3, std::abs(e3) / allowance);
      size8 = std::max(size8, std::abs(error[i]) / allowance);
      poison += 0.0 * (error[i] + x_new[i]);
      error_[i] = std::max(std::abs(e5), std::abs(e6));
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    for (int i = 0; i < error.size(); ++i) {
      error_[i] = std::max(std::abs(error[i]), reduction * error_[i]);
    }
    return std::max(size8, kGuard * size5 * reduction) + poison;
  }
  void calcTorqueGain(System& /*system*/, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    // 34/105 k6 + 9/35 (k7 + k8) + 9/280 (k9 + k10) + 41/840 (k12 + k13)
    constexpr double b[] = {0.0,          0.0,          0.0,         0.0,         0.0,
                            34.0 / 105.0, 9.0 / 35.0,   9.0 / 35.0,  9.0 / 280.0, 9.0 / 280.0,
                            0.0,          41.0 / 840.0, 41.0 / 840.0};
    torque_rates_[0] = from.torque_rate;
    gain.addStages(to.time - from.time, b, torque_rates_);
  }

 private:
  static constexpr double kGuard = 0.1;  // sees quadratures; costs 8 % more steps where not needed
  std::vector<State> stages_;
  std::vector<ShaftVector> torque_rates_;
  odeint::runge_kutta_fehlberg78<State, double, State, double, odeint::range_algebra> scheme_;
};

}  // namespace

std::unique_ptr<Stepper> makeRk4Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<Rk4Stepper>(system, tolerance);
}
std::unique_ptr<Stepper> makeFehlberg78Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<Fehlberg78Stepper>(system, tolerance);
}

}  // namespace variator_sim
