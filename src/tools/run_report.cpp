#include "tools/run_report.h"

#include <cstdio>
#include <string>

#include "model/number_text.h"

namespace variator_sim {
void printStatistics(Simulation& simulation, bool tracks_energy, const WallTimes& wall,
                     std::uint64_t samples) {
  const Statistics& counts = simulation.statistics();
  const auto print = [](const char* name, std::uint64_t count) {
    std::fprintf(stderr, "%s: %llu\n", name, static_cast<unsigned long long>(count));
  };
  std::fprintf(stderr, "stepper: %s\n", simulation.describeStepper().c_str());
  const std::string skips = join(simulation.skips(), "; ");
  std::fprintf(stderr, "formulas by: %s\n", simulation.machineCode().c_str());
  if (const std::string companion = simulation.describeErrorEstimate(); !companion.empty()) {
    std::fprintf(stderr, "errors estimated by: %s\n", companion.c_str());
  }
  std::fprintf(stderr, "not computed: %s\n", skips.empty() ? "-" : skips.c_str());
  print("steps", counts.steps);
  if (counts.implicit_steps > 0) print("implicit steps", counts.implicit_steps);
  if (isFixedStep(simulation.scene().solver.stepper)) {
    std::fprintf(stderr, "largest error estimate: %.6g of the tolerance\n",
                 counts.largest_error_estimate);
  }
  if (counts.largest_rounding > 0.0) {
    std::fprintf(stderr, "rounding: %.3g tolerances (what it makes of a step's end at the most)\n",
                 counts.largest_rounding);
  }
  print("rejected steps", counts.rejected_steps);
  print("right-hand sides", counts.right_hand_sides);
  print("projections", counts.projections);
  print("Newton iterations", counts.newton_iterations);
  print("jumps", counts.jumps);
  if (!simulation.scene().events.empty()) {
    print("changes of modes and events", counts.mode_changes);
  } else if (!simulation.scene().holdNames().empty()) {
    print("changes of modes", counts.mode_changes);
  }
  if (counts.sleeps > 0) print("times come to rest", counts.sleeps);
  print("commands accepted", counts.commands_accepted);
  print("commands clamped", counts.commands_clamped);
  print("commands refused", counts.commands_refused);
  print("samples", samples);
  std::fprintf(stderr, "simulated time: %.6g s\n", simulation.time());
  const Energy energy = simulation.energy();
  const char* const note = tracks_energy ? "" : " (estimated; --energy integrates it)";
  std::fprintf(stderr, "kinetic energy change: %.6g J\n", energy.applied + energy.reactions);
  std::fprintf(stderr, "energy of the applied torques: %.6g J%s\n", energy.applied, note);
  std::fprintf(stderr, "energy of the reactions: %.6g J%s\n", energy.reactions, note);
  const double stepping = wall.simulation - wall.sampling;
  const auto speed = [&](double seconds) {
    return seconds > 0.0 ? simulation.time() / seconds : 0.0;
  };
  std::fprintf(stderr, "wall time: %.6g s\n", stepping);
  std::fprintf(stderr, "sampling wall time: %.6g s\n", wall.sampling);
  std::fprintf(stderr, "output wall time: %.6g s\n", wall.output);
  std::fprintf(stderr, "times real time: %.6g\n", speed(stepping));
  std::fprintf(stderr, "times real time with samples: %.6g\n", speed(wall.simulation));
}

}  // namespace variator_sim
