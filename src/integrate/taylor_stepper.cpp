/// Steps by the motion's own series, where the integrator makes single steps of them: `taylor`.
///
/// The order N follows from the tolerance and the step from the last coefficients, as the texts of
/// src/runtime choose them (orders.h).
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "expression/series_dot.h"
#include "integrate/stepper.h"

namespace variator_sim {
namespace {

class TaylorStepper final : public Stepper {
 public:
  TaylorStepper(const System& system, Tolerance tolerance)
      : Stepper(system.size(), tolerance),
        S(system.shafts()),
        size_(system.size()),
        end_(system.size()),
        base_x_(system.size()),
        base_dxdt_(system.size()),
        least_angle_(system.readsAngles() ? 0 : S) {
    if (system.formulas() == nullptr) return;
    most_ = system.formulas()->order();
    const double ratio = std::pow(std::max(tolerance.relative, 1e-16), 1.0 / most_);
    decay_[0] = 1.0;
    for (int k = 1; k < kTerms; ++k) decay_[k] = ratio * decay_[k - 1];
  }
  const char* name() const override { return "taylor"; }
  bool stepsBySeries() const override { return true; }
  int errorOrder() const override { return most_; }
  /// Measured beside radau's.
  double work() const override { return 2.5 * most_; }

  void restart() override { base_time_ = std::numeric_limits<double>::quiet_NaN(); }
  /// The length of the last step is the unit of the next series, and so in its rounding.
  void forget() override {
    restart();
    length_ = 0.0;
  }

  double chooseStep(System& system, const StepNode& from, double limit) override {
    expand(system, from, limit);
    return order_ < kLeastOrder ? 0.0 : std::min(limit, length_);
  }

  double step(System& system, const StepNode& from, double h, State& x_new) override {
    expand(system, from, h);
    if (order_ < kLeastOrder) return std::numeric_limits<double>::quiet_NaN();
    evaluate(h, x_new);
    end_ = x_new;
    if (!x_new.isFinite()) return std::numeric_limits<double>::quiet_NaN();
    // No longer than `chooseLength` allows: the terms are known to be within this. Accelerations
    // that follow from the state are judged by its error component by component.
    if (size_ == 3 * S && h <= length_) return kCaution;
    return calcLastTerms(from, x_new);
  }

  /// x' at the end beside that of the series: of an error c h^(N+1) it is off by c (N+1) h^N. What
  /// the last coefficients do not show (a pole that is near, a branch) is seen here. Accelerations
  /// that are no part of x have a tolerance of their own: what dies away is in them by its rate,
  /// and a step is many times as long as that lasts. (Beside the bend of a torque the accelerations
  /// of a short step are off by where the bend is: nothing that velocities would notice.)
  double estimateFromEnd(const StepNode& from, const StepNode& to) const override {
    const double h = to.time - from.time;
    const int last = lastTerm();
    const double part = h / (last + 1);
    double norm = 0.0;
    const auto judge = [&](int n, double slope) {
      const double defect = std::abs(to.dxdt[n] - slope);
      const double error = part * defect / tolerance_.of(from.x[n], to.x[n]);
      norm = worseOf(norm, error);
      if (n < S || size_ != 2 * S) return;
      const double allowed = kOfAccelerations * tolerance_.of(from.dxdt[n], to.dxdt[n]);
      norm = worseOf(norm, std::min(defect / allowed, kNoticed * error));
    };
    // The slope of another component's integral is that one's series but for the last term.
    const int highest = size_ - S;
    for (int n = least_angle_; n < highest; ++n) {
      judge(n, end_[n + S] - coefficients(n + S)[last] * powers_[last]);
    }
    double weights[kRoom];
    for (int k = 0; k <= last_power_ + 3; ++k) weights[k] = k * powers_[k];
    const double per_power = 1.0 / h;  // s c'(s) is what the sums are
    for (int n = highest; n < size_; ++n) {
      judge(n, sumOf(coefficients(n), weights) * per_power);
    }
    return norm;
  }

  /// Q of the series: that at the end is compared with it, whatever lies between.
  void calcTorqueGain(System& system, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    expand(system, from, limit_);
    setPowers((to.time - from.time) / shown_.unit);
    const double per_unit = 1.0 / shown_.unit;
    for (int i = 0; i < S; ++i) {
      const double* const Q = rows_[3 * S + i];
      gain.change[i] = sumOf(Q, powers_);
      gain.largest_rate[i] = std::max(std::abs(from.torque_rate[i]), std::abs(Q[1]) * per_unit);
    }
  }

  double stiffness(const State& /*x_new*/, const State& /*dxdt_new*/) const override {
    return shown_.stiffness;
  }

  bool interpolate(System& system, double time, const StepNode& from, const StepNode& /*to*/,
                   State& x) override {
    expand(system, from, limit_);
    if (order_ < kLeastOrder) return false;
    evaluate(time - base_time_, x);
    return true;
  }

 private:
  static constexpr int kTerms = 3;
  /// Tolerances: what accelerations that the velocities tell may be off by at the end of a step.
  static constexpr double kOfAccelerations = 10.0;
  static constexpr double kNoticed = 30.0;
  static constexpr int kLeastOrder = 3;
  /// Returns those of component n of x.
  const double* coefficients(int n) const { return rows_[n]; }
  /// The same for all of them, although angles and velocities are known further: what is linear in
  /// the coefficients of every order (an invariant of the reaction, say) stays so.
  int lastTerm() const { return size_ == 3 * S ? order_ : order_ + 1; }

