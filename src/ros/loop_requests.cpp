// Requests of other threads: their way to the stepping loop, and its answers.
#include <algorithm>

#include "ros/nanoseconds.h"
#include "ros/stepping_loop.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

std::string LoopAnswer::describeFault() const {
  switch (result) {
    case RequestResult::kDone:
      break;
    case RequestResult::kNotPaused:
      return "the simulation is running: pause first (~pause), then ~step";
    case RequestResult::kStopped:
      return "the motion has stopped; call ~reset first. " + message;
    case RequestResult::kRefused:
      return message;
    case RequestResult::kInterrupted:
      return "~pause has ended the step on its way, at the state returned";
    case RequestResult::kTimeExhausted:
      return "simulated time has come to the end of its range; call ~reset_time";
    case RequestResult::kShutDown:
      return "the node is shutting down";
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
  LoopAnswer shut_down;
  shut_down.result = RequestResult::kShutDown;
  if (request.kind == RequestKind::kPause) pause_wanted_.store(true, std::memory_order_relaxed);
  const std::lock_guard<std::mutex> one_at_a_time(submitting_);
  if (request.kind == RequestKind::kPause) pause_wanted_.store(false, std::memory_order_relaxed);
  if (isStopping()) return shut_down;
  if (LoopAnswer answer; serveWhileIdle(request, answer)) return answer;
  request_ = request;
  request_posted_.store(true, std::memory_order_release);
  clock_.wake();
  // run() answers a last request before it returns, but one that comes later would wait forever.
  for (;;) {
    constexpr std::int64_t kLook = 50000000;
    answered_.waitUntil(steadyTime() + kLook);
    if (!request_posted_.load(std::memory_order_acquire)) return answer_;
    if (isStopping()) return shut_down;
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
  answer_.result = RequestResult::kDone;
  answer_.message.clear();
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
    case RequestKind::kGetState:
    case RequestKind::kSetState:
      serveState();
      break;
  }
  const bool stop_told = noticeStop();
  const bool reset =
      request_.kind == RequestKind::kReset || request_.kind == RequestKind::kResetTime;
  if (state() == RunState::kStopped && !reset && request_.kind != RequestKind::kPause) {
    answer_.result = RequestResult::kStopped;
    answer_.message = simulation_.describeStatus();
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
  for (int i = 0; i < request_.command_count; ++i) {
    applyCommand(request_.commands[static_cast<std::size_t>(i)]);
  }
  const std::int64_t end = present_ + request_.duration;
  present_ = end;
  catchUp();
  if (present_ < end && simulation_.status().ok()) {
    answer_.result = isStopping() ? RequestResult::kShutDown : RequestResult::kInterrupted;
  }
  answer_.sample = takeSample();
  // noticeStop reports a stop with its sample.
  if (simulation_.status().ok() && samples_wanted_.load(std::memory_order_relaxed)) {
    handOver(answer_.sample);
  }
}

}  // namespace variator_sim
