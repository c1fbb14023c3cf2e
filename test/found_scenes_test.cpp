// Scenes in which others found the program wrong, endless or stopping without need (test/found),
// and the right values: closed forms, quadratures by mpmath to 20 digits, and SciPy's DOP853 at
// 1e-13 with steps below every feature. Each is played in a process of its own, which may take 5 s.
#include <gtest/gtest.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "support/scenes.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim::test {
namespace {

/// Beside the tolerance of 1e-9: a hundred times it.
constexpr double kAllowed = 1e-7;

struct Value {
  double time;
  const char* column;  ///< SHAFT/QUANTITY
  double value;
  double allowed = kAllowed;
};

struct Found {
  const char* name;           ///< a file of test/found, or of a torque alone
  std::vector<Value> values;  ///< in order of time
  const char* torque = "";    ///< on one shaft of unit inertia
  double velocity = 0.0;      ///< its start
  const char* commands =
      "";                 ///< lines of a command file; those of the file of the same name if none
  const char* keys = "";  ///< further lines of the scene
  double chatters_at = -1.0;  ///< a stop of that name is as right, up to this time, s
  const char* fault = "";     ///< a stop whose message has these words is what is right
};

void PrintTo(const Found& found, std::ostream* out) {
  *out << found.name;
}

constexpr const char* kRate = "inputs: [v]\nv: {topic: v, hold: rate_limit, rate: 1, initial: 0}\n";
constexpr const char* kZero = "inputs: [v]\nv: {topic: v, initial: 0}\n";
constexpr const char* kGauss = "principle: gauss\n";

const Found kFound[] = {
    // flat, and on no list (R1)
    {"R1_high_power_missed",
     {{1, "a/velocity", 2.18917046},
      {3, "a/velocity", 2.36324663},
      {5, "a/velocity", 2.677661157},
      {5, "a/angle", 11.54830124}}},
    {"R1_input_products_missed",
     {{1, "a/velocity", 2.5952692275795}, {3, "a/velocity", 2.5952692275795}}},
    {"R1_ratio_order1_bump_missed",
     {{1, "a/velocity", 1.1},
      {2, "a/velocity", 1.70943429},
      {2, "a/acceleration", 1.073810365, 1e-6},
      {3, "a/velocity", 2.78324197},
      {3, "a/acceleration", 1.072607616, 1e-6}}},
    {"R1_sqrt_triangle_missed",
     {{1, "a/velocity", 1.3168895938545},
      {2, "a/velocity", 0.82360624239711},
      {3, "a/velocity", 0.62205872749268}}},
    {"log_of_power", {{3, "a/velocity", 0.30316689551618}}, "5*log(1+cos(t-2.4)^1000)"},
    {"log_of_polynomial", {{3, "a/velocity", 0.33888693497839}}, "5*log(1+(4*t/3*(1-t/3))^900)"},
    {"exp_of_power", {{3, "a/velocity", 0.58446658248723}}, "5*(exp(cos(t-1.7)^1000)-1)"},
    {"tan_of_power", {{3, "a/velocity", 0.43590510741398}}, "5*tan(0.7*cos(t-1.7)^500)"},
    {"sin_of_power", {{3, "a/velocity", 0.45965043987518}}, "5*sin(3*cos(t-1.7)^1000)"},
    {"power_of_no_integer",
     {{3, "a/velocity", 0.33478298217477}},
     "5*(0.5+0.5*cos(2*(t-1.7)))^700.5"},
    {"polynomial_bump", {{1, "a/velocity", 0.31274256924533}}, "5*(4*t*(1-t))^200"},
    {"nested_squares",
     {{1, "a/velocity", 1.45163445}, {2, "a/velocity", 1.45163445}, {3, "a/velocity", 1.79289861}},
     "5*((((((((cos(phi1-0.22)^2)^2)^2)^2)^2)^2)^2)^2)^2",
     1.0},
    // vanishing derivatives where a step begins, and a period (R2)
    {"R2_between_commands", {{3, "a/velocity", 5.9625}}},
    {"R2_cam_edge_at_start",
     {{0.5, "a/reaction_torque", 0.0},
      {0.5, "a/velocity", 0.5 * 3072.0 / 2772.0},
      {1, "a/velocity", 3072.0 / 2772.0}}},
    {"R2_every_period_lost",
     {{1, "a/velocity", 1.4375}, {2, "a/velocity", 2.875}, {3, "a/velocity", 4.3125}}},
    {"R2_quotient_of_period",
     {{1, "a/velocity", 2.2932315171388}, {3, "a/velocity", 6.8796945514163}}},
    {"R2_short_series_steps_over_sine_power",
     {{1, "a/velocity", 0.9375}, {3, "a/velocity", 2.8125}}},
    {"R2_slip_gauss",
     {{1, "a/velocity", 2.0 + 2.5 / 3.0}, {3, "a/velocity", 4.5}, {3, "b/velocity", 2.25}}},
    {"cube_of_period", {{3, "a/velocity", 22.5}}, "3*(1-cos(2*pi*t))^3"},
    {"cosine_of_cube", {{3, "a/velocity", 4.6483208772379}}, "5*cos(2*sin(pi*t)^3)-1"},
    {"exp_of_period", {{3, "a/velocity", 3.2010264534362}}, "3*exp(-30*sin(pi*t)^6)"},
    {"period_of_angle",
     {{1, "a/velocity", 1.95255284}, {2, "a/velocity", 2.90567662}, {3, "a/velocity", 3.77268714}},
     "3*sin(2*pi*phi1)^6",
     1.0},
    {"polynomial_from_end_to_end",
     {{2, "a/velocity", 0.063342230524893}},
     "30*t^6*(1-t)^6*(2-t)^6"},
    {"long_period",
     {{300, "a/velocity", 281.25, 1e-5}},
     "3*sin(0.01*pi*t)^6",
     0.0,
     "",
     "solver: {maximum_step: 100}\n"},
    // a polynomial of the argument that does not converge (R3)
    {"R3_argument_polynomial_diverges",
     {{1, "a/velocity", 1.01582723},
      {2, "a/velocity", 1.03398618},
      {3, "a/velocity", 1.04930091},
      {3, "a/angle", 3.07469111}}},
    {"R3_angle2",
     {{1, "a/velocity", 1.037355}, {2, "a/velocity", 1.07341083}, {3, "a/velocity", 1.11257781}}},
    {"R3_time",
     {{1, "a/velocity", 0.031907361170116},
      {2, "a/velocity", 0.067359984692468},
      {3, "a/velocity", 0.099267345862585}}},
    {"diverges_in_time", {{3, "a/velocity", 0.050516197766279}}, "3*exp(-(100*sin(20*t+1))^2)"},
    // found by resolution_test
    {"../stress/kept/bump_10005_free_shaft_of_input",
     {
         {1.5, "a/velocity", 0.89893, 0.1},
         {3.0, "a/velocity", 1.42843815028, 0.1},
     }},
    {"../stress/kept/bump_10039_free_shaft_of_time",
     {
         {1.5, "a/velocity", 2.92045621038, 1e-06},
         {3.0, "a/velocity", 4.84091242077, 1e-06},
     }},
    {"../stress/kept/bump_10040_order2_of_table",
     {
         {1.5, "a/velocity", 5.11668975146, 1e-05},
         {3.0, "a/velocity", 9.54249016974, 1e-05},
     }},
    {"../stress/kept/bump_10045_free_shaft_of_angle",
     {
         {1.5, "a/velocity", 8.43834256773, 0.1},
         {3.0, "a/velocity", 15.946219559, 0.1},
     }},
    {"../stress/kept/bump_10100_order2_of_input",
     {
         {0.5, "a/velocity", 0.406885244972, 1e-05},
         {1.0, "a/velocity", 0.864430940691, 1e-05},
     }},
    {"../stress/kept/bump_10122_order1_of_angle",
     {
         {1.5, "a/velocity", 1.24027952901, 1e-07},
         {3.0, "a/velocity", 1.41256479086, 1e-07},
     }},
    {"../stress/kept/bump_10139_order3_of_angle",
     {
         {1.5, "a/velocity", 2.20559976756, 0.01},
         {3.0, "a/velocity", 3.54046440731, 0.01},
     }},
    {"../stress/kept/bump_10156_order2_of_time",
     {
         {1.5, "a/velocity", -1.07616564502, 0.01},
         {3.0, "a/velocity", 0.362041114489, 0.01},
     }},
    {"../stress/kept/bump_10189_free_shaft_of_table",
     {
         {1.5, "a/velocity", 2.69954961962, 1e-06},
         {3.0, "a/velocity", 4.84909923931, 1e-06},
     }},
    {"../stress/kept/bump_10236_order1_of_velocity",
     {
         {1.5, "a/velocity", 3.91023534539, 0.01},
         {3.0, "a/velocity", 5.80110308865, 0.01},
     }},
    // a sample at the instant of a jump (R5)
    {"R5_sample_at_sign_instant",
     {{0.25, "a/velocity", 0.25}, {0.5, "a/reaction_torque", 0.0}, {0.75, "a/velocity", 1.25}}},
    // a jump where something else ends (R6)
    {"R6_command_at_edge_chattering",
     {{0.9, "a/velocity", 0.9}, {1.5, "a/velocity", 3.5}, {2, "a/velocity", 6.0}}},
    {"unread_command_at_edge", {{2, "a/velocity", 4.0}}, "if(t<1,1,3)+0*v", 0.0, "1,v,2\n", kZero},
    {"command_at_edge_0.7", {{1.7, "a/velocity", 5.7}}, "if(t<0.7,1,3)+v", 0.0, "0.7,v,2\n", kZero},
    {"command_at_sign", {{2, "a/velocity", 2.0}}, "sign(t-1)+v", 0.0, "1,v,2\n", kZero},
    {"lag_at_edge",
     {{1.7, "a/velocity", 0.7 + 3 + 2 * (0.9 + 0.1 * 4.539992976248485e-05)}},
     "if(t<0.7,1,3)+v",
     0.0,
     "0.7,v,2\n",
     "inputs: [v]\nv: {topic: v, hold: first_order_lag, time_constant: 0.1, initial: 0}\n"},
    {"timeout_at_edge",
     {{2, "a/velocity", 6.0}},
     "if(t<1,1,3)+v",
     0.0,
     "0.5,v,4\n",
     "inputs: [v]\nv: {topic: v, initial: 0, timeout: 0.5, on_timeout: zero}\n"},
    {"command_at_edge_of_velocity",
     {{2, "a/velocity", 3.0}},
     "if(w1<1,1,v)",
     0.0,
     "1,v,2\n",
     kZero},
    {"ramp_ends_on_edge", {{1.5, "a/velocity", 2.5}}, "if(v<1,1,3)", 0.0, "0,v,1\n", kRate},
    {"hold_ends_on_edge",
     {{1.5, "a/velocity", 2.5}},
     "if(v<1,1,3)",
     0.0,
     "0,v,1\n",
     "inputs: [v]\nv: {topic: v, hold: first_order_hold, period: 1, initial: 0}\n"},
    {"ramp_ends_at_edge", {{1.5, "a/velocity", 3.5}}, "if(t<1,1,3)+v", 0.0, "0,v,1\n", kRate},
    // (when the rounded lag arrives is its own affair)
    {"lag_ends_on_edge",
     {{0.6, "a/velocity", 0.6}, {2, "a/velocity", 2.6, 0.7}},
     "if(v<1,1,2)",
     0.0,
     "0,v,1\n",
     "inputs: [v]\nv: {topic: v, hold: first_order_lag, time_constant: 0.02, initial: 0}\n"},
    // a step that ends on an edge to the bit (R7)
    {"R7_gauss_step_ends_on_edge", {{1.5, "a/velocity", 1.25}, {2, "a/velocity", 1.5}}},
    {"step_ends_on_sign", {{1.5, "a/velocity", 2.5}}, "sign(w1-1)+2", 0.0, "", kGauss},
    // at rest, and beside switches
    {"auto_stays_explicit", {{1, "input/velocity", 0.0}}},
    {"slow_edges",
     {{0.4, "input/velocity", 0.0}, {1, "input/velocity", 1e-4 * 0.7331685343967135}}},
    {"time_edge_at_rest", {{0.4, "input/velocity", 0.0}, {1, "input/velocity", 0.0}}},
    {"stick_crawl", {{1, "mass/velocity", 0.19999986587, 1e-9}}},
    {"clutch_tolerance",
     {{0.45, "flywheel/velocity", 94.66966463, 2e-3},
      {0.45, "hub/velocity", 94.66966463, 2e-3},
      {0.45, "car/velocity", 96.04620816, 2e-3}}},
    {"freewheel_hang", {{2, "a/velocity", 0.909292495237}, {3, "a/velocity", 0.371435852926}}},
    {"freewheel_underflow",
     {{0.5, "a/velocity", 4.06566591315}, {1, "a/velocity", 2.533018098081}}},
    {"hold_by_sign", {{1, "hoist/velocity", 0.0}}, "", 0.0, "", "", 1e-9},
    {"hold_by_sign_geared",
     {{1, "a/velocity", 0.0}, {1, "b/velocity", 0.0}},
     "",
     0.0,
     "",
     "",
     1e-9},
    // gear 1 pulls above the threshold, gear 2 does not hold it: a scene without memory has no
    // motion
    {"gear_logic", {{60, "wheel/velocity", 30.0, 0.0}}, "", 0.0, "", "", 60.0},
    {"misblame", {}, "", 0.0, "", "", -1.0, "torque 'fluid'"},
};

std::string pathOf(const std::string& file) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/found/" + file;
}

