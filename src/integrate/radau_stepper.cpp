/// Implicit steps for stiff scenes.
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <memory>

#include "dynamics/shaft_count.h"
#include "integrate/stepper.h"

namespace variator_sim {
namespace {

/// Radau IIA of order 5: three stages, L-stable, stiffly accurate; dense output by its collocation
/// polynomial (Hairer, Wanner: Solving ODE II, IV.8).
///
/// A stiff constraint whose C turns with time or state pulls the accelerations back along a moving
/// direction J^-1 C^T. Its limit is a differential-algebraic system of index 2, on which this
/// method keeps its order and Rosenbrock methods do not: rosenbrock4's error grows like h^5/tau
/// there. So the stages hold psi = 0 itself, in place of its derivative C eta + c0 = 0 that has
/// 1/tau in it (Drivetrain::calcStageResidual); Newton's iteration then converges whatever tau.
///
/// The stages Z_i = y_i - x, h A x'(y) = Z are found by simplified Newton iterations with the exact
/// matrix at the beginning of the step, decoupled into one real and one complex system of S x S
/// (linearization.h) by the eigenvectors T of A^-1.
class RadauStepper final : public Stepper {
 public:
  RadauStepper(const System& system, Tolerance tolerance)
      : Stepper(system, tolerance),
        S(system.shafts()),
        size_(system.size()),
        last_(size_ - S),
        linearization_(S, size_ / S),
        matrix_x_(size_),
        rounding_(size_),
        limit_(size_),
        f_{rounding_, rounding_, rounding_},
        Z_(f_),
        W_(f_),
        polynomial_(f_) {
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    newton_tolerance_ = std::max(10.0 * kEpsilon / std::max(tolerance.relative, 1e-14),
                                 std::min(0.03, std::sqrt(tolerance.relative)));
    newton_tolerance_ = std::min(newton_tolerance_, 0.03);
  }

  const char* name() const override { return "radau5"; }
  int errorOrder() const override { return 4; }
  double work() const override { return 26.0; }
  bool isImplicit() const override { return true; }
  bool keepsConstraints() const override { return true; }
  bool hasDenseOutput() const override { return true; }
  void restart() override {
    matrix_time_ = std::numeric_limits<double>::quiet_NaN();
    polynomial_end_ = std::numeric_limits<double>::quiet_NaN();
  }

  double step(System& system, const StepNode& from, double h, State& x_new,
              State& /*dxdt_new*/) override {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    // The matrix belongs to the point, not to the step: a repeated step keeps it.
    const bool is_repeated = from.time == matrix_time_ && from.x == matrix_x_;
    if (!is_repeated) {
      system.calcStageLinearization(from.time, from.x, from.dxdt, linearization_);
      matrix_time_ = from.time;
      matrix_x_ = from.x;
    }
    if (!linearization_.factor(h / kRealValue) ||
        !linearization_.factorComplex(h / kComplexValue)) {
      return kNaN;
    }
    noteRounding(system, from, h);
    noteLimits(system, from);
    predictStages(from, h);
    polynomial_end_ = kNaN;
    if (!findStages(system, from, h)) return kNaN;

    // The polynomial that takes the values x, x + Z_1, x + Z_2, x + Z_3 at 0, c_1, c_2, 1
    for (int n = 0; n < size_; ++n) {
      x_new[n] = from.x[n] + Z_[2][n];
      for (std::size_t p = 0; p < 3; ++p) {
        polynomial_[p][n] = Z_[0][n] * kP[0][p] + Z_[1][n] * kP[1][p] + Z_[2][n] * kP[2][p];
      }
    }
    polynomial_end_ = from.time + h;
    polynomial_step_ = h;
    return calcError(system, from, h, x_new, is_repeated);
  }

  void calcSlope(double theta, double h, State& slope) const override {
    for (int n = 0; n < size_; ++n) {
      slope[n] = (polynomial_[0][n] +
                  theta * (2.0 * polynomial_[1][n] + theta * 3.0 * polynomial_[2][n])) /
                 h;
    }
  }

