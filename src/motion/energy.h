/// Where the energy of a motion comes from and goes to.
///
///     T = 1/2 omega^T J omega        T' = sum Q_i omega_i + sum R_i omega_i
///
/// for J(phi) too: n, which R = J epsilon + n - Q has in it, is 1/2 J' omega^2. So
///
///     applied   = integral of sum Q_i omega_i
///     reactions = T - T(0) - applied
///
/// One quadrature and exact bookkeeping: Q and omega are what a step knows best, while R has the
/// accelerations, which dense output knows worst, and a quadrature of its own would leave a
/// remainder that is nobody's.
///
/// All of it stands beside the motion: nothing here goes into a step, its size or its error.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/principle_system.h"
#include "integrate/step_control.h"
#include "integrate/stepper.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// The integral of f over [from, to] by the rules of Gauss (3 points) and Kronrod (7, degree 11),
/// the interval halved up to `depth` times where their difference d says that the latter errs by
/// more than `tolerance` of the integral of |f|. It errs by about d^2, and by less than
/// (10 d)^(3/2) where f is less smooth.
template <class Function>
double integrate(const Function& f, double from, double to, double tolerance, int depth) {
  constexpr double kNodes[] = {0.960491268708020283, 0.774596669241483377, 0.434243749346802558};
  constexpr double kKronrod[] = {0.104656226026467265, 0.268488089868333441, 0.401397414775962223};
  constexpr double kKronrodCenter = 0.450916538658474142;
  constexpr double kGauss = 5.0 / 9.0;  // of the second nodes
  constexpr double kGaussCenter = 8.0 / 9.0;
  const double center = 0.5 * (from + to);
  const double half = 0.5 * (to - from);
  const double middle = f(center);
  double kronrod = kKronrodCenter * middle;
  double gauss = kGaussCenter * middle;
  double size = kKronrodCenter * std::abs(middle);
  for (int i = 0; i < 3; ++i) {
    const double left = f(center - half * kNodes[i]);
    const double right = f(center + half * kNodes[i]);
    kronrod += kKronrod[i] * (left + right);
    if (i == 1) gauss += kGauss * (left + right);
    size += kKronrod[i] * (std::abs(left) + std::abs(right));
  }
  const double difference = 10.0 * std::abs(kronrod - gauss);
  const double error = difference * std::sqrt(difference / size);
  if (depth == 0 || !(error > tolerance * size)) return half * kronrod;  // when NaN, too
  return integrate(f, from, center, tolerance, depth - 1) +
         integrate(f, center, to, tolerance, depth - 1);
}

/// The energy account of one motion. All are [loop].
class EnergyMeter {
 public:
  using Row = double[kMaxShafts];

  /// `system` has to outlive this.
  EnergyMeter(PrincipleSystem& system, const Scene& scene, Tolerance tolerance)
      : S(system.shafts()),
        drivetrain_(system.drivetrain()),
        tolerance_(tolerance),
        is_watched_(scene.principle == Principle::kGeneralizedGauss &&
                    !drivetrain_.hasConstantRows() && drivetrain_.constraintCount() > 0) {}

  /// Whether the applied energy of the steps to come is integrated inside each, to about the
  /// tolerance of the motion, or estimated from their ends.
  void track(bool on) { is_tracked_ = on; }
  bool isTracked() const { return is_tracked_; }

  /// The motion begins at `start`, where C has the rows `rows`.
  void begin(const StepNode& start, const Row* rows);

  /// The account of the motion up to its present, where it was cut, and the same taken up again.
  EnergyAccount account() const;
  void resume(const EnergyAccount& account, double time);

  /// A step from `from` to `to` was accepted, at whose end C has the rows `rows`; `inside(theta,
  /// x)` is the state at from + theta (to - from). Q and Q' of both are known.
  template <class Inside>
  void noteStep(const StepNode& from, const StepNode& to, const Row* rows, const Inside& inside) {
    const double h = to.time - from.time;
    const Power begin = powerOf(from);
    const Power end = powerOf(to);
    applied_before_ = applied_;
    throughput_before_ = throughput_;
    doubt_before_ = doubt_;
    addStep(h, begin, end,
            is_tracked_ ? calcWork(from, to, 1.0, inside) : estimateWork(h, begin, end));
    if (is_watched_) watch(to.time, to.x.data(), rows);
  }
  /// Steps before that one were passed over, from `from` to the nodes, at whose ends C is theirs.
  void notePassed(const StepNode& from, const SeriesNode* begin, const SeriesNode* end);
  /// The motion goes on from `present`, to which it has gone in its last step; inputs are still
  /// those of that step.
  template <class Inside>
  void cut(const StepNode& from, const StepNode& to, const StepNode& present,
           const Inside& inside) {
    const double h = present.time - from.time;
    StepNode end = present;
    drivetrain_.calcTorque(view(end.time, end.x), end.torque.data());
    const Power begin = powerOf(from);
    const double power = powerOf(end).value;
    throughput_ = throughput_before_ + 0.5 * h * (begin.through + powerOf(end).through);
    if (is_tracked_) {
      applied_ = calcApplied(from, to, h / (to.time - from.time), inside);
    } else {
      // The rate at the end is not known: of order 3.
      const double rise = power - begin.value;
      const double bend = h * begin.rate - rise;
      applied_ = applied_before_ + 0.5 * h * (begin.value + power) +
                 (std::abs(bend) <= std::abs(begin.value) + std::abs(power) ? h / 6.0 * bend : 0.0);
    }
    if (is_watched_) judge(present.time, present.x.data());
  }
  /// The same of a motion at rest since `from`.
  void cutAtRest(const StepNode& from, const StepNode& present) {
    applied_ = calcAppliedAtRest(from, present.x);
  }

