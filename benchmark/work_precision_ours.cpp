// Our own methods: Simulation on the scenes of benchmark/scenes/, interpreted and by machine code.
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "peers/method.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::benchmark {
namespace {

ParameterTree numbers(const double* values, int count) {
  ParameterTree::List list;
  for (int i = 0; i < count; ++i) list.push_back(ParameterTree::real(values[i]));
  return ParameterTree::list(std::move(list));
}

/// The scene's file with tau and its initial values replaced.
template <template <class> class SceneOf>
ParameterTree readTree(const SceneCase& scene_case, const std::string& folder) {
  ParameterTree tree = readYamlFile(folder + "/" + scene_case.file + ".yaml");
  if (scene_case.tau > 0.0) {
    auto& root = tree.asDictionary();
    root["variator"].asDictionary()["parameters"].asDictionary()["tau"] =
        ParameterTree::real(scene_case.tau);
    if (!scene_case.parameters.slips_at_start) {
      double x[6];
      SceneOf<double>(scene_case.parameters).initial(x);
      auto& initial = root["initial"].asDictionary();
      initial["velocity"] = numbers(x + 2, 2);
      initial["acceleration"] = numbers(x + 4, 2);
    }
  }
  return tree;
}

template <template <class> class SceneOf>
class Ours : public Method {
 public:
  Ours(const std::string& stepper, const std::string& form, SceneCase scene_case,
       ParameterTree tree, const std::string& folder)
      : Method("ours " + stepper, form),
        stepper_(stepper),
        scene_case_(std::move(scene_case)),
        tree_(std::move(tree)) {
    if (!scene_case_.commands.empty()) {
      commands_ = readCommandFile(folder + "/" + scene_case_.commands + ".csv");
    }
  }

  std::string prepare(double tolerance) override {
    ParameterTree tree = tree_;
    tree.asDictionary()["solver"] = ParameterTree::dictionary({
        {"stepper", ParameterTree::text(stepper_)},
        {"machine_code", ParameterTree::text(form() == "machine code" ? "always" : "never")},
        {"relative_tolerance", ParameterTree::real(tolerance)},
        {"absolute_tolerance", ParameterTree::real(tolerance)},
        // As the peers, whose steps nothing limits.
        {"maximum_step", ParameterTree::real(kEnd)},
    });
    BuiltinComponentFactory factory;
    try {
      simulation_.emplace(readScene(tree, factory));
      if (form() == "machine code" && !simulation_->loadMachineCode(true)) return "no machine code";
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
  bool run() override { return play(1, HUGE_VAL); }
  /// The same motion in small advances, which change no bit of it.
  bool runGuarded(double seconds) override { return play(300, seconds); }
  Outcome outcome() override {
    Outcome result;
    constexpr int S = SceneOf<double>::kShafts;
    for (std::size_t i = 0; i < S; ++i) {
      result.state[i] = sample_.angle[i];
      result.state[S + i] = sample_.velocity[i];
      result.state[2 * S + i] = sample_.acceleration[i];
    }
    result.right_hand_sides = simulation_->statistics().right_hand_sides;
    result.steps = simulation_->statistics().steps;
    if (late_) {
      result.status = "time-out";
    } else if (!simulation_->status().ok()) {
      result.status = toString(simulation_->status().reason);
    }
    return result;
  }

 private:
  static constexpr double kEnd = static_cast<double>(SceneOf<double>::kEnd);

  /// In so many advances between which the time is looked at.
  bool play(int slices, double seconds) {
    const auto start = ProcessorClock::now();
    late_ = false;
    simulation_->reset();
    std::size_t next = 0;
    for (int slice = 1; slice <= slices; ++slice) {
      const double time = kEnd * slice / slices;
      for (; next < commands_.size() && commands_[next].time <= time; ++next) {
        if (!simulation_->advanceTo(commands_[next].time).ok()) return finish();
        simulation_->command(0, commands_[next].value);
      }
      if (!simulation_->advanceTo(time).ok()) return finish();
      late_ = slices > 1 && secondsSince(start) > seconds;
      if (late_) return false;
    }
    return finish();
  }
  bool finish() {
    sample_ = simulation_->sample();
    return simulation_->status().ok();
  }

  std::string stepper_;
  SceneCase scene_case_;
  ParameterTree tree_;
  std::vector<TimedCommand> commands_;
  std::optional<Simulation> simulation_;
  Sample sample_;
  bool late_ = false;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, const std::string& folder, Methods& methods,
                SceneTag<SceneOf> /*tag*/) {
  const ParameterTree formulas = readTree<SceneOf>(scene, folder);
  for (const char* stepper : {"auto", "dopri5", "fehlberg78", "radau"}) {
    for (const char* form : {"formulas", "machine code"}) {
      methods.push_back(std::make_unique<Ours<SceneOf>>(stepper, form, scene, formulas, folder));
    }
  }
}

}  // namespace

void addOurMethods(const SceneCase& scene, const std::string& scene_folder, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, scene_folder, methods, tag); });
}

}  // namespace variator_sim::benchmark