Scene sceneOf(const Found& found) {
  if (*found.torque == '\0') return sceneFromFile(pathOf(found.name + std::string(".yaml")));
  return sceneFromText(
      "shafts: [a]\na: {inertia: 1.0}\ntorques: [q]\n"
      "q: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" +
      std::string(found.torque) + "\"}\ninitial: {velocity: [" + std::to_string(found.velocity) +
      "]}\n" + found.keys);
}

double read(const Sample& sample, const std::string& column, const Scene& scene) {
  const std::size_t slash = column.find('/');
  const std::string quantity = column.substr(slash + 1);
  const double* values = quantity == "velocity"       ? sample.velocity
                         : quantity == "angle"        ? sample.angle
                         : quantity == "acceleration" ? sample.acceleration
                                                      : sample.reaction_torque;
  for (std::size_t i = 0; i < scene.shafts.size(); ++i) {
    if (scene.shafts[i] == column.substr(0, slash)) return values[i];
  }
  return NAN;
}

void play(const Found& found, Scene scene) {
  std::vector<TimedCommand> commands;
  const std::string file = pathOf(found.name + std::string(".csv"));
  if (*found.commands != '\0') {
    commands = readCommandText("time,topic,value\n" + std::string(found.commands), "commands");
  } else if (std::filesystem::exists(file)) {
    commands = readCommandFile(file);
  }
  scene.solver.machine_code = MachineCode::kNever;
  Simulation simulation(scene);
  std::size_t next = 0;
  const double end = found.values.empty() ? 1.0 : found.values.back().time;
  for (std::size_t n = 0; n <= found.values.size() && simulation.status().ok(); ++n) {
    const double time = n < found.values.size() ? found.values[n].time : end;
    for (; next < commands.size() && commands[next].time <= time; ++next) {
      simulation.advanceTo(commands[next].time);
      for (int input = 0; input < scene.inputCount(); ++input) {
        if (scene.inputs[static_cast<std::size_t>(input)].topic != commands[next].topic) continue;
        simulation.command(input, commands[next].value);
      }
    }
    if (!simulation.advanceTo(time).ok() || n == found.values.size()) break;
    const auto& [at, column, value, allowed] = found.values[n];
    EXPECT_NEAR(read(simulation.sample(), column, scene), value, allowed * (1.0 + std::abs(value)))
        << column << " at " << at << " s";
  }
  if (*found.fault != '\0') {
    EXPECT_NE(simulation.describeStatus().find(found.fault), std::string::npos)
        << simulation.describeStatus();
  } else if (simulation.status().reason != StopReason::kChattering ||
             simulation.status().time > found.chatters_at) {
    EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  }
  const Statistics& statistics = simulation.statistics();
  EXPECT_LT(statistics.steps + statistics.rejected_steps, 20000u);
}

