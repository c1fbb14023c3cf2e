#include "ros/simulation_server.h"

#include <sched.h>
#include <sys/mman.h>

#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <utility>

#include "model/number_text.h"
#include "model/thrown.h"
#include "ros/nanoseconds.h"
#include "ros/poll_thread_task.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

constexpr std::int64_t kStatusPeriod = 100000000;        // ns: 10 Hz
constexpr std::int64_t kDiagnosticsPeriod = 1000000000;  // ns: 1 Hz
constexpr std::uint32_t kCommandQueue = 1000;            // messages
constexpr std::uint32_t kStateQueue = 100;               // messages
constexpr std::uint32_t kEventQueue = 1000;              // messages
constexpr std::uint32_t kClockQueue = 100;               // messages
constexpr std::int64_t kClockPatience = 5000000000;      // ns: then the log reports the wait

// Real-time priority and locked memory of Linux. An ordinary user may lack the right to both; then
// the node runs without them and logs it.

/// Sets SCHED_FIFO with `priority` (1 to 99). Returns why not and the remedy, or "".
std::string setRealTimePriority(std::thread& thread, int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
  if (error == 0) return "";
  return "realtime_priority " + std::to_string(priority) + " is not permitted (" +
         std::strerror(error) +
         "): going on without it. It needs root, CAP_SYS_NICE, or a line '<user> - rtprio 99' in "
         "/etc/security/limits.conf.";
}

/// Locks the pages that the process has mapped by now, from their next use on. Later mappings are
/// not locked: a running stepping loop maps nothing more, and a limit can fail no later allocation.
/// Returns why not and the remedy, or "".
std::string lockMemory() {
  if (mlockall(MCL_CURRENT | MCL_ONFAULT) == 0) return "";
  return std::string("lock_memory is not permitted (") + std::strerror(errno) +
         "): going on without it. It needs root, CAP_IPC_LOCK, or a line '<user> - memlock "
         "unlimited' in /etc/security/limits.conf.";
}

ClockRole roleFor(const NodeSettings& settings) {
  if (settings.publish_clock) return ClockRole::kOwner;
  return ros::Time::isSystemTime() ? ClockRole::kWall : ClockRole::kFollower;
}

std::vector<std::vector<std::string>> listQuantities(const Simulation& simulation) {
  std::vector<std::vector<std::string>> names;
  names.reserve(kQuantityGroups.size());
  for (const QuantityGroup group : kQuantityGroups) {
    names.push_back(simulation.quantityNames(group));
  }
  return names;
}

/// Returns the other nodes that publish /clock, by the master.
std::vector<std::string> listOtherClocks() {
  XmlRpc::XmlRpcValue arguments, response, state;
  arguments[0] = ros::this_node::getName();
  std::vector<std::string> others;
  if (!ros::master::execute("getSystemState", arguments, response, state, false)) return others;
  XmlRpc::XmlRpcValue& topics = state[0];
  for (int i = 0; i < topics.size(); ++i) {
    if (static_cast<std::string&>(topics[i][0]) != "/clock") continue;
    for (int n = 0; n < topics[i][1].size(); ++n) {
      const auto& name = static_cast<std::string&>(topics[i][1][n]);
      if (name != ros::this_node::getName()) others.push_back(name);
    }
  }
  return others;
}

/// Returns a handle whose callbacks, and those of handles made from it, come in the queue.
ros::NodeHandle withQueue(ros::NodeHandle handle, ros::CallbackQueue& queue) {
  handle.setCallbackQueue(&queue);
  return handle;
}

/// Publishes a message that subscribers in the same process share.
template <class Message>
void publish(const ros::Publisher& publisher, const ros::Time& stamp, Message message) {
  message.header.stamp = stamp;
  publisher.publish(boost::make_shared<const Message>(std::move(message)));
}

}  // namespace

