/// The scenes of the work-precision benchmark by name.
#pragma once

#include <string>
#include <vector>

#include "scenes.h"

namespace variator_sim::benchmark {

/// One scene as it is run: a file of benchmark/scenes/ and what is replaced in it.
struct SceneCase {
  std::string name;  ///< as in the tables: "stiff_slip_1e-3"
  std::string file;  ///< benchmark/scenes/FILE.yaml
  double tau = 0.0;  ///< s, replaced in the file where not 0
  SceneParameters parameters;
  bool stiff = false;      ///< implicit peers run too
  bool in_quick = false;   ///< part of a quick run
  std::string commands{};  ///< benchmark/scenes/COMMANDS.csv, or ""
};

std::vector<SceneCase> allScenes();

/// A scene's template, handed to a generic lambda: `typename decltype(tag)::template Of<double>`.
template <template <class> class Scene>
struct SceneTag {
  template <class R>
  using Of = Scene<R>;
};

/// Calls visitor(SceneTag<...>) for the scene of that file.
template <class Visitor>
auto visitScene(const SceneCase& scene, Visitor visitor) {
  if (scene.file == "ship") return visitor(SceneTag<Ship>());
  if (scene.file == "smooth_linear") return visitor(SceneTag<SmoothLinear>());
  if (scene.file == "acceleration_circle") return visitor(SceneTag<AccelerationCircle>());
  if (scene.file == "torque_steps") return visitor(SceneTag<TorqueSteps>());
  if (scene.file == "four_shafts") return visitor(SceneTag<FourShafts>());
  if (scene.file == "crank") return visitor(SceneTag<Crank>());
  if (scene.file == "order1") return visitor(SceneTag<Order1>());
  if (scene.file == "order3") return visitor(SceneTag<Order3>());
  return visitor(SceneTag<StiffSlip>());  // stiff_slip, stiff_start
}

}  // namespace variator_sim::benchmark
