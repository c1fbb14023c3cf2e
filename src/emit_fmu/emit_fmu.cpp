#include "emit_fmu/emit_fmu.h"

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "emit_fmu/fmu_parameters.h"
#include "expression/series_dot.h"
#include "io/text_file.h"
#include "model/number_text.h"
#include "motion_program/c_text.h"
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
    const auto code = static_cast<unsigned char>(c);
    const bool is_plain = code >= ' ' && c != '"' && c != '\\';
    made += is_plain ? std::string(1, c) : printed("\\u%04x", code);
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
  for (const Law* const law : scene.laws()) {
    const auto* const torque = dynamic_cast<const Torque*>(law);
    if (torque != nullptr && law->holdings().empty()) {
      Node power = graph.constant(0.0);
      for (const auto& [i, node] : torque->torques()) {
        const std::string& shaft = scene.shafts[static_cast<std::size_t>(i)];
        made.push_back({law->name() + "/" + shaft + "/torque", "N m", node});
        const Node velocity = graph.variable(slotOf(Source::kVelocity, i));
        power = graph.add(power, graph.multiply(node, velocity));
      }
      made.push_back({law->name() + "/power", "W", power});
    }
    for (const auto& [name, node] : law->outputs()) {
      made.push_back({law->name() + "/" + name, "", node});
    }
  }
  for (const Output& output : scene.outputs) {
    if (output.reads_principle) {
      throw SceneError(output.name,
                       "reads how the reactions change (G_SHAFT, Z), which an FMU does not tell; "
                       "allowed: formulas of the state");
    }
    made.push_back({"outputs/" + output.name, output.unit, output.node});
  }
  return made;
}

std::unique_ptr<MotionProgram> makeProgram(const Scene& scene) {
  std::vector<Node> nodes;
  for (const Shown& it : listShown(scene)) nodes.push_back(it.node);
  auto made = std::make_unique<MotionProgram>(scene, nodes);
  made->requireText();
  return made;
}

class FmuWriter {
 public:
  FmuWriter(Simulation& simulation, int version)
      : simulation_(simulation),
        scene_(simulation.scene()),
        version_(version),
        shown_(listShown(scene_)),
        parameters_(scene_, makeProgram),
        program_(parameters_.program()) {}

  std::string write(const std::string& name, const std::string& title) {
    addVariables();
    const std::string source = writeSource();
    const std::string token = "{variator_sim-" + checksumOf(source) + "}";
    std::string complete = source;
    replaceAll(complete, "@TOKEN@", token);
    std::vector<std::string> shafts;
    for (const std::string& shaft : scene_.shafts) shafts.push_back(asJson(shaft));
    return "{\"version\": " + std::to_string(version_) + ", \"name\": " + asJson(name) +
           ", \"title\": " + asJson(title) + ", \"token\": " + asJson(token) +
           ", \"fuses\": " + (expression::fusesProducts() ? "true" : "false") +
           ",\n\"tolerance\": " + literalOf(scene_.solver.relative_tolerance) + ", \"shafts\": [" +
           join(shafts, ", ") + "],\n\"units\": {" + writeUnits() + "},\n\"variables\": [" +
           variables_ + "],\n\"source\": " + asJson(complete) + "}\n";
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
    const auto add = [&names](const std::string& unit) {
      const bool is_known = contains(names, unit);
      if (!unit.empty() && !is_known) names.push_back(unit);
    };
    for (const Output& it : scene_.outputs) add(it.unit);
    for (const FmuParameters::Parameter& it : parameters_.list()) add(unitOf(it));
    return names;
  }

