// The holds: closed forms of u and u' against the differential equations they solve, continuity at
// every event, ends of segments, and when u jumps.
#include "variator_sim/command_input.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

CommandInputSettings makeSettings(Hold hold, double parameter, double initial) {
  CommandInputSettings settings;
  settings.hold = hold;
  settings.hold_parameter = parameter;
  settings.initial = initial;
  return settings;
}

TEST(CommandSignal, IsTheInitialValueAfterReset) {
  for (const Hold hold : {Hold::kZeroOrder, Hold::kFirstOrderLag, Hold::kRateLimit,
                          Hold::kFirstOrderHold, Hold::kSecondOrderLag}) {
    const CommandInputSettings settings = makeSettings(hold, 0.5, -3.0);
    CommandSignal signal;
    signal.command(settings, 1.0, 8.0);
    signal.reset(settings);
    EXPECT_EQ(signal.closed().form, CommandSignal::Closed::kConstant);
    EXPECT_EQ(signal.target(), -3.0);
    EXPECT_EQ(signal.segmentEnd(), kInfinity);
    for (const double t : {0.0, 1.0, 1e6}) {
      EXPECT_EQ(signal.at(t).value, -3.0);
      EXPECT_EQ(signal.at(t).rate, 0.0);
    }
  }
}

TEST(CommandSignal, ZeroOrderJumps) {
  const CommandInputSettings settings = makeSettings(Hold::kZeroOrder, 0.0, 1.0);
  CommandSignal signal;
  signal.reset(settings);
  EXPECT_TRUE(signal.command(settings, 2.0, 5.0));
  EXPECT_EQ(signal.closed().form, CommandSignal::Closed::kConstant);
  EXPECT_EQ(signal.at(2.0).value, 5.0);
  EXPECT_EQ(signal.at(9.0).value, 5.0);
  EXPECT_EQ(signal.at(2.0).rate, 0.0);
  EXPECT_EQ(signal.target(), 5.0);
  EXPECT_FALSE(signal.command(settings, 3.0, 5.0)) << "the same value again is no jump";
  EXPECT_TRUE(signal.command(settings, 4.0, -5.0));
}

TEST(CommandSignal, FirstOrderLagSolvesItsEquation) {
  const double tau = 0.2;
  const CommandInputSettings settings = makeSettings(Hold::kFirstOrderLag, tau, 1.0);
  CommandSignal signal;
  signal.reset(settings);
  EXPECT_FALSE(signal.command(settings, 2.0, 5.0));
  EXPECT_NE(signal.closed().form, CommandSignal::Closed::kConstant);
  EXPECT_EQ(signal.segmentEnd(), 2.0 + 50.0 * settings.hold_parameter);  // arrived, to the last bit
  EXPECT_EQ(signal.target(), 5.0);
  EXPECT_EQ(signal.at(2.0).value, 1.0);
  EXPECT_DOUBLE_EQ(signal.at(2.0).rate, 20.0);
  for (const double t : {2.0, 2.05, 2.2, 3.0, 10.0}) {
    EXPECT_NEAR(signal.at(t).value, 5.0 - 4.0 * std::exp(-(t - 2.0) / tau), 4e-15) << t;
    EXPECT_NEAR(tau * signal.at(t).rate, 5.0 - signal.at(t).value, 4e-15) << t;
  }
  EXPECT_EQ(signal.at(1e3).value, 5.0);

  // A new command in between goes on from where u is.
  const double before = signal.at(2.1).value;
  EXPECT_FALSE(signal.command(settings, 2.1, -1.0));
  EXPECT_EQ(signal.at(2.1).value, before);
  EXPECT_DOUBLE_EQ(signal.at(2.1).rate, (-1.0 - before) / tau);
  EXPECT_NEAR(signal.at(2.3).value, -1.0 + (before + 1.0) * std::exp(-1.0), 1e-14);
}

