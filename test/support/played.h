/// Motions as text, to the bit.
#pragma once

#include <cstdio>
#include <string>

#include "support/scenes.h"

namespace variator_sim::test {

/// A scene of two shafts.
inline std::string twoShafts(const std::vector<std::string>& elements,
                             const std::string& keys = "") {
  return sceneText("drive 0.5, load 1.2", elements, "initial: {velocity: [10, 6]}\n" + keys);
}

inline std::string hex(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%a", value);
  return text;
}

/// The samples and the end of a motion, commands in it, as text of their bits. At sample
/// `switch_at` it goes over to machine code.
inline std::string play(Simulation& simulation, int switch_at, int samples = 40,
                        double every = 0.05) {
  const Scene& scene = simulation.scene();
  const auto s = static_cast<std::size_t>(scene.shaftCount());
  const int inputs = scene.inputCount();
  std::string text;
  const auto note = [&text](const double* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) text += hex(values[i]) + " ";
  };
  for (int n = 0; n < samples; ++n) {
    if (n == switch_at) {
      EXPECT_TRUE(simulation.loadMachineCode(true)) << simulation.machineCode();
      EXPECT_TRUE(simulation.hasMachineCode());
    }
    simulation.advanceTo(n * every);
    if (inputs > 0 && n % 7 == 3) {
      const auto& input = scene.inputs[static_cast<std::size_t>(n % inputs)];
      simulation.command(n % inputs, input.initial + 0.05 * n);
    }
    const Sample& sample = simulation.sample();
    for (const double* values : {sample.angle, sample.velocity, sample.acceleration,
                                 sample.applied_torque, sample.reaction_torque}) {
      note(values, s);
    }
    note(sample.multiplier, scene.constraints.size());
    text += "\n";
  }
  return text + simulation.describeStatus() + " " + std::to_string(simulation.statistics().steps);
}

inline std::string play(Scene scene, int switch_at) {
  scene.solver.machine_code = MachineCode::kAlways;  // kAlways waits for a busy compiler
  Simulation simulation(std::move(scene));
  return play(simulation, switch_at);
}

}  // namespace variator_sim::test
