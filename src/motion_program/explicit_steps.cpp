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
  /// `size`: of x.
  OdeintScheme(const MotionProgram& program, int size, int order)
      : ExplicitScheme(order),
        tolerance_{program.ABSOLUTE_TOLERANCE, program.RELATIVE_TOLERANCE},
        x_(static_cast<std::size_t>(size)),
        dxdt_(x_),
        end_(x_),
        inside_(x_),
        error_(x_) {
    scheme_.adjust_size(x_);
  }

  /// Takes over where the step begins.
  void begin(const ExplicitStep& step) {
    std::copy_n(step.x, step.size, x_.begin());
    std::copy_n(step.slope, step.size, dxdt_.begin());
  }

  static auto derivativeOf(const ExplicitStep& step) {
    return [&step](const StateValues& x, StateValues& dxdt, double t) {
      (*step.slope_at)(t, x.data(), dxdt.data());
    };
  }
  static double* at(const ExplicitStep& step, int node) {
    return step.at_node + static_cast<std::ptrdiff_t>(node) * step.size;
  }
  /// Returns error_ in tolerances; NaN where it, or a state at a node, is not finite.
  double errorOf(const ExplicitStep& step) const {
    double norm = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (std::size_t n = 0; n < x_.size(); ++n) {
      poison += 0.0 * error_[n];
      if (n < static_cast<std::size_t>(step.first)) continue;
      norm = std::max(norm, std::abs(error_[n]) / tolerance_.of(x_[n], end_[n]));
    }
    for (int n = 0; n < step.nodes * step.size; ++n) poison += 0.0 * step.at_node[n];
    return norm + poison;
  }
  /// Finds the states at inner nodes by steps of their own, where the scheme has no dense output.
  void stepToNodes(const ExplicitStep& step) {
    auto derivative = derivativeOf(step);
    for (int j = 0; j + 1 < step.nodes; ++j) {
      scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, inside_, step.node[j] * step.h);
      std::copy(inside_.begin(), inside_.end(), at(step, j));
    }
  }

  const Tolerance tolerance_;
  StateValues x_;
  StateValues dxdt_;
  StateValues end_;
  StateValues inside_;
  StateValues error_;
  Scheme scheme_;
};

/// Classical Runge-Kutta of order 4 with fixed steps.
///
/// With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
/// h (k4 - k5) / 6 estimates the error.
class Rk4 final : public OdeintScheme<odeint::runge_kutta4<StateValues>> {
 public:
  Rk4(const MotionProgram& program, int size) : OdeintScheme(program, size, 4), last_(x_) {}

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = [this, &step](const StateValues& x, StateValues& dxdt, double t) {
      (*step.slope_at)(t, x.data(), dxdt.data());
      last_ = dxdt;  // k2, k3, k4
    };
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h);
    std::copy(end_.begin(), end_.end(), at(step, step.nodes - 1));
    (*step.slope_at)(step.h, end_.data(), error_.data());
    for (std::size_t n = 0; n < x_.size(); ++n) error_[n] = step.h / 6.0 * (last_[n] - error_[n]);
    stepToNodes(step);
    return errorOf(step);
  }

  StateValues last_;
};

/// Dormand and Prince 5(4) with dense output of order 4 (J. Comput. Appl. Math. 6, 1980; Hairer,
/// Norsett, Wanner: Solving ODE I, II.5, II.6).
class Dopri5 final : public OdeintScheme<odeint::runge_kutta_dopri5<StateValues>> {
 public:
  Dopri5(const MotionProgram& program, int size)
      : OdeintScheme(program, size, 5), slope_at_end_(x_) {}
  const double* errorAtEnd() const override { return error_.data(); }

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = derivativeOf(step);
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, slope_at_end_, step.h, error_);
    for (int j = 0; j < step.nodes; ++j) {
      scheme_.calc_state(step.node[j] * step.h, inside_, x_, dxdt_, 0.0, end_, slope_at_end_,
                         step.h);
      const StateValues& shown = j + 1 < step.nodes ? inside_ : end_;
      std::copy(shown.begin(), shown.end(), at(step, j));
    }
    return errorOf(step);
  }

  StateValues slope_at_end_;
};

/// Fehlberg 7(8), continued with the result of order 8 (NASA TR R-287, 1968).
class Fehlberg78 final : public OdeintScheme<odeint::runge_kutta_fehlberg78<StateValues>> {
 public:
  Fehlberg78(const MotionProgram& program, int size) : OdeintScheme(program, size, 8) {}
  const double* errorAtEnd() const override { return error_.data(); }

 private:
  double make(const ExplicitStep& step) override {
    begin(step);
    auto derivative = derivativeOf(step);
    scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h, error_);
    std::copy(end_.begin(), end_.end(), at(step, step.nodes - 1));
    stepToNodes(step);
    return errorOf(step);
  }
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
