/// Finds the element of a scene that caused a stop, by the share of each. Not in the loop.
#pragma once

#include <string>

#include "dynamics/inertia.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Returns "torque 'clutch'".
std::string describe(const Law& element);

/// Returns the next number of one digit away from 0, or towards it.
double toOneDigit(double value, bool is_up);
/// Returns "'KEY: VALUE'".
std::string assign(const std::string& path, double value);

/// Returns the element whose formulas change their branch where `argument` passes 0, or null.
const Law* findOwner(const Scene& scene, expression::Node argument);
/// Returns the part of an element's formulas that is not finite at `state`, or within the next
/// 0.01 s, while its operands are: "sqrt(10 - w_load)"; "" for laws without formulas.
std::string findNonFinitePart(const Scene& scene, const Law& element, const StateView& state);

/// Describes what a function of the element's plugin has thrown; "" when none has.
std::string describeThrown(const Law& element);
/// Returns the first element whose function has thrown, or null.
const Law* findThrower(const Scene& scene);

class Culprits {
 public:
  /// All have to outlive it; `inertia` is evaluated at `state`.
  Culprits(const Scene& scene, const Inertia& inertia, const StateView& state)
      : scene_(scene), S(scene.shaftCount()), inertia_(inertia), state_(state) {}

  /// Returns the element with most of the accelerations' response to rounding of the state.
  const Law* findSteepest() const;
  /// Returns the element that changes the accelerations fastest, by itself or with the state; null
  /// if that is slower than `least`, 1/s.
  const Law* findFastest(double least) const;
  /// Returns the accelerations that four roundings of the state make through an element of this
  /// scene or one like it, at most at speeds around, in tolerances.
  double calcUnattainable(const Law& element) const;
  /// Returns the number of an element whose change would lessen its largest response to rounding
  /// `factor` times, and its new value. If several would, it is the one that changes the element
  /// least elsewhere: a width rather than a height. "" for elements of other packages, and if no
  /// single number suffices.
  std::string findRemedy(const Law& element, double factor) const;

 private:
  struct Shafts;
  Shafts calcAnswer(const Law& element, const StateView& here, const StateView& beside) const;
  double calcRounding(const Law& element, const StateView& here) const;
  double calcChange(const Law& changed, const Law& element) const;
  template <class Rate>
  const Law* findLargest(const Rate& rate, double least) const;

  const Scene& scene_;
  const int S;
  const Inertia& inertia_;
  const StateView& state_;
};

}  // namespace variator_sim
