/// Implicit steps for stiff scenes.
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <memory>

#include "dynamics/shaft_count.h"
#include "integrate/radau_method.h"
#include "integrate/stepper.h"

namespace variator_sim {
namespace {

/// Radau IIA of 3, 5 or 7 stages, order 5, 9 or 13: L-stable, stiffly accurate; dense output by its
/// collocation polynomial (Hairer, Wanner: Solving ODE II, IV.8; radau_method.h).
///
/// A stiff constraint whose C turns with time or state pulls the accelerations back along a moving
/// direction J^-1 C^T. Its limit is a differential-algebraic system of index 2, on which this
/// method keeps its order (Rosenbrock methods do not). So the stages hold psi = 0 itself, in place
/// of its derivative C eta + c0 = 0 that has 1/tau in it (Drivetrain::calcStageResidual); Newton's
/// iteration then converges whatever tau.
///
/// The stages Z_i = y_i - x, h A x'(y) = Z are found by simplified Newton iterations with the exact
/// matrix at the beginning of the step, decoupled into one real system and some complex ones of
/// S x S (linearization.h) by the eigenvectors T of A^-1.
class RadauStepper final : public Stepper {
 public:
  RadauStepper(const System& system, Tolerance tolerance, int most)
      : Stepper(system.size(), tolerance),
        most_(most),
        stages_(most),
        tried_(most),
        keeps_psi_(system.keepsConstraintsInStages()),
        holds_jerks_(system.scene().hasOrder3()),
        S(system.shafts()),
        size_(system.size()),
        last_(size_ - S),
        linearization_(S, size_ / S),
        matrix_x_(size_),
        rounding_(size_),
        limit_(size_),
        newton_weight_(size_),
        f_{rounding_, rounding_, rounding_, rounding_, rounding_, rounding_, rounding_},
        parts_(f_),
        Z_(f_),
        last_stages_(f_) {
    // Coefficients are worked out here, not in the middle of a motion.
    for (int s = kLeast; s <= most_; s += 2) RadauMethod::withStages(s);
    method_ = &RadauMethod::withStages(stages_);
  }

  const char* name() const override { return "radau"; }
  int errorOrder() const override { return tried_ + 1; }
  double work() const override { return 10.0 * tried_ - 4.0; }
  bool isImplicit() const override { return true; }
  /// A step that took many iterations is near those that do not converge (Hairer, Wanner, IV.8
  /// (8.21)).
  double ease() const override { return (2.0 * kNit + 1.0) / (2.0 * kNit + iterations_); }
  void restart() override {
    matrix_time_ = std::numeric_limits<double>::quiet_NaN();
    end_ = std::numeric_limits<double>::quiet_NaN();
    stages_ = tried_ = most_;
    quick_steps_ = 0;
    has_converged_ = true;
  }

  double step(System& system, const StepNode& from, double h, State& x_new) override {
    // The matrix belongs to the point, not to the step: a repeated step keeps it.
    const bool is_repeated = from.time == matrix_time_ && from.x == matrix_x_;
    if (!is_repeated) {
      system.calcStageLinearization(from.time, from.x, from.dxdt, linearization_);
      matrix_time_ = from.time;
      matrix_x_ = from.x;
    }
    chooseOrder(is_repeated);
    tried_ = stages_;
    switch (stages_) {
      case 3:
        return stepBy<3>(system, from, h, x_new, is_repeated);
      case 5:
        return stepBy<5>(system, from, h, x_new, is_repeated);
      default:
        return stepBy<7>(system, from, h, x_new, is_repeated);
    }
  }

  void calcSlope(double theta, double h, State& slope) const override {
    RadauMethod::Vector weights{};
    method_->calcSlopeWeights(theta, weights);
    combine(weights, slope);
    for (double& value : slope) value /= h;
  }

  bool interpolate(System& /*system*/, double time, const StepNode& from, const StepNode& to,
                   State& x) override {
    RadauMethod::Vector weights{};
    method_->calcValueWeights((time - from.time) / (to.time - from.time), weights);
    combine(weights, x);
    for (int n = 0; n < size_; ++n) x[n] += from.x[n];
    return true;
  }