  void add(const char* kind, const std::string& name, const std::string& unit,
           const std::string& more = "") {
    variables_ += (variables_.empty() ? "" : ",\n") + std::string("{\"kind\": \"") + kind +
                  "\", \"name\": " + asJson(name) + ", \"unit\": " + asJson(unit) + more + "}";
  }
  void addStart(const char* kind, const std::string& name, const std::string& unit, double start,
                const std::string& more = "") {
    add(kind, name, unit, ", \"start\": " + literalOf(start) + more);
  }
  /// Adds the variables in the order of their value references (runtime/fmu.h).
  void addVariables() {
    add("time", "time", "s");
    const std::pair<const char*, const char*> kOfShafts[] = {
        {"angle", "rad"},          {"velocity", "rad/s"},      {"acceleration", "rad/s^2"},
        {"applied_torque", "N m"}, {"reaction_torque", "N m"}, {"reaction_torque_rate", "N m/s"}};
    for (const auto& [quantity, unit] : kOfShafts) {
      const bool is_state = std::string(unit) == "rad" || std::string(unit) == "rad/s";
      for (const std::string& shaft : scene_.shafts) {
        add(is_state ? "state" : "output", shaft + "/" + quantity, unit);
      }
    }
    for (const char* quantity : {"/residual", "/multiplier"}) {
      for (const ConstraintPtr& it : scene_.constraints) add("output", it->name() + quantity, "");
    }
    const std::pair<const char*, const char*> kOfHolds[] = {
        {"/torque", "N m"}, {"/slip", "rad/s"}, {"/reserve", "N m"}, {"/heat", "J"}};
    for (const std::string& hold : program_.holdNames()) {
      for (const auto& [quantity, unit] : kOfHolds) add("output", hold + quantity, unit);
    }
    addMemory("output", "");
    for (const Shown& it : shown_) add("output", it.name, it.unit);
    addParameters();
    for (const CommandInputSettings& it : scene_.inputs) {
      if (it.kind != InputKind::kCommanded) continue;
      addStart("input", "inputs/" + it.name, "", it.initial, limits(it.minimum, it.maximum));
    }
    for (const std::string& hold : program_.holdNames()) add("mode", hold + "/mode", "");
  }
  /// Adds states, and then variables.
  void addMemory(const char* kind, const std::string& prefix) {
    for (const SceneState& it : scene_.states) {
      const CommandInputSettings& state = scene_.inputs[static_cast<std::size_t>(it.input)];
      addStart(kind, prefix + "states/" + state.name, "", state.initial);
    }
    for (const CommandInputSettings& it : scene_.inputs) {
      if (it.kind != InputKind::kVariable) continue;
      addStart(kind, prefix + "variables/" + it.name, "", it.initial);
    }
  }
  void addParameters() {
    const auto add_shafts = [this](const char* quantity, const char* unit, const auto& values) {
      for (std::size_t i = 0; i < values.size(); ++i)
        addStart("parameter", "initial/" + scene_.shafts[i] + quantity, unit, values[i]);
    };
    add_shafts("/angle", "rad", scene_.initial.angle);
    add_shafts("/velocity", "rad/s", scene_.initial.velocity);
    addMemory("parameter", "initial/");
    for (const FmuParameters::Parameter& it : parameters_.list()) {
      addStart("parameter", "scene/" + it.path, unitOf(it), it.start,
               limits(it.range.minimum, it.range.maximum));
    }
  }
  static std::string limits(double minimum, double maximum) {
    return (std::isinf(minimum) ? "" : ", \"min\": " + literalOf(minimum)) +
           (std::isinf(maximum) ? "" : ", \"max\": " + literalOf(maximum));
  }
  static std::string unitOf(const FmuParameters::Parameter& it) {
    return it.range.unit == "1" ? "" : it.range.unit;
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
      reaction.assign(state.history.kept_reaction, state.history.kept_reaction + shafts);
      if (scene_.principle == Principle::kGauss) {
        multiplier.assign(first.multiplier, first.multiplier + constraints);
      }
      longest.assign(state.history.longest_row, state.history.longest_row + constraints);
    }
    const std::vector<double>& given = scene_.initial.acceleration;
    return "enum { FMU_IS_SETTLED = " + std::to_string(is_settled ? 1 : 0) + " };\n" +
           arrayOf("double", "initial_angle", angle) +
           arrayOf("double", "initial_velocity", velocity) +
           arrayOf("double", "initial_acceleration", acceleration) +
           arrayOf("double", "given_acceleration", given.empty() ? acceleration : given) +
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
    const std::size_t starts = parameter.size();
    for (const FmuParameters::Parameter& it : parameters_.list()) parameter.push_back(it.start);
    return "enum {\n  FMU_STARTS = " + std::to_string(starts) +
           ",\n  FMU_PARAMETERS = " + std::to_string(parameter.size()) +
           ",\n  FMU_COMMANDS = " + std::to_string(command.size()) +
           ",\n  FMU_ROWS = " + std::to_string(shown_.size()) + "\n};\n" +
           arrayOf("double", "fmu_parameter", parameter) + arrayOf("int", "fmu_command", command) +
           arrayOf("int", "fmu_row", program_.shownRows().values) +
           "static const long fmu_most_steps = " + std::to_string(scene_.solver.maximum_steps) +
           ";\nstatic const char fmu_token[] = \"@TOKEN@\";\n";
  }

  /// Writes the lists that kernels leave to their host.
  std::string writeLists() const {
    std::string text;
#define VARIATOR_SIM_WRITE(type, name) text += arrayOf(#type, "fmu_" #name, program_.name.values);
    VARIATOR_SIM_MOTION_COMMANDS(VARIATOR_SIM_WRITE)
    VARIATOR_SIM_WRITE(double, timeout_of)
#undef VARIATOR_SIM_WRITE
    return text;
  }

  std::string writeTables() const {
    std::string text;
    std::vector<std::string> of_one, of_two, passages;
    const auto listOf = [](const std::vector<std::string>& words) {
      return std::string("{").append(join(words, ", ")).append("}");
    };
    for (const expression::DenseTable& it : program_.rows().tables()) {
      const std::string name = "fmu_table_" + std::to_string(of_one.size());
      const std::string x = std::to_string(it.points.front().size());
      const std::string y = std::to_string(it.points.back().size());
      const std::string in_x = name + "_x";
      const std::string in_y = name + "_y";
      const std::string pieces = name + "_pieces";
      text.append(arrayOf("double", in_x, it.points.front()));
      text.append(arrayOf("double", in_y, it.points.back()));
      text.append(arrayOf("double", pieces, it.pieces));
      of_one.push_back(listOf({x, in_x, pieces}));
      of_two.push_back(listOf({x, y, in_x, in_y, pieces}));
    }
    for (const std::vector<double>& points : program_.passages) {
      passages.push_back("fmu_passage_" + std::to_string(passages.size()));
      text += arrayOf("double", passages.back(), points);
    }
    if (of_one.empty()) of_one = of_two = {"{0}"};
    return text + arrayOf("vs_table", "fmu_table", of_one) +
           arrayOf("vs_table_of_two", "fmu_table_of_two", of_two) +
           arrayOf("double *const", "fmu_passage_points", passages);
  }

  /// Writes the numbers of the program, and where their kinds begin.
  std::string writeNumbers() const {
    const std::vector<double> numbers = FmuParameters::numbersOf(program_);
    std::string text = "enum {\n  FMU_NUMBERS = " + std::to_string(numbers.size());
    std::size_t place = 4;
    const auto add = [&](const char* name, std::size_t size) {
      text += std::string(",\n  FMU_") + name + " = " + std::to_string(place);
      place += size;
    };
    add("CONSTANTS", program_.rows().numbers().size());
    add("COUPLING", program_.coupling.values.size());
    add("CONSTANT_VALUE", program_.constant_value.values.size());
    add("RESTITUTION", program_.restitution.values.size());
    add("CLOSES_BELOW", program_.closes_below.values.size());
    add("PARAMETER_OF", program_.parameter_of.values.size());
    add("FACTORS", 0);
    std::vector<std::string> operations;
    for (const expression::SeriesOperation& it : program_.resolved.values) {
      std::string row = "{";
      operations.push_back(row.append(MotionProgram::integersOf(it)).append("0.0, 0.0}"));
    }
    operations.emplace_back("{0}");
    return text + "\n};\n" + arrayOf("double", "fmu_number", numbers) +
           arrayOf("struct SeriesOperation", "fmu_operation", operations);
  }

  /// Writes how numbers follow from parameters.
  std::string writePowers() const {
    std::vector<int> places, begins, parameters, exponents;
    std::vector<double> factors;
    for (const FmuParameters::Dependent& it : parameters_.dependents()) {
      places.push_back(it.place);
      factors.push_back(it.factor);
      begins.push_back(static_cast<int>(parameters.size()));
      for (const auto& [parameter, exponent] : it.powers) {
        parameters.push_back(parameter);
        exponents.push_back(exponent);
      }
    }
    begins.push_back(static_cast<int>(parameters.size()));
    return "enum { FMU_DEPENDENTS = " + std::to_string(places.size()) + " };\n" +
           arrayOf("int", "fmu_dependent", places) + arrayOf("double", "fmu_factor", factors) +
           arrayOf("int", "fmu_power_begin", begins) + arrayOf("int", "fmu_power_of", parameters) +
           arrayOf("int", "fmu_power", exponents);
  }

  std::string writeAllowed() const {
    std::vector<std::string> rows;
    for (const FmuParameters::Parameter& it : parameters_.list()) {
      const Range& range = it.range;
      const std::string unit = unitOf(it);
      const std::string words = range.toText() + (it.is_never_zero ? ", not 0" : "") +
                                (unit.empty() ? "" : ", in " + unit);
      const auto flag = [](bool is) { return is ? "1, " : "0, "; };
      rows.push_back("{" + literalOf(range.minimum) + ", " + literalOf(range.maximum) + ", " +
                     flag(range.minimum_included) + flag(range.maximum_included) +
                     flag(it.is_never_zero) + "\"" + harmless(it.path) + "\", \"" +
                     harmless(words) + "\"}");
    }
    return "typedef struct {\n  double low, high;\n  int has_low, has_high, is_never_zero;\n"
           "  const char *path, *allowed;\n} fmu_allowance;\n" +
           arrayOf("fmu_allowance", "fmu_allowed", rows);
  }

  std::string writeSource() {
    return std::string("#include <float.h>\n#include <math.h>\n#include <stdio.h>\n") +
           "#include <stdlib.h>\n#include <string.h>\n\n" + expression::arithmeticOfCode() +
           "#define VS_FUNCTION static __attribute__((unused))\n#define VS_FUNCTION_INLINE "
           "VS_INLINE\n#define VS_FUNCTION_RARE VS_RARE\n" +
           "#define UNITS 1\n#define UNIT 0\n" + program_.writeExtents() + kSceneHeader +
           kTableData + kExchangeData + program_.writeMotion(true) + kExchange + kCommands + kHost +
           "\n" + writeLists() + writeTables() + writeNumbers() + writePowers() + writeAllowed() +
           writeConstants() + writeStart() + kFmu + (version_ == 2 ? kFmi2 : kFmi3);
  }

  Simulation& simulation_;
  const Scene& scene_;
  const int version_;
  const std::vector<Shown> shown_;
  const FmuParameters parameters_;
  const MotionProgram& program_;
  std::string variables_;  ///< as JSON
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
