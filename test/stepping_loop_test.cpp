// The stepping thread by itself, on a clock that takes no time.
#include "ros/stepping_loop.h"

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "ros/nanoseconds.h"
#include "support/count_allocations.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

const std::string kScene =
    test::sceneText("drive 0.5, load 1.2",
                    {"engine on drive from drive_torque", "friction on load: -0.3*w2",
                     "variator: 0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"},
                    "initial: {velocity: [10, 8]}");

/// Sleeping moves the clock. At given ticks it plays the part of the other threads, in the stepping
/// thread itself: so the order of events is the same on every run.
class ScriptedClock : public PacingClock {
 public:
  std::int64_t now() override { return now_; }
  void sleepUntil(std::int64_t deadline) override {
    now_ = std::max(now_, deadline);
    if (on_sleep_) on_sleep_(++sleeps_);
  }
  void waitUntil(std::int64_t deadline) override { sleepUntil(deadline); }
  void wake() override {}
  std::function<void(int)> on_sleep_;

 private:
  std::int64_t now_ = 1000000000;
  int sleeps_ = 0;
};

/// Time passes only in sleeps and waits, and stops on its way at the events given before.
class EventClock : public PacingClock {
 public:
  /// `action` at `time`, ns since the start, later than those before; in the stepping thread.
  void at(std::int64_t time, std::function<void()> action) {
    events_.push_back({kStart + time, std::move(action)});
  }
  /// As `at`, for requests: they wait for the stepping thread, so another one makes them.
  void submitAt(std::int64_t time, SteppingLoop& loop, RequestKind kind) {
    at(time, [this, &loop, kind] {
      join();  // the one before has its answer
      woken_ = false;
      submitters_.emplace_back([&loop, kind] {
        LoopRequest request;
        request.kind = kind;
        EXPECT_EQ(loop.submit(request).result, RequestResult::kDone);
      });
      while (!woken_) std::this_thread::yield();
    });
  }
  /// When all is over.
  void join() {
    for (std::thread& thread : submitters_) thread.join();
    submitters_.clear();
  }

  std::int64_t now() override { return now_; }
  void sleepUntil(std::int64_t deadline) override {
    ++sleeps_;
    pass(deadline, /*can_wake=*/false);
  }
  void waitUntil(std::int64_t deadline) override {
    ++waits_;
    pass(deadline, /*can_wake=*/true);
  }
  void wake() override { woken_ = true; }

  int sleeps_ = 0;
  int waits_ = 0;
  static constexpr std::int64_t kStart = 1000000000;

 private:
  struct Event {
    std::int64_t time;
    std::function<void()> action;
  };
  void pass(std::int64_t deadline, bool can_wake) {
    for (;;) {
      if (can_wake && woken_.exchange(false)) return;
      if (next_ == events_.size() || events_[next_].time > deadline) break;
      now_ = std::max(now_, events_[next_].time);
      events_[next_++].action();
    }
    ASSERT_NE(deadline, kForever) << "nothing will wake the loop";
    now_ = std::max(now_, deadline);
  }

  std::int64_t now_ = kStart;
  std::vector<Event> events_;
  std::size_t next_ = 0;
  std::atomic<bool> woken_{false};
  std::vector<std::thread> submitters_;
};

/// At rest from its start until it is driven.
const std::string kRestingScene = test::sceneText(
    "drive 0.5, load 1.2", {"engine on drive from drive_torque", "friction on load: -9.0*w2",
                            "variator: 0.05*(e2-0.8*e1)+w2-0.8*w1"});

constexpr std::int64_t kMs = 1000000;

/// A loop on its clock, and none of the allocations counted yet.
template <class Clock>
class LoopTest : public testing::Test {
 protected:
  LoopTest() {
    counting = false;
    allocations = 0;
  }
  void make(const std::string& scene) {
    loop_ =
        std::make_unique<SteppingLoop>(Simulation(test::sceneFromText(scene)), settings_, clock_);
  }
  LoopSnapshot lastSnapshot() {
    LoopSnapshot snapshot;
    while (loop_->popSnapshot(snapshot)) {
    }
    return snapshot;
  }

  Clock clock_;
  NodeSettings settings_;
  std::unique_ptr<SteppingLoop> loop_;
};
using ScriptedLoop = LoopTest<ScriptedClock>;
using EventLoop = LoopTest<EventClock>;
using SteadyLoop = LoopTest<SteadyClock>;

bool sameBits(const Sample& a, const Sample& b) {
  return std::memcmp(&a, &b, sizeof(Sample)) == 0;
}

TEST_F(ScriptedLoop, AllocatesNothingPerTick) {
  settings_.publish_rate = 1000.0;
  make(kScene);
  loop_->setWanted(Topics().set(kStates));
  clock_.on_sleep_ = [&](int tick) {
    if (tick == 100) counting = true;
    if (tick % 7 == 0) loop_->command({0, std::sin(0.01 * tick)});
    if (tick % 100 == 0) loop_->command({0, std::numeric_limits<double>::quiet_NaN()});
    if (tick == 5000) {
      counting = false;
      loop_->stop();
    }
  };
  loop_->run();
  EXPECT_EQ(allocations, 0);
}

