// The accelerations of least reaction where psi is nonlinear or linear in pieces: at the start they
// are the least of all minima. (test/known_motions.yaml has refused starts, and jumps over kinks.)

#include <random>

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::plainly;

/// Two shafts with constant torques and one constraint of order 2.
struct TwoShafts {
  double inertia[2] = {1.0, 2.0};  // kg m^2
  double torque[2] = {0.0, 0.0};   // N m
  std::string psi;
  std::string rest;  // further keys

  std::string text() const {
    return test::sceneText(
        "a " + plainly(inertia[0]) + ", b " + plainly(inertia[1]),
        {"p on a: " + plainly(torque[0]), "q on b: " + plainly(torque[1]), "v: " + psi}, rest);
  }
  /// 1/2 R^T J^-1 R at accelerations (e1, e2), W.
  double reaction(double e1, double e2) const {
    const double R1 = inertia[0] * e1 - torque[0];
    const double R2 = inertia[1] * e2 - torque[1];
    return 0.5 * (R1 * R1 / inertia[0] + R2 * R2 / inertia[1]);
  }
};

std::string messageOf(const std::string& text) {
  try {
    Simulation simulation(test::sceneFromText(text));
  } catch (const SceneError& error) {
    EXPECT_EQ(error.keyPath(), "initial/acceleration");
    return error.what();
  }
  return "accepted";
}

/// The least of `cost` on [low, high] by brute force.
double findLeast(const std::function<double(double)>& cost, double low, double high) {
  double least = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 8; ++round) {
    const int parts = round == 0 ? 40000 : 400;
    double at = low;
    const double part = (high - low) / parts;
    for (int n = 0; n <= parts; ++n) {
      const double value = cost(low + n * part);
      if (!(value < least)) continue;
      least = value;
      at = low + n * part;
    }
    low = at - 2.0 * part;
    high = at + 2.0 * part;
  }
  return least;
}

TEST(LeastReaction, IsTheLeastOfAllMinima) {
  std::mt19937 random(7);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  int found = 0;
  constexpr int kScenes = 240;
  for (int n = 0; n < kScenes; ++n) {
    // psi = slope (e2 - ratio e1) + offset + part(e1)
    TwoShafts scene;
    for (int i = 0; i < 2; ++i) {
      scene.inertia[i] = std::pow(10.0, uniform(-1.0, 1.0));
      scene.torque[i] = uniform(-5.0, 5.0);
    }
    const double slope = std::pow(10.0, uniform(-1.0, 0.5));
    const double ratio = uniform(-1.5, 1.5);
    const double offset = uniform(-5.0, 5.0);
    const double size = std::pow(10.0, uniform(-1.5, 1.0));
    const double place = uniform(-4.0, 4.0);
    struct Part {
      std::string text;
      std::function<double(double)> value;
    };
    const Part parts[] = {
        {"sin(e1)", [](double e) { return std::sin(e); }},
        {"sin(p*e1)", [&](double e) { return std::sin(place * e); }},
        {"0.1*e1^3", [](double e) { return 0.1 * e * e * e; }},
        {"abs(e1)", [](double e) { return std::abs(e); }},
        {"abs(e1-p)", [&](double e) { return std::abs(e - place); }},
        {"max(e1,p)-2*min(e1,0)",
         [&](double e) { return std::max(e, place) - 2.0 * std::min(e, 0.0); }},
        {"exp(0.3*e1)", [](double e) { return std::exp(0.3 * e); }},
        {"(e1+p)*(e2-ratio*e1)/size",
         [&](double) { return std::numeric_limits<double>::quiet_NaN(); }},
    };
    const Part& part = parts[n % 8];
    std::string parameters = "slope: " + plainly(slope) + ", ratio: " + plainly(ratio) +
                             ", offset: " + plainly(offset) + ", size: " + plainly(size);
    const bool reads_place = n % 8 == 1 || n % 8 == 4 || n % 8 == 5 || n % 8 == 7;
    if (reads_place) parameters += ", p: " + plainly(place);
    std::string text = scene.text();
    const std::string empty = "expression: \"\"";
    text.replace(text.find(empty), empty.size(),
                 "expression: \"slope*(e2-ratio*e1)+offset+size*(" + part.text +
                     ")\", parameters: {" + parameters + "}");
    const auto cost = [&](double e1) {
      // The product is linear in e2 as well.
      const double e2 = n % 8 == 7 ? ratio * e1 - offset / (slope + e1 + place)
                                   : ratio * e1 - (offset + size * part.value(e1)) / slope;
      return scene.reaction(e1, e2);
    };
    const double free = scene.torque[0] / scene.inertia[0];
    const double reach = std::sqrt(2.0 * cost(free) / scene.inertia[0]);
    const double least = findLeast(cost, free - reach, free + reach);
    Simulation simulation(test::sceneFromText(text));
    const Sample& s = simulation.sample();
    EXPECT_NEAR(s.residual[0], 0.0, 1e-9 * (1.0 + std::abs(s.acceleration[1]))) << text;
    const double reaction = scene.reaction(s.acceleration[0], s.acceleration[1]);
    EXPECT_LE(reaction, least * (1.0 + 1e-8) + 1e-12) << text;
    if (reaction <= least * (1.0 + 1e-8) + 1e-12) ++found;
  }
  EXPECT_EQ(found, kScenes);
}