SimulationServer::SimulationServer(const ros::NodeHandle& public_handle,
                                   const ros::NodeHandle& private_handle, Simulation simulation,
                                   const NodeSettings& settings,
                                   const std::function<void()>& preparation)
    : public_handle_(withQueue(public_handle, callback_queue_)),
      private_handle_(withQueue(private_handle, callback_queue_)),
      scene_(simulation.scene()),
      has_errors_(!simulation.describeErrorEstimate().empty()),
      quantity_names_(listQuantities(simulation)),
      scene_message_(toSceneInfo(simulation)),
      role_(roleFor(settings)),
      loop_(std::move(simulation), settings,
            role_ == ClockRole::kFollower ? static_cast<PacingClock&>(followed_clock_)
                                          : steady_clock_),
      quantities_(loop_.quantityCount()),
      update_diagnostics_(
          serveDiagnostics(public_handle_, private_handle_, scene_message_.constraints)),
      live_settings_(
          serveSettings(private_handle_, settings, role_ == ClockRole::kFollower, loop_)) {
  advertiseTopics();
  subscribeToCommands();
  ros::NodeHandle pause_handle = withQueue(private_handle_, pause_queue_);
  services_ = advertiseServices(scene_, has_errors_, loop_, private_handle_, pause_handle);
  setUpClock();
  if (role_ == ClockRole::kFollower && settings.real_time_factor != 1.0) {
    warn(
        printed("real_time_factor %g is left aside: /use_sim_time is true, so /clock sets the pace",
                settings.real_time_factor));
  }
  startThreads(settings, preparation);
}

SimulationServer::~SimulationServer() {
  stopping_.store(true);
  sample_task_.reset();
  loop_.stop();
  callback_queue_.disable();
  pause_queue_.disable();
  if (preparation_thread_.joinable()) preparation_thread_.join();
  callback_thread_.join();
  pause_thread_.join();
  stepping_thread_.join();
  status_thread_.join();
}

void SimulationServer::warn(const std::string& text) const {
  if (!text.empty()) ROS_WARN("%s: %s", private_handle_.getNamespace().c_str(), text.c_str());
}

void SimulationServer::advertiseTopics() {
  // A new subscriber is served from the next tick on, without polling; while there is no next tick,
  // with the state that stands. One that goes is noticed with the next status.
  const ros::SubscriberStatusCallback refresh = [this](const ros::SingleSubscriberPublisher&) {
    refreshDemand();
  };
  const auto greet = [this](const ros::SingleSubscriberPublisher& subscriber) {
    refreshDemand();
    showState(subscriber);
  };
  publishers_[kStates] = private_handle_.advertise<DrivetrainState>("state", kStateQueue, greet);
  publishers_[kEnergy] =
      private_handle_.advertise<DrivetrainEnergy>("energy", kStateQueue, refresh);
  publishers_[kEvents] = private_handle_.advertise<Event>("events", kEventQueue, refresh);
  for (const QuantityGroup group : kQuantityGroups) {
    publishers_[static_cast<std::size_t>(group)] =
        private_handle_.advertise<NamedValues>(toString(group), kStateQueue, refresh);
  }
  publishers_[kJoints] =
      public_handle_.advertise<sensor_msgs::JointState>("joint_states", kStateQueue, refresh);
  scene_publisher_ = private_handle_.advertise<SceneInfo>("scene", 1, /*latch=*/true);
  status_publisher_ = private_handle_.advertise<SimulationStatus>("status", 10);
  scene_publisher_.publish(scene_message_);
}

