// The running node, seen through its topics and services. Waits are for conditions, with a bound
// that only a failure reaches.
#include <ros/package.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/DrivetrainState.h>
#include <variator_sim/Event.h>
#include <variator_sim/NamedValues.h>
#include <variator_sim/SceneInfo.h>
#include <variator_sim/SimulationStatus.h>
#include <variator_sim/Step.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr auto kPatience = std::chrono::seconds(30);

using Commands = std::vector<std::pair<std::string, double>>;

std::string stepsScene() {
  return ros::package::getPath("variator_sim") + "/test/cases/torque_steps/scene.yaml";
}

/// All that one node says, and its services.
class Node {
 public:
  explicit Node(const std::string& name) : handle_("/" + name) {
    state_ = handle_.subscribe<DrivetrainState>(
        "state", 10000, [this](const DrivetrainStateConstPtr& m) { keep(states_, *m); });
    status_ = handle_.subscribe<SimulationStatus>(
        "status", 1000, [this](const SimulationStatusConstPtr& m) { keep(statuses_, *m); });
    scene_ = handle_.subscribe<SceneInfo>(
        "scene", 10, [this](const SceneInfoConstPtr& m) { keep(scenes_, *m); });
    EXPECT_TRUE(ros::service::waitForService("/" + name + "/step", 30000));
    // Status comes at 10 Hz: once it is heard, the node has had the time to meet us.
    EXPECT_TRUE(waitFor([this] {
      return !statuses_.empty() && !scenes_.empty() && state_.getNumPublishers() > 0;
    }));
    // A paused node publishes its state once more for each new subscriber.
    EXPECT_TRUE(waitFor(
        [this] { return statuses_.back().state != SimulationStatus::PAUSED || !states_.empty(); }));
  }

  std_srvs::Trigger::Response trigger(const std::string& service) {
    std_srvs::Trigger call;
    EXPECT_TRUE(client<std_srvs::Trigger>(service).call(call)) << service;
    return call.response;
  }

  Step::Response step(double duration, const Commands& commands = {}) {
    Step call;
    call.request.duration = duration;
    for (const auto& [topic, value] : commands) {
      call.request.command_topics.push_back(topic);
      call.request.command_values.push_back(value);
    }
    return step(call);
  }

  Step::Response step(Step& call) {
    EXPECT_TRUE(client<Step>("step").call(call));
    return call.response;
  }

  /// A publisher that the node listens to.
  ros::Publisher commander(const std::string& topic) {
    ros::Publisher publisher = handle_.advertise<std_msgs::Float64>(topic, 100);
    EXPECT_TRUE(waitFor([&] { return publisher.getNumSubscribers() > 0; }));
    return publisher;
  }

  template <class Condition>
  bool waitFor(Condition condition) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      // Some conditions change without a message.
      changed_.wait_for(lock, std::chrono::milliseconds(20));
    }
    return true;
  }

  /// A status that came after this call and meets the condition.
  template <class Condition>
  bool waitForStatus(Condition condition) {
    std::size_t seen = 0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      seen = statuses_.size();
    }
    return waitFor([&, seen]() mutable {
      for (; seen < statuses_.size(); ++seen) {
        if (condition(statuses_[seen])) return true;
      }
      return false;
    });
  }

  bool waitForState(std::uint8_t state) {
    return waitForStatus([state](const SimulationStatus& s) { return s.state == state; });
  }

  bool waitForStates(std::size_t count) {
    return waitFor([&] { return states_.size() >= count; });
  }

  std::vector<DrivetrainState> states() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return states_;
  }

  /// Torque of the first shaft in the last state received; for conditions.
  double lastTorque() const { return states_.empty() ? 0.0 : states_.back().applied_torque[0]; }

  /// Time of the last state received, or -1; for conditions.
  double lastTime() const { return states_.empty() ? -1.0 : states_.back().time; }

  void forgetStates() {
    const std::lock_guard<std::mutex> lock(mutex_);
    states_.clear();
  }

  SimulationStatus lastStatus() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return statuses_.back();
  }

  SceneInfo scene() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return scenes_.back();
  }

  ros::NodeHandle& handle() { return handle_; }

 private:
  /// Persistent: roscpp sometimes loses the answer of a call with a connection of its own
  /// (ros_comm issue 1976).
  template <class Service>
  ros::ServiceClient& client(const std::string& service) {
    ros::ServiceClient& client = clients_[service];
    if (!client.isValid()) client = handle_.serviceClient<Service>(service, /*persistent=*/true);
    return client;
  }

  template <class Message>
  void keep(std::vector<Message>& messages, const Message& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages.push_back(message);
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<DrivetrainState> states_;
  std::vector<SimulationStatus> statuses_;
  std::vector<SceneInfo> scenes_;
  ros::NodeHandle handle_;
  ros::Subscriber state_;
  ros::Subscriber status_;
  ros::Subscriber scene_;
  std::map<std::string, ros::ServiceClient> clients_;
};

