#include "emit_c/emit_c.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "io/text_file.h"
#include "motion_program/c_text.h"
#include "motion_program/motion_program.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

namespace fs = std::filesystem;

std::string holdOf(const CommandInputSettings& input) {
  std::string text = toString(input.hold);
  if (input.hold != Hold::kZeroOrder) {
    text += ", " + formatReal(input.hold_parameter) +
            (input.hold == Hold::kRateLimit ? " per s" : " s");
  }
  if (input.timeout > 0.0) {
    text += std::string("; ") + (input.on_timeout == OnTimeout::kZero ? "0" : "held") + " after " +
            formatReal(input.timeout) + " s without a command";
  }
  return text;
}

std::string tablesOf(const Scene& scene) {
  std::string text = "| index | shaft |\n|---|---|\n";
  int index = 0;
  for (const std::string& shaft : scene.shafts) {
    text += "| " + std::to_string(index++) + " | " + shaft + " |\n";
  }
  index = 0;
  const auto takes_commands = [](const auto& it) { return it.kind == InputKind::kCommanded; };
  if (std::any_of(scene.inputs.begin(), scene.inputs.end(), takes_commands)) {
    text += "\n| input | topic | first value | clamped to | hold |\n|---|---|---|---|---|\n";
  }
  for (const CommandInputSettings& input : scene.inputs) {
    const int own = index++;
    if (!takes_commands(input)) continue;
    text += "| " + std::to_string(own) + " | " + input.topic + " | " + formatReal(input.initial) +
            " | " + formatReal(input.minimum) + " .. " + formatReal(input.maximum) + " | " +
            holdOf(input) + " |\n";
  }
  index = 0;
  if (!scene.constraints.empty()) text += "\n| constraint | name | order |\n|---|---|---|\n";
  for (const ConstraintPtr& constraint : scene.constraints) {
    text += "| " + std::to_string(index++) + " | " + constraint->name() + " | " +
            std::to_string(constraint->order()) + " |\n";
  }
  return text;
}

const char* const kUse = R"md(
Freestanding C99 of one drivetrain: `scene_@.c` and `scene_@.h` need the library of mathematics and
nothing else. Nothing is allocated, and all memory is the `scene_model` that you give.

## Try it

    make
    ./scene_play --duration 10 --rate 100 --output motion.csv
    ./scene_play --duration 10 --commands commands.csv
    ./scene_play --duration 10 --events events.csv   # changes of modes, and the scene's events

`commands.csv` has the header `time,topic,value`. The columns are those of `simulate`. The exit status
is 0, 1 when the motion stopped (the reason is on standard error), 2 for bad usage.

## In a controller

    #include "scene_@.h"

    static scene_model model;           /* some kB: not on a small stack */
    scene_sample sample;

    scene_init(&model);
    for (;;) {
      scene_command(&model, 0, demand); /* an input's index; acts from the present on */
      if (scene_step(&model, 0.001) != SCENE_OK) {
        /* stopped, at the last good state: scene_status_text tells why; scene_init begins anew */
      }
      scene_read(&model, &sample);      /* angle, velocity, acceleration, torques, .. */
    }

`model.now` is the whole state: a copy of it, written back, is a way to go on from there.
)md";

const char* const kLimits = R"md(
## Steps

At each step the motion is expanded into power series of the order `SCENE_ORDER` that the scene's tolerances
ask for (relative @RELATIVE@, absolute @ABSOLUTE@). A call makes as many parts of a step as the last
coefficients ask for, and ends one where a formula changes its branch (abs, min, max, sign, if, points
of tables). A command that jumps moves the accelerations by the jump map of `simulate`.

## Limits

- Stiff motions get implicit steps only where `principle` is `gauss`, `solver/stepper` is `auto` and no element holds:
  others cost many parts of a step, and `SCENE_TOO_MANY_STEPS` stops them at SCENE_MOST_STEPS of them in one call.
- Where a formula has no power series (sqrt(x) at x = 0) or no value it stops: `SCENE_NOT_FINITE`.
- It stops for `SCENE_CHATTERING` where a formula jumps and the motion turns back at once (dry friction
  by `sign` at rest; an element that holds does not), as `simulate` does.
- Commands at time 0 find the first accelerations anew by Newton's iteration from those of the scene.
  Where a constraint is not linear in the accelerations that is the stationary reaction nearby;
  `simulate` looks for the least of all.
