// Work against precision: our steppers beside general solvers, on hand-written scenes for those.
// doc/evidence.md explains the measurement.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "peers/error.h"
#include "peers/method.h"
#include "work_precision_references.h"
#ifdef VARIATOR_SIM_WITH_SUNDIALS
#include <sundials/sundials_config.h>
#endif
#ifdef VARIATOR_SIM_WITH_GSL
#include <gsl/gsl_version.h>
#endif
#include <boost/version.hpp>

#ifndef VARIATOR_SIM_BENCHMARK_FLAGS
#define VARIATOR_SIM_BENCHMARK_FLAGS "unknown"
#endif

namespace variator_sim::benchmark {

std::vector<SceneCase> allScenes() {
  std::vector<SceneCase> scenes;
  const auto add = [&scenes](const char* name, bool quick, const char* commands = "") {
    SceneCase scene;
    scene.name = scene.file = name;
    scene.in_quick = quick;
    scene.commands = commands;
    scenes.push_back(scene);
  };
  add("ship", true);
  add("smooth_linear", false);
  add("acceleration_circle", false);
  add("torque_steps", true, "torque_steps");
  add("four_shafts", true);
  add("crank", false);
  add("order1", false);
  add("order3", false);
  const auto add_stiff = [&scenes](const std::string& tau, bool slips, bool quick) {
    SceneCase scene;
    scene.file = slips ? "stiff_start" : "stiff_slip";
    scene.name = slips ? scene.file : scene.file + "_" + tau;
    scene.tau = std::stod(tau);
    scene.parameters = {std::stold(tau), slips};
    scene.stiff = true;
    scene.in_quick = quick;
    scenes.push_back(scene);
  };
  for (const char* tau : {"1e-1", "1e-2", "1e-3", "1e-4", "1e-5", "1e-6", "1e-7", "1e-8"}) {
    add_stiff(tau, false, std::string(tau) == "1e-3");
  }
  add_stiff("5e-4", true, false);
  return scenes;
}

namespace {

using WallClock = std::chrono::steady_clock;

constexpr double kTimeOut = 2.0;  ///< s, of one run
/// s: what takes longer is run at 1e-3, 1e-7, 1e-11 only, so that the whole takes minutes.
constexpr double kSlow = 0.15;
constexpr double kShort = 2e-3;  ///< s: up to here the wall clock counts

struct Options {
  std::string scenes = "benchmark/scenes";
  std::string references = "benchmark/references.csv";
  std::string output;
  std::string commit = "unknown";
  std::string only_scene;
  std::string only_method;
  bool make_references = false;
  bool check = false;
  bool quick = false;
};

void printUsage() {
  std::cerr << "Usage: work_precision [--quick] [--output FILE.csv] [--scene NAME] "
               "[--method TEXT]\n"
               "                      [--scenes FOLDER] [--references FILE.csv] [--commit TEXT]\n"
               "       work_precision --make-references | --check\n\n"
               "  --quick             few scenes, few tolerances\n"
               "  --output            where the rows go; default: standard output\n"
               "  --scene             only scenes whose name begins so\n"
               "  --method            only methods whose name contains it\n"
               "  --scenes            default benchmark/scenes\n"
               "  --references        default benchmark/references.csv\n"
               "  --commit            written into the head of the output\n"
               "  --make-references   computes the references and writes their file\n"
               "  --check             checks the hand-written scenes against each other and the "
               "core\n";
}

/// False on bad usage.
bool readOptions(int argc, char** argv, Options* options) {
  const std::map<std::string, std::string*> texts = {
      {"--scenes", &options->scenes},    {"--references", &options->references},
      {"--output", &options->output},    {"--commit", &options->commit},
      {"--scene", &options->only_scene}, {"--method", &options->only_method}};
  const std::map<std::string, bool*> flags = {{"--make-references", &options->make_references},
                                              {"--check", &options->check},
                                              {"--quick", &options->quick}};
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto flag = flags.find(argument);
    const auto text = texts.find(argument);
    if (flag != flags.end()) {
      *flag->second = true;
    } else if (text != texts.end() && i + 1 < argc) {
      *text->second = argv[++i];
    } else {
      std::cerr << "work_precision: '" << argument << "' is not an option or lacks its value\n";
      return false;
    }
  }
  return true;
}

std::string readProcessorName() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line)) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown";
}

void printHead(std::ostream& out, const Options& options) {
  char date[32];
  const std::time_t now = std::time(nullptr);
  std::strftime(date, sizeof(date), "%Y-%m-%d", std::gmtime(&now));
  out << "# processor: " << readProcessorName() << '\n'
      << "# cores: " << std::thread::hardware_concurrency() << '\n'
      << "# compiler: g++ " << __VERSION__ << ", " << VARIATOR_SIM_BENCHMARK_FLAGS << '\n'
      << "# date: " << date << '\n'
      << "# commit: " << options.commit << '\n'
      << "# run: " << (options.quick ? "quick" : "full") << '\n'
      << "# Boost.Odeint: " << BOOST_VERSION / 100000 << '.' << BOOST_VERSION / 100 % 1000 << '.'
      << BOOST_VERSION % 100 << '\n';
#ifdef VARIATOR_SIM_WITH_SUNDIALS
  out << "# SUNDIALS: " << SUNDIALS_VERSION << '\n';
#endif
#ifdef VARIATOR_SIM_WITH_GSL
  out << "# GSL: " << GSL_VERSION << '\n';
#endif
  out << "scene,method,form,tolerance,error,milliseconds,right_hand_sides,steps,status\n";
}