bool sameBits(double a, double b) {
  return std::memcmp(&a, &b, sizeof(double)) == 0;
}

/// Every number of the message but its time has the bits of the sample's.
void expectSameBits(const DrivetrainState& message, const Sample& sample) {
  const auto compare = [&](const std::vector<double>& values, const double* expected,
                           const char* what) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      EXPECT_TRUE(sameBits(values[i], expected[i]))
          << what << "[" << i << "] at " << message.time << " s: " << values[i] << " and "
          << expected[i];
    }
  };
  EXPECT_EQ(message.angle.size(), 2u);
  EXPECT_EQ(message.residual.size(), 1u);
  compare(message.angle, sample.angle, "angle");
  compare(message.velocity, sample.velocity, "velocity");
  compare(message.acceleration, sample.acceleration, "acceleration");
  compare(message.applied_torque, sample.applied_torque, "applied_torque");
  compare(message.reaction_torque, sample.reaction_torque, "reaction_torque");
  compare(message.reaction_torque_rate, sample.reaction_torque_rate, "reaction_torque_rate");
  compare(message.residual, sample.residual, "residual");
  compare(message.multiplier, sample.multiplier, "multiplier");
}

int inputOf(const Simulation& simulation, const std::string& topic) {
  for (std::size_t i = 0; i < simulation.scene().inputs.size(); ++i) {
    if (simulation.scene().inputs[i].topic == topic) return static_cast<int>(i);
  }
  ADD_FAILURE() << topic;
  return 0;
}

// A torque published on the topic moves the shafts as the offline simulation says, to the last bit.
TEST(Node, APublishedTorqueMovesTheShaftsAsOffline) {
  Node node("published");
  ASSERT_EQ(node.lastStatus().state, SimulationStatus::PAUSED);
  ros::Publisher torque = node.commander("drive_torque");
  std_msgs::Float64 command;
  command.data = 4.0;
  torque.publish(command);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) { return s.commands_accepted == 1; }));
  node.forgetStates();
  ASSERT_TRUE(node.trigger("resume").success);
  ASSERT_TRUE(node.waitForStates(40));
  ASSERT_TRUE(node.trigger("pause").success);

  Simulation offline(test::sceneFromFile(stepsScene()));
  offline.command(inputOf(offline, "drive_torque"), 4.0);
  double last = 0.0;
  for (const DrivetrainState& state : node.states()) {
    if (state.time == 0.0) continue;  // from before the resume
    ASSERT_GE(state.time, last);      // (the pause may come right after a state)
    last = state.time;
    offline.advanceTo(state.time);
    ASSERT_DOUBLE_EQ(state.applied_torque[0], 4.0);
    expectSameBits(state, offline.sample());
    EXPECT_GT(state.header.stamp.toSec(), 1e9);  // wall time
  }
  EXPECT_GT(node.states().back().velocity[0], 10.0);
}

// States come every 10 ticks at 1000 Hz and 100 Hz.
TEST(Node, StatesComeAtThePublishRate) {
  Node node("published");
  node.trigger("pause");
  node.trigger("reset_time");
  // The reset publishes the initial state; all that comes after it belongs to the run.
  ASSERT_TRUE(node.waitFor([&] { return node.lastTime() == 0.0; }));
  node.forgetStates();
  ASSERT_TRUE(node.trigger("resume").success);
  ASSERT_TRUE(node.waitForStates(30));
  node.trigger("pause");
  const std::vector<DrivetrainState> states = node.states();
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(states[i].time, static_cast<double>(i + 1) / 100.0);
  }
}

