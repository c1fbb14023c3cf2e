// Pacing with a clock that the test moves: nothing here sleeps.
#include "ros/pacer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <thread>
#include <vector>

#include "ros/lateness.h"
#include "ros/sample_ring.h"
#include "ros/sample_schedule.h"

namespace variator_sim {
namespace {

constexpr std::int64_t kMillisecond = 1000000;

/// Sleeping takes no time but moves the clock; each sleep ends `oversleep` late.
class ManualClock : public PacingClock {
 public:
  std::int64_t now() override { return now_; }
  void sleepUntil(std::int64_t deadline) override {
    ++sleeps_;
    longest_sleep_ = std::max(longest_sleep_, deadline - now_);
    now_ = std::max(now_, deadline) + oversleep_;
  }
  void waitUntil(std::int64_t deadline) override { sleepUntil(deadline); }
  void wake() override {}
  void pass(std::int64_t duration) { now_ += duration; }

  std::int64_t now_ = 5000 * kMillisecond;
  std::int64_t oversleep_ = 0;
  std::int64_t longest_sleep_ = 0;
  int sleeps_ = 0;
};

void waitForTick(Pacer& pacer) {
  while (!pacer.waitForTick()) {
  }
}

Pacer anchored(PacingClock& clock, double period) {
  Pacer pacer(clock, period);
  pacer.anchor();
  return pacer;
}

/// Every tenth tick of a ms has a sample.
SampleSchedule samplesOf(const Pacer& pacer, PacingClock& clock) {
  SampleSchedule samples;
  samples.setRate(100.0, 1000.0);
  samples.countFrom(pacer, clock.now());
  return samples;
}

TEST(Pacer, TicksStandAtAbsoluteDeadlines) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e9 / 3.0);
  const std::int64_t start = clock.now();
  for (std::int64_t n = 1; n <= 3000; ++n) {
    waitForTick(pacer);
    // n / 3 s, rounded to whole ns: nothing adds up.
    ASSERT_EQ(pacer.tickStart() - start, (n * 1000000000 + 1) / 3) << n;
  }
  EXPECT_EQ(pacer.counters().ticks, 3000u);
  EXPECT_EQ(pacer.counters().overruns, 0u);
  EXPECT_LE(clock.longest_sleep_, Pacer::kLongestSleep);
}

TEST(Pacer, LateWakingDelaysNoLaterTick) {
  ManualClock clock;
  clock.oversleep_ = 130000;
  Pacer pacer = anchored(clock, 1e6);
  const std::int64_t start = clock.now();
  for (int n = 1; n <= 1000; ++n) {
    waitForTick(pacer);
    ASSERT_EQ(pacer.tickStart() - start, n * kMillisecond + 130000);
    ASSERT_EQ(pacer.lateness(), 130000);
  }
  EXPECT_EQ(pacer.counters().overruns, 0u);
}

TEST(Pacer, CatchesUpAfterAStallWithoutSleeping) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  const std::int64_t start = clock.now();
  waitForTick(pacer);
  clock.pass(10 * kMillisecond);
  const int sleeps = clock.sleeps_;
  // Ticks 2 to 11 are due at 2 to 11 ms and begin at 11 ms: the first eight are overruns.
  for (int n = 2; n <= 11; ++n) waitForTick(pacer);
  EXPECT_EQ(clock.sleeps_, sleeps);
  EXPECT_EQ(pacer.counters().overruns, 8u);
  EXPECT_EQ(pacer.counters().lost_time, 0);
  waitForTick(pacer);
  EXPECT_EQ(pacer.tickStart() - start, 12 * kMillisecond);
  EXPECT_EQ(pacer.lateness(), 0);
}

TEST(Pacer, GivesUpWallTimeInsteadOfALongBurst) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  waitForTick(pacer);
  clock.pass(10000 * kMillisecond);
  const std::int64_t resumed = clock.now();
  waitForTick(pacer);
  EXPECT_EQ(pacer.lateness(), 9999 * kMillisecond);
  EXPECT_EQ(pacer.counters().lost_time, 9999 * kMillisecond);
  EXPECT_EQ(pacer.counters().overruns, 1u);
  for (int n = 1; n <= 100; ++n) {
    waitForTick(pacer);
    ASSERT_EQ(pacer.tickStart() - resumed, n * kMillisecond);
  }
  EXPECT_EQ(pacer.counters().overruns, 1u);
  EXPECT_EQ(pacer.counters().ticks, 102u);
}

TEST(Pacer, TicksTooHeavyForTheirRateFallBehindBounded) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  for (int n = 0; n < 10000; ++n) {
    waitForTick(pacer);
    clock.pass(2 * kMillisecond);
    ASSERT_LE(pacer.lateness(), Pacer::kMostBehind + 2 * kMillisecond);
  }
  EXPECT_GT(pacer.counters().lost_time, 9000 * kMillisecond);
}

