#include "tools/offline_run.h"

#include <chrono>
#include <stdexcept>

#include "model/number_text.h"
#include "tools/sensitivity.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

std::vector<TimedCommand> resolveCommands(std::vector<TimedCommand> commands, const Scene& scene,
                                          const std::string& path) {
  for (TimedCommand& command : commands) {
    try {
      command.input = findInput(scene.inputs, command.topic);
    } catch (const std::invalid_argument& error) {
      throw CommandFileError(path + ":" + std::to_string(command.line) + ": " + error.what());
    }
  }
  return commands;
}

std::vector<std::string> describeDoubts(const Simulation& simulation) {
  std::vector<std::string> doubts;
  // Fixed steps keep no tolerance, so the user is warned when they are crude.
  constexpr double kCrude = 1e-3;
  const SolverSettings& solver = simulation.scene().solver;
  const double part = simulation.statistics().largest_error_estimate * solver.relative_tolerance;
  if (part > kCrude) {
    doubts.push_back(
        printed("fixed steps of %.6g s are crude: the largest estimated error of one step is "
                "%.2g of the state; lower 'solver/step'",
                solver.step, part));
  }
  const std::vector<CommandInputSettings>& inputs = simulation.scene().inputs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const double clamped = simulation.firstClampedCommand(static_cast<int>(i));
    if (!std::isnan(clamped)) doubts.push_back(describeClamped(inputs[i], clamped));
  }
  const std::string energy = describe(simulation.energyDoubt());
  if (!energy.empty()) doubts.push_back(energy);
  const std::vector<std::string> errors = describe(simulation.errorDoubt());
  doubts.insert(doubts.end(), errors.begin(), errors.end());
  return doubts;
}

std::string writeEvents(Simulation& simulation) {
  const std::vector<std::string> names = simulation.scene().eventNames();
  std::string text = "time,element,from,to,torque,impulse\n";
  ModeEvent it;
  while (simulation.takeModeEvent(&it)) {
    text += formatNumber(it.time) + "," + names[static_cast<std::size_t>(it.element)] + "," +
            modeName(it.from) + "," + modeName(it.to) + "," + formatNumber(it.torque) + "," +
            formatNumber(it.impulse) + "\n";
  }
  return text;
}

OfflineRun::OfflineRun(Simulation& simulation, SampleTimes times,
                       std::vector<TimedCommand> commands, double end)
    : simulation_(simulation), times_(std::move(times)), commands_(std::move(commands)), end_(end) {
  const auto first_after = [this](double time) {
    return std::find_if(commands_.begin(), commands_.end(),
                        [time](const TimedCommand& command) { return command.time > time; });
  };
  const auto first_ignored = first_after(end);
  ignored_count_ = static_cast<std::size_t>(commands_.end() - first_ignored);
  commands_.erase(first_ignored, commands_.end());
  // A command at the beginning may have been applied already; applying it twice has no effect.
  const auto first = first_after(std::nextafter(simulation.time(), -kNever));
  past_count_ = static_cast<std::size_t>(first - commands_.begin());
  commands_.erase(commands_.begin(), first);
}

bool OfflineRun::reach(double time) {
  if (time <= simulation_.time()) return true;
  if (sensitivity_ != nullptr) sensitivity_->follow(simulation_);
  return simulation_.advanceTo(time).ok() && simulation_.time() >= time;  // not interrupted
}

void OfflineRun::applyCommands() {
  while (next_command_ < commands_.size() && commands_[next_command_].time <= simulation_.time()) {
    const TimedCommand& command = commands_[next_command_++];
    if (sensitivity_ != nullptr) sensitivity_->command(simulation_, command.input, command.value);
    if (simulation_.command(command.input, command.value) == CommandResult::kRefused &&
        ++refused_count_ == 1) {
      first_refused_ = command;
    }
  }
}

void OfflineRun::takeSample(SampleBlock& block) {
  if (!measures_sampling_) {
    addSample(block);
    return;
  }
  const auto start = std::chrono::steady_clock::now();
  addSample(block);
  sampling_seconds_ +=
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void OfflineRun::addSample(SampleBlock& block) {
  const Sample& taken = simulation_.sample();
  if (!simulation_.status().ok()) return;  // a failed jump
  block.samples.push_back(taken);
  if (look_) look_(taken);
  const auto make_room = [&block](const std::vector<std::string>& names) {
    block.quantities.resize(block.quantities.size() + names.size());
    return block.quantities.data() + block.quantities.size() - names.size();
  };
  for (const QuantityGroup group : groups_) {
    simulation_.calcQuantities(group, make_room(simulation_.quantityNames(group)));
  }
  if (sensitivity_ == nullptr) return;
  sensitivity_->calc(simulation_, make_room(sensitivity_->names()));
}

void OfflineRun::serveEvents() {
  const double now = simulation_.time();
  const bool is_last_command = next_command_ == commands_.size();
  if (rest_.nextLook() <= now && rest_.look(simulation_, is_last_command)) {
    end_ = now;
    times_.endAt(now);
  }
  if (save_time_ <= now || (save_time_ < kNever && now >= end_)) saveState();
}

void OfflineRun::saveState() {
  if (!has_state_) has_state_ = simulation_.saveState(&state_);
}

bool OfflineRun::advanceBlock(double span, SampleBlock& block) {
  block.samples.clear();
  block.quantities.clear();
  const double block_end = simulation_.time() + span;
  while (block.samples.size() < kBlockSize && !Interruption::isWanted()) {
    const double command_time =
        next_command_ < commands_.size() ? commands_[next_command_].time : kNever;
    const double save_time = has_state_ ? kNever : save_time_;
    const double next =
        std::min({times_.current(), command_time, save_time, rest_.nextLook(), end_});
    if (next > block_end) return reach(block_end);
    if (!reach(next)) return false;
    applyCommands();
    serveEvents();
    if (!simulation_.status().ok()) return false;
    if (times_.current() <= next) {
      takeSample(block);
      if (!simulation_.status().ok()) return false;
      times_.next();
    } else if (next >= end_) {
      return false;
    }
  }
  return true;
}

}  // namespace variator_sim
