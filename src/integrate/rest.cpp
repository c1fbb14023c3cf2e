#include "integrate/rest.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

void Deviation::begin(const Linearization& linearization, const State& r) {
  const int S = linearization.shafts();
  Matrix G{};  // h (A r)
  for (int i = 0; i < size_ - S; ++i) G[i][i + S] = 1.0;
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < size_; ++j) G[size_ - S + i][j] = linearization.block(j / S)(i, j % S);
  }
  double norm = 0.0;
  for (int i = 0; i < size_; ++i) {
    double sum = 0.0;
    for (int j = 0; j < size_; ++j) sum += std::abs(G[i][j]);
    norm = std::max(norm, sum);
  }
  // A power of two: rounds nothing.
  time_ = std::exp2(std::floor(std::log2(kFirst / norm)));
  for (int i = 0; i < size_; ++i) {
    G[i][size_] = r[i];
    for (int j = 0; j <= size_; ++j) G[i][j] *= time_;
  }
  r_ = r;
  // h A + (h A)^2/2! + ... from its end: G (1 + G/2 (1 + G/3 (...)))
  M_ = G;
  for (int m = kTerms; m > 1; --m) {
    for (int i = 0; i < size_; ++i) {
      for (int j = 0; j <= size_; ++j) M_[i][j] /= m;
    }
    addProduct(G, G);
  }
}

void Deviation::doubleTime() {
  Matrix twice = M_;
  for (int i = 0; i < size_; ++i) {
    for (int j = 0; j <= size_; ++j) twice[i][j] *= 2.0;
  }
  addProduct(twice, M_);
  time_ *= 2.0;
}

double Deviation::calcRateChange(int n) const {
  double sum = 0.0;
  for (int k = 0; k < size_; ++k) sum += M_[n][k] * r_[k];
  return sum;
}

void Deviation::addProduct(const Matrix& summand, const Matrix& factor) {
  Matrix result = summand;
  for (int i = 0; i < size_; ++i) {
    for (int k = 0; k < size_; ++k) {
      const double part = factor[i][k];
      if (part == 0.0) continue;
      for (int j = 0; j <= size_; ++j) result[i][j] += part * M_[k][j];
    }
  }
  M_ = result;
}

void Rest::reset() {
  quiet_ = 0;
  needed_ = kQuiet;
}

bool Rest::noteStep(double change) {
  if (!(change <= kLeft)) {
    quiet_ = 0;
    return false;
  }
  if (++quiet_ < needed_) return false;
  quiet_ = 0;
  needed_ = std::min(2 * needed_, kMostQuiet);
  return true;
}

double Rest::calcTerm(double t, const State& x, const State& dxdt, const Tolerance& tolerance,
                      State& left) {
  State r = dxdt;
  if (!system_.readsAngles()) std::fill_n(r.begin(), S, 0.0);
  left.fill(0.0);
  const auto is_zero = [](double value) { return value == 0.0; };
  if (std::all_of(r.begin(), r.end(), is_zero)) return std::numeric_limits<double>::infinity();

  Linearization& linearization = linearization_;
  system_.calcLinearization(t, x, linearization);
  for (int l = 0; l < L; ++l) {
    if (!linearization.block(l).allFinite()) return 0.0;
  }
  if (L == 2) {
    calcRounding(t, x, linearization);
    if (system_.readsAngles()) dropRounding(linearization, x, r);
  }
  const double fastest = linearization.calcFastestRate();
  longest_ = std::min(1.0 / (kNoise * fastest), kForever);  // NaN when fastest is
  deviation_.begin(linearization, r);
  if (!(deviation_.time() > 0.0)) return 0.0;
  double term = 0.0;
  double last = 0.0;
  while (deviation_.time() <= longest_) {
    double size = 0.0;
    for (int n = 0; n < x.size(); ++n) {
      const double allowed =
          tolerance.of(n < S && !system_.readsAngles() ? angleAfter(x, n) : x[n]);
      const double part = std::abs(deviation_[n]) / (allowed + 1e-300);
      if (!(part <= kLeft)) return term;
      size = std::max(size, part);
    }
    if (!areAccelerationsNear(r, tolerance)) return term;
    if (term > 0.0 && size > kSteepest * last) return term;
    term = deviation_.time();
    last = size;
    for (int n = 0; n < left.size(); ++n) left[n] = deviation_[n];
    deviation_.doubleTime();
  }
  return term;
}