  bool interpolate(System& /*system*/, double time, const StepNode& from, const StepNode& to,
                   State& x) override {
    const double theta = (time - from.time) / (to.time - from.time);
    for (int n = 0; n < size_; ++n) {
      x[n] = from.x[n] +
             theta * (polynomial_[0][n] + theta * (polynomial_[1][n] + theta * polynomial_[2][n]));
    }
    return true;
  }

 private:
  using Complex = std::complex<double>;

  /// Stages from the polynomial of the last step, where there is one that ends here.
  void predictStages(const StepNode& from, double h) {
    if (!(polynomial_end_ == from.time)) {
      for (State& stage : Z_) stage.fill(0.0);
      for (State& stage : W_) stage.fill(0.0);
      return;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const double theta = 1.0 + kC[i] * h / polynomial_step_;
      for (int n = 0; n < size_; ++n) {
        const auto at = [&](double s) {
          return s * (polynomial_[0][n] + s * (polynomial_[1][n] + s * polynomial_[2][n]));
        };
        Z_[i][n] = at(theta) - at(1.0);
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      for (int n = 0; n < size_; ++n) {
        W_[i][n] = kTI[i][0] * Z_[0][n] + kTI[i][1] * Z_[1][n] + kTI[i][2] * Z_[2][n];
      }
    }
  }

  /// Simplified Newton iterations on W = T^-1 Z. False when they do not converge.
  bool findStages(System& system, const StepNode& from, double h) {
    constexpr int kMaxIterations = 10;
    const double real = kRealValue / h;
    const Complex complex = kComplexValue / h;
    double previous = 0.0;
    State y(size_);
    const double inverse = 1.0 / h;
    State real_part(size_);
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      for (std::size_t i = 0; i < 3; ++i) {
        forEachComponent(0, size_, [&](int n) { y[n] = from.x[n] + Z_[i][n]; });
        for (int n = 0; n < last_; ++n) f_[i][n] = y[n + S];
        double rate[kMaxShafts];
        for (int j = 0; j < S; ++j) {
          const int n = last_ + j;
          rate[j] = inverse * (kInverse[i][0] * Z_[0][n] + kInverse[i][1] * Z_[1][n] +
                               kInverse[i][2] * Z_[2][n]);
        }
        double residual[kMaxShafts];
        system.calcStageResidual(from.time + kC[i] * h, y, rate, linearization_, residual);
        for (int j = 0; j < S; ++j) f_[i][last_ + j] = -residual[j];
      }
      forEachComponent(0, size_, [&](int n) {
        real_part[n] = kTI[0][0] * f_[0][n] + kTI[0][1] * f_[1][n] + kTI[0][2] * f_[2][n];
        complex_part_[static_cast<std::size_t>(n)] = {
            kTI[1][0] * f_[0][n] + kTI[1][1] * f_[1][n] + kTI[1][2] * f_[2][n],
            kTI[2][0] * f_[0][n] + kTI[2][1] * f_[1][n] + kTI[2][2] * f_[2][n]};
        if (n >= last_) return;  // the residual has x' in it
        real_part[n] -= real * W_[0][n];
        complex_part_[static_cast<std::size_t>(n)] -=
            multiply(complex, Complex(W_[1][n], W_[2][n]));
      });
      linearization_.solve(real_part);
      linearization_.solveComplex(complex_part_);
      double size = 0.0;
      forEachComponent(0, size_, [&](int n) {
        const Complex change = complex_part_[static_cast<std::size_t>(n)];
        W_[0][n] += real_part[n];
        W_[1][n] += change.real();
        W_[2][n] += change.imag();
        const double sum =
            std::abs(real_part[n]) + std::abs(change.real()) + std::abs(change.imag());
        // rounding is no reason to go on
        const double allowed = std::min(tolerance_.of(from.x[n]), limit_[n]);
        size = std::max(size, sum / (allowed + rounding_[n] / newton_tolerance_));
        size += 0.0 * sum;  // NaN and infinity stay
        for (std::size_t i = 0; i < 3; ++i) {
          Z_[i][n] = kT[i][0] * W_[0][n] + kT[i][1] * W_[1][n] + kT[i][2] * W_[2][n];
        }
      });
      if (!std::isfinite(size)) return false;
      if (size == 0.0) return true;
      if (iteration == 0) {
        // A prediction this good needs no second look.
        if (size <= 1e-3 * newton_tolerance_) return true;
      } else {
        double rate = size / previous;
        // The first correction of stages that start from nothing is mostly the predictor that they
        // lack: the rate that it leads to says too little of the next one.
        if (iteration == 1) rate = std::max(rate, kFirstRate);
        if (rate >= 0.99) return size <= newton_tolerance_;
        if (rate / (1.0 - rate) * size <= newton_tolerance_) return true;
        // The first rate still has the error of the prediction in it.
        const int rest = kMaxIterations - 1 - iteration;
        if (iteration > 2 && std::pow(rate, rest) / (1.0 - rate) * size > newton_tolerance_) {
          return false;
        }
      }
      previous = size;
    }
    return false;
  }