TEST(LeastReaction, IsFoundInAWellThatIsNarrowBesideTheFirstGuess) {
  // psi = slope e2 + e1^3 - 3 e1: at the free e1 = 1 lies e2 = 2 / slope, far from the least one.
  for (const double slope : {0.5, 0.05, 0.005}) {
    TwoShafts scene;
    scene.torque[0] = 1.0;
    scene.psi = formatNumber(slope) + "*e2+e1^3-3*e1";
    const auto cost = [&](double e1) {
      return scene.reaction(e1, (3.0 * e1 - e1 * e1 * e1) / slope);
    };
    Simulation simulation(test::sceneFromText(scene.text()));
    const Sample& s = simulation.sample();
    const double reaction = scene.reaction(s.acceleration[0], s.acceleration[1]);
    EXPECT_LE(reaction, findLeast(cost, -3.0, 3.0) * (1.0 + 1e-8)) << scene.psi;
  }
}

TEST(LeastReaction, IsTheLeastOverTwoNonlinearAccelerations) {
  // psi = e3 - e1 - e2 + sin(2 e1) - 3 cos(e2) + offset, J = 1: many minima over (e1, e2).
  for (double offset : {-9.0, -4.0, 2.0, 5.0, 11.0}) {
    const auto reaction = [offset](double e1, double e2) {
      const double e3 = e1 + e2 - std::sin(2.0 * e1) + 3.0 * std::cos(e2) - offset;
      return 0.5 * (e1 * e1 + e2 * e2 + e3 * e3);
    };
    double least = std::numeric_limits<double>::infinity();
    const double reach = std::sqrt(2.0 * reaction(0.0, 0.0));
    for (int n = -600; n <= 600; ++n) {
      for (int m = -600; m <= 600; ++m) {
        least = std::min(least, reaction(reach * n / 600.0, reach * m / 600.0));
      }
    }
    Simulation simulation(
        test::sceneFromText("a 1, b 1, c 1", {"v = ExpressionConstraint, order: 2, expression: "
                                              "'e3-e1-e2+sin(2*e1)-3*cos(e2)+d', parameters: {d: " +
                                              std::to_string(offset) + "}"}));
    const Sample& s = simulation.sample();
    EXPECT_NEAR(s.residual[0], 0.0, 1e-12);
    EXPECT_LE(reaction(s.acceleration[0], s.acceleration[1]), least) << offset;
  }
}

// A sine that is multiplied by zero changes the form of psi and none of its values.
TEST(LeastReaction, OfACubicIsThatOfTheSameFunctionOfAnyForm) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int round = 0; round < 60; ++round) {
    TwoShafts machine;
    machine.torque[0] = 5.0 * uniform(random);
    machine.torque[1] = 5.0 * uniform(random);
    const auto term = [&](const char* monomial) {
      return "+(" + std::to_string(uniform(random)) + ")*" + monomial;
    };
    machine.psi = std::to_string(3.0 * uniform(random)) + term("e1") + term("e2") + term("e1^2") +
                  term("e1*e2") + term("e2^3") + term("e1^2*e2") + term("e1^3");
    Simulation cubic(test::sceneFromText(machine.text()));
    const std::string psi = machine.psi;
    machine.psi += "+0*sin(e1*e2)";
    Simulation other(test::sceneFromText(machine.text()));
    for (int i = 0; i < 2; ++i) {
      const double expected = other.sample().acceleration[i];
      EXPECT_NEAR(cubic.sample().acceleration[i], expected, 1e-9 * (1.0 + std::abs(expected)))
          << psi;
    }
  }
}

/// c_0 + c_1 x + c_2 y + c_3 x^2 + c_4 x y + c_5 y^2 + c_6 x^3 + c_7 x^2 y + c_8 x y^2 + c_9 y^3
struct PlaneCubic {
  double c[10];
  double at(double x, double y) const {
    return c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y +
           c[6] * x * x * x + c[7] * x * x * y + c[8] * x * y * y + c[9] * y * y * y;
  }
  std::string text() const {
    const char* const powers[] = {"1",    "e1",   "e2",      "e1^2",    "e1*e2",
                                  "e2^2", "e1^3", "e1^2*e2", "e1*e2^2", "e2^3"};
    std::string text = "0";
    for (int n = 0; n < 10; ++n) text += "+(" + plainly(c[n]) + ")*" + powers[n];
    return text;
  }
};