// More events between two samples than are kept: the loop tells how many are missing.
TEST(SteppingLoop, CountsTheEventsThatNobodyIsTold) {
  ScriptedClock clock;
  NodeSettings settings;
  settings.tick_rate = 1.0;
  settings.publish_rate = 1.0;
  SteppingLoop loop(
      Simulation(test::sceneFromText(
          "shafts: [a]\na: {inertia: 1}\nvariables: [n]\nn: {initial: 0}\nevents: [turn]\n"
          "turn: {when: sin(5000*t), direction: both, set: {n: n + 1}}\n")),
      settings, clock);
  loop.setWanted(Topics().set(kStates).set(kEvents));
  clock.on_sleep_ = [&](int tick) {
    if (tick == 60) loop.stop();  // of 20 ms each
  };
  loop.run();
  TimedEvent event;
  int told = 0;
  while (loop.popEvent(event)) ++told;
  EXPECT_EQ(told, 1024);
  EXPECT_GT(loop.droppedEvents(), 500U);
}

// The steps of one tick may take for ever: here 3e9 of them.
TEST_F(ScriptedLoop, StopsInTheMidstOfATickThatCrawls) {
  settings_.tick_rate = settings_.publish_rate = 0.1;
  make(test::sceneText("a 1", {"drag on a: sin(t) - 1e9*w_a"},
                       "solver: {stepper: dopri5, maximum_steps: 2000000000}"));
  std::atomic<bool> ticks{false};
  std::atomic<bool> has_ended{false};
  clock_.on_sleep_ = [&](int) { ticks = true; };
  std::thread thread([&] {
    loop_->run();
    has_ended = true;
  });
  const auto wait = [](const std::atomic<bool>& flag) {
    for (int n = 0; n < 1000 && !flag; ++n) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return flag.load();
  };
  EXPECT_TRUE(wait(ticks));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_FALSE(has_ended);
  loop_->stop();
  EXPECT_TRUE(wait(has_ended));
  if (!has_ended) std::_Exit(1);  // nothing else ends that thread
  thread.join();
}

/// Runs 3 s with commands, energy being wanted from tick `from` on; the samples that have it.
std::vector<TimedSample> runForEnergy(int from, LoopSnapshot* snapshot) {
  ScriptedClock clock;
  NodeSettings settings;
  SteppingLoop loop(Simulation(test::sceneFromText(kScene)), settings, clock);
  loop.setWanted(Topics().set(kStates).set(kEnergy, from == 0));
  std::vector<TimedSample> samples;
  TimedSample timed;
  allocations = 0;
  counting = false;
  clock.on_sleep_ = [&](int tick) {
    counting = false;
    while (loop.popSample(timed)) {
      if (timed.topics[kEnergy]) samples.push_back(timed);
    }
    while (loop.popSnapshot(*snapshot)) {
    }
    if (tick == from) loop.setWanted(Topics().set(kStates).set(kEnergy));
    if (tick % 300 == 0) loop.command({0, 0.01 * tick});
    if (tick == 3000) {
      loop.stop();
      return;
    }
    counting = tick > 100;
  };
  loop.run();
  counting = false;
  EXPECT_EQ(allocations, 0);
  return samples;
}

TEST_F(ScriptedLoop, TellsTheFirstClampedCommandOfAnInput) {
  std::string scene = kScene;
  scene.replace(scene.find("topic: drive_torque"), 0, "max: 40, ");
  make(scene);
  clock_.on_sleep_ = [&](int tick) {
    if (tick < 5) loop_->command({0, 30.0 + 10.0 * tick});  // 40, 50, 60, 70
    if (tick == 10) loop_->stop();
  };
  loop_->run();
  InputCommand command;
  ASSERT_TRUE(loop_->popOddCommand(command));
  EXPECT_EQ(command.value, 50.0);
  EXPECT_FALSE(loop_->popOddCommand(command));
}

TEST(SteppingLoop, EnergyCountsFromTheStartForWhoComesLate) {
  LoopSnapshot snapshot;
  const std::vector<TimedSample> all = runForEnergy(0, &snapshot);
  EXPECT_TRUE(snapshot.energy_doubt.exists());
  const std::vector<TimedSample> late = runForEnergy(2000, &snapshot);
  EXPECT_TRUE(snapshot.energy_doubt.exists());
  ASSERT_GT(all.size(), 290u);
  ASSERT_GT(late.size(), 90u);
  ASSERT_LT(late.size(), 110u);
  const double start = all.front().sample.energy.kinetic;
  EXPECT_EQ(all.front().time, 0);
  EXPECT_EQ(all.front().sample.energy.applied, 0.0);
  for (std::size_t i = 0; i < late.size(); ++i) {
    const TimedSample& first = all[all.size() - late.size() + i];
    const Energy& exact = first.sample.energy;
    const Energy& energy = late[i].sample.energy;
    ASSERT_EQ(late[i].time, first.time);
    ASSERT_EQ(energy.kinetic, exact.kinetic);
    ASSERT_EQ(energy.applied_power, exact.applied_power);
    ASSERT_NEAR(energy.applied, exact.applied, 1e-4 * std::abs(exact.applied));
    ASSERT_NEAR(energy.applied + energy.reactions, energy.kinetic - start, 1e-9 * start);
  }
}

