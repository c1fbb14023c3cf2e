// The cost limit of loading any scene: 5 s and 500 MB. (The margin is for slower machines and
// sanitizers: the worst of these takes a tenth.)
#include <sys/resource.h>

#include <ctime>

#include "support/scenes.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

std::string repeat(int count, const std::function<std::string(int)>& piece,
                   const std::string& between) {
  std::string text;
  for (int i = 0; i < count; ++i) text += (i == 0 ? "" : between) + piece(i);
  return text;
}
std::string sum(int count, const std::function<std::string(int)>& piece) {
  return repeat(count, piece, "+");
}
/// `open` and `close` around `inner`, `depth` times.
std::string nest(int depth, const std::string& open, const std::string& inner,
                 const std::string& close) {
  std::string text;
  for (int i = 0; i < depth; ++i) text += open;
  text += inner;
  for (int i = 0; i < depth; ++i) text += close;
  return text;
}
std::string number(int i) {
  return std::to_string(i);
}
std::string ofTorque(const std::string& formula) {
  return test::sceneText("a 1, b 2", {"m on a: " + formula});
}
std::string ofElements(int count, const std::function<std::string(int)>& behind_name) {
  std::vector<std::string> elements;
  for (int i = 0; i < count; ++i) elements.push_back("m" + number(i) + behind_name(i));
  return test::sceneText("a 1", elements);
}
std::string ofHarmonics(int shafts, int count, const std::function<int(int)>& order) {
  const auto name = [](int i) { return "s" + number(i); };
  return "shafts: [" + repeat(shafts, name, ", ") + "]\n" +
         repeat(
             shafts,
             [&](int i) {
               return name(i) + ": {inertia: {mean: 1e6, harmonics: [" +
                      repeat(
                          count,
                          [&](int n) { return "{order: " + number(order(n)) + ", cos: 0.001}"; },
                          ", ") +
                      "]}}\n";
             },
             "");
}

struct Cost {
  double seconds;
  std::string error;
};

/// Processor time of loading, s, up to the beginning of a run.
Cost load(const std::string& scene) {
  Cost cost{};
  const std::clock_t begin = std::clock();
  try {
    Simulation simulation(test::sceneFromText(scene));
    simulation.sample();
  } catch (const Error& error) {
    cost.error = error.what();
  }
  cost.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return cost;
}

// (AddressSanitizer keeps what was freed, and takes its time.)
#ifdef __SANITIZE_ADDRESS__
constexpr int kSlack = 4;
#else
constexpr int kSlack = 1;
#endif
constexpr double kLongest = kSlack * 5.0;           // s
constexpr long kMostMemory = kSlack * 500L * 1024;  // kB

long peakMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST(LoadCost, FormulasOfManyTerms) {
  const Cost cost = load(ofTorque(repeat(
      24000, [](int i) { return "(w1+" + number(i) + "e-9)"; }, "*")));
  EXPECT_EQ(cost.error, "");
  EXPECT_LT(cost.seconds, kLongest);
  EXPECT_LT(peakMemory(), kMostMemory);
}

// Each edge would be searched for in each part of each step.
TEST(LoadCost, FormulasOfManyEdges) {
  const auto absolutes = [](int count) {
    return ofTorque(sum(count, [](int i) { return "abs(w1-" + number(i) + ")"; }));
  };
  EXPECT_EQ(load(absolutes(500)).error, "");
  const std::pair<std::string, int> scenes[] = {
      {absolutes(501), 501},
      {absolutes(24000), 24000},
      {ofTorque(sum(9000, [](int i) { return "clamp(w1+" + number(i) + ",w2,phi1)"; })), 18000},
      {ofTorque(sum(9000, [](int i) { return "if(w1<w2+" + number(i) + ",1,2)"; })), 9000},
  };
  for (const auto& [scene, edges] : scenes) {
    const Cost cost = load(scene);
    EXPECT_NE(cost.error.find(" make " + number(edges) + " edges at which"), std::string::npos)
        << cost.error;
    EXPECT_NE(cost.error.find("allowed: 500 at most"), std::string::npos) << cost.error;
    EXPECT_LT(cost.seconds, kLongest);
  }
  EXPECT_LT(peakMemory(), kMostMemory);
}

TEST(LoadCost, FormulasWithinEachOther) {
  const auto nests = [](int count, int depth, const std::string& open, const std::string& close) {
    return ofTorque(sum(count, [&](int i) { return nest(depth, open, "w1+" + number(i), close); }));
  };
  const Cost cost = load(nests(20, 190, "sin(w2-", ")"));
  EXPECT_EQ(cost.error, "");
  EXPECT_LT(cost.seconds, kLongest);
  const Cost guards = load(nests(240, 190, "abs(w2-", ")"));
  EXPECT_NE(guards.error.find("edges at which"), std::string::npos) << guards.error;
  EXPECT_LT(guards.seconds, kLongest);
  EXPECT_LT(peakMemory(), kMostMemory);
}

TEST(LoadCost, FormulasThatAreTooLong) {
  const std::string scenes[] = {
      ofTorque(sum(60000, [](int i) { return "w1*" + number(i); })),
      ofTorque(sum(500000, [](int) { return "(w1)"; })),
      ofElements(3000,
                 [](int) { return " on a: " + sum(20, [](int n) { return "w1^" + number(n); }); }),
  };
  for (const std::string& scene : scenes) {
    const Cost cost = load(scene);
    EXPECT_NE(cost.error.find("have more than 50000 numbers and names in all"), std::string::npos)
        << cost.error;
    EXPECT_LT(cost.seconds, kLongest);
  }
  EXPECT_LT(peakMemory(), kMostMemory);
}

TEST(LoadCost, ManyElements) {
  const Cost cost = load(ofElements(8000, [](int i) {
    return " = Friction, shaft: a, coulomb: " + number(i + 1) + ", regularization_speed: 0.01";
  }));
  EXPECT_EQ(cost.error, "");
  EXPECT_LT(cost.seconds, kLongest);
}

TEST(LoadCost, Harmonics) {
  const std::string scenes[] = {ofHarmonics(1, 1000, [](int) { return 1000; }),
                                ofHarmonics(1, 19000, [](int) { return 1000; }),
                                ofHarmonics(8, 1000, [](int n) { return n + 1; })};
  for (const std::string& scene : scenes) {
    const Cost cost = load(scene);
    EXPECT_EQ(cost.error, "");
    EXPECT_LT(cost.seconds, kLongest);
  }
}

// Two harmonics of one order are one.
TEST(LoadCost, HarmonicsOfOneOrderAreAdded) {
  const Scene scene = test::sceneFromText(
      "shafts: [a]\n"
      "a: {inertia: {mean: 2, harmonics: [{order: 3, cos: 0.5}, {order: 1, sin: 0.25},"
      " {order: 3, cos: 0.25, sin: 0.5}]}}\n");
  ASSERT_EQ(scene.inertia_harmonics[0].size(), 2U);
  EXPECT_EQ(scene.inertia_harmonics[0][0].order, 3);
  EXPECT_EQ(scene.inertia_harmonics[0][0].cosine, 0.75);
  EXPECT_EQ(scene.inertia_harmonics[0][0].sine, 0.5);
  EXPECT_EQ(scene.inertia_harmonics[0][1].sine, 0.25);
}

}  // namespace
}  // namespace variator_sim
