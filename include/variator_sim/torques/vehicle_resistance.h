#pragma once

#include "variator_sim/table.h"
#include "variator_sim/torque.h"

namespace variator_sim {

/// Running resistance F of a vehicle on one of its shafts, through a gear and a wheel:
///     v = rho omega,   Q = -rho F(v, t),   Q' = -rho (dF/dv rho epsilon + dF/dt)
/// with rho = wheel_radius / ratio, m/rad (ratio: turns of the shaft per turn of the wheel) and, s
/// = tanh(v/v_0) being the sign of v made smooth,
///   davis  a train:     F = (A + C v^2) s + B v + m g sin alpha
///   road   a road car:  F = (c_rr m g cos alpha + c_w v^2) s + m g sin alpha,  c_w = rho_air C_d
///   A/2
/// v in m/s, F in N. F is odd in v on the level and as smooth as tanh; it falls short of the exact
/// law by the part 2 exp(-2 v/v_0). It does not hold a vehicle at rest: on a slope below its
/// resistance that creeps with about v_0 sin alpha / c_rr. `grade` is tan alpha, a constant or a
/// table over time (two times continuously differentiable; the first and the last value hold beyond
/// its ends).
/// The inertia of the vehicle is not in it: add m rho^2 to the shaft's.
///
/// Keys: `shaft`, `law`: davis | road, `wheel_radius` > 0 (m), `ratio` (default 1, not 0; negative:
/// the shaft turns against the wheel), `regularization_speed` v_0 > 0 (m/s, default 0.1), `grade`
/// (default 0: a number from -1 to 1, or {`time` (s, increasing), `grade`}), and
///   davis  `constant` A >= 0 (N), `linear` B >= 0 (N s/m), `quadratic` C >= 0 (N s^2/m^2), for the
///          whole train; `mass` m > 0 (kg), required with `grade`
///   road   `mass` m > 0 (kg), `rolling_coefficient` c_rr >= 0, `drag_area` C_d A >= 0 (m^2),
///          `air_density` > 0 (kg/m^3, default 1.2)
///
/// Sources: W. J. Davis: The tractive resistance of electric locomotives and cars, General Electric
/// Review 29 (1926); Guzzella, Sciarretta: Vehicle Propulsion Systems (2013), section 2.1.
class VehicleResistance : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {grade_varies_, false}; }
  Dependence doRateDependence() const override { return {grade_varies_, false}; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  std::vector<double> doInstants() const override { return grade_.points(); }

 private:
  void readGrade(ParameterReader& parameters);

  int shaft_ = 0;
  double radius_ = 1.0;      ///< rho, m/rad
  double sign_scale_ = 1.0;  ///< 1/v_0, s/m
  double constant_ = 0.0;    ///< A, N
  double linear_ = 0.0;      ///< B, N s/m
  double quadratic_ = 0.0;   ///< C or c_w, N s^2/m^2
  double weight_ = 0.0;      ///< m g, N
  double rolling_ = 0.0;     ///< c_rr m g, N
  double sine_ = 0.0;        ///< sin alpha of a constant grade
  double cosine_ = 1.0;
  bool grade_varies_ = false;
  Table grade_;  ///< tan alpha over time
};

}  // namespace variator_sim
