/// The thread that steps, and its mailboxes. It knows nothing of ROS.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <mutex>
#include <vector>

#include "ros/event_descriptor.h"
#include "ros/lateness.h"
#include "ros/loop_messages.h"
#include "ros/node_settings.h"
#include "ros/pacer.h"
#include "ros/sample_ring.h"
#include "ros/sample_schedule.h"
#include "ros/semaphore.h"
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
/// A tick whose instant lies inside a step already made moves the present alone: the simulation
/// follows when a sample, a command or the status asks for it, or the next step is due. What it is
/// asked is the same, and so are steps, stops and samples; but code and data that have left the
/// processor's caches since the last tick need not come back for nothing.
///
/// While the motion sleeps nobody needs ticks but those with a sample or a status: the thread waits
/// for the next of these, or until it is woken, and the ticks between are passed over. What a tick
/// of a sleeping motion does to it is move the present, so times, samples and commands are those of
/// a loop that makes every tick.
///
/// On a followed clock the first tick waits until the clock has started, simulated time stands
/// while the clock does, and a jump back is a reset of motion and time.
class SteppingLoop {
 public:
  /// `clock` must outlive the loop.
  SteppingLoop(Simulation simulation, const NodeSettings& settings, PacingClock& clock);

  /// @name For the thread that steps
  /// @{
  /// Returns after `stop`.
  void run();
  /// @}

  /// @name Before `run`
  /// @{
  /// Holds the motion at its present until `endPreparation`, for machine code that is being
  /// compiled meanwhile; requests are served.
  void beginPreparation() { is_preparing_ = true; }
  /// @}

  /// @name For one thread that commands
  /// @{
  /// Wait-free. A full queue drops the command and counts that.
  void command(const InputCommand& command) { commandTogether(&command, 1); }
  /// The same for some that take effect at one instant.
  void commandTogether(const InputCommand* commands, int count);
  /// @}

  /// @name For one thread that publishes samples
  /// @{
  /// `quantities`, if wanted, gets the values of the sample's groups and has room for those of all.
  bool popSample(TimedSample& sample, double* quantities = nullptr) {
    return samples_.pop(sample, quantities);
  }
  /// Of all groups.
  std::size_t quantityCount() const { return quantities_.size(); }
  /// Posted when there is something to pop.
  EventDescriptor& sampleNews() { return sample_news_; }
  /// @}

  /// @name For one thread that tells of the loop
  /// @{
  bool popSnapshot(LoopSnapshot& snapshot) { return snapshots_.pop(snapshot); }
  /// Comes before each snapshot of a stopped motion.
  bool popStopMessage(StopMessage& message) { return stop_messages_.pop(message); }
  /// A command that was refused for being NaN or infinite, or the first one to its input that was
  /// clamped.
  bool popOddCommand(InputCommand& command) { return odd_commands_.pop(command); }
  /// Sleeps until the state has changed, or the loop has ended, or until `deadline` (ns on
  /// CLOCK_MONOTONIC).
  void waitForNews(std::int64_t deadline) { news_.waitUntil(deadline); }
  /// @}

  /// @name For any thread
  /// @{
  /// Hands the request over and waits until the stepping thread has served it; serves it itself
  /// when that thread has nothing to do. One at a time: others wait for their turn, but a step that
  /// goes on for more than kPatience of wall time ends for a pause, and a tick for any request.
  LoopAnswer submit(const LoopRequest& request);
  /// Machine code is in the cache, or there is none: the motion begins.
  void endPreparation();
  std::uint64_t droppedCommands() const {
    return dropped_commands_.load(std::memory_order_relaxed);
  }
  std::uint64_t droppedSamples() const { return samples_.dropped(); }
  /// Whether anybody wants samples at publish_rate.
  void setSamplesWanted(bool wanted);
  /// Whether samples are to have the energies.
  void setEnergyWanted(bool wanted) { energy_wanted_.store(wanted, std::memory_order_relaxed); }
  /// Which groups of quantities samples are to have.
  void setQuantitiesWanted(QuantityGroups groups) {
    groups_wanted_.store(groups.bits(), std::memory_order_relaxed);
  }
  /// Ends `run`; requests from then on, and one under way, are answered with kShutDown.
  void stop();
  /// Simulated s per s of the clock, >= 0 (0: unpaced), from the present on: deadlines count anew,
  /// so neither a burst nor a stall comes of it. Nothing on a followed clock, which sets the pace.
  void setRealTimeFactor(double factor);
  /// States per s of the clock, > 0 and at most the tick rate.
  void setPublishRate(double rate);
  /// @}

