// Estimated errors of scenes made at random, against the true ones: how often an estimate is within
// a factor of ten, and what it costs. VARIATOR_SIM_STRESS_SEED chooses another first seed.

#include <atomic>
#include <cstdlib>
#include <ctime>
#include <thread>

#include "stress/methods.h"
#include "stress/random_scene.h"

namespace variator_sim::test {
namespace {

constexpr int kSamples = 50;

double processorSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Outcome of the estimates.
struct Tally {
  int scenes = 0;
  int left_out = 0;  ///< no truth, or no start
  int stopped = 0;   ///< estimates of which ended before their motion
  int doubted = 0;   ///< scenes, that errors have outgrown proportion
  std::uint64_t samples = 0;
  std::uint64_t within = 0;    ///< a factor of ten
  std::uint64_t rounding = 0;  ///< both at most 1e-14 of the column
  std::uint64_t too_small = 0;
  std::uint64_t too_large = 0;
  std::uint64_t unknown = 0;  ///< NaN
  double plain_seconds = 0.0;
  double estimated_seconds = 0.0;

  void add(const Tally& other) {
    scenes += other.scenes;
    left_out += other.left_out;
    stopped += other.stopped;
    doubted += other.doubted;
    samples += other.samples;
    within += other.within;
    rounding += other.rounding;
    too_small += other.too_small;
    too_large += other.too_large;
    unknown += other.unknown;
    plain_seconds += other.plain_seconds;
    estimated_seconds += other.estimated_seconds;
  }
  double coverage() const {
    return static_cast<double>(within + rounding) / static_cast<double>(samples);
  }
  double cost() const { return estimated_seconds / plain_seconds; }
};

void compare(double value, double exact, double estimate, double largest, Tally& tally) {
  const double error = std::abs(value - exact);
  const double rounding = 1e-14 * largest;
  ++tally.samples;
  if (std::isnan(estimate)) {
    ++tally.unknown;
  } else if (error <= rounding && estimate <= rounding) {
    ++tally.rounding;
  } else if (error > 10.0 * estimate) {
    ++tally.too_small;
  } else if (error < 0.1 * estimate) {
    ++tally.too_large;
  } else {
    ++tally.within;
  }
}

/// The same as `play`, with what it took and the doubts.
struct EstimatedRun {
  std::vector<Sample> samples;
  ErrorDoubt doubt;
  double seconds = 0.0;
};

EstimatedRun playEstimated(const Scene& scene, const std::vector<double>& times,
                           const std::vector<TimedCommand>& commands, bool with_estimates) {
  EstimatedRun run;
  Simulation simulation(scene);
  simulation.estimateErrors(with_estimates);
  const double start = processorSeconds();
  auto command = commands.begin();
  for (const double time : times) {
    for (; command != commands.end() && command->time <= time; ++command) {
      simulation.advanceTo(command->time);
      simulation.command(command->input, command->value);
    }
    simulation.advanceTo(time);
    const Sample& sample = simulation.sample();
    if (!simulation.status().ok()) break;
    run.samples.push_back(sample);
  }
  run.seconds = processorSeconds() - start;
  run.doubt = simulation.errorDoubt();
  return run;
}

std::vector<TimedCommand> commandsOf(const RandomScene& random, const Scene& scene) {
  std::vector<TimedCommand> commands;
  for (const RandomScene::Command& command : random.commands) {
    for (int i = 0; i < scene.inputCount(); ++i) {
      if (scene.inputs[static_cast<std::size_t>(i)].topic == command.topic) {
        commands.push_back({command.time, i, command.value});
      }
    }
  }
  return commands;
}

/// By a method and at a tolerance that nothing compared has.
Run playTruth(const Scene& scene, const std::vector<double>& times,
              const std::vector<TimedCommand>& commands) {
  Run truth = play(withSolver(scene, StepperKind::kFehlberg78, 1e-13), times, commands);
  if (truth.reason == StopReason::kNone) return truth;
  return play(withSolver(scene, StepperKind::kFehlberg78, 1e-12), times, commands);
}

Tally examineEstimates(const RandomScene& random, StepperKind stepper, double tolerance) {
  Tally tally;
  tally.scenes = 1;
  try {
    Scene scene = withSolver(sceneFromText(random.yaml()), stepper, tolerance);
    scene.solver.maximum_steps = 20000;
    scene.solver.machine_code = MachineCode::kNever;
    const std::vector<TimedCommand> commands = commandsOf(random, scene);
    const std::vector<double> times = evenly(random.duration, kSamples);
    const Run truth = playTruth(scene, times, commands);
    const EstimatedRun plain = playEstimated(scene, times, commands, false);
    const EstimatedRun run = playEstimated(scene, times, commands, true);
    tally.plain_seconds = plain.seconds;
    tally.estimated_seconds = run.seconds;
    tally.stopped = run.doubt.stopped >= 0.0;
    tally.doubted = run.doubt.grown >= 0.0;
    double largest[3][kMaxShafts] = {};
    const std::size_t count = std::min(run.samples.size(), truth.samples.size());
    if (count < run.samples.size()) tally.left_out = 1;
    for (std::size_t n = 0; n < count; ++n) {
      const Sample& a = run.samples[n];
      const Sample& b = truth.samples[n];
      const double* const columns[3][3] = {{a.angle, b.angle, a.angle_error},
                                           {a.velocity, b.velocity, a.velocity_error},
                                           {a.acceleration, b.acceleration, a.acceleration_error}};
      for (int c = 0; c < 3; ++c) {
        for (int i = 0; i < scene.shaftCount(); ++i) {
          largest[c][i] = std::max(largest[c][i], std::abs(columns[c][1][i]));
          compare(columns[c][0][i], columns[c][1][i], columns[c][2][i], largest[c][i], tally);
        }
      }
    }
  } catch (const SceneError&) {
    tally.left_out = 1;
  }
  return tally;
}

Tally examineMany(StepperKind stepper, double tolerance, int count) {
  const char* given = std::getenv("VARIATOR_SIM_STRESS_SEED");
  const std::uint64_t first = given != nullptr ? std::strtoull(given, nullptr, 10) : 1;
  std::vector<Tally> tallies(static_cast<std::size_t>(count));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int n = next++; n < count; n = next++) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(n);
      Tally& tally = tallies[static_cast<std::size_t>(n)];
      tally = examineEstimates(makeRandomScene(seed), stepper, tolerance);
      if (tally.samples > 0 && tally.coverage() < 0.8) {
        std::printf("  seed %llu: coverage %.3f, %llu too small, %llu too large, %llu unknown\n",
                    static_cast<unsigned long long>(seed), tally.coverage(),
                    static_cast<unsigned long long>(tally.too_small),
                    static_cast<unsigned long long>(tally.too_large),
                    static_cast<unsigned long long>(tally.unknown));
      }
    }
  };
  std::vector<std::thread> threads;
  for (unsigned n = 0; n < std::max(1u, std::thread::hardware_concurrency()); ++n) {
    threads.emplace_back(work);
  }
  for (std::thread& thread : threads) thread.join();
  Tally sum;
  for (const Tally& tally : tallies) sum.add(tally);
  std::printf(
      "%s at %g: %d scenes (%d cut short for want of a truth), %llu estimates: %.2f %% within a "
      "factor of ten (%.2f %% at rounding, both), %.2f %% too small, %.2f %% too large, %.2f %% "
      "unknown; %d scenes doubted, %d ended; cost %.2f plain runs\n",
      toString(stepper), tolerance, sum.scenes, sum.left_out,
      static_cast<unsigned long long>(sum.samples), 100.0 * sum.coverage(),
      100.0 * static_cast<double>(sum.rounding) / static_cast<double>(sum.samples),
      100.0 * static_cast<double>(sum.too_small) / static_cast<double>(sum.samples),
      100.0 * static_cast<double>(sum.too_large) / static_cast<double>(sum.samples),
      100.0 * static_cast<double>(sum.unknown) / static_cast<double>(sum.samples), sum.doubted,
      sum.stopped, sum.cost());
  std::fflush(stdout);
  return sum;
}

TEST(ErrorEstimates, AreWithinAFactorOfTenOnRandomScenes) {
  const Tally tally = examineMany(StepperKind::kAuto, 1e-9, sizeOf(40, 1000));
  EXPECT_GE(tally.coverage(), 0.95);
  EXPECT_LT(tally.left_out, sizeOf(40, 1000) / 5);
  // (Times of a few milliseconds tell nothing.)
  if (isLongForm()) {
    EXPECT_LE(tally.cost(), 3.0);
  }
}

TEST(ErrorEstimates, AreSoByEveryStepper) {
  for (const double tolerance : {1e-5, 1e-7, 1e-11}) {
    const Tally tally = examineMany(StepperKind::kAuto, tolerance, sizeOf(10, 200));
    EXPECT_GE(tally.coverage(), 0.9) << tolerance;
  }
  for (const StepperKind stepper :
       {StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau, StepperKind::kRk4,
        StepperKind::kTaylorFixed}) {
    const Tally tally = examineMany(stepper, 1e-8, sizeOf(6, 100));
    EXPECT_GE(tally.coverage(), 0.9) << toString(stepper);
  }
}

}  // namespace
}  // namespace variator_sim::test