// The search finds the minimum for cubics of two accelerations: no grid point has less reaction, if
// a third one is free (J = 1), obeys a row of its own, or does not exist.
TEST(LeastReaction, OfTwoAccelerationsInACubicNoPlaceIsLeftOut) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto someCubic = [&] {
    PlaneCubic cubic{};
    for (double& c : cubic.c) c = std::pow(10.0, 1.5 * uniform(random)) * uniform(random);
    return cubic;
  };
  constexpr int kCells = 400;
  int accepted = 0;
  for (int round = 0; round < 90; ++round) {
    const PlaneCubic first = someCubic();
    const PlaneCubic second = someCubic();
    const double torque[] = {5.0 * uniform(random), 5.0 * uniform(random)};
    enum {
      kAlone,
      kGoesAlong,
      kOwnRow
    } const form = std::array{kAlone, kGoesAlong, kOwnRow}[round % 3];
    std::vector<std::string> elements = {
        "p on a: " + plainly(torque[0]), "q on b: " + plainly(torque[1]),
        "v: " + std::string(form == kGoesAlong ? "e3+" : "") + first.text()};
    if (form == kOwnRow) elements.push_back("w: e3+" + second.text());
    const std::string text = test::sceneText("a 1, b 1, c 1", elements);
    // e3 of the third shaft is 0 where nothing moves it.
    const auto reaction = [&](double e1, double e2) {
      const double e3 = form == kAlone       ? 0.0
                        : form == kGoesAlong ? -first.at(e1, e2)
                                             : -second.at(e1, e2);
      return 0.5 * (std::pow(e1 - torque[0], 2) + std::pow(e2 - torque[1], 2) + e3 * e3);
    };
    std::unique_ptr<Simulation> simulation;
    try {
      simulation = std::make_unique<Simulation>(test::sceneFromText(text));
    } catch (const SceneError& error) {
      ADD_FAILURE() << error.what() << "\n" << text;
      continue;
    }
    ++accepted;
    const Sample& s = simulation->sample();
    const double found = reaction(s.acceleration[0], s.acceleration[1]);
    const double reach = std::sqrt(2.0 * found);
    double least = std::numeric_limits<double>::infinity();
    for (int n = -kCells; n <= kCells; ++n) {
      const double e1 = torque[0] + reach * n / kCells;
      double before = 0.0;
      for (int m = -kCells; m <= kCells; ++m) {
        double e2 = torque[1] + reach * m / kCells;
        if (form == kGoesAlong) {
          least = std::min(least, reaction(e1, e2));
          continue;
        }
        const double value = first.at(e1, e2);
        if (m > -kCells && (value < 0.0) != (before < 0.0)) {
          double low = e2 - reach / kCells;
          for (int halving = 0; halving < 50; ++halving) {
            const double middle = 0.5 * (low + e2);
            ((first.at(e1, middle) < 0.0) == (before < 0.0) ? low : e2) = middle;
          }
          least = std::min(least, reaction(e1, e2));
        }
        before = value;
      }
    }
    EXPECT_LE(found, least * (1.0 + 1e-9)) << text;
    for (int m = 0; m < simulation->scene().constraintCount(); ++m) {
      EXPECT_NEAR(s.residual[m], 0.0, 1e-8 * (1.0 + reach * reach * reach)) << text;
    }
  }
  EXPECT_EQ(accepted, 90);
}

// psi knows accelerations of 1e-8 rad/s^2 beside velocities of 1 rad/s to some digits only: a
// correction of rounding's size is no reason to refuse the start.
TEST(LeastReaction, IsFoundWhereItIsSmallBesideTheRoundingOfPsi) {
  TwoShafts tiny;
  for (const char* const bump : {"893*tanh(2/(1+((t-0.86649)/0.0011084)^4))", "1e-12", "1e-17"}) {
    tiny.psi = std::string("0.3*(e2-0.5*e1)+w2-0.5*w1-") + bump;
    tiny.rest = "initial: {velocity: [0.80161, 0.400805], project: true}\n";
    EXPECT_EQ(messageOf(tiny.text()), "accepted") << bump;
    // J^-1 C^T = (-0.15, 0.15): without torques that is where the least reaction leads.
    Simulation simulation(test::sceneFromText(tiny.text()));
    const Sample& sample = simulation.sample();
    EXPECT_NEAR(sample.acceleration[0], -sample.acceleration[1], 1e-15) << bump;
  }
}

}  // namespace
}  // namespace variator_sim
