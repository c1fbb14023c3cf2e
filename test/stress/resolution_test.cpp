// Features narrower than a step: bumps, steps and periods of every kind that a series or a
// polynomial of an argument does not show where a step begins. Each scene is right within its
// tolerance, or stops by name.
//
//     resolution_test SEED   plays one scene and prints it
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "emit_c/emit_c.h"
#include "io/text_file.h"
#include "stress/bumpy_scene.h"
#include "stress/methods.h"
#include "support/machine_code_folder.h"

namespace variator_sim::test {
namespace {

/// Tolerances that a motion may be off by, beside what the motion makes of a start that is off by
/// one.
constexpr double kGenerous = 1000.0;

double calcError(const std::vector<Sample>& samples, const std::vector<Sample>& reference,
                 const BumpyScene& scene) {
  double worst = 0.0;
  for (std::size_t n = 0; n < std::min(samples.size(), reference.size()); ++n) {
    const auto compare = [&](double x, double y) {
      const double unit = scene.tolerance + 0.1 * scene.rounding();
      const double error = std::abs(x - y) / (unit * (1.0 + std::abs(y)));
      worst = error <= worst ? worst : error == error ? error : HUGE_VAL;
    };
    compare(samples[n].angle[0], reference[n].angle[0]);
    compare(samples[n].velocity[0], reference[n].velocity[0]);
    if (scene.order > 0) compare(samples[n].velocity[1], reference[n].velocity[1]);
  }
  return worst;
}

struct Verdict {
  std::string kind;  ///< "right", "wrong", "refused", "unknown", or the name of a stop
  double error = 0.0;
  double allowed = kGenerous;
  std::string message;
};

Verdict judge(const BumpyScene& scene, const std::vector<Sample>& samples,
              std::vector<Sample> reference) {
  Verdict verdict;
  verdict.error = calcError(samples, reference, scene);
  verdict.kind = "right";
  if (verdict.error <= verdict.allowed) return verdict;
  const std::vector<Sample> moved = scene.reference(scene.tolerance);
  verdict.allowed *= 1.0 + calcError(moved, reference, scene);
  if (moved.empty()) verdict.kind = "unknown";
  if (verdict.error <= verdict.allowed) return verdict;
  // The reference may be the one that is off: it is sure where shorter steps do not move it.
  for (const double fineness : {0.25, 0.0625, 0.015625}) {
    const std::vector<Sample> finer = scene.reference(0.0, fineness);
    verdict.kind = "unknown";
    if (finer.empty()) return verdict;
    const double moves = calcError(reference, finer, scene);
    reference = finer;
    verdict.error = calcError(samples, reference, scene);
    if (!(moves <= 0.1 * verdict.allowed)) continue;
    verdict.kind = verdict.error <= verdict.allowed ? "right" : "wrong";
    return verdict;
  }
  verdict.message = "the reference moves with its steps";
  return verdict;
}

/// The execution path of formulas and steps.
enum class Means { kInterpreter, kKernel, kEmitted };

/// The emitted program, compiled, up to where it stops.
test::Run playEmitted(Simulation& simulation, const BumpyScene& bumpy) {
  std::string folder = (std::filesystem::temp_directory_path() / "resolution_XXXXXX").string();
  EXPECT_NE(::mkdtemp(folder.data()), nullptr);
  writeEmittedScene(emitScene(simulation, "bumpy", "bumpy.yaml"), folder);
  std::ofstream(folder + "/commands.csv") << bumpy.csv();
  const std::string line = "cd " + folder + " && make -s >log 2>&1 && ./bumpy_play --duration " +
                           plainly(bumpy.end) + " --rate " + plainly(4.0 / bumpy.end) +
                           " --commands commands.csv --output motion.csv 2>>log";
  test::Run run;
  if (std::system(line.c_str()) != 0) {
    run.reason = StopReason::kStepUnderflow;  // whatever it is: the message says
    readTextFile(folder + "/log", &run.message);
  }
  std::ifstream file(folder + "/motion.csv");
  std::string text;
  std::getline(file, text);
  // time, then angle, velocity, acceleration, torques and rate of each shaft
  while (std::getline(file, text)) {
    std::istringstream row(text);
    std::vector<double> values;
    for (std::string cell; std::getline(row, cell, ',');)
      values.push_back(std::strtod(cell.c_str(), nullptr));
    if (values.size() < 7 || values[0] == 0.0) continue;
    Sample sample;
    sample.time = values[0];
    sample.angle[0] = values[1];
    sample.velocity[0] = values[2];
    if (bumpy.order > 0) sample.velocity[1] = values[8];
    run.samples.push_back(sample);
  }
  EXPECT_TRUE(!run.samples.empty() || run.reason != StopReason::kNone) << line;
  std::filesystem::remove_all(folder);
  return run;
}

Verdict examine(const BumpyScene& bumpy, Means means = Means::kInterpreter) {
  const std::vector<Sample> reference = bumpy.reference();
  if (reference.empty()) return {"unknown", 0.0, kGenerous, ""};
  Verdict verdict;
  try {
    Scene scene = sceneFromText(bumpy.yaml());
    scene.solver.machine_code =
        means == Means::kKernel ? MachineCode::kAlways : MachineCode::kNever;
    if (!takes(scene, scene.solver.stepper)) scene.solver.stepper = StepperKind::kAuto;
    Simulation simulation(scene);
    std::vector<test::Run> runs;
    if (means == Means::kEmitted) {
      runs.push_back(playEmitted(simulation, bumpy));
    } else if (means != Means::kKernel || simulation.loadMachineCode(true)) {
      runs.push_back(play(simulation, bumpy.times(), bumpy.commands));
    }
    if (runs.empty()) return {"no machine code", 0.0, kGenerous, simulation.machineCode()};
    for (const test::Run& run : runs) {
      verdict = judge(bumpy, run.samples, reference);
      if (verdict.kind != "right") return verdict;
      if (run.reason != StopReason::kNone) {
        return {toString(run.reason), verdict.error, verdict.allowed, run.message};
      }
    }
  } catch (const SceneError& error) {
    const bool is_of_c = std::string(error.what()).find("written as C") != std::string::npos;
    return {is_of_c ? "not written as C" : "refused", 0.0, kGenerous, error.what()};
  }
  return verdict;
}

/// The scene, text and reference of a known motion of `hunt`.
BumpyScene byHand(Argument argument, double scale, const Formula& formula, Feature feature) {
  BumpyScene scene;
  scene.terms.push_back({scale, formula, {feature}, argument});
  return scene;
}

TEST(BumpyReference, KnowsMotionsThatOthersHaveComputed) {
  const Formula X = variable();
  BumpyScene power_of_sine =
      byHand(Argument::kAngle, 5.0, power(call("sin", X), 1000), {0.5 * kPi, 0.03, kPi});
  power_of_sine.velocity = 2.0;
  power_of_sine.end = 5.0;
  EXPECT_NEAR(power_of_sine.reference().back().velocity[0], 2.677661157, 1e-9);
  BumpyScene period =
      byHand(Argument::kTime, 3.0, power(call("sin", number(2 * kPi) * X), 6), {0.25, 0.05, 0.5});
  period.velocity = 0.0;
  EXPECT_NEAR(period.reference().back().velocity[0], 2.8125, 1e-10);
  const BumpyScene argument = byHand(
      Argument::kAngle, 3.0,
      call("exp", number(0) - power(number(100) * call("sin", number(20) * X + number(1)), 2)),
      {-0.05, 0.0005, kPi / 20});
  EXPECT_NEAR(argument.reference().back().velocity[0], 1.0493009, 1e-7);
  EXPECT_NEAR(argument.reference().back().angle[0], 3.0746911, 1e-7);
  // The first of two jumps of the ratio of R1_ratio_order1_bump_missed: 2.7832 at 3 s
  BumpyScene ratio =
      byHand(Argument::kAngle, 0.5, power(call("sin", X), 1000), {0.5 * kPi, 0.03, kPi});
  std::swap(ratio.terms, ratio.ratio_terms);
  ratio.order = 1;
  ratio.base = 0.3;
  ratio.ratio = 1.0;
  EXPECT_NEAR(ratio.reference().back().velocity[0], 2.7832, 1e-4);
}

TEST(BumpyScene, IsTheSameForTheSameSeedAndCoversEveryKind) {
  EXPECT_EQ(makeBumpyScene(7).yaml(), makeBumpyScene(7).yaml());
  std::map<std::string, int> found;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    const std::string text = makeBumpyScene(seed).yaml();
    for (const char* part :
         {"exp(",        "tanh(",    "cosh(",    "atan(",      "asin(",
          "tan(",        "log(",     "sqrt(",    "if(",        "max(0",
          "phi1",        "w1",       "u",        "line(t)",    "KinematicRatio",
          "SlipRatio",   "order: 1", "order: 2", "order: 3",   "gauss",
          "generalized", "taylor",   "auto",     "rate_limit", "second_order_lag"}) {
      if (text.find(part) != std::string::npos) ++found[part];
    }
  }
  EXPECT_EQ(found.size(), 25u);
  for (const auto& [part, count] : found) EXPECT_GE(count, 5) << part;
}

void print(std::uint64_t seed, const BumpyScene& scene, const Verdict& verdict) {
  std::printf("seed %llu: %s, %.4g tolerances where %.4g are allowed %s\n%s%s",
              static_cast<unsigned long long>(seed), verdict.kind.c_str(), verdict.error,
              verdict.allowed, verdict.message.c_str(), scene.yaml().c_str(), scene.csv().c_str());
  for (const Sample& at : scene.reference()) {
    std::printf("# %.17g s: angle %.12g, velocities %.12g %.12g\n", at.time, at.angle[0],
                at.velocity[0], at.velocity[1]);
  }
  std::fflush(stdout);
}

/// Counts what became of `seeds` by `means`, prints the first of each kind that is not right, and
/// fails for each that is wrong.
void examineAll(const std::vector<std::uint64_t>& seeds, Means means, const std::string& by) {
  std::vector<Verdict> verdicts(seeds.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t n = next++; n < seeds.size(); n = next++) {
      verdicts[n] = examine(makeBumpyScene(seeds[n]), means);
      if (n % 1000 == 999 && isLongForm()) std::printf("%zu of %zu\n", n + 1, seeds.size());
    }
  };
  std::vector<std::thread> threads;
  for (unsigned n = 0; n < std::max(1u, std::thread::hardware_concurrency()); ++n) {
    threads.emplace_back(work);
  }
  for (std::thread& thread : threads) thread.join();