/// Some values of `simulation` at its present, group after group.
std::vector<double> quantitiesOf(Simulation& simulation, Topics topics) {
  std::vector<double> values;
  for (const QuantityGroup group : kQuantityGroups) {
    if (!topics[static_cast<std::size_t>(group)]) continue;
    const std::size_t begin = values.size();
    values.resize(begin + simulation.quantityNames(group).size());
    simulation.calcQuantities(group, values.data() + begin);
  }
  return values;
}

TEST_F(ScriptedLoop, BringsTheQuantitiesOfTheGroupsThatAreWanted) {
  const std::string scene = kScene + "outputs: [ratio]\nratio: {expression: w2/w1 + e1}\n";
  const Topics none = Topics().set(kStates);
  Topics some = none;
  some.set(static_cast<std::size_t>(QuantityGroup::kElements));
  some.set(static_cast<std::size_t>(QuantityGroup::kOutputs));
  Topics others = none;
  others.set(static_cast<std::size_t>(QuantityGroup::kInputs));
  const auto wanted_at = [&](std::int64_t tick) {
    return tick < 500 || tick >= 1500 ? none : tick < 1000 ? some : others;
  };
  make(scene);
  loop_->setWanted(Topics().set(kStates));
  Simulation offline(test::sceneFromText(scene));
  ASSERT_EQ(loop_->quantityCount(), 4u + 1u + 1u + 4u);  // G of two shafts, Z, the measure of gauss
  std::vector<double> values(loop_->quantityCount());
  TimedSample timed;
  int count = 0;
  // While the loop sleeps before a tick: what the ticks before have left, then what this one finds.
  clock_.on_sleep_ = [&](int tick) {
    counting = false;
    while (loop_->popSample(timed, values.data())) {
      offline.advanceTo(static_cast<double>(timed.time) / 1e9);
      ASSERT_EQ(timed.topics, wanted_at(timed.time / kMs)) << timed.time;
      const std::vector<double> expected = quantitiesOf(offline, timed.topics);
      // (An empty vector's data may be no pointer at all, which memcmp must not see.)
      ASSERT_TRUE(expected.empty() || std::memcmp(values.data(), expected.data(),
                                                  expected.size() * sizeof(double)) == 0);
      ++count;
    }
    loop_->setWanted(wanted_at(tick));
    if (tick % 150 == 0) {
      loop_->command({0, 0.01 * tick});
      offline.advanceTo(tick / 1000.0);
      offline.command(0, 0.01 * tick);
    }
    if (tick == 2000) {
      loop_->stop();
      return;
    }
    counting = tick > 100;
  };
  loop_->run();
  counting = false;
  EXPECT_EQ(allocations, 0);
  EXPECT_EQ(count, 200);
}

TEST_F(ScriptedLoop, TakesACommandAtTheNextTickAndShowsItThere) {
  settings_.publish_rate = 1000.0;
  make(kScene);
  loop_->setWanted(Topics().set(kStates));
  clock_.on_sleep_ = [&](int tick) {
    // Given while the loop waits for tick 50.
    if (tick == 50) loop_->command({0, 3.0});
    if (tick == 100) loop_->stop();
  };
  loop_->run();

  Simulation offline(test::sceneFromText(kScene));
  TimedSample timed;
  ASSERT_TRUE(loop_->popSample(timed));
  EXPECT_EQ(timed.time, 0);
  for (int tick = 1; loop_->popSample(timed); ++tick) {
    ASSERT_EQ(timed.time, tick * 1000000);
    offline.advanceTo(tick / 1000.0);
    if (tick == 50) offline.command(0, 3.0);
    const Sample& expected = offline.sample();
    ASSERT_EQ(timed.sample.acceleration[0], expected.acceleration[0]) << tick;
    ASSERT_EQ(timed.sample.applied_torque[0], tick < 50 ? 0.0 : 3.0);
  }
  EXPECT_EQ(timed.time, 100000000);
}

TEST_F(ScriptedLoop, TellsItsRealTimeFactorAndLateness) {
  settings_.real_time_factor = 4.0;
  make(kScene);
  clock_.on_sleep_ = [&](int tick) {
    if (tick == 20000) loop_->stop();
  };
  loop_->run();
  const LoopSnapshot snapshot = lastSnapshot();
  EXPECT_EQ(snapshot.state, RunState::kRunning);
  EXPECT_NEAR(snapshot.real_time_factor, 4.0, 1e-3);
  EXPECT_EQ(snapshot.pacing.overruns, 0u);
  EXPECT_EQ(snapshot.lateness.max, 0);
}

