// The cost of one right-hand side, its growth with the scene, and the savings of each skip.
//
// Alone: Google Benchmark over the right-hand sides. With --output: the rows of the tables of
// doc/benchmarks.md, which says what each of them means. There the variants of a table run in turn,
// in short blocks, because a processor's clock changes from one moment to the next: only ratios
// within a round can be compared.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "dynamics/system.h"
#include "motion/motion.h"
#include "peers/method.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"

#ifndef VARIATOR_SIM_BENCHMARK_FLAGS
#define VARIATOR_SIM_BENCHMARK_FLAGS "unknown"
#endif

namespace variator_sim::benchmark {
namespace {

// --- scenes ----------------------------------------------------------------------------------

Scene read(const std::string& text) {
  BuiltinComponentFactory factory;
  return readScene(readYamlText(text, "scene"), factory);
}

std::string number(int value) {
  return std::to_string(value);
}

/// A motor of Kloss's characteristic, or a load of the speed's square, on shaft `i` (from 1).
std::string torqueText(int i) {
  const bool is_motor = i % 2 == 1;
  const std::string w = "w" + number(i);
  const std::string slip = "((50-" + w + ")/50)";
  return "q" + number(i) + ": {shaft: s" + number(i) +
         ", type: variator_sim/ExpressionTorque, torque: \"" +
         (is_motor ? "12*" + slip + "/(" + slip + "^2+0.04)" : "-0.02*" + w + "^2") + "\"}\n";
}

/// `shafts` shafts of such torques; `constraints` lines for the constraints c1, c2, ...;
/// `harmonics` behind every mean inertia.
std::string sceneText(int shafts, const std::vector<std::string>& constraints,
                      const std::string& harmonics = "") {
  std::string names;
  std::string torque_names;
  std::string constraint_names;
  std::string velocities;
  std::string body;
  double velocity = 5.0;
  for (int i = 1; i <= shafts; ++i) {
    const std::string separator = i > 1 ? ", " : "";
    const std::string mean = i % 2 == 1 ? "0.8" : "2.0";
    names += separator + "s" + number(i);
    torque_names += separator + "q" + number(i);
    velocities += separator + std::to_string(velocity);
    velocity *= 0.5;
    body += "s" + number(i) + ": {inertia: " +
            (harmonics.empty() ? mean : "{mean: " + mean + ", harmonics: " + harmonics + "}") +
            "}\n" + torqueText(i);
  }
  for (std::size_t m = 0; m < constraints.size(); ++m) {
    const std::string name = "c" + std::to_string(m + 1);
    constraint_names += (m > 0 ? ", " : "") + name;
    body += name + ": {" + constraints[m] + "}\n";
  }
  return "shafts: [" + names + "]\ntorques: [" + torque_names + "]\nconstraints: [" +
         constraint_names + "]\ninitial: {velocity: [" + velocities + "], project: true}\n" + body;
}

std::string shipText(const std::string& harmonics = "") {
  const std::string row =
      "type: variator_sim/ExpressionConstraint, order: 2, expression: "
      "\"0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + w2-(0.6+0.2*sin(0.7*t))*w1\"";
  return sceneText(2, {row}, harmonics);
}

/// Constraints between neighbouring shafts: `line(a, b)` for each pair.
template <class Line>
std::vector<std::string> between(int count, Line line) {
  std::vector<std::string> lines;
  for (int m = 1; m <= count; ++m) lines.push_back(line(number(m), number(m + 1)));
  return lines;
}

std::string bentText(int shafts, int constraints) {
  return sceneText(shafts, between(constraints, [](const auto& a, const auto& b) {
                     return "type: variator_sim/ExpressionConstraint, order: 2, expression: "
                            "\"0.2*(e" +
                            b + "-0.6*e" + a + ")*(1+0.05*(e" + a + "^2+e" + b + "^2)) + w" + b +
                            "-0.6*w" + a + "\"";
                   }));
}

std::string slipText(int shafts, int constraints, const std::string& ratio) {
  return sceneText(shafts, between(constraints, [&](const auto& a, const auto& b) {
                     return "type: variator_sim/SlipRatio, shafts: [s" + a + ", s" + b +
                            "], time_constant: 0.2, ratio: " + ratio;
                   }));
}
/// A ratio that changes all the time, so that C is factored at every evaluation.
const char* const kTable = "{times: [0, 50, 100], values: [0.4, 0.7, 0.5]}";

// --- right-hand sides ------------------------------------------------------------------------

/// Evaluates a right-hand side so many times, each at a state that the last result has moved, as
/// the stages of a step do.
using Kernel = std::function<void(int)>;

template <class Values, class RightHandSide>
void evaluateInChain(const Values& start, int count, RightHandSide&& evaluate) {
  Values x = start;
  Values dxdt = start;
  double t = 1.0;
  for (int n = 0; n < count; ++n) {
    evaluate(x, dxdt, t);
    for (decltype(x.size()) i = 0; i < x.size(); ++i) x[i] = start[i] + 1e-5 * dxdt[i];
    t += 1e-6;
  }
  ::benchmark::DoNotOptimize(x);
}

/// The ship hand-written for this one scene, with constants known to the compiler.
[[gnu::noinline]] void calcShipByHand(const std::array<double, 6>& x, std::array<double, 6>& dxdt,
                                      double t) {
  calcDerivative(Ship<double>({}), t, x.data(), dxdt.data());
}

Kernel makeHandKernel() {
  std::array<double, 6> start{};
  Ship<double>::initial(start.data());
  return [start](int count) { evaluateInChain(start, count, calcShipByHand); };
}

/// `specialize`: by code for the number of constraints, where there is some.
Kernel makeKernel(const std::string& text, bool specialize = true) {
  struct Owner {
    Owner(Scene read_scene, const Shortcuts& shortcuts)
        : scene(std::move(read_scene)), system(scene, shortcuts) {}
    Scene scene;
    System system;
  };
  Shortcuts shortcuts;
  shortcuts.specialize = specialize;
  auto owner = std::make_shared<Owner>(read(text), shortcuts);
  State start(owner->system.size());
  double nearest[kMaxShafts] = {};
  bool velocities_at_fault = false;
  if (owner->system.start(start, nearest, &velocities_at_fault) != InitialResult::kConsistent) {
    throw std::runtime_error("a scene of the benchmark has no start");
  }
  return [owner, start](int count) {
    evaluateInChain(start, count,
                    [&](const auto& x, auto& dxdt, double t) { owner->system(x, dxdt, t); });
  };
}

struct NamedKernel {
  std::string scene;
  std::string variant;
  Kernel kernel;
};

std::vector<NamedKernel> makeShipKernels() {
  const std::string formulas = shipText();
  return {{"ship", "by hand", makeHandKernel()},
          {"ship", "formulas", makeKernel(formulas)},
          {"ship", "formulas, shafts known", makeKernel(formulas, false)}};
}

std::vector<NamedKernel> makeScalingKernels() {
  std::vector<NamedKernel> kernels;
  for (int s = 2; s <= kMaxShafts; ++s) {
    for (int k = 1; k < s && k <= 4; ++k) {
      const std::string size = number(s) + " " + number(k);
      kernels.push_back({size, "formulas", makeKernel(bentText(s, k))});
      kernels.push_back({size, "SlipRatio", makeKernel(slipText(s, k, kTable))});
    }
  }
  kernels.push_back({"2 1", "formulas, shafts known", makeKernel(bentText(2, 1), false)});
  return kernels;
}

// --- motions with and without a skip ---------------------------------------------------------

/// One way to run a scene; `run` does it once.
struct Variant {
  std::string name;
  std::unique_ptr<Simulation> simulation;
  std::function<void(Simulation&)> run;
};

/// Two ways with the same motion, the one that saves second.
struct Comparison {
  std::string skip;
  std::string scene;
  double seconds;  ///< simulated by one run
  Variant variants[2];
};

constexpr double kEnd = 20.0;  ///< s

void runFromStart(Simulation& simulation) {
  simulation.reset();
  simulation.advanceTo(kEnd);
}
void runWithSamples(Simulation& simulation) {
  simulation.reset();
  for (int n = 1; n <= 100 * static_cast<int>(kEnd); ++n) {
    simulation.advanceTo(0.01 * n);
    ::benchmark::DoNotOptimize(simulation.sample().time);
  }
}
/// From where the last run ended.
void runLong(Simulation& simulation) {
  simulation.advanceTo(simulation.time() + 1e5);
}
void runTicks(Simulation& simulation) {
  const double start = simulation.time();
  for (int n = 1; n <= 100000; ++n) simulation.advanceTo(start + 1e-3 * n);
}

using Change = std::function<void(Scene&, Shortcuts&)>;

std::unique_ptr<Simulation> makeSimulation(const std::string& text, const Change& change) {
  Scene scene = read(text);
  Shortcuts shortcuts;
  change(scene, shortcuts);
  auto simulation = std::make_unique<Simulation>(scene);
  Motion::of(*simulation) = std::make_unique<Motion>(std::move(scene), shortcuts);
  return simulation;
}

Comparison compare(const std::string& skip, const std::string& scene, const std::string& text,
                   const Change& without, const Change& with) {
  return {skip,
          scene,
          kEnd,
          {{"without", makeSimulation(text, without), runFromStart},
           {"with", makeSimulation(text, with), runFromStart}}};
}

std::vector<Comparison> makeComparisons() {
  std::vector<Comparison> list;
  const std::string ship = shipText();
  const auto add = [&](const char* skip, const std::string& name, const std::string& text,
                       bool Shortcuts::*flag, bool specialize = true) {
    for (const double tolerance : {1e-4, 1e-9}) {
      const auto set = [=](bool on) {
        return [=](Scene& scene, Shortcuts& shortcuts) {
          shortcuts.specialize = specialize;
          shortcuts.*flag = on;
          scene.solver.relative_tolerance = scene.solver.absolute_tolerance = tolerance;
        };
      };
      list.push_back(compare(skip, name + (tolerance > 1e-5 ? ", 1e-4" : ", 1e-9"), text,
                             set(false), set(true)));
    }
  };
  add("angles not stepped", "ship", ship, &Shortcuts::skip_angles);
  add("angles not stepped", "8 shafts, 4 variators", bentText(8, 4), &Shortcuts::skip_angles);
  add("shape (2, 1) compiled", "ship", ship, &Shortcuts::specialize);

  // A harmonic of amplitude 0: J is evaluated and inverted everywhere, and stays the same.
  for (const double tolerance : {1e-4, 1e-9}) {
    const auto set = [=](Scene& scene, Shortcuts& shortcuts) {
      shortcuts.specialize = shortcuts.skip_angles = false;
      scene.solver.relative_tolerance = scene.solver.absolute_tolerance = tolerance;
    };
    const std::string name = tolerance > 1e-5 ? ", 1e-4" : ", 1e-9";
    Comparison comparison =
        compare("constant inertia", "ship" + name, shipText("[{order: 1, cos: 0}]"), set, set);
    comparison.variants[1].simulation = makeSimulation(ship, set);
    list.push_back(std::move(comparison));
  }

  list.push_back(compare(
      "no acceleration state", "constant ratio",
      sceneText(2, {"type: variator_sim/KinematicRatio, shafts: [s1, s2], ratio: 0.5"}),
      [](Scene& scene, Shortcuts& /*shortcuts*/) {
        scene.principle = Principle::kGeneralizedGauss;
      },
      [](Scene& scene, Shortcuts& /*shortcuts*/) { scene.principle = Principle::kGauss; }));

  // The cost of 100 samples per second: the same stepper without and with them.
  for (const StepperKind kind : {StepperKind::kFehlberg78, StepperKind::kDopri5}) {
    const auto set = [=](Scene& scene, Shortcuts& /*shortcuts*/) { scene.solver.stepper = kind; };
    Comparison comparison = compare(
        "dense output", std::string("ship, ") + variator_sim::toString(kind), ship, set, set);
    comparison.variants[0].name = "100 samples/s";
    comparison.variants[0].run = runWithSamples;
    comparison.variants[1].name = "no samples";
    list.push_back(std::move(comparison));
  }
  return list;
}

/// A scene at rest, advanced on.
std::vector<Comparison> makeRests() {
  std::vector<Comparison> list;
  for (const bool ticks : {false, true}) {
    Comparison comparison = compare(
        "sleep", ticks ? "at rest, advanced by 1 ms" : "at rest, advanced by 1e5 s",
        slipText(2, 1, "0.6"),
        [](Scene& scene, Shortcuts& /*shortcuts*/) { scene.solver.sleep = false; },
        [](Scene& scene, Shortcuts& /*shortcuts*/) { scene.solver.sleep = true; });
    comparison.seconds = ticks ? 100.0 : 1e5;
    for (Variant& variant : comparison.variants) {
      variant.run = ticks ? runTicks : runLong;
      variant.simulation->advanceTo(1000.0);
      const bool should_sleep = variant.name == "with";
      if (variant.simulation->isSleeping() != should_sleep) {
        throw std::runtime_error("the scene at rest does not sleep as it should");
      }
    }
    list.push_back(std::move(comparison));
  }
  return list;
}

/// The largest relative difference of the two variants' states.
double calcDifference(Comparison& comparison) {
  const Sample& a = comparison.variants[0].simulation->sample();
  const Sample& b = comparison.variants[1].simulation->sample();
  const auto compare_values = [](double p, double q) {
    return std::abs(p - q) / std::max(1.0, std::abs(p));
  };
  double largest = 0.0;
  for (int i = 0; i < comparison.variants[0].simulation->scene().shaftCount(); ++i) {
    largest = std::max({largest, compare_values(a.angle[i], b.angle[i]),
                        compare_values(a.velocity[i], b.velocity[i]),
                        compare_values(a.acceleration[i], b.acceleration[i])});
  }
  return largest;
}

// --- measuring -------------------------------------------------------------------------------

struct Times {
  double median = 0.0;   ///< s per block
  double minimum = 0.0;  ///< s per block
};

double calcMedian(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// All blocks in turn, `rounds` times, after one round that is not counted.
std::vector<Times> measureInTurn(const std::vector<std::function<void()>>& blocks, int rounds) {
  using Clock = std::chrono::steady_clock;
  std::vector<std::vector<double>> seconds(blocks.size());
  for (int round = -1; round < rounds; ++round) {
    for (std::size_t n = 0; n < blocks.size(); ++n) {
      const auto start = Clock::now();
      blocks[n]();
      if (round >= 0) seconds[n].push_back(secondsSince(start));
    }
  }
  std::vector<Times> times;
  for (const std::vector<double>& list : seconds) {
    times.push_back({calcMedian(list), *std::min_element(list.begin(), list.end())});
  }
  return times;
}

struct Options {
  std::string output;
  std::string commit = "unknown";
  bool quick = false;
};

void printHead(std::ostream& out, const Options& options) {
  std::ifstream file("/proc/cpuinfo");
  std::string processor = "unknown";
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("model name", 0) != 0) continue;
    processor = line.substr(line.find(':') + 2);
    break;
  }
  char date[32];
  const std::time_t now = std::time(nullptr);
  std::strftime(date, sizeof(date), "%Y-%m-%d", std::gmtime(&now));
  out << "# processor: " << processor << '\n'
      << "# cores: " << std::thread::hardware_concurrency() << '\n'
      << "# compiler: g++ " << __VERSION__ << ", " << VARIATOR_SIM_BENCHMARK_FLAGS << '\n'
      << "# date: " << date << '\n'
      << "# commit: " << options.commit << '\n'
      << "# run: " << (options.quick ? "quick" : "full") << '\n'
      << "table,scene,variant,unit,median,minimum,steps,difference\n";
}

/// One line of the output. `steps` and `difference`: "" where they mean nothing.
void printRow(std::ostream& out, const std::string& table, const std::string& scene,
              const std::string& variant, const char* unit, const Times& times, double scale,
              const std::string& steps = "", const std::string& difference = "") {
  char numbers[64];
  std::snprintf(numbers, sizeof(numbers), "%.6g,%.6g", times.median * scale, times.minimum * scale);
  out << "\"" << table << "\",\"" << scene << "\",\"" << variant << "\"," << unit << ',' << numbers
      << ',' << steps << ',' << difference << '\n';
}

void measureKernels(const std::string& table, const std::vector<NamedKernel>& kernels, int count,
                    int rounds, std::ostream& out) {
  std::vector<std::function<void()>> blocks;
  for (const NamedKernel& entry : kernels) {
    blocks.push_back([&entry, count] { entry.kernel(count); });
  }
  const std::vector<Times> times = measureInTurn(blocks, rounds);
  for (std::size_t n = 0; n < kernels.size(); ++n) {
    printRow(out, table, kernels[n].scene, kernels[n].variant, "ns", times[n], 1e9 / count);
  }
}

void measureComparisons(std::vector<Comparison> comparisons, int rounds, std::ostream& out) {
  std::vector<std::function<void()>> blocks;
  for (Comparison& comparison : comparisons) {
    for (Variant& variant : comparison.variants) {
      blocks.push_back([&variant] { variant.run(*variant.simulation); });
    }
  }
  const std::vector<Times> times = measureInTurn(blocks, rounds);
  for (std::size_t n = 0; n < comparisons.size(); ++n) {
    Comparison& comparison = comparisons[n];
    char difference[32];
    std::snprintf(difference, sizeof(difference), "%.1e", calcDifference(comparison));
    for (std::size_t v = 0; v < 2; ++v) {
      const Variant& variant = comparison.variants[v];
      if (!variant.simulation->status().ok()) {
        throw std::runtime_error(toString(variant.simulation->status().reason));
      }
      // A motion that goes on and on counts all its runs' steps.
      const bool restarts = comparison.skip != "sleep";
      printRow(out, comparison.skip, comparison.scene, variant.name, "us/s", times[2 * n + v],
               1e6 / comparison.seconds,
               restarts ? std::to_string(variant.simulation->statistics().steps) : "", difference);
    }
  }
}

int measure(const Options& options) {
  std::ofstream out(options.output);
  if (!out) throw std::runtime_error(options.output + " cannot be written");
  printHead(out, options);
  const int rounds = options.quick ? 40 : 200;
  measureKernels("ship", makeShipKernels(), 20000, rounds, out);
  measureKernels("scaling", makeScalingKernels(), 1000, rounds, out);
  measureComparisons(makeComparisons(), rounds / 2, out);
  measureComparisons(makeRests(), options.quick ? 3 : 11, out);
  return 0;
}

void registerKernels() {
  std::vector<NamedKernel> kernels = makeShipKernels();
  for (NamedKernel& entry : makeScalingKernels()) kernels.push_back(std::move(entry));
  for (const NamedKernel& entry : kernels) {
    ::benchmark::RegisterBenchmark((entry.scene + "/" + entry.variant).c_str(),
                                   [kernel = entry.kernel](::benchmark::State& state) {
                                     constexpr int kBatch = 1000;
                                     while (state.KeepRunningBatch(kBatch)) kernel(kBatch);
                                   });
  }
}

/// False on bad usage. Options of Google Benchmark are left for it.
bool readOptions(int argc, char** argv, Options* options) {
  const std::map<std::string, std::string*> texts = {{"--output", &options->output},
                                                     {"--commit", &options->commit}};
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto text = texts.find(argument);
    if (argument == "--quick") {
      options->quick = true;
    } else if (text != texts.end() && i + 1 < argc) {
      *text->second = argv[++i];
    } else if (argument.rfind("--benchmark_", 0) != 0) {
      std::cerr << "kernel_benchmark: '" << argument << "' is not an option or lacks its value\n";
      return false;
    }
  }
  return true;
}

}  // namespace
}  // namespace variator_sim::benchmark

int main(int argc, char** argv) {
  using namespace variator_sim::benchmark;  // NOLINT(google-build-using-namespace)
  Options options;
  if (!readOptions(argc, argv, &options)) {
    std::cerr << "Usage: kernel_benchmark [--benchmark_filter=TEXT ...]\n"
                 "       kernel_benchmark --output FILE.csv [--quick] [--commit TEXT]\n";
    return 2;
  }
  try {
    if (!options.output.empty()) return measure(options);
    registerKernels();
    ::benchmark::Initialize(&argc, argv);
    ::benchmark::RunSpecifiedBenchmarks();
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "kernel_benchmark: " << error.what() << '\n';
    return 1;
  }
}
