#include "motion/command_queue.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

namespace {
constexpr double kNever = std::numeric_limits<double>::infinity();

double clamp(const CommandInputSettings& input, double value) {
  return std::min(input.maximum, std::max(input.minimum, value));
}
}  // namespace

CommandQueue::CommandQueue(const std::vector<CommandInputSettings>& inputs) : inputs_(inputs) {
  std::fill(std::begin(first_clamped_), std::end(first_clamped_),
            std::numeric_limits<double>::quiet_NaN());
  reset();
}

void CommandQueue::reset() {
  count_ = 0;
  std::fill(std::begin(last_time_), std::end(last_time_), kNever);
}

bool CommandQueue::add(int input, double value, double time) {
  const double clamped = clamp(inputs_[static_cast<std::size_t>(input)], value);
  stage(input, clamped);
  last_time_[input] = time;
  if (clamped == value) return false;
  if (std::isnan(first_clamped_[input])) first_clamped_[input] = value;
  return true;
}

void CommandQueue::stage(int input, double value) {
  for (int n = 0; n < count_; ++n) {
    if (commands_[n].input != input) continue;
    commands_[n].value = value;
    return;
  }
  commands_[count_++] = {input, value};
}

double CommandQueue::nextTimeout() const {
  double next = kNever;
  int i = 0;
  for (const CommandInputSettings& input : inputs_) {
    const double last = last_time_[i++];
    if (input.timeout > 0.0 && last != kNever) next = std::min(next, last + input.timeout);
  }
  return next;
}

int CommandQueue::addTimeouts(double time, double rounding) {
  int count = 0;
  int next = 0;
  for (const CommandInputSettings& input : inputs_) {
    const int i = next++;
    if (input.timeout <= 0.0 || last_time_[i] == kNever) continue;
    if (last_time_[i] + input.timeout > time + rounding) continue;
    last_time_[i] = kNever;
    ++count;
    if (input.on_timeout == OnTimeout::kZero) stage(i, clamp(input, 0.0));
  }
  return count;
}

}  // namespace variator_sim
