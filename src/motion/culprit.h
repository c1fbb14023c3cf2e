/// Which element of a scene is to blame for a stop: each is asked for its own share. Not in the
/// loop.
#pragma once

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

/// "torque 'clutch'"; "" where there is none.
std::string describe(const Scene& scene, Element element);

/// The next number of one digit away from 0, or towards it.
double toOneDigit(double value, bool is_up);
/// "'KEY: VALUE'"
std::string assign(const std::string& path, double value);

class Culprits {
 public:
  /// All have to outlive it; `inertia` is at `state`.
  Culprits(const Scene& scene, const Inertia& inertia, const StateView& state)
      : scene_(scene), S(scene.shaftCount()), inertia_(inertia), state_(state) {}

  /// The element that makes most of the accelerations' answer to rounding of the state.
  Element findSteepest() const;
  /// The element that changes the accelerations fastest, by itself or with the state; none where
  /// that is slower than `least`, 1/s.
  Element findFastest(double least) const;
  /// The accelerations that four roundings of the state make by way of this element of a scene like
  /// this one, at most at speeds around, in tolerances.
  double calcUnattainable(const Scene& scene, Element element) const;
  /// The number of an element whose change would lessen its largest answer to rounding `factor`
  /// times, and its new value. Where several would do it is the one that changes the element least
  /// elsewhere: a width rather than a height. "" for elements of other packages, and where no
  /// single number is to blame.
  std::string findRemedy(Element element, double factor) const;
  /// The part of an element's formulas that is not finite here, or ahead within a hundredth of a
  /// second, while what it is made of is: "sqrt(10 - w_load)"; "" where it is no formula.
  std::string findNonFinitePart(Element element) const;

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
