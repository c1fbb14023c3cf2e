/// One instant of a motion, as linear models and trim use it.
#pragma once

#include <vector>

#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene.h"

namespace variator_sim {

struct OperatingPoint {
  double time = 0.0;                      ///< t, s
  std::vector<double> angle;              ///< phi, rad, s values
  std::vector<double> velocity;           ///< omega, rad/s, s values
  std::vector<double> acceleration;       ///< epsilon, rad/s^2, s values
  std::vector<double> input;              ///< u in force, its own unit, one per input of the scene
  std::vector<double> input_rate;         ///< u', its own unit per second
  std::vector<double> input_second_rate;  ///< u'', per second squared
  std::vector<double> command;            ///< limits of u
  std::vector<int> mode;  ///< of elements that hold (HeldElement), as Scene::holdNames
};

/// Names the modes: "'clutch' stuck, 'brake' free"; "" where nothing holds.
std::string describeModes(const Scene& scene, const std::vector<int>& mode);

/// Returns the state that `tree` describes, with consistent accelerations. Keys, all optional:
/// `time` (s), `angle`, `velocity`, `acceleration` (s numbers each), `inputs` (a dictionary of
/// numbers, by the inputs' names). Missing keys are as at the scene's start, a missing
/// `acceleration` of least reaction; elements that hold are in the modes of a start from there.
/// `source` stands before the keys in messages. Throws SceneError.
OperatingPoint readOperatingPoint(const ParameterTree& tree, Scene scene,
                                  const std::string& source);

/// Computes the residuals of the constraints of `scene` at `point` with these accelerations (s
/// values, rad/s^2) in place of its own: psi for order 2, f' for order 1, NaN for order 3, which
/// does not limit accelerations alone. One value per constraint, in its own unit.
void calcResiduals(const Scene& scene, const OperatingPoint& point, const double* acceleration,
                   double* residual);

}  // namespace variator_sim