void SimulationServer::subscribeToCommands() {
  for (std::size_t i = 0; i < scene_.inputs.size(); ++i) {
    if (scene_.inputs[i].kind != InputKind::kCommanded) continue;
    const int input = static_cast<int>(i);
    const boost::function<void(const std_msgs::Float64ConstPtr&)> receive =
        [this, input](const std_msgs::Float64ConstPtr& message) {
          loop_.command({input, message->data});
        };
    command_subscribers_.push_back(private_handle_.subscribe<std_msgs::Float64>(
        scene_.inputs[i].topic, kCommandQueue, receive, ros::VoidConstPtr(),
        ros::TransportHints().tcpNoDelay()));
  }
  const boost::function<void(const CommandsConstPtr&)> receive_group =
      [this](const CommandsConstPtr& message) { receiveCommands(*message); };
  group_subscriber_ =
      private_handle_.subscribe<Commands>("commands", kCommandQueue, receive_group,
                                          ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void SimulationServer::receiveCommands(const Commands& message) {
  std::vector<InputCommand> commands;
  const std::string fault = readCommands(scene_.inputs, message.topics, message.values, commands);
  if (fault.empty()) {
    loop_.commandTogether(commands.data(), commands.size());
    return;
  }
  loop_.command({InputCommand::kRefused, 0.0});
  if (!refused_group_log_.passes(steady_clock_.now())) return;
  ROS_WARN("Refused a message on %s: %s", group_subscriber_.getTopic().c_str(), fault.c_str());
}

void SimulationServer::setUpClock() {
  if (role_ == ClockRole::kOwner) {
    // A subscriber that comes while time stands still has to learn the time.
    const ros::SubscriberStatusCallback greet = [this](const ros::SingleSubscriberPublisher&) {
      refreshDemand();
      clock_requested_.store(true);
      loop_.sampleNews().post();
    };
    publishers_[kClock] =
        public_handle_.advertise<rosgraph_msgs::Clock>("/clock", kClockQueue, greet);
    if (ros::Time::isSystemTime()) {
      warn(
          "publish_clock is true, but /use_sim_time is not: other nodes stay on the wall clock. "
          "Set "
          "/use_sim_time before they start.");
    }
    const std::vector<std::string> others = listOtherClocks();
    if (!others.empty()) {
      warn(
          "publish_clock is true, and /clock is published by " + join(others, ", ") +
          ", too: nodes that follow it are set back again and again. Only one node may publish it: "
          "leave publish_clock out here, or end the other one.");
    }
  } else if (role_ == ClockRole::kFollower) {
    using ClockEvent = ros::MessageEvent<const rosgraph_msgs::Clock>;
    const boost::function<void(const ClockEvent&)> receive = [this](const ClockEvent& event) {
      receiveClock(static_cast<std::int64_t>(event.getConstMessage()->clock.toNSec()),
                   event.getPublisherName());
    };
    ros::SubscribeOptions options;
    options.initByFullCallbackType<const ClockEvent&>("/clock", kClockQueue, receive);
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    clock_subscriber_ = public_handle_.subscribe(options);
    ROS_INFO("%s: /use_sim_time is true: simulated time follows /clock",
             private_handle_.getNamespace().c_str());
  }
}

void SimulationServer::receiveClock(std::int64_t time, const std::string& publisher) {
  if (publisher != clock_publisher_name_) {
    const std::string earlier = std::exchange(clock_publisher_name_, publisher);
    // (One that is started anew, or another one behind it, is no second one.)
    if (!earlier.empty() && !two_clocks_told_ && clock_subscriber_.getNumPublishers() > 1) {
      two_clocks_told_ = true;
      warn("/clock comes from " + earlier + " and from " + publisher +
           ": the motion starts anew whenever one sets the other back. Only one node may publish "
           "it.");
    }
  }
  const std::int64_t before = followed_clock_.now();
  if (!followed_clock_.set(time) || !jump_back_log_.passes(steady_clock_.now())) return;
  warn(printed("/clock has jumped back from %.3f s to %.3f s (jump %llu): the motion starts anew",
               toSeconds(before), toSeconds(time),
               static_cast<unsigned long long>(followed_clock_.jumpsBack())));
}

void SimulationServer::startThreads(const NodeSettings& settings,
                                    const std::function<void()>& preparation) {
  status_thread_ = std::thread([this] { runStatus(); });
  sample_task_ = runOnPollThread(loop_.sampleNews(), [this] { publishSamples(); });
  if (preparation) loop_.beginPreparation();
  stepping_thread_ = std::thread([this] { loop_.run(); });
  if (settings.realtime_priority > 0) {
    warn(setRealTimePriority(stepping_thread_, settings.realtime_priority));
  }
  if (settings.lock_memory) warn(lockMemory());
  callback_thread_ = std::thread([this] { runCallbacks(callback_queue_); });
  pause_thread_ = std::thread([this] { runCallbacks(pause_queue_); });
  if (!preparation) return;
  preparation_thread_ = std::thread([this, preparation] {
    const Interruption interruption([this] { return stopping_.load() || ros::isShuttingDown(); });
    try {
      preparation();
    } catch (...) {
      const std::string reason = describeThrown();
      if (!Interruption::isWanted()) ROS_WARN("formulas are not compiled: %s", reason.c_str());
    }
    loop_.endPreparation();
  });
}

void SimulationServer::runCallbacks(ros::CallbackQueue& queue) const {
  // A callback wakes the queue, and so does its end. ros::AsyncSpinner would poll ten times a
  // second.
  while (!stopping_.load(std::memory_order_relaxed)) {
    queue.callAvailable(ros::WallDuration(1.0));
  }
}

void SimulationServer::refreshDemand() {
  Topics wanted;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i] = publishers_[i].getNumSubscribers() > 0;
  }
  loop_.setWanted(wanted);
}