TEST(Node, JointStatesAndSceneSayTheSame) {
  Node node("published");
  const SceneInfo scene = node.scene();
  EXPECT_EQ(scene.shafts, (std::vector<std::string>{"drive", "load"}));
  EXPECT_EQ(scene.torques, (std::vector<std::string>{"engine", "brake", "friction"}));
  EXPECT_EQ(scene.constraints, (std::vector<std::string>{"variator"}));
  EXPECT_EQ(scene.inputs, (std::vector<std::string>{"drive_torque", "load_torque"}));
  EXPECT_EQ(scene.principle, "generalized_gauss");
  // The parameters are a scene again.
  BuiltinComponentFactory factory;
  const Scene again = readScene(readYamlText(scene.parameters, "~scene"), factory);
  EXPECT_EQ(again.shafts, scene.shafts);

  node.trigger("pause");
  std::mutex mutex;
  std::vector<sensor_msgs::JointState> joints;
  ros::NodeHandle global;
  const ros::Subscriber subscriber = global.subscribe<sensor_msgs::JointState>(
      "joint_states", 1000, [&](const sensor_msgs::JointStateConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex);
        joints.push_back(*message);
      });
  ASSERT_TRUE(node.waitFor([&] { return subscriber.getNumPublishers() > 0; }));
  // Several nodes publish joint_states here: this one's are those with its own velocities.
  std::set<std::vector<double>> velocities;
  ASSERT_TRUE(node.waitFor([&] {
    velocities.insert(node.step(0.01).state.velocity);
    const std::lock_guard<std::mutex> lock(mutex);
    for (const sensor_msgs::JointState& joint : joints) {
      if (joint.name == scene.shafts && velocities.count(joint.velocity) > 0) return true;
    }
    return false;
  }));
}

// Commands of two topics at one instant, steps of uneven lengths, some of them with no double of
// their own: all numbers have the bits that the core gives. (clock_test.py: and `simulate`.)
TEST(Node, LockstepGivesTheBytesOfTheOfflineSimulation) {
  Node node("lockstep");
  node.trigger("reset_time");
  Simulation offline(test::sceneFromFile(stepsScene()));
  std::int64_t now = 0;  // ns
  for (int i = 0; i < 600; ++i) {
    const std::int64_t duration = 1000000 + 500000 * (i % 3) + (i % 7 == 0 ? 123457 : 0);
    Commands commands;
    if (i % 10 == 0) {
      commands.emplace_back("drive_torque", 4.0 + 3.0 * std::sin(0.1 * i));
      commands.emplace_back("load_torque", 2.0 + std::cos(0.13 * i));
    } else if (i % 10 == 4) {
      commands.emplace_back("load_torque", 1.0 + 0.01 * i);
    }
    for (const auto& [topic, value] : commands) offline.command(inputOf(offline, topic), value);
    const Step::Response response = node.step(static_cast<double>(duration) / 1e9, commands);
    ASSERT_TRUE(response.success) << response.message;
    now += duration;
    const double time = static_cast<double>(now) / 1e9;
    ASSERT_TRUE(sameBits(response.state.time, time));
    ASSERT_EQ(static_cast<std::int64_t>(response.state.header.stamp.toNSec()), now);
    offline.advanceTo(time);
    ASSERT_TRUE(offline.status().ok());
    expectSameBits(response.state, offline.sample());
    ASSERT_FALSE(HasFailure()) << "step " << i;
  }
  EXPECT_GT(offline.statistics().jumps, 100u);
}

