/// Linearly implicit steps for stiff scenes.
#include <array>
#include <boost/numeric/odeint/stepper/rosenbrock4.hpp>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>

#include "dynamics/shaft_count.h"
#include "integrate/stepper.h"

namespace variator_sim {
namespace {

/// RODAS 4(3): six stages, L-stable, stiffly accurate, of full order on the slow manifold of a
/// stiff constraint; dense output of order 3 (Hairer, Wanner: Solving ODE II, IV.7, VI.4). The
/// coefficients are Boost.Odeint's; its stepper works on uBLAS types only and allocates.
///
/// Each stage solves (I/(h gamma) - dx'/dx) u_i = x'(t + alpha_i h, x + sum a_ij u_j)
///     + sum c_ij u_j / h + d_i h dx'/dt
/// by the S x S system of linearization.h.
class RosenbrockStepper final : public Stepper {
 public:
  RosenbrockStepper(const System& system, Tolerance tolerance)
      : Stepper(system, tolerance),
        size_(system.size()),
        linearization_(system.shafts(), system.size() / system.shafts()),
        matrix_x_(size_),
        time_derivative_(size_),
        u_{matrix_x_, matrix_x_, matrix_x_, matrix_x_, matrix_x_},
        third_(size_),
        fourth_(size_) {}

  const char* name() const override { return "rosenbrock4"; }
  int errorOrder() const override { return 4; }
  double work() const override { return 10.0; }
  bool isImplicit() const override { return true; }
  bool hasDenseOutput() const override { return true; }

  void restart() override { matrix_time_ = std::numeric_limits<double>::quiet_NaN(); }
  double step(System& system, const StepNode& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    is_prepared_ = false;
    // The matrix and dx'/dt belong to the point, not to the step: a repeated step keeps them.
    if (from.time != matrix_time_ || from.x != matrix_x_) {
      system.calcLinearization(from.time, from.x, linearization_);
      matrix_time_ = from.time;
      matrix_x_ = from.x;
    }
    if (!linearization_.factor(h * k_.gamma)) return kNaN;
    calcTimeDerivative(system, from, h);

    const auto& x = from.x;
    const double t = from.time;
    const double inverse = 1.0 / h;
    State y(size_);
    State slope(size_);
    forEachComponent(0, size_,
                     [&](int n) { u_[0][n] = from.dxdt[n] + h * k_.d1 * time_derivative_[n]; });
    linearization_.solve(u_[0]);

    for (int n = 0; n < size_; ++n) y[n] = x[n] + k_.a21 * u_[0][n];
    system(y, slope, t + k_.c2 * h);
    forEachComponent(0, size_, [&](int n) {
      u_[1][n] = slope[n] + h * k_.d2 * time_derivative_[n] + inverse * k_.c21 * u_[0][n];
    });
    linearization_.solve(u_[1]);

    for (int n = 0; n < size_; ++n) y[n] = x[n] + k_.a31 * u_[0][n] + k_.a32 * u_[1][n];
    system(y, slope, t + k_.c3 * h);
    forEachComponent(0, size_, [&](int n) {
      u_[2][n] = slope[n] + h * k_.d3 * time_derivative_[n] +
                 inverse * (k_.c31 * u_[0][n] + k_.c32 * u_[1][n]);
    });
    linearization_.solve(u_[2]);

    forEachComponent(0, size_, [&](int n) {
      y[n] = x[n] + k_.a41 * u_[0][n] + k_.a42 * u_[1][n] + k_.a43 * u_[2][n];
    });
    system(y, slope, t + k_.c4 * h);
    forEachComponent(0, size_, [&](int n) {
      u_[3][n] = slope[n] + h * kD4 * time_derivative_[n] +
                 inverse * (k_.c41 * u_[0][n] + k_.c42 * u_[1][n] + k_.c43 * u_[2][n]);
    });
    linearization_.solve(u_[3]);

    forEachComponent(0, size_, [&](int n) {
      y[n] = x[n] + k_.a51 * u_[0][n] + k_.a52 * u_[1][n] + k_.a53 * u_[2][n] + k_.a54 * u_[3][n];
    });
    system(y, slope, t + h);
    forEachComponent(0, size_, [&](int n) {
      u_[4][n] = slope[n] + inverse * (k_.c51 * u_[0][n] + k_.c52 * u_[1][n] + k_.c53 * u_[2][n] +
                                       k_.c54 * u_[3][n]);
    });
    linearization_.solve(u_[4]);

    for (int n = 0; n < size_; ++n) y[n] += u_[4][n];
    system(y, slope, t + h);
    State error(size_);
    forEachComponent(0, size_, [&](int n) {
      error[n] = slope[n] + inverse * (k_.c61 * u_[0][n] + k_.c62 * u_[1][n] + k_.c63 * u_[2][n] +
                                       k_.c64 * u_[3][n] + k_.c65 * u_[4][n]);
    });
    linearization_.solve(error);

    double largest = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int n = 0; n < size_; ++n) {
      x_new[n] = y[n] + error[n];
      error_[n] = error[n];
      largest = std::max(largest, std::abs(error[n]) / tolerance_.of(x[n], x_new[n]));
      poison += 0.0 * (error[n] + x_new[n]);
    }
    return largest + poison;
  }

