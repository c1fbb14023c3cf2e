/// How long a motion may rest: go on without being stepped, within the tolerance.
///
/// An autonomous motion x' = f(x) that is at x0 at the time t0 rests when it is taken to be
///     X(t0 + t) = x0 + v t,
/// with v the velocities of angles that nothing reads, and 0 else. The deviation y = x - X begins
/// with 0 and obeys, as long as it is small,
///     y' = A y + r,   A = df/dx at x0,   r = f(x0) - v,
/// so that
///     y(t) = c(t) = int_0^t exp(A s) ds r.
/// The angles are part of it: they deviate by the integral of what the velocities do.
///
/// Rest has a term, the longest t = h 2^k for which c stays within kLeft of the tolerance. At its
/// end c is what the motion lacks, the state becomes X + c, and the rest of there is asked anew:
/// nothing piles up. A transient that is nearly over so comes to its end at once, and leaves a term
/// that ends only by rounding; slow modes, drifting and swinging, and saddles have short terms.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "linearization.h"
#include "principle_system.h"
#include "step_control.h"

namespace variator_sim {

/// c(t), for t doubled again and again.
///
/// With Psi(t) = exp(A t) - 1,
///     Psi(2t) = 2 Psi + Psi Psi,   c(2t) = 2 c + Psi c.
/// Without the 1, which is left out, what is slow beside something fast keeps its digits; what is
/// stable goes to Psi = -1, which doubling keeps. The first t is so short that Taylor's series has
/// converged.
class Deviation {
 public:
  explicit Deviation(int size) : size_(size), r_(size) {}

  void begin(const Linearization& linearization, const State& r) {
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
  void doubleTime() {
    Matrix twice = M_;
    for (int i = 0; i < size_; ++i) {
      for (int j = 0; j <= size_; ++j) twice[i][j] *= 2.0;
    }
    addProduct(twice, M_);
    time_ *= 2.0;
  }

  /// t
  double time() const { return time_; }
  /// c(t), component n
  double operator[](int n) const { return M_[n][size_]; }
  /// y'(t) - y'(0) = Psi r, component n
  double calcRateChange(int n) const {
    double sum = 0.0;
    for (int k = 0; k < size_; ++k) sum += M_[n][k] * r_[k];
    return sum;
  }

 private:
  /// (Psi c)
  struct Matrix {
    double rows[3 * kMaxShafts][3 * kMaxShafts + 1];
    double* operator[](int i) { return rows[i]; }
    const double* operator[](int i) const { return rows[i]; }
  };

  /// M = summand + factor M. (The row below (Psi c) is 0.)
  void addProduct(const Matrix& summand, const Matrix& factor) {
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

  static constexpr double kFirst = 1.0 / 32.0;  // |A t|: the series errs by kFirst^kTerms / 7!
  static constexpr int kTerms = 6;
  const int size_;
  Matrix M_;
  State r_;
  double time_ = 0.0;
};

/// When rest is looked for, and how long it lasts.
class Rest {
 public:
  explicit Rest(PrincipleSystem& system)
      : system_(system),
        S(system.shafts()),
        L(system.size() / S),
        linearization_(S, L),
        deviation_(system.size()),
        rounding_(S) {}

  void reset() {
    quiet_ = 0;
    needed_ = kQuiet;
  }
  /// A step changed x by `change` tolerances at most: true when the term is worth being asked for.
  /// That costs as much as many steps, so after each time it is done half as often.
  bool noteStep(double change) {
    if (!(change <= kLeft)) {
      quiet_ = 0;
      return false;
    }
    if (++quiet_ < needed_) return false;
    quiet_ = 0;
    needed_ = std::min(2 * needed_, kMostQuiet);
    return true;
  }

  /// The term of rest from x at t, where the derivative is dxdt, s; 0 when there is none, infinity
  /// when all rates are exactly 0. `left` gets c at its end. [loop]
  double calcTerm(double t, const State& x, const State& dxdt, const Tolerance& tolerance,
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
    const double longest = std::min(1.0 / (kNoise * fastest), kForever);  // NaN when fastest is
    deviation_.begin(linearization, r);
    if (!(deviation_.time() > 0.0)) return 0.0;
    double term = 0.0;
    double last = 0.0;
    while (deviation_.time() <= longest) {
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

  /// A tenth of the error allowed.
  static constexpr double kLeft = 0.1;

 private:
  /// Angle n at the end of the time; 0 once it may have passed through there.
  double angleAfter(const State& x, int n) const {
    const double gone = x[S + n] * deviation_.time();
    if (x[n] * gone >= 0.0) return x[n] + gone;
    return std::max(0.0, std::abs(x[n]) - std::abs(gone));
  }
  /// What rounding makes of the accelerations where they follow from torques that cancel: of Q, R,
  /// and each of the state's values in them.
  void calcRounding(double t, const State& x, const Linearization& linearization) {
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
  /// Where angles are read, all velocities end at 0 in rest. Torques that cancel leave a rounding
  /// that would drive whatever settles slowly, anew in each term: accelerations that rounding alone
  /// tells from those that the velocities make, at angles of equilibrium, are taken to be these.
  void dropRounding(const Linearization& linearization, const State& x, State& r) const {
    for (int i = 0; i < S; ++i) {
      double damping = 0.0;
      for (int j = 0; j < S; ++j) {
        damping += linearization.block(1)(i, j) * x[S + j];
      }
      if (std::abs(r[S + i] - damping) <= rounding_[i]) r[S + i] = damping;
    }
  }
  /// Accelerations that follow from the state may answer to it strongly. What they answer to its
  /// rounding counts for nothing.
  bool areAccelerationsNear(const State& r, const Tolerance& tolerance) const {
    for (int i = 0; i < S && L == 2; ++i) {
      const double change = std::abs(deviation_.calcRateChange(S + i));
      if (!(change <= kLeft * tolerance.of(r[S + i]) + rounding_[i])) return false;
    }
    return true;
  }

  /// Growth of c while t doubles that is no drift or swing (t^3 grows by 8): an unstable state, or
  /// one that rounding of A makes look so.
  static constexpr double kSteepest = 16.0;
  /// A part of the fastest rate of A that slow ones may err by: A may come from differences.
  static constexpr double kNoise = 1e-10;
  static constexpr double kUlps = 4.0;
  static constexpr double kForever = 1e12;  // s
  static constexpr int kQuiet = 4;          // steps: a moment's low of an oscillation is not rest
  static constexpr int kMostQuiet = 1024;

  PrincipleSystem& system_;
  const int S;  // shafts
  const int L;  // levels of the state
  Linearization linearization_;
  Deviation deviation_;
  ShaftVector rounding_;  // of accelerations, rad/s^2
  int quiet_ = 0;
  int needed_ = kQuiet;
};

}  // namespace variator_sim
