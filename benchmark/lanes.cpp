/// Motions at once, one in each lane of a vector, against the same in turn, both by machine code
/// and to the same bits: what benchmark/sweep.py shows beside its sweeps.
///
/// usage: lanes SCENE.yaml DURATION TOLERANCE
/// prints how many, and microseconds of these in turn and at once: the least of many rounds,
/// which take turns. Scenes, code and simulations are made before.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "python/row_fibers.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

int main(int argc, char** argv) {
  using namespace variator_sim;
  if (argc != 4) return 2;
  const double duration = std::atof(argv[2]);
  BuiltinComponentFactory factory;
  Scene scene = readScene(readYamlFile(argv[1]), factory);
  scene.solver.relative_tolerance = scene.solver.absolute_tolerance = std::atof(argv[3]);
  scene.solver.machine_code = MachineCode::kAlways;
  Simulation first(scene);
  if (!first.loadMachineCode(true)) return 1;
  const std::shared_ptr<SeriesLanes> lanes = first.loadLanes(true);
  if (lanes == nullptr) return 1;

  constexpr int kMotions = SeriesLanes::kLanes;
  std::vector<std::unique_ptr<Simulation>> motions;
  for (int n = 0; n < kMotions; ++n) {
    Scene own = scene;
    for (double& velocity : own.initial.velocity) velocity *= 1.0 + 0.01 * n;
    own.initial.project = true;
    motions.push_back(std::make_unique<Simulation>(own, first));
  }
  python::RowFibers fibers;
  fibers.setLanes(lanes);
  const auto play = [&](Simulation& motion) {
    motion.reset();
    motion.advanceTo(duration);
    motion.sample();
  };
  // Runs of each motion in a round, since a sweep of many rows makes its fibers once.
  constexpr int kRuns = 256;
  using Clock = std::chrono::steady_clock;
  double in_turn = 1e9;
  double at_once = 1e9;
  for (int round = 0; round < 12; ++round) {
    for (auto& motion : motions) motion->makeStepsWith(nullptr);
    const auto begin = Clock::now();
    for (int run = 0; run < kRuns; ++run) {
      for (auto& motion : motions) play(*motion);
    }
    const auto middle = Clock::now();
    for (auto& motion : motions) motion->makeStepsWith(&fibers);
    int next = 0;
    fibers.run([&] {
      Simulation& motion = *motions[static_cast<std::size_t>(next++)];
      for (int run = 0; run < kRuns; ++run) play(motion);
    });
    const auto end = Clock::now();
    in_turn = std::min(in_turn, std::chrono::duration<double>(middle - begin).count());
    at_once = std::min(at_once, std::chrono::duration<double>(end - middle).count());
  }
  std::printf("%d %.2f %.2f\n", kMotions, 1e6 * in_turn / kRuns, 1e6 * at_once / kRuns);
}
