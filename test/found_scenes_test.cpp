// Scenes in which the program was once wrong, endless or stopped without need (test/found), against
// the right values of test/found_scenes.yaml. Each is played in a process of its own, which may
// take 5 s.
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim::test {
namespace {

/// The allowed relative error: a hundred times the tolerance of 1e-9.
constexpr double kAllowed = 1e-7;

struct Value {
  double time;
  std::string column;  ///< SHAFT/QUANTITY
  double value;
  double allowed;
};

struct Found {
  std::string name;
  std::vector<Value> values;
  std::string torque;
  double velocity = 0.0;
  std::string commands;
  std::string keys;
  double chatters_until = -1.0;
  std::string fault;
};

void PrintTo(const Found& found, std::ostream* out) {
  *out << found.name;
}

/// The rows of test/found_scenes.yaml, which says what they hold.
std::vector<Found> readFound() {
  const ParameterTree file = readYamlFile(VARIATOR_SIM_TEST_DIR "/found_scenes.yaml");
  std::vector<Found> all;
  for (const ParameterTree& row : file.asDictionary().at("found").asList()) {
    ParameterReader reader(row, "found");
    Found found;
    found.name = reader.text("name");
    found.torque = reader.text("torque", "");
    found.velocity = reader.number("velocity", Range::any(), 0.0);
    found.commands = reader.text("commands", "");
    for (const std::string& line : split(reader.text("keys", ""), " / ")) found.keys += line + "\n";
    found.chatters_until = reader.number("chatters_until", Range::any(), -1.0);
    found.fault = reader.text("fault", "");
    const ParameterTree* const values = reader.raw("values");
    for (const ParameterTree& value : values->asList()) {
      const ParameterTree::List& cells = value.asList();
      found.values.push_back({cells.at(0).asReal(), cells.at(1).asText(), cells.at(2).asReal(),
                              cells.size() > 3 ? cells[3].asReal() : kAllowed});
    }
    reader.finish();
    all.push_back(found);
  }
  return all;
}

std::string pathOf(const std::string& file) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/found/" + file;
}

Scene sceneOf(const Found& found) {
  if (found.torque.empty()) return sceneFromFile(pathOf(found.name + ".yaml"));
  return sceneFromText(
      "shafts: [a]\na: {inertia: 1.0}\ntorques: [q]\n"
      "q: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" +
      found.torque + "\"}\ninitial: {velocity: [" + std::to_string(found.velocity) + "]}\n" +
      found.keys);
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
  const std::string file = pathOf(found.name + ".csv");
  if (!found.commands.empty()) {
    commands = readCommandText("time,topic,value\n" + found.commands + "\n", "commands");
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
  if (!found.fault.empty()) {
    EXPECT_NE(simulation.describeStatus().find(found.fault), std::string::npos)
        << simulation.describeStatus();
  } else if (simulation.status().reason != StopReason::kChattering ||
             simulation.status().time > found.chatters_until) {
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

std::string nameOf(const testing::TestParamInfo<Found>& of) {
  std::string name = of.param.name;
  name.erase(0, name.rfind('/') + 1);
  for (char& c : name) c = c == '.' ? '_' : c;
  return name;
}

INSTANTIATE_TEST_SUITE_P(Test, FoundScene, testing::ValuesIn(readFound()), nameOf);

/// A brake on a shaft of its own changes nothing, but its scene is stepped by its program alone.
class FoundTorque : public testing::TestWithParam<Found> {
 public:
  static std::vector<Found> all() {
    std::vector<Found> made;
    for (const Found& found : readFound()) {
      const bool goes_on = found.fault.empty() && found.chatters_until < 0.0;
      if (!found.torque.empty() && goes_on) made.push_back(found);
    }
    return made;
  }
};

TEST_P(FoundTorque, IsRightBesideABrake) {
  for (const char* principle : {"gauss", "generalized_gauss"}) {
    inChild([&] {
      const Found& found = GetParam();
      std::string keys;
      for (const std::string& line : split(found.keys, "\n"))
        if (line.rfind("principle", 0) != 0) keys += line + "\n";
      play(found,
           sceneFromText(
               "shafts: [a, spare]\na: {inertia: 1.0}\nspare: {inertia: 1.0}\n"
               "torques: [q, brake]\nbrake: {type: variator_sim/Brake, shaft: spare, "
               "capacity: 5}\nq: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" +
               found.torque + "\"}\ninitial: {velocity: [" + std::to_string(found.velocity) +
               ", 0]}\nprinciple: " + principle + "\n" + keys));
    });
  }
}

INSTANTIATE_TEST_SUITE_P(Test, FoundTorque, testing::ValuesIn(FoundTorque::all()), nameOf);

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
