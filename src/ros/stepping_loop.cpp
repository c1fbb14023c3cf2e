#include "ros/stepping_loop.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace variator_sim {
namespace {

constexpr double kNanosecondsPerSecond = 1e9;
/// ~step advances in cuts of this length, ns, to see an order to stop; cuts change no bit.
constexpr std::int64_t kStepCut = 100000000;
/// Half of what 64 bits hold: 146 years.
constexpr std::int64_t kLastInstant = std::numeric_limits<std::int64_t>::max() / 2;

/// The double nearest to ns * 1e-9: both operands are exact, one rounding by the division.
double toSeconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / kNanosecondsPerSecond;
}

double wallPeriod(const NodeSettings& settings) {
  if (settings.real_time_factor == 0.0) return 0.0;
  return kNanosecondsPerSecond / (settings.tick_rate * settings.real_time_factor);
}

}  // namespace

SteppingLoop::SteppingLoop(Simulation simulation, const NodeSettings& settings, PacingClock& clock)
    : clock_(clock),
      pacer_(clock, wallPeriod(settings)),
      simulation_(std::move(simulation)),
      tick_rate_(settings.tick_rate),
      publish_rate_(settings.publish_rate),
      // publish_rate counts wall time: what goes over the wire does not grow with the speed.
      ticks_per_sample_(
          std::max(1.0, settings.tick_rate * settings.real_time_factor / settings.publish_rate)),
      paused_(settings.start_paused) {}

void SteppingLoop::command(const InputCommand& command) {
  if (!commands_.push(command)) dropped_commands_.fetch_add(1, std::memory_order_relaxed);
  // Read-modify-write on both sides: either this one comes first and the stepping thread sees the
  // command before it sleeps, or it comes second and sees that there is somebody to wake.
  if (idle_.fetch_add(0, std::memory_order_acq_rel) != 0) wake_.post();
}

LoopAnswer SteppingLoop::submit(const LoopRequest& request) {
  LoopAnswer shut_down;
  shut_down.result = RequestResult::kShutDown;
  if (isStopping()) return shut_down;
  request_ = request;
  request_posted_.store(true, std::memory_order_release);
  wake_.post();
  // run() answers a last request before it returns, but one that comes later would wait forever.
  for (;;) {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    constexpr std::int64_t kPatience = 50000000;
    const std::int64_t deadline =
        static_cast<std::int64_t>(now.tv_sec) * 1000000000 + now.tv_nsec + kPatience;
    answered_.waitUntil(deadline);
    if (!request_posted_.load(std::memory_order_acquire)) return answer_;
    if (isStopping()) return shut_down;
  }
}

void SteppingLoop::stop() {
  stopping_.store(true);
  wake_.post();
  news_.post();
}

void SteppingLoop::run() {
  clock_.prepareThread();
  pushSample();
  pushSnapshot(true);
  anchor();
  while (!isStopping()) {
    if (request_posted_.load(std::memory_order_acquire)) serveRequest();
    if (isIdle()) {
      waitWhileIdle();
    } else if (pacer_.waitForTick()) {
      tick();
    }
  }
  if (request_posted_.load(std::memory_order_acquire)) {
    answer_.result = RequestResult::kShutDown;
    request_posted_.store(false, std::memory_order_release);
    answered_.post();
  }
}

void SteppingLoop::tick() {
  ++tick_;
  present_ =
      anchor_ + std::llround(static_cast<double>(tick_) * kNanosecondsPerSecond / tick_rate_);
  simulation_.advanceTo(toSeconds(present_));
  if (noticeStop()) return;
  // Commands that arrived since the last tick take effect now: never before they were given.
  applyCommands();
  if (isSampleDue() && samples_wanted_.load(std::memory_order_relaxed)) pushSample();
  if (pacer_.isPaced()) lateness_.add(pacer_.lateness());
  if (pacer_.tickStart() >= slice_end_) endSlice();
}

bool SteppingLoop::isSampleDue() {
  if (pacer_.isPaced()) {
    // Sample m is due at tick round(m ticks_per_sample): no rounding error adds up.
    if (tick_ < next_sample_tick_) return false;
    ++due_samples_;
    next_sample_tick_ = std::llround(static_cast<double>(due_samples_ + 1) * ticks_per_sample_);
    return true;
  }
  if (pacer_.tickStart() < next_sample_wall_) return false;
  const auto interval = static_cast<std::int64_t>(kNanosecondsPerSecond / publish_rate_);
  next_sample_wall_ = std::max(next_sample_wall_ + interval, pacer_.tickStart());
  return true;
}

void SteppingLoop::waitWhileIdle() {
  idle_.exchange(1, std::memory_order_acq_rel);
  // A command that came before the flag was set has woken nobody. Requests always do.
  if (commands_.read_available() == 0) wake_.wait();
  idle_.store(0, std::memory_order_relaxed);
  if (request_posted_.load(std::memory_order_acquire)) return;
  if (commands_.read_available() > 0) {
    // They count and are refused now; what they move shows in the next sample.
    applyCommands();
    pushSnapshot(false);
  }
}

void SteppingLoop::applyCommands() {
  InputCommand command;
  while (commands_.pop(command)) applyCommand(command);
}

void SteppingLoop::applyCommand(const InputCommand& command) {
  if (simulation_.command(command.input, command.value) == CommandResult::kRefused) {
    refused_commands_.push(command);  // full: counted all the same, only not told
  }
}

