/// The account of a motion's energy: its sources and its sinks.
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
/// remainder that belongs to none of both.
///
/// All of it stands beside the motion: nothing here goes into a step, its size or its error.
#pragma once

#include <cmath>

#include "dynamics/principle_system.h"
#include "integrate/integrator.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
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
  /// Both have to outlive this.
  EnergyMeter(Integrator& integrator, PrincipleSystem& system);

  /// Whether the applied energy of the steps to come is integrated inside each, to about the
  /// tolerance of the motion, or estimated from their ends.
  void track(bool on) { is_tracked_ = on; }
  bool isTracked() const { return is_tracked_; }

  /// The motion begins at the integrator's front.
  void begin();
  /// The account of the motion up to its present, where it was cut, and the same taken up again.
  const EnergyAccount& account() const { return account_; }
  void resume(const EnergyAccount& account, double time);

  /// The integrator has made a step; Q and Q' at both of its ends are known.
  void noteStep();
  /// It has passed over steps before that one.
  void notePassed();
  /// The motion goes on from `present`, to which it has gone in its last step or at rest; inputs
  /// are still those of that step.
  void cut(const StepNode& present);

  /// Everything at `sample`, taken at `now` as nodes count it.
  Energy calcEnergy(const Sample& sample, double now);
  /// At the last end of a step that is not after `time`, s since the motion's start.
  EnergyDoubt doubt(double time) const { return judged_at_ <= time ? doubtAtFront() : before_; }

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
  void calcTorque(double t, const State& x, double* Q) const;

  void addStep(double h, const Power& begin, const Power& end, double work);
  /// The work of Q over the given part of the last step, by quadrature.
  double calcWork(double part) const;
  /// Trapezoid with end corrections, of order 4; without them where the rates are steeper than a
  /// step of this size can follow.
  static double estimateWork(double h, const Power& begin, const Power& end);
  /// The applied energy at `now`, J; of a motion that rests, with the angles of x.
  double calcApplied(double now) const;
  double calcAppliedAtRest(const State& x) const;

  EnergyDoubt doubtAtFront() const {
    return {account_.doubt_since, judged_at_, account_.reactions, account_.throughput};
  }
  /// Row c of C in coordinates in which J is 1 (but for inertia coupling), as a unit vector.
  void calcDirection(const double* c, double* direction) const;
  bool haveRowsTurned(const double (*rows)[kMaxShafts]) const;
  void watch(double time, const double* x, const double (*rows)[kMaxShafts]) {
    account_.has_turned = account_.has_turned || haveRowsTurned(rows);
    judge(time, x);
  }
  /// Compares the energy of the reactions with what the applied torques have brought and taken.
  void judge(double time, const double* x);

  const int S;  // shafts
  Integrator& integrator_;
  Drivetrain& drivetrain_;  // the system's
  const Tolerance tolerance_;
  const bool is_watched_;
  bool is_tracked_ = false;
  EnergyAccount account_;  // at the front; reactions only where they are watched
  double judged_at_ = 0.0;
  double applied_before_ = 0.0;  // J, at the base of the last step
  EnergyDoubt before_;           // there
};

}  // namespace variator_sim
