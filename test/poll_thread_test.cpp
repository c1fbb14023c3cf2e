// Work on roscpp's poll thread: run after each post, never after its end. Needs no master.
#include <gtest/gtest.h>
#include <ros/poll_manager.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>

#include "ros/poll_thread_task.h"
#include "ros/wakeup.h"

namespace variator_sim {
namespace {

constexpr std::chrono::seconds kPatience{60};  // only a failure takes as long

class PollThread : public testing::Test {
 protected:
  static void SetUpTestSuite() { ros::PollManager::instance()->start(); }
  static void TearDownTestSuite() { ros::PollManager::instance()->shutdown(); }

  /// After this the poll thread has served what was posted before.
  static void waitForTurn() {
    EventDescriptor event;
    std::promise<void> turned;
    const auto turn = runOnPollThread(event, [&] { turned.set_value(); });
    event.post();
    ASSERT_EQ(turned.get_future().wait_for(kPatience), std::future_status::ready);
  }

  EventDescriptor event_;
};

TEST_F(PollThread, RunsAfterAPost) {
  std::promise<std::thread::id> ran;
  const auto task = runOnPollThread(event_, [&] { ran.set_value(std::this_thread::get_id()); });
  event_.post();
  std::future<std::thread::id> result = ran.get_future();
  ASSERT_EQ(result.wait_for(kPatience), std::future_status::ready);
  EXPECT_NE(result.get(), std::this_thread::get_id());
}

TEST_F(PollThread, SeesAPostFromBeforeItWasMade) {
  event_.post();
  std::promise<void> ran;
  const auto task = runOnPollThread(event_, [&] { ran.set_value(); });
  EXPECT_EQ(ran.get_future().wait_for(kPatience), std::future_status::ready);
}

TEST_F(PollThread, RunsOnceForPostsThatComeTogether) {
  std::atomic<int> count{0};
  event_.post();
  event_.post();
  const auto task = runOnPollThread(event_, [&] { ++count; });
  for (int turn = 0; turn < 3; ++turn) waitForTurn();
  EXPECT_EQ(count, 1);
}

// A post that comes while the function runs is not lost: it may have come after its last look.
TEST_F(PollThread, RunsAgainForAPostDuringARun) {
  std::atomic<int> count{0};
  std::promise<void> second;
  const auto task = runOnPollThread(event_, [&] {
    if (++count == 1) event_.post();
    if (count == 2) second.set_value();
  });
  event_.post();
  EXPECT_EQ(second.get_future().wait_for(kPatience), std::future_status::ready);
}

TEST_F(PollThread, RunsNoMoreAfterItsEnd) {
  std::atomic<int> count{0};
  auto task = runOnPollThread(event_, [&] { ++count; });
  task.reset();
  event_.post();
  for (int turn = 0; turn < 3; ++turn) waitForTurn();
  EXPECT_EQ(count, 0);
}

TEST_F(PollThread, EndsAfterACallUnderWay) {
  std::promise<void> started;
  std::promise<void> released;
  std::atomic<bool> finished{false};
  auto task = runOnPollThread(event_, [&] {
    started.set_value();
    released.get_future().wait();
    // Time for a destructor that does not wait to be caught.
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    finished = true;
  });
  event_.post();
  ASSERT_EQ(started.get_future().wait_for(kPatience), std::future_status::ready);
  released.set_value();
  task.reset();
  EXPECT_TRUE(finished);
}

TEST_F(PollThread, RefusesADescriptorTwice) {
  const auto task = runOnPollThread(event_, [] {});
  EXPECT_THROW(runOnPollThread(event_, [] {}), std::logic_error);
  std::promise<void> ran;
  EventDescriptor other;
  const auto another = runOnPollThread(other, [&] { ran.set_value(); });
  other.post();
  EXPECT_EQ(ran.get_future().wait_for(kPatience), std::future_status::ready);
}

}  // namespace
}  // namespace variator_sim
