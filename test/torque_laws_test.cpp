// The torque laws: values against closed forms, rates against differences of those forms and of the
// torque itself along a motion, the derivatives of the rates by the state, what happens at rest, at
// the ends of tables and far away, every fault of their keys, and that the documentation's examples
// are read.

#include <set>

#include "support/count_allocations.h"
#include "support/documents.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/table.h"

namespace variator_sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// ------------------------------------------------------------------------------------------ motion

/// The number type of a closed form and its derivative.
using Wide = long double;
using Pair = std::array<Wide, 2>;

/// Everything that a torque can depend on, of two shafts, and its rates.
struct Moment {
  Wide t;
  Pair phi;
  Pair w;
  Pair e;
  Pair u;
  Pair u_rate;
};

/// w_i = mean_i + swing_i sin(f_i t + p_i), u_i = 0.5 + 0.4 sin(g_i t + q_i), with nothing special
/// about the frequencies.
struct Motion {
  Pair mean;
  Pair swing;

  Moment at(Wide t) const {
    static const Pair f{1.31L, 0.83L};
    static const Pair p{0.4L, 1.9L};
    static const Pair g{0.77L, 1.13L};
    Moment m{};
    m.t = t;
    for (std::size_t i = 0; i < 2; ++i) {
      m.phi[i] = 0.7L + mean[i] * t - swing[i] / f[i] * std::cos(f[i] * t + p[i]);
      m.w[i] = mean[i] + swing[i] * std::sin(f[i] * t + p[i]);
      m.e[i] = swing[i] * f[i] * std::cos(f[i] * t + p[i]);
      m.u[i] = 0.5L + 0.4L * std::sin(g[i] * t + p[i]);
      m.u_rate[i] = 0.4L * g[i] * std::cos(g[i] * t + p[i]);
    }
    return m;
  }
};

/// A moment as components see it.
struct State {
  explicit State(const Moment& m) : time(static_cast<double>(m.t)) {
    for (std::size_t i = 0; i < 2; ++i) {
      angle[i] = static_cast<double>(m.phi[i]);
      velocity[i] = static_cast<double>(m.w[i]);
      acceleration[i] = static_cast<double>(m.e[i]);
      input[i] = static_cast<double>(m.u[i]);
      input_rate[i] = static_cast<double>(m.u_rate[i]);
    }
  }
  StateView view() const { return {time, angle, velocity, acceleration, input, input_rate}; }
  double time;
  double angle[2];
  double velocity[2];
  double acceleration[2];
  double input[2];
  double input_rate[2];
};

/// d f/dt by differences of order eight.
template <typename Number, typename Function>
Number difference(const Function& f, Number t, Number h) {
  const Number c[] = {Number(4) / 5, -Number(1) / 5, Number(4) / 105, -Number(1) / 280};
  Number sum = 0;
  for (int k = 1; k <= 4; ++k) sum += c[k - 1] * (f(t + k * h) - f(t - k * h));
  return sum / h;
}

// -------------------------------------------------------------------------------------------- laws

std::string sceneOf(const std::string& element) {
  return "shafts: [drive, load]\ndrive: {inertia: 0.8}\nload: {inertia: 2}\ntorques: [it]\nit: {" +
         element + "}\n";
}

TorquePtr torqueOf(const std::string& element) {
  return test::sceneFromText(sceneOf("type: variator_sim/" + element)).torques.at(0);
}

/// Both calls add to what is there.
std::array<double, 2> torqueAt(const TorquePtr& torque, const StateView& state) {
  std::array<double, 2> Q{};
  torque->addTorque(state, Q.data());
  std::array<double, 2> again = Q;
  torque->addTorque(state, again.data());
  for (std::size_t i = 0; i < 2; ++i) EXPECT_TRUE(again[i] == 2.0 * Q[i] || std::isnan(Q[i]));
  return Q;
}

std::array<double, 2> rateAt(const TorquePtr& torque, const StateView& state) {
  std::array<double, 2> rate{};
  torque->addTorqueRate(state, rate.data());
  std::array<double, 2> again = rate;
  torque->addTorqueRate(state, again.data());
  for (std::size_t i = 0; i < 2; ++i) EXPECT_TRUE(again[i] == 2.0 * rate[i] || std::isnan(rate[i]));
  return rate;
}

using ClosedForm = std::function<Pair(const Moment&)>;

/// Along `motion` the element gives the torques of `closed_form`, and its rates are their
/// derivatives.
void expectLaw(const std::string& element, const Motion& motion, const ClosedForm& closed_form) {
  SCOPED_TRACE(element);
  const TorquePtr torque = torqueOf(element);
  const auto rates = [&](Wide t, std::size_t i) {
    return difference<Wide>([&](Wide s) { return closed_form(motion.at(s))[i]; }, t, 1e-3L);
  };
  std::vector<Wide> times;
  for (int n = 0; n < 60; ++n) times.push_back(0.05L + 0.1237L * n);
  Wide torque_scale = 0;
  Wide rate_scale = 0;
  for (const Wide t : times) {
    for (std::size_t i = 0; i < 2; ++i) {
      torque_scale = std::max(torque_scale, std::abs(closed_form(motion.at(t))[i]));
      rate_scale = std::max(rate_scale, std::abs(rates(t, i)));
    }
  }
  ASSERT_GT(torque_scale, 0.1L);
  ASSERT_GT(rate_scale, 0.1L);
  for (const Wide t : times) {
    SCOPED_TRACE("t = " + std::to_string(t));
    const Moment m = motion.at(t);
    const State state(m);
    const std::array<double, 2> Q = torqueAt(torque, state.view());
    const std::array<double, 2> rate = rateAt(torque, state.view());
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_NEAR(Q[i], static_cast<double>(closed_form(m)[i]),
                  static_cast<double>(2e-14L * torque_scale));
      EXPECT_NEAR(rate[i], static_cast<double>(rates(t, i)),
                  static_cast<double>(1e-12L * rate_scale));
      const double along_torque = difference<double>(
          [&](double s) { return torqueAt(torque, State(motion.at(s)).view())[i]; },
          static_cast<double>(t), 1e-3);
      EXPECT_NEAR(rate[i], along_torque, 1e-9 * static_cast<double>(rate_scale + torque_scale));
    }
    if (::testing::Test::HasFailure()) return;
  }
}

