// Scenes against the right values of their rows: those in which the program was once wrong, endless
// or stopped without need (test/found_scenes.yaml), and those whose motion or stop is known
// (test/known_motions.yaml). Each is played in a process of its own, which may take 5 s, or 30 s by
// steppers that a row names.
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/io/command_file.h"

namespace variator_sim::test {
namespace {

/// The allowed relative error: a hundred times the tolerance of 1e-9; less where a row says by
/// which steppers.
constexpr double kAllowed = 1e-7;
constexpr double kAllowedByStepper = 1.4e-8;
/// The largest reaction of a free shaft there, N m.
constexpr double kNoReaction = 1e-5;

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
  std::string shafts;
  std::vector<std::string> elements;
  std::string commands;
  std::string keys;
  std::vector<std::string> by;
  double chatters_until = -1.0;
  std::vector<std::string> fault;
  std::vector<std::string> lacks;
  double end = 1.0;
  std::vector<double> stops_at;  ///< time and what it may be off, s
  std::string file;
  std::vector<double> tolerances;
  int most_steps = 20000;
};

/// The words between " | " of a key; none where it is missing.
std::vector<std::string> wordsOf(ParameterReader& reader, const char* key) {
  const std::string text = reader.text(key, "");
  return text.empty() ? std::vector<std::string>() : split(text, " | ");
}
/// The lines between " / " of a key.
std::string linesOf(ParameterReader& reader, const char* key) {
  std::string lines;
  for (const std::string& line : split(reader.text(key, ""), " / ")) lines += line + "\n";
  return lines;
}
std::vector<double> numbersOf(ParameterReader& reader, const char* key) {
  std::vector<double> numbers;
  if (!reader.has(key)) return numbers;
  for (const ParameterTree& number : reader.raw(key)->asList()) numbers.push_back(number.asReal());
  return numbers;
}
std::vector<std::string> textsOf(ParameterReader& reader, const char* key) {
  std::vector<std::string> texts;
  if (!reader.has(key)) return texts;
  for (const ParameterTree& text : reader.raw(key)->asList()) texts.push_back(text.asText());
  return texts;
}

void PrintTo(const Found& found, std::ostream* out) {
  *out << found.name;
}

/// The rows of a file; that of found_scenes.yaml says what they hold.
std::vector<Found> readFound(const std::string& name) {
  const ParameterTree file = readYamlFile(VARIATOR_SIM_TEST_DIR "/" + name);
  std::vector<Found> all;
  for (const ParameterTree& row : file.asDictionary().at("found").asList()) {
    ParameterReader reader(row, "found");
    Found found;
    found.name = reader.text("name");
    found.torque = reader.text("torque", "");
    found.velocity = reader.number("velocity", Range::any(), 0.0);
    found.shafts = reader.text("shafts", "");
    found.elements = textsOf(reader, "elements");
    found.commands = reader.has("commands") ? linesOf(reader, "commands") : "";
    found.keys = linesOf(reader, "keys");
    found.by = textsOf(reader, "by");
    found.chatters_until = reader.number("chatters_until", Range::any(), -1.0);
    found.fault = wordsOf(reader, "fault");
    found.lacks = wordsOf(reader, "lacks");
    const double allowed = found.by.empty() ? kAllowed : kAllowedByStepper;
    if (reader.has("values")) {
      for (const ParameterTree& value : reader.raw("values")->asList()) {
        const ParameterTree::List& cells = value.asList();
        found.values.push_back({cells.at(0).asReal(), cells.at(1).asText(), cells.at(2).asReal(),
                                cells.size() > 3 ? cells[3].asReal() : allowed});
      }
      if (!found.values.empty()) found.end = found.values.back().time;
    }
    found.end = reader.number("end", Range::any(), found.end);
    found.stops_at = numbersOf(reader, "stops_at");
    found.file = reader.text("file", "");
    found.tolerances = numbersOf(reader, "tolerances");
    found.most_steps = static_cast<int>(
        reader.number("most_steps", Range::any(), static_cast<double>(found.most_steps)));
    reader.finish();
    all.push_back(found);
  }
  return all;
}

std::string pathOf(const std::string& file) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/found/" + file;
}

Scene sceneOf(const Found& found) {
  if (!found.file.empty()) return sceneFromFile(VARIATOR_SIM_TEST_DIR "/" + found.file);
  if (!found.shafts.empty()) return sceneFromText(found.shafts, found.elements, found.keys);
  if (found.torque.empty()) return sceneFromFile(pathOf(found.name + ".yaml"));
  return sceneFromText(
      "shafts: [a]\na: {inertia: 1.0}\ntorques: [q]\n"
      "q: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" +
      found.torque + "\"}\ninitial: {velocity: [" + std::to_string(found.velocity) + "]}\n" +
      found.keys);
}

/// A column of the state, or one of the quantities as `simulate` names them.
double read(Simulation& simulation, const std::string& column) {
  const Scene& scene = simulation.scene();
  const Sample& sample = simulation.sample();
  const std::size_t slash = column.find('/');
  const std::map<std::string, const double*> columns = {
      {"velocity", sample.velocity},
      {"angle", sample.angle},
      {"acceleration", sample.acceleration},
      {"applied_torque", sample.applied_torque},
      {"reaction_torque", sample.reaction_torque}};
  const auto values = columns.find(column.substr(slash + 1));
  for (std::size_t i = 0; values != columns.end() && i < scene.shafts.size(); ++i) {
    if (scene.shafts[i] == column.substr(0, slash)) return values->second[i];
  }
  for (std::size_t i = 0; i < scene.constraints.size(); ++i) {
    if (column == scene.constraints[i]->name() + "/residual") return sample.residual[i];
  }
  for (const QuantityGroup group : kQuantityGroups) {
    const std::vector<std::string>& names = simulation.quantityNames(group);
    const bool is_plain = group == QuantityGroup::kElements;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (column != (is_plain ? "" : std::string(toString(group)) + "/") + names[i]) continue;
      std::vector<double> quantities(names.size());
      simulation.calcQuantities(group, quantities.data());
      return quantities[i];
    }
  }
  return NAN;
}

