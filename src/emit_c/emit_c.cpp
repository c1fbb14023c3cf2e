#include "emit_c/emit_c.h"

#include <cctype>
#include <filesystem>
#include <set>
#include <utility>
#include <vector>

#include "emit_c/readme.h"
#include "expression/series_text.h"
#include "motion_program/c_text.h"
#include "motion_program/motion_program.h"
#include "variator_sim/errors.h"

namespace variator_sim {

namespace {

std::string asIdentifier(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool is_plain =
        std::isalnum(static_cast<unsigned char>(c)) != 0 && static_cast<unsigned char>(c) < 128;
    name += is_plain ? c : '_';
  }
  return name;
}

/// Writes NAME_<kind>_<name> for each, without duplicates.
std::string writeEnum(const std::string& prefix, const std::vector<std::string>& names) {
  std::set<std::string> taken;
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string name = prefix + inCapitals(asIdentifier(names[i]));
    while (!taken.insert(name).second) name += "_" + std::to_string(i);
    text += std::string(text.empty() ? "" : ", ") + name + " = " + std::to_string(i);
  }
  return text.empty() ? "" : "enum { " + text + " };\n";
}

/// The parts of one program.
class Emission {
 public:
  Emission(Simulation& simulation, std::string name, const std::string& title)
      : simulation_(simulation),
        scene_(simulation.scene()),
        name_(std::move(name)),
        title_(harmless(title)),
        program_(scene_) {
    program_.requireSteps();
  }

  EmittedScene write() {
    EmittedScene made;
    made.name = name_;
    made.source = writeSource();
    made.header = writeHeader();
    std::string player = withName(kPlayer, name_);
    replaceAll(player, "\"scene.h\"", "\"" + name_ + ".h\"");
    made.main = "/* " + title_ + " */" + player;
    made.readme = writeReadme(scene_, name_, title_);
    made.makefile = writeMakefile(name_);
    return made;
  }

 private:
  std::string writeHeader() const {
    std::vector<std::string> inputs;
    for (const CommandInputSettings& input : scene_.inputs) inputs.push_back(input.name);
    const std::string guard = inCapitals(name_) + "_H\n";
    const std::string prefix = inCapitals(name_);
    const std::string sizes =
        program_.writeExtents() + "enum { SCENE_MOST_STEPS = 10000 }; /* that one call makes */\n";
    return "/* " + title_ + ", written by `simulate --emit-c`. README.md tells more. */\n#ifndef " +
           guard + "#define " + guard + "\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n" +
           withName(sizes, name_) + "\n/* Indices of the arrays below, in the scene's order. */\n" +
           writeEnum(prefix + "_SHAFT_", scene_.shafts) +
           writeEnum(prefix + "_CONSTRAINT_", namesOf(scene_.constraints)) +
           writeEnum(prefix + "_INPUT_", inputs) +
           writeEnum(prefix + "_HOLD_", program_.holdNames()) + withName(kSceneHeader, name_) +
           "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
  }

  std::string writeNames() const {
    const auto list = [&](const char* what, std::vector<std::string> names) {
      if (std::string(what) != "shaft") names.emplace_back();
      std::string text;
      for (const std::string& name : names) {
        text += (text.empty() ? "\"" : ", \"") + harmless(name) + "\"";
      }
      return "const char *const " + name_ + "_" + what + "_name[] = {" + text + "};\n";
    };
    std::vector<std::string> topics;
    std::vector<std::string> variables;
    std::vector<std::string> states;
    for (const CommandInputSettings& input : scene_.inputs) {
      const bool takes_commands = input.kind == InputKind::kCommanded;
      topics.push_back(takes_commands ? input.topic : "");
      if (!takes_commands)
        (input.kind == InputKind::kState ? states : variables).push_back(input.name);
    }
    return list("shaft", scene_.shafts) + list("constraint", namesOf(scene_.constraints)) +
           list("input", topics) + list("hold", program_.holdNames()) + list("state", states) +
           list("variable", variables) + list("event", scene_.eventNames());
  }
  static std::vector<std::string> namesOf(const std::vector<ConstraintPtr>& constraints) {
    std::vector<std::string> names;
    names.reserve(constraints.size());
    for (const ConstraintPtr& it : constraints) names.push_back(it->name());
    return names;
  }

  std::string writeStart() {
    const Sample& sample = simulation_.sample();
    if (!simulation_.status().ok()) throw SceneError("", simulation_.describeStatus());
    const auto list = [](const char* name, const double* from, int count) {
      return arrayOf("double", name, std::vector<double>(from, from + count));
    };
    const int shafts = scene_.shaftCount();
    return list("initial_angle", sample.angle, shafts) +
           // (Before impacts of elements that hold, which scene_init makes.)
           list("initial_velocity",
                program_.TRANSMITS != 0 ? scene_.initial.velocity.data() : sample.velocity,
                shafts) +
           list("initial_acceleration", sample.acceleration, shafts) +
           list("initial_multiplier", sample.multiplier, scene_.constraintCount());
  }

  std::string writeSource() {
    return "/* " + title_ + ", written by `simulate --emit-c`. */\n#include \"" + name_ +
           ".h\"\n\n#include <float.h>\n#include <math.h>\n#include <string.h>\n\n" + writeNames() +
           "\n/* The first state */\n" + writeStart() + "\n" +
           withName(
               program_.writeMotion(expression::kOperationsText, false) + kCommands + kInterface,
               name_);
  }

  Simulation& simulation_;
  const Scene& scene_;
  const std::string name_;
  const std::string title_;
  const MotionProgram program_;
};

}  // namespace

std::string nameForC(const std::string& scene_path) {
  std::string name = asIdentifier(std::filesystem::path(scene_path).stem().string());
  const bool is_plain = !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) != 0;
  if (!is_plain) name = "scene_" + name;
  // NAME_play becomes the name of a file, too.
  constexpr std::size_t kLongest = 100;
  if (name.size() > kLongest) name.resize(kLongest);
  // main.c is another file, and the next three are headers that the source reads. Functions of the
  // runtime begin with vs_, those of the player with the others.
  std::string lower = name;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  static const std::set<std::string> taken = {"main",    "math", "float", "string",
                                              "command", "most", "vs",    "write"};
  const bool is_taken = taken.count(lower) > 0 || lower.rfind("vs_", 0) == 0;
  return is_taken ? "scene_" + name : name;
}

EmittedScene emitScene(Simulation& simulation, const std::string& name, const std::string& title) {
  return orRefuse("cannot be written as C", [&] {
    simulation.scene().refuseDelays(kNoPast);
    return Emission(simulation, name, title).write();
  });
}

}  // namespace variator_sim
