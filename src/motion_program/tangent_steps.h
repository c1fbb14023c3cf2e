/// A motion with its derivatives by parameters: the texts of src/runtime over numbers that carry
/// them (tangent.h), so that no equation is written twice. Steps and modes are those of the values;
/// the instants of events have derivatives of their own.
#pragma once

#include <memory>
#include <vector>

#include "motion_program/motion_steps.h"

namespace variator_sim {

/// The numbers that parameters change: MotionProgram::numbers, then the scene's initial angles,
/// velocities and accelerations.
struct TangentNumbers {
  std::vector<double> values;
  std::vector<std::vector<double>> slopes;  ///< by each parameter, or empty; those beyond the
                                            ///< width of a motion are left to another one
  double relative_tolerance = 0.0;          ///< of the scene
  double absolute_tolerance = 0.0;
};

/// Derivatives are not judged: their motions are stepped for so small a part of the tolerance.
constexpr int kTightening = 100;

/// Steps a motion freely ahead of its current time and shows any instant inside the last step.
/// Quantities: of each shaft angle, velocity, acceleration, applied torque, reaction torque; of
/// each constraint the multiplier; states; formulas that the program shows.
class TangentMotion {
 public:
  virtual ~TangentMotion() = default;
  /// The number of parameters that it has room for.
  virtual int width() const = 0;
  /// Returns to time 0. `accelerations`: where the iteration for those of least reaction begins.
  virtual scene_status begin(const double* accelerations) = 0;
  /// A command at the current time; `slope`: derivatives of its value, `width` of them.
  virtual void command(int input, double value, const double* slope) = 0;
  virtual scene_status advance(double time) = 0;
  /// Writes the derivatives of the quantities at the current time, `width` for each.
  virtual scene_status see(double* slopes) = 0;
};

/// `program` has to outlive what is returned; `shown`: rows of further quantities.
std::unique_ptr<TangentMotion> hostTangents(const MotionProgram& program,
                                            const TangentNumbers& numbers,
                                            const std::vector<int>& shown);

}  // namespace variator_sim