/// The rate is the derivative of the torque itself, where there is no closed form.
void expectRate(const std::string& element, const Motion& motion, double tolerance) {
  SCOPED_TRACE(element);
  const TorquePtr torque = torqueOf(element);
  for (int n = 0; n < 200; ++n) {
    const double t = 0.03 + 0.0437 * n;
    const auto along = [&](double s) { return torqueAt(torque, State(motion.at(s)).view())[0]; };
    const double expected = (along(t + 1e-6) - along(t - 1e-6)) / 2e-6;
    EXPECT_NEAR(rateAt(torque, State(motion.at(t)).view())[0], expected, tolerance) << "t = " << t;
  }
}

Moment mirrored(Moment m) {
  for (Pair* values : {&m.phi, &m.w, &m.e}) {
    for (Wide& value : *values) value = -value;
  }
  return m;
}

/// Q(-omega) = -Q(omega), nothing at rest, and neither torque nor rate jumps on the way through.
void expectOdd(const std::string& element) {
  SCOPED_TRACE(element);
  const TorquePtr torque = torqueOf(element);
  const Motion motion{{0.2L, -0.1L}, {1.5L, 0.9L}};
  for (int n = 0; n < 30; ++n) {
    const Moment m = motion.at(0.21L * n);
    const Moment back = mirrored(m);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(torqueAt(torque, State(back).view())[i], -torqueAt(torque, State(m).view())[i]);
      EXPECT_EQ(rateAt(torque, State(back).view())[i], -rateAt(torque, State(m).view())[i]);
    }
  }
  Moment rest = motion.at(1.0L);
  rest.e = {3.0L, -2.0L};
  const auto at = [&rest](Wide w) {
    rest.w = {w, w};
    return State(rest);
  };
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(torqueAt(torque, at(0).view())[i], 0.0);
    const double rate = rateAt(torque, at(0).view())[i];
    EXPECT_NEAR(rateAt(torque, at(1e-9L).view())[i], rate, 1e-5 * (1.0 + std::abs(rate)));
    EXPECT_NEAR(rateAt(torque, at(-1e-9L).view())[i], rate, 1e-5 * (1.0 + std::abs(rate)));
  }
}

const Motion kThroughRest{{0.3L, -0.2L}, {2.5L, 1.7L}};
const Motion kFast{{40.0L, 20.0L}, {25.0L, -9.0L}};

// -------------------------------------------------------------------------------- elastic coupling

TEST(ElasticCoupling, IsASpringAndADamper) {
  for (const Wide ratio : {1.0L, 2.5L, -0.4L}) {
    expectLaw("ElasticCoupling, shafts: [drive, load], stiffness: 400, damping: 3, ratio: " +
                  std::to_string(ratio),
              kThroughRest, [ratio](const Moment& m) -> Pair {
                const Wide T = 400 * (m.phi[0] - ratio * m.phi[1]) + 3 * (m.w[0] - ratio * m.w[1]);
                return {-T, ratio * T};
              });
  }
}

TEST(ElasticCoupling, HasDefaultsAndKeepsTheOrderOfItsShafts) {
  expectLaw("ElasticCoupling, shafts: [load, drive], stiffness: 40", kThroughRest,
            [](const Moment& m) -> Pair {
              const Wide T = 40 * (m.phi[1] - m.phi[0]);
              return {T, -T};
            });
}

TEST(ElasticCoupling, TakesWhatItsDamperTakesAndKeepsTheRest) {
  const TorquePtr torque =
      torqueOf("ElasticCoupling, shafts: [drive, load], stiffness: 400, damping: 3, ratio: 1.7");
  for (int n = 0; n < 30; ++n) {
    const Moment m = kThroughRest.at(0.31L * n);
    const std::array<double, 2> Q = torqueAt(torque, State(m).view());
    const Wide slip = m.w[0] - 1.7L * m.w[1];
    const Wide stored_rate = 400 * (m.phi[0] - 1.7L * m.phi[1]) * slip;
    const Wide power = Q[0] * m.w[0] + Q[1] * m.w[1];
    EXPECT_NEAR(static_cast<double>(power + stored_rate), static_cast<double>(-3 * slip * slip),
                1e-11);
  }
}

// ------------------------------------------------------------------------------------- motor curve

Wide kloss(Wide w) {
  const Wide s = (50 - w) / 50;
  return 2 * 30.0L / (s / 0.2L + 0.2L / s);
}
const std::string kKloss =
    "characteristic: kloss, breakdown_torque: 30, synchronous_speed: 50, critical_slip: 0.2";

TEST(MotorCurve, FollowsKloss) {
  // Through standstill, breakdown, synchronous speed and braking.
  expectLaw("MotorCurve, shaft: drive, " + kKloss, kFast, [](const Moment& m) -> Pair {
    return {kloss(m.w[0]), 0};
  });
  expectLaw("MotorCurve, shaft: load, direction: -1, command: 0.25, " + kKloss,
            {{0, -30.0L}, {0, 40.0L}}, [](const Moment& m) -> Pair {
              return {0, -0.25L * kloss(-m.w[1])};
            });
  expectLaw("MotorCurve, shaft: drive, command: {topic: throttle}, " + kKloss, kFast,
            [](const Moment& m) -> Pair {
              return {m.u[0] * kloss(m.w[0]), 0};
            });
}

