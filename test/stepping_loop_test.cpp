// The stepping thread by itself, on a clock that takes no time.
#include "ros/stepping_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <new>

#include "support/scenes.h"

namespace {

thread_local bool counting = false;
std::atomic<int> allocations{0};

void* allocate(std::size_t size) {
  if (counting) allocations.fetch_add(1);
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) {
  return allocate(size);
}
void* operator new[](std::size_t size) {
  return allocate(size);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace variator_sim {
namespace {

constexpr const char* kScene = R"(
shafts: [drive, load]
drive: {inertia: 0.5}
load: {inertia: 1.2}
torques: [engine, friction]
engine: {type: variator_sim/CommandedTorque, shaft: drive, topic: drive_torque}
friction: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.3*w2"}
constraints: [variator]
variator:
  type: variator_sim/ExpressionConstraint
  order: 2
  expression: "0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"
initial: {velocity: [10.0, 8.0]}
)";

/// Sleeping moves the clock. At given ticks it plays the part of the other threads, in the stepping
/// thread itself: so the order of events is the same on every run.
class ScriptedClock : public PacingClock {
 public:
  std::int64_t now() override { return now_; }
  void sleepUntil(std::int64_t deadline) override {
    now_ = std::max(now_, deadline);
    if (on_sleep_) on_sleep_(++sleeps_);
  }
  std::function<void(int)> on_sleep_;

 private:
  std::int64_t now_ = 1000000000;
  int sleeps_ = 0;
};

TEST(SteppingLoop, AllocatesNothingPerTick) {
  ScriptedClock clock;
  NodeSettings settings;
  settings.publish_rate = 1000.0;
  SteppingLoop loop(Simulation(test::sceneFromText(kScene)), settings, clock);
  loop.setSamplesWanted(true);
  clock.on_sleep_ = [&](int tick) {
    if (tick == 100) counting = true;
    if (tick % 7 == 0) loop.command({0, std::sin(0.01 * tick)});
    if (tick % 100 == 0) loop.command({0, std::numeric_limits<double>::quiet_NaN()});
    if (tick == 5000) {
      counting = false;
      loop.stop();
    }
  };
  allocations = 0;
  loop.run();
  EXPECT_EQ(allocations.load(), 0);
}

TEST(SteppingLoop, TakesACommandAtTheNextTickAndShowsItThere) {
  ScriptedClock clock;
  NodeSettings settings;
  settings.publish_rate = 1000.0;
  SteppingLoop loop(Simulation(test::sceneFromText(kScene)), settings, clock);
  loop.setSamplesWanted(true);
  clock.on_sleep_ = [&](int tick) {
    // Given while the loop waits for tick 50.
    if (tick == 50) loop.command({0, 3.0});
    if (tick == 100) loop.stop();
  };
  loop.run();

  Simulation offline(test::sceneFromText(kScene));
  TimedSample timed;
  ASSERT_TRUE(loop.popSample(timed));
  EXPECT_EQ(timed.time, 0);
  for (int tick = 1; loop.popSample(timed); ++tick) {
    ASSERT_EQ(timed.time, tick * 1000000);
    offline.advanceTo(tick / 1000.0);
    if (tick == 50) offline.command(0, 3.0);
    const Sample& expected = offline.sample();
    ASSERT_EQ(timed.sample.acceleration[0], expected.acceleration[0]) << tick;
    ASSERT_EQ(timed.sample.applied_torque[0], tick < 50 ? 0.0 : 3.0);
  }
  EXPECT_EQ(timed.time, 100000000);
}

TEST(SteppingLoop, TellsItsRealTimeFactorAndLateness) {
  ScriptedClock clock;
  NodeSettings settings;
  settings.real_time_factor = 4.0;
  SteppingLoop loop(Simulation(test::sceneFromText(kScene)), settings, clock);
  clock.on_sleep_ = [&](int tick) {
    if (tick == 20000) loop.stop();
  };
  loop.run();
  LoopSnapshot snapshot;
  while (loop.popSnapshot(snapshot)) {
  }
  EXPECT_EQ(snapshot.state, RunState::kRunning);
  EXPECT_NEAR(snapshot.real_time_factor, 4.0, 1e-3);
  EXPECT_EQ(snapshot.pacing.overruns, 0u);
  EXPECT_EQ(snapshot.lateness_max, 0);
}

}  // namespace
}  // namespace variator_sim

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