// --- ticks inside a step -----------------------------------------------------------------------
// Unobserved ticks move the current time alone. Results in between are those of a loop that makes
// every tick: commands at their ticks, timeouts between two of them, samples.
TEST_F(ScriptedLoop, TicksInsideAStepChangeNothing) {
  const std::string kOverdue = test::sceneText(
      "drive 2",
      {"motor on drive from torque, timeout: 0.0405, on_timeout: zero", "drag on drive: -0.1*w1"},
      "initial: {velocity: [5]}");
  const std::map<int, double> commands{{13, 4.0}, {44, -2.0}, {45, 1.0}, {230, 3.0}};
  settings_.publish_rate = 10.0;
  make(kOverdue);
  loop_->setWanted(Topics().set(kStates));
  clock_.on_sleep_ = [&](int tick) {
    if (commands.count(tick) > 0) loop_->command({0, commands.at(tick)});
    if (tick == 500) loop_->stop();
  };
  loop_->run();

  Simulation offline(test::sceneFromText(kOverdue));
  TimedSample timed;
  ASSERT_TRUE(loop_->popSample(timed));
  for (int tick = 1; tick <= 500; ++tick) {
    offline.advanceTo(tick / 1000.0);
    if (commands.count(tick) > 0) offline.command(0, commands.at(tick));
    if (tick % 100 != 0) continue;
    ASSERT_TRUE(loop_->popSample(timed));
    ASSERT_EQ(timed.time, tick * kMs);
    EXPECT_TRUE(sameBits(timed.sample, offline.sample())) << tick;
  }
  const LoopSnapshot snapshot = lastSnapshot();
  EXPECT_EQ(offline.statistics().command_timeouts, 2u);
  EXPECT_EQ(snapshot.statistics.command_timeouts, 2u);
  EXPECT_EQ(snapshot.statistics.steps, offline.statistics().steps);
}

// omega' = omega^2 is infinite at 1 s.
TEST_F(ScriptedLoop, TellsAStopWithoutARequest) {
  const std::string kEscape =
      test::sceneText("drive 1", {"blow on drive: w1^2"}, "initial: {velocity: [1]}");
  make(kEscape);
  bool stopped = false;
  LoopSnapshot snapshot;
  int last_tick = 0;
  clock_.on_sleep_ = [&](int tick) {
    while (loop_->popSnapshot(snapshot)) stopped = stopped || snapshot.state == RunState::kStopped;
    if (stopped || tick == 2000) loop_->stop();
    last_tick = tick;
  };
  loop_->run();
  Simulation offline(test::sceneFromText(kEscape));
  offline.advanceTo(2.0);
  ASSERT_TRUE(stopped);
  EXPECT_LE(last_tick, 1002);
  EXPECT_EQ(snapshot.reason, offline.status().reason);
  EXPECT_EQ(snapshot.time, std::llround(offline.status().time * 1e9));
}

// Unpaced and with slow ticks a node comes to the end of time within a second.
TEST(SteppingLoop, StopsAtTheEndOfTimeAndSaysSo) {
  for (const std::string& scene : {kRestingScene, kScene}) {
    ScriptedClock clock;
    NodeSettings settings;
    settings.tick_rate = settings.publish_rate = 1e-3;
    settings.real_time_factor = scene == kRestingScene ? 0.0 : 1e10;
    if (scene == kScene) settings.tick_rate = settings.publish_rate = 1e-8;
    SteppingLoop loop(Simulation(test::sceneFromText(scene)), settings, clock);
    std::int64_t last = 0;
    LoopSnapshot snapshot;
    int ticks = 0;
    clock.on_sleep_ = [&](int) {
      while (loop.popSnapshot(snapshot)) {
        EXPECT_GE(snapshot.time, last);
        last = snapshot.time;
      }
      if (snapshot.state == RunState::kStopped || ++ticks == 10000) loop.stop();
    };
    loop.run();
    EXPECT_EQ(snapshot.state, RunState::kStopped);
    EXPECT_EQ(snapshot.reason, StopReason::kTimeExhausted);
    EXPECT_NEAR(static_cast<double>(last), static_cast<double>(kLastInstant), 1e3);
    EXPECT_NE(std::string(snapshot.stop_message.data()).find("~reset_time"), std::string::npos)
        << scene;
  }
}

// --- at rest ----------------------------------------------------------------------------------
/// Expected and actual samples of commands at their ticks, compared one by one.
void expectSamplesAsOffline(SteppingLoop& loop, const std::map<std::int64_t, double>& commands,
                            std::int64_t interval, std::int64_t end) {
  Simulation offline(test::sceneFromText(kRestingScene));
  TimedSample timed;
  ASSERT_TRUE(loop.popSample(timed));
  ASSERT_EQ(timed.time, 0);
  auto command = commands.begin();
  for (std::int64_t time = interval; time <= end; time += interval) {
    for (; command != commands.end() && command->first <= time; ++command) {
      offline.advanceTo(static_cast<double>(command->first) / 1e9);
      offline.command(0, command->second);
    }
    offline.advanceTo(static_cast<double>(time) / 1e9);
    ASSERT_TRUE(loop.popSample(timed));
    ASSERT_EQ(timed.time, time);
    ASSERT_EQ(timed.clock_time - EventClock::kStart, time);
    ASSERT_TRUE(sameBits(timed.sample, offline.sample())) << time;
  }
  EXPECT_FALSE(loop.popSample(timed)) << timed.time;
}