TEST(MotorCurve, OfKlossIsRegularAtSynchronousSpeed) {
  const TorquePtr torque = torqueOf("MotorCurve, shaft: drive, " + kKloss);
  Moment m = kFast.at(1.0L);
  const auto at = [&](Wide w) {
    m.w[0] = w;
    return torqueAt(torque, State(m).view())[0];
  };
  EXPECT_NEAR(at(50), 0.0, 1e-13);
  EXPECT_NEAR(at(40), 30.0, 1e-13);  // s = s_k
  EXPECT_NEAR(at(60), -30.0, 1e-13);
  EXPECT_NEAR(at(0), 2 * 30.0 / (5.0 + 0.2), 1e-13);
  m.w[0] = 50;
  m.e[0] = 7;
  // dM/dw = -2 M_k/(s_k w_s)
  EXPECT_NEAR(rateAt(torque, State(m).view())[0], -60.0 / 10.0 * 7.0, 1e-12);
}

/// A table of 520 - 0.02 (w - 220)^2: points on one side of its vertex, where the table is exact
/// between the second and the last but one.
const char* const kParabola =
    "{speed: [60, 80, 100, 120, 140, 160], torque: [8, 128, 232, 320, 392, 448]}";
Wide parabola(Wide w) {
  return 520 - 0.02L * (w - 220) * (w - 220);
}
const Motion kOnParabola{{110.0L, -110.0L}, {28.0L, 28.0L}};

TEST(MotorCurve, FollowsATable) {
  expectLaw(std::string("MotorCurve, shaft: drive, characteristic: table, table: ") + kParabola,
            kOnParabola, [](const Moment& m) -> Pair {
              return {parabola(m.w[0]), 0};
            });
  expectLaw(std::string("MotorCurve, shaft: load, direction: -1, characteristic: table, command: "
                        "{topic: throttle, hold: rate_limit, rate: 2, initial: 1}, table: ") +
                kParabola,
            kOnParabola, [](const Moment& m) -> Pair {
              return {0, -m.u[0] * parabola(-m.w[1])};
            });
  // Over every point and beyond both ends.
  const std::string uneven =
      "MotorCurve, shaft: drive, characteristic: table, command: {topic: throttle}, "
      "table: {speed: [20, 25, 40, 48, 50], torque: [20, 22, 30, 18, 0], beyond: ";
  for (const char* beyond : {"constant", "linear"}) {
    expectRate(uneven + beyond + "}", {{38.0L, 0}, {30.0L, 0}}, 1e-6);
  }
}

TEST(MotorCurve, GoesOnBeyondItsTable) {
  const auto at = [](const std::string& beyond, Wide w) {
    Moment m = kFast.at(1.0L);
    m.w[0] = w;
    return torqueAt(torqueOf("MotorCurve, shaft: drive, characteristic: table, table: {speed: "
                             "[10, 20, 30], torque: [50, 40, 0]" +
                             beyond + "}"),
                    State(m).view())[0];
  };
  for (const char* beyond : {"", ", beyond: constant"}) {
    EXPECT_EQ(at(beyond, 0), 50.0);
    EXPECT_EQ(at(beyond, 20), 40.0);
    EXPECT_EQ(at(beyond, 1000), 0.0);
  }
  EXPECT_EQ(at(", beyond: linear", 0), 60.0);
  EXPECT_EQ(at(", beyond: linear", 40), -40.0);
}

TEST(MotorCurve, OfDirectCurrentIsALine) {
  const std::string line = "characteristic: dc, stall_torque: 12, no_load_speed: 250";
  expectLaw("MotorCurve, shaft: drive, " + line, kFast, [](const Moment& m) -> Pair {
    return {12 * (1 - m.w[0] / 250), 0};
  });
  expectLaw("MotorCurve, shaft: load, direction: -1, command: {topic: a}, " + line, kFast,
            [](const Moment& m) -> Pair {
              return {0, -m.u[0] * 12 * (1 + m.w[1] / 250)};
            });
}

TEST(MotorCurve, OfDirectCurrentTakesAVoltage) {
  const std::string circuit = "characteristic: dc, torque_constant: 0.12, resistance: 0.5";
  expectLaw("MotorCurve, shaft: drive, voltage: 24, " + circuit, kFast,
            [](const Moment& m) -> Pair {
              return {0.12L * (24 - 0.12L * m.w[0]) / 0.5L, 0};
            });
  expectLaw("MotorCurve, shaft: load, direction: -1, voltage: {topic: voltage}, " + circuit, kFast,
            [](const Moment& m) -> Pair {
              return {0, -0.12L * (m.u[0] + 0.12L * m.w[1]) / 0.5L};
            });
}

// ----------------------------------------------------------------------------------- Diesel engine

Wide step(Wide x) {
  if (x <= 0) return 0;
  return x >= 1 ? 1 : x * x * x * (10 - 15 * x + 6 * x * x);
}

TEST(DieselEngine, IsRackTimesFullLoadLessFriction) {
  const std::string full_load = std::string(", full_load: ") + kParabola;
  expectLaw("DieselEngine, shaft: drive, rack: 0.7" + full_load, kOnParabola,
            [](const Moment& m) -> Pair {
              return {0.7L * parabola(m.w[0]), 0};
            });
  expectLaw(
      "DieselEngine, shaft: drive, rack: {topic: rack, hold: first_order_lag, time_constant: "
      "0.1}, friction: {constant: 30, linear: 0.4, regularization_speed: 60}" +
          full_load,
      kOnParabola, [](const Moment& m) -> Pair {
        return {m.u[0] * parabola(m.w[0]) - 30 * std::tanh(m.w[0] / 60) - 0.4L * m.w[0], 0};
      });
}

