#include "ros/stepping_loop.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>

#include "ros/nanoseconds.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

/// Returns the time between two ticks, ns; 0: unpaced.
double periodOf(double tick_rate, double real_time_factor) {
  return real_time_factor == 0.0 ? 0.0 : kNanosecondsPerSecond / (tick_rate * real_time_factor);
}

std::size_t countQuantities(const Simulation& simulation) {
  std::size_t count = 0;
  for (const QuantityGroup group : kQuantityGroups) count += simulation.quantityNames(group).size();
  return count;
}

}  // namespace

SteppingLoop::SteppingLoop(Simulation simulation, const NodeSettings& settings, PacingClock& clock)
    : quantities_(countQuantities(simulation)),
      samples_(quantities_.size()),
      wanted_factor_(clock.isFollowed() ? 1.0 : settings.real_time_factor),
      wanted_publish_rate_(settings.publish_rate),
      clock_(clock),
      followed_(clock.isFollowed()),
      pacer_(clock, periodOf(settings.tick_rate, wanted_factor_)),
      simulation_(std::move(simulation)),
      tick_rate_(settings.tick_rate),
      real_time_factor_(wanted_factor_),
      paused_(settings.start_paused) {
  samples_due_.setRate(settings.publish_rate, tick_rate_ * real_time_factor_);
}

void SteppingLoop::commandTogether(const InputCommand* commands, std::size_t count) {
  // A queue shows what is pushed at once at once: no tick comes between.
  if (commands_.write_available() >= count) {
    commands_.push(commands, count);
  } else {
    dropped_commands_.fetch_add(count, std::memory_order_relaxed);
  }
  wakeIfIdle();
}

void SteppingLoop::wakeIfIdle() {
  // Read-modify-write on both sides: either this one comes first and the stepping thread sees the
  // request before it waits, or it comes second and sees that the thread waits.
  if (idle_.fetch_add(0, std::memory_order_acq_rel) != 0) clock_.wake();
}

void SteppingLoop::endPreparation() {
  prepared_.store(true, std::memory_order_release);
  clock_.wake();
}

void SteppingLoop::setWanted(Topics topics) {
  if (wanted_.exchange(topics, std::memory_order_relaxed) != topics) wakeIfIdle();
}

void SteppingLoop::change(std::atomic<double>& setting, double value) {
  setting.store(value, std::memory_order_relaxed);
  settings_changed_.store(true, std::memory_order_release);
  clock_.wake();
}

void SteppingLoop::stop() {
  stopping_.store(true);
  clock_.wake();
  news_.post();
}

void SteppingLoop::run() {
  const Interruption interruption([this] { return hasToYield(); });
  clock_.prepareThread();
  clock_started_ = clock_.hasStarted();
  jumps_back_ = clock_.jumpsBack();
  anchor();
  pushSample();
  pushSnapshot(true);
  while (!isStopping()) {
    noticeChanges();
    if (request_posted_.load(std::memory_order_acquire)) {
      serveRequest();
      request_posted_.store(false, std::memory_order_release);
      answered_.post();
    }
    if (followed_ && !isIdle()) endSliceIfDue(clock_.wallTime());
    if (isIdle()) {
      waitWhileIdle();
      continue;
    }
    if (pacer_.isPaced() && simulation_.isSleeping()) {
      passOverRest();
      if (isCalled()) continue;
    }
    if (pacer_.waitForTick()) tick();
  }
  if (request_posted_.load(std::memory_order_acquire)) {
    answer_ = {RequestResult::kShutDown};
    request_posted_.store(false, std::memory_order_release);
    answered_.post();
  }
}

bool SteppingLoop::isCalled() const {
  return request_posted_.load(std::memory_order_acquire) ||
         settings_changed_.load(std::memory_order_relaxed) || isStopping() ||
         (is_preparing_ && prepared_.load(std::memory_order_acquire)) ||
         (followed_ && clock_.jumpsBack() != jumps_back_);
}

void SteppingLoop::noticeChanges() {
  if (is_preparing_ && prepared_.load(std::memory_order_acquire)) {
    is_preparing_ = false;
    const Interruption none([] { return false; });  // the cache has it, or not
    simulation_.loadMachineCode(/*compile=*/false);
    anchor();
    pushSnapshot(true);
  }
  if (followed_) noticeClock();
  if (settings_changed_.load(std::memory_order_relaxed)) applySettings();
}

void SteppingLoop::noticeClock() {
  if (!clock_started_ && clock_.hasStarted()) {
    clock_started_ = true;
    anchor();
    pushSnapshot(true);
  }
  const std::uint64_t jumps_back = clock_.jumpsBack();
  if (jumps_back == jumps_back_) return;
  jumps_back_ = jumps_back;
  resetMotion(/*reset_time=*/true);
  if (!noticeStop()) pushSnapshot(true);
}