  /// The applied energy at the end of the last step, J.
  double applied() const { return applied_; }
  /// The same at from + part (to - from) of that step.
  template <class Inside>
  double calcApplied(const StepNode& from, const StepNode& to, double part, const Inside& inside) {
    return applied_before_ + calcWork(from, to, part, inside);
  }
  /// The same of a motion that came to rest at `from`, with the angles gone on to those of x.
  double calcAppliedAtRest(const StepNode& from, const State& x);

  /// Everything at `sample`, where the applied energy is `applied`.
  Energy calcEnergy(const Sample& sample, double applied);

  /// At the last end of a step that is not after `time`, s since the motion's start.
  const EnergyDoubt& doubt(double time) const {
    return doubt_.time <= time ? doubt_ : doubt_before_;
  }

 private:
  /// sum Q_i omega_i at a node, its rate, and sum |Q_i omega_i|.
  struct Power {
    double value = 0.0;
    double rate = 0.0;
    double through = 0.0;
  };
  Power powerOf(const double* torque, const double* torque_rate, const double* omega,
                const double* epsilon) const;
  Power powerOf(const StepNode& node) const {
    return powerOf(node.torque.data(), node.torque_rate.data(), node.x.data() + S,
                   node.dxdt.data() + S);
  }

  void addStep(double h, const Power& begin, const Power& end, double work) {
    throughput_ += 0.5 * h * (begin.through + end.through);
    applied_ += work;
  }

  StateView view(double t, const State& x);
  double calcKinetic(const State& x) {
    return drivetrain_.calcKineticEnergy(x.data(), x.data() + S);
  }

  template <class Inside>
  double calcWork(const StepNode& from, const StepNode& to, double part, const Inside& inside) {
    const double h = to.time - from.time;
    const auto power = [&](double theta) {
      State x(from.x.size());
      inside(theta, x);
      double Q[kMaxShafts];
      drivetrain_.calcTorque(view(from.time + theta * h, x), Q);
      double sum = 0.0;
      for (int i = 0; i < S; ++i) sum += Q[i] * x[S + i];
      return sum;
    };
    return h * integrate(power, 0.0, part, std::max(tolerance_.relative, 1e-13), kHalvings);
  }
  /// Trapezoid with end corrections, of order 4; without them where the rates are steeper than a
  /// step of this size can follow.
  static double estimateWork(double h, const Power& begin, const Power& end);

  /// Row c of C in coordinates in which J is 1 (but for inertia coupling), as a unit vector.
  void calcDirection(const double* c, double* direction) const;
  bool haveRowsTurned(const Row* rows) const;
  void watch(double time, const double* x, const Row* rows) {
    has_turned_ = has_turned_ || haveRowsTurned(rows);
    judge(time, x);
  }
  /// Compares the energy of the reactions with what the applied torques have brought and taken.
  void judge(double time, const double* x);

  /// rad, by which C has turned when it counts as turning.
  static constexpr double kTurned = 0.01;
  /// Times that an energy is above what the tolerance makes of it.
  static constexpr double kCertain = 100.0;
  static constexpr int kHalvings = 4;

  const int S;              // shafts
  Drivetrain& drivetrain_;  // the system's
  Tolerance tolerance_;
  bool is_watched_;
  bool is_tracked_ = false;
  double start_kinetic_ = 0.0;   // J
  double applied_ = 0.0;         // J, at the front
  double applied_before_ = 0.0;  // J, at the base of the last step
  double throughput_ = 0.0;      // J, integral of sum |Q_i omega_i|, at the front
  double throughput_before_ = 0.0;
  EnergyDoubt doubt_;  // at the front, where the reactions are watched
  EnergyDoubt doubt_before_;
  bool has_turned_ = false;
  double directions_[kMaxRows][kMaxShafts] = {};  // of C at the start
};

}  // namespace variator_sim
