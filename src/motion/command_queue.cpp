#include "motion/command_queue.h"

#include <algorithm>
#include <limits>

namespace variator_sim {

namespace {
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double clamp(const CommandInputSettings& input, double value) {
  return std::min(input.maximum, std::max(input.minimum, value));
}
}  // namespace

CommandQueue::CommandQueue(const std::vector<CommandInputSettings>& inputs) : inputs_(inputs) {
  std::fill_n(first_clamped_, kMaxInputs, kNone);
  reset();
}

void CommandQueue::reset() {
  clear();
  std::fill_n(last_time_, kMaxInputs, kNever);
}

void CommandQueue::clear() {
  is_empty_ = true;
  std::fill_n(value_, kMaxInputs, kNone);
}

bool CommandQueue::add(int input, double value, double time) {
  const double clamped = clamp(inputs_[static_cast<std::size_t>(input)], value);
  stage(input, clamped);
  last_time_[input] = time;
  if (clamped == value) return false;
  if (std::isnan(first_clamped_[input])) first_clamped_[input] = value;
  return true;
}

double CommandQueue::timeoutOf(int i) const {
  const double timeout = inputs_[static_cast<std::size_t>(i)].timeout;
  return timeout > 0.0 ? last_time_[i] + timeout : kNever;
}

double CommandQueue::nextTimeout() const {
  double next = kNever;
  const int count = static_cast<int>(inputs_.size());
  for (int i = 0; i < count; ++i) next = std::min(next, timeoutOf(i));
  return next;
}

int CommandQueue::addTimeouts(double time, double rounding) {
  int count = 0;
  for (int i = 0; i < static_cast<int>(inputs_.size()); ++i) {
    if (timeoutOf(i) > time + rounding) continue;
    const CommandInputSettings& input = inputs_[static_cast<std::size_t>(i)];
    last_time_[i] = kNever;
    ++count;
    if (input.on_timeout == OnTimeout::kZero) stage(i, clamp(input, 0.0));
  }
  return count;
}

}  // namespace variator_sim