  /// The first of the terms that the step is judged by.
  int firstTerm() const { return lastTerm() - (order_ < most_ ? 1 : kTerms - 1); }

  void evaluate(double h, State& x) {
    setPowers(h / shown_.unit);
    for (int n = 0; n < size_; ++n) {
      const double* const c = coefficients(n);
      x[n] = c[0] + sumOf(c, powers_);
    }
  }

  /// The error of the last step, component by component: what the next term would be, by those
  /// before it.
  double calcLastTerms(const StepNode& from, const State& x_new) {
    const int last = lastTerm();
    double scale[kTerms];
    for (int k = firstTerm(); k <= last; ++k) scale[last - k] = powers_[k] * decay_[last - k];
    double norm = 0.0;
    for (int n = 0; n < size_; ++n) {
      const double* const c = coefficients(n);
      double term = 0.0;
      for (int k = firstTerm(); k <= last; ++k) {
        term = std::max(term, std::abs(c[k]) * scale[last - k]);
      }
      error_[n] = term;
      if (n >= least_angle_) norm = worseOf(norm, term / tolerance_.of(from.x[n], x_new[n]));
    }
    return norm;
  }

  /// theta^k for k = 1 to the last term, and 0 beside them.
  void setPowers(double theta) {
    const int last = lastTerm();
    if (theta == powers_[1] && last == last_power_) return;
    powers_[1] = theta;
    // By the powers half as high: no long chain of products.
    for (int k = 2; k <= last; ++k) powers_[k] = powers_[k / 2] * powers_[k - k / 2];
    for (int k = last + 1; k <= last_power_; ++k) powers_[k] = 0.0;
    last_power_ = last;
  }

  /// sum c_k weights_k. Behind the last term weights are 0, and coefficients numbers.
  double sumOf(const double* c, const double* weights) const {
    return expression::plain::vs_dot(c, weights, (last_power_ + 4) / 4 * 4);
  }

  /// The series at `from`, as far as steps of `limit` need it.
  void expand(System& system, const StepNode& from, double limit) {
    SceneSeries* const series = system.series();
    const bool reaches = limit <= limit_ || (order_ == most_ && length_ <= limit_);
    const bool is_known = from.time == base_time_ && isBase(from) && reaches;
    const bool is_own = series != nullptr && series->expansion() == expansion_;
    if (is_known && (is_own || order_ == 0)) return;
    if (!is_known) {  // (Another stepper has been there: once more, to the bit.)
      usual_ = length_;
      limit_ = limit;
    }
    order_ = 0;
    base_time_ = from.time;
    base_x_ = from.x;
    if (series == nullptr) return;
    double x[3 * kMaxShafts];
    double multiplier[kMaxConstraints] = {};
    std::copy(from.x.begin(), from.x.end(), x);
    if (size_ == 2 * S) {
      base_dxdt_ = from.dxdt;
      std::copy_n(from.dxdt.begin() + S, S, x + 2 * S);
      const StateView view = system.drivetrain().view(from.time, x, x + S, x + 2 * S);
      system.accelerations().calcMultipliers(view, multiplier);
    }
    const SeriesPoint point = {from.time, system.drivetrain().origin(), x, multiplier};
    length_ = 0.0;
    const bool is_good = series->expand(point, usual_, limit_, &shown_);
    expansion_ = series->expansion();
    if (!is_good) return;
    order_ = shown_.last;
    length_ = shown_.length;
  }

  /// The series are those of this state: accelerations that are no part of it count, too.
  bool isBase(const StepNode& node) const {
    return node.x == base_x_ && (size_ == 3 * S || node.dxdt == base_dxdt_);
  }

  static constexpr double kCaution = 0.25;

  const int S;  // shafts
  const int size_;
  int most_ = 1;
  int order_ = 0;
  double length_ = 0.0;
  /// A term so many before the last one may be larger than the tolerance by the inverse of this: of
  /// N terms that fall from 1 to the tolerance.
  double decay_[kTerms] = {};
  double limit_ = 0.0;
  double usual_ = 0.0;   ///< the length that the expansion was given
  long expansion_ = -1;  ///< its number
  /// Sums go by fours.
  static constexpr int kRoom = expression::SeriesProgram::kStride;
  const double* rows_[4 * kMaxShafts] = {};  ///< of coefficients: the state, accelerations, torques
  vs_shown shown_ = {rows_, 0, 1.0, 0.0, 0.0};
  double powers_[kRoom] = {};  // of the part of a unit that was looked at last
  int last_power_ = 0;
  State end_;  // of the last step, as its series gives it
  double base_time_ = std::numeric_limits<double>::quiet_NaN();
  State base_x_;
  State base_dxdt_;
  int least_angle_;
};

}  // namespace

std::unique_ptr<Stepper> makeTaylorStepper(const System& system, Tolerance tolerance) {
  return std::make_unique<TaylorStepper>(system, tolerance);
}

}  // namespace variator_sim
