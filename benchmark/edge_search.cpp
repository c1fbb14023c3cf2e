/// The cost of one search for events inside a step: for steps of 0.1 s of the given scenes, with
/// their commands, each along the sampled motion.
///
/// usage: edge_search config/applications/*.yaml
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "integrate/guard_search.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::benchmark {
namespace {

constexpr double kStep = 0.1;
constexpr int kSteps = 400;
constexpr int kRepeats = 5;

/// One motion, moved from node to node, and the step that it has made last.
class Steps {
 public:
  explicit Steps(const std::string& path) : simulation_(read(path)) {
    const Scene& scene = simulation_.scene();
    std::vector<GuardPtr> guards;
    const auto add = [&guards](std::vector<GuardPtr> more) {
      guards.insert(guards.end(), more.begin(), more.end());
    };
    for (const TorquePtr& torque : scene.torques) add(torque->guards());
    for (const ConstraintPtr& constraint : scene.constraints) add(constraint->guards());
    search_.setGuards(
        std::move(guards),
        [this](double time, const double* angle, const double* velocity,
               const double* acceleration) { return viewOf(time, angle, velocity, acceleration); },
        [this](const Interval& time, Interval* inputs) { enclose(time, inputs); });
    has_accelerations_ = scene.principle == Principle::kGeneralizedGauss;
    values_.resize(simulation_.quantityNames(QuantityGroup::kInputs).size());
    commands_ = readCommandFile(path.substr(0, path.rfind('.')) + ".csv");
  }

  int guardCount() const { return search_.count(); }
  /// False where no guard can have left its branch by what the ends tell: there nothing is
  /// searched.
  void next() {
    const double begin = simulation_.time();
    curve_.begin(begin, kStep, simulation_.scene().shaftCount(), has_accelerations_);
    for (int n = 0; n < StepCurve::kNodes; ++n) {
      simulation_.advanceTo(begin + StepCurve::node(n) * kStep);
      giveCommands();
      note(n);
      if (n == 0) search_.moveBase(viewOf(begin, x_, x_ + shafts(), epsilon_));
      curve_.setNode(n, x_);
    }
    curve_.finish();
  }
  GuardFinding find() { return search_.find(curve_, 1e-14); }

 private:
  static Simulation read(const std::string& path) {
    BuiltinComponentFactory factory;
    return Simulation(readScene(readYamlFile(path), factory));
  }
  int shafts() const { return simulation_.scene().shaftCount(); }
  void giveCommands() {
    const auto& inputs = simulation_.scene().inputs;
    for (; given_ < commands_.size() && commands_[given_].time <= simulation_.time(); ++given_) {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        if (inputs[i].topic != commands_[given_].topic) continue;
        simulation_.command(static_cast<int>(i), commands_[given_].value);
      }
    }
  }
  void note(int node) {
    const Sample& sample = simulation_.sample();
    std::copy_n(sample.angle, shafts(), x_);
    std::copy_n(sample.velocity, shafts(), x_ + shafts());
    std::copy_n(sample.acceleration, shafts(), x_ + 2 * shafts());
    std::copy_n(sample.acceleration, shafts(), epsilon_);
    simulation_.calcQuantities(QuantityGroup::kInputs, values_.data());
    for (std::size_t i = 0; i < simulation_.scene().inputs.size(); ++i) {
      inputs_[node][i] = values_[i];  // the values come first
    }
  }
  double inputAt(std::size_t input, double time) const {
    const double part = std::clamp((time - curve_.time()) / kStep, 0.0, 1.0);
    int n = 1;
    while (n + 1 < StepCurve::kNodes && StepCurve::node(n) < part) ++n;
    const double width = StepCurve::node(n) - StepCurve::node(n - 1);
    const double beyond = (part - StepCurve::node(n - 1)) / width;
    return inputs_[n - 1][input] + beyond * (inputs_[n][input] - inputs_[n - 1][input]);
  }
  StateView viewOf(double time, const double* angle, const double* velocity,
                   const double* acceleration) {
    for (std::size_t i = 0; i < simulation_.scene().inputs.size(); ++i) now_[i] = inputAt(i, time);
    return {time, angle, velocity, acceleration, now_, rates_};
  }
  void enclose(const Interval& time, Interval* inputs) const {
    for (std::size_t i = 0; i < simulation_.scene().inputs.size(); ++i) {
      const auto [low, high] = std::minmax({inputAt(i, time.low), inputAt(i, time.high)});
      inputs[i] = {low, high};
    }
  }

  Simulation simulation_;
  GuardSearch search_;
  StepCurve curve_;
  bool has_accelerations_ = false;
  std::vector<TimedCommand> commands_;
  std::size_t given_ = 0;
  std::vector<double> values_;
  double x_[3 * kMaxShafts] = {};
  double epsilon_[kMaxShafts] = {};
  double inputs_[StepCurve::kNodes][kMaxInputs] = {};
  double now_[kMaxInputs] = {};
  double rates_[kMaxInputs] = {};
};

struct Times {
  int count = 0;
  double sum = 0.0;
  double longest = 0.0;
  void add(double microseconds) {
    ++count;
    sum += microseconds;
    longest = std::max(longest, microseconds);
  }
  void print(const char* name) const {
    std::printf("  %5d %-10s mean %6.2f us, longest %6.2f us\n", count, name,
                count > 0 ? sum / count : 0.0, longest);
  }
};

void measure(const std::string& path) {
  using Clock = std::chrono::steady_clock;
  Steps steps(path);
  Times of[3];
  for (int n = 0; n < kSteps; ++n) {
    steps.next();
    GuardFinding finding;
    double least = 1e9;
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      const Clock::time_point begin = Clock::now();
      finding = steps.find();
      least = std::min(least, std::chrono::duration<double>(Clock::now() - begin).count());
    }
    of[static_cast<int>(finding.kind)].add(1e6 * least);
  }
  std::printf("%s, %d guards\n", path.c_str(), steps.guardCount());
  of[static_cast<int>(GuardFinding::Kind::kClear)].print("clear");
  of[static_cast<int>(GuardFinding::Kind::kCrossing)].print("crossings");
  of[static_cast<int>(GuardFinding::Kind::kUnknown)].print("unknown");
}

}  // namespace
}  // namespace variator_sim::benchmark

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) variator_sim::benchmark::measure(argv[i]);
  return argc > 1 ? 0 : 2;
}
