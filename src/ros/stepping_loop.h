/// The stepping thread and its mailboxes. It does not depend on ROS.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "ros/loop_messages.h"
#include "ros/node_settings.h"
#include "ros/sample_ring.h"
#include "ros/sample_schedule.h"
#include "ros/wakeup.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// Owns the Simulation and advances it tick by tick in `run`, which one thread calls. Per tick that
/// thread takes no lock and allocates nothing; it hands over samples and takes commands through
/// wait-free queues, and wakes others by an eventfd (samples) and a semaphore.
///
/// Simulated time is kept in whole nanoseconds. Tick n after an anchor (start, resume, reset)
/// stands at round(n 1e9 / tick_rate) ns after it, and a time in s is the quotient ns / 1e9: the
/// double nearest to the decimal that a user would write, so `simulate` can be given the same
/// instants. After a reset the scene's own time starts at 0 again, while the time of samples goes
/// on from an offset.
///
/// A command takes effect at the first tick after its arrival; while paused, at the present.
///
/// While the motion sleeps, only ticks with a sample or a status are needed: the thread waits for
/// the next of these, or for a wake-up, and skips the ticks between. A tick only moves the current
/// time of a sleeping motion, so times, samples and commands are those of a loop that makes every
/// tick.
///
/// On a followed clock the first tick waits until the clock has started, simulated time stands
/// while the clock does, and a jump back is a reset of motion and time.
class SteppingLoop {
 public:
  /// `clock` must outlive the loop.
  SteppingLoop(Simulation simulation, const NodeSettings& settings, PacingClock& clock);

  /// Returns after `stop`.
  void run();
  /// Holds the motion, before `run`, at the current time until `endPreparation`, while machine code
  /// is compiled; requests are served.
  void beginPreparation() { is_preparing_ = true; }

  // For one thread that commands.
  /// Queues a command, wait-free. A full queue drops and counts it.
  void command(const InputCommand& command) { commandTogether(&command, 1); }
  /// Queues commands that take effect at one instant.
  void commandTogether(const InputCommand* commands, std::size_t count);

  // For one thread that publishes samples.
  /// `quantities`, if wanted, gets the values of the sample's groups and has room for those of all.
  bool popSample(TimedSample& sample, double* quantities = nullptr) {
    return samples_.pop(sample, quantities);
  }
  bool popEvent(TimedEvent& event) { return events_.pop(event); }
  std::size_t quantityCount() const { return quantities_.size(); }
  /// The event posted when there is a sample to pop.
  EventDescriptor& sampleNews() { return sample_news_; }

  // For one thread that reports on the loop.
  bool popSnapshot(LoopSnapshot& snapshot) { return snapshots_.pop(snapshot); }
  /// Pops a command that was rejected for being NaN or infinite, or the first one to its input that
  /// was clamped.
  bool popOddCommand(InputCommand& command) { return odd_commands_.pop(command); }
  /// Sleeps until the state changes, the loop ends, or `deadline` (ns on CLOCK_MONOTONIC).
  void waitForNews(std::int64_t deadline) { news_.waitUntil(deadline); }

  // For any thread.
  /// Hands the request over and waits until the stepping thread has served it; serves it itself
  /// when that thread has nothing to do. One at a time: others wait for their turn, but a step that
  /// goes on for more than kPatience of wall time ends for a pause, and a tick for any request.
  LoopAnswer submit(const LoopRequest& request);
  /// Begins the motion: machine code is in the cache, or there is none.
  void endPreparation();
  std::uint64_t droppedCommands() const {
    return dropped_commands_.load(std::memory_order_relaxed);
  }
  std::uint64_t droppedSamples() const { return samples_.dropped(); }
  std::uint64_t droppedEvents() const {
    return events_.dropped() + lost_events_.load(std::memory_order_relaxed);
  }
  /// Selects what samples have, which are taken at publish_rate if anything is wanted of them.
  void setWanted(Topics topics);
  /// Ends `run`; requests from then on, and one under way, are answered with kShutDown.
  void stop();
  /// Sets the simulated s per s of the clock, >= 0 (0: unpaced), from the current time on:
  /// deadlines count anew, which causes neither a burst nor a stall. No effect on a followed clock,
  /// which sets the pace.
  void setRealTimeFactor(double factor) { change(wanted_factor_, factor); }
  /// Sets the states per s of the clock, > 0 and at most the tick rate.
  void setPublishRate(double rate) { change(wanted_publish_rate_, rate); }

 private:
  static constexpr std::int64_t kSliceLength = 100000000;  ///< of the windows, ns
  static constexpr std::int64_t kPatience = 200000000;     ///< of requests, ns

  enum Idleness : int { kAwake, kResting, kWaiting, kLent };

