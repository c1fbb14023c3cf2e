/// Explicit Runge-Kutta steps: the schemes are Boost.Odeint's; error norms, estimates of stiffness
/// and what their stages have seen of the torque are not.
#include <algorithm>
#include <boost/numeric/odeint/algebra/range_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>
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

/// x_new = x + h sum b_i k_i. The last stage stands at the end of the step.
class ExplicitStepper : public Stepper {
 public:
  double work() const override { return static_cast<double>(b_.size()); }

  void calcTorqueGain(System& /*system*/, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    torque_rates_[0] = from.torque_rate;
    for (std::size_t i = 0; i < b_.size(); ++i) {
      gain.add(to.time - from.time, b_[i], torque_rates_[i].data());
    }
  }

  double stiffness(const State& x_new, const State& dxdt_new) const override {
    // |h lambda| from the two derivatives at the end of the step (Solving ODE II, IV.2).
    double distance = 0.0;
    double change = 0.0;
    for (int n = 0; n < x_new.size(); ++n) {
      const double allowance = tolerance_.of(x_new[n]);
      distance = std::max(distance, std::abs(x_new[n] - last_[n]) / allowance);
      change = std::max(change, std::abs(dxdt_new[n] - slopes_.back()[n]) / allowance);
    }
    return distance > 0.0 ? h_ * change / distance / stability_bound_ : 0.0;
  }

 protected:
  /// Steps do not grow as long as |h lambda| is at most `stability_bound`.
  ExplicitStepper(int size, int shafts, Tolerance tolerance, std::vector<double> b,
                  double stability_bound)
      : Stepper(size, tolerance),
        last_(size),
        slopes_(b.size(), last_),
        torque_rates_(b.size(), ShaftVector(shafts)),
        b_(std::move(b)),
        stability_bound_(stability_bound) {}

  /// The derivative for a scheme that makes a step of h from `from`. It keeps the stages, which
  /// Boost.Odeint does not show; a derivative behind the last of them is that at x_new.
  template <class Slope>
  auto recordStages(Slope& slope, const StepNode& from, double h) {
    h_ = h;
    slopes_[0] = from.dxdt;
    return [this, &slope, i = std::size_t{1}](const State& x, State& dxdt, double t) mutable {
      slope(x, dxdt, t);
      if (i == slopes_.size()) return;
      if constexpr (std::is_same_v<Slope, System>) {
        if (slope.integratesTorque()) torque_rates_[i].assign(slope.torqueRate());
      }
      last_ = x;
      slopes_[i++] = dxdt;
    };
  }
  /// k_i of component n, i from 1.
  double slope(int i, int n) const { return slopes_[static_cast<std::size_t>(i - 1)][n]; }

 private:
  double h_ = 0.0;
  State last_;                 // x at the last stage
  std::vector<State> slopes_;  // k_i
  std::vector<ShaftVector> torque_rates_;
  const std::vector<double> b_;
  const double stability_bound_;
};

/// Classical Runge-Kutta of order 4 with fixed steps.
///
/// With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
/// h (k4 - k5) / 6 estimates the error; the fifth stage is the next step's first.
class Rk4Stepper final : public ExplicitStepper {
 public:
  Rk4Stepper(const System& system, Tolerance tolerance)
      : ExplicitStepper(system.size(), system.shafts(), tolerance,
                        {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0}, 2.6) {}
  const char* name() const override { return "rk4"; }
  int errorOrder() const override { return 0; }
  double step(System& system, const StepNode& from, double h, State& x_new) override {
    auto derivative = recordStages(system, from, h);
    scheme_.do_step(std::ref(derivative), from.x, from.dxdt, from.time, x_new, h);
    return 0.0;
  }
  double estimateFromEnd(const StepNode& from, const StepNode& to) const override {
    State error(from.x.size());
    for (int n = 0; n < error.size(); ++n) {
      error[n] = (to.time - from.time) / 6.0 * (slope(4, n) - to.dxdt[n]);
    }
    return calcErrorNorm(error, from.x, to.x, tolerance_);
  }

