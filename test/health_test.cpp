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

LoopSnapshot aSecond() {
  LoopSnapshot snapshot = running();
  snapshot.pacing.ticks = 1000;
  return snapshot;
}

void expectHealth(const Health& health, HealthLevel level, const std::string& summary) {
  EXPECT_EQ(health.level, level) << health.summary;
  EXPECT_EQ(health.summary, summary);
}

TEST(Health, StatesThatAreMeantAreWell) {
  LoopSnapshot snapshot = running();
  expectHealth(judgeHealth(aSecond(), {}), HealthLevel::kOk, "running");
  snapshot.state = RunState::kPaused;
  snapshot.real_time_factor = 0.0;
  expectHealth(judgeHealth(snapshot, {}), HealthLevel::kOk, "paused");
  snapshot.state = RunState::kSleeping;
  expectHealth(judgeHealth(snapshot, {}), HealthLevel::kOk, "sleeping: at rest until a command");
}

TEST(Health, AStopIsAnErrorWhateverElse) {
  LoopSnapshot now = aSecond();
  now.state = RunState::kStopped;
  now.reason = StopReason::kSingularConstraint;
  now.statistics.commands_refused = 3;
  expectHealth(judgeHealth(now, {}), HealthLevel::kError, "stopped: SingularConstraint");
}

TEST(Health, AFewOverrunsAreWell) {
  LoopSnapshot before = running();
  before.pacing.ticks = 5000;
  before.pacing.overruns = 500;
  LoopSnapshot now = before;
  now.pacing.ticks += 1000;
  now.pacing.overruns += 10;
  expectHealth(judgeHealth(now, before), HealthLevel::kOk, "running");
  now.pacing.overruns += 1;
  expectHealth(judgeHealth(now, before), HealthLevel::kWarn, "11 of 1000 ticks overran");
}

TEST(Health, ASlowSimulationIsAWarning) {
  LoopSnapshot snapshot = aSecond();
  snapshot.real_time_factor = 0.91;
  EXPECT_EQ(judgeHealth(snapshot, {}).level, HealthLevel::kOk);
  snapshot.real_time_factor = 0.5;
  expectHealth(judgeHealth(snapshot, {}), HealthLevel::kWarn, "real-time factor 0.5 instead of 1");
  snapshot.wanted_factor = 0.0;  // unpaced: any speed will do
  EXPECT_EQ(judgeHealth(snapshot, {}).level, HealthLevel::kOk);
}

TEST(Health, NamesAllThatIsWrong) {
  LoopSnapshot now = aSecond();
  now.waiting_for_clock = true;
  now.pacing.lost_time = 1;
  now.statistics.commands_refused = 1;
  now.statistics.command_timeouts = 2;
  now.commands_dropped = 3;
  now.samples_dropped = 4;
  expectHealth(judgeHealth(now, {}), HealthLevel::kWarn,
               "waiting for /clock; fell behind its clock for good; 1 commands refused; 2 inputs "
               "without a command; 3 commands dropped; 4 samples dropped");
  // It is about what has been added.
  now.waiting_for_clock = false;
  expectHealth(judgeHealth(now, now), HealthLevel::kOk, "running");
}

TEST(Health, CountsAfterAResetBeginAtZero) {
  LoopSnapshot before = aSecond();
  before.statistics.commands_refused = 5;
  LoopSnapshot now = aSecond();
  EXPECT_EQ(judgeHealth(now, before).level, HealthLevel::kOk);
  now.statistics.commands_refused = 2;
  expectHealth(judgeHealth(now, before), HealthLevel::kWarn, "2 commands refused");
}

}  // namespace
}  // namespace variator_sim
