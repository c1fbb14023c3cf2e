#include "emit_fmu/emit_fmu.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

#include "expression/series_dot.h"
#include "expression/series_text.h"
#include "motion_program/c_text.h"
#include "motion_program/motion_program.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/units.h"

namespace variator_sim {

namespace {

using expression::Node;
using expression::slotOf;
using expression::Source;

std::string asJson(const std::string& text) {
  std::string made = "\"";
  for (const char c : text) {
    char escape[8];
    const auto code = static_cast<unsigned char>(c);
    std::snprintf(escape, sizeof escape, "\\u%04x", code);
    made += code < ' ' || c == '"' || c == '\\' ? escape : std::string(1, c);
  }
  return made + "\"";
}

/// A value that is computed for the importer alone.
struct Shown {
  std::string name;
  std::string unit;
  Node node;
};

/// Lists the quantities of elements, but of those that hold, and the scene's outputs.
std::vector<Shown> listShown(const Scene& scene) {
  expression::Graph& graph = *scene.graph;
  std::vector<Shown> made;
  const auto addOutputs = [&made](const auto& element) {
    const NamedOutputs& outputs = element.outputs();
    for (std::size_t n = 0; n < outputs.names().size(); ++n) {
      made.push_back({element.name() + "/" + outputs.names()[n], "", outputs.nodes()[n]});
    }
  };
  for (const TorquePtr& element : scene.torques) {
    Node power = graph.constant(0.0);
    for (const auto& [i, torque] : element->torques()) {
      if (!element->holdings().empty()) continue;
      const std::string& shaft = scene.shafts[static_cast<std::size_t>(i)];
      made.push_back({element->name() + "/" + shaft + "/torque", "N m", torque});
      const Node velocity = graph.variable(slotOf(Source::kVelocity, i));
      power = graph.add(power, graph.multiply(torque, velocity));
    }
    if (element->holdings().empty()) made.push_back({element->name() + "/power", "W", power});
    addOutputs(*element);
  }
  for (const ConstraintPtr& constraint : scene.constraints) addOutputs(*constraint);
  for (const Output& output : scene.outputs) {
    if (output.readsPrinciple()) {
      throw SceneError(output.name(),
                       "reads how the reactions change (G_SHAFT, Z), which an FMU does not tell; "
                       "allowed: formulas of the state");
    }
    made.push_back({"outputs/" + output.name(), output.unit(), output.node()});
  }
  return made;
}

std::vector<Node> nodesOf(const std::vector<Shown>& shown) {
  std::vector<Node> nodes;
  nodes.reserve(shown.size());
  for (const Shown& it : shown) nodes.push_back(it.node);
  return nodes;
}

/// Writes the variables in the order of their value references (runtime/fmu.h).
class Variables {
 public:
  void add(const char* kind, const std::string& name, const std::string& unit,
           const std::string& more = "") {
    text_ += (text_.empty() ? "" : ",\n") + std::string("{\"kind\": \"") + kind +
             "\", \"name\": " + asJson(name) + ", \"unit\": " + asJson(unit) + more + "}";
  }
  void addStart(const char* kind, const std::string& name, const std::string& unit, double start,
                const std::string& more = "") {
    add(kind, name, unit, ", \"start\": " + literalOf(start) + more);
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class FmuWriter {
 public:
  FmuWriter(Simulation& simulation, int version)
      : simulation_(simulation),
        scene_(simulation.scene()),
        version_(version),
        shown_(listShown(scene_)),
        program_(scene_, nodesOf(shown_)) {
    program_.requireSteps();
  }

  std::string write(const std::string& name, const std::string& title) {
    const std::string source = writeSource();
    std::uint64_t sum = 14695981039346656037ULL;  // FNV-1a
    for (const char c : source) sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
    char token[40];
    std::snprintf(token, sizeof token, "{variator_sim-%016llx}",
                  static_cast<unsigned long long>(sum));
    std::string complete = source;
    replaceAll(complete, "@TOKEN@", token);
    std::string shafts;
    for (const std::string& shaft : scene_.shafts) {
      shafts += (shafts.empty() ? "" : ", ") + asJson(shaft);
    }
    return "{\"version\": " + std::to_string(version_) + ", \"name\": " + asJson(name) +
           ", \"title\": " + asJson(title) + ", \"token\": " + asJson(token) +
           ", \"fuses\": " + (expression::fusesProducts() ? "true" : "false") +
           ",\n\"tolerance\": " + literalOf(scene_.solver.relative_tolerance) + ", \"shafts\": [" +
           shafts + "],\n\"units\": {" + writeUnits() + "},\n\"variables\": [" + writeVariables() +
           "],\n\"source\": " + asJson(complete) + "}\n";
  }

 private:
  /// Writes the scene's outputs' own units: a factor and exponents of kg, m, s, A, K, rad.
  std::string writeUnits() const {
    std::string text;
    for (const std::string& name : unitsUsed()) {
      const auto read = readUnit(name);
      if (!read || !read->unknown.empty()) continue;
      text += (text.empty() ? "" : ", ") + asJson(name) + ": [" +
              literalOf(read->unit.numerator / read->unit.denominator);
      for (const int exponent : read->unit.dimension) text += ", " + std::to_string(exponent);
      if (read->unit.zero != 0.0) text += ", " + literalOf(read->unit.zero);
      text += "]";
    }
    return text;
  }
  std::vector<std::string> unitsUsed() const {
    std::vector<std::string> names = {"s", "rad", "rad/s", "rad/s^2", "N m", "N m/s", "W", "J"};
    for (const Output& it : scene_.outputs) {
      if (!it.unit().empty() && std::find(names.begin(), names.end(), it.unit()) == names.end()) {
        names.push_back(it.unit());
      }
    }
    return names;
  }

  std::string writeVariables() const {
    Variables made;
    made.add("time", "time", "s");
    const std::pair<const char*, const char*> kOfShafts[] = {
        {"angle", "rad"},          {"velocity", "rad/s"},      {"acceleration", "rad/s^2"},
        {"applied_torque", "N m"}, {"reaction_torque", "N m"}, {"reaction_torque_rate", "N m/s"}};
    for (const auto& [quantity, unit] : kOfShafts) {
      const bool is_state = std::string(unit) == "rad" || std::string(unit) == "rad/s";
      for (const std::string& shaft : scene_.shafts) {
        made.add(is_state ? "state" : "output", shaft + "/" + quantity, unit);
      }
    }
    for (const char* quantity : {"/residual", "/multiplier"}) {
      for (const ConstraintPtr& it : scene_.constraints)
        made.add("output", it->name() + quantity, "");
    }
    const std::pair<const char*, const char*> kOfHolds[] = {
        {"/torque", "N m"}, {"/slip", "rad/s"}, {"/reserve", "N m"}, {"/heat", "J"}};
    for (const std::string& hold : program_.holdNames()) {
      for (const auto& [quantity, unit] : kOfHolds) made.add("output", hold + quantity, unit);
    }
    addMemory("output", "", made);
    for (const Shown& it : shown_) made.add("output", it.name, it.unit);
    addParameters(made);
    for (const CommandInputSettings& it : scene_.inputs) {
      if (it.kind != InputKind::kCommanded) continue;
      const auto limit = [](const char* key, double value) {
        return std::isinf(value) ? "" : std::string(", \"") + key + "\": " + literalOf(value);
      };
      made.addStart("input", "inputs/" + it.name, "", it.initial,
                    limit("min", it.minimum) + limit("max", it.maximum));
    }
    for (const std::string& hold : program_.holdNames()) made.add("mode", hold + "/mode", "");
    return made.text();
  }
  /// Adds states, and then variables.
  void addMemory(const char* kind, const std::string& prefix, Variables& made) const {
    for (const SceneState& it : scene_.states) {
      const CommandInputSettings& state = scene_.inputs[static_cast<std::size_t>(it.input)];
      made.addStart(kind, prefix + "states/" + state.name, "", state.initial);
    }
    for (const CommandInputSettings& it : scene_.inputs) {
      if (it.kind != InputKind::kVariable) continue;
      made.addStart(kind, prefix + "variables/" + it.name, "", it.initial);
    }
  }
  void addParameters(Variables& made) const {
    for (std::size_t i = 0; i < scene_.shafts.size(); ++i) {
      made.addStart("parameter", "initial/" + scene_.shafts[i] + "/angle", "rad",
                    scene_.initial.angle[i]);
    }
    for (std::size_t i = 0; i < scene_.shafts.size(); ++i) {
      made.addStart("parameter", "initial/" + scene_.shafts[i] + "/velocity", "rad/s",
                    scene_.initial.velocity[i]);
    }
    addMemory("parameter", "initial/", made);
  }

  /// Writes the state that the motion goes on from, if another one than the program has found it.
  std::string writeStart() {
    const auto shafts = static_cast<std::size_t>(scene_.shaftCount());
    const auto constraints = static_cast<std::size_t>(scene_.constraintCount());
    const bool is_settled = scene_.holdNames().empty() && !scene_.hasMemory();
    std::vector<double> angle = scene_.initial.angle, velocity = scene_.initial.velocity,
                        acceleration(shafts), reaction(shafts), multiplier(constraints),
                        longest(constraints);
    if (is_settled) {
      // (Under `gauss` the reaction of the first instant is in no history.)
      const Sample first = simulation_.sample();
      MotionState state;
      if (!simulation_.saveState(&state)) throw SceneError("", simulation_.describeStatus());
      angle.assign(state.angle, state.angle + shafts);
      velocity.assign(state.velocity, state.velocity + shafts);
      acceleration.assign(state.acceleration, state.acceleration + shafts);
      reaction.assign(state.history.kept_reaction.value,
                      state.history.kept_reaction.value + shafts);
      if (scene_.principle == Principle::kGauss) {
        multiplier.assign(first.multiplier, first.multiplier + constraints);
      }
      longest.assign(state.history.longest_row, state.history.longest_row + constraints);
    } else if (!scene_.initial.acceleration.empty()) {
      acceleration = scene_.initial.acceleration;
    }
    return "enum { FMU_IS_SETTLED = " + std::to_string(is_settled ? 1 : 0) + " };\n" +
           arrayOf("double", "initial_angle", angle) +
           arrayOf("double", "initial_velocity", velocity) +
           arrayOf("double", "initial_acceleration", acceleration) +
           arrayOf("double", "initial_reaction", reaction) +
           arrayOf("double", "initial_multiplier", multiplier) +
           arrayOf("double", "initial_longest", longest);
  }

  std::string writeConstants() {
    std::vector<double> parameter = scene_.initial.angle;
    parameter.insert(parameter.end(), scene_.initial.velocity.begin(),
                     scene_.initial.velocity.end());
    std::vector<int> command;
    for (const SceneState& it : scene_.states) {
      parameter.push_back(scene_.inputs[static_cast<std::size_t>(it.input)].initial);
    }
    for (int i = 0; i < scene_.inputCount(); ++i) {
      const CommandInputSettings& it = scene_.inputs[static_cast<std::size_t>(i)];
      if (it.kind == InputKind::kVariable) parameter.push_back(it.initial);
      if (it.kind == InputKind::kCommanded) command.push_back(i);
    }
    return "enum {\n  FMU_PARAMETERS = " + std::to_string(parameter.size()) +
           ",\n  FMU_COMMANDS = " + std::to_string(command.size()) +
           ",\n  FMU_ROWS = " + std::to_string(shown_.size()) + "\n};\n" +
           arrayOf("double", "fmu_parameter", parameter) + arrayOf("int", "fmu_command", command) +
           arrayOf("int", "fmu_row", program_.rowsOf(nodesOf(shown_)).values) +
           "static const long fmu_most_steps = " + std::to_string(scene_.solver.maximum_steps) +
           ";\nstatic const char fmu_token[] = \"@TOKEN@\";\n";
  }

  std::string writeSource() {
    return std::string("#include <float.h>\n#include <math.h>\n#include <stdio.h>\n") +
           "#include <stdlib.h>\n#include <string.h>\n\n" + expression::arithmeticOfCode() +
           "#define VS_FUNCTION static __attribute__((unused))\n#define VS_FUNCTION_INLINE "
           "VS_INLINE\n#define VS_FUNCTION_RARE VS_RARE\n" +
           program_.writeExtents() + kSceneHeader +
           program_.writeMotion(expression::kOperationsText, false) + kExchangeData + kExchange +
           kCommands + kHost + "\n" + writeConstants() + writeStart() + kFmu +
           (version_ == 2 ? kFmi2 : kFmi3);
  }

  Simulation& simulation_;
  const Scene& scene_;
  const int version_;
  const std::vector<Shown> shown_;
  const MotionProgram program_;
};

}  // namespace

std::string describeFmu(Simulation& simulation, int version, const std::string& name,
                        const std::string& title) {
  return orRefuse("cannot be written as C", [&] {
    simulation.scene().refuseDelays(kNoPast);
    return FmuWriter(simulation, version).write(name, title);
  });
}

}  // namespace variator_sim