void SimulationServer::showState(const ros::SingleSubscriberPublisher& subscriber) {
  const LoopAnswer answer = loop_.submit({RequestKind::kSample});
  if (answer.result != RequestResult::kDone) return;
  const TimedSample& timed = answer.sample;
  DrivetrainState message = toState(timed.sample, toSeconds(timed.time), scene_, has_errors_);
  message.header.stamp = stampOf(timed.time, timed.clock_time);
  subscriber.publish(message);
}

void SimulationServer::runStatus() {
  started_at_ = steady_clock_.now();
  // (The loop's first state comes by itself; before there is none to tell.)
  std::int64_t next_status = started_at_ + kStatusPeriod;
  std::int64_t next_diagnostics = started_at_ + kDiagnosticsPeriod;
  while (!stopping_.load(std::memory_order_relaxed)) {
    loop_.waitForNews(next_status);
    logOddCommands();
    LoopSnapshot snapshot;
    bool state_changed = false;
    while (loop_.popSnapshot(snapshot)) {
      snapshot_ = snapshot;
      if (!snapshot.state_changed) continue;
      state_changed = true;
      publishStatus();
      if (snapshot.state == RunState::kStopped) {
        ROS_ERROR("%s: the motion has stopped; ~reset brings it back. %s",
                  private_handle_.getNamespace().c_str(), snapshot.stop_message.data());
      }
    }
    logReactionEnergy();
    const std::int64_t now = steady_clock_.now();
    if (now >= next_status) {
      if (!state_changed) publishStatus();
      refreshDemand();
      logTimeTrouble(now);
      next_status = now + kStatusPeriod;
    }
    if (now >= next_diagnostics) {
      update_diagnostics_(snapshot_);
      next_diagnostics = now + kDiagnosticsPeriod;
    }
  }
}

ros::Time SimulationServer::stampOf(std::int64_t time, std::int64_t clock_time) {
  if (role_ == ClockRole::kOwner) return toStamp(time);
  if (role_ == ClockRole::kFollower) return toStamp(clock_time);
  // The stepping thread reads no ROS time: the age of the sample is known on the pacing clock.
  const ros::Duration age = ros::Duration().fromNSec(steady_clock_.now() - clock_time);
  const ros::Time now = ros::Time::now();
  return now.toSec() > age.toSec() ? now - age : now;
}