void SteppingLoop::serveRequest() {
  answer_.result = RequestResult::kDone;
  answer_.message.clear();
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
  }
  const bool stop_told = noticeStop();
  const bool reset =
      request_.kind == RequestKind::kReset || request_.kind == RequestKind::kResetTime;
  if (state() == RunState::kStopped && !reset && request_.kind != RequestKind::kPause) {
    answer_.result = RequestResult::kStopped;
    answer_.message = simulation_.describeStatus();
  }
  pushSnapshot(!stop_told && (state() != before || reset));
  request_posted_.store(false, std::memory_order_release);
  answered_.post();
}

void SteppingLoop::serveStep() {
  if (!simulation_.status().ok()) {
    answer_.sample = takeSample();
    return;  // the caller tells why
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
  while (present_ < end && simulation_.status().ok()) {
    if (isStopping()) {
      answer_.result = RequestResult::kShutDown;
      break;
    }
    present_ = std::min(end, present_ + kStepCut);
    simulation_.advanceTo(toSeconds(present_));
  }
  answer_.sample = takeSample();
  // A stop is told, with its sample, by noticeStop.
  if (simulation_.status().ok()) {
    samples_.push(answer_.sample);
    news_.post();
  }
}

void SteppingLoop::resetMotion(bool reset_time) {
  // Commands from before the reset are forgotten with the motion that they were meant for.
  commands_.consume_all([](const InputCommand&) {});
  offset_ = reset_time ? 0 : sampleTime();
  present_ = 0;
  simulation_.reset();
  stop_noticed_ = false;
  pushSample();
  anchor();
}

void SteppingLoop::anchor() {
  anchor_ = present_;
  tick_ = 0;
  due_samples_ = 0;
  next_sample_tick_ = std::llround(ticks_per_sample_);
  pacer_.anchor();
  const std::int64_t now = clock_.now();
  next_sample_wall_ = now;
  lateness_.clear();
  slice_count_ = 0;
  slice_starts_[0] = {now, present_};
  slice_end_ = now + kSliceLength;
  real_time_factor_ = 0.0;
}

RunState SteppingLoop::state() const {
  if (!simulation_.status().ok()) return RunState::kStopped;
  if (paused_) return RunState::kPaused;
  return simulation_.isSleeping() ? RunState::kSleeping : RunState::kRunning;
}

bool SteppingLoop::noticeStop() {
  if (stop_noticed_ || simulation_.status().ok()) return false;
  stop_noticed_ = true;
  pushSample();
  pushSnapshot(true);
  return true;
}

std::int64_t SteppingLoop::sampleTime() {
  const MotionStatus& status = simulation_.status();
  if (status.ok()) return offset_ + present_;
  // Stopped between two instants of ours.
  return offset_ + std::llround(status.time * kNanosecondsPerSecond);
}

TimedSample SteppingLoop::takeSample() {
  TimedSample timed;
  timed.sample = simulation_.sample();
  timed.time = sampleTime();
  timed.wall_time = clock_.now();
  return timed;
}

void SteppingLoop::pushSample() {
  samples_.push(takeSample());
  news_.post();
  // The jump of commands is carried out by sampling, and can fail.
  noticeStop();
}

void SteppingLoop::endSlice() {
  const std::int64_t now = pacer_.tickStart();
  ++slice_count_;
  constexpr std::int64_t kSlices = LatenessWindow::kSlices;
  // The oldest start still known: of the slice kSlices before this one, or the anchor's.
  const std::int64_t oldest = std::max<std::int64_t>(0, slice_count_ - kSlices);
  const SliceStart& start = slice_starts_[static_cast<std::size_t>(oldest % kSlices)];
  if (now > start.wall_time) {
    real_time_factor_ =
        static_cast<double>(present_ - start.time) / static_cast<double>(now - start.wall_time);
  }
  slice_starts_[static_cast<std::size_t>(slice_count_ % kSlices)] = {now, present_};
  slice_end_ = std::max(slice_end_ + kSliceLength, now);
  pushSnapshot(false);
  lateness_.nextSlice();
}

void SteppingLoop::pushSnapshot(bool state_changed) {
  LoopSnapshot snapshot;
  snapshot.state = state();
  snapshot.state_changed = state_changed;
  snapshot.reason = simulation_.status().reason;
  snapshot.time = sampleTime();
  if (snapshot.state == RunState::kRunning || snapshot.state == RunState::kSleeping)
    snapshot.real_time_factor = real_time_factor_;
  snapshot.pacing = pacer_.counters();
  const LatenessHistogram window = lateness_.total();
  snapshot.lateness_p50 = window.quantile(0.5);
  snapshot.lateness_p99 = window.quantile(0.99);
  snapshot.lateness_max = window.max();
  snapshot.statistics = simulation_.statistics();
  if (snapshot.state == RunState::kStopped) {
    // The motion is over: this allocates, and nobody is waiting for a tick.
    const std::string message = simulation_.describeStatus();
    const std::size_t size = std::min(message.size(), snapshot.message.size() - 1);
    std::copy_n(message.begin(), size, snapshot.message.begin());
  }
  snapshots_.push(snapshot);
  if (state_changed) news_.post();
}

}  // namespace variator_sim