TEST(CommandSignal, SecondOrderLagSolvesItsEquationAndKeepsItsRate) {
  const double tau = 0.2;
  const CommandInputSettings settings = makeSettings(Hold::kSecondOrderLag, tau, 1.0);
  CommandSignal signal;
  signal.reset(settings);
  EXPECT_EQ(signal.at(1.0).second_rate, 0.0);
  EXPECT_FALSE(signal.command(settings, 2.0, 5.0));
  EXPECT_NE(signal.closed().form, CommandSignal::Closed::kConstant);
  EXPECT_EQ(signal.segmentEnd(), 2.0 + 50.0 * settings.hold_parameter);
  EXPECT_EQ(signal.at(2.0).value, 1.0);
  EXPECT_EQ(signal.at(2.0).rate, 0.0);
  EXPECT_DOUBLE_EQ(signal.at(2.0).second_rate, 4.0 / (tau * tau));
  const auto expectEquation = [&](double t, double command) {
    // (tau d/dt + 1)^2 u = tau^2 u'' + 2 tau u' + u
    EXPECT_NEAR(
        tau * tau * signal.at(t).second_rate + 2.0 * tau * signal.at(t).rate + signal.at(t).value,
        command, 1e-14)
        << t;
    const double h = 1e-4;
    EXPECT_NEAR(signal.at(t).rate, (signal.at(t + h).value - signal.at(t - h).value) / (2.0 * h),
                1e-5)
        << t;
    EXPECT_NEAR(signal.at(t).second_rate,
                (signal.at(t + h).rate - signal.at(t - h).rate) / (2.0 * h), 1e-4)
        << t;
  };
  for (const double t : {2.01, 2.05, 2.2, 3.0, 10.0}) expectEquation(t, 5.0);
  EXPECT_NEAR(signal.at(2.2).value, 5.0 - 4.0 * 2.0 * std::exp(-1.0), 1e-14);
  EXPECT_EQ(signal.at(1e3).value, 5.0);

  // A new command in between goes on from where u and u' are.
  const double before = signal.at(2.1).value;
  const double rate_before = signal.at(2.1).rate;
  EXPECT_FALSE(signal.command(settings, 2.1, -1.0));
  EXPECT_EQ(signal.at(2.1).value, before);
  EXPECT_NEAR(signal.at(2.1).rate, rate_before, 1e-14);
  for (const double t : {2.11, 2.3, 3.0}) expectEquation(t, -1.0);

  // A command to where u just passes through is none to stay there.
  const double passing = signal.at(2.3).value;
  EXPECT_FALSE(signal.command(settings, 2.3, passing));
  EXPECT_NE(signal.closed().form, CommandSignal::Closed::kConstant);
  EXPECT_LT(signal.at(2.3).rate, -1.0);
  for (const double t : {2.35, 2.6}) expectEquation(t, passing);
}

TEST(CommandSignal, FirstOrderLagKeepsDigitsOfSmallChanges) {
  const CommandInputSettings settings = makeSettings(Hold::kFirstOrderLag, 1.0, 0.0);
  CommandSignal signal;
  signal.reset(settings);
  signal.command(settings, 0.0, 1.0);
  EXPECT_DOUBLE_EQ(signal.at(1e-12).value, 1e-12 - 0.5e-24);
}

TEST(CommandSignal, RateLimitRampsBothWaysAndArrives) {
  for (const double sign : {1.0, -1.0}) {
    const CommandInputSettings settings = makeSettings(Hold::kRateLimit, 4.0, sign);
    CommandSignal signal;
    signal.reset(settings);
    EXPECT_FALSE(signal.command(settings, 2.0, sign * 7.0));
    EXPECT_NE(signal.closed().form, CommandSignal::Closed::kConstant);
    EXPECT_EQ(signal.segmentEnd(), 3.5);
    EXPECT_EQ(signal.at(2.0).value, sign);
    EXPECT_EQ(signal.at(2.0).rate, sign * 4.0);
    EXPECT_EQ(signal.at(2.25).value, sign * 2.0);
    EXPECT_EQ(signal.at(2.25).rate, sign * 4.0);
    EXPECT_EQ(signal.at(3.5).value, sign * 7.0);
    EXPECT_EQ(signal.at(3.5).rate, sign * 4.0) << "left-hand limit at the end";
    EXPECT_EQ(signal.at(4.0).value, sign * 7.0) << "never past its target";

    signal.finishSegment();
    EXPECT_EQ(signal.closed().form, CommandSignal::Closed::kConstant);
    EXPECT_EQ(signal.segmentEnd(), kInfinity);
    EXPECT_EQ(signal.at(3.5).value, sign * 7.0);
    EXPECT_EQ(signal.at(3.5).rate, 0.0);
    EXPECT_EQ(signal.target(), sign * 7.0);
  }
}