 private:
  odeint::runge_kutta4<State, double, State, double, odeint::range_algebra> scheme_;
};

/// Dormand and Prince 5(4) with dense output of order 4 (J. Comput. Appl. Math. 6, 1980; Hairer,
/// Norsett, Wanner: Solving ODE I, II.5, II.6).
class Dopri5Stepper final : public ExplicitStepper {
 public:
  Dopri5Stepper(const System& system, Tolerance tolerance)
      : ExplicitStepper(
            system.size(), system.shafts(), tolerance,
            {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0},
            3.25),
        end_(system.size()),
        slope_at_end_(system.size()) {}
  const char* name() const override { return "dopri5"; }
  int errorOrder() const override { return 5; }
  /// Its seventh stage, which the error needs, is not the next step's first: x_new is projected.
  double work() const override { return 7.0; }
  double step(System& system, const StepNode& from, double h, State& x_new) override {
    auto derivative = recordStages(system, from, h);
    scheme_.do_step(std::ref(derivative), from.x, from.dxdt, from.time, end_, slope_at_end_, h,
                    error_);
    x_new = end_;
    const double norm = calcErrorNorm(error_, from.x, x_new, tolerance_);
    return norm <= 1.0 && !isResolved(from, h) ? kUnresolved : norm;
  }
  bool interpolate(System& /*system*/, double time, const StepNode& from, const StepNode& to,
                   State& x) override {
    scheme_.calc_state(time, x, from.x, from.dxdt, from.time, to.x, to.dxdt, to.time);
    // It ends at x_new as it was before the projection.
    const double theta = (time - from.time) / (to.time - from.time);
    const double part = theta * theta * (3.0 - 2.0 * theta);
    for (int n = 0; n < x.size(); ++n) x[n] += part * (to.x[n] - end_[n]);
    return true;
  }

 private:
  /// False where the slopes vary so wildly over a step that its error estimate, one number, may be
  /// small by chance, as on both sides of a pole: where the term of degree 4 of the dense output,
  ///     16 (p(1/2) - (x + x_new)/2 - h/8 (k1 - k7)),
  /// is more than half a step with the largest slope, and counts.
  bool isResolved(const StepNode& from, double h) const {
    State middle(end_.size());
    scheme_.calc_state(from.time + 0.5 * h, middle, from.x, from.dxdt, from.time, end_,
                       slope_at_end_, from.time + h);
    for (int n = 0; n < middle.size(); ++n) {
      const double cubic =
          0.5 * (from.x[n] + end_[n]) + 0.125 * h * (from.dxdt[n] - slope_at_end_[n]);
      const double term = 16.0 * std::abs(middle[n] - cubic);
      if (!(term > 10.0 * tolerance_.of(from.x[n], end_[n]))) continue;
      double steepest = std::max(std::abs(slope(1, n)), std::abs(slope_at_end_[n]));
      for (int i = 3; i <= 6; ++i) steepest = std::max(steepest, std::abs(slope(i, n)));
      if (term > 0.5 * h * steepest) return false;
    }
    return true;
  }

  /// The error norm given to a step that is too long to have one.
  static constexpr double kUnresolved = 4.0;

  State end_;  // x_new
  State slope_at_end_;
  odeint::runge_kutta_dopri5<State, double, State, double, odeint::range_algebra> scheme_;
};