  Topics wanted() const { return wanted_.load(std::memory_order_relaxed); }
  bool areSamplesWanted() const { return wanted().reset(kEvents).any(); }
  bool isStopping() const { return stopping_.load(std::memory_order_relaxed); }
  bool isIdle() const {
    return paused_ || !clock_started_ || is_preparing_ || !simulation_.status().ok();
  }
  bool isCalled() const;
  /// Returns whether the stepping thread has to end an advance of the motion early.
  bool hasToYield();
  void wakeIfIdle();
  void change(std::atomic<double>& setting, double value);
  /// Applies settings and times that other threads have requested without waiting.
  void noticeChanges();
  void noticeClock();
  void applySettings();
  RunState state() const;
  /// Describes the stop, and its time as messages show it where the scene's own is another one.
  std::string describeStop();
  void tick();
  /// Returns false, and stops the motion, when simulated time ends before.
  bool moveToTick();
  /// Advances the simulation to the current time. An interruption sets that back to the time of the
  /// motion.
  void catchUp();
  /// At rest: waits until a tick is needed and skips those before it.
  void passOverRest();
  void waitWhileIdle();
  void serveRequest();
  /// Serves a request on the submitter's thread while the stepping thread is idle; returns false
  /// when it is not. Spares a controller in lockstep two thread switches per step.
  bool serveWhileIdle(const LoopRequest& request, LoopAnswer& answer);
  void serveStep();
  void serveState();
  void resetMotion(bool reset_time);
  void applyCommands();
  void applyCommand(const InputCommand& command);
  /// Counts ticks and deadlines from the current time.
  void anchor();
  /// Called after each action that may stop the motion; returns true when it has just stopped.
  bool noticeStop();
  /// Samples the simulation at its own time, which is the current one after `catchUp`. The
  /// quantities are in `quantities_` until the next call.
  TimedSample takeSample();
  /// Passes the sample just taken to the publishing thread and wakes it.
  void handOver(const TimedSample& sample);
  void pushSample();
  /// Passes on the events up to the simulation's time.
  void pushEvents();
  void pushSnapshot(bool state_changed);
  void endSliceIfDue(std::int64_t now);
  /// Simulated time of the simulation, ns, offset included.
  std::int64_t sampleTime();

  /// The values of the last sample's groups, the stepping thread's own.
  std::vector<double> quantities_;
  std::size_t quantity_count_ = 0;

  // Shared.
  boost::lockfree::spsc_queue<InputCommand, boost::lockfree::capacity<4096>> commands_;
  boost::lockfree::spsc_queue<InputCommand, boost::lockfree::capacity<64>> odd_commands_;
  SampleRing<TimedSample, 256> samples_;
  SampleRing<TimedEvent, 1024> events_;
  SampleRing<LoopSnapshot, 16> snapshots_;
  LoopRequest request_;  ///< the submitter's until posted, the stepping thread's until answered
  LoopAnswer answer_;
  std::mutex submitting_;
  std::atomic<bool> pause_wanted_{false};
  std::atomic<bool> prepared_{false};
  std::atomic<bool> request_posted_{false};
  std::atomic<bool> stopping_{false};
  /// Not kAwake: a command has to wake the stepping thread. The thread that moves it from kWaiting
  /// to kLent owns the stepping thread's data until it moves it back.
  std::atomic<int> idle_{kAwake};
  std::atomic<Topics> wanted_{Topics()};
  std::atomic<bool> settings_changed_{false};
  std::atomic<double> wanted_factor_;
  std::atomic<double> wanted_publish_rate_;
  std::atomic<std::uint64_t> dropped_commands_{0};
  std::atomic<std::uint64_t> lost_events_{0};  ///< before they were taken
  EventDescriptor sample_news_;
  Semaphore news_;
  Semaphore answered_;

  // The stepping thread's own.
  PacingClock& clock_;
  bool followed_;
  Pacer pacer_;
  Simulation simulation_;
  double tick_rate_;
  double real_time_factor_;
  SampleSchedule samples_due_;
  bool paused_;
  bool is_preparing_ = false;
  bool is_serving_ = false;
  std::int64_t asked_since_ = 0;  ///< during this advance, ns on CLOCK_MONOTONIC; 0: not yet
  bool clock_started_ = false;
  std::uint64_t jumps_back_ = 0;  ///< of the clock, those served
  bool stop_noticed_ = false;
  std::uint64_t lost_seen_ = 0;  ///< events
  std::int64_t offset_ = 0;      ///< sample time minus the scene's time, ns
  std::int64_t present_ = 0;     ///< the scene's time, ns
  std::int64_t anchor_ = 0;      ///< the scene's time at tick 0, ns
  std::int64_t moment_ = 0;      ///< when the last tick was due, ns on the clock

  /// A ring of the starts of the windows' last slices.
  struct SliceStart {
    std::int64_t wall_time = 0;  ///< ns
    std::int64_t time = 0;       ///< the scene's, ns
  };
  std::array<SliceStart, LatenessWindow::kSlices> slice_starts_{};
  std::int64_t slice_count_ = 0;
  std::int64_t slice_end_ = 0;
  double measured_factor_ = 0.0;
  std::array<double, kMaxConstraints> residual_{};
  LatenessWindow lateness_;
  Lateness last_lateness_;  ///< in that window at the end of the last slice
};

}  // namespace variator_sim
