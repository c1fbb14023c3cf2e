/// Explicit Runge-Kutta schemes of Boost.Odeint for the steps of a motion (explicit_motion.inc).
#pragma once

#include <functional>
#include <memory>

#include "motion_program/motion_program.h"

namespace variator_sim {

/// Writes the slope x' of a state, `at` s behind the start of a step. NaN where there is none.
using SlopeOfMotion = std::function<void(double at, const double* x, double* slope)>;

/// A step of h s from the state x with the slope x', and the nodes, parts of h, at which states are
/// asked for: the last is the end.
struct ExplicitStep {
  int size;   ///< of x
  int first;  ///< the error of components from this one on counts
  double h;
  const double* x;
  const double* slope;
  int nodes;
  const double* node;
  double* at_node;  ///< nodes x size
  const SlopeOfMotion* slope_at;
};

/// Its functions are [loop].
class ExplicitScheme {
 public:
  explicit ExplicitScheme(int p) : order(p) {}
  virtual ~ExplicitScheme() = default;
  ExplicitScheme(const ExplicitScheme&) = delete;
  ExplicitScheme& operator=(const ExplicitScheme&) = delete;

  const int order;  ///< p of the error h^p
  /// Makes a step. Returns its error in tolerances; NaN where the motion has no value.
  virtual double make(const ExplicitStep& step) = 0;
  /// Returns the error of the last step's end, or null where it has none for each component.
  virtual const double* errorAtEnd() const = 0;
};

/// Returns the scheme of the scene's stepper for states of `size` components, or null where the
/// stepper is no explicit one.
std::unique_ptr<ExplicitScheme> makeExplicitScheme(const MotionProgram& program, int size);

}  // namespace variator_sim
