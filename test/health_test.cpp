// The rule behind the diagnostics.
#include "ros/health.h"

#include <gtest/gtest.h>

#include <string>

namespace variator_sim {
namespace {

LoopSnapshot running() {
  LoopSnapshot snapshot;
  snapshot.state = RunState::kRunning;
  snapshot.real_time_factor = 1.0;
  snapshot.wanted_factor = 1.0;
  return snapshot;
}

HealthCounts aSecond() {
  HealthCounts counts;
  counts.pacing.ticks = 1000;
  return counts;
}

void expectHealth(const Health& health, HealthLevel level, const std::string& summary) {
  EXPECT_EQ(health.level, level) << health.summary;
  EXPECT_EQ(health.summary, summary);
}

TEST(Health, StatesThatAreMeantAreWell) {
  LoopSnapshot snapshot = running();
  expectHealth(judgeHealth(snapshot, aSecond(), {}), HealthLevel::kOk, "running");
  snapshot.state = RunState::kPaused;
  snapshot.real_time_factor = 0.0;
  expectHealth(judgeHealth(snapshot, {}, {}), HealthLevel::kOk, "paused");
  snapshot.state = RunState::kSleeping;
  expectHealth(judgeHealth(snapshot, {}, {}), HealthLevel::kOk,
               "sleeping: at rest until a command");
}

TEST(Health, AStopIsAnErrorWhateverElse) {
  LoopSnapshot snapshot = running();
  snapshot.state = RunState::kStopped;
  snapshot.reason = StopReason::kSingularConstraint;
  HealthCounts now = aSecond();
  now.statistics.commands_refused = 3;
  expectHealth(judgeHealth(snapshot, now, {}), HealthLevel::kError, "stopped: SingularConstraint");
}

TEST(Health, AFewOverrunsAreWell) {
  HealthCounts before;
  before.pacing.ticks = 5000;
  before.pacing.overruns = 500;
  HealthCounts now = before;
  now.pacing.ticks += 1000;
  now.pacing.overruns += 10;
  expectHealth(judgeHealth(running(), now, before), HealthLevel::kOk, "running");
  now.pacing.overruns += 1;
  expectHealth(judgeHealth(running(), now, before), HealthLevel::kWarn, "11 of 1000 ticks overran");
}

TEST(Health, ASlowSimulationIsAWarning) {
  LoopSnapshot snapshot = running();
  snapshot.real_time_factor = 0.91;
  EXPECT_EQ(judgeHealth(snapshot, aSecond(), {}).level, HealthLevel::kOk);
  snapshot.real_time_factor = 0.5;
  expectHealth(judgeHealth(snapshot, aSecond(), {}), HealthLevel::kWarn,
               "real-time factor 0.5 instead of 1");
  snapshot.wanted_factor = 0.0;  // unpaced: any speed will do
  EXPECT_EQ(judgeHealth(snapshot, aSecond(), {}).level, HealthLevel::kOk);
}

TEST(Health, NamesAllThatIsWrong) {
  LoopSnapshot snapshot = running();
  snapshot.waiting_for_clock = true;
  HealthCounts now = aSecond();
  now.pacing.lost_time = 1;
  now.statistics.commands_refused = 1;
  now.statistics.command_timeouts = 2;
  now.commands_dropped = 3;
  now.samples_dropped = 4;
  expectHealth(judgeHealth(snapshot, now, {}), HealthLevel::kWarn,
               "waiting for /clock; fell behind its clock for good; 1 commands refused; 2 inputs "
               "without a command; 3 commands dropped; 4 samples dropped");
  // It is about what has been added.
  snapshot.waiting_for_clock = false;
  expectHealth(judgeHealth(snapshot, now, now), HealthLevel::kOk, "running");
}

TEST(Health, CountsAfterAResetBeginAtZero) {
  HealthCounts before = aSecond();
  before.statistics.commands_refused = 5;
  HealthCounts now = aSecond();
  EXPECT_EQ(judgeHealth(running(), now, before).level, HealthLevel::kOk);
  now.statistics.commands_refused = 2;
  expectHealth(judgeHealth(running(), now, before), HealthLevel::kWarn, "2 commands refused");
}

}  // namespace
}  // namespace variator_sim
