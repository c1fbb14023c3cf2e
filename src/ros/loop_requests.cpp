// Requests of other threads: their way to the stepping loop, and its answers.
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "ros/nanoseconds.h"
#include "ros/stepping_loop.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
std::string LoopAnswer::describeFault() const {
  constexpr const char* kFaults[] = {
      "",
      "the simulation is running: pause first (~pause), then ~step",
      "the motion has stopped; call ~reset first. ",
      "",
      "~pause has ended the step on its way, at the state returned",
      "simulated time has come to the end of its range; call ~reset_time",
      "the node is shutting down"};
  static_assert(std::size(kFaults) == static_cast<std::size_t>(RequestResult::kShutDown) + 1);
  return kFaults[static_cast<std::size_t>(result)] + message;
}

std::string readCommands(const std::vector<CommandInputSettings>& inputs,
                         const std::vector<std::string>& topics, const std::vector<double>& values,
                         std::vector<InputCommand>& commands) {
  if (topics.size() != values.size()) {
    return "there are " + std::to_string(topics.size()) + " command topics and " +
           std::to_string(values.size()) + " values";
  }
  commands.clear();
  std::array<bool, kMaxInputs> seen{};
  for (std::size_t i = 0; i < topics.size(); ++i) {
    int input = 0;
    try {
      input = findInput(inputs, topics[i]);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    if (std::exchange(seen[static_cast<std::size_t>(input)], true)) {
      return "command topic " + inQuotes(topics[i]) + " is given twice";
    }
    if (!std::isfinite(values[i])) {
      return "the command for " + inQuotes(topics[i]) + " is " + formatReal(values[i]) +
             "; it must be finite";
    }
    commands.push_back({input, values[i]});
  }
  return "";
}

bool SteppingLoop::hasToYield() {
  if (isStopping()) return true;
  const std::atomic<bool>& is_asked = is_serving_ ? pause_wanted_ : request_posted_;
  if (!is_asked.load(std::memory_order_acquire)) return false;
  const std::int64_t now = steadyTime();
  if (asked_since_ == 0) asked_since_ = now;
  return now - asked_since_ > kPatience;
}

LoopAnswer SteppingLoop::submit(const LoopRequest& request) {
  if (request.kind == RequestKind::kPause) pause_wanted_.store(true, std::memory_order_relaxed);
  const std::lock_guard<std::mutex> one_at_a_time(submitting_);
  if (request.kind == RequestKind::kPause) pause_wanted_.store(false, std::memory_order_relaxed);
  if (isStopping()) return {RequestResult::kShutDown};
  if (LoopAnswer answer; serveWhileIdle(request, answer)) return answer;
  request_ = request;
  request_posted_.store(true, std::memory_order_release);
  clock_.wake();
  // run() answers a last request before it returns, but one that comes later would wait forever.
  for (;;) {
    constexpr std::int64_t kLook = 50000000;
    answered_.waitUntil(steadyTime() + kLook);
    if (!request_posted_.load(std::memory_order_acquire)) return answer_;
    if (isStopping()) return {RequestResult::kShutDown};
  }
}

bool SteppingLoop::serveWhileIdle(const LoopRequest& request, LoopAnswer& answer) {
  int waiting = kWaiting;
  if (!idle_.compare_exchange_strong(waiting, kLent, std::memory_order_acq_rel)) return false;
  const Interruption interruption([this] { return hasToYield(); });
  noticeChanges();
  request_ = request;
  serveRequest();
  answer = answer_;
  const bool idle = isIdle();
  idle_.store(kWaiting, std::memory_order_release);
  if (!idle) clock_.wake();
  return true;
}

void SteppingLoop::serveRequest() {
  answer_ = {};
  catchUp();
  is_serving_ = true;
  const RunState before = state();
  switch (request_.kind) {
    case RequestKind::kPause:
      if (!paused_ && !isIdle()) pushSample();
      paused_ = true;
      break;
    case RequestKind::kResume:
      if (paused_) {
        paused_ = false;
        applyCommands();
        anchor();
      }
      break;
    case RequestKind::kReset:
    case RequestKind::kResetTime:
      resetMotion(request_.kind == RequestKind::kResetTime);
      break;
    case RequestKind::kStep:
      serveStep();
      break;
    case RequestKind::kSample:
      if (isIdle()) {
        answer_.sample = takeSample();
      } else {
        answer_.result = RequestResult::kRefused;
      }
      break;
    case RequestKind::kGetState:
    case RequestKind::kSetState:
      serveState();
      break;
  }
  const bool stop_told = noticeStop();
  const bool reset =
      request_.kind == RequestKind::kReset || request_.kind == RequestKind::kResetTime;
  const bool moves_none =
      request_.kind == RequestKind::kPause || request_.kind == RequestKind::kSample;
  if (state() == RunState::kStopped && !reset && !moves_none) {
    answer_.result = RequestResult::kStopped;
    answer_.message = describeStop();
  }
  pushSnapshot(!stop_told && (state() != before || reset));
  is_serving_ = false;
}

void SteppingLoop::serveStep() {
  if (!simulation_.status().ok()) {
    answer_.sample = takeSample();
    return;  // the caller reports why
  }
  if (!paused_) {
    answer_.result = RequestResult::kNotPaused;
    return;
  }
  if (request_.duration > kLastInstant - present_ - offset_) {
    answer_.result = RequestResult::kTimeExhausted;
    return;
  }
  applyCommands();
  for (const InputCommand& command : request_.commands) applyCommand(command);
  const std::int64_t end = present_ + request_.duration;
  present_ = end;
  catchUp();
  if (present_ < end && simulation_.status().ok()) {
    answer_.result = isStopping() ? RequestResult::kShutDown : RequestResult::kInterrupted;
  }
  answer_.sample = takeSample();
  // noticeStop reports a stop with its sample.
  if (simulation_.status().ok() && areSamplesWanted()) {
    handOver(answer_.sample);
  }
}

void SteppingLoop::serveState() {
  applyCommands();
  if (simulation_.status().ok()) {
    const std::int64_t shown = sampleTime();
    answer_.message = request_.visit(simulation_);
    if (!answer_.message.empty()) answer_.result = RequestResult::kRefused;
    if (request_.kind == RequestKind::kSetState) {
      // Time of samples never goes back.
      present_ = std::llround(simulation_.time() * kNanosecondsPerSecond);
      offset_ = shown - present_;
      anchor();
    }
  }
  answer_.sample = takeSample();
  if (request_.kind == RequestKind::kSetState && areSamplesWanted()) {
    handOver(answer_.sample);
  }
}

}  // namespace variator_sim