TEST(DieselEngine, IsGovernedAtIdle) {
  // The governor's band from 95 to 125 rad/s, where the closed form is smooth.
  const auto form = [](const Moment& m, Wide u) -> Pair {
    const Wide g = 1 - step((m.w[0] - 110 + 40) / 80);
    return {(u + (1 - u) * g) * parabola(m.w[0]), 0};
  };
  const std::string engine = std::string("DieselEngine, shaft: drive, full_load: ") + kParabola +
                             ", idle_governor: {speed: 110, band: 40}, rack: ";
  expectLaw(engine + "{topic: rack}", kOnParabola,
            [&](const Moment& m) { return form(m, m.u[0]); });
  expectLaw(engine + "0", kOnParabola, [&](const Moment& m) { return form(m, 0); });
  // Below its band, in it and above it; over the table's ends.
  expectRate(std::string("DieselEngine, shaft: drive, full_load: ") + kParabola +
                 ", idle_governor: {speed: 110, band: 10}, rack: {topic: rack}",
             {{110.0L, 0}, {70.0L, 0}}, 2e-5);

  const TorquePtr torque = torqueOf(std::string("DieselEngine, shaft: drive, full_load: ") +
                                    kParabola + ", idle_governor: {speed: 100, band: 10}, rack: 0");
  Moment m = kFast.at(1.0L);
  for (const auto& [speed, expected] :
       std::vector<std::pair<Wide, double>>{{0, 8}, {80, 128}, {100, 116}, {120, 0}, {900, 0}}) {
    m.w[0] = speed;
    EXPECT_NEAR(torqueAt(torque, State(m).view())[0], expected, 1e-12) << speed;
  }
}

// --------------------------------------------------------------------------------------- propeller

TEST(Propeller, IsQuadratic) {
  // Positive and negative speeds; the exact law has a kink at 0, which no difference may straddle.
  for (const Wide sign : {1.0L, -1.0L}) {
    expectLaw("Propeller, shaft: load, coefficient: 0.02", {{0, sign * 30.0L}, {0, 20.0L}},
              [](const Moment& m) -> Pair {
                return {0, -0.02L * m.w[1] * std::abs(m.w[1])};
              });
    expectLaw("Propeller, shaft: drive, torque_coefficient: 0.035, diameter: 1.2",
              {{sign * 30.0L, 0}, {20.0L, 0}}, [](const Moment& m) -> Pair {
                const Wide n = m.w[0] / (2 * std::acos(-1.0L));
                return {-1025 * 0.035L * std::pow(1.2L, 5) * n * std::abs(n), 0};
              });
  }
  expectOdd("Propeller, shaft: load, coefficient: 0.02");
  expectOdd("Propeller, shaft: load, coefficient: 0.02, regularization_speed: 0.4");
}

TEST(Propeller, IsSmoothWhereAsked) {
  const auto magnitude = [](Wide w) { return w * w / std::sqrt(w * w + 0.49L); };
  expectLaw("Propeller, shaft: drive, coefficient: 2, regularization_speed: 0.7", kThroughRest,
            [&](const Moment& m) -> Pair {
              return {-2 * m.w[0] * magnitude(m.w[0]), 0};
            });
  for (const Wide V : {4.0L, -3.0L}) {
    expectLaw(
        "Propeller, shaft: drive, torque_coefficient: 0.035, diameter: 1.2, density: 1000, "
        "regularization_speed: 0.7, advance: {slope: 0.03, speed: " +
            std::to_string(V) + "}",
        kThroughRest, [&](const Moment& m) -> Pair {
          const Wide n = m.w[0] / (2 * std::acos(-1.0L));
          const Wide a = magnitude(m.w[0]) / (2 * std::acos(-1.0L));
          const Wide D4 = std::pow(1.2L, 4);
          return {-1000 * D4 * a * (0.035L * 1.2L * n - 0.03L * V), 0};
        });
  }
}

TEST(Propeller, HasTheTorqueCoefficientOfItsAdvance) {
  const TorquePtr torque = torqueOf(
      "Propeller, shaft: drive, torque_coefficient: 0.035, diameter: 1.2, regularization_speed: "
      "1e-6, advance: {slope: 0.03, speed: 4}");
  Moment m = kFast.at(1.0L);
  m.w[0] = 60;
  const double n = 60 / (2 * std::acos(-1.0));
  const double K_Q = 0.035 - 0.03 * 4 / (n * 1.2);
  EXPECT_NEAR(torqueAt(torque, State(m).view())[0], -1025 * K_Q * std::pow(1.2, 5) * n * n, 1e-9);
}

// ------------------------------------------------------------------------------ vehicle resistance

TEST(VehicleResistance, FollowsDavis) {
  const std::string train =
      "VehicleResistance, shaft: load, law: davis, wheel_radius: 0.5, constant: 90, linear: 25, "
      "quadratic: 2.8, regularization_speed: 0.3";
  for (const Wide ratio : {1.0L, 4.5L, -2.0L}) {
    expectLaw(train + ", ratio: " + std::to_string(ratio), kThroughRest,
              [ratio](const Moment& m) -> Pair {
                const Wide v = 0.5L / ratio * m.w[1];
                const Wide F = (90 + 2.8L * v * v) * std::tanh(v / 0.3L) + 25 * v;
                return {0, -0.5L / ratio * F};
              });
  }
  expectOdd(train);
  expectLaw(train + ", mass: 100, grade: 0.02", kThroughRest, [](const Moment& m) -> Pair {
    const Wide v = 0.5L * m.w[1];
    const Wide F = (90 + 2.8L * v * v) * std::tanh(v / 0.3L) + 25 * v +
                   100 * 9.80665L * std::sin(std::atan(0.02L));
    return {0, -0.5L * F};
  });
  const TorquePtr torque = torqueOf(
      "VehicleResistance, shaft: load, law: davis, wheel_radius: 0.5, ratio: 2, constant: 90, "
      "linear: 25, quadratic: 2.8");
  Moment m = kFast.at(1.0L);
  m.w[1] = 80;  // 20 m/s
  EXPECT_NEAR(torqueAt(torque, State(m).view())[1], -0.25 * (90 + 25 * 20 + 2.8 * 400), 1e-11);
}

/// The grade i(t) = 0.0005 t (t + 20) at the points -20.., where the table is exact from -2 to 10.
const char* const kGrade =
    "grade: {time: [-4, -2, 0, 2, 4, 6, 8, 10, 12], "
    "grade: [-0.032, -0.018, 0, 0.022, 0.048, 0.078, 0.112, 0.15, 0.192]}";