Methods makeMethods(const SceneCase& scene, const Options& options) {
  Methods methods;
  addOurMethods(scene, options.scenes, methods);
  addOdeintMethods(scene, methods);
#ifdef VARIATOR_SIM_WITH_SUNDIALS
  addSundialsMethods(scene, methods);
#endif
#ifdef VARIATOR_SIM_WITH_GSL
  addGslMethods(scene, methods);
#endif
  const auto unwanted = [&options](const std::unique_ptr<Method>& method) {
    return method->name().find(options.only_method) == std::string::npos;
  };
  methods.erase(std::remove_if(methods.begin(), methods.end(), unwanted), methods.end());
  return methods;
}

std::string keyOf(const Method& method) {
  return method.name() + ", " + method.form();
}

/// One line of the output.
struct Row {
  Method* method = nullptr;
  Outcome outcome;
  double error = 0.0;
  double best = std::nan("");  ///< s
  double guarded = 0.0;        ///< s, of the warm-up
  bool timed = false;          ///< best is of another run than the warm-up
};

/// All methods of one scene at one tolerance, interleaved.
class Measurement {
 public:
  Measurement(const Options& options, const SceneCase& scene, const Reference& reference)
      : options_(options), scene_(scene), reference_(reference) {}

  /// `too_slow`: methods that timed out before, with less work than is asked for now. Slow methods
  /// are left out unless `for_slow_ones_too`.
  void run(Methods& methods, double tolerance, bool for_slow_ones_too,
           std::set<std::string>* too_slow, std::set<std::string>* refused, std::ostream& out) {
    std::vector<Row> rows;
    for (const auto& method : methods) {
      const std::string key = keyOf(*method);
      if (refused->count(key) > 0 || (last_[key] > kSlow && !for_slow_ones_too)) continue;
      Row row;
      row.method = method.get();
      if (too_slow->count(key) > 0) {
        row.outcome.status = "not run: timed out with less work";
      } else {
        const std::string fault = method->prepare(tolerance);
        if (!fault.empty()) {
          std::cerr << "  " << key << ": left out: " << fault << '\n';
          refused->insert(key);
          continue;
        }
        warmUp(&row);
        if (row.outcome.status == "time-out") too_slow->insert(key);
      }
      rows.push_back(row);
    }
    // The machine's other work comes and goes: rounds over all methods, the least time counts.
    const int rounds = options_.quick ? 2 : 3;
    for (int round = 0; round < rounds; ++round) {
      for (Row& row : rows) {
        if (row.outcome.status == "ok") repeat(&row);
      }
    }
    for (const Row& row : rows) {
      if (row.best > 0.0) last_[keyOf(*row.method)] = row.best;
      print(row, tolerance, out);
    }
  }

 private:
  void warmUp(Row* row) const {
    const auto start = ProcessorClock::now();
    const bool good = row->method->runGuarded(kTimeOut);
    row->guarded = row->best = secondsSince(start);
    row->outcome = row->method->outcome();
    if (!good && row->outcome.status == "ok") row->outcome.status = "failed";
    row->error =
        calcError(row->outcome.state.data(), reference_.state.data(), reference_.state.size());
    if (row->outcome.status == "ok" && !std::isfinite(row->error)) {
      row->outcome.status = "not finite";
    }
  }
  /// For 10 ms, or once where that is longer; what takes half a second was timed by the warm-up.
  /// Runs of microseconds are timed several at once: asking for the time takes a part of one.
  void repeat(Row* row) const {
    if (row->guarded > 0.5) return;
    if (!row->timed) row->best = std::numeric_limits<double>::infinity();
    row->timed = true;
    const int runs = 1 + static_cast<int>(1e-4 / std::max(row->guarded, 1e-6));
    const auto start = WallClock::now();
    do {
      const auto begin_work = ProcessorClock::now();
      const auto begin = WallClock::now();
      for (int run = 0; run < runs; ++run) row->method->run();
      const double elapsed = secondsSince(begin);
      // A short time is undisturbed sooner or later, and the least one is taken; a long one is
      // interrupted always. The processor's clock may step back a little, which only a long time
      // does not feel.
      const double counted = elapsed < kShort ? elapsed : secondsSince(begin_work);
      row->best = std::min(row->best, counted / runs);
    } while (secondsSince(start) < 0.01);
  }
  void print(const Row& row, double tolerance, std::ostream& out) const {
    char text[256];
    const bool good = row.outcome.status == "ok";
    std::snprintf(text, sizeof(text), "%.0e,%.3e,%.5f,%llu,%llu", tolerance,
                  good ? row.error : std::nan(""), 1e3 * row.best,
                  static_cast<unsigned long long>(row.outcome.right_hand_sides),
                  static_cast<unsigned long long>(row.outcome.steps));
    out << scene_.name << ',' << row.method->name() << ',' << row.method->form() << ',' << text
        << ',' << row.outcome.status << '\n';
  }