void SteppingLoop::applySettings() {
  settings_changed_.exchange(false, std::memory_order_acquire);
  const double factor = wanted_factor_.load(std::memory_order_relaxed);
  const bool new_pace = factor != real_time_factor_ && !followed_;
  if (new_pace) {
    real_time_factor_ = factor;
    pacer_.setPeriod(periodOf(tick_rate_, factor));
  }
  samples_due_.setRate(wanted_publish_rate_.load(std::memory_order_relaxed),
                       tick_rate_ * real_time_factor_);
  if (new_pace) {
    anchor();
  } else {
    samples_due_.countFrom(pacer_, clock_.now());
  }
}

void SteppingLoop::tick() {
  if (!moveToTick()) return;
  catchUp();
  if (noticeStop()) return;
  // Commands that arrived since the last tick take effect now, never before their arrival.
  applyCommands();
  if (samples_due_.isDue(pacer_) && areSamplesWanted()) pushSample();
  // A followed clock may stand, so there slices end without ticks.
  if (followed_) return;
  if (pacer_.isPaced()) lateness_.add(pacer_.lateness());
  endSliceIfDue(pacer_.tickStart());
}

bool SteppingLoop::moveToTick() {
  const double passed = static_cast<double>(pacer_.tick()) * kNanosecondsPerSecond / tick_rate_;
  const std::int64_t left = kLastInstant - offset_ - anchor_;
  present_ = anchor_ + std::min(toCount(passed), left);
  moment_ = pacer_.isPaced() ? pacer_.tickDue() : pacer_.tickStart();
  if (passed <= static_cast<double>(left)) return true;
  catchUp();
  if (simulation_.status().ok()) simulation_.exhaustTime();
  noticeStop();
  return false;
}

void SteppingLoop::catchUp() {
  const double aim = toSeconds(present_);
  asked_since_ = 0;
  simulation_.advanceTo(aim);
  pushEvents();
  if (simulation_.time() < aim && simulation_.status().ok()) {  // interrupted
    constexpr double kRounding = 1e-3;                          // ns
    present_ = static_cast<std::int64_t>(simulation_.time() * kNanosecondsPerSecond + kRounding);
  }
}

void SteppingLoop::passOverRest() {
  idle_.exchange(kResting, std::memory_order_acq_rel);
  // Status is due ten times a second, samples by their own schedule.
  const double ticks_per_slice = std::ceil(static_cast<double>(kSliceLength) / pacer_.period());
  std::int64_t needed =
      pacer_.tick() + std::max<std::int64_t>(1, static_cast<std::int64_t>(ticks_per_slice));
  if (areSamplesWanted()) {
    needed = std::min(needed, samples_due_.nextTick());
  }
  const bool can_wait = needed > pacer_.tick() + 1;
  // A request before the flag was set has not woken this thread.
  if (can_wait && commands_.read_available() == 0 && !isCalled()) {
    clock_.waitUntil(pacer_.dueTime(needed));
  }
  idle_.store(kAwake, std::memory_order_relaxed);
  if (!can_wait) return;
  const std::int64_t last = std::min(needed - 1, pacer_.lastDueTick());
  if (last <= pacer_.tick()) return;
  pacer_.passOver(last);
  if (!moveToTick()) return;
  catchUp();
  samples_due_.passOver(pacer_.tick(), clock_.now());
  noticeStop();
}