- Commands that are clamped are not counted. Outputs of elements, energies and `outputs` of the scene
  are not emitted. States and variables are in `scene_sample`.
)md";

struct EmittedFile {
  std::string name;
  std::string text;
  const char* begin_comment;
  const char* end_comment;
};

/// Returns `text` with a last line that identifies files written by simulate.
std::string withSum(const EmittedFile& file, const std::string& text) {
  return text + file.begin_comment + "Written by simulate --emit-c, sum " + checksumOf(text) +
         file.end_comment + "\n";
}

/// Returns true if `path` is free, or holds an unchanged file written by simulate.
bool mayReplace(const fs::path& path, const EmittedFile& file) {
  const fs::file_type type = fs::symlink_status(path).type();
  if (type == fs::file_type::not_found) return true;
  std::string text;
  constexpr std::size_t kLongest = 1U << 28U;
  if (type != fs::file_type::regular || !readTextFile(path.string(), &text, kLongest).empty()) {
    return false;
  }
  const std::size_t last_line = text.size() < 2 ? 0 : text.rfind('\n', text.size() - 2) + 1;
  return text == withSum(file, text.substr(0, last_line));
}

/// Writes NAME_<kind>_<name> for each, without duplicates.
std::string writeEnum(const std::string& prefix, const std::vector<std::string>& names) {
  std::set<std::string> taken;
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string name = prefix + inCapitals(toIdentifier(names[i]));
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
    program_.requireText();
  }

  EmittedScene write() {
    EmittedScene made;
    made.name = name_;
    made.source = writeSource();
    made.header = writeHeader();
    std::string player = withName(kPlayer, name_);
    replaceAll(player, "\"scene.h\"", "\"" + name_ + ".h\"");
    made.main = "/* " + title_ + " */" + player;
    made.readme = writeReadme();
    made.makefile = writeMakefile();
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
           withName(program_.writeMotion(false) + kCommands + kInterface, name_);
  }

  std::string writeReadme() const {
    // (Names from the scene are not replaced: one may contain the placeholder of the scene's name.)
    const auto complete = [&](std::string text) {
      replaceAll(text, "scene_@", name_);
      replaceAll(text, "@RELATIVE@", formatReal(scene_.solver.relative_tolerance));
      replaceAll(text, "@ABSOLUTE@", formatReal(scene_.solver.absolute_tolerance));
      return withName(text, name_);
    };
    return "# " + name_ + "\n\nWritten by `simulate --emit-c` from " + title_ + ".\n" +
           complete(kUse) + "\n" + tablesOf(scene_) + complete(kLimits);
  }

  std::string writeMakefile() const {
    return "CFLAGS = -std=c99 -O2 -Wall -Wextra\n\n" + name_ + "_play: main.c " + name_ + ".c " +
           name_ + ".h\n\t$(CC) $(CFLAGS) -o $@ main.c " + name_ + ".c -lm\n\nclean:\n\trm -f " +
           name_ + "_play\n\n.PHONY: clean\n";
  }

  Simulation& simulation_;
  const Scene& scene_;
  const std::string name_;
  const std::string title_;
  const MotionProgram program_;
};

}  // namespace

void writeEmittedScene(const EmittedScene& scene, const std::string& directory) {
  const std::array<EmittedFile, 5> files{{{scene.name + ".h", scene.header, "/* ", " */"},
                                          {scene.name + ".c", scene.source, "/* ", " */"},
                                          {"main.c", scene.main, "/* ", " */"},
                                          {"README.md", scene.readme, "<!-- ", " -->"},
                                          {"Makefile", scene.makefile, "# ", ""}}};
  const fs::path folder = directory;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(directory + ": " + error.message());
  for (const EmittedFile& file : files) {
    if (mayReplace(folder / file.name, file)) continue;
    throw std::runtime_error((folder / file.name).string() +
                             ": is there and is not, or no longer, what simulate --emit-c wrote; "
                             "nothing was written. Allowed: a folder without it (--emit-c FOLDER)");
  }
  for (const EmittedFile& file : files) {
    const std::string path = (folder / file.name).string();
    const std::string reason = writeWholeFile(path, withSum(file, file.text));
    if (!reason.empty()) throw std::runtime_error(std::string(path).append(": ").append(reason));
  }
}

std::string nameForC(const std::string& scene_path) {
  std::string name = toIdentifier(std::filesystem::path(scene_path).stem().string());
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