Wide gradeAt(Wide t) {
  return 0.0005L * t * (t + 20);
}

TEST(VehicleResistance, FollowsARoad) {
  const std::string car =
      "VehicleResistance, shaft: drive, law: road, wheel_radius: 0.3, ratio: 0.7, mass: 12, "
      "rolling_coefficient: 0.2, drag_area: 0.65, regularization_speed: 0.4";
  expectLaw(car, kThroughRest, [](const Moment& m) -> Pair {
    const Wide v = 0.3L / 0.7L * m.w[0];
    const Wide F = (0.2L * 12 * 9.80665L + 0.5L * 1.2L * 0.65L * v * v) * std::tanh(v / 0.4L);
    return {-0.3L / 0.7L * F, 0};
  });
  expectOdd(car);
  expectLaw(car + ", air_density: 1.1, " + kGrade, kThroughRest, [](const Moment& m) -> Pair {
    const Wide v = 0.3L / 0.7L * m.w[0];
    const Wide alpha = std::atan(gradeAt(m.t));
    const Wide F = (0.2L * 12 * 9.80665L * std::cos(alpha) + 0.5L * 1.1L * 0.65L * v * v) *
                       std::tanh(v / 0.4L) +
                   12 * 9.80665L * std::sin(alpha);
    return {-0.3L / 0.7L * F, 0};
  });
  // Davis' law over the same track.
  expectLaw(std::string("VehicleResistance, shaft: drive, law: davis, wheel_radius: 0.3, constant: "
                        "9, linear: 2, quadratic: 0.3, regularization_speed: 0.5, mass: 30, ") +
                kGrade,
            kThroughRest, [](const Moment& m) -> Pair {
              const Wide v = 0.3L * m.w[0];
              const Wide F = (9 + 0.3L * v * v) * std::tanh(v / 0.5L) + 2 * v +
                             30 * 9.80665L * std::sin(std::atan(gradeAt(m.t)));
              return {-0.3L * F, 0};
            });
}

TEST(VehicleResistance, IsPulledDownASlopeAtRest) {
  const TorquePtr torque = torqueOf(
      "VehicleResistance, shaft: drive, law: road, wheel_radius: 0.5, mass: 10, "
      "rolling_coefficient: 0.01, drag_area: 1, grade: {time: [0, 10], grade: [0, 1]}");
  Moment m = kFast.at(1.0L);
  m.w[0] = 0;
  for (const auto& [time, sine] : std::vector<std::pair<Wide, double>>{{-5, 0},
                                                                       {0, 0},
                                                                       {5, 0.5 / std::sqrt(1.25)},
                                                                       {10, std::sqrt(0.5)},
                                                                       {99, std::sqrt(0.5)}}) {
    m.t = time;
    EXPECT_NEAR(torqueAt(torque, State(m).view())[0], -0.5 * 10 * 9.80665 * sine, 1e-13);
  }
}

// ---------------------------------------------------------------------------------- cutting torque

TEST(CuttingTorque, EntersAndLeavesSmoothly) {
  // The cut covers the times of the test, so that the closed form has no corner there.
  expectLaw(
      "CuttingTorque, shaft: load, torque: 42, begin: -1, ramp: 10, regularization_speed: 0.4",
      kThroughRest, [](const Moment& m) -> Pair {
        return {0, -42 * step((m.t + 1) / 10) * std::tanh(m.w[1] / 0.4L)};
      });
  expectLaw("CuttingTorque, shaft: drive, torque: 42, begin: -20, ramp: 9, end: -1",
            {{20.0L, 0}, {5.0L, 0}}, [](const Moment& m) -> Pair {
              return {-42 * (1 - step((m.t + 1) / 9)) * std::tanh(m.w[0] / 0.1L), 0};
            });
  expectLaw(
      "CuttingTorque, shaft: drive, torque: 42, begin: -2, ramp: 12, regularization_speed: "
      "0.5, tooth_passing: {teeth: 3, amplitude: 0.3, phase: 0.2}",
      kThroughRest, [](const Moment& m) -> Pair {
        return {-42 * step((m.t + 2) / 12) * (1 + 0.3L * std::sin(3 * m.phi[0] + 0.2L)) *
                    std::tanh(m.w[0] / 0.5L),
                0};
      });
  expectOdd("CuttingTorque, shaft: drive, torque: 42, begin: -2, ramp: 1");
}

TEST(CuttingTorque, IsContinuousOverItsWholeCourse) {
  const std::string cut =
      "CuttingTorque, shaft: drive, torque: 42, begin: 2, ramp: 0.5, end: 6, tooth_passing: "
      "{teeth: 2, amplitude: 0.5}";
  expectRate(cut, {{3.0L, 0}, {1.0L, 0}}, 1e-6);
  const TorquePtr torque = torqueOf(cut);
  Moment m = kFast.at(0.0L);
  m.w[0] = 50;
  m.phi[0] = 0;
  for (const auto& [time, part] : std::vector<std::pair<Wide, double>>{
           {-1, 0}, {2, 0}, {2.25, 0.5}, {2.5, 1}, {6, 1}, {6.25, 0.5}, {6.5, 0}, {1e9, 0}}) {
    m.t = time;
    EXPECT_NEAR(torqueAt(torque, State(m).view())[0], -42 * part, 1e-13) << time;
  }
}

// ---------------------------------------------------------------------------------------- friction

Wide stribeck(Wide w) {
  return (1.5L + 0.7L * std::exp(-w * w / 0.64L)) * std::tanh(w / 0.3L) + 0.05L * w;
}
const std::string kStribeck =
    "coulomb: 1.5, static: 2.2, stribeck_speed: 0.8, viscous: 0.05, regularization_speed: 0.3";