void expectWords(const Found& found, const std::string& told) {
  for (const std::string& word : found.fault) EXPECT_NE(told.find(word), std::string::npos) << told;
  for (const std::string& word : found.lacks) EXPECT_EQ(told.find(word), std::string::npos) << told;
}

void play(const Found& found, Scene scene) {
  std::vector<TimedCommand> commands;
  const std::string file = pathOf(found.name + ".csv");
  if (!found.commands.empty()) {
    commands = readCommandText("time,topic,value\n" + found.commands, "commands");
  } else if (std::filesystem::exists(file)) {
    commands = readCommandFile(file);
  }
  scene.solver.machine_code = MachineCode::kNever;
  Simulation simulation(scene);
  std::size_t next = 0;
  for (std::size_t n = 0; n <= found.values.size() && simulation.status().ok(); ++n) {
    const double time = n < found.values.size() ? found.values[n].time : found.end;
    for (; next < commands.size() && commands[next].time <= time; ++next) {
      simulation.advanceTo(commands[next].time);
      for (int input = 0; input < scene.inputCount(); ++input) {
        if (scene.inputs[static_cast<std::size_t>(input)].topic != commands[next].topic) continue;
        simulation.command(input, commands[next].value);
      }
    }
    if (!simulation.advanceTo(time).ok() || n == found.values.size()) break;
    const auto& [at, column, value, allowed] = found.values[n];
    EXPECT_NEAR(read(simulation, column), value, allowed * (1.0 + std::abs(value)))
        << column << " at " << at << " s";
    if (!found.by.empty() && !found.torque.empty()) {
      EXPECT_NEAR(simulation.sample().reaction_torque[0], 0.0, kNoReaction) << at;
    }
  }
  const std::string told = simulation.describeStatus();
  expectWords(found, told);
  if (!found.stops_at.empty()) {
    EXPECT_NEAR(simulation.status().time, found.stops_at[0], found.stops_at[1]) << told;
  }
  if (!found.fault.empty()) {
    EXPECT_FALSE(simulation.status().ok());
  } else if (simulation.status().reason != StopReason::kChattering ||
             simulation.status().time > found.chatters_until) {
    EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  }
  // (Explicit steps may have to be short where a row names them and no number.)
  const bool is_named = !found.by.empty() && scene.solver.stepper != StepperKind::kAuto;
  if (is_named && found.most_steps == Found().most_steps) return;
  const Statistics& statistics = simulation.statistics();
  EXPECT_LT(statistics.steps + statistics.rejected_steps,
            static_cast<std::uint64_t>(found.most_steps));
}

/// A run that exceeds so many seconds of its process' time fails, and the next test goes on.
void inChild(const std::function<void()>& body, int seconds = 5) {
  std::fflush(nullptr);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const itimerval timer{{0, 0}, {seconds, 0}};
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

INSTANTIATE_TEST_SUITE_P(Test, FoundScene, testing::ValuesIn(readFound("found_scenes.yaml")),
                         nameOf);

constexpr StepperKind kSteppers[] = {
    StepperKind::kAuto,       StepperKind::kTaylor, StepperKind::kRadau,      StepperKind::kDopri5,
    StepperKind::kFehlberg78, StepperKind::kRk4,    StepperKind::kTaylorFixed};

/// By the steppers and principles of its row.
class KnownMotion : public testing::TestWithParam<Found> {};

/// Plays a row once; tolerance 0: that of its scene.
void playRow(const Found& row, const std::string& stepper, double tolerance) {
  try {
    Scene scene = sceneOf(row);
    for (const StepperKind kind : kSteppers) {
      if (stepper == toString(kind)) scene.solver.stepper = kind;
    }
    play(row, tolerance > 0.0 ? withTolerance(scene, tolerance) : scene);
  } catch (const SceneError& error) {
    EXPECT_FALSE(row.fault.empty()) << error.what();
    expectWords(row, error.what());
  }
}

TEST_P(KnownMotion, IsRight) {
  const Found& found = GetParam();
  const bool has_principle =
      !found.file.empty() || found.keys.find("principle: ") != std::string::npos;
  std::vector<double> tolerances = found.tolerances;
  if (tolerances.empty()) tolerances.push_back(0.0);
  for (const std::string& stepper : found.by) {
    for (const double tolerance : tolerances) {
      for (const char* principle : {"gauss", "generalized_gauss"}) {
        SCOPED_TRACE(stepper + ", " + principle + ", " + plainly(tolerance));
        Found row = found;
        if (!has_principle) row.keys += std::string("principle: ") + principle + "\n";
        inChild([&] { playRow(row, stepper, tolerance); }, 30);
        if (has_principle) break;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Test, KnownMotion, testing::ValuesIn(readFound("known_motions.yaml")),
                         nameOf);

/// A brake on a shaft of its own changes nothing, but its scene is stepped by its program alone.
class FoundTorque : public testing::TestWithParam<Found> {
 public:
  static std::vector<Found> all() {
    std::vector<Found> made;
    for (const Found& found : readFound("found_scenes.yaml")) {
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
