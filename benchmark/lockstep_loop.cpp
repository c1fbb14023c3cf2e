/// Lockstep with a controller in C++: what benchmark/lockstep.py compares Python's loop with.
///
/// usage: lockstep_loop SCENE STEPS TOPIC|- ; prints seconds and the last velocity of shaft 1

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

int main(int argc, char** argv) {
  using namespace variator_sim;
  if (argc != 4) return 2;
  BuiltinComponentFactory factory;
  Simulation simulation(readScene(readYamlFile(argv[1]), factory));
  const int steps = std::atoi(argv[2]);
  const bool has_commands = std::string(argv[3]) != "-";
  int input = 0;
  while (has_commands &&
         simulation.scene().inputs.at(static_cast<std::size_t>(input)).topic != argv[3]) {
    ++input;
  }
  simulation.loadMachineCode(false);
  double velocity = 0.0;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < steps; ++i) {
    if (has_commands) simulation.command(input, 20.0 - 0.1 * velocity);
    if (!simulation.advanceTo(simulation.time() + 0.001).ok()) return 1;
    velocity = simulation.sample().velocity[0];
  }
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  std::printf("%.6f %.17g\n", wall.count(), velocity);
}