  Hazard hazard("inside a step", "bumps, steps and periods made at random, by " + by,
                "widths 1 to 1e-6, orders 0 to 3");
  std::map<std::string, int> counts;
  for (std::size_t n = 0; n < seeds.size(); ++n) {
    const Verdict& verdict = verdicts[n];
    const std::string label = "seed " + std::to_string(seeds[n]);
    const int of_kind = ++counts[verdict.kind];
    if (verdict.kind == "right" || verdict.kind == "wrong") {
      hazard.judge(verdict.error, label, verdict.allowed);
    } else {
      hazard.named(verdict.kind, label + ": " + verdict.message);
    }
    if (seeds.size() == 1 || (verdict.kind != "right" && of_kind <= 3)) {
      print(seeds[n], makeBumpyScene(seeds[n]), verdict);
    }
  }
  for (const auto& [kind, number] : counts) {
    std::printf("%s: %s: %d\n", by.c_str(), kind.c_str(), number);
  }
  EXPECT_EQ(counts["refused"], 0);
  if (means != Means::kInterpreter) return;
  EXPECT_LE(hazard.stops(), 2 + static_cast<int>(seeds.size()) / 50)
      << "a generator whose scenes stop shows nothing";
}

TEST(Resolution, NoBumpIsSteppedOver) {
  examineAll(givenSeeds(900, 100000), Means::kInterpreter, "the interpreter");
}

using ResolutionByMachineCode = MachineCodeFolder;

/// Compilers take a second or two for each; seed 101 is one of those that have a program.
TEST_F(ResolutionByMachineCode, NoBumpIsSteppedOver) {
  const std::vector<std::uint64_t> seeds = givenSeeds(1, 200, 101);
  examineAll(seeds, Means::kKernel, "kernels");
  examineAll(seeds, Means::kEmitted, "emitted C");
}

}  // namespace
}  // namespace variator_sim::test