  const Options& options_;
  const SceneCase& scene_;
  const Reference& reference_;
  std::map<std::string, double> last_;  ///< s, of each method at the last tolerance it ran at
};

int makeReferences(const Options& options) {
  std::map<std::string, Reference> references;
  for (const SceneCase& scene : allScenes()) references[scene.name] = makeReference(scene);
  writeReferences(options.references, allScenes(), references);
  return 0;
}

/// The peers' formulas against dual numbers, and the package's accelerations after a short time
/// against the peers': prints the largest differences. 1 when one is too large.
int check(const Options& options) {
  int faults = 0;
  const auto references = readReferences(options.references);
  for (const SceneCase& scene : allScenes()) {
    double jacobian_difference = 0.0;
    visitScene(scene, [&](auto tag) {
      using Tag = decltype(tag);
      using Scene = typename Tag::template Of<double>;
      constexpr int N = 3 * Scene::kShafts;
      if constexpr (HasHandJacobian<Scene>::value) {
        const Scene hand(scene.parameters);
        double x[N] = {0.3, 0.2, 7.0, 4.0, 3.0, 1.5};
        double a[N * N];
        double b[N * N];
        double at[N];
        double bt[N];
        calcJacobian<Tag::template Of>(hand, scene.parameters, 0.8, x, a, at);
        calcJacobian<Tag::template Of>(hand, scene.parameters, 0.8, x, b, bt, false);
        const auto compare = [&](const double* values, const double* exact, int count) {
          for (int i = 0; i < count; ++i) {
            const double difference = std::abs(values[i] - exact[i]) / (1.0 + std::abs(exact[i]));
            jacobian_difference = std::max(jacobian_difference, difference);
          }
        };
        compare(a, b, N * N);
        compare(at, bt, N);
      }
    });
    std::printf("%-22s Jacobian %.1e\n", scene.name.c_str(), jacobian_difference);
    if (!(jacobian_difference < 1e-12)) ++faults;
    if (scene.tau > 0.0 && scene.tau < 1e-3) continue;
    for (const auto& method : makeMethods(scene, options)) {
      if (!method->prepare(1e-10).empty()) continue;
      const bool good = method->runGuarded(kTimeOut);
      const Outcome outcome = method->outcome();
      const std::vector<long double>& exact = references.at(scene.name).state;
      const double error = calcError(outcome.state.data(), exact.data(), exact.size());
      std::printf("    %-42s %-9s %s %.1e\n", method->name().c_str(), method->form().c_str(),
                  outcome.status.c_str(), error);
      if (good && !(error < 1e-4)) ++faults;
    }
  }
  std::printf("%d faults\n", faults);
  return faults == 0 ? 0 : 1;
}

int measure(const Options& options) {
  const auto references = readReferences(options.references);
  std::ofstream file;
  if (!options.output.empty()) file.open(options.output);
  std::ostream& out = options.output.empty() ? std::cout : file;
  printHead(out, options);
  std::set<std::string> refused;
  std::set<std::string> too_slow_before;  // at a larger tau
  const int first = 3;
  const int last = 13;
  for (const SceneCase& scene : allScenes()) {
    if (scene.name.rfind(options.only_scene, 0) != 0) continue;
    if (options.quick && options.only_scene.empty() && !scene.in_quick) continue;
    const auto start = WallClock::now();
    if (scene.parameters.slips_at_start) too_slow_before.clear();
    std::set<std::string> too_slow = too_slow_before;
    Methods methods = makeMethods(scene, options);
    Measurement measurement(options, scene, references.at(scene.name));
    for (int exponent = first; exponent <= last; exponent += options.quick ? 3 : 1) {
      measurement.run(methods, std::strtod(("1e-" + std::to_string(exponent)).c_str(), nullptr),
                      options.quick || exponent % 4 == 3, &too_slow, &refused, out);
      // Stability bounds the step of what times out at the loosest tolerance: a smaller tau
      // takes still longer.
      if (scene.stiff && exponent == first) too_slow_before = too_slow;
    }
    out.flush();
    std::fprintf(stderr, "%-22s %.1f s\n", scene.name.c_str(), secondsSince(start));
  }
  return 0;
}

}  // namespace
}  // namespace variator_sim::benchmark

int main(int argc, char** argv) {
  using namespace variator_sim::benchmark;  // NOLINT(google-build-using-namespace)
  Options options;
  if (!readOptions(argc, argv, &options)) {
    printUsage();
    return 2;
  }
  try {
    if (options.make_references) return makeReferences(options);
    if (options.check) return check(options);
    return measure(options);
  } catch (const std::exception& error) {
    std::cerr << "work_precision: " << error.what() << '\n';
    return 1;
  }
}