  /// By the quadrature that the stages are points of.
  void calcTorqueGain(System& system, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    if (!system.integratesTorque()) return;
    const double h = to.time - from.time;
    const int s = method_->stages();
    for (int i = 0; i < s; ++i) {
      const auto stage = static_cast<std::size_t>(i);
      State x = to.x;
      if (i < s - 1) {
        for (int n = 0; n < size_; ++n) x[n] = from.x[n] + Z_[stage][n];
      }
      const double weight = method_->coefficients()[static_cast<std::size_t>(s - 1)][stage];
      const double time = from.time + method_->points()[stage] * h;
      gain.add(h, weight, system.calcTorqueRate(time, x));
    }
  }

 private:
  using Complex = std::complex<double>;
  using Stages = std::array<State, RadauMethod::kMaxStages>;

  /// The sum of the first s stages, each with its weight.
  void combine(std::size_t s, const RadauMethod::Vector& weights, const Stages& stages,
               State& sum) const {
    for (int n = 0; n < size_; ++n) sum[n] = 0.0;
    for (std::size_t i = 0; i < s; ++i) {
      for (int n = 0; n < size_; ++n) sum[n] += weights[i] * stages[i][n];
    }
  }
  void combine(const RadauMethod::Vector& weights, State& sum) const {
    combine(static_cast<std::size_t>(method_->stages()), weights, Z_, sum);
  }

  /// Newton's iteration tells what the order is to be: where it fails, steps are shorter than the
  /// error asks for, and of short steps those with few stages cost least. Where it converges at
  /// once for some steps, the order goes up again.
  void chooseOrder(bool is_repeated) {
    if (is_repeated) {
      if (!has_converged_ && stages_ > kLeast) stages_ -= 2;
      if (!has_converged_) quick_steps_ = 0;
      return;
    }
    if (stages_ == most_ || quick_steps_ < kQuickSteps) return;
    stages_ += 2;
    quick_steps_ = 0;
  }

  template <std::size_t kStages>
  double stepBy(System& system, const StepNode& from, double h, State& x_new, bool is_repeated) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const bool is_predicted = predictStages<kStages>(from, h, is_repeated);
    has_converged_ = false;
    if (!linearization_.factor(h / method_->real())) return kNaN;
    for (int p = 0; p < method_->pairs(); ++p) {
      if (!linearization_.factorComplex(p, h / method_->pair(p))) return kNaN;
    }
    noteRounding(from, h);
    noteLimits(from);
    weighCorrections(from);
    has_converged_ = findStages<kStages>(system, from, h, is_predicted);
    if (!has_converged_) return kNaN;
    for (int n = 0; n < size_; ++n) x_new[n] = from.x[n] + Z_[kStages - 1][n];
    end_ = from.time + h;
    step_ = h;
    if (refused_ > 0.0) return refused_;
    return calcError(system, from, h, x_new, is_repeated);
  }

  /// Stages from the polynomial of the last step that ends here, or of a longer one from here that
  /// was refused: true; else none. Leaves no polynomial.
  template <std::size_t kStages>
  bool predictStages(const StepNode& from, double h, bool is_repeated) {
    const bool goes_on = end_ == from.time && h <= kFarthest * step_;
    const bool is_known = goes_on || (is_repeated && !std::isnan(end_));
    const RadauMethod& last = *method_;
    method_ = &RadauMethod::withStages(kStages);
    end_ = std::numeric_limits<double>::quiet_NaN();
    if (!is_known) {
      for (std::size_t i = 0; i < kStages; ++i) Z_[i].fill(0.0);
      return false;
    }
    const auto s = static_cast<std::size_t>(last.stages());
    for (std::size_t i = 0; i < s; ++i) last_stages_[i] = Z_[i];
    for (std::size_t i = 0; i < kStages; ++i) {
      RadauMethod::Vector weights{};
      const double theta = method_->points()[i] * h / step_;
      last.calcValueWeights(goes_on ? 1.0 + theta : theta, weights);
      if (goes_on) weights[s - 1] -= 1.0;
      combine(s, weights, last_stages_, Z_[i]);
    }
    return true;
  }

  /// Computes the stages' defects: f - h^-1 A^-1 Z of the upper rows, minus the residual in the
  /// last.
  template <std::size_t kStages>
  void calcDefects(System& system, const StepNode& from, double h) {
    const RadauMethod::Matrix& inverse = method_->inverse();
    const double rate = 1.0 / h;
    State y(size_);
    for (std::size_t i = 0; i < kStages; ++i) {
      State& f = f_[i];
      forEachComponent(0, size_, [&](int n) {
        double sum = inverse[i][0] * Z_[0][n];
        for (std::size_t j = 1; j < kStages; ++j) sum += inverse[i][j] * Z_[j][n];
        f[n] = rate * sum;
        y[n] = from.x[n] + Z_[i][n];
      });
      double residual[kMaxShafts];
      system.calcStageResidual(from.time + method_->points()[i] * h, y, f.data() + last_,
                               linearization_, residual);
      for (int n = 0; n < last_; ++n) f[n] = y[n + S] - f[n];
      for (int j = 0; j < S; ++j) f[last_ + j] = -residual[j];
    }
  }

