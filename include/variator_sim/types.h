/// Sizes, enumerations and the view of a state that plugins read. Units: SI (rad, s, N m, kg m^2).
#pragma once

#include <bitset>

namespace variator_sim {

/// Largest number of shafts s of one drivetrain.
constexpr int kMaxShafts = 64;
/// A set of shafts.
using ShaftSet = std::bitset<kMaxShafts>;
/// Largest number of constraints k; k < s.
constexpr int kMaxConstraints = kMaxShafts - 1;
/// Largest number of commanded inputs u of one drivetrain.
constexpr int kMaxInputs = 32;
/// Largest number of elements of one drivetrain that hold. Formulas read the side that one slides
/// to as an input: that of number kMaxInputs + n, which is constant between events.
constexpr int kMaxHolds = 64;

/// Outputs read a motion's G, its measure Z and the constraint measure as inputs behind these
/// sides.
constexpr int kFirstObserved = kMaxInputs + kMaxHolds;
constexpr int kMaxObserved = kMaxShafts + 2;

/// An element that holds, at an instant.
struct HeldElement {
  int mode = 2;                      ///< -1 slides backward, 0 holds, 1 slides forward, 2 free
  double torque = 0.0;               ///< N m, against the slip
  double slip = 0.0;                 ///< rad/s
  double reserve = 0.0;              ///< N m, how much more it would hold; 0 while it does not hold
  double heat = 0.0;                 ///< J since the start
  double on_shaft[kMaxShafts] = {};  ///< N m
};

/// Largest number of events of one scene.
constexpr int kMaxEvents = 32;

/// The state that torques and constraints are evaluated at. It owns nothing: the arrays belong to
/// the caller and are valid during the call only.
struct StateView {
  double time;             ///< t, s
  const double* angle;     ///< phi, s values, rad
  const double* velocity;  ///< omega, s values, rad/s
  const double*
      acceleration;          ///< epsilon, s values, rad/s^2 (undefined when a torque is evaluated)
  const double* input;       ///< u, one value per commanded input of the scene, its own unit
  const double* input_rate;  ///< u', one value per commanded input, its own unit per second
  /// u'', one value per commanded input, its own unit per second squared: of inputs with
  /// `second_order_lag`; 0 for all others, whose u' is not differentiable at a command. Only a
  /// constraint of order 1 needs it; null when no law may read it.
  const double* input_second_rate = nullptr;
  /// Elements that hold, in the scene's order; null where their modes are not known.
  const HeldElement* held = nullptr;
  /// Their values for formulas (expression::heldSlot).
  const double* held_values = nullptr;
};

}  // namespace variator_sim
