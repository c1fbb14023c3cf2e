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

#include "dynamics/linearization.h"
#include "dynamics/system.h"
#include "integrate/current_step.h"

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

  void begin(const Linearization& linearization, const State& r);
  void doubleTime();

  /// t
  double time() const { return time_; }
  /// c(t), component n
  double operator[](int n) const { return M_[n][size_]; }
  /// y'(t) - y'(0) = Psi r, component n
  double calcRateChange(int n) const;

 private:
  /// (Psi c)
  struct Matrix {
    double rows[3 * kMaxShafts][3 * kMaxShafts + 1];
    double* operator[](int i) { return rows[i]; }
    const double* operator[](int i) const { return rows[i]; }
  };

  /// M = summand + factor M. (The row below (Psi c) is 0.)
  void addProduct(const Matrix& summand, const Matrix& factor);

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
  explicit Rest(System& system)
      : system_(system),
        S(system.shafts()),
        L(system.size() / S),
        linearization_(S, L),
        deviation_(system.size()),
        rounding_(S) {}

  void reset();
  /// A step changed x by `change` tolerances at most: true when the term is worth being asked for.
  /// That costs as much as many steps, so after each time it is done half as often.
  bool noteStep(double change);
  /// A step changed x by more than that.
  void noteMotion() { quiet_ = 0; }

  /// The term of rest from x at t, where the derivative is dxdt, s; 0 when there is none, infinity
  /// when all rates are exactly 0. `left` gets c at its end. [loop]
  double calcTerm(double t, const State& x, const State& dxdt, const Tolerance& tolerance,
                  State& left);

  /// No term is longer than this, s: of slow modes beside very fast ones too little is known.
  double longestTerm() const { return longest_; }

  /// A tenth of the error allowed.
  static constexpr double kLeft = 0.1;

 private:
  /// Angle n at the end of the time; 0 once it may have passed through there.
  double angleAfter(const State& x, int n) const;
  /// Computes the effect of rounding on accelerations that follow from torques that cancel: of Q,
  /// R, and each of the state's values in them.
  void calcRounding(double t, const State& x, const Linearization& linearization);
  /// If angles are read, all velocities end at 0 in rest. Torques that cancel leave a rounding
  /// that would drive whatever settles slowly, anew in each term: accelerations that rounding alone
  /// tells from those that the velocities make, at angles of equilibrium, are taken to be these.
  void dropRounding(const Linearization& linearization, const State& x, State& r) const;
  /// Accelerations that follow from the state may answer to it strongly. What they answer to its
  /// rounding counts for nothing.
  bool areAccelerationsNear(const State& r, const Tolerance& tolerance) const;

  /// Growth of c while t doubles that is no drift or swing (t^3 grows by 8): an unstable state, or
  /// one that rounding of A makes look so.
  static constexpr double kSteepest = 16.0;
  /// A part of the fastest rate of A that slow ones may err by: A may come from differences.
  static constexpr double kNoise = 1e-10;
  static constexpr double kUlps = 4.0;
  static constexpr double kForever = 1e12;  // s
  static constexpr int kQuiet = 4;          // steps: a moment's low of an oscillation is not rest
  static constexpr int kMostQuiet = 1024;

  System& system_;
  const int S;  // shafts
  const int L;  // levels of the state
  Linearization linearization_;
  Deviation deviation_;
  ShaftVector rounding_;  // of accelerations, rad/s^2
  double longest_ = kForever;
  int quiet_ = 0;
  int needed_ = kQuiet;
};

/// The sleep of a motion at rest: it is not stepped until the end of its term. All are [loop].
class Sleep : private StepPart {
 public:
  explicit Sleep(CurrentStep& step)
      : StepPart(step), rest_(step.system), left_(step.system.size()) {}

  void reset() { rest_.reset(); }
  /// A step was no rest.
  void noteMotion() { rest_.noteMotion(); }
  /// True when nothing changes at the end of the step, exactly, and the motion sleeps from there.
  bool beginExactly();
  /// True when the motion sleeps from the end of the last step on. `rate`: the largest of its
  /// rates, in tolerances per s.
  bool beginAfterStep(double* rate);
  /// The motion sleeps on from the end of the step. False when the term is too short to be worth
  /// its search.
  bool begin();
  /// Until when nothing is stepped.
  double end() const { return term_end_; }
  /// Moves the end of the step to where the sleep ends.
  void finish();
  /// x at `time` of a motion at rest: that of the step's end, angles gone on at constant speed.
  void calcState(double time, State& x) const;

 private:
  Rest rest_;
  double term_end_ = 0.0;
  State left_;  // the deviation c there
};

}  // namespace variator_sim