TEST(Friction, ActsOnOneShaft) {
  expectLaw("Friction, shaft: load, " + kStribeck, kThroughRest, [](const Moment& m) -> Pair {
    return {0, -stribeck(m.w[1])};
  });
  expectLaw("Friction, shaft: drive, coulomb: 4, regularization_speed: 0.5", kThroughRest,
            [](const Moment& m) -> Pair {
              return {-4 * std::tanh(m.w[0] / 0.5L), 0};
            });
  expectLaw("Friction, shaft: drive, viscous: 0.3", kThroughRest, [](const Moment& m) -> Pair {
    return {-0.3L * m.w[0], 0};
  });
  expectOdd("Friction, shaft: drive, " + kStribeck);
}

TEST(Friction, ActsBetweenTwoShafts) {
  for (const Wide ratio : {1.0L, 1.8L, -0.6L}) {
    expectLaw("Friction, shafts: [drive, load], ratio: " + std::to_string(ratio) + ", " + kStribeck,
              kThroughRest, [ratio](const Moment& m) -> Pair {
                const Wide T = stribeck(m.w[0] - ratio * m.w[1]);
                return {-T, ratio * T};
              });
  }
  expectOdd("Friction, shafts: [load, drive], ratio: 2, " + kStribeck);
}

TEST(Friction, TakesPower) {
  for (const char* shafts : {"shaft: load, ", "shafts: [drive, load], ratio: 1.8, "}) {
    const TorquePtr torque = torqueOf("Friction, " + (shafts + kStribeck));
    for (int n = 0; n < 50; ++n) {
      const State state(kThroughRest.at(0.17L * n));
      const std::array<double, 2> Q = torqueAt(torque, state.view());
      EXPECT_LT(Q[0] * state.velocity[0] + Q[1] * state.velocity[1], 0.0);
    }
  }
}

TEST(Friction, HoldsUnlessItsSignIsSmoothed) {
  EXPECT_EQ(torqueOf("Friction, shaft: drive, coulomb: 4")->holdings().size(), 1U);
  EXPECT_EQ(torqueOf("Friction, shaft: drive, coulomb: 1, static: 1.5")->holdings().size(), 1U);
  EXPECT_TRUE(torqueOf("Friction, shaft: drive, viscous: 4")->holdings().empty());
  EXPECT_TRUE(torqueOf("Friction, shaft: drive, " + kStribeck)->holdings().empty());
}

// ------------------------------------------------------------------------------------------- table

Table tableOf(const std::string& lists, Table::Beyond beyond) {
  const ParameterTree tree = readYamlText(lists, "table");
  ParameterReader reader(tree, "it");
  const Table table = Table::read(reader, {{"x", Range::any()}, {"y", Range::any()}}, beyond);
  reader.finish();
  return table;
}

const char* const kUneven =
    "{x: [-3, -1, 0, 0.2, 4, 5, 6, 9], y: [2, 2.5, 2.5, 7, -4, -4.1, -4, 0]}";
const double kUnevenX[] = {-3, -1, 0, 0.2, 4, 5, 6, 9};
const double kUnevenY[] = {2, 2.5, 2.5, 7, -4, -4.1, -4, 0};

TEST(Table, IsTwiceContinuouslyDifferentiable) {
  for (const Table::Beyond beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    const Table table = tableOf(kUneven, beyond);
    for (int k = 0; k < 8; ++k) {
      const double x = kUnevenX[k];
      EXPECT_EQ(table.value(x), kUnevenY[k]);
      const double left = std::nextafter(x, -1e9);
      const double right = std::nextafter(x, 1e9);
      for (const double beside : {left, right}) {
        EXPECT_NEAR(table.value(beside), table.value(x), 1e-13);
        EXPECT_NEAR(table.slope(beside), table.slope(x), 1e-10);
        EXPECT_NEAR(table.curvature(beside), table.curvature(x), 1e-9);
      }
    }
    // Between the points one polynomial: differences of order eight are exact but for rounding.
    for (int k = 0; k < 7; ++k) {
      const double h = (kUnevenX[k + 1] - kUnevenX[k]) / 20;
      for (int n = 5; n <= 15; ++n) {
        const double x = kUnevenX[k] + n * h;
        EXPECT_NEAR(table.slope(x),
                    difference<double>([&](double z) { return table.value(z); }, x, h), 1e-12 / h);
        EXPECT_NEAR(table.curvature(x),
                    difference<double>([&](double z) { return table.slope(z); }, x, h),
                    1e-12 / (h * h));
      }
    }
  }
}

TEST(Table, DoesNotOvershoot) {
  for (const Table::Beyond beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    const Table table = tableOf(kUneven, beyond);
    for (int k = 0; k < 7; ++k) {
      const double d = kUnevenY[k + 1] - kUnevenY[k];
      double last = kUnevenY[k];
      for (int n = 1; n <= 1000; ++n) {
        const double y = table.value(kUnevenX[k] + n * 1e-3 * (kUnevenX[k + 1] - kUnevenX[k]));
        if (d == 0.0) {
          EXPECT_NEAR(y, last, 1e-14);
        }
        EXPECT_GE((y - last) * d, -1e-14) << "between points " << k << " and " << k + 1;
        last = y;
      }
    }
  }
  // Many shapes, also steep ones beside flat ones.
  unsigned seed = 1;
  const auto random = [&seed] {
    seed = 1664525U * seed + 1013904223U;
    return static_cast<double>(seed >> 8) / 16777216.0;
  };
  for (int shape = 0; shape < 300; ++shape) {
    std::ostringstream x_list;
    std::ostringstream y_list;
    double x = 0.0;
    double y = 0.0;
    std::vector<std::pair<double, double>> points;
    for (int k = 0; k < 6; ++k) {
      x += std::pow(10.0, 4.0 * random() - 2.0);
      y += std::pow(10.0, 6.0 * random() - 3.0) * (shape % 2 == 0 ? 1.0 : random() - 0.5);
      x_list << (k > 0 ? ", " : "") << std::scientific << x;
      y_list << (k > 0 ? ", " : "") << std::scientific << y;
      points.emplace_back(std::stod((std::ostringstream() << std::scientific << x).str()),
                          std::stod((std::ostringstream() << std::scientific << y).str()));
    }
    const Table table = tableOf("{x: [" + x_list.str() + "], y: [" + y_list.str() + "]}",
                                shape % 3 == 0 ? Table::Beyond::kLinear : Table::Beyond::kConstant);
    const auto secant = [&points](std::size_t k) {
      return (points[k + 1].second - points[k].second) / (points[k + 1].first - points[k].first);
    };
    for (std::size_t k = 1; k + 1 < points.size(); ++k) {
      const double least = std::min(std::abs(secant(k - 1)), std::abs(secant(k)));
      const double slope = table.slope(points[k].first);
      EXPECT_LE(std::abs(slope), 1.25 * least * (1 + 1e-12));
      if (secant(k - 1) * secant(k) < 0.0) {
        EXPECT_EQ(slope, 0.0);
      }
    }
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      const auto [x0, y0] = points[k];
      const auto [x1, y1] = points[k + 1];
      for (int n = 1; n < 40; ++n) {
        const double slope = table.slope(x0 + n / 40.0 * (x1 - x0));
        EXPECT_GE(slope * (y1 - y0), -1e-11 * (y1 - y0) * (y1 - y0) / (x1 - x0))
            << "shape " << shape;
      }
    }
  }
}

