/// The order of a list says nothing: shafts, torques, constraints, couplings of inertia, timeouts
/// that fall on one instant, and commands of one instant.
#include <numeric>
#include <random>

#include "stress/methods.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim::test {
namespace {

/// As withSolver; nothing here needs many steps in a second, and whatever does is told soon.
Scene withFewSteps(Scene scene, StepperKind stepper, double tolerance) {
  scene = withSolver(std::move(scene), stepper, tolerance);
  scene.solver.maximum_steps = 10000;
  return scene;
}

/// Differences of order are of rounding; where they turn a step's size they are of a step's error.
constexpr double kAFew = 5.0;

using Order = std::vector<int>;

Order identity(std::size_t n) {
  Order order(n);
  std::iota(order.begin(), order.end(), 0);
  return order;
}

/// A scene whose lists can be written in any order. Formulas name shafts by letters: w{a}.
struct Lists {
  std::string name;
  std::vector<std::string> shafts;   ///< names of one letter
  std::vector<std::string> inertia;  ///< and their dictionaries
  std::vector<std::pair<std::string, std::string>> torques;
  std::vector<std::pair<std::string, std::string>> constraints;
  std::vector<std::string> couplings;
  std::vector<double> velocity;
  std::vector<std::pair<double, std::map<std::string, double>>> commands;  ///< per instant by topic

