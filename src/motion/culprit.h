/// Finds the element of a scene that caused a stop, by the share of each. Not in the loop.
#pragma once

#include <string>

#include "dynamics/inertia.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// A torque or a constraint of a scene, by its index; the other index is -1.
struct Element {
  int torque = -1;
  int constraint = -1;
  bool exists() const { return torque >= 0 || constraint >= 0; }
};

/// Returns "torque 'clutch'"; "" if there is none.
std::string describe(const Scene& scene, Element element);

/// Returns the next number of one digit away from 0, or towards it.
double toOneDigit(double value, bool is_up);
/// Returns "'KEY: VALUE'".
std::string assign(const std::string& path, double value);

/// Returns the element one of whose laws changes its branch where `argument` passes 0; none of
/// laws of other kinds.
Element findOwner(const Scene& scene, expression::Node argument);
/// Finds the component whose value is not finite at `state`: first torques, then constraints.
/// Returns false when all are finite. [loop]
bool findNonFinite(const Scene& scene, StateView state, int* torque, int* constraint);
/// Returns the part of an element's formulas that is not finite at `state`, or within the next
/// 0.01 s, while its operands are: "sqrt(10 - w_load)"; "" for laws without formulas.
std::string findNonFinitePart(const Scene& scene, Element element, const StateView& state);

/// Describes what a function of the element's plugin has thrown; "" when none has.
std::string describeThrown(const Scene& scene, Element element);
/// Returns the first element whose function has thrown; none when none has.
Element findThrower(const Scene& scene);

class Culprits {
 public:
  /// All have to outlive it; `inertia` is evaluated at `state`.
  Culprits(const Scene& scene, const Inertia& inertia, const StateView& state)
      : scene_(scene), S(scene.shaftCount()), inertia_(inertia), state_(state) {}

  /// Returns the element with most of the accelerations' response to rounding of the state.
  Element findSteepest() const;
  /// Returns the element that changes the accelerations fastest, by itself or with the state; none
  /// if that is slower than `least`, 1/s.
  Element findFastest(double least) const;
  /// Returns the accelerations that four roundings of the state make through this element of a
  /// scene like this one, at most at speeds around, in tolerances.
  double calcUnattainable(const Scene& scene, Element element) const;
  /// Returns the number of an element whose change would lessen its largest response to rounding
  /// `factor` times, and its new value. If several would, it is the one that changes the element
  /// least elsewhere: a width rather than a height. "" for elements of other packages, and if no
  /// single number suffices.
  std::string findRemedy(Element element, double factor) const;

 private:
  struct Shafts;
  Shafts calcAnswer(const Scene& scene, Element element, const StateView& here,
                    const StateView& beside) const;
  double calcRounding(const Scene& scene, Element element, const StateView& here) const;
  double calcChange(const Scene& changed, Element element) const;
  template <class Rate>
  Element findLargest(const Rate& rate, double least) const;

  const Scene& scene_;
  const int S;
  const Inertia& inertia_;
  const StateView& state_;
};

}  // namespace variator_sim
