#include "variator_sim/operating_point.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "variator_sim/message_text.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

void readInputs(ParameterReader& reader, Scene& scene) {
  std::vector<std::string> names;
  for (const CommandInputSettings& input : scene.inputs) names.push_back(input.name);
  for (const auto& [name, value] : reader.numberDictionary("inputs")) {
    const std::string path = reader.keyPath("inputs") + "/" + name;
    const int index = placeOf(name, names, path, "is no input");
    CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(index)];
    const Range limits = Range::between(input.minimum, input.maximum);
    if (!limits.contains(value)) {
      throw SceneError(path, formatNumber(value) + " is outside of the input's limits; allowed: " +
                                 "a number " + limits.toText());
    }
    input.initial = value;
  }
}

}  // namespace

std::string describeModes(const Scene& scene, const std::vector<int>& mode) {
  const std::vector<std::string> names = scene.holdNames();
  std::string text;
  for (std::size_t h = 0; h < mode.size(); ++h) {
    text += (text.empty() ? "" : ", ") + inQuotes(names[h]) + " " + modeName(mode[h]);
  }
  return text;
}

OperatingPoint readOperatingPoint(const ParameterTree& tree, Scene scene,
                                  const std::string& source) {
  OperatingPoint point;
  ParameterReader reader(tree, source);
  const auto s = static_cast<std::size_t>(scene.shaftCount());
  reader.allow({"angle", "velocity", "acceleration"});
  point.time = reader.number("time", Range::notNegative(), 0.0);
  const bool moves = reader.has("velocity") || reader.has("angle") || reader.has("inputs");
  if (moves) scene.initial.acceleration.clear();
  InitialConditions& initial = scene.initial;
  for (const auto& [key, values] : {std::pair{"angle", &initial.angle},
                                    {"velocity", &initial.velocity},
                                    {"acceleration", &initial.acceleration}}) {
    if (reader.has(key)) *values = reader.numbers(key, s);
  }
  readInputs(reader, scene);
  try {
    reader.finish();
  } catch (const SceneError& error) {
    throw SceneError(error.keyPath(),
                     error.message() +
                         "; angle, velocity and acceleration are lists over the shafts (" +
                         joinNames(scene.shafts) +
                         "), inputs a dictionary; a steady state at a speed: --trim --fix w_" +
                         scene.shafts.front() + "=VALUE");
  }

  if (!scene.inertia_formulas.empty() && point.time > 0.0) {
    throw SceneError(source + "/time",
                     "a scene whose inertia is a formula starts at 0; allowed: 0, or a time or a "
                     "saved state as --at");
  }
  if (!scene.holdNames().empty() && point.time > 0.0) {
    throw SceneError(source + "/time",
                     "the modes of elements that hold are decided at the scene's start; allowed: "
                     "0, or a time or a saved state as --at");
  }
  scene.initial.time = point.time;
  Simulation simulation(std::move(scene));
  if (!simulation.status().ok()) {
    throw SceneError(source,
                     "no accelerations follow from this state: a law is not finite there, "
                     "or the constraints' derivatives have lost rank" +
                         simulation.scene().extreme_numbers);
  }
  return simulation.operatingPoint();
}

void calcResiduals(const Scene& scene, const OperatingPoint& point, const double* acceleration,
                   double* residual) {
  StateView state{};  // no u'': only f'' has it
  state.time = point.time;
  state.angle = point.angle.data();
  state.velocity = point.velocity.data();
  state.acceleration = acceleration;
  state.input = point.input.data();
  state.input_rate = point.input_rate.data();
  double C[kMaxShafts];
  for (const ConstraintPtr& constraint : scene.constraints) {
    *residual++ = constraint->order() == 3 ? std::numeric_limits<double>::quiet_NaN()
                                           : constraint->calcResidualAndJacobian(state, C);
  }
}

}  // namespace variator_sim