// Ten ticks take 50 ms where each takes 5 ms: once time is lost, samples come between them.
TEST(SampleSchedule, OverloadedItKeepsHalfItsRate) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  SampleSchedule samples = samplesOf(pacer, clock);
  int count = 0;
  for (int n = 0; n < 1100; ++n) {
    waitForTick(pacer);
    count += samples.isDue(pacer) && n >= 100 ? 1 : 0;
    clock.pass(5 * kMillisecond);
  }
  EXPECT_GE(count, 240);  // 5 s
  EXPECT_LE(count, 500);
}

// A burst of late ticks has the samples that it would have had in time, and no other ones.
TEST(SampleSchedule, LateTicksMakeNoFurtherSamples) {
  for (const auto& [interval, stall] : {std::pair{10, 9}, std::pair{300, 240}}) {
    ManualClock clock;
    Pacer pacer = anchored(clock, 1e6);
    SampleSchedule samples = samplesOf(pacer, clock);
    for (int n = 1; n <= 1000; ++n) {
      if (n % interval == 5) clock.pass(stall * kMillisecond);
      waitForTick(pacer);
      EXPECT_EQ(samples.isDue(pacer), n % 10 == 0) << n << ", " << stall << " ms late";
    }
  }
}

TEST(Pacer, ANewPeriodCountsFromNow) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  for (int n = 0; n < 5000; ++n) waitForTick(pacer);
  const std::int64_t start = clock.now();
  pacer.setPeriod(1e5);
  for (int n = 1; n <= 100; ++n) {
    waitForTick(pacer);
    ASSERT_EQ(pacer.tickStart() - start, n * 100000);
  }
  EXPECT_EQ(pacer.counters().overruns, 0u);
}

// Lateness at a change of the period is neither caught up nor hidden.
TEST(Pacer, ANewPeriodCountsTheBacklogAsLost) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e6);
  waitForTick(pacer);
  clock.pass(100 * kMillisecond);
  pacer.setPeriod(1e5);
  EXPECT_EQ(pacer.counters().lost_time, 99 * kMillisecond);
  const std::int64_t start = clock.now();
  waitForTick(pacer);
  EXPECT_EQ(pacer.tickStart() - start, 100000);
}

TEST(Pacer, PassesOverTicksAndKeepsTheirGrid) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 1e9 / 3.0);
  const std::int64_t start = clock.now();
  EXPECT_EQ(pacer.lastDueTick(), 0);
  for (std::int64_t n = 1; n < 3000; n += 7) {
    // Exactly when it is due, and 1 ns before.
    clock.now_ = start + (n * 1000000000 + 1) / 3;
    ASSERT_EQ(pacer.dueTime(n), clock.now_);
    ASSERT_EQ(pacer.lastDueTick(), n);
    clock.pass(-1);
    ASSERT_EQ(pacer.lastDueTick(), n - 1);
    pacer.passOver(n - 1);
    waitForTick(pacer);
    ASSERT_EQ(pacer.tick(), n);
    ASSERT_EQ(pacer.lateness(), 0);
  }
  EXPECT_EQ(pacer.counters().ticks, 429u);
  clock.now_ = start - 1;
  EXPECT_LT(pacer.lastDueTick(), 0);
}

TEST(Pacer, UnpacedNeverSleeps) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 0.0);
  for (int n = 0; n < 1000; ++n) {
    ASSERT_TRUE(pacer.waitForTick());
    clock.pass(3 * kMillisecond);
  }
  EXPECT_EQ(clock.sleeps_, 0);
  EXPECT_EQ(pacer.counters().ticks, 1000u);
  EXPECT_EQ(pacer.counters().overruns, 0u);
}

TEST(Pacer, ASlowTickIsWaitedForInShortSleeps) {
  ManualClock clock;
  Pacer pacer = anchored(clock, 10e9);
  int calls = 1;
  while (!pacer.waitForTick()) ++calls;
  EXPECT_EQ(calls, 500);
  EXPECT_EQ(pacer.lateness(), 0);
}

TEST(LatenessHistogram, QuantilesAreKnownToTheirBin) {
  LatenessHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0);
  for (std::int64_t i = 1; i <= 100000; ++i) histogram.add(i);
  for (const double fraction : {0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999}) {
    const double exact = fraction * 100000.0;
    // The last bin is filled in part.
    const double allowance = fraction < 0.98 ? 1.0 : 0.031 * exact;
    EXPECT_NEAR(static_cast<double>(histogram.quantile(fraction)), exact, allowance) << fraction;
  }
  EXPECT_EQ(histogram.quantile(1.0), 100000);
  EXPECT_EQ(histogram.max(), 100000);
}

// The quantile of a sample lies in its bin.
TEST(LatenessHistogram, QuantilesStayInTheirBin) {
  LatenessHistogram histogram;
  for (int i = 0; i < 1000; ++i) {
    histogram.add(69632);  // the least of its bin
    histogram.add(500000);
  }
  EXPECT_GE(histogram.quantile(0.01), 69632);
  EXPECT_LE(histogram.quantile(0.5), 1.031 * 69632);
  EXPECT_GE(histogram.quantile(0.51), 500000 / 1.031);
  EXPECT_EQ(histogram.quantile(1.0), 500000);
}