  bool interpolate(System& /*system*/, double time, const StepNode& from, const StepNode& to,
                   State& x) override {
    if (!is_prepared_) {
      for (int n = 0; n < size_; ++n) {
        third_[n] = k_.d21 * u_[0][n] + k_.d22 * u_[1][n] + k_.d23 * u_[2][n] + k_.d24 * u_[3][n] +
                    k_.d25 * u_[4][n];
        fourth_[n] = k_.d31 * u_[0][n] + k_.d32 * u_[1][n] + k_.d33 * u_[2][n] + k_.d34 * u_[3][n] +
                     k_.d35 * u_[4][n];
      }
      is_prepared_ = true;
    }
    const double theta = (time - from.time) / (to.time - from.time);
    const double rest = 1.0 - theta;
    for (int n = 0; n < size_; ++n) {
      x[n] = from.x[n] * rest + theta * (to.x[n] + rest * (third_[n] + theta * fourth_[n]));
    }
    return true;
  }

 private:
  /// dx'/dt with x held, inputs moving, by a difference over a part of the step; only its last rows
  /// are not zero.
  void calcTimeDerivative(System& system, const StepNode& from, double h) {
    if (!system.readsTime()) {
      time_derivative_.fill(0.0);
      return;
    }
    // Forward, into the step: behind it there may be a kink. Truncation and rounding are both about
    // 1e-9 here. Steps of a few roundings of the time (to a sample just behind a command) have no
    // such parts; what lies a little further will do for them.
    constexpr double kPart = 1.0 / 8192.0;
    constexpr double kLeast = 1024.0 * std::numeric_limits<double>::epsilon();
    const double width = std::max(kPart * h, kLeast * std::abs(from.time));
    const double near = from.time + width;
    const double far = from.time + 2.0 * width;
    State slope_near(size_);
    State slope_far(size_);
    system(from.x, slope_near, near);
    system(from.x, slope_far, far);
    for (int n = 0; n < size_; ++n) {
      const double first = (slope_near[n] - from.dxdt[n]) / (near - from.time);
      const double second = (slope_far[n] - slope_near[n]) / (far - near);
      time_derivative_[n] = 1.5 * first - 0.5 * second;
    }
  }

  /// Boost.Odeint 1.74 has this one with the wrong sign, which costs scenes that depend on time two
  /// orders (measured: test/stepper_test.cpp).
  static constexpr double kD4 = -0.03620000000000023;
  const int size_;
  const boost::numeric::odeint::default_rosenbrock_coefficients<double> k_;
  Linearization linearization_;
  double matrix_time_ = std::numeric_limits<double>::quiet_NaN();
  State matrix_x_;
  State time_derivative_;
  std::array<State, 5> u_;
  State third_;
  State fourth_;
  bool is_prepared_ = false;
};

}  // namespace

std::unique_ptr<Stepper> makeRosenbrock4Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<RosenbrockStepper>(system, tolerance);
}

}  // namespace variator_sim