// A command in the middle of a rest acts at the tick after it, as if every tick had been made; and
// the motion that comes to rest again is the same, too.
TEST_F(EventLoop, ARestChangesNeitherTicksNorSamples) {
  make(kRestingScene);
  loop_->setWanted(Topics().set(kStates));
  clock_.at(501 * kMs + 400000, [&] { loop_->command({0, 3.0}); });
  clock_.at(520 * kMs + 1, [&] { loop_->command({0, 0.0}); });
  clock_.at(2455 * kMs + 1, [&] { loop_->stop(); });
  loop_->run();
  expectSamplesAsOffline(*loop_, {{502 * kMs, 3.0}, {521 * kMs, 0.0}}, 10 * kMs, 2450 * kMs);
}

TEST(SteppingLoop, ARestIsOneWaitPerSampleOrStatus) {
  for (const bool wanted : {false, true}) {
    EventClock clock;
    NodeSettings settings;
    SteppingLoop loop(Simulation(test::sceneFromText(kRestingScene)), settings, clock);
    loop.setWanted(Topics().set(kStates, wanted));
    clock.at(10005 * kMs, [&] { loop.stop(); });
    loop.run();
    // 10 Hz of status, or 100 Hz of states, for 10 s; the first tick notices the rest.
    EXPECT_LE(clock.waits_, wanted ? 1003 : 103);
    EXPECT_LE(clock.sleeps_, 2);
    LoopSnapshot snapshot;
    int count = 0;
    while (loop.popSnapshot(snapshot)) ++count;
    EXPECT_EQ(snapshot.state, RunState::kSleeping);
    EXPECT_GE(snapshot.time, 9900 * kMs);
    EXPECT_NEAR(snapshot.real_time_factor, 1.0, 1e-2);
    EXPECT_EQ(snapshot.pacing.overruns, 0u);
    EXPECT_EQ(count, 16);  // the ring is full
  }
}

// A subscriber that comes while the motion rests gets the samples that are due from then on.
TEST_F(EventLoop, AllocatesNothingAtRest) {
  make(kRestingScene);
  clock_.at(100 * kMs, [&] { counting = true; });
  clock_.at(1500 * kMs, [&] { loop_->setWanted(Topics().set(kStates)); });
  clock_.at(2500 * kMs, [&] { loop_->command({0, 1.0}); });
  clock_.at(2510 * kMs, [&] { loop_->command({0, 0.0}); });
  clock_.at(2700 * kMs, [&] { loop_->setRealTimeFactor(2.0); });
  clock_.at(2800 * kMs, [&] { loop_->setPublishRate(500.0); });
  clock_.at(5000 * kMs, [&] {
    counting = false;
    loop_->stop();
  });
  loop_->run();
  EXPECT_EQ(allocations, 0);
}

TEST_F(EventLoop, ANewSubscriberIsServedDuringARest) {
  make(kRestingScene);
  clock_.at(321 * kMs, [&] { loop_->setWanted(Topics().set(kStates)); });
  clock_.at(345 * kMs, [&] { loop_->stop(); });
  loop_->run();
  TimedSample timed;
  ASSERT_TRUE(loop_->popSample(timed));  // the start
  for (const std::int64_t time : {330 * kMs, 340 * kMs}) {
    ASSERT_TRUE(loop_->popSample(timed));
    EXPECT_EQ(timed.time, time);
  }
  EXPECT_FALSE(loop_->popSample(timed));
}

// A pause at an instant within a rest stops time at the last tick before it.
TEST_F(EventLoop, APauseDuringARestFindsThePresent) {
  make(kRestingScene);
  clock_.submitAt(777 * kMs + 700000, *loop_, RequestKind::kPause);
  clock_.submitAt(900 * kMs, *loop_, RequestKind::kResume);
  clock_.at(901 * kMs + 1, [&] { loop_->setWanted(Topics().set(kStates)); });
  clock_.at(911 * kMs, [&] { loop_->stop(); });
  loop_->run();
  clock_.join();
  TimedSample timed;
  ASSERT_TRUE(loop_->popSample(timed));  // the start
  ASSERT_TRUE(loop_->popSample(timed));
  EXPECT_EQ(timed.time, 777 * kMs);
  ASSERT_TRUE(loop_->popSample(timed));
  EXPECT_EQ(timed.time, 787 * kMs);
  EXPECT_EQ(timed.clock_time - EventClock::kStart, 910 * kMs);
}

