/// The energy account (energy_balance.h) of a motion by an integrator.
///
/// One quadrature and exact bookkeeping: Q and omega are the most accurate values of a step, while
/// R contains the accelerations, which dense output knows worst, and a quadrature of its own would
/// leave a remainder that belongs to neither.
///
/// The account is a pure observer: it affects no step, step size or error.
#pragma once

#include <cmath>

#include "dynamics/system.h"
#include "integrate/integrator.h"
#include "motion/energy_balance.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// Returns the integral of f over [from, to] by the rules of Gauss (3 points) and Kronrod (7,
/// degree 11). The interval is halved up to `depth` times while their difference d says that the
/// latter errs by more than `tolerance` of the integral of |f|. It errs by about d^2, and by less
/// than (10 d)^(3/2) if f is less smooth.
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
  EnergyMeter(Integrator& integrator, System& system);

  /// Sets whether the applied energy of the steps to come is integrated inside each, to about the
  /// tolerance of the motion, or estimated from their ends.
  void track(bool on) { is_tracked_ = on; }
  bool isTracked() const { return is_tracked_; }

  /// Begins the account at the integrator's step end.
  void begin();
  /// Returns the account up to the current time of a cut motion, and restores it.
  const EnergyAccount& account() const { return balance_.account(); }
  void resume(const EnergyAccount& account, double time) { balance_.resume(account, time); }

  /// Accounts for a step of the integrator; Q and Q' at both of its ends are known.
  void noteStep();
  /// Continues from `present`, which the motion has reached in its last step;
  /// inputs are still those of that step.
  void cut(const StepNode& present);

  /// Returns all energies at `sample`, taken at the node time `now`.
  Energy calcEnergy(const Sample& sample, double now);
  /// Returns the doubt at the last step end that is not after `time`, s since the start.
  EnergyDoubt doubt(double time) const { return balance_.doubt(time); }

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

  /// Returns the work of Q over the given part of the last step, by quadrature.
  double calcWork(double part) const;
  /// Returns the trapezoid with end corrections, of order 4; without them if the rates are too
  /// steep for a step of this size.
  static double estimateWork(double h, const Power& begin, const Power& end);
  /// Returns the applied energy at `now`, J.
  double calcApplied(double now) const;

  const int S;  // shafts
  Integrator& integrator_;
  Drivetrain& drivetrain_;  // the system's
  const Tolerance tolerance_;
  bool is_tracked_ = false;
  EnergyBalance balance_;
};

}  // namespace variator_sim