TEST(Table, MeetsParabolasAndLines) {
  const Table table =
      tableOf("{x: [10, 11, 12.5, 13, 15, 18], y: [100, 121, 156.25, 169, 225, 324]}",
              Table::Beyond::kLinear);
  for (int n = 0; n <= 100; ++n) {
    const double x = 11 + 0.04 * n;
    EXPECT_NEAR(table.value(x), x * x, 1e-12);
    EXPECT_NEAR(table.slope(x), 2 * x, 1e-11);
    EXPECT_NEAR(table.curvature(x), 2.0, 1e-9);
  }
  for (const char* points : {"{x: [1, 2, 5], y: [3, 5, 11]}", "{x: [1, 5], y: [3, 11]}"}) {
    const Table line = tableOf(points, Table::Beyond::kLinear);
    for (const double x : {-7.0, 1.0, 1.7, 2.0, 3.3, 5.0, 80.0}) {
      EXPECT_NEAR(line.value(x), 2 * x + 1, 1e-13);
      EXPECT_NEAR(line.slope(x), 2.0, 1e-13);
      EXPECT_NEAR(line.curvature(x), 0.0, 1e-13);
    }
  }
}

TEST(Table, EndsAsAsked) {
  const Table constant = tableOf("{x: [1, 5], y: [3, 11]}", Table::Beyond::kConstant);
  for (const double x : {-1e300, -2.0, 1.0}) {
    EXPECT_EQ(constant.value(x), 3.0);
    EXPECT_EQ(constant.slope(x), 0.0);
  }
  for (const double x : {5.0, 5.1, 1e300}) {
    EXPECT_EQ(constant.value(x), 11.0);
    EXPECT_EQ(constant.slope(x), 0.0);
  }
  EXPECT_NEAR(constant.value(2.0), 3.0 + 8.0 * static_cast<double>(step(0.25L)), 1e-14);
  for (const double f : {Table().value(0.0), Table().slope(-1.0), Table().curvature(7.0)}) {
    EXPECT_EQ(f, 0.0);
  }
  for (const Table& table : {constant, tableOf(kUneven, Table::Beyond::kLinear), Table()}) {
    EXPECT_TRUE(std::isnan(table.value(kNan)));
    EXPECT_TRUE(std::isnan(table.slope(kNan)));
    EXPECT_TRUE(std::isnan(table.curvature(kNan)));
  }
}

TEST(Table, RefusesWhatIsNoTable) {
  test::expectFaultsOfElements(
      "tables", [](const std::string& lists) { tableOf(lists, Table::Beyond::kConstant); });
}

// ------------------------------------------------------------------------------------------ errors

TEST(Elements, AreRefusedByPathAndWords) {
  test::expectFaultsOfElements("torque_laws", torqueOf);
}

TEST(InputValue, ATopicUsedTwiceIsToldByItsFullPath) {
  test::expectRefused("b/command/topic", {"b/command/topic: topic 'same' is used twice"}, [&] {
    test::sceneFromText(
        "drive 1, load 1",
        {"a on drive from same",
         std::string("b = MotorCurve, shaft: load, command: {topic: same}, ") + kKloss});
  });
}