/// Fehlberg 7(8), continued with the result of order 8 (NASA TR R-287, 1968).
///
/// Its own error estimate 41/840 h (k1 + k11 - k12 - k13) is blind to a pure quadrature x' = f(t):
/// the four stages stand at t, t + h, t, t + h. So a second estimate stands beside it, made from
/// two formulas embedded in the same stages,
///     e5 = h (k1/10 - k6 - k7/10 - k8/2 + k9/2 + k10)    of order h^6,
///     e3 = x_new - x - h (3/4 k10 + 1/4 k11)             of order h^4,
/// combined as in Hairer's DOP853 (Solving ODE I, II.10) to e5 |e5| / |e3|, which is of order h^8.
/// Neither sees what happens after the last inner stage, at 5/6 of the step: a kink there. So e5 is
/// the larger one of that and of the sixth difference of the seven equidistant stages, up to the
/// one at the end,
///     e6 = h/20 (k1 - 6 k8 + 15 k10 - 20 k6 + 15 k9 - 6 k7 + k11).
class Fehlberg78Stepper final : public ExplicitStepper, public PathStepper {
 public:
  Fehlberg78Stepper(int size, int shafts, Tolerance tolerance)
      : ExplicitStepper(size, shafts, tolerance,
                        {0.0, 0.0, 0.0, 0.0, 0.0, 34.0 / 105.0, 9.0 / 35.0, 9.0 / 35.0, 9.0 / 280.0,
                         9.0 / 280.0, 0.0, 41.0 / 840.0, 41.0 / 840.0},
                        4.4) {}
  const char* name() const override { return "fehlberg78"; }
  int errorOrder() const override { return kErrorOrder; }
  double step(System& system, const StepNode& from, double h, State& x_new) override {
    return stepBy(system, from, h, x_new);
  }
  double step(const PathSlope& slope, const StepNode& from, double h, State& x_new) override {
    return stepBy(slope, from, h, x_new);
  }

 private:
  template <class Slope>
  double stepBy(Slope& path, const StepNode& from, double h, State& x_new) {
    auto derivative = recordStages(path, from, h);
    State error(from.x.size());
    scheme_.do_step(std::ref(derivative), from.x, from.dxdt, from.time, x_new, h, error);
    double size5 = 0.0;
    double size3 = 0.0;
    double size8 = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int n = 0; n < error.size(); ++n) {
      const auto k = [&](int i) { return slope(i, n); };
      const double allowance = tolerance_.of(from.x[n], x_new[n]);
      const double e5 = h * (0.1 * (k(1) - k(7)) - k(6) + 0.5 * (k(9) - k(8)) + k(10));
      const double e3 = x_new[n] - from.x[n] - h * (0.75 * k(10) + 0.25 * k(11));
      const double e6 =
          0.05 * h * (k(1) + k(11) - 6.0 * (k(8) + k(7)) + 15.0 * (k(10) + k(9)) - 20.0 * k(6));
      size5 = std::max({size5, std::abs(e5) / allowance, std::abs(e6) / allowance});
      size3 = std::max(size3, std::abs(e3) / allowance);
      size8 = std::max(size8, std::abs(error[n]) / allowance);
      poison += 0.0 * (error[n] + x_new[n]);
      error_[n] = std::max(std::abs(e5), std::abs(e6));
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    for (int n = 0; n < error.size(); ++n) {
      error_[n] = std::max(std::abs(error[n]), reduction * error_[n]);
    }
    return std::max(size8, kGuard * size5 * reduction) + poison;
  }

  static constexpr double kGuard = 0.1;  // sees quadratures; costs 8 % more steps where not needed
  odeint::runge_kutta_fehlberg78<State, double, State, double, odeint::range_algebra> scheme_;
};

}  // namespace

std::unique_ptr<Stepper> makeRk4Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<Rk4Stepper>(system, tolerance);
}
std::unique_ptr<Stepper> makeDopri5Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<Dopri5Stepper>(system, tolerance);
}
std::unique_ptr<Stepper> makeFehlberg78Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<Fehlberg78Stepper>(system.size(), system.shafts(), tolerance);
}
std::unique_ptr<PathStepper> makePathStepper(int size, Tolerance tolerance) {
  return std::make_unique<Fehlberg78Stepper>(size, 0, tolerance);
}

}  // namespace variator_sim
