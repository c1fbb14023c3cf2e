// Hazard 11: scenes made at random, run by several methods, must agree within what was asked for or
// stop by name. The folder `kept` has the scenes that once failed.

#include <atomic>
#include <cstdlib>
#include <thread>

#include "stress/random_scene.h"
#include "support/scenes.h"

namespace variator_sim::test {
namespace {

TEST(RandomScene, IsTheSameForTheSameSeed) {
  const RandomScene scene = makeRandomScene(7);
  EXPECT_EQ(scene.yaml(), makeRandomScene(7).yaml());
  EXPECT_EQ(scene.csv(), makeRandomScene(7).csv());
  EXPECT_NE(scene.yaml(), makeRandomScene(8).yaml());
}

// The generator covers every kind of scene within the first few hundred.
TEST(RandomScene, CoversEveryKind) {
  std::map<std::string, int> found;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const RandomScene scene = makeRandomScene(seed);
    ++found["shafts " + std::to_string(scene.shafts.size())];
    ++found["constraints " + std::to_string(scene.constraints.size())];
    ++found[scene.principle];
    const std::string text = scene.yaml();
    for (const char* part :
         {"order: 1,", "order: 2,", "order: 3,", "zero_order", "first_order_lag", "rate_limit",
          "first_order_hold", "second_order_lag", "ElasticCoupling", "SlipRatio", "harmonics",
          "inertia_coupling", "abs("}) {
      if (text.find(part) != std::string::npos) ++found[part];
    }
    if (!scene.commands.empty()) ++found["commands"];
  }
  // shafts 1 to 8, constraints 0 to 4, two principles, the parts above, commands
  EXPECT_EQ(found.size(), 8u + 5u + 2u + 13u + 1u);
  for (const auto& [kind, count] : found) EXPECT_GE(count, 3) << kind;
}

// The measure itself: an error put in on purpose is found, and shrunk to what matters.
TEST(RandomScene, ALooserToleranceThanSaidIsFound) {
  const Scene scene = sceneFromText(makeRandomScene(5).yaml());
  const std::vector<double> times = evenly(2.0, 16);
  Scene tight = withTolerance(scene, 1e-12);
  tight.solver.stepper = StepperKind::kFehlberg78;
  const test::Run reference = play(tight, times);
  const test::Run loose = play(withTolerance(scene, 1e-4), times);
  EXPECT_GT(calcDifference(loose, reference, scene.shaftCount(), 1e-9, 1e-9, Columns::kAll),
            kAllowed);
  EXPECT_LT(calcDifference(loose, reference, scene.shaftCount(), 1e-4, 1e-4, Columns::kAll),
            kAllowed);
}

void note(Hazard& hazard, const Finding& finding, const std::string& label) {
  switch (finding.kind) {
    case Finding::Kind::kAgrees:
      hazard.judge(finding.error, label);
      break;
    case Finding::Kind::kStops:
    case Finding::Kind::kRefused:
      hazard.named(finding.name, label);
      break;
    case Finding::Kind::kWrong:
      hazard.judge(finding.error, label + ": " + finding.message, finding.allowed);
      break;
  }
}

TEST(RandomScenes, AgreeOrStopByName) {
  // Another first seed runs new scenes: VARIATOR_SIM_STRESS_SEED=100000.
  const char* given = std::getenv("VARIATOR_SIM_STRESS_SEED");
  const std::uint64_t first = given != nullptr ? std::strtoull(given, nullptr, 10) : 1;
  const int count = sizeOf(500, 10000);
  std::vector<Finding> findings(static_cast<std::size_t>(count));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int n = next++; n < count; n = next++) {
      findings[static_cast<std::size_t>(n)] =
          examine(makeRandomScene(first + static_cast<std::uint64_t>(n)));
      if (isLongForm() && n % 500 == 499) {
        std::printf("%d of %d random scenes\n", n + 1, count);
        std::fflush(stdout);
      }
    }
  };
  std::vector<std::thread> threads;
  for (unsigned n = 0; n < std::max(1u, std::thread::hardware_concurrency()); ++n) {
    threads.emplace_back(work);
  }
  for (std::thread& thread : threads) thread.join();

  Hazard hazard("random scenes", "1 to 8 shafts, 0 to 4 constraints, all orders, both principles",
                "seeds " + std::to_string(first) + " .. " +
                    std::to_string(first + static_cast<std::uint64_t>(count) - 1));
  int shrunk = 0;
  for (int n = 0; n < count; ++n) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(n);
    const Finding& finding = findings[static_cast<std::size_t>(n)];
    note(hazard, finding, "seed " + std::to_string(seed));
    if (finding.kind != Finding::Kind::kWrong || ++shrunk > 3) continue;
    const RandomScene smallest = shrink(makeRandomScene(seed));
    ADD_FAILURE() << "seed " << seed << " shrunk, " << smallest.duration << " s:\n"
                  << smallest.yaml() << smallest.csv();
  }
  // A generator whose scenes nearly all stop would show nothing.
  EXPECT_LT(hazard.stops(), count / 5);
}

// Scenes that were silently wrong once: kept/<name>.yaml, with a comment that says what was.
TEST(KeptScenes, AreMended) {
  Hazard hazard("random scenes", "scenes that were wrong once", "test/stress/kept");
  for (const char* name : {"dense_output_of_a_stability_limited_step", "kink_in_the_last_sixth",
                           "friction_layer", "kink_beyond_a_rejected_step"}) {
    const Scene scene =
        sceneFromFile(std::string(VARIATOR_SIM_TEST_DIR) + "/stress/kept/" + name + ".yaml");
    note(hazard, examine(scene, {}, 2.0), name);
  }
  EXPECT_EQ(hazard.stops(), 0);
}

}  // namespace
}  // namespace variator_sim::test
