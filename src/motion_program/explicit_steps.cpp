#include "motion_program/explicit_steps.h"

#include <algorithm>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "dynamics/tolerance.h"

namespace variator_sim {
namespace {

namespace odeint = boost::numeric::odeint;
using StateValues = std::vector<double>;

/// A scheme of Boost.Odeint, which neither shows its stages nor refuses an error that is NaN.
template <class Scheme>
class OdeintScheme : public ExplicitScheme {
 protected:
  /// `size`: of x; `stages`: how many slopes are kept, from the one at the step's begin on.
  OdeintScheme(const MotionProgram& program, int size, int order, int stages)
      : ExplicitScheme(order),
        tolerance_{program.ABSOLUTE_TOLERANCE, program.RELATIVE_TOLERANCE},
        x_(static_cast<std::size_t>(size)),
        dxdt_(x_),
        end_(x_),
        error_(x_),
        slopes_(static_cast<std::size_t>(stages), x_) {
    scheme_.adjust_size(x_);
  }

  /// Takes over where the step begins.
  void begin(const ExplicitStep& step) {
    std::copy_n(step.x, step.size, x_.begin());
    std::copy_n(step.slope, step.size, dxdt_.begin());
    slopes_[0] = dxdt_;
  }

  /// Returns the derivative, which keeps the slopes of the stages.
  auto derivativeOf(const ExplicitStep& step) {
    return [this, &step, i = std::size_t{1}](const StateValues& x, StateValues& dxdt,
                                             double t) mutable {
      step.motion->calc(t, x.data(), dxdt.data());
      if (i < slopes_.size()) slopes_[i++] = dxdt;
    };
  }
  /// k_i of component n, i from 1.
  double slope(int i, std::size_t n) const { return slopes_[static_cast<std::size_t>(i - 1)][n]; }
  static std::size_t count(const ExplicitStep& step) { return static_cast<std::size_t>(step.size); }
  static std::size_t first(const ExplicitStep& step) {
    return static_cast<std::size_t>(step.first);
  }
  static double* at(const ExplicitStep& step, int node) {
    return step.at_node + static_cast<std::ptrdiff_t>(node) * step.size;
  }
  /// Returns 0; NaN where a state at a node is not finite.
  static double poisonOf(const ExplicitStep& step) {
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int n = 0; n < step.nodes * step.size; ++n) poison += 0.0 * step.at_node[n];
    return poison;
  }
  /// Finds the states at inner nodes by steps of their own, where the scheme has no dense output.
  void stepToNodes(const ExplicitStep& step) {
    for (int j = 0; j + 1 < step.nodes; ++j) {
      auto derivative = [&step](const StateValues& x, StateValues& dxdt, double t) {
        step.motion->calc(t, x.data(), dxdt.data());
      };
      scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.node[j] * step.h);
      std::copy(end_.begin(), end_.end(), at(step, j));
    }
  }

  const Tolerance tolerance_;
  StateValues x_;
  StateValues dxdt_;
  StateValues end_;
  StateValues error_;
  std::vector<StateValues> slopes_;  ///< k_i
  Scheme scheme_;
};

/// Classical Runge-Kutta of order 4 with fixed steps.
///
/// With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
/// h (k4 - k5) / 6 estimates the error.
class Rk4 final : public OdeintScheme<odeint::runge_kutta4<StateValues>> {
 public:
  Rk4(const MotionProgram& program, int size) : OdeintScheme(program, size, 4, 4) {}

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = derivativeOf(step);
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h);
    std::copy(end_.begin(), end_.end(), at(step, step.nodes - 1));
    step.motion->calc(step.h, end_.data(), error_.data());
    double norm = 0.0;
    for (std::size_t n = first(step); n < count(step); ++n) {
      const double error = step.h / 6.0 * std::abs(slope(4, n) - error_[n]);
      norm = std::max(norm, error / tolerance_.of(x_[n], end_[n]));
    }
    stepToNodes(step);
    return norm + poisonOf(step);
  }
};

