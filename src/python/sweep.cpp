#include "python/sweep.h"

#include <algorithm>
#include <new>

#include "model/thrown.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/overrides.h"

namespace variator_sim::python {

void CodeOfRows::giveTo(Simulation& simulation) {
  const std::size_t ready = ready_;
  for (std::size_t i = 0; i < ready; ++i) {
    if (simulation.shareMachineCode(*owners_[i])) return;
  }
  if (ready == kMost) return;
  // Rows that start during a compilation are interpreted.
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock() || tried_ == kMost || ready_ != ready) return;
  ++tried_;
  auto owner = std::make_unique<Simulation>(simulation.scene(), simulation);
  const bool always = owner->scene().solver.machine_code == MachineCode::kAlways;
  if (!owner->loadMachineCode(compiles_ || always)) return;
  simulation.shareMachineCode(*owner);
  owners_[ready] = std::move(owner);
  ++ready_;
}

Simulation RowRunner::make(const std::vector<double>& values) {
  Scene scene = read(values);
  if (!keeps_formulas_) {
    Simulation simulation(std::move(scene));
    sweep_->code.giveTo(simulation);
    return simulation;
  }
  if (like_ == nullptr) like_ = std::make_unique<Simulation>(scene);
  sweep_->code.giveTo(*like_);
  Simulation simulation(std::move(scene), *like_);
  return simulation;
}

Scene RowRunner::read(const std::vector<double>& values) {
  ParameterTree tree = tree_;
  for (std::size_t i = 0; i < values.size(); ++i) {
    setValue(tree, sweep_->paths[i], ParameterTree::real(values[i]));
  }
  if (uses_left_ > 0) {
    --uses_left_;
    Scene scene = model_;
    rereadNumbers(tree, nodeNames(), &scene);
    return scene;
  }
  Scene scene = readScene(tree, *sweep_->factory, nodeNames());
  if (!is_known_) inspect(scene);
  if (keeps_formulas_) {
    model_ = scene;
    uses_left_ = kUses;
    like_.reset();
  }
  return scene;
}

void RowRunner::inspect(const Scene& scene) {
  is_known_ = true;
  for (const Law* law : scene.laws()) {
    if (law->callsOpaqueFunction()) return;  // its gradients are checked in each row
  }
  const std::vector<std::string>& paths = sweep_->paths;
  keeps_formulas_ = std::all_of(paths.begin(), paths.end(), [&](const std::string& path) {
    return isOutsideFormulas(path, scene);
  });
  // One check suffices for all rows.
  setValue(tree_, "verify_derivatives", ParameterTree::boolean(false));
}

SweepRow RowRunner::run(const std::vector<double>& values) {
  const Interruption interruption([this] { return sweep_->is_cancelled.load(); });
  SweepRow row;
  try {
    Simulation simulation = make(values);
    simulation.trackEnergy(sweep_->run.columns.energy);
    row.values = python::run(simulation, sweep_->run).values;
    row.reason = simulation.describeStatus();
  } catch (const std::bad_alloc&) {
    throw;  // no fault of the row
  } catch (...) {
    row.reason = describeThrown();
  }
  return row;
}

ParameterTree withOverrides(ParameterTree tree, const Overrides& overrides) {
  applyOwnOverrides(tree);
  for (const auto& [path, value] : overrides) setValue(tree, path, value);
  return tree;
}

RunRows run(Simulation& simulation, const RunRequest& request, Sensitivity* sensitivity) {
  const double begin = simulation.time();
  const double end = begin + request.duration;
  OfflineRun offline(simulation,
                     request.has_times ? SampleTimes::at(request.times)
                                       : SampleTimes::atRate(request.rate, begin, end),
                     resolveCommands(request.commands, simulation.scene(), "commands"), end);
  offline.observe(request.columns.quantities);
  offline.differentiate(sensitivity);
  if (request.until_rest) offline.endAtRest();
  RunRows rows;
  rows.ignored_commands = offline.ignoredCount() + offline.pastCount();
  const Columns columns(simulation, request.columns);
  SampleBlock samples;
  samples.samples.reserve(OfflineRun::kBlockSize);
  for (bool more = true; more && !Interruption::isWanted();) {
    more = offline.advanceBlock(kNever, samples);
    columns.append(samples, &rows.values);
  }
  return rows;
}

}  // namespace variator_sim::python
