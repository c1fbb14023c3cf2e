/// Random scenes whose laws have bumps, steps and periods far narrower than the motion, and a
/// reference for each: the generator knows where the features are, and how wide, so that an
/// explicit integrator outside of the program can be kept from stepping over them.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stress/hazard.h"

namespace variator_sim::test {

/// A value and its rate along the motion.
struct Dual {
  double value = 0.0;
  double rate = 0.0;
};

/// A formula of one variable, written X: its text, and the same computed without the program.
struct Formula {
  std::string text;
  std::function<Dual(Dual)> at;
};

/// A place in X, or one of a period (0: none), where a formula changes within `width`.
struct Feature {
  double at = 0.0;
  double width = 0.0;
  double period = 0.0;
};

enum class Argument { kTime, kAngle, kVelocity, kInput, kTable };

/// scale * formula(argument).
struct Term {
  double scale = 1.0;
  Formula formula;
  std::vector<Feature> features;
  Argument argument = Argument::kTime;
};

/// Shaft a of inertia 1 under base - damping w + drift sin(1.4 t) + a commanded torque + terms,
/// and, unless `order` is 0, shaft b of inertia 2 under `load`, related by
///     order 1:  w_b - c w_a,   order 2:  tau (e_b - c e_a) + w_b - c w_a - bumps,
///     order 3:  j_b - c j_a + e_b - c e_a - bumps
/// with c = ratio + ratio terms (order 3: c = ratio).
struct BumpyScene {
  int order = 0;
  Principle principle = Principle::kGeneralizedGauss;
  double base = 0.0, damping = 0.0, drift = 0.0, load = 0.0;
  double ratio = 0.5, slip_time = 0.3;
  bool is_law = false;  ///< KinematicRatio and SlipRatio where they can say it, not formulas
  std::vector<Term> terms, ratio_terms, bumps;
  double velocity = 1.0;  ///< of a at the start, rad/s
  double end = 3.0;       ///< s

  std::string hold = "first_order_lag";  ///< of the input u, which is 0 at the start
  double hold_time = 0.1;                ///< time constant or period, s; 1 / rate
  double table_offset = 0.0;             ///< the table is table_offset + t: a straight line
  std::vector<TimedCommand> commands;    ///< input 0: u, 1: the commanded torque

  StepperKind stepper = StepperKind::kAuto;
  double tolerance = 1e-9;
  double maximum_step = 1.0;

  std::string yaml() const;
  std::string csv() const;
  std::vector<double> times() const;
  /// Error of the velocity by rounding of a bump's argument, rad/s.
  double rounding() const;
  /// Velocities and the angle of a at times(), from a start moved by `shift` of angle and velocity.
  /// Each step passes at most the part `fineness` of what the features allow. Empty where more than
  /// `most` steps are needed.
  std::vector<Sample> reference(double shift = 0.0, double fineness = 1.0,
                                int most = 1000000) const;
};

/// The same for the same seed.
BumpyScene makeBumpyScene(std::uint64_t seed);

/// The formula X, a number, and 1 - that of `Formula`: for scenes written by hand.
Formula variable();
Formula number(double value);
Formula operator+(const Formula& a, const Formula& b);
Formula operator-(const Formula& a, const Formula& b);
Formula operator*(const Formula& a, const Formula& b);
Formula operator/(const Formula& a, const Formula& b);
Formula power(const Formula& x, double exponent);
/// `name` is a function of formulas: sin, exp, tanh, ...
Formula call(const char* name, const Formula& x);

}  // namespace variator_sim::test
