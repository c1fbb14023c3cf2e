#include "motion_program/explicit_steps.h"

#include <algorithm>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <vector>

#include "dynamics/tolerance.h"

namespace variator_sim {
namespace {

namespace odeint = boost::numeric::odeint;
using StateValues = std::vector<double>;

using Rk4 = odeint::runge_kutta4<StateValues>;
/// Dormand and Prince 5(4) with dense output of order 4 (J. Comput. Appl. Math. 6, 1980; Hairer,
/// Norsett, Wanner: Solving ODE I, II.5, II.6).
using Dopri5 = odeint::runge_kutta_dopri5<StateValues>;
/// Fehlberg 7(8), continued with the result of order 8 (NASA TR R-287, 1968).
using Fehlberg78 = odeint::runge_kutta_fehlberg78<StateValues>;

/// A scheme of Boost.Odeint, which neither shows its stages nor refuses an error that is NaN.
template <class Scheme>
class OdeintScheme final : public ExplicitScheme {
 public:
  /// `size`: of x.
  OdeintScheme(const MotionProgram& program, int size, int p)
      : ExplicitScheme(p),
        tolerance_{program.ABSOLUTE_TOLERANCE, program.RELATIVE_TOLERANCE},
        x_(static_cast<std::size_t>(size)),
        dxdt_(x_),
        end_(x_),
        slope_at_end_(x_),
        inside_(x_),
        error_(x_),
        last_(x_) {
    scheme_.adjust_size(x_);
  }

  const double* errorAtEnd() const override { return kEstimates ? error_.data() : nullptr; }
  double make(const ExplicitStep& step) override {
    std::copy_n(step.x, step.size, x_.begin());
    std::copy_n(step.slope, step.size, dxdt_.begin());
    auto derivative = [this, &step](const StateValues& x, StateValues& dxdt, double t) {
      (*step.slope_at)(t, x.data(), dxdt.data());
      if (!kEstimates) last_ = dxdt;  // k2, k3, k4
    };
    if constexpr (kIsDense) {
      scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, slope_at_end_, step.h, error_);
    } else if constexpr (kEstimates) {
      scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h, error_);
    } else {
      // With x' at the end as a fifth stage k5, h (k1 + 2 k2 + 2 k3 + k5) / 6 is of order 3, so
      // h (k4 - k5) / 6 estimates the error.
      scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, end_, step.h);
      (*step.slope_at)(step.h, end_.data(), slope_at_end_.data());
      for (std::size_t n = 0; n < x_.size(); ++n) {
        error_[n] = step.h / 6.0 * (last_[n] - slope_at_end_[n]);
      }
    }
    for (int j = 0; j < step.nodes; ++j) {
      const double at = step.node[j] * step.h;
      if (j + 1 == step.nodes) {
        inside_ = end_;
      } else if constexpr (kIsDense) {
        scheme_.calc_state(at, inside_, x_, dxdt_, 0.0, end_, slope_at_end_, step.h);
      } else {  // a step of its own
        scheme_.do_step(std::ref(derivative), x_, dxdt_, 0.0, inside_, at);
      }
      std::copy(inside_.begin(), inside_.end(),
                step.at_node + static_cast<std::ptrdiff_t>(j) * step.size);
    }
    return errorOf(step);
  }

 private:
  static constexpr bool kIsDense = std::is_same_v<Scheme, Dopri5>;
  static constexpr bool kEstimates = !std::is_same_v<Scheme, Rk4>;

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

  const Tolerance tolerance_;
  StateValues x_, dxdt_, end_, slope_at_end_, inside_, error_;
  StateValues last_;  ///< the last slope that was asked for
  Scheme scheme_;
};

}  // namespace

std::unique_ptr<ExplicitScheme> makeExplicitScheme(const MotionProgram& program, int size) {
  switch (program.stepper) {
    case StepperKind::kRk4:
      return std::make_unique<OdeintScheme<Rk4>>(program, size, 4);
    case StepperKind::kDopri5:
      return std::make_unique<OdeintScheme<Dopri5>>(program, size, 5);
    case StepperKind::kFehlberg78:
      return std::make_unique<OdeintScheme<Fehlberg78>>(program, size, 8);
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