  std::string write(const Order& shaft_order, const Order& torque_order,
                    const Order& constraint_order, const Order& coupling_order) const {
    const auto listed = [](const auto& items, const Order& order, auto word) {
      std::string list;
      for (int i : order) {
        list += (list.empty() ? "" : ", ") + std::string(word(items[static_cast<std::size_t>(i)]));
      }
      return "[" + list + "]";
    };
    const auto first = [](const auto& item) { return item.first; };
    const auto self = [](const std::string& item) { return item; };
    std::string yaml = "shafts: " + listed(shafts, shaft_order, self) + "\n";
    for (std::size_t i = 0; i < shafts.size(); ++i) yaml += shafts[i] + ": " + inertia[i] + "\n";
    if (!couplings.empty()) {
      yaml += "inertia_coupling: " + listed(couplings, coupling_order, self) + "\n";
    }
    yaml += "torques: " + listed(torques, torque_order, first) + "\n";
    for (const auto& [key, value] : torques) yaml += key + ": " + value + "\n";
    yaml += "constraints: " + listed(constraints, constraint_order, first) + "\n";
    for (const auto& [key, value] : constraints) yaml += key + ": " + value + "\n";
    std::vector<std::string> numbers;
    for (double value : velocity) numbers.push_back(plainly(value));
    yaml += "initial: {velocity: " + listed(numbers, shaft_order, self) + ", project: true}\n";
    for (std::size_t place = 0; place < shafts.size(); ++place) {
      const std::string token = "{" + shafts[static_cast<std::size_t>(shaft_order[place])] + "}";
      for (std::size_t at = yaml.find(token); at != std::string::npos; at = yaml.find(token, at)) {
        yaml.replace(at, token.size(), std::to_string(place + 1));
      }
    }
    return yaml;
  }
};

std::string formula(const std::string& shaft, const std::string& torque) {
  return "{type: variator_sim/ExpressionTorque, shaft: " + shaft + ", torque: \"" + torque + "\"}";
}
std::string input(const std::string& shaft, const std::string& topic, const std::string& keys) {
  return "{type: variator_sim/CommandedTorque, shaft: " + shaft + ", topic: " + topic + ", " +
         keys + "}";
}
std::string psi(int order, const std::string& expression) {
  return "{type: variator_sim/ExpressionConstraint, order: " + std::to_string(order) +
         ", expression: \"" + expression + "\"}";
}

std::vector<Lists> scenes() {
  std::vector<Lists> list;
  list.push_back({"kinks, jumps, a slip",
                  {"a", "b", "c"},
                  {"{inertia: 0.8}", "{inertia: 2.0}",
                   "{inertia: {mean: 1.3, harmonics: [{order: "
                   "1, cos: 0.1, sin: 0.05}, {order: 2, cos: "
                   "0.02, sin: -0.07}]}}"},
                  {{"m", formula("a", "3-0.4*w{a}")},
                   {"s",
                    "{type: variator_sim/ElasticCoupling, shafts: [b, c], stiffness: 40, "
                    "damping: 3, ratio: 1.0}"},
                   {"k", formula("c", "-0.2*w{c}*abs(w{c})-max(0,phi{c}-1)")},
                   {"j", formula("b", "-0.5-0.4*sign(t-0.7)")},
                   {"f",
                    "{type: variator_sim/Friction, shaft: b, coulomb: 0.3, "
                    "regularization_speed: 0.2}"}},
                  {{"v", psi(2, "0.2*(e{b}-0.6*e{a})+w{b}-0.6*w{a}")}},
                  {"[a, b, 0.05]", "[b, c, -0.1]", "[a, c, 0.02]"},
                  {1.0, 0.7, 0.5},
                  {}});
  list.push_back({"two curved constraints, commands of one instant",
                  {"a", "b", "c"},
                  {"{inertia: 0.8}", "{inertia: 2.0}", "{inertia: 1.3}"},
                  {{"x", input("a", "u", "initial: 2")},
                   {"y", input("b", "v", "initial: -1")},
                   {"z", input("c", "w", "initial: -0.5")},
                   {"d", formula("a", "-0.5*w{a}")}},
                  {{"p", psi(2, "0.2*(e{b}-0.6*e{a})*(1+0.05*(e{a}^2+e{b}^2))+w{b}-0.6*w{a}")},
                   {"q", psi(2, "0.3*(e{c}-0.8*e{b})+0.02*e{a}*e{c}+w{c}-0.8*w{b}")}},
                  {},
                  {1.0, 0.6, 0.48},
                  {{0.4, {{"u", 8.0}, {"v", -3.0}, {"w", 2.0}}},
                   {0.9, {{"u", -4.0}, {"w", -2.0}}},
                   {1.2, {{"v", 1.0}, {"u", 1.0}, {"w", 1.0}}}}});
  list.push_back(
      {"timeouts of one instant",
       {"a", "b"},
       {"{inertia: 0.8}", "{inertia: 2.0}"},
       {{"x", input("a", "u", "timeout: 0.5, on_timeout: zero")},
        {"y", input("b", "v", "timeout: 0.5, on_timeout: zero")},
        {"z", input("b", "w", "timeout: 0.5, on_timeout: zero, hold: rate_limit, rate: 50")},
        {"d", formula("a", "-0.5*w{a}")}},
       {{"p", psi(2, "0.2*(e{b}-0.6*e{a})*(1+0.05*(e{a}^2+e{b}^2))+w{b}-0.6*w{a}")}},
       {},
       {1.0, 0.6},
       {{0.3, {{"u", 9.0}, {"v", 5.0}, {"w", -3.0}}}}});
  list.push_back(
      {"orders 1 and 3",
       {"a", "b", "c"},
       {"{inertia: 0.8}", "{inertia: 2.0}", "{inertia: 1.3}"},
       {{"m", formula("a", "2*cos(3*t)-0.3*w{a}")},
        {"l", formula("c", "-0.4*w{c}-0.1*w{c}^3")},
        {"x", input("b", "u", "hold: first_order_lag, time_constant: 0.05")}},
       {{"p", psi(1, "w{b}-0.5*w{a}")},
        {"q", psi(3, "0.04*(j{c}-0.5*j{a})+0.4*(e{c}-0.5*e{a})+w{c}-(0.5+0.1*sin(t))*w{a}")}},
       {},
       {1.0, 0.5, 0.5},
       {{0.5, {{"u", 3.0}}}}});
  return list;
}

/// The run of a scene with its lists in some order, its columns in the first order of shafts.
Run playIn(const Lists& lists, const Order& shafts, const Order& torques, const Order& constraints,
           const Order& couplings, const std::string& principle, StepperKind stepper,
           double tolerance, const std::vector<double>& times, Scene* played = nullptr) {
  const Scene scene =
      withFewSteps(sceneFromText(lists.write(shafts, torques, constraints, couplings) +
                                 "principle: " + principle + "\n"),
                   stepper, tolerance);
  std::vector<TimedCommand> commands;
  for (const auto& [time, values] : lists.commands) {
    for (int i = 0; i < scene.inputCount(); ++i) {
      const auto value = values.find(scene.inputs[static_cast<std::size_t>(i)].topic);
      if (value != values.end()) commands.push_back({time, i, value->second});
    }
  }
  test::Run run = play(scene, times, commands);
  for (Sample& sample : run.samples) {
    const Sample as_played = sample;
    for (std::size_t place = 0; place < shafts.size(); ++place) {
      const auto i = static_cast<std::size_t>(shafts[place]);
      sample.angle[i] = as_played.angle[place];
      sample.velocity[i] = as_played.velocity[place];
      sample.acceleration[i] = as_played.acceleration[place];
    }
  }
  if (played != nullptr) *played = scene;
  return run;
}

TEST(Permutations, OfLists) {
  Hazard hazards[] = {
      {"permutations", "of the list of shafts", "every order"},
      {"permutations", "of the list of torques, timeouts of one instant", "every order"},
      {"permutations", "of the list of constraints", "every order"},
      {"permutations", "of the couplings of inertia", "every order"}};
  const std::vector<double> times = {0.2, 0.4, 0.5, 0.8, 0.81, 1.0, 1.3, 2.0, 3.0};
  for (const Lists& lists : scenes()) {
    for (const char* principle : kPrinciples) {
      for (StepperKind stepper : kAdaptiveSteppers) {
        for (double tolerance : {1e-5, 1e-9}) {
          const Order all[] = {identity(lists.shafts.size()), identity(lists.torques.size()),
                               identity(lists.constraints.size()),
                               identity(lists.couplings.size())};
          Scene scene;
          const test::Run first = playIn(lists, all[0], all[1], all[2], all[3], principle, stepper,
                                         tolerance, times, &scene);
          if (!takes(scene, stepper)) continue;
          EXPECT_EQ(first.reason, StopReason::kNone) << lists.name << ": " << first.message;
          for (int list = 0; list < 4; ++list) {
            Order order = all[list];
            int n = 0;
            while (std::next_permutation(order.begin(), order.end())) {
              // The brief form takes every ninth of the 120 orders of five torques.
              if (n++ % sizeOf(all[list].size() > 3 ? 9 : 2, 1) != 0) continue;
              const test::Run run =
                  playIn(lists, list == 0 ? order : all[0], list == 1 ? order : all[1],
                         list == 2 ? order : all[2], list == 3 ? order : all[3], principle, stepper,
                         tolerance, times);
              std::string label = lists.name + ", " + principle + ", order";
              for (int i : order) label += " " + std::to_string(i);
              label += " " + describe(stepper, tolerance);
              EXPECT_EQ(run.reason, first.reason) << label << ": " << run.message;
              hazards[list].compare(run, first, scene, label, kAFew, Columns::kAll);
            }
          }
        }
      }
    }
  }
}

/// Rows of a file of commands in any order, but for the order of two rows of one instant and one
/// topic (of which the last counts): the same bits.
TEST(Permutations, OfCommandsOfOneInstant) {
  Hazard hazard("permutations", "of the rows of a command file, differences",
                "3 inputs, jumps and ramps, some repeated");
  const std::vector<double> times = {0.2, 0.3, 0.5, 0.6, 0.8, 1.5};
  struct Row {
    double time;
    std::string topic;
    double value;
  };
  const std::vector<Row> rows = {
      {0.3, "u", 9.0}, {0.3, "v", 5.0},  {0.3, "w", -3.0}, {0.3, "u", 8.0},  {0.6, "v", -6.0},
      {0.6, "w", 4.0}, {0.6, "u", -2.0}, {0.6, "v", 7.0},  {0.6, "v", -5.0}, {0.0, "u", 2.0},
      {0.0, "w", 1.0}, {0.9, "u", 0.0},  {0.9, "v", 0.0},  {0.9, "w", 0.0}};
  std::mt19937 generator(7);
  const int shuffles = sizeOf(12, 200);
  for (const char* keys : {"hold: zero_order", "hold: rate_limit, rate: 60",
                           "hold: first_order_lag, time_constant: 0.01"}) {
    for (const char* principle : kPrinciples) {
      const Scene plain = sceneFromText(
          std::string("shafts: [a, b]\na: {inertia: 0.8}\nb: {inertia: 2}\n"
                      "torques: [x, y, z, d]\nx: ") +
          input("a", "u", "initial: 0") + "\ny: " + input("b", "v", "initial: 1") +
          "\nz: " + input("a", "w", keys) + "\nd: " + formula("a", "-0.5*w1") +
          "\nconstraints: [p]\np: " + psi(2, "0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2))+w2-0.6*w1") +
          "\ninitial: {velocity: [1, 0.6]}\nprinciple: " + principle + "\n");
      for (StepperKind stepper : steppersOf(plain)) {
        const Scene scene = withFewSteps(plain, stepper, 1e-7);
        test::Run first;
        for (int shuffle = 0; shuffle < shuffles; ++shuffle) {
          std::vector<Row> shuffled = rows;
          if (shuffle > 0) std::shuffle(shuffled.begin(), shuffled.end(), generator);
          // Rows of one instant and topic keep their order among themselves.
          std::map<std::pair<double, std::string>, std::size_t> taken;
          for (Row& row : shuffled) {
            std::size_t& from = taken[{row.time, row.topic}];
            while (rows[from].time != row.time || rows[from].topic != row.topic) ++from;
            row.value = rows[from++].value;
          }
          std::string file = "time,topic,value\n";
          for (const Row& row : shuffled) {
            file += plainly(row.time) + "," + row.topic + "," + plainly(row.value) + "\n";
          }
          std::vector<TimedCommand> commands;
          for (const variator_sim::TimedCommand& row : readCommandText(file, "test")) {
            int i = 0;
            while (scene.inputs[static_cast<std::size_t>(i)].topic != row.topic) ++i;
            commands.push_back({row.time, i, row.value});
          }
          const test::Run run = play(scene, times, commands);
          const std::string label = std::string(keys) + " " + principle + " " + toString(stepper) +
                                    ", shuffle " + std::to_string(shuffle);
          EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
          if (shuffle == 0) {
            first = run;
            continue;
          }
          int differences = run.samples.size() != first.samples.size();
          for (std::size_t n = 0; n < std::min(run.samples.size(), first.samples.size()); ++n) {
            for (int i = 0; i < 2; ++i) {
              differences += run.samples[n].angle[i] != first.samples[n].angle[i];
              differences += run.samples[n].velocity[i] != first.samples[n].velocity[i];
              differences += run.samples[n].acceleration[i] != first.samples[n].acceleration[i];
              differences +=
                  run.samples[n].reaction_torque[i] != first.samples[n].reaction_torque[i];
            }
          }
          hazard.judge(differences, label, 0.5);
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