double Rest::angleAfter(const State& x, int n) const {
  const double gone = x[S + n] * deviation_.time();
  if (x[n] * gone >= 0.0) return x[n] + gone;
  return std::max(0.0, std::abs(x[n]) - std::abs(gone));
}

void Rest::calcRounding(double t, const State& x, const Linearization& linearization) {
  Drivetrain& drivetrain = system_.drivetrain();
  const StateView state = system_.view(t, x);
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  drivetrain.calcTorque(state, torque);
  drivetrain.calcReaction(state, torque, reaction);
  for (int i = 0; i < S; ++i) {
    const int row = i;
    rounding_[i] = (std::abs(torque[i]) + std::abs(reaction[i])) /
                   std::abs(drivetrain.inertia().entry(row, row));
    for (int n = 0; n < x.size(); ++n) {
      const auto& block = linearization.block(n / S);
      rounding_[i] += std::abs(block(row, n % S) * x[n]);
    }
    rounding_[i] *= kUlps * std::numeric_limits<double>::epsilon();
  }
}

void Rest::dropRounding(const Linearization& linearization, const State& x, State& r) const {
  for (int i = 0; i < S; ++i) {
    double damping = 0.0;
    for (int j = 0; j < S; ++j) {
      damping += linearization.block(1)(i, j) * x[S + j];
    }
    if (std::abs(r[S + i] - damping) <= rounding_[i]) r[S + i] = damping;
  }
}

bool Rest::areAccelerationsNear(const State& r, const Tolerance& tolerance) const {
  for (int i = 0; i < S && L == 2; ++i) {
    const double change = std::abs(deviation_.calcRateChange(S + i));
    if (!(change <= kLeft * tolerance.of(r[S + i]) + rounding_[i])) return false;
  }
  return true;
}

bool Sleep::beginExactly() {
  if (drivetrain_.readsTime() || !step_.settings.sleep || step_.choice.isFixed()) return false;
  // Angles that nothing reads go on at constant speed.
  const bool is_exact = std::all_of(end_.dxdt.begin() + (system_.readsAngles() ? 0 : S),
                                    end_.dxdt.end(), [](double rate) { return rate == 0.0; });
  if (!is_exact || !begin()) return false;
  ++step_.statistics.sleeps;
  return true;
}

bool Sleep::beginAfterStep(double* rate) {
  *rate = 0.0;
  if (!step_.settings.sleep) return false;
  // Angles that nothing reads go on at constant speed.
  double change = 0.0;
  for (int n = system_.readsAngles() ? 0 : S; n < end_.x.size(); ++n) {
    const double allowed = tolerance_.of(end_.x[n]);
    *rate = std::max(*rate, std::abs(end_.dxdt[n]) / allowed);
    change = std::max(change, std::abs(end_.x[n] - start_.x[n]) / allowed);
  }
  if (drivetrain_.readsTime() || (*rate != 0.0 && !rest_.noteStep(change)) || !begin()) {
    return false;
  }
  ++step_.statistics.sleeps;
  return true;
}

bool Sleep::begin() {
  // In longest steps: a shorter term saves less than its search costs.
  constexpr double kLeastSleep = 20.0;
  const double term = rest_.calcTerm(end_.time, end_.x, end_.dxdt, tolerance_, left_);
  const bool sleeps =
      term >= std::min(kLeastSleep * step_.settings.maximum_step, 0.25 * rest_.longestTerm());
  if (sleeps) step_.phase = StepPhase::kSleeping;
  term_end_ = end_.time + term;
  return sleeps;
}

void Sleep::finish() {
  State x(system_.size());
  calcState(term_end_, x);
  end_.time = term_end_;
  end_.x = x;
  for (int n = 0; n < x.size(); ++n) x[n] += left_[n];
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(end_.time, x, moved, &step_.statistics.projections);
  if (projected == ProjectionResult::kConverged) end_.x = x;
}

void Sleep::calcState(double time, State& x) const {
  x = end_.x;
  if (system_.readsAngles()) return;
  for (int n = 0; n < S; ++n) x[n] += (time - end_.time) * end_.x[S + n];
}

}  // namespace variator_sim
