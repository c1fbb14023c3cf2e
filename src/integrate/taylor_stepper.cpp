/// Steps by the motion's own series: `taylor`.
///
/// The order N follows from the tolerance and the step from the last coefficients. Of N terms that
/// fall from 1 to the tolerance each is the tolerance^(1/N) of the one before, h is that part of
/// the radius of convergence, and the step is the longest for which the last three terms keep to
/// that: one of them may vanish by accident. (Jorba and Zou 2005, see series_program.h, whose N = 1
/// - ln(tolerance) / 2 counts the work of the coefficients alone.) A step is no longer than all
/// formulas are what their series say (series_resolution.inc).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include "dynamics/motion_series.h"
#include "expression/series_dot.h"
#include "integrate/series_stiffness.h"
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
    if (size_ == 3 * S) series_ = system.series();
    most_ = MotionSeries::orderFor(tolerance.relative);
    const double ratio = std::pow(std::max(tolerance.relative, 1e-16), 1.0 / most_);
    decay_[0] = 1.0;
    for (int k = 1; k < kTerms; ++k) decay_[k] = ratio * decay_[k - 1];
    early_ = series_stiffness::EarlyTerm(most_);
  }
  const char* name() const override { return "taylor"; }
  bool stepsBySeries() const override { return true; }
  int errorOrder() const override { return most_; }
  /// Measured beside radau's: whole steps take less, and much less as machine code; what steps must
  /// not depend on which of them is there.
  double work() const override { return (makesWholeSteps() ? 0.75 : 2.0) * most_; }

  void restart() override {
    base_time_ = refused_at_ = std::numeric_limits<double>::quiet_NaN();
    if (series_ != nullptr) series_->forgetNext();
  }
  /// The length of the last step is the unit of the next series, and so in its rounding.
  void forget() override {
    restart();
    length_ = length_before_ = 0.0;
  }

  double chooseStep(System& system, const StepNode& from, double limit) override {
    expand(system, from, limit);
    return order_ < kLeastOrder ? 0.0 : std::min(limit, length_);
  }

  bool makesWholeSteps() const override {
    return size_ == 3 * S && series_ != nullptr && series_->makesWholeSteps();
  }

  int makeWholeSteps(const StepNode& from, bool goes_on, const Reach& reach,
                     const SeriesStep** made) override {
    if (from.time == refused_at_) return 0;
    // Without a step before, its length is in the coefficients, whatever their unit.
    const double length = length_ > 0.0 ? length_ : reach.longestFrom(from.time);
    const SeriesStep& it =
        series_->stride(from.time, from.x.data(),
                        {goes_on, length, length_before_ > 0.0 ? length_before_ : length,
                         tolerance_.absolute, tolerance_.relative, decay_[1], reach});
    *made = &it;
    const bool is_refused = it.refused != 0.0;
    const int good = is_refused ? std::max(it.made - 1, 0) : it.made;
    if (good > 1) length_before_ = it.node[good - 2].length;
    if (good == 1) length_before_ = length;
    if (good > 0) length_ = it.node[good - 1].length;
    if (is_refused) {
      // The series are those of what was refused.
      refused_at_ = good > 0 ? it.node[good - 1].end : from.time;
      base_time_ = std::numeric_limits<double>::quiet_NaN();
      return good;
    }
    findRows();
    base_time_ = it.time;
    base_x_.assign(it.x);
    limit_ = it.limit;
    order_ = it.last;
    is_short_ = order_ < most_;
    unit_ = 0.5 * it.unit;
    stamp_ = series_->stamp();
    return good;
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
    setPowers((to.time - from.time) / series_->unit());
    const double per_unit = 1.0 / series_->unit();
    for (int i = 0; i < S; ++i) {
      const double* const Q = series_->torque(i);
      gain.change[i] = sumOf(Q, powers_);
      gain.largest_rate[i] = std::max(std::abs(from.torque_rate[i]), std::abs(Q[1]) * per_unit);
    }
  }

  double stiffness(const State& /*x_new*/, const State& /*dxdt_new*/) const override {
    const int last = lastTerm();
    if (last < series_stiffness::kDerivatives) return 0.0;
    series_->fetchState();
    return series_stiffness::estimate(rows_, least_angle_, size_, last, length_ / series_->unit(),
                                      early_, tolerance_);
  }

  bool interpolate(System& system, double time, const StepNode& from, const StepNode& /*to*/,
                   State& x) override {
    expand(system, from, limit_);
    if (order_ < kLeastOrder) return false;
    evaluate(time - base_time_, x);
    return true;
  }

  /// The series' stamp is that of the base: whatever makes it another one begins them anew.
  bool calcSample(double time, const StepNode& from, const StepNode& to, std::uint64_t* projections,
                  Sample* sample) override {
    return series_ != nullptr && from.time == base_time_ &&
           series_->calcSample(stamp_, to.time, time, projections, sample);
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
  int firstTerm() const { return lastTerm() - (is_short_ ? 1 : kTerms - 1); }

  void evaluate(double h, State& x) {
    setPowers(h / series_->unit());
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
    // The series are the system's: another stepper may have been there.
    const bool is_own = series_ != nullptr && series_->stamp() == stamp_;
    const bool is_base = from.time == base_time_ && isBase(from);
    const bool reaches = limit <= limit_;
    if (is_base && is_own && (reaches || (order_ == most_ && length_ <= limit_))) {
      series_->fetch();
      return;
    }
    // Once more, to the bit.
    const bool is_again = is_base && !is_own && reaches;
    const double length = length_;
    if (is_again) {
      limit = limit_;
      length_ = length_before_;
    }
    length_before_ = length_;
    if (series_ == nullptr) series_ = system.series();
    order_ = 0;
    base_time_ = from.time;
    base_x_ = from.x;
    limit_ = limit;
    double x[3 * kMaxShafts];
    forEachComponent(0, size_, [&](int n) { x[n] = from.x[n]; });
    if (size_ == 2 * S) {
      base_dxdt_ = from.dxdt;
      std::copy_n(from.dxdt.begin() + S, S, x + 2 * S);
    }
    if (series_ == nullptr) return;
    findRows();
    // In units of the step no coefficient overflows; without one it has to be found.
    double unit = is_again ? unit_ : length_ > 0.0 ? std::min(length_, limit) : limit;
    constexpr int kTrials = 12;
    for (int trial = 0; trial < kTrials; ++trial) {
      makeSeries(x, unit, limit);
      if (order_ >= kLeastOrder && (order_ == most_ || is_short_)) break;
      unit *= 1.0 / 64.0;
    }
    stamp_ = series_->stamp();
    unit_ = 0.5 * series_->unit();  // of which makeSeries makes the power of 2 above
    if (is_again) {
      length_ = length;
    } else if (order_ >= kLeastOrder) {
      chooseLength(from.x);
    }
  }

  /// The series are those of this state: accelerations that are no part of it count, too.
  bool isBase(const StepNode& node) const {
    return node.x == base_x_ && (size_ == 3 * S || node.dxdt == base_dxdt_);
  }

  /// They have two places, and change them with each whole step.
  void findRows() {
    for (int i = 0; i < S; ++i) {
      rows_[i] = series_->angle(i);
      rows_[S + i] = series_->velocity(i);
      rows_[2 * S + i] = series_->acceleration(i);
    }
  }

  void makeSeries(const double* x, double unit, double limit) {
    constexpr double kPart = 0.03;
    order_ = 0;
    is_short_ = false;
    for (int n = least_angle_; n < size_; ++n) nothing_[n] = kPart * tolerance_.of(x[n]);
    // Accelerations that follow from the state have terms (k / limit) times as large.
    for (int n = S; n < 2 * S && size_ == 2 * S; ++n) {
      nothing_[n] = std::min(nothing_[n], kPart * tolerance_.of(x[n + S]) * limit / most_);
    }
    int exponent = 0;
    std::frexp(unit, &exponent);
    unit = std::ldexp(1.0, exponent);
    if (!series_->begin(base_time_, x, unit, most_)) return;
    // A limit beyond the last step's length cuts nothing off.
    if (length_ > 0.0 && limit > length_) {
      if (series_->extendTo(most_)) order_ = most_;
      return;
    }
    const double theta = limit / unit;
    double scale = size_ == 3 * S ? 1.0 : theta;  // theta^lastTerm()
    int small = 0;
    bool is_resolved = false;
    while (order_ < most_ && !is_short_) {
      if (!series_->extendTo(order_ + 1)) {
        order_ = 0;  // nothing is left of it
        return;
      }
      ++order_;
      scale *= theta;
      // Terms in a row that are nothing: the step cannot be longer than `limit` anyway. Formulas
      // that are resolved up to an order make the next term: it has to be nothing, too.
      small = isNothing(theta, scale) ? small + 1 : 0;
      is_short_ = is_resolved && small > 0;
      is_resolved = small >= 2 && order_ > kLeastOrder && isResolved(limit);
    }
  }
  /// The last terms, those of theta^k = `scale`, are a small part of the tolerance, and of what
  /// goes before them: of something far below the tolerance that grows the digits count, too.
  bool isNothing(double theta, double scale) const {
    constexpr double kDigits = 1e-6;
    const int last = lastTerm();
    for (int n = least_angle_; n < size_; ++n) {
      const double* const c = coefficients(n);
      const double term = std::abs(c[last]) * scale;
      if (!(term <= nothing_[n])) return false;
      if (!(term <= kDigits * std::max(std::abs(c[0]), std::abs(c[1]) * theta))) return false;
    }
    return true;
  }

  /// The longest step for which the last terms are within the tolerance.
  void chooseLength(const State& x) {
    const int last = lastTerm();
    const int terms = last - firstTerm() + 1;
    double largest[kTerms] = {};  // the last one first
    for (int n = least_angle_; n < size_; ++n) {
      const double* const c = coefficients(n) + last;
      const double allowed = 1.0 / (kCaution * tolerance_.of(x[n]));
      for (int j = 0; j < terms; ++j) largest[j] = std::max(largest[j], std::abs(c[-j]) * allowed);
    }
    double least = std::numeric_limits<double>::infinity();
    for (int j = 0; j < terms; ++j) {
      const double term = largest[j] * decay_[j];
      if (term > 0.0) least = std::min(least, -logarithm(term) / (last - j));
    }
    length_ = series_->unit() * exponential(least);
    for (int halvings = 0; halvings < 60; ++halvings) {
      setPowers(length_ / series_->unit());
      if (isGrowing(x)) {
        length_ *= 0.5;
        continue;
      }
      const double taken = std::min(length_, limit_);
      if (isResolved(taken)) break;
      length_ = 0.5 * taken;
    }
  }

  bool isResolved(double length) const {
    return series_->isResolved(length, tolerance_.absolute, tolerance_.relative);
  }

  /// log2; no step needs to be known to more than seven digits.
  static double logarithm(double x) {
    constexpr double kLargest = 1e30;
    const bool is_moderate = x < kLargest && x * kLargest > 1.0;
    return is_moderate ? static_cast<double>(std::log2(static_cast<float>(x))) : std::log2(x);
  }

  static double exponential(double x) {
    constexpr double kLargest = 100.0;
    return std::abs(x) < kLargest ? static_cast<double>(std::exp2(static_cast<float>(x)))
                                  : std::exp2(x);
  }

  /// The last term at the length whose powers are set is the largest of all but the first one: that
  /// is beyond the radius of convergence. Of something that is smaller than the tolerance every
  /// step would do, and a motion might be thrown back by each.
  bool isGrowing(const State& x) const {
    constexpr double kNoise = 1e-6;  // tolerances
    const int last = lastTerm();
    for (int n = least_angle_; n < size_; ++n) {
      const double* const c = coefficients(n);
      const double term = std::abs(c[last]) * powers_[last];
      bool is_largest = term > kNoise * tolerance_.of(x[n]);
      for (int k = 1; k < last && is_largest; ++k) {
        is_largest = term > std::abs(c[k]) * powers_[k];
      }
      if (is_largest) return true;
    }
    return false;
  }
  static constexpr double kCaution = 0.25;

  const int S;  // shafts
  const int size_;
  int most_ = 0;
  int order_ = 0;
  bool is_short_ = false;
  double length_ = 0.0;
  double length_before_ = 0.0;  // when the series were begun
  double unit_ = 0.0;           // what they were begun with
  /// A term so many before the last one may be larger than the tolerance by the inverse of this: of
  /// N terms that fall from 1 to the tolerance.
  double decay_[kTerms] = {};
  double limit_ = 0.0;
  /// Sums go by fours.
  static constexpr int kRoom = MotionSeries::kMostOrder + 2 + 4;
  const double* rows_[3 * kMaxShafts] = {};  // of coefficients
  double nothing_[3 * kMaxShafts] = {};      // what a term is at most that is none
  double powers_[kRoom] = {};                // of the part of a unit that was looked at last
  int last_power_ = 0;
  State end_;  // of the last step, as its series gives it
  series_stiffness::EarlyTerm early_{0};
  double base_time_ = std::numeric_limits<double>::quiet_NaN();
  /// From where the next step is not made as a whole.
  double refused_at_ = std::numeric_limits<double>::quiet_NaN();
  State base_x_;
  State base_dxdt_;
  int least_angle_;
  MotionSeries* series_ = nullptr;
  std::uint64_t stamp_ = 0;
};

}  // namespace

std::unique_ptr<Stepper> makeTaylorStepper(const System& system, Tolerance tolerance) {
  return std::make_unique<TaylorStepper>(system, tolerance);
}

}  // namespace variator_sim
