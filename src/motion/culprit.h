/// Which element of a scene is to blame for a stop: each is asked for its own share. Not in the
/// loop.
#pragma once

#include <optional>
#include <string>

#include "variator_sim/inertia.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// A torque or a constraint of a scene, by its index; the other index is -1.
struct Element {
  int torque = -1;
  int constraint = -1;
  bool exists() const { return torque >= 0 || constraint >= 0; }
};
const std::string& nameOf(const Scene& scene, Element element);
/// "torque 'clutch'"
std::string describe(const Scene& scene, Element element);

/// A number of the scene that another value would help.
struct Remedy {
  std::string path;
  double now;
  double then;
};
/// The next number of one digit away from 0, or towards it.
double toOneDigit(double value, bool is_up);

/// Asks the elements of a scene at one of its states. Both and `inertia`, which is at this state,
/// have to outlive it.
class Culprits {
 public:
  Culprits(const Scene& scene, const Inertia& inertia, const StateView& state)
      : scene_(scene), S(scene.shaftCount()), inertia_(inertia), state_(state) {}

  /// The element that makes most of the accelerations' answer to rounding of the state.
  Element findSteepest() const;
  /// The element that changes the accelerations fastest, by itself or with the state; none where
  /// that is slower than `least`, 1/s.
  Element findFastest(double least) const;
  /// What four roundings of the state make of the accelerations by way of this element, at most at
  /// speeds around, in tolerances.
  double calcUnattainable(Element element) const {
    return calcUnattainable(scene_, element, state_);
  }
  /// The number of an element whose change would lessen its largest answer to rounding `factor`
  /// times. Where several would do it is the one that changes the element least elsewhere: a width
  /// rather than a height. None for elements of other packages, and where no single number is to
  /// blame.
  std::optional<Remedy> findRemedy(Element element, double factor) const;
  /// The part of an element's formulas that is not finite here, or ahead within a hundredth of a
  /// second, while what it is made of is: "sqrt(10 - w_load)"; "" where it is no formula.
  std::string findNonFinitePart(Element element) const;

 private:
  class Beside;
  /// The accelerations that `element` of `scene` makes of a change of the state, S values, rad/s^2.
  void calcAnswer(const Scene& scene, Element element, const StateView& here,
                  const StateView& beside, double* answer) const;
  double calcUnattainable(const Scene& scene, Element element, const StateView& here) const;
  double calcRounding(const Scene& scene, Element element, const StateView& here) const;
  /// The size of what the element gives at `state`.
  double calcSize(const Scene& scene, Element element, const StateView& state) const;
  double largestOf(const double* values) const;
  template <class Rate>
  Element findLargest(const Rate& rate, double least) const;

  const Scene& scene_;
  const int S;
  const Inertia& inertia_;
  const StateView& state_;
};

}  // namespace variator_sim