  /// One Newton correction of the stages. Its size, in units of what the iteration may leave.
  template <std::size_t kStages>
  double correctStages() {
    const RadauMethod::Matrix& T = method_->transform();
    const RadauMethod::Matrix& T_inverse = method_->inverseTransform();
    forEachComponent(0, size_, [&](int n) {
      for (std::size_t k = 0; k < kStages; ++k) {
        double sum = T_inverse[k][0] * f_[0][n];
        for (std::size_t i = 1; i < kStages; ++i) sum += T_inverse[k][i] * f_[i][n];
        parts_[k][n] = sum;
      }
    });
    linearization_.solve(parts_[0]);
    for (std::size_t k = 1; k < kStages; k += 2) {
      for (int n = 0; n < size_; ++n) {
        complex_part_[static_cast<std::size_t>(n)] = {parts_[k][n], parts_[k + 1][n]};
      }
      linearization_.solveComplex(static_cast<int>(k / 2), complex_part_);
      for (int n = 0; n < size_; ++n) {
        parts_[k][n] = complex_part_[static_cast<std::size_t>(n)].real();
        parts_[k + 1][n] = complex_part_[static_cast<std::size_t>(n)].imag();
      }
    }
    double size = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    forEachComponent(0, size_, [&](int n) {
      double largest = 0.0;
      double sum = 0.0;
      for (std::size_t i = 0; i < kStages; ++i) {
        double change = T[i][0] * parts_[0][n];
        for (std::size_t k = 1; k < kStages; ++k) change += T[i][k] * parts_[k][n];
        Z_[i][n] += change;
        largest = std::max(largest, std::abs(change));
        sum += change;
      }
      size = std::max(size, largest * newton_weight_[n]);
      poison += 0.0 * sum;
    });
    return size + poison;
  }

  /// Simplified Newton iterations on the stages, left where the step is hopeless (`refused_`).
  /// False when they do not converge.
  template <std::size_t kStages>
  bool findStages(System& system, const StepNode& from, double h, bool is_predicted) {
    double first = 0.0;
    double previous = 0.0;
    ++quick_steps_;
    refused_ = 0.0;
    for (iterations_ = 1; iterations_ <= kMaxIterations; ++iterations_) {
      calcDefects<kStages>(system, from, h);
      const double size = correctStages<kStages>();
      if (iterations_ == kQuick + 1) quick_steps_ = 0;
      if (iterations_ == 1) first = size;
      const Newton verdict = judgeCorrection(size, previous, first, is_predicted);
      if (verdict != Newton::kGoesOn) return verdict == Newton::kConverged;
      if (iterations_ == 2 && isHopeless(from, h, size)) return true;
      previous = size;
    }
    iterations_ = kMaxIterations;
    return false;
  }

  enum class Newton { kGoesOn, kConverged, kFails };
  /// Judges the iteration by the sizes of its last two corrections, and of the first one.
  Newton judgeCorrection(double size, double previous, double first, bool is_predicted) const {
    constexpr double kUlps = 64.0 * kEpsilon;
    if (!std::isfinite(size)) return Newton::kFails;
    if (size == 0.0) return Newton::kConverged;
    // A prediction this good needs no second look.
    if (iterations_ == 1) return size <= 1e-3 ? Newton::kConverged : Newton::kGoesOn;
    double rate = size / previous;
    // The first correction of stages that start from nothing is the predictor that they lack: the
    // rate that it leads to says nothing of the next one. At the top of a bump of Q the matrix may
    // be far stiffer than where the stages lie: all further corrections are small, and as large as
    // the one before, more than rounding.
    const bool is_rate_known = is_predicted || iterations_ > 2;
    const bool creeps =
        !is_predicted && std::abs(rate - 1.0) < 0.01 && size > std::max(first, largest_) * kUlps;
    if (iterations_ == 2) rate = std::max(rate, kFirstRate);
    if (rate >= 0.99) return size <= 1.0 && !creeps ? Newton::kConverged : Newton::kFails;
    if (is_rate_known && rate / (1.0 - rate) * size <= 1.0) return Newton::kConverged;
    // The first rate still has the error of the prediction in it.
    const int rest = kMaxIterations - iterations_;
    const bool is_late = iterations_ > 3 && std::pow(rate, rest) / (1.0 - rate) * size > 1.0;
    return is_late ? Newton::kFails : Newton::kGoesOn;
  }