  /// (I/g - dx'/dx)^-1 (x' + sum e_i Z_i / h) / ..., Hairer's and Wanner's estimate (8.20), once
  /// more filtered at a first step or after a rejection.
  double calcError(System& system, const StepNode& from, double h, const State& x_new,
                   bool is_repeated) {
    State weighted(size_);
    State error(size_);
    for (int n = 0; n < size_; ++n) {
      weighted[n] = (kE[0] * Z_[0][n] + kE[1] * Z_[1][n] + kE[2] * Z_[2][n]) / h;
      error[n] = from.dxdt[n] + weighted[n];
    }
    weighMass(error);
    linearization_.solve(error);
    double norm = calcNorm(error, from.x, x_new);
    if (norm > 1.0 || is_repeated) {
      State x(size_);
      for (int n = 0; n < size_; ++n) x[n] = from.x[n] + error[n];
      std::copy(x.begin() + S, x.end(), error.begin());
      double residual[kMaxShafts];
      const double at_rest[kMaxShafts] = {};
      system.calcStageResidual(from.time, x, at_rest, linearization_, residual);
      weighMass(weighted);
      for (int j = 0; j < S; ++j) error[last_ + j] = -residual[j];
      for (int n = 0; n < size_; ++n) error[n] += weighted[n];
      linearization_.solve(error);
      norm = calcNorm(error, from.x, x_new);
    }
    error_ = error;
    return norm;
  }