/// Receives the messages on the topic of one group.
class QuantityListener {
 public:
  QuantityListener(Node& node, QuantityGroup group)
      : subscriber_(node.handle().subscribe<NamedValues>(
            toString(group), 1000, [this](const NamedValuesConstPtr& message) {
              const std::lock_guard<std::mutex> lock(mutex_);
              messages_.push_back(*message);
            })) {
    // The node computes them from when it has heard of us.
    EXPECT_TRUE(node.waitFor([&] {
      EXPECT_TRUE(node.step(0.001).success);
      return !messages().empty();
    }));
  }
  std::vector<NamedValues> messages() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  bool hasHeardOf(double time) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return !messages_.empty() && messages_.back().time == time;
  }
  /// Since the last reset of time, whose own message is left out.
  void expectAsOffline(const std::map<double, std::vector<double>>& expected) {
    const std::vector<NamedValues> all = messages();
    const auto reset = std::find_if(all.rbegin(), all.rend(),
                                    [](const NamedValues& message) { return message.time == 0.0; });
    ASSERT_NE(reset, all.rend());
    std::size_t count = 0;
    for (auto next = reset.base(); next != all.end(); ++next) {
      const NamedValues& message = *next;
      ASSERT_EQ(expected.count(message.time), 1u) << message.time;
      const std::vector<double>& values = expected.at(message.time);
      ASSERT_EQ(message.value.size(), values.size());
      for (std::size_t i = 0; i < values.size(); ++i) {
        EXPECT_TRUE(sameBits(message.value[i], values[i])) << message.name[i];
      }
      ++count;
    }
    EXPECT_EQ(count, expected.size());
  }

 private:
  std::mutex mutex_;
  std::vector<NamedValues> messages_;
  ros::Subscriber subscriber_;
};

TEST(Node, QuantitiesOfEachGroupAreThoseOfTheOfflineSimulation) {
  Node node("observed");
  Simulation offline(
      test::sceneFromFile(ros::package::getPath("variator_sim") + "/test/scenes/observed.yaml"));
  std::map<QuantityGroup, std::map<double, std::vector<double>>> expected;
  std::map<QuantityGroup, std::unique_ptr<QuantityListener>> listeners;
  for (const QuantityGroup group : kQuantityGroups) {
    listeners[group] = std::make_unique<QuantityListener>(node, group);
    EXPECT_EQ(listeners[group]->messages().back().name, offline.quantityNames(group));
  }
  ASSERT_TRUE(node.trigger("reset_time").success);
  double time = 0.0;
  for (int i = 1; i <= 100; ++i) {
    Commands commands;
    if (i == 20) commands = {{"engine/torque", 25.0}, {"ratio", 0.8}};
    for (const auto& [topic, value] : commands) offline.command(inputOf(offline, topic), value);
    ASSERT_TRUE(node.step(0.01, commands).success);
    time = i / 100.0;
    offline.advanceTo(time);
    for (const QuantityGroup group : kQuantityGroups) {
      std::vector<double>& values = expected[group][time];
      values.resize(offline.quantityNames(group).size());
      offline.calcQuantities(group, values.data());
    }
  }
  for (const QuantityGroup group : kQuantityGroups) {
    ASSERT_TRUE(node.waitFor([&] { return listeners[group]->hasHeardOf(time); }));
    SCOPED_TRACE(toString(group));
    listeners[group]->expectAsOffline(expected[group]);
  }
}

TEST(Node, TellsOfModesAndEventsAtTheirInstants) {
  Node node("telling");
  std::mutex mutex;
  std::vector<Event> events;
  const ros::Subscriber listener =
      ros::NodeHandle().subscribe<Event>("/telling/events", 10, [&](const EventConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex);
        events.push_back(*message);
      });
  ASSERT_TRUE(node.waitFor([&] { return listener.getNumPublishers() > 0; }));
  ASSERT_TRUE(node.trigger("reset_time").success);
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(node.step(0.1, {}).success);
  ASSERT_TRUE(node.waitFor([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return events.size() >= 3;
  }));
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_EQ(events.size(), 3U);
  const Event& holds = events[0];
  EXPECT_EQ(holds.element + " " + holds.before + " " + holds.after, "brake forward stuck");
  EXPECT_NEAR(holds.time, 1.0, 1e-9);
  EXPECT_NEAR(holds.torque, 4.0, 1e-9);
  const Event& passes = events[1];
  EXPECT_EQ(passes.element + " " + passes.before + " " + passes.after, "release below above");
  EXPECT_NEAR(passes.time, 1.5, 1e-9);
  EXPECT_EQ(events[2].element + " " + events[2].after, "brake forward");
  EXPECT_NEAR(events[2].time, 1.5, 1e-9);
}