TEST(InputValue, IsLimitedToItsRange) {
  const auto input = [](const std::string& keys) {
    return test::sceneFromText(
               sceneOf("type: variator_sim/MotorCurve, shaft: load, " + keys + kKloss))
        .inputs.at(0);
  };
  const CommandInputSettings plain = input("command: {topic: a}, ");
  EXPECT_EQ(plain.owner, "it");
  EXPECT_EQ(plain.minimum, 0.0);
  EXPECT_EQ(plain.maximum, 1.0);
  EXPECT_EQ(plain.initial, 0.0);
  const CommandInputSettings narrow =
      input("command: {topic: a, min: 0.2, max: 0.9, initial: 0.5, hold: rate_limit, rate: 3}, ");
  EXPECT_EQ(narrow.minimum, 0.2);
  EXPECT_EQ(narrow.maximum, 0.9);
  EXPECT_EQ(narrow.initial, 0.5);
  EXPECT_EQ(narrow.hold, Hold::kRateLimit);
  EXPECT_EQ(narrow.hold_parameter, 3.0);
  const CommandInputSettings voltage =
      test::sceneFromText(sceneOf("type: variator_sim/MotorCurve, shaft: load, characteristic: dc, "
                                  "torque_constant: 1, resistance: 1, voltage: {topic: a}"))
          .inputs.at(0);
  EXPECT_EQ(voltage.minimum, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(voltage.maximum, std::numeric_limits<double>::infinity());
}

// ----------------------------------------------------------------------------------- documentation

/// A scene of two shafts with the elements of `examples`.
Scene sceneOfExamples(const std::vector<std::string>& examples) {
  std::string text;
  std::string names;
  for (const std::string& example : examples) {
    text += example;
    const ParameterTree tree = readYamlText(example, "an example");
    for (const auto& element : tree.asDictionary()) {
      names += (names.empty() ? "" : ", ") + element.first;
    }
  }
  return test::sceneFromText(
      "shafts: [drive, load]\ndrive: {inertia: 5}\nload: {inertia: 9}\n"
      "torques: [" +
      names + "]\n" + text);
}

TEST(Documentation, ExamplesAreReadAndEveryTypeAndKeyIsThere) {
  std::map<std::string, std::set<std::string>> keys;
  std::vector<std::string> examples = test::readExamples("Torques");
  for (const std::string& example : test::readExamples("Elements with modes")) {
    examples.push_back(example);
    const Scene scene = sceneOfExamples({example});
    for (const TorquePtr& element : scene.torques) {
      EXPECT_FALSE(element->holdings().empty()) << element->name();
    }
  }
  for (const std::string& example : examples) {
    SCOPED_TRACE(example);
    ASSERT_NO_THROW(sceneOfExamples({example}));
    ParameterTree scene = sceneOfExamples({example}).resolved;
    const ParameterTree elements = readYamlText(example, "an example");
    for (const auto& named : elements.asDictionary()) {
      ParameterTree& element = scene.asDictionary().at(named.first);
      std::set<std::string>& known = keys[element.asDictionary().at("type").asText()];
      known.merge(test::allowedKeys(scene, element));
      for (auto& [key, value] : element.asDictionary()) {
        const bool is_commanded = value.kind() == ParameterTree::Kind::kDictionary &&
                                  value.asDictionary().count("topic") != 0;
        if (value.kind() == ParameterTree::Kind::kDictionary && !is_commanded) {
          known.merge(test::allowedKeys(scene, value));
        }
      }
    }
  }
  std::set<std::string> types{"variator_sim/CommandedTorque", "variator_sim/ExpressionTorque"};
  for (auto& [type, known] : keys) {
    known.erase("type");
    const std::string name = type.substr(type.find('/') + 1);
    EXPECT_EQ(test::documentedKeys(name), known) << type;
    types.insert(type);
  }
  const std::vector<std::string> all = BuiltinComponentFactory().torqueTypes();
  EXPECT_EQ(types, std::set<std::string>(all.begin(), all.end()));
}

TEST(Documentation, ExamplesRunTogether) {
  Simulation simulation(sceneOfExamples(test::readExamples("Torques")));
  for (int n = 1; n <= 40; ++n) {
    if (n == 10) {
      for (int i = 0; i < simulation.scene().inputCount(); ++i) simulation.command(i, 0.6);
    }
    ASSERT_TRUE(simulation.advanceTo(0.1 * n).ok()) << simulation.describeStatus();
  }
}

/// All elements of the documentation at extreme states, but for those that others cover.
TEST(Laws, AreFiniteFarAway) {
  const Scene scene = sceneOfExamples(test::readExamples("Torques"));
  double input[kMaxInputs] = {};
  double input_rate[kMaxInputs] = {};
  for (double& u : input) u = 0.5;
  for (double& rate : input_rate) rate = 2.0;
  for (const double w : {0.0, 1e-300, -1e-300, 1e-20, 40.0, 48.0, 50.0, 1e5, -1e5, 1e100, -1e100}) {
    for (const double time : {0.0, 2.0, 5.0, 1e100}) {
      const double velocity[] = {w, -0.5 * w};
      const double acceleration[] = {1e3, -1e5};
      const StateView state{time, velocity, velocity, acceleration, input, input_rate};
      for (const TorquePtr& torque : scene.torques) {
        const std::array<double, 2> Q = torqueAt(torque, state);
        const std::array<double, 2> rate = rateAt(torque, state);
        EXPECT_TRUE(std::isfinite(Q[0]) && std::isfinite(Q[1])) << torque->name() << " at " << w;
        EXPECT_TRUE(std::isfinite(rate[0]) && std::isfinite(rate[1]))
            << torque->name() << " at " << w;
      }
    }
  }
}

TEST(Laws, PassOnWhatIsNotANumber) {
  const Scene scene = sceneOfExamples(test::readExamples("Torques"));
  const double nothing[] = {kNan, kNan};
  const double acceleration[] = {1.0, 2.0};
  double input[kMaxInputs] = {};
  double input_rate[kMaxInputs] = {};
  const StateView state{5.0, nothing, nothing, acceleration, input, input_rate};
  for (const TorquePtr& torque : scene.torques) {
    const std::array<double, 2> Q = torqueAt(torque, state);
    EXPECT_TRUE(std::isnan(Q[0]) || std::isnan(Q[1])) << torque->name();
    const std::array<double, 2> rate = rateAt(torque, state);
    // Straight lines have the same slope everywhere.
    const bool is_line = torque->name() == "starter" || torque->name() == "servo";
    EXPECT_TRUE(is_line || std::isnan(rate[0]) || std::isnan(rate[1])) << torque->name();
  }
}

#ifdef VARIATOR_SIM_COUNTS_ALLOCATIONS
TEST(Laws, AllocateNothing) {
  const Scene scene = sceneOfExamples(test::readExamples("Torques"));
  double input[kMaxInputs] = {};
  double input_rate[kMaxInputs] = {};
  for (double& u : input) u = 0.5;
  for (double& rate : input_rate) rate = 2.0;
  const long before = allocations;
  double sum[2] = {};
  for (int n = -200; n < 400; ++n) {
    const double velocity[] = {0.7 * n, 0.3 * n};
    const StateView state{0.05 * n, velocity, velocity, velocity, input, input_rate};
    for (const TorquePtr& torque : scene.torques) {
      torque->addTorque(state, sum);
      torque->addTorqueRate(state, sum);
    }
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(std::isfinite(sum[0]) && std::isfinite(sum[1]));
  const std::string text(1000, 'x');
  EXPECT_GT(allocations, before) << text.size();
}
#endif

}  // namespace
}  // namespace variator_sim