  /// Errors far above the tolerance show long before the stages are known to a part of it, in
  /// corrections of at least a tolerance.
  bool isHopeless(const StepNode& from, double h, double size) {
    if (kNewton * size < 1.0) return false;
    State slope(size_);
    State error(size_);
    const double norm = calcFilteredDefect(from, h, from.x, slope, error);
    if (!(norm > kHopeless + kUncertain * size)) return false;
    refused_ = norm;
    return true;
  }

  /// `slope` p'(0), `error` (gamma/h M - dx'/dx)^-1 (x' - p'(0)), and its norm.
  double calcFilteredDefect(const StepNode& from, double h, const State& x_new, State& slope,
                            State& error) const {
    calcSlope(0.0, h, slope);
    for (int n = 0; n < size_; ++n) error[n] = from.dxdt[n] - slope[n];
    linearization_.weigh(error.data() + last_);
    linearization_.solve(error);
    return calcNorm(error, from.x, x_new);
  }

  /// Returns the error of the slope of the stages' polynomial at the beginning, times h / gamma and
  /// filtered: (gamma/h M - dx'/dx)^-1 (x' - p'(0)), Hairer's and Wanner's estimate (8.20), once
  /// more filtered at a first step or after a rejection.
  double calcError(System& system, const StepNode& from, double h, const State& x_new,
                   bool is_repeated) {
    State weighted(size_);
    State error(size_);
    double norm = calcFilteredDefect(from, h, x_new, weighted, error);
    if (norm > 1.0 || is_repeated) {
      State x(size_);
      for (int n = 0; n < size_; ++n) x[n] = from.x[n] + error[n];
      for (double& value : weighted) value = -value;
      std::copy(x.begin() + S, x.end(), error.begin());
      double residual[kMaxShafts];
      const double at_rest[kMaxShafts] = {};
      system.calcStageResidual(from.time, x, at_rest, linearization_, residual);
      // M is a projector: once more, and what rounding left of the slope along the rows is gone. It
      // would not become less with h.
      linearization_.weigh(weighted.data() + last_);
      linearization_.weigh(weighted.data() + last_);
      for (int j = 0; j < S; ++j) error[last_ + j] = -residual[j];
      for (int n = 0; n < size_; ++n) error[n] += weighted[n];
      linearization_.solve(error);
      norm = calcNorm(error, from.x, x_new);
    }
    // Neither calcNorm nor the checks of the accelerations count its part due to rounding.
    const double stages = method_->stages();
    for (int n = 0; n < size_; ++n) {
      const double rounding = stages * stages / (kLeast * kLeast) * rounding_[n];
      error_[n] = std::copysign(std::max(0.0, std::abs(error[n]) - rounding), error[n]);
    }
    return holds_jerks_ ? kOfOrder3 * norm : norm;
  }