TEST(Node, StatesCarryEstimatedErrorsWhereAskedFor) {
  Node estimating("estimating");
  Node plain("lockstep");
  ASSERT_TRUE(estimating.trigger("reset_time").success);
  ASSERT_TRUE(plain.trigger("reset_time").success);
  for (int i = 1; i <= 20; ++i) {
    const DrivetrainState with = estimating.step(0.1).state;
    const DrivetrainState without = plain.step(0.1).state;
    EXPECT_EQ(with.angle, without.angle);
    EXPECT_EQ(with.velocity, without.velocity);
    EXPECT_EQ(with.acceleration, without.acceleration);
    EXPECT_EQ(with.reaction_torque_rate, without.reaction_torque_rate);
    EXPECT_TRUE(without.angle_error.empty());
    for (const auto& errors : {with.angle_error, with.velocity_error, with.acceleration_error}) {
      ASSERT_EQ(errors.size(), with.angle.size());
      for (const double error : errors) {
        EXPECT_GT(error, 0.0);
        EXPECT_LT(error, 1e-6);
      }
    }
  }
}

TEST(Node, LockstepAnswersAreAlsoPublished) {
  Node node("lockstep");
  node.forgetStates();
  const Step::Response response = node.step(0.25);
  ASSERT_TRUE(response.success);
  ASSERT_TRUE(node.waitForStates(1));
  const DrivetrainState published = node.states().front();
  EXPECT_TRUE(sameBits(published.time, response.state.time));
  EXPECT_EQ(published.acceleration, response.state.acceleration);
}

TEST(Node, RefusesStepsThatMakeNoSenseAndMovesNothing) {
  Node node("lockstep");
  const double before = node.step(0.001).state.time;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto expectRefused = [&](double duration, const Commands& commands, const char* part) {
    const Step::Response response = node.step(duration, commands);
    EXPECT_FALSE(response.success) << part;
    EXPECT_NE(response.message.find(part), std::string::npos) << response.message;
  };
  expectRefused(0.0, {}, "above 0");
  expectRefused(-0.001, {}, "above 0");
  expectRefused(nan, {}, "above 0");
  expectRefused(infinity, {}, "above 0");
  expectRefused(1.1e6, {}, "at most 1e6");
  expectRefused(1e-10, {}, "nanoseconds");
  expectRefused(0.001, {{"drive_torqe", 1.0}}, "'drive_torque'");
  expectRefused(0.001, {{"load_torque", 1.0}, {"drive_torque", nan}}, "finite");
  expectRefused(0.001, {{"drive_torque", -infinity}}, "finite");
  expectRefused(0.001, {{"drive_torque", 1.0}, {"drive_torque", 2.0}}, "twice");
  Step uneven;
  uneven.request.duration = 0.001;
  uneven.request.command_topics = {"drive_torque"};
  EXPECT_FALSE(node.step(uneven).success);
  const Step::Response after = node.step(0.001);
  ASSERT_TRUE(after.success);
  EXPECT_EQ(std::llround(after.state.time * 1e9), std::llround(before * 1e9) + 1000000);
}

TEST(Node, PausesResumesAndResets) {
  Node node("control");
  ASSERT_TRUE(node.waitForState(SimulationStatus::RUNNING));
  // Running: no steps.
  const Step::Response refused = node.step(0.001);
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("pause first"), std::string::npos) << refused.message;

  // Paused: time stands still, as two steps show.
  ASSERT_TRUE(node.trigger("pause").success);
  ASSERT_TRUE(node.waitForState(SimulationStatus::PAUSED));
  EXPECT_TRUE(node.trigger("pause").success);  // twice is once
  const auto first = node.step(0.001);
  const auto second = node.step(0.003);
  ASSERT_TRUE(first.success && second.success);
  EXPECT_EQ(std::llround((second.state.time - first.state.time) * 1e9), 3000000);
  // The node ran at 1000 Hz: its time is a whole number of ms.
  EXPECT_EQ(static_cast<std::int64_t>(second.state.header.stamp.toNSec()) % 1000000, 0);

  // Running again: time goes on from there.
  ASSERT_TRUE(node.waitFor([&] { return node.lastTime() == second.state.time; }));
  node.forgetStates();
  ASSERT_TRUE(node.trigger("resume").success);
  ASSERT_TRUE(node.waitForState(SimulationStatus::RUNNING));
  ASSERT_TRUE(node.waitForStates(3));
  EXPECT_EQ(std::llround((node.states().front().time - second.state.time) * 1e9), 10000000);
  ASSERT_TRUE(node.trigger("pause").success);

  // Reset: the initial state, while time goes on.
  const double before = node.step(0.001).state.time;
  ASSERT_TRUE(node.trigger("reset").success);
  const auto restarted = node.step(0.002);
  ASSERT_TRUE(restarted.success);
  EXPECT_EQ(std::llround((restarted.state.time - before) * 1e9), 2000000);
  Simulation offline(test::sceneFromFile(stepsScene()));
  offline.advanceTo(0.002);
  expectSameBits(restarted.state, offline.sample());

  // Reset of time: time, too.
  ASSERT_TRUE(node.trigger("reset_time").success);
  const auto again = node.step(0.002);
  ASSERT_TRUE(again.success);
  EXPECT_EQ(again.state.time, 0.002);
  expectSameBits(again.state, offline.sample());

  // Over all of this, time in messages never went backwards but once.
  int backwards = 0;
  const std::vector<DrivetrainState> states = node.states();
  for (std::size_t i = 1; i < states.size(); ++i) {
    if (states[i].time < states[i - 1].time) ++backwards;
  }
  EXPECT_LE(backwards, 1);
  ASSERT_TRUE(node.trigger("resume").success);
}