void SteppingLoop::waitWhileIdle() {
  idle_.exchange(kResting, std::memory_order_acq_rel);
  // A request before the flag was set has not woken this thread.
  if (commands_.read_available() == 0 && !isCalled() && clock_started_ == clock_.hasStarted()) {
    idle_.store(kWaiting, std::memory_order_release);
    clock_.waitUntil(PacingClock::kForever);
    // A submitter that has borrowed the simulation gives it back first; no tick is late while idle.
    int waiting = kWaiting;
    while (!idle_.compare_exchange_strong(waiting, kAwake, std::memory_order_acq_rel)) {
      waiting = kWaiting;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  } else {
    idle_.store(kAwake, std::memory_order_relaxed);
  }
  if (isCalled()) return;
  if (commands_.read_available() > 0) {
    // They count and are rejected now; their effect shows in the next sample.
    applyCommands();
    pushSnapshot(false);
  }
}

void SteppingLoop::applyCommands() {
  InputCommand command;
  while (commands_.pop(command)) applyCommand(command);
}

void SteppingLoop::applyCommand(const InputCommand& command) {
  if (command.input == InputCommand::kRefused) {
    simulation_.command(command.input, std::numeric_limits<double>::quiet_NaN());
    return;
  }
  const bool was_clamped = !std::isnan(simulation_.firstClampedCommand(command.input));
  const CommandResult result = simulation_.command(command.input, command.value);
  if (result == CommandResult::kRefused || (result == CommandResult::kClamped && !was_clamped)) {
    odd_commands_.push(command);  // full: counted, but not reported
  }
}

void SteppingLoop::resetMotion(bool reset_time) {
  // Commands from before the reset are dropped with the motion that they were for.
  commands_.consume_all([](const InputCommand&) {});
  offset_ = reset_time ? 0 : sampleTime();
  present_ = 0;
  simulation_.reset();
  stop_noticed_ = false;
  anchor();
  pushSample();
}

void SteppingLoop::anchor() {
  anchor_ = present_;
  pacer_.anchor();
  samples_due_.countFrom(pacer_, clock_.now());
  moment_ = clock_.now();
  lateness_.clear();
  last_lateness_ = {};
  slice_count_ = 0;
  const std::int64_t now = clock_.wallTime();
  slice_starts_[0] = {now, present_};
  slice_end_ = now + kSliceLength;
  measured_factor_ = 0.0;
}

RunState SteppingLoop::state() const {
  if (!simulation_.status().ok()) return RunState::kStopped;
  if (paused_) return RunState::kPaused;
  return simulation_.isSleeping() ? RunState::kSleeping : RunState::kRunning;
}

std::string SteppingLoop::describeStop() {
  std::string text = simulation_.describeStatus();
  const std::size_t end = text.find(": ");
  if (offset_ == 0 || end == std::string::npos) return text;
  return text.insert(end, " (of the motion since ~reset or ~set_state; 'time' of messages is " +
                              formatNumber(toSeconds(sampleTime())) + " s)");
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
  // The motion stopped between two ticks.
  return offset_ + std::llround(status.time * kNanosecondsPerSecond);
}

TimedSample SteppingLoop::takeSample() {
  TimedSample timed;
  timed.topics = wanted();
  simulation_.trackEnergy(timed.topics[kEnergy]);
  timed.sample = simulation_.sample();
  quantity_count_ = 0;
  for (const QuantityGroup group : kQuantityGroups) {
    if (!timed.topics[static_cast<std::size_t>(group)]) continue;
    simulation_.calcQuantities(group, quantities_.data() + quantity_count_);
    quantity_count_ += simulation_.quantityNames(group).size();
  }
  timed.time = sampleTime();
  pushEvents();  // of commands
  std::copy(std::begin(timed.sample.residual), std::end(timed.sample.residual), residual_.begin());
  timed.clock_time = followed_ ? moment_ : clock_.now();
  return timed;
}

void SteppingLoop::handOver(const TimedSample& sample) {
  samples_.push(sample, quantities_.data(), quantity_count_);
  sample_news_.post();
}

void SteppingLoop::pushSample() {
  handOver(takeSample());
  // The jump of commands is carried out by sampling, and can fail.
  noticeStop();
}

void SteppingLoop::pushEvents() {
  const bool is_wanted = wanted()[kEvents];
  const std::uint64_t lost = simulation_.lostModeEvents();
  if (is_wanted) lost_events_.fetch_add(lost - lost_seen_, std::memory_order_relaxed);
  lost_seen_ = lost;
  TimedEvent timed;
  bool has_news = false;
  while (simulation_.takeModeEvent(&timed.event)) {
    if (!is_wanted) continue;
    timed.time = offset_ + std::llround(timed.event.time * kNanosecondsPerSecond);
    timed.clock_time = followed_ ? moment_ : clock_.now();
    events_.push(timed);
    has_news = true;
  }
  if (has_news) sample_news_.post();
}

void SteppingLoop::endSliceIfDue(std::int64_t now) {
  if (now < slice_end_) return;
  ++slice_count_;
  constexpr std::int64_t kSlices = LatenessWindow::kSlices;
  // The oldest start kept: that of the slice kSlices before this one, or the anchor.
  const std::int64_t oldest = std::max<std::int64_t>(0, slice_count_ - kSlices);
  const SliceStart& start = slice_starts_[static_cast<std::size_t>(oldest % kSlices)];
  if (now > start.wall_time) {
    measured_factor_ =
        static_cast<double>(present_ - start.time) / static_cast<double>(now - start.wall_time);
  }
  slice_starts_[static_cast<std::size_t>(slice_count_ % kSlices)] = {now, present_};
  slice_end_ = std::max(slice_end_ + kSliceLength, now);
  const LatenessHistogram window = lateness_.total();
  last_lateness_ = {window.quantile(0.5), window.quantile(0.99), window.max()};
  catchUp();
  // Sampling, like a command, may make inputs jump, and a jump can fail.
  const Sample& sample = simulation_.sample();
  std::copy(std::begin(sample.residual), std::end(sample.residual), residual_.begin());
  if (noticeStop()) return;
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
    snapshot.real_time_factor = measured_factor_;
  snapshot.wanted_factor = followed_ ? 0.0 : real_time_factor_;
  snapshot.waiting_for_clock = !clock_started_;
  snapshot.is_preparing = is_preparing_;
  snapshot.residual = residual_;
  snapshot.pacing = pacer_.counters();
  snapshot.lateness = last_lateness_;
  snapshot.statistics = simulation_.statistics();
  snapshot.energy_doubt = simulation_.energyDoubt();
  if (snapshot.state == RunState::kStopped) {
    // The motion is over, so no tick is delayed if this allocates.
    const std::string text = describeStop();
    std::copy_n(text.begin(), std::min(text.size(), snapshot.stop_message.size() - 1),
                snapshot.stop_message.begin());
  }
  snapshots_.push(snapshot);
  if (state_changed) news_.post();
}

}  // namespace variator_sim
