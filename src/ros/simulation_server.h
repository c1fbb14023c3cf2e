/// A simulation as a ROS node: the topics and services around one SteppingLoop.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <std_msgs/Float64.h>

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ros/checked_lists.h"
#include "ros/diagnostics.h"
#include "ros/message_conversion.h"
#include "ros/pacing_clock.h"
#include "ros/services.h"
#include "ros/stepping_loop.h"

namespace variator_sim {

/// Source of ticks and stamps.
enum class ClockRole {
  kWall,      ///< ticks by the wall clock, stamps by ROS time
  kFollower,  ///< /use_sim_time: ticks and stamps by /clock
  kOwner      ///< publish_clock: ticks by the wall clock, stamps by simulated time, told on /clock
};

/// Limits the rate of log lines of one kind.
class LogThrottle {
 public:
  /// `now` in ns.
  bool passes(std::int64_t now) {
    if (now < next_) return false;
    next_ = now + 1000000000;
    return true;
  }

 private:
  std::int64_t next_ = 0;
};

/// Four threads, each with its own part of the data, and a fifth that answers ~pause while a long
/// ~step occupies the callback thread:
///
///     callbacks --- commands (queue), one request at a time ---> stepping
///     stepping  --- samples -----------------------------------> poll thread of roscpp
///     stepping  --- snapshots, refused commands ---------------> status
///
/// The stepping thread runs the SteppingLoop and calls nothing of ROS, so neither a slow subscriber
/// nor a full socket delays a step. Samples are published in the thread that writes the sockets,
/// which spares waking another one; slow work, the diagnostics and the log, is the status thread's.
/// Callbacks have their own queue and one thread: the node's global queue is not used.
class SimulationServer {
 public:
  /// Advertises, subscribes and starts the threads. `public_handle` is for joint_states,
  /// `private_handle` for everything else. The motion begins after `preparation`, which compiles
  /// machine code in a thread of its own; null for none.
  SimulationServer(const ros::NodeHandle& public_handle, const ros::NodeHandle& private_handle,
                   Simulation simulation, const NodeSettings& settings,
                   const std::function<void()>& preparation);
  /// Ends the threads; a pending request fails.
  ~SimulationServer();

 private:
  void advertiseTopics();
  void subscribeToCommands();
  void setUpClock();
  void startThreads(const NodeSettings& settings, const std::function<void()>& preparation);

  // Callback thread.
  void runCallbacks(ros::CallbackQueue& queue) const;
  void refreshDemand();
  /// Tells a new subscriber the state where simulated time stands.
  void showState(const ros::SingleSubscriberPublisher& subscriber);
  /// `publisher`: the node that has sent it.
  void receiveClock(std::int64_t time, const std::string& publisher);
  void receiveCommands(const Commands& message);

  // Poll thread.
  void publishSamples();
  void publishEvents();
  void publishClock();

  // Any thread.
  /// Logs a warning, unless there is none.
  void warn(const std::string& text) const;
  /// `time` and `clock_time` as in TimedSample.
  ros::Time stampOf(std::int64_t time, std::int64_t clock_time);

  // Status thread.
  void runStatus();
  void publishStatus();
  void logTimeTrouble(std::int64_t now);
  void logOddCommands();
  void logReactionEnergy();

  ros::CallbackQueue callback_queue_;
  ros::CallbackQueue pause_queue_;
  ros::NodeHandle public_handle_;
  ros::NodeHandle private_handle_;

  // Constant after construction.
  const Scene scene_;
  const bool has_errors_;
  const std::vector<std::vector<std::string>> quantity_names_;  ///< of each group
  SceneInfo scene_message_;
  ClockRole role_;

  // Poll thread.
  std::int64_t published_time_ = 0;  ///< simulated time of /clock, ns
  bool lost_events_told_ = false;

  // Status thread.
  LoopSnapshot snapshot_;
  std::int64_t lost_time_ = 0;  ///< ns, as far as it was logged
  LogThrottle refused_log_;
  LogThrottle lost_time_log_;
  bool waiting_told_ = false;
  bool reaction_energy_told_ = false;
  std::int64_t started_at_ = 0;  ///< ns on the steady clock

  // Callback thread.
  LogThrottle refused_group_log_;
  LogThrottle jump_back_log_;
  bool two_clocks_told_ = false;
  std::string clock_publisher_name_;  ///< of the last time that came

  SteadyClock steady_clock_;
  FollowedClock followed_clock_;
  SteppingLoop loop_;
  std::vector<double> quantities_;            ///< of the sample being published
  std::atomic<bool> clock_requested_{false};  ///< /clock has a new subscriber
  std::atomic<bool> stopping_{false};

  // Publishers may be used by any thread.
  std::array<ros::Publisher, Topics().size()> publishers_;  ///< by Topic
  ros::Publisher scene_publisher_;
  ros::Publisher status_publisher_;
  std::function<void(const LoopSnapshot&)> update_diagnostics_;

  std::vector<ros::Subscriber> command_subscribers_;
  ros::Subscriber group_subscriber_;
  std::vector<ros::ServiceServer> services_;
  ros::Subscriber clock_subscriber_;
  std::shared_ptr<void> live_settings_;

  std::thread preparation_thread_;
  std::thread callback_thread_;
  std::thread pause_thread_;
  std::thread stepping_thread_;
  std::thread status_thread_;
  std::shared_ptr<void> sample_task_;
};

}  // namespace variator_sim