TEST(Node, TellsItsStateToWhoeverComesWhileItIsPaused) {
  DrivetrainState expected;
  {
    Node node("control");
    ASSERT_TRUE(node.trigger("pause").success);
    expected = node.step(0.05).state;
  }  // (One process has one connection for each topic.)
  {
    Node node("control");
    ASSERT_EQ(node.states().size(), 1U);
    EXPECT_TRUE(sameBits(node.states().front().time, expected.time));
    EXPECT_EQ(node.states().front().acceleration, expected.acceleration);
    // A command that waits is in force, although no state tells so by itself.
    ros::Publisher torque = node.commander("drive_torque");
    std_msgs::Float64 command;
    command.data = 7.0;
    torque.publish(command);
    ASSERT_TRUE(node.waitForStatus([](const auto& s) { return s.commands_accepted == 1; }));
    EXPECT_EQ(node.states().size(), 1U);
  }
  Node node("control");
  ASSERT_EQ(node.states().size(), 1U);
  EXPECT_EQ(node.states().front().applied_torque[0], 7.0);
  EXPECT_TRUE(sameBits(node.states().front().time, expected.time));
  ASSERT_TRUE(node.trigger("reset").success);
  ASSERT_TRUE(node.trigger("resume").success);
}

// Commands from before a reset are forgotten with the motion.
TEST(Node, ResetForgetsCommands) {
  Node node("control");
  ASSERT_TRUE(node.trigger("pause").success);
  ros::Publisher torque = node.commander("drive_torque");
  std_msgs::Float64 command;
  command.data = 100.0;
  torque.publish(command);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) { return s.commands_accepted == 1; }));
  ASSERT_TRUE(node.trigger("reset").success);
  const auto stepped = node.step(0.001);
  ASSERT_TRUE(stepped.success);
  EXPECT_EQ(stepped.state.applied_torque[0], 0.0);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) { return s.commands_accepted == 0; }));
}

TEST(Node, RefusesAndCountsCommandsThatAreNotFinite) {
  Node node("refusing");
  ros::Publisher torque = node.commander("drive_torque");
  std_msgs::Float64 command;
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity(), 5.0}) {
    command.data = value;
    torque.publish(command);
  }
  ASSERT_TRUE(node.waitForStatus(
      [](const auto& s) { return s.commands_refused == 3 && s.commands_accepted == 1; }));
  EXPECT_EQ(node.lastStatus().state, SimulationStatus::RUNNING);
  // States travel beside the status: those of before the command may still be on their way.
  ASSERT_TRUE(node.waitFor([&] { return node.lastTorque() == 5.0; }));
  node.forgetStates();
  ASSERT_TRUE(node.waitForStates(5));
  for (const DrivetrainState& state : node.states()) {
    EXPECT_EQ(state.applied_torque[0], 5.0);
    EXPECT_TRUE(std::isfinite(state.acceleration[0]));
  }
}