void SimulationServer::publishEvents() {
  TimedEvent timed;
  while (loop_.popEvent(timed)) {
    publish(publishers_[kEvents], stampOf(timed.time, timed.clock_time),
            toMessage(timed, scene_.eventNames()));
  }
  const std::uint64_t lost = loop_.droppedEvents();
  if (lost == 0 || lost_events_told_) return;
  lost_events_told_ = true;
  warn(
      std::to_string(lost) +
      " events were lost: more came between two samples than are kept, or than could be published; "
      "this is told once");
}

void SimulationServer::publishSamples() {
  const auto is_read = [this](std::size_t topic) {
    return publishers_[topic].getNumSubscribers() > 0;
  };
  TimedSample timed;
  while (loop_.popSample(timed, quantities_.data())) {
    if (role_ == ClockRole::kOwner) {
      // The clock precedes the messages stamped with it.
      published_time_ = timed.time;
      publishClock();
    }
    const Sample& sample = timed.sample;
    const ros::Time stamp = stampOf(timed.time, timed.clock_time);
    const double time = toSeconds(timed.time);
    if (is_read(kStates)) {
      publish(publishers_[kStates], stamp, toState(sample, time, scene_, has_errors_));
    }
    const double* values = quantities_.data();
    for (std::size_t i = 0; i < quantity_names_.size(); ++i) {
      if (!timed.topics[i]) continue;
      if (is_read(i)) publish(publishers_[i], stamp, toMessage(values, time, quantity_names_[i]));
      values += quantity_names_[i].size();
    }
    if (timed.topics[kEnergy] && is_read(kEnergy)) {
      publish(publishers_[kEnergy], stamp, toMessage(sample.energy, time));
    }
    if (is_read(kJoints)) publish(publishers_[kJoints], stamp, toJointState(sample, scene_));
  }
  publishEvents();
  if (clock_requested_.exchange(false)) publishClock();
}

void SimulationServer::publishClock() {
  if (publishers_[kClock].getNumSubscribers() == 0) return;
  rosgraph_msgs::Clock message;
  message.clock = toStamp(published_time_);
  publishers_[kClock].publish(message);
}

void SimulationServer::publishStatus() {
  snapshot_.commands_dropped = loop_.droppedCommands();
  snapshot_.samples_dropped = loop_.droppedSamples();
  if (status_publisher_.getNumSubscribers() == 0) return;
  publish(status_publisher_,
          role_ == ClockRole::kOwner ? toStamp(snapshot_.time) : ros::Time::now(),
          toMessage(snapshot_));
}

void SimulationServer::logTimeTrouble(std::int64_t now) {
  if (snapshot_.waiting_for_clock && !waiting_told_ && now - started_at_ > kClockPatience) {
    waiting_told_ = true;
    warn("waiting for /clock: /use_sim_time is true, and no time has come yet");
  }
  const std::int64_t lost = snapshot_.pacing.lost_time;
  if (lost > lost_time_ && lost_time_log_.passes(now)) {
    warn(printed("fell behind its clock for good by %.3f s (%.3f s in all); nothing was skipped",
                 toSeconds(lost - lost_time_), toSeconds(lost)));
    lost_time_ = lost;
  }
}

void SimulationServer::logReactionEnergy() {
  if (reaction_energy_told_ || !snapshot_.energy_doubt.exists()) return;
  reaction_energy_told_ = true;  // once, also when resets make the same motion again and again
  warn(describe(snapshot_.energy_doubt));
}

void SimulationServer::logOddCommands() {
  InputCommand command;
  while (loop_.popOddCommand(command)) {
    const CommandInputSettings& input = scene_.inputs[static_cast<std::size_t>(command.input)];
    const std::string topic = private_handle_.resolveName(input.topic);
    if (std::isfinite(command.value)) {
      ROS_WARN("%s: %s", topic.c_str(), describeClamped(input, command.value).c_str());
    } else if (refused_log_.passes(steady_clock_.now())) {
      ROS_WARN("Refused %g on %s: commands must be finite.", command.value, topic.c_str());
    }
  }
}

}  // namespace variator_sim