  /// What an ulp of the velocities makes of the accelerations. A short transient of a stiff
  /// constraint (tau = 1e-8 s) has epsilon = -(omega_2 - u omega_1)/tau, which no arithmetic of
  /// 16 digits can know better than |omega| 1e-16 / tau; steps much longer than tau know it to
  /// |omega| 1e-16 / h.
  void noteRounding(const System& system, const StepNode& from, double h) {
    rounding_.fill(0.0);
    if (!system.keepsConstraintsInStages()) return;
    constexpr double kUlps = 64.0 * std::numeric_limits<double>::epsilon();
    const auto& by_velocity = linearization_.block(1);
    // The last rows are the accelerations, or the velocities: h times as much.
    const double scale = size_ == 3 * S ? 1.0 : h;
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) {
        const double slope = std::abs(by_velocity(i, j));
        rounding_[last_ + i] += scale * kUlps * std::abs(from.x[S + j]) * std::min(slope, 1.0 / h);
      }
    }
  }
  /// Accelerations that are no state follow from it: errors of the velocities may be so large only
  /// that the accelerations keep their tolerance.
  void noteLimits(const System& system, const StepNode& from) {
    limit_.fill(std::numeric_limits<double>::infinity());
    if (size_ == 3 * S) return;
    // Along what psi pulls, the accelerations are those of the stages.
    SquareMatrix by_velocity = linearization_.block(1);
    if (system.keepsConstraintsInStages()) {
      by_velocity = linearization_.projector().lazyProduct(linearization_.block(1));
    }
    for (int i = 0; i < S; ++i) {
      const double allowed = tolerance_.of(from.dxdt[last_ + i]);
      for (int j = 0; j < S; ++j) {
        const double slope = std::abs(by_velocity(i, j));
        limit_[last_ + j] = std::min(limit_[last_ + j], 0.25 * allowed / slope);
        rounding_[last_ + j] =
            std::max(rounding_[last_ + j],
                     16.0 * std::numeric_limits<double>::epsilon() * std::abs(from.x[last_ + j]));
      }
    }
  }
  double calcNorm(const State& error, const State& x, const State& x_new) const {
    double norm = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int n = 0; n < size_; ++n) {
      norm =
          std::max(norm, std::abs(error[n]) /
                             (std::min(tolerance_.of(x[n], x_new[n]), limit_[n]) + rounding_[n]));
      poison += 0.0 * (error[n] + x_new[n]);
    }
    return norm + poison;
  }

  /// The last rows of r times M.
  void weighMass(State& r) const {
    double weighed[kMaxShafts];
    for (int i = 0; i < S; ++i) {
      weighed[i] = linearization_.mass()(i, 0) * r[last_];
      for (int j = 1; j < S; ++j) weighed[i] += linearization_.mass()(i, j) * r[last_ + j];
    }
    std::copy_n(weighed, S, r.begin() + last_);
  }

  /// Without the checks for infinities of std::complex's operator.
  static Complex multiply(Complex a, Complex b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
  }

  // Computed to 40 digits from A of the method: nodes, eigenvalues and real eigenvectors of A^-1,
  // the error estimate's weights, and the collocation polynomial by Z.
  static constexpr double kC[3] = {0.15505102572168219018, 0.64494897427831780982, 1.0};
  static constexpr double kInverse[3][3] = {
      {3.2247448713915890491, 1.1678400846904054949, -0.25319726474218082619},
      {-3.5678400846904054949, 0.7752551286084109509, 1.0531972647421808262},
      {5.5319726474218082619, -7.5319726474218082619, 5.0}};
  static constexpr double kRealValue = 3.6378342527444957322;
  static constexpr Complex kComplexValue{2.6810828736277521339, 3.0504301992474105694};
  static constexpr double kT[3][3] = {
      {0.094438762488975241487, -0.14125529502095420843, -0.030029194105147424492},
      {0.25021312296533331138, 0.204129352293799932, 0.3829421127572619378},
      {1.0, 1.0, 0.0}};
  static constexpr double kTI[3][3] = {
      {4.1787185915519047273, 0.32768282076106238708, 0.52337644549944954804},
      {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
      {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};
  static constexpr double kE[3] = {-10.048809399827415562, 1.3821427331607488958,
                                   -0.33333333333333333333};
  static constexpr double kP[3][3] = {
      {10.048809399827415562, -25.629591447076639387, 15.580782047249223824},
      {-1.3821427331607488958, 10.296258113743306053, -8.9141153805825571577},
      {0.33333333333333333333, -2.6666666666666666667, 3.3333333333333333333}};
  static constexpr double kFirstRate = 0.01;

  const int S;  // shafts
  const int size_;
  const int last_;  // component of the last S
  Linearization linearization_;
  Linearization::ComplexState complex_part_{};
  double newton_tolerance_;
  double matrix_time_ = std::numeric_limits<double>::quiet_NaN();
  State matrix_x_;
  State rounding_;
  State limit_;
  std::array<State, 3> f_;  // x_{l+1}; minus the residual in the last rows
  std::array<State, 3> Z_;
  std::array<State, 3> W_;
  std::array<State, 3> polynomial_;
  double polynomial_end_ = std::numeric_limits<double>::quiet_NaN();
  double polynomial_step_ = 0.0;
};

}  // namespace

std::unique_ptr<Stepper> makeRadau5Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<RadauStepper>(system, tolerance);
}

}  // namespace variator_sim