// The scene has more inputs than topics: its variable is one, too.
TEST(Node, WarnsOfOddCommandsByTheirTopic) {
  Node node("clamping");
  std::mutex mutex;
  std::string log;
  const ros::Subscriber listener = ros::NodeHandle().subscribe<rosgraph_msgs::Log>(
      "/rosout", 100, [&](const rosgraph_msgs::LogConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (message->name == "/clamping") log += message->msg + "\n";
      });
  const auto hasLogged = [&](const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex);
    return log.find(text) != std::string::npos;
  };
  ros::Publisher push = node.commander("push");
  std_msgs::Float64 command;
  command.data = std::numeric_limits<double>::quiet_NaN();
  // (The node tells it once a second: what comes before the log is connected is lost.)
  EXPECT_TRUE(node.waitFor([&] {
    push.publish(command);
    return hasLogged("nan on /clamping/push: ");
  }));
  command.data = 9.0;
  push.publish(command);
  EXPECT_TRUE(node.waitFor([&] { return hasLogged("/clamping/push: the command 9"); }));
}

TEST(Node, StatusTellsPacingAndCounts) {
  Node node("refusing");
  ASSERT_TRUE(node.waitForStatus([](const auto& s) {
    return s.ticks > 1000 && s.real_time_factor > 0.3 && s.real_time_factor < 3.0;
  }));
  const SimulationStatus status = node.lastStatus();
  EXPECT_EQ(status.stop_reason, "");
  EXPECT_EQ(status.message, "");
  EXPECT_GT(status.steps, 0u);
  EXPECT_GE(status.right_hand_sides, status.steps);
  EXPECT_LE(status.lateness_p50, status.lateness_p99);
  EXPECT_LE(status.lateness_p99, status.lateness_max);
  EXPECT_EQ(status.samples_dropped, 0u);
  EXPECT_EQ(status.commands_dropped, 0u);
}

TEST(Node, AStoppedMotionLeavesTheNodeAlive) {
  Node node("stopping");
  node.forgetStates();
  ASSERT_TRUE(node.trigger("resume").success);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) {
    return s.state == SimulationStatus::STOPPED && s.stop_reason == "NonFiniteValue" &&
           s.message.find("motor") != std::string::npos &&
           s.message.find("~reset") == std::string::npos && std::abs(s.time - 0.3) < 1e-3;
  })) << node.lastStatus();
  // The last state published is the last good one.
  ASSERT_TRUE(node.waitFor([&] { return std::abs(node.lastTime() - 0.3) < 1e-3; }));
  const DrivetrainState last = node.states().back();
  EXPECT_NEAR(last.time, 0.3, 1e-3);
  for (const double value : last.acceleration) EXPECT_TRUE(std::isfinite(value));

  const auto resumed = node.trigger("resume");
  EXPECT_FALSE(resumed.success);
  EXPECT_NE(resumed.message.find("NonFiniteValue"), std::string::npos) << resumed.message;
  EXPECT_FALSE(node.step(0.001).success);

  // Reset revives it; time goes on, until it stops again.
  ASSERT_TRUE(node.trigger("reset").success);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) {
    return s.state == SimulationStatus::STOPPED && std::abs(s.time - 0.6) < 2e-3 &&
           s.message.find("(of the motion since ~reset or ~set_state; 'time' of messages is 0.6") !=
               std::string::npos;
  })) << node.lastStatus();

  // In lockstep the step that stops says so and shows the last good state.
  ASSERT_TRUE(node.trigger("pause").success);
  ASSERT_TRUE(node.trigger("reset_time").success);
  ASSERT_TRUE(node.step(0.2).success);
  const auto stopped = node.step(0.2);
  EXPECT_FALSE(stopped.success);
  EXPECT_NE(stopped.message.find("NonFiniteValue"), std::string::npos) << stopped.message;
  EXPECT_NEAR(stopped.state.time, 0.3, 1e-3);
  ASSERT_TRUE(node.trigger("reset").success);
  EXPECT_TRUE(node.step(0.1).success);
}

TEST(Node, UnpacedRunsFasterThanTheWallClockAndObeys) {
  Node node("unpaced");
  ASSERT_TRUE(node.trigger("resume").success);
  ASSERT_TRUE(node.waitForStatus([](const auto& s) { return s.real_time_factor > 1.5; }));
  ASSERT_TRUE(node.trigger("pause").success);
  EXPECT_TRUE(node.step(0.001).success);
  EXPECT_EQ(node.lastStatus().overruns, 0u);
}

}  // namespace
}  // namespace variator_sim

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_test");
  ros::NodeHandle handle;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const int result = RUN_ALL_TESTS();
  ros::shutdown();
  return result;
}