/// A run that exceeds 5 s of its process' time fails, and the next test goes on.
void inChild(const std::function<void()>& body) {
  std::fflush(nullptr);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const itimerval timer{{0, 0}, {5, 0}};
    setitimer(ITIMER_PROF, &timer, nullptr);
    body();
    std::fflush(nullptr);
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_FALSE(WIFSIGNALED(status) && WTERMSIG(status) == SIGPROF) << "goes on for ever";
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

class FoundScene : public testing::TestWithParam<Found> {};

TEST_P(FoundScene, IsRight) {
  inChild([] { play(GetParam(), sceneOf(GetParam())); });
}
TEST_P(FoundScene, IsRightByOtherMeans) {
  inChild([] {
    Scene scene = sceneOf(GetParam());
    // On free shafts both principles give the same motion.
    if (scene.constraints.empty()) {
      scene.principle =
          scene.principle == Principle::kGauss ? Principle::kGeneralizedGauss : Principle::kGauss;
    }
    // (Explicit steps crawl in stiff scenes, where `auto` goes over to implicit ones.)
    Simulation automatic(sceneOf(GetParam()));
    automatic.advanceTo(0.1);
    const bool is_stiff = automatic.statistics().implicit_steps > 0 || automatic.isSleeping();
    if (!is_stiff && takes(scene, StepperKind::kTaylor))
      scene.solver.stepper = StepperKind::kTaylor;
    play(GetParam(), scene);
  });
}

INSTANTIATE_TEST_SUITE_P(Test, FoundScene, testing::ValuesIn(kFound), [](const auto& of) {
  std::string name = of.param.name;
  name.erase(0, name.rfind('/') + 1);
  for (char& c : name) c = c == '.' ? '_' : c;
  return name;
});

TEST(FoundState, IsRestoredToTheBit) {
  const Scene scene = sceneFromFile(pathOf("R4_restored_not_to_the_bit.yaml"));
  Simulation saved(scene);
  saved.advanceTo(0.37);
  MotionState state;
  ASSERT_TRUE(saved.saveState(&state));
  Simulation restored(scene);
  ASSERT_EQ(restored.setState(state), "");
  for (const double time : {1.0, 2.018}) {
    saved.advanceTo(time);
    restored.advanceTo(time);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(restored.sample().velocity[i], saved.sample().velocity[i]) << time;
      EXPECT_EQ(restored.sample().acceleration[i], saved.sample().acceleration[i]) << time;
      EXPECT_EQ(restored.sample().reaction_torque[i], saved.sample().reaction_torque[i]) << time;
      EXPECT_EQ(restored.sample().reaction_torque_rate[i], saved.sample().reaction_torque_rate[i]);
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