TEST(LatenessHistogram, TakesAnyValue) {
  for (const std::int64_t value :
       {std::int64_t{0}, std::int64_t{1}, std::int64_t{3}, std::int64_t{4}, std::int64_t{7},
        std::int64_t{8}, std::int64_t{1} << 39, std::int64_t{1} << 50, INT64_MAX}) {
    LatenessHistogram histogram;
    histogram.add(value);
    histogram.add(value);
    EXPECT_LE(histogram.quantile(0.5), value);
    EXPECT_EQ(histogram.quantile(1.0), std::min(value, histogram.quantile(1.0)));
    EXPECT_EQ(histogram.max(), value);
  }
}

TEST(LatenessWindow, ForgetsWhatIsOlderThanItsSlices) {
  LatenessWindow window;
  window.add(1000000);
  for (int i = 0; i < LatenessWindow::kSlices - 1; ++i) {
    window.nextSlice();
    window.add(10);
    EXPECT_EQ(window.total().max(), 1000000);
  }
  window.nextSlice();
  EXPECT_EQ(window.total().max(), 10);
  EXPECT_EQ(window.total().count(), static_cast<std::uint64_t>(LatenessWindow::kSlices - 1));
}

struct Entry {
  std::uint64_t number = 0;
  std::uint64_t copies[20] = {};
};

Entry entryOf(std::uint64_t number) {
  Entry entry;
  entry.number = number;
  std::fill(std::begin(entry.copies), std::end(entry.copies), number);
  return entry;
}

TEST(SampleRing, GivesEntriesInOrder) {
  SampleRing<Entry, 8> ring;
  Entry entry;
  EXPECT_FALSE(ring.pop(entry));
  for (std::uint64_t i = 0; i < 100; ++i) {
    ring.push(entryOf(2 * i));
    ring.push(entryOf(2 * i + 1));
    ASSERT_TRUE(ring.pop(entry));
    ASSERT_EQ(entry.number, 2 * i);
    ASSERT_TRUE(ring.pop(entry));
    ASSERT_EQ(entry.number, 2 * i + 1);
    ASSERT_FALSE(ring.pop(entry));
  }
  EXPECT_EQ(ring.dropped(), 0u);
}

TEST(SampleRing, DropsAndCountsTheOldest) {
  SampleRing<Entry, 8> ring;
  for (std::uint64_t i = 0; i < 100; ++i) ring.push(entryOf(i));
  Entry entry;
  for (std::uint64_t i = 92; i < 100; ++i) {
    ASSERT_TRUE(ring.pop(entry));
    EXPECT_EQ(entry.number, i);
  }
  EXPECT_FALSE(ring.pop(entry));
  EXPECT_EQ(ring.dropped(), 92u);
}

TEST(SampleRing, CarriesAsManyNumbersAsEachEntryHas) {
  SampleRing<Entry, 4> ring(3);
  const double numbers[] = {0.1, -0.2, 1e300};
  ring.push(entryOf(7), numbers, 3);
  ring.push(entryOf(8));
  ring.push(entryOf(9), numbers + 1, 1);
  Entry entry;
  double got[] = {5.0, 5.0, 5.0};
  ASSERT_TRUE(ring.pop(entry, got));
  EXPECT_EQ(entry.number, 7u);
  EXPECT_TRUE(std::equal(std::begin(got), std::end(got), std::begin(numbers)));
  ASSERT_TRUE(ring.pop(entry, got));
  EXPECT_EQ(entry.number, 8u);
  EXPECT_TRUE(std::equal(std::begin(got), std::end(got), std::begin(numbers)));
  ASSERT_TRUE(ring.pop(entry, got));
  EXPECT_EQ(entry.number, 9u);
  EXPECT_EQ(got[0], -0.2);
  EXPECT_EQ(got[1], -0.2);
  ring.push(entryOf(10), numbers, 3);
  ASSERT_TRUE(ring.pop(entry));
  EXPECT_EQ(entry.number, 10u);
}

TEST(SampleRing, NeverShowsATornEntry) {
  constexpr std::uint64_t kEntries = 200000;
  SampleRing<Entry, 4> ring(2);
  std::thread producer([&] {
    for (std::uint64_t i = 1; i <= kEntries; ++i) {
      const double numbers[] = {static_cast<double>(i), -static_cast<double>(i)};
      ring.push(entryOf(i), numbers, i % 3);
    }
  });
  std::uint64_t last = 0;
  std::uint64_t seen = 0;
  Entry entry;
  while (last < kEntries) {
    double numbers[2] = {};
    if (!ring.pop(entry, numbers)) continue;
    const double number = static_cast<double>(entry.number);
    const double expected[] = {number, -number};
    for (std::size_t i = 0; i < entry.number % 3; ++i) ASSERT_EQ(numbers[i], expected[i]);
    ASSERT_GT(entry.number, last);
    for (const std::uint64_t copy : entry.copies) ASSERT_EQ(copy, entry.number);
    last = entry.number;
    ++seen;
  }
  producer.join();
  EXPECT_EQ(seen + ring.dropped(), kEntries);
}

}  // namespace
}  // namespace variator_sim