// --- another speed ----------------------------------------------------------------------------
TEST_F(EventLoop, ANewRealTimeFactorMakesNeitherBurstNorStall) {
  settings_.publish_rate = 1000.0;
  make(kScene);
  loop_->setWanted(Topics().set(kStates));
  std::vector<TimedSample> samples;
  const auto collect = [&] {
    TimedSample timed;
    while (loop_->popSample(timed)) samples.push_back(timed);
  };
  const std::int64_t change = 100 * kMs + 300000;
  const std::int64_t back = 150 * kMs + 100000;
  clock_.at(change, [&] {
    collect();
    loop_->setRealTimeFactor(0.25);
  });
  clock_.at(back, [&] {
    collect();
    loop_->setRealTimeFactor(1.0);
  });
  clock_.at(200 * kMs, [&] {
    collect();
    loop_->stop();
  });
  loop_->run();
  // Every tick has its sample: each is one tick after the one before, at its time on the clock_.
  ASSERT_GT(samples.size(), 150u);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].time - samples[i - 1].time, 1 * kMs);
    const std::int64_t start = samples[i - 1].clock_time - EventClock::kStart;
    const std::int64_t waited = samples[i].clock_time - samples[i - 1].clock_time;
    const bool slow = start > change + 1 * kMs && start < back - 4 * kMs;
    const bool changing = start > change - 1 * kMs && start < back + 4 * kMs && !slow;
    if (changing) {
      // The tick under way comes at its old time; the next one a whole new period after the change.
      EXPECT_GE(waited, 1 * kMs) << start;
      EXPECT_LE(waited, 4 * kMs + 1 * kMs) << start;
    } else {
      EXPECT_EQ(waited, slow ? 4 * kMs : 1 * kMs) << start;
    }
  }
  const LoopSnapshot snapshot = lastSnapshot();
  EXPECT_EQ(snapshot.pacing.overruns, 0u);
  EXPECT_EQ(snapshot.pacing.lost_time, 0);
}

TEST_F(EventLoop, ANewPublishRateCountsFromNow) {
  make(kScene);
  loop_->setWanted(Topics().set(kStates));
  clock_.at(95 * kMs + 1, [&] { loop_->setPublishRate(200.0); });
  clock_.at(117 * kMs, [&] { loop_->stop(); });
  loop_->run();
  std::vector<std::int64_t> times;
  TimedSample timed;
  while (loop_->popSample(timed)) times.push_back(timed.time / kMs);
  EXPECT_EQ(times,
            (std::vector<std::int64_t>{0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 101, 106, 111, 116}));
}

// No rate that a caller may think of hangs the loop, whatever the node's parameters allow.
TEST(SteppingLoop, TinyPublishRatesHangNothing) {
  for (const double rate : {1e-9, 1e-17, 1e-300, 5e-324}) {
    EventClock clock;
    NodeSettings settings;
    settings.publish_rate = rate;
    SteppingLoop loop(Simulation(test::sceneFromText(kScene)), settings, clock);
    loop.setWanted(Topics().set(kStates));
    clock.at(20 * kMs, [&] { loop.setPublishRate(rate / 2.0); });
    clock.at(50 * kMs, [&] { loop.stop(); });
    loop.run();
    int later = 0;
    TimedSample timed;
    while (loop.popSample(timed)) later += timed.time > 0 ? 1 : 0;
    EXPECT_EQ(later, 0) << rate;
  }
}

// --- a clock of others ------------------------------------------------------------------------
/// A loop on a clock that the test sets, in a thread of its own.
class FollowedClockTest : public LoopTest<FollowedClock> {
 protected:
  void start(const std::string& scene) {
    make(scene);
    loop_->setWanted(Topics().set(kStates));
    thread_ = std::thread([this] { loop_->run(); });
  }
  void TearDown() override {
    loop_->stop();
    thread_.join();
  }

  template <class Pop, class Value, class Condition>
  bool waitFor(Pop pop, Value& value, Condition condition) {
    const std::int64_t end = steady_.now() + 20000 * kMs;
    while (steady_.now() < end) {
      while (pop(value)) {
        if (condition(value)) return true;
      }
      loop_->waitForNews(steady_.now() + 20 * kMs);
    }
    return false;
  }
  /// The next sample in the queue, waited for.
  TimedSample nextSample() {
    TimedSample timed;
    EXPECT_TRUE(waitFor([this](TimedSample& t) { return loop_->popSample(t); }, timed,
                        [](const TimedSample&) { return true; }));
    return timed;
  }
  template <class Condition>
  LoopSnapshot waitForSnapshot(Condition condition) {
    LoopSnapshot snapshot;
    EXPECT_TRUE(
        waitFor([this](LoopSnapshot& s) { return loop_->popSnapshot(s); }, snapshot, condition));
    return snapshot;
  }
  /// The clock's first time, and the loop has met it.
  void startClock(std::int64_t time) {
    waitForSnapshot([](const LoopSnapshot& s) { return s.waiting_for_clock; });
    clock_.set(time);
    waitForSnapshot([](const LoopSnapshot& s) { return !s.waiting_for_clock; });
  }

  static constexpr std::int64_t kSecond = 1000 * kMs;
  SteadyClock steady_;
  std::thread thread_;
};

/// The motion goes on, or rests.
class FollowedClockSceneTest : public FollowedClockTest,
                               public testing::WithParamInterface<std::string> {};

