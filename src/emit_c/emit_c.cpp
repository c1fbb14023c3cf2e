#include "emit_c/emit_c.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "emit_c/c_text.h"
#include "emit_c/formula_rows.h"
#include "emit_c/readme.h"
#include "emit_c/scene_formulas.h"
#include "expression/series_text.h"
#include "variator_sim/errors.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {

using expression::Node;
using expression::slotOf;
using expression::Source;
using Part = FormulaRows::Part;

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
        S(scene_.shaftCount()),
        K_(scene_.constraintCount()),
        U_(scene_.inputCount()),
        formulas_(collectFormulas(scene_)),
        program_(compile()),
        rows_(program_, static_cast<int>(series_)) {}

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
  /// Lists the outputs, those that are needed as series first, and makes their rows.
  expression::SeriesProgram compile() {
    const auto add = [this](const std::vector<Node>& nodes) {
      outputs_.insert(outputs_.end(), nodes.begin(), nodes.end());
    };
    add(formulas_.residual);
    if (isClassical()) add(formulas_.entry);
    const std::vector<Node> trial = outputs_;
    if (!isClassical()) add(formulas_.entry);
    add(formulas_.torque);
    add(formulas_.inertia);
    add(formulas_.inertial_torque);
    add(formulas_.connection);
    for (const expression::Branch& it : formulas_.signs) outputs_.push_back(it.argument);
    for (const expression::Passage& it : formulas_.tables) outputs_.push_back(it.argument);
    series_ = outputs_.size();
    for (const Node node : outputs_) {
      for (int i = 0; i < S; ++i) {
        reads_angles_ = reads_angles_ || scene_.graph->dependsOn(node, slotOf(Source::kAngle, i));
      }
    }
    add(formulas_.velocity_residual);
    add(formulas_.curvature);
    add(formulas_.input_slope);
    const std::vector<Node> others(outputs_.begin() + static_cast<std::ptrdiff_t>(trial.size()),
                                   outputs_.end());
    try {
      return {*scene_.graph, trial, others, slots(), order()};
    } catch (const std::invalid_argument& error) {
      throw SceneError("",
                       std::string("cannot be written as C: its formulas have ") + error.what());
    }
  }

  /// Variables, which have the first rows, in the order of writeSizes.
  std::vector<int> slots() {
    std::vector<int> made = {slotOf(Source::kTime)};
    for (const Source source : {Source::kAngle, Source::kVelocity, Source::kAcceleration}) {
      for (int i = 0; i < S; ++i) made.push_back(slotOf(source, i));
    }
    // Multipliers and J^-1 R: no formula reads them.
    for (int n = 0; n < K_ + S; ++n) made.push_back(slotOf(Source::kJerk, n));
    for (int n = 0; n < U_; ++n) {
      int rate = 0;
      for (const Source source : {Source::kInput, Source::kInputRate, Source::kInputSecondRate}) {
        const auto reads = [&](Node node) {
          return scene_.graph->dependsOn(node, slotOf(source, n));
        };
        if (std::any_of(outputs_.begin(), outputs_.end(), reads)) {
          input_rows_.push_back(static_cast<int>(made.size()));
          input_of_row_.push_back(n);
          input_rate_of_row_.push_back(rate);
          made.push_back(slotOf(source, n));
        }
        ++rate;
      }
    }
    return made;
  }

  int rowOf(Node node) const {
    const auto found = std::find_if(outputs_.begin(), outputs_.end(),
                                    [&](Node it) { return it.index == node.index; });
    return program_.output(static_cast<int>(found - outputs_.begin()));
  }

  bool isClassical() const { return scene_.principle == Principle::kGauss; }
  /// Orders cost little once a step is made: measured, 0.6 orders for each digit (natural
  /// logarithm) of the tolerance are the fastest.
  int order() const {
    const double digits = -std::log(std::max(scene_.solver.relative_tolerance, 1e-16));
    return std::max(4, static_cast<int>(std::ceil(1.5 + 0.6 * digits)));
  }
  bool hasOrder(int low, int high) const {
    return std::any_of(
        scene_.constraints.begin(), scene_.constraints.end(),
        [&](const ConstraintPtr& it) { return it->order() >= low && it->order() <= high; });
  }
  bool isDiagonal() const {
    const Eigen::MatrixXd diagonal = scene_.inertia.diagonal().asDiagonal();
    return scene_.inertia == diagonal;
  }
  /// True if C depends on no acceleration and no input: a jump is one projection (jump_map.h).
  bool jumpsStraight() const {
    return std::all_of(scene_.constraints.begin(), scene_.constraints.end(),
                       [](const ConstraintPtr& it) {
                         return it->nonlinearAccelerations() == 0 && !it->readsInputs();
                       });
  }

  /// Finds shafts whose reaction no C contains; these are all shafts if C and J, and so the null
  /// space, are constant.
  std::vector<int> findNeutral() const {
    const auto shafts = static_cast<std::size_t>(S);
    std::vector<int> neutral(shafts, 1);
    bool is_constant = !formulas_.inertia_varies;
    for (std::size_t n = 0; n < formulas_.entry.size(); ++n) {
      is_constant = is_constant && scene_.graph->isConstant(formulas_.entry[n]);
      if (!scene_.graph->isConstant(formulas_.entry[n], 0.0)) neutral[n % shafts] = 0;
    }
    if (is_constant) neutral.assign(shafts, 1);
    if (isClassical() || (formulas_.inertia_varies && !isDiagonal())) neutral.assign(shafts, 0);
    return neutral;
  }

  template <class Values>
  static std::string constant(const char* type, const char* name, const Values& values) {
    return std::string("static const ") + type + " " + name + "[] = {" + listOf(values) + "};\n";
  }
  std::string rowsOf(const char* name, const std::vector<Node>& nodes) const {
    std::vector<int> rows(nodes.size());
    std::transform(nodes.begin(), nodes.end(), rows.begin(),
                   [this](Node node) { return rowOf(node); });
    return constant("int", name, rows);
  }

  std::string writeHeader() const {
    const std::string capitals = inCapitals(name_);
    std::vector<std::string> inputs;
    for (const CommandInputSettings& input : scene_.inputs) inputs.push_back(input.name);
    std::string text = "/* " + title_ +
                       ", written by `simulate --emit-c`. README.md tells more. */\n#ifndef " +
                       capitals + "_H\n#define " + capitals +
                       "_H\n\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n\nenum {\n";
    const auto size = [&](const char* what, int value, const char* note) {
      text += "  " + capitals + "_" + what + " = " + std::to_string(value) + "," + note + "\n";
    };
    size("SHAFTS", S, "");
    size("CONSTRAINTS", K_, "");
    size("INPUTS", U_, "");
    size("ORDER", order(), " /* of the series */");
    size("MOST_STEPS", 10000, " /* that one call makes */");
    size("ROWS", rows_.rows(), " /* of coefficients */");
    size("STRIDE", (order() + 4) / 4 * 4 + 4, "");
    size("MODES", std::max(1, rows_.modes()), "");
    size("PIECES", std::max(1, rows_.pieces()), "");
    text.erase(text.rfind(','), 1);
    text += "};\n\n/* Indices of the arrays below, in the scene's order. */\n";
    text += writeEnum(capitals + "_SHAFT_", scene_.shafts);
    text += writeEnum(capitals + "_CONSTRAINT_", namesOf(scene_.constraints));
    text += writeEnum(capitals + "_INPUT_", inputs);
    text += withName(kSceneHeader, name_);
    return text + "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
  }

  std::string writeSizes() const {
    const SolverSettings& solver = scene_.solver;
    const std::vector<int> neutral = findNeutral();
    std::string text = "enum {\n";
    const auto add = [&text](const std::string& name, const std::string& value) {
      text += "  " + name + " = " + value + ",\n";
    };
    const auto addSize = [&add](const char* name, std::size_t value) {
      add(name, std::to_string(value));
    };
    const auto addFlag = [&add](const char* name, bool is_set) { add(name, is_set ? "1" : "0"); };
    const auto anyEntry = [&](const auto& test) {
      return std::any_of(formulas_.entry.begin(), formulas_.entry.end(),
                         [&](Node node) { return test(rowOf(node)); });
    };
    add("S", "SCENE_SHAFTS");
    add("K", "SCENE_CONSTRAINTS");
    add("INPUTS", "SCENE_INPUTS");
    add("VS_STRIDE", "SCENE_STRIDE");
    add("SIZE", "S + K");
    addFlag("IS_CLASSICAL", isClassical());
    addFlag("IS_CURVED",
            std::any_of(formulas_.curvature.begin(), formulas_.curvature.end(),
                        [&](Node node) { return !scene_.graph->isConstant(node, 0.0); }));
    addFlag("IS_COUPLED", !isDiagonal());
    addFlag("INERTIA_VARIES", formulas_.inertia_varies);
    addFlag("ENTRIES_VARY", anyEntry([this](int row) { return !program_.isConstant(row); }));
    addFlag("ENTRIES_TURN", anyEntry([this](int row) { return program_.isAccelerated(row); }));
    addFlag("HAS_ORDER_1", hasOrder(1, 1));
    addFlag("HAS_RESIDUAL", hasOrder(1, 2));
    addFlag("HAS_GIVEN_ACCELERATIONS", !scene_.initial.acceleration.empty());
    addFlag("MAY_PROJECT", scene_.initial.project);
    addFlag("HAS_NEUTRAL",
            std::any_of(neutral.begin(), neutral.end(), [](int it) { return it != 0; }));
    addFlag("JUMPS_STRAIGHT", jumpsStraight());
    add("COMPONENTS", isClassical() ? "2 * S" : "3 * S");
    add("FIRST_JUDGED", reads_angles_ ? "0" : "S");
    addSize("SIGNS", formulas_.signs.size());
    addSize("TABLES", formulas_.tables.size());
    addSize("CONSTANTS", rows_.constants().size());
    addSize("INPUT_ROW_COUNT", input_rows_.size());
    text +=
        "  /* rows that are no formulas */\n  TIME = 0,\n  ANGLE = 1,\n  VELOCITY = 1 + S,\n"
        "  ACCELERATION = 1 + 2 * S,\n  MULTIPLIER = 1 + 3 * S,\n"
        "  PULL = 1 + 3 * S + K /* J^-1 R */\n};\n";
    const double decay = std::pow(std::max(solver.relative_tolerance, 1e-16), 1.0 / order());
    const auto number = [](const char* name, double value) {
      return std::string("static const double ") + name + " = " + literalOf(value) + ";\n";
    };
    text += number("RELATIVE_TOLERANCE", solver.relative_tolerance) +
            number("ABSOLUTE_TOLERANCE", solver.absolute_tolerance) +
            number("MAXIMUM_STEP", solver.maximum_step) + number("DECAY", decay);
    return withName(text, name_);
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
    topics.reserve(scene_.inputs.size());
    for (const CommandInputSettings& input : scene_.inputs) topics.push_back(input.topic);
    return list("shaft", scene_.shafts) + list("constraint", namesOf(scene_.constraints)) +
           list("input", topics);
  }
  static std::vector<std::string> namesOf(const std::vector<ConstraintPtr>& constraints) {
    std::vector<std::string> names;
    names.reserve(constraints.size());
    for (const ConstraintPtr& it : constraints) names.push_back(it->name());
    return names;
  }

  std::string writeInputs() const {
    using Input = CommandInputSettings;
    const auto column = [this](const char* type, const char* name, auto value) {
      std::vector<double> values;
      for (const Input& it : scene_.inputs) values.push_back(static_cast<double>(value(it)));
      if (std::string(type) == "double") return constant(type, name, values);
      return constant(type, name, std::vector<int>(values.begin(), values.end()));
    };
    return constant("int", "input_row", input_rows_) +
           constant("int", "input_of_row", input_of_row_) +
           constant("int", "input_rate_of_row", input_rate_of_row_) +
           column("int", "hold_of", [](const Input& it) { return it.hold; }) +
           column("double", "parameter_of",
                  [](const Input& it) {
                    return it.hold == Hold::kRateLimit        ? it.rate
                           : it.hold == Hold::kFirstOrderHold ? it.period
                                                              : it.time_constant;
                  }) +
           column("double", "initial_input", [](const Input& it) { return it.initial; }) +
           column("double", "minimum_of", [](const Input& it) { return it.minimum; }) +
           column("double", "maximum_of", [](const Input& it) { return it.maximum; }) +
           column("double", "timeout_of", [](const Input& it) { return it.timeout; }) +
           column("int", "falls_to_zero",
                  [](const Input& it) { return it.on_timeout == OnTimeout::kZero; });
  }

  std::string writeStart() {
    const Sample& sample = simulation_.sample();
    if (!simulation_.status().ok()) throw SceneError("", simulation_.describeStatus());
    const auto values = [](const double* from, int count) {
      return std::vector<double>(from, from + count);
    };
    return constant("double", "initial_angle", values(sample.angle, S)) +
           constant("double", "initial_velocity", values(sample.velocity, S)) +
           constant("double", "initial_acceleration", values(sample.acceleration, S)) +
           constant("double", "initial_multiplier", values(sample.multiplier, K_));
  }

  std::string writeResolution() const {
    const std::vector<expression::SeriesOperation> operations = rows_.resolved();
    std::string text =
        std::string("\n/* ---- Whether the series show all of their functions. ---- */\n\n") +
        expression::kSeriesOperationText + expression::kSeriesResolutionText +
        expression::kSeriesRangesText + "enum { RESOLVED = " + std::to_string(operations.size()) +
        " };\nstatic const struct SeriesOperation resolved[] = {\n";
    for (const expression::SeriesOperation& it : operations) {
      text += "    {";
      for (const int n :
           {it.kind, it.result, it.second, it.a, it.b, it.degree, it.state, it.power}) {
        text += std::to_string(n) + ", ";
      }
      text += literalOf(it.f) + ", " + literalOf(it.g) + "},\n";
    }
    return text + "    {0, 0, -1, 0, -1, 0, -1, 0, 0.0, 0.0}};\n";
  }

  std::string writeConstants() const {
    std::vector<int> orders;
    for (const ConstraintPtr& it : scene_.constraints) orders.push_back(it->order());
    std::vector<double> coupling;
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) coupling.push_back(i == j ? 0.0 : scene_.inertia(i, j));
    }
    std::vector<Node> signs;
    std::vector<int> jumps;
    for (const expression::Branch& it : formulas_.signs) {
      signs.push_back(it.argument);
      jumps.push_back(static_cast<int>(it.jumps));
    }
    std::vector<int> rows;
    std::vector<double> values;
    for (const auto& [row, value] : rows_.constants()) {
      rows.push_back(row);
      values.push_back(value);
    }
    return constant("int", "order_of", orders) + constant("int", "is_neutral", findNeutral()) +
           constant("double", "coupling", coupling) + rowsOf("torque_row", formulas_.torque) +
           rowsOf("residual_row", formulas_.residual) +
           rowsOf("velocity_residual_row", formulas_.velocity_residual) +
           rowsOf("entry_row", formulas_.entry) + rowsOf("curvature_row", formulas_.curvature) +
           rowsOf("input_slope_row", formulas_.input_slope) +
           rowsOf("inertia_row", formulas_.inertia) +
           rowsOf("inertial_row", formulas_.inertial_torque) +
           rowsOf("connection_row", formulas_.connection) + rowsOf("sign_row", signs) +
           constant("int", "sign_jumps", jumps) + constant("int", "constant_row", rows) +
           constant("double", "constant_value", values) + writePassages();
  }

  std::string writePassages() const {
    std::vector<Node> arguments;
    std::vector<int> counts;
    std::string points;
    std::string list;
    for (const expression::Passage& it : formulas_.tables) {
      const std::string name = "passage_" + std::to_string(arguments.size());
      arguments.push_back(it.argument);
      counts.push_back(static_cast<int>(it.points.size()));
      points += constant("double", name.c_str(), it.points);
      list += (list.empty() ? "" : ", ") + name;
    }
    return points + rowsOf("passage_row", arguments) + constant("int", "passage_count", counts) +
           "static const double *const passage_points[] = {" + (list.empty() ? "0" : list) + "};\n";
  }

  std::string writeFormulas() const {
    struct Function {
      const char* name;
      Part part;
      const char* parameter;
      const char* note;
    };
    std::string text = "\n/* ---- The scene's formulas: coefficients n ---- */\n" + rows_.tables();
    for (const Function& it :
         {Function{"given", Part::kGiven, "", "Rows that read no acceleration."},
          Function{"tried", Part::kTried, "", "Rows with accelerations that constraints read."},
          Function{"corrected", Part::kCorrected, ", const Real *de",
                   "These after the accelerations n have changed by de."},
          Function{"rest", Part::kRest, "", "Other rows with accelerations."},
          Function{"at_once", Part::kAtOnce, "", "Rows that are read at order 0 only."}}) {
      text +=
          std::string("\n/* ") + it.note + " */\nVS_INLINE void vs_" + it.name +
          "(scene_series *it, int n" + it.parameter +
          ")\n{\n  vs_row *const r = it->row;\n  Real *const s = it->mode;\n  double *const a = "
          "it->piece;\n  (void)r, (void)s, (void)a, (void)n" +
          (*it.parameter == '\0' ? "" : ", (void)de") + ";\n" + rows_.statements(it.part) + "}\n";
    }
    return withName(text, name_);
  }

  /// One function for each order, unless a scene has so many rows that compiling them takes long.
  std::string writeOrders() const {
    constexpr int kMostRows = 200;
    if (rows_.rows() > kMostRows) return "";
    std::string text = "#define VS_EACH_ORDER(X)";
    for (int n = 1; n <= order(); ++n) text += " X(" + std::to_string(n) + ")";
    return text + "\n";
  }

  std::string writeSource() {
    std::string text = "/* " + title_ + ", written by `simulate --emit-c`. */\n#include \"" +
                       name_ +
                       ".h\"\n\n#include <float.h>\n#include <math.h>\n#include <string.h>\n\n";
    text += writeSizes() + writeOrders() + writeNames() + "\n/* Commanded inputs */\n" +
            writeInputs() + "\n/* The first state */\n" + writeStart() +
            "\n/* Where formulas stand, by shaft and constraint */\n" + writeConstants();
    return text + kSeriesFunctions + writeFormulas() + writeResolution() + withName(kMotion, name_);
  }

  Simulation& simulation_;
  const Scene& scene_;
  const std::string name_;
  const std::string title_;
  const int S;  // shafts
  const int K_;
  const int U_;
  const SceneFormulas formulas_;
  bool reads_angles_ = false;
  std::vector<Node> outputs_;
  std::size_t series_ = 0;  // outputs that are needed as series
  std::vector<int> input_rows_;
  std::vector<int> input_of_row_;
  std::vector<int> input_rate_of_row_;
  const expression::SeriesProgram program_;
  FormulaRows rows_;
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
                                              "command", "vs",   "write"};
  const bool is_taken = taken.count(lower) > 0 || lower.rfind("vs_", 0) == 0;
  return is_taken ? "scene_" + name : name;
}

EmittedScene emitScene(Simulation& simulation, const std::string& name, const std::string& title) {
  return Emission(simulation, name, title).write();
}

}  // namespace variator_sim
