/// The inside of a step: polynomials that can be enclosed over any part of it.
#pragma once

#include <array>
#include <cstddef>

#include "variator_sim/guard.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// The motion at one end of a step. Arrays of s values; jerks may be missing.
struct CurveEnd {
  const double* angle;
  const double* velocity;
  const double* acceleration;
  const double* jerk;  ///< nullptr where accelerations are no state
};

/// Every state between two ends at a distance of `duration` s, as far as these tell: the Hermite
/// polynomials through all that is known there, widened by what the highest derivatives at the ends
/// make of them. `box` gets all but the time. [loop]
void encloseStep(int shafts, const CurveEnd& from, const CurveEnd& to, double duration,
                 StateBox* box);

/// x over one step as polynomials of degree 8 in the part theta of it, 0 to 1, in Bernstein's form:
/// its coefficients enclose it, and over a part of the step de Casteljau's algorithm gives those of
/// that part (Farouki: The Bernstein polynomial basis, CAGD 29 (2012) 379).
class StepCurve {
 public:
  static constexpr int kNodes = 9;
  static constexpr int kMostComponents = 3 * kMaxShafts;

  /// Returns theta of the nodes 0 to kNodes - 1 at which x is sampled, the first 0 and the last 1.
  static double node(int index);

  /// A step from `time` by `duration` s of `shafts` shafts; x is (phi, omega), and epsilon where
  /// `has_accelerations` (they are the slopes of omega otherwise). [loop]
  void begin(double time, double duration, int shafts, bool has_accelerations);
  /// x at a node. [loop]
  void setNode(int index, const double* x);
  /// After all nodes were set. [loop]
  void finish();

  double time() const { return time_; }
  double duration() const { return duration_; }
  int shafts() const { return shafts_; }

  /// Bernstein coefficients of one polynomial: their range encloses it.
  using Coefficients = std::array<double, kNodes>;
  /// Encloses all states of the step. [loop]
  void enclose(StateBox* box) const;
  /// One part of the state, counted as in LinearValue, less `*origin`. [loop]
  Coefficients part(int index, double* origin) const;
  /// Returns a linear form as a polynomial from its value at the beginning on; `*size` is that of
  /// its terms, which tells their rounding. [loop]
  Coefficients combine(const LinearValue& form, double* size) const;
  /// Returns the place of that part in `box`, its enclosure by the polynomial. [loop]
  static Interval* partOf(StateBox* box, int index);
  static Interval rangeOf(const Coefficients& whole, double origin);
  /// Both halves of a polynomial: `whole` becomes the later one. [loop]
  static void halve(Coefficients& whole, Coefficients* earlier);
  /// It as far as `part`, from 0 to 1. [loop]
  static Coefficients head(const Coefficients& whole, double part);
  /// Its value at `part`, and the slope by that. [loop]
  static double valueAt(const Coefficients& whole, double part, double* slope);

  /// phi, omega and epsilon (s values each) at a part of the step. [loop]
  void evaluate(double part, double* angle, double* velocity, double* acceleration) const;

 private:
  double time_ = 0.0;
  double duration_ = 0.0;
  int shafts_ = 0;
  bool has_accelerations_ = true;
  std::size_t count_ = 0;
  /// First values at the nodes, then Bernstein coefficients, of x less x at the first node.
  std::array<Coefficients, kMostComponents> component_{};
  std::array<double, kMostComponents> origin_{};
};

}  // namespace variator_sim