TEST(CommandSignal, RateLimitTurnsBackWithoutAJump) {
  const CommandInputSettings settings = makeSettings(Hold::kRateLimit, 2.0, 0.0);
  CommandSignal signal;
  signal.reset(settings);
  signal.command(settings, 0.0, 10.0);
  EXPECT_FALSE(signal.command(settings, 1.0, -10.0));
  EXPECT_EQ(signal.at(1.0).value, 2.0);
  EXPECT_EQ(signal.at(1.0).rate, -2.0);
  EXPECT_EQ(signal.segmentEnd(), 7.0);
  EXPECT_EQ(signal.at(2.0).value, 0.0);
}

TEST(CommandSignal, FirstOrderHoldTakesOnePeriod) {
  const CommandInputSettings settings = makeSettings(Hold::kFirstOrderHold, 0.5, 1.0);
  CommandSignal signal;
  signal.reset(settings);
  EXPECT_FALSE(signal.command(settings, 2.0, 3.0));
  EXPECT_EQ(signal.segmentEnd(), 2.5);
  EXPECT_EQ(signal.at(2.0).value, 1.0);
  EXPECT_EQ(signal.at(2.25).value, 2.0);
  EXPECT_EQ(signal.at(2.25).rate, 4.0);
  EXPECT_EQ(signal.at(2.5).rate, 4.0);
  EXPECT_EQ(signal.at(2.5).value, 3.0);
  // The next sample comes early: from where u is, over one period again.
  EXPECT_FALSE(signal.command(settings, 2.25, 0.0));
  EXPECT_EQ(signal.at(2.25).value, 2.0);
  EXPECT_EQ(signal.at(2.25).rate, -4.0);
  EXPECT_EQ(signal.segmentEnd(), 2.75);
  EXPECT_EQ(signal.at(2.5).value, 1.0);
}

TEST(CommandSignal, IsContinuousAtTheEndOfARamp) {
  // Numbers without exact quotients: u may not step by more than the resolution of time explains,
  // and may never be past its target.
  for (const Hold hold : {Hold::kRateLimit, Hold::kFirstOrderHold}) {
    for (int i = 1; i <= 1000; ++i) {
      const CommandInputSettings settings = makeSettings(hold, 0.3, 0.1);
      const double target = i % 2 == 0 ? 0.7 : -0.7;
      CommandSignal signal;
      signal.reset(settings);
      signal.command(settings, i / 3.0, target);
      const double end = signal.segmentEnd();
      ASSERT_LT(end, kInfinity);
      const double before = signal.at(std::nextafter(end, 0.0)).value;
      EXPECT_NEAR(before, target, 4e-16 * end * std::abs(signal.at(end).rate) + 1e-15);
      EXPECT_LE(std::abs(before), 0.7);
      EXPECT_EQ(signal.at(end).value, target);
      signal.finishSegment();
      EXPECT_EQ(signal.at(end).value, target);
    }
  }
}

TEST(CommandSignal, StaysConstantWhenTheCommandIsWhereUIs) {
  for (const Hold hold : {Hold::kZeroOrder, Hold::kFirstOrderLag, Hold::kRateLimit,
                          Hold::kFirstOrderHold, Hold::kSecondOrderLag}) {
    const CommandInputSettings settings = makeSettings(hold, 0.5, 3.0);
    CommandSignal signal;
    signal.reset(settings);
    EXPECT_FALSE(signal.command(settings, 1.0, 3.0));
    EXPECT_EQ(signal.closed().form, CommandSignal::Closed::kConstant);
    EXPECT_EQ(signal.at(2.0).value, 3.0);
    EXPECT_EQ(signal.at(1.0).rate, 0.0);
    EXPECT_EQ(signal.segmentEnd(), kInfinity);
  }
}

TEST(CommandSignal, ARampShorterThanTheResolutionOfTimeIsAJump) {
  const CommandInputSettings settings = makeSettings(Hold::kRateLimit, 1e9, 0.0);
  CommandSignal signal;
  signal.reset(settings);
  EXPECT_TRUE(signal.command(settings, 1e6, 1e-3));
  EXPECT_EQ(signal.closed().form, CommandSignal::Closed::kConstant);
  EXPECT_EQ(signal.at(1e6).value, 1e-3);
  EXPECT_EQ(signal.segmentEnd(), kInfinity);
}

TEST(CommandSignal, DoesNotClampByItself) {
  CommandInputSettings settings = makeSettings(Hold::kZeroOrder, 0.0, 0.0);
  settings.minimum = -1.0;
  settings.maximum = 1.0;
  CommandSignal signal;
  signal.reset(settings);
  signal.command(settings, 0.0, 5.0);
  EXPECT_EQ(signal.at(0.0).value, 5.0);
}

}  // namespace
}  // namespace variator_sim