/// Dormand and Prince 5(4) with dense output of order 4 (J. Comput. Appl. Math. 6, 1980; Hairer,
/// Norsett, Wanner: Solving ODE I, II.5, II.6).
class Dopri5 final : public OdeintScheme<odeint::runge_kutta_dopri5<StateValues>> {
 public:
  Dopri5(const MotionProgram& program, int size)
      : OdeintScheme(program, size, 5, 6), slope_at_end_(x_), inside_(x_) {}
  const double* errorAtEnd() const override { return error_.data(); }

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = derivativeOf(step);
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, slope_at_end_, step.h, error_);
    double norm = 0.0;
    for (std::size_t n = first(step); n < count(step); ++n) {
      norm = std::max(norm, std::abs(error_[n]) / tolerance_.of(x_[n], end_[n]));
    }
    for (int j = 0; j < step.nodes; ++j) {
      scheme_.calc_state(step.node[j] * step.h, inside_, x_, dxdt_, 0.0, end_, slope_at_end_,
                         step.h);
      const StateValues& shown = j + 1 < step.nodes ? inside_ : end_;
      std::copy(shown.begin(), shown.end(), at(step, j));
    }
    return norm + poisonOf(step);
  }

  StateValues slope_at_end_;
  StateValues inside_;
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
class Fehlberg78 final : public OdeintScheme<odeint::runge_kutta_fehlberg78<StateValues>> {
 public:
  Fehlberg78(const MotionProgram& program, int size)
      : OdeintScheme(program, size, 8, 13), rough_(x_) {}
  const double* errorAtEnd() const override { return error_.data(); }

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = derivativeOf(step);
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h, error_);
    std::copy(end_.begin(), end_.end(), at(step, step.nodes - 1));
    const double norm = errorOf(step);
    stepToNodes(step);
    return norm + poisonOf(step);
  }

  /// The error of each component is in error_.
  double errorOf(const ExplicitStep& step) {
    const double h = step.h;
    double size5 = 0.0;
    double size3 = 0.0;
    double size8 = 0.0;
    double poison = 0.0;
    for (std::size_t n = first(step); n < count(step); ++n) {
      const auto k = [&](int i) { return slope(i, n); };
      const double allowance = tolerance_.of(x_[n], end_[n]);
      const double e5 = h * (0.1 * (k(1) - k(7)) - k(6) + 0.5 * (k(9) - k(8)) + k(10));
      const double e3 = end_[n] - x_[n] - h * (0.75 * k(10) + 0.25 * k(11));
      const double e6 =
          0.05 * h * (k(1) + k(11) - 6.0 * (k(8) + k(7)) + 15.0 * (k(10) + k(9)) - 20.0 * k(6));
      rough_[n] = std::abs(e5) > std::abs(e6) ? e5 : e6;
      size5 = std::max(size5, std::abs(rough_[n]) / allowance);
      size3 = std::max(size3, std::abs(e3) / allowance);
      size8 = std::max(size8, std::abs(error_[n]) / allowance);
      poison += 0.0 * (error_[n] + end_[n]);
    }
    const double reduction = size3 > 0.0 ? std::min(1.0, size5 / size3) : 0.0;
    for (std::size_t n = first(step); n < count(step); ++n) {
      const double other = kGuard * reduction * rough_[n];
      if (std::abs(other) > std::abs(error_[n])) error_[n] = other;
    }
    return std::max(size8, kGuard * size5 * reduction) + poison;
  }

  StateValues rough_;                    ///< the larger one of e5 and e6
  static constexpr double kGuard = 0.1;  // sees quadratures; costs 8 % more steps where not needed
};

}  // namespace

std::unique_ptr<ExplicitScheme> makeExplicitScheme(const MotionProgram& program, int size) {
  switch (program.stepper) {
    case StepperKind::kRk4:
      return std::make_unique<Rk4>(program, size);
    case StepperKind::kDopri5:
      return std::make_unique<Dopri5>(program, size);
    case StepperKind::kFehlberg78:
      return std::make_unique<Fehlberg78>(program, size);
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