 private:
  static constexpr std::int64_t kSliceLength = 100000000;  ///< of the windows, ns
  static constexpr std::int64_t kPatience = 200000000;     ///< of requests, ns

  enum Idleness : int { kAwake, kResting, kWaiting, kLent };

  bool isStopping() const { return stopping_.load(std::memory_order_relaxed); }
  bool isIdle() const {
    return paused_ || !clock_started_ || is_preparing_ ||
           (!isQuiet() && !simulation_.status().ok());
  }
  /// True while ticks have no need of the simulation, see Simulation::quietUntil.
  bool isQuiet() const { return present_ < quiet_until_; }
  bool isCalled() const;
  /// Whether an advance of the motion ends early, where it has come to: by whoever steps.
  bool hasToYield();
  void wakeIfIdle();
  /// What others have asked for without waiting: another time, other settings.
  void noticeChanges();
  void noticeClock();
  void applySettings();
  RunState state() const;
  void tick();
  /// False when simulated time ends before: the motion is stopped there.
  bool moveToTick();
  /// Brings the simulation to the present, which ticks may have moved alone. Interrupted, the
  /// present goes back to where the motion has come to.
  void catchUp();
  /// At rest: waits until a tick is needed and passes over those before it.
  void passOverRest();
  void waitWhileIdle();
  void serveRequest();
  /// On the submitter's thread, while the stepping thread waits for something to do: false when it
  /// does not wait. Spares a controller in lockstep two changes of thread per step.
  bool serveWhileIdle(const LoopRequest& request, LoopAnswer& answer);
  void serveStep();
  void serveState();
  void resetMotion(bool reset_time);
  void applyCommands();
  void applyCommand(const InputCommand& command);
  /// Ticks and deadlines count from the present.
  void anchor();
  /// After anything that may have ended the motion: true when it has just stopped.
  bool noticeStop();
  /// Of the simulation where it is: at the present, for those who have caught up. Its quantities
  /// are in `quantities_` until the next one is taken.
  TimedSample takeSample();
  /// To the thread that publishes, which is woken: the sample just taken.
  void handOver(const TimedSample& sample);
  void pushSample();
  void pushSnapshot(bool state_changed);
  void endSliceIfDue(std::int64_t now);
  /// Simulated ns of the simulation's present, offset included.
  std::int64_t sampleTime();

  /// The values of the last sample's groups, the stepping thread's own.
  std::vector<double> quantities_;
  std::size_t quantity_count_ = 0;

  // Shared.
  boost::lockfree::spsc_queue<InputCommand, boost::lockfree::capacity<4096>> commands_;
  boost::lockfree::spsc_queue<InputCommand, boost::lockfree::capacity<64>> odd_commands_;
  SampleRing<TimedSample, 256> samples_;
  SampleRing<LoopSnapshot, 16> snapshots_;
  SampleRing<StopMessage, 2> stop_messages_;
  LoopRequest request_;  ///< the submitter's until posted, the stepping thread's until answered
  LoopAnswer answer_;
  std::mutex submitting_;
  std::atomic<bool> pause_wanted_{false};
  std::atomic<bool> prepared_{false};
  std::atomic<bool> request_posted_{false};
  std::atomic<bool> stopping_{false};
  /// Not kAwake: a command has to wake the stepping thread. Whoever moves it from kWaiting to kLent
  /// owns all that is the stepping thread's, until he moves it back.
  std::atomic<int> idle_{kAwake};
  std::atomic<bool> samples_wanted_{false};
  std::atomic<bool> energy_wanted_{false};
  std::atomic<unsigned> groups_wanted_{0};
  std::atomic<bool> settings_changed_{false};
  std::atomic<double> wanted_factor_;
  std::atomic<double> wanted_publish_rate_;
  std::atomic<std::uint64_t> dropped_commands_{0};
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
  std::int64_t offset_ = 0;       ///< sample time minus the scene's time, ns
  std::int64_t present_ = 0;      ///< the scene's time, ns
  std::int64_t quiet_until_ = 0;  ///< likewise, see isQuiet
  std::int64_t anchor_ = 0;       ///< the scene's time at tick 0, ns
  std::int64_t moment_ = 0;       ///< when the last tick was due, ns on the clock

  /// Where the last slices of the windows began: a ring.
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
  // Of that window at the end of the last slice, ns.
  std::int64_t lateness_p50_ = 0;
  std::int64_t lateness_p99_ = 0;
  std::int64_t lateness_max_ = 0;
};

}  // namespace variator_sim
