// The nodelet, in a manager of Debian's and in this test as a manager of its own.
#include <nodelet/NodeletList.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/loader.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/DrivetrainState.h>
#include <variator_sim/SimulationStatus.h>
#include <variator_sim/Step.h>

#include <chrono>
#include <mutex>
#include <thread>

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr const char* kType = "variator_sim/VariatorNodelet";

template <class Condition>
bool waitFor(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

/// Keeps the messages of one topic as they come.
template <class Message>
class Listener {
 public:
  using Ptr = typename Message::ConstPtr;
  explicit Listener(const std::string& topic) {
    subscriber_ = handle_.subscribe<Message>(topic, 1000, [this](const Ptr& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      messages_.push_back(message);
    });
  }
  std::vector<Ptr> messages() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  bool waitForPublisher() {
    return waitFor([this] { return subscriber_.getNumPublishers() > 0; });
  }

 private:
  std::mutex mutex_;
  std::vector<Ptr> messages_;
  ros::NodeHandle handle_;
  ros::Subscriber subscriber_;
};

Step::Response step(const std::string& node, double duration) {
  ros::NodeHandle handle;
  const std::string name = node + "/step";
  EXPECT_TRUE(ros::service::waitForService(name, 30000));
  ros::ServiceClient client = handle.serviceClient<Step>(name, /*persistent=*/true);
  Step call;
  call.request.duration = duration;
  EXPECT_TRUE(client.call(call)) << name;
  return call.response;
}

bool load(nodelet::Loader& loader, const std::string& name) {
  return loader.load(name, kType, {}, {});
}

// Each has its own scene, time and threads; what one does the other does not feel.
TEST(Nodelet, TwoDrivetrainsShareAManager) {
  for (const char* node : {"/first/variator", "/second/variator"}) {
    const Step::Response response = step(node, 0.25);
    ASSERT_TRUE(response.success) << response.message;
    EXPECT_EQ(response.state.time, 0.25);
  }
  EXPECT_EQ(step("/first/variator", 0.25).state.time, 0.5);
  const Step::Response second = step("/second/variator", 0.05);
  EXPECT_EQ(second.state.time, 0.3);
  Simulation offline(test::sceneFromFile(ros::package::getPath("variator_sim") +
                                         "/test/cases/torque_steps/scene.yaml"));
  offline.advanceTo(0.25);
  offline.advanceTo(0.3);
  EXPECT_EQ(second.state.velocity[0], offline.sample().velocity[0]);
  EXPECT_EQ(second.state.acceleration[1], offline.sample().acceleration[1]);
}

TEST(Nodelet, ABadSceneIsRefusedAndTheManagerGoesOn) {
  ros::NodeHandle handle;
  nodelet::NodeletLoad bad;
  bad.request.name = "/inside/bad";
  bad.request.type = kType;
  // A load that fails is a call that fails.
  EXPECT_FALSE(ros::service::call("/drivetrains/load_nodelet", bad) && bad.response.success);
  nodelet::NodeletList list;
  ASSERT_TRUE(ros::service::call("/drivetrains/list", list));
  std::vector<std::string> names = list.response.nodelets;
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"/first/variator", "/second/variator"}));
  EXPECT_TRUE(step("/first/variator", 0.001).success);

  nodelet::Loader loader;
  EXPECT_FALSE(load(loader, "/inside/bad"));
  EXPECT_FALSE(load(loader, "/inside/nothing"));
  EXPECT_TRUE(loader.listLoadedNodelets().empty());
  EXPECT_TRUE(load(loader, "/inside/one"));
  EXPECT_TRUE(step("/inside/one", 0.001).success);
}

// A subscriber in the publisher's process receives the published object itself: roscpp numbers
// messages (header.seq) only when it serializes them.
TEST(Nodelet, MessagesAreNotCopiedWithinTheProcess) {
  nodelet::Loader loader;
  ASSERT_TRUE(load(loader, "/inside/one"));
  Listener<DrivetrainState> states("/inside/one/state");
  Listener<SimulationStatus> statuses("/inside/one/status");
  Listener<DrivetrainState> outside("/first/variator/state");
  ASSERT_TRUE(states.waitForPublisher());
  ASSERT_TRUE(outside.waitForPublisher());
  for (int i = 1; i <= 20; ++i) {
    ASSERT_TRUE(step("/inside/one", 0.001).success);
    ASSERT_TRUE(step("/first/variator", 0.001).success);
  }
  ASSERT_TRUE(waitFor([&] {
    return states.messages().size() >= 20 && outside.messages().size() >= 20 &&
           statuses.messages().size() >= 3;
  }));
  const auto received = states.messages();
  for (std::size_t i = 0; i < received.size(); ++i) {
    EXPECT_EQ(received[i]->header.seq, 0u);
    // Each is a message of its own: those kept do not change.
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_NE(received[i], received[j]);
      EXPECT_LT(received[j]->time, received[i]->time);
    }
  }
  for (const auto& status : statuses.messages()) EXPECT_EQ(status->header.seq, 0u);
  EXPECT_GT(outside.messages().back()->header.seq, 0u);
}

TEST(Nodelet, LoadsAndUnloadsManyTimes) {
  nodelet::Loader loader;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(load(loader, "/inside/one"));
    ASSERT_TRUE(load(loader, "/inside/two"));
    ASSERT_TRUE(step("/inside/two", 0.1).success);
    EXPECT_EQ(step("/inside/one", 0.2).state.time, 0.2);
    EXPECT_TRUE(loader.unload("/inside/one"));
    EXPECT_TRUE(loader.unload("/inside/two"));
  }
}

}  // namespace
}  // namespace variator_sim

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "nodelet_test");
  ros::NodeHandle handle;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  const int result = RUN_ALL_TESTS();
  ros::shutdown();
  return result;
}