  /// Returns the effect of an ulp of the velocities on the accelerations. A transient of a stiff
  /// constraint (tau = 1e-8 s) has epsilon = -(omega_2 - u omega_1)/tau, which no arithmetic of
  /// 16 digits can know better than |omega| 1e-16 / tau; steps much longer than tau know it to
  /// |omega| 1e-16 / h.
  void noteRounding(const StepNode& from, double h) {
    rounding_.fill(0.0);
    if (!keeps_psi_) return;
    constexpr double kUlps = 64.0 * kEpsilon;
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
  void noteLimits(const StepNode& from) {
    limit_.fill(std::numeric_limits<double>::infinity());
    if (size_ == 3 * S) return;
    // Along what psi pulls, the accelerations are those of the stages.
    SquareMatrix by_velocity = linearization_.block(1);
    if (keeps_psi_) {
      by_velocity = linearization_.projector().lazyProduct(linearization_.block(1));
    }
    for (int i = 0; i < S; ++i) {
      const double allowed = tolerance_.of(from.dxdt[last_ + i]);
      for (int j = 0; j < S; ++j) {
        const double slope = std::abs(by_velocity(i, j));
        limit_[last_ + j] = std::min(limit_[last_ + j], 0.25 * allowed / slope);
        rounding_[last_ + j] =
            std::max(rounding_[last_ + j], 16.0 * kEpsilon * std::abs(from.x[last_ + j]));
      }
    }
  }
  /// Newton's iteration may leave a part of the tolerance; rounding is no reason to go on.
  /// If stages keep psi, velocities that a torque answers to steeply (a narrow layer of
  /// friction) have to be known as well as the accelerations that they make beside those of x: the
  /// torque is integrated by its rate, and a step that loses some of it has lost it for good.
  void weighCorrections(const StepNode& from) {
    const auto& answer = linearization_.block(size_ / S - 1);
    largest_ = 0.0;
    forEachComponent(0, size_, [&](int n) {
      double allowed = std::min(tolerance_.of(from.x[n]), limit_[n]);
      if (keeps_psi_ && size_ == 3 * S && n >= S && n < 2 * S) {
        for (int i = 0; i < S; ++i) {
          const double slope = std::abs(answer(i, n - S));
          allowed = std::min(allowed, kAnswer * tolerance_.of(from.x[last_ + i]) / slope);
        }
      }
      newton_weight_[n] = 1.0 / (kNewton * allowed + rounding_[n]);
      largest_ = std::max(largest_, std::abs(from.x[n]) * newton_weight_[n]);
    });
  }
  /// The slope at the beginning has the roundings of all stages in it, each with a weight of about
  /// the square of their number, which shorter steps would have, too.
  double calcNorm(const State& error, const State& x, const State& x_new) const {
    const double stages = method_->stages();
    const double part = stages * stages / (kLeast * kLeast);
    double norm = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int n = 0; n < size_; ++n) {
      norm =
          std::max(norm, std::abs(error[n]) / (std::min(tolerance_.of(x[n], x_new[n]), limit_[n]) +
                                               part * rounding_[n]));
      poison += 0.0 * (error[n] + x_new[n]);
    }
    return norm + poison;
  }

  static constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  /// The part of the tolerance that Newton's iteration may leave.
  static constexpr double kNewton = 0.01;
  /// Errors count so many times where nothing restores the accelerations: what thousands of steps
  /// leave in them may be of one sign.
  static constexpr double kOfOrder3 = 2.0;
  /// Tolerances of the accelerations: what a torque may answer to what is left.
  static constexpr double kAnswer = 10.0;
  /// 2 kNit + 2 iterations halve the next step.
  static constexpr double kNit = 3.0;
  static constexpr double kFirstRate = 0.01;
  /// A step is refused in the middle of the iteration where its error is above this, and what a
  /// correction of one (of what the iteration may leave) still moves that.
  static constexpr double kHopeless = 2.0;
  static constexpr double kUncertain = 1e-3;
  static constexpr int kLeast = 3;
  /// Steps that polynomials reach beyond their end.
  static constexpr double kFarthest = 10.0;
  /// Iterations of a quick step, and so many steps that let the order rise.
  static constexpr int kQuick = 4;
  static constexpr int kQuickSteps = 5;
  static constexpr int kMaxIterations = 10;

  const int most_;  // stages
  int stages_;      // of the next step
  int tried_;       // of the last step, whether it was good or not
  int quick_steps_ = 0;
  const bool keeps_psi_;  // in the stages
  const bool holds_jerks_;
  int iterations_ = 1;         // of the last step
  bool has_converged_ = true;  // the last try
  double refused_ = 0.0;       // the error for which the iteration was left, 0 where it was not

  const int S;  // shafts
  const int size_;
  const int last_;             // component of the last S
  const RadauMethod* method_;  // of the last step
  Linearization linearization_;
  Linearization::ComplexState complex_part_{};
  double matrix_time_ = std::numeric_limits<double>::quiet_NaN();
  State matrix_x_;
  State rounding_;
  State limit_;
  State newton_weight_;
  double largest_ = 0.0;  // component of x, weighed so

  Stages f_;      // x_{l+1} - x_l'; minus the residual in the last rows
  Stages parts_;  // of a correction, along the eigenvectors
  Stages Z_;      // what the stages have moved
  Stages last_stages_;
  double end_ = std::numeric_limits<double>::quiet_NaN();
  double step_ = 0.0;
};

}  // namespace

std::unique_ptr<Stepper> makeRadauStepper(const System& system, Tolerance tolerance,
                                          int most_stages) {
  return std::make_unique<RadauStepper>(system, tolerance, most_stages);
}

}  // namespace variator_sim