TEST_P(FollowedClockSceneTest, WaitsForATimeAndKeepsToIt) {
  start(GetParam());
  EXPECT_EQ(nextSample().time, 0);
  EXPECT_FALSE(clock_.set(0));
  startClock(100 * kSecond);
  // Steps of the clock of any size; between two of them time stands.
  std::int64_t shown = 0;
  for (const std::int64_t time : {3, 12, 20, 21, 470, 2000}) {
    clock_.set(100 * kSecond + time * kMs);
    while (shown + 10 <= time) {
      shown += 10;
      const TimedSample timed = nextSample();
      ASSERT_EQ(timed.time, shown * kMs);
      ASSERT_EQ(timed.clock_time, 100 * kSecond + shown * kMs);
    }
  }
  EXPECT_EQ(loop_->droppedSamples(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Scenes, FollowedClockSceneTest, testing::Values(kScene, kRestingScene));

TEST_F(FollowedClockTest, StartsAnewWhenTheClockJumpsBack) {
  start(kScene);
  nextSample();
  startClock(100 * kSecond);
  clock_.set(100 * kSecond + 30 * kMs);
  for (const std::int64_t time : {10, 20, 30}) EXPECT_EQ(nextSample().time, time * kMs);
  EXPECT_TRUE(clock_.set(50 * kSecond));
  EXPECT_EQ(nextSample().time, 0);
  clock_.set(50 * kSecond + 10 * kMs);
  const TimedSample timed = nextSample();
  EXPECT_EQ(timed.time, 10 * kMs);
  EXPECT_EQ(timed.clock_time, 50 * kSecond + 10 * kMs);
  Simulation offline(test::sceneFromText(kScene));
  offline.advanceTo(0.01);
  EXPECT_TRUE(sameBits(timed.sample, offline.sample()));
  // Also to a time of 0.
  EXPECT_TRUE(clock_.set(0));
  EXPECT_EQ(nextSample().time, 0);
  clock_.set(10 * kMs);
  EXPECT_EQ(nextSample().time, 10 * kMs);
}

// A jump ahead is made in ticks up to 10 s; a longer one is counted, not made and not hidden.
TEST_F(FollowedClockTest, CountsAJumpAheadThatIsTooLong) {
  settings_.publish_rate = 1000.0;
  start(kScene);
  nextSample();
  startClock(100 * kSecond);
  clock_.set(3700 * kSecond);
  EXPECT_EQ(nextSample().time, 1 * kMs);
  // Ticks count from the jump on.
  for (const std::int64_t time : {1, 2}) {
    clock_.set(3700 * kSecond + time * kMs);
    const TimedSample timed = nextSample();
    EXPECT_EQ(timed.time, (time + 1) * kMs);
    EXPECT_EQ(timed.clock_time, 3700 * kSecond + time * kMs);
  }
  loop_->submit(LoopRequest{});  // a pause: a snapshot
  const LoopSnapshot snapshot =
      waitForSnapshot([](const LoopSnapshot& s) { return s.state == RunState::kPaused; });
  EXPECT_EQ(snapshot.pacing.lost_time, 3600 * kSecond - 1 * kMs);
  EXPECT_EQ(snapshot.pacing.overruns, 0u);
}

// The ticks stay where they are on the clock; only samples are counted anew.
TEST_F(FollowedClockTest, ANewPublishRateMovesNoTick) {
  start(kScene);
  nextSample();
  startClock(100 * kSecond);
  clock_.set(100 * kSecond + 10 * kMs + 700000);
  EXPECT_EQ(nextSample().time, 10 * kMs);
  loop_->setRealTimeFactor(3.0);  // not ours to change
  loop_->setPublishRate(1000.0);
  loop_->submit(LoopRequest{});  // a pause: served after the settings
  LoopRequest resume;
  resume.kind = RequestKind::kResume;
  loop_->submit(resume);
  EXPECT_EQ(nextSample().time, 10 * kMs);  // of the pause
  // Ticks count from the resume, which found the clock at 10.7 ms.
  clock_.set(100 * kSecond + 14 * kMs);
  for (const std::int64_t time : {11, 12, 13}) {
    const TimedSample timed = nextSample();
    EXPECT_EQ(timed.time, time * kMs);
    EXPECT_EQ(timed.clock_time, 100 * kSecond + (time * kMs) + 700000);
  }
}

TEST_F(FollowedClockTest, StepsWithoutAClock) {
  settings_.start_paused = true;
  start(kScene);
  LoopRequest step;
  step.kind = RequestKind::kStep;
  step.duration = 5 * kMs;
  const LoopAnswer answer = loop_->submit(step);
  EXPECT_EQ(answer.result, RequestResult::kDone);
  EXPECT_EQ(answer.sample.time, 5 * kMs);
}

LoopAnswer ask(SteppingLoop& loop, RequestKind kind, std::int64_t duration = 0) {
  LoopRequest request;
  request.kind = kind;
  request.duration = duration;
  request.visit = [](Simulation& simulation) {
    MotionState state;
    simulation.saveState(&state);
    return std::string();
  };
  return loop.submit(request);
}

// While paused the simulation is lent to the submitting thread, otherwise the stepping thread
// serves: in whatever order these meet, no step and no command is lost or taken twice.
TEST_F(SteadyLoop, ServesRequestsFromWhicheverThread) {
  settings_.start_paused = true;
  make(kScene);
  std::thread stepping([this] { loop_->run(); });
  std::int64_t time = 0;
  std::uint64_t commands = 0;
  for (int round = 0; round < 100; ++round) {
    for (int i = 0; i < 5; ++i) {
      // Wakes the thread that waits, so that the step meets it at any point of its way.
      loop_->command({0, 1.0});
      LoopRequest step;
      step.kind = RequestKind::kStep;
      step.duration = 1000000;
      step.commands = {{0, 0.5 * i}};
      commands += 2;
      const LoopAnswer answer = loop_->submit(step);
      ASSERT_EQ(answer.result, RequestResult::kDone);
      time += step.duration;
      ASSERT_EQ(answer.sample.time, time);
      ASSERT_EQ(answer.sample.sample.applied_torque[0], 0.5 * i);
    }
    ASSERT_EQ(ask(*loop_, RequestKind::kResume).result, RequestResult::kDone);
    ASSERT_EQ(ask(*loop_, RequestKind::kPause).result, RequestResult::kDone);
    const LoopSnapshot snapshot = lastSnapshot();
    ASSERT_EQ(snapshot.state, RunState::kPaused);
    ASSERT_EQ(snapshot.statistics.commands_accepted, commands);
    ASSERT_GE(snapshot.time, time);
    time = snapshot.time;
  }
  loop_->stop();
  stepping.join();
  EXPECT_EQ(ask(*loop_, RequestKind::kStep, 1).result, RequestResult::kShutDown);
}

// --- what takes long ---------------------------------------------------------------------------

/// A ms of it takes some steps: 1e6 s would take hours.
const std::string kBusyScene =
    test::sceneText("a 1", {"it on a: cos(1e4*t)-w1"}, "solver: {maximum_steps: 1000000000}");

TEST_F(SteadyLoop, APauseAndAnEndInterruptALongStep) {
  settings_.start_paused = true;
  make(kBusyScene);
  std::thread stepping([this] { loop_->run(); });
  LoopAnswer answer;
  std::atomic<bool> is_answered{false};
  const auto step = [&] {
    is_answered = false;
    answer = ask(*loop_, RequestKind::kStep, 1000000000000000);
    is_answered = true;
  };
  std::thread caller(step);
  while (!is_answered) EXPECT_EQ(ask(*loop_, RequestKind::kPause).result, RequestResult::kDone);
  caller.join();
  EXPECT_EQ(answer.result, RequestResult::kInterrupted);
  const std::int64_t reached = answer.sample.time;
  EXPECT_GT(reached, 0);
  EXPECT_LT(reached, 1000000000000000);
  EXPECT_NEAR(answer.sample.sample.time, toSeconds(reached), 2e-9);
  // It goes on from there.
  answer = ask(*loop_, RequestKind::kStep, kMs);
  EXPECT_EQ(answer.result, RequestResult::kDone);
  EXPECT_EQ(answer.sample.time, reached + kMs);
  std::thread last(step);
  loop_->stop();
  last.join();
  stepping.join();
  EXPECT_EQ(answer.result, RequestResult::kShutDown);
}

TEST_F(SteadyLoop, ALongTickLetsRequestsThrough) {
  settings_.tick_rate = settings_.publish_rate = 0.001;
  settings_.real_time_factor = 0.0;  // the first tick is due at once, at 1000 s
  make(kBusyScene);
  std::thread stepping([this] { loop_->run(); });
  for (const RequestKind kind : {RequestKind::kGetState, RequestKind::kPause}) {
    const LoopAnswer answer = ask(*loop_, kind);
    EXPECT_EQ(answer.result, RequestResult::kDone) << answer.message;
  }
  const LoopAnswer answer = ask(*loop_, RequestKind::kGetState);
  EXPECT_GT(answer.sample.time, 0);
  EXPECT_LT(answer.sample.time, 1000000000000);
  EXPECT_EQ(ask(*loop_, RequestKind::kResume).result, RequestResult::kDone);
  loop_->stop();
  stepping.join();
}

TEST_F(SteadyLoop, ServesRequestsWhileItIsPrepared) {
  make(kScene);
  loop_->beginPreparation();
  std::thread stepping([this] { loop_->run(); });
  LoopSnapshot snapshot;
  while (!loop_->popSnapshot(snapshot)) std::this_thread::yield();
  EXPECT_TRUE(snapshot.is_preparing);
  EXPECT_EQ(ask(*loop_, RequestKind::kGetState).sample.time, 0);
  EXPECT_EQ(ask(*loop_, RequestKind::kStep, kMs).result, RequestResult::kNotPaused);
  EXPECT_EQ(ask(*loop_, RequestKind::kPause).result, RequestResult::kDone);
  EXPECT_EQ(ask(*loop_, RequestKind::kStep, kMs).sample.time, kMs);
  EXPECT_EQ(ask(*loop_, RequestKind::kReset).result, RequestResult::kDone);
  EXPECT_EQ(ask(*loop_, RequestKind::kResume).result, RequestResult::kDone);
  const std::int64_t held = ask(*loop_, RequestKind::kGetState).sample.time;
  EXPECT_EQ(held, kMs);  // a reset takes the motion back, and not the time
  EXPECT_EQ(ask(*loop_, RequestKind::kGetState).sample.time, held);
  loop_->endPreparation();
  while (snapshot.is_preparing || snapshot.time <= held) {
    if (!loop_->popSnapshot(snapshot)) std::this_thread::yield();
  }
  loop_->stop();
  stepping.join();
}

}  // namespace
}  // namespace variator_sim
