#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// A friction variator with its characteristic, order 2 (rad/s), driving shaft a, driven shaft b:
///     psi = omega_b - i omega_a (1 - s(M)),     s = s_n sinh(g M/M_n)/sinh(g),
///     M = J_b epsilon_b + L + k omega_b |omega_b|
/// M is the torque transmitted to b, as its acceleration shows it: what speeds up its inertia J_b
/// and what its known load takes. The slip s grows in proportion to M at first and ever faster
/// towards the limit of traction; s_n is the slip at the nominal torque M_n, g how sharply it
/// bends. psi is nonlinear in epsilon_b. |omega_b| is omega_b^2/sqrt(omega_b^2 + omega_r^2),
/// smooth. C = i omega_a ds/dM J_b vanishes at omega_a = 0: the scene starts in motion. Where the
/// speeds change fast, put elastic links between the variator and the other masses. After Mal'tsev:
/// Stability of motion of a stepless drive with regard to the variator's characteristic and the
/// elasticity of links, Theory of mechanisms and machines 29 (Kharkov 1980), 121-125 (in Russian):
/// the idea of the characteristic; the formula is our choice.
///
/// Keys: `shafts` [a, b], `ratio` i (a number, a table over time, or commanded with any hold),
/// `inertia` J_b > 0 (kg m^2), `nominal_torque` M_n > 0 (N m), `nominal_slip` 0 < s_n < 1,
/// `sharpness` g > 0 (default 2), `load` L (N m, positive brakes: a number, a table over time, or
/// commanded; default 0), `load_square` k >= 0 (N m s^2/rad^2, default 0), `regularization_speed`
/// omega_r > 0 (rad/s, default 0.1).
class TractionCurve : public AutomaticConstraint<TractionCurve, 2, 2, 2> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T& w = x.velocity[1];
    T torque = inertia_ * x.acceleration[1] + load_(x);
    if (load_square_ != 0.0) {
      torque = torque + load_square_ * w * w * w /
                            sqrt(w * w + regularization_speed_ * regularization_speed_);
    }
    const T slip = slip_scale_ * sinh(torque * torque_scale_);
    return w - ratio_(x) * x.velocity[0] * (1.0 - slip);
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  std::vector<double> doInstants() const override {
    std::vector<double> instants = ratio_.instants();
    for (const double instant : load_.instants()) instants.push_back(instant);
    return instants;
  }
  Dependence doDependence() const override {
    return {ratio_.readsTime() || load_.readsTime(), false};
  }

 private:
  TimeValue ratio_;                    ///< i
  TimeValue load_;                     ///< L, N m
  double inertia_ = 1.0;               ///< J_b, kg m^2
  double slip_scale_ = 0.01;           ///< s_n / sinh g
  double torque_scale_ = 1.0;          ///< g / M_n, 1/(N m)
  double load_square_ = 0.0;           ///< k, N m s^2/rad^2
  double regularization_speed_ = 0.1;  ///< omega_r, rad/s
};

}  // namespace variator_sim
