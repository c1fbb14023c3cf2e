#include "emit_c/emit_c.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>
#include <utility>

#include "dynamics/motion_series.h"
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
        rows_(*scene_.graph, pullRow() + S, slots()) {
    std::vector<Node> series = formulas_.residual;
    const auto add = [](std::vector<Node>& to, const std::vector<Node>& nodes) {
      to.insert(to.end(), nodes.begin(), nodes.end());
    };
    add(series, formulas_.entry);
    add(series, formulas_.torque);
    add(series, formulas_.inertia);
    add(series, formulas_.inertial_torque);
    add(series, formulas_.connection);
    for (const expression::Branch& it : formulas_.signs) series.push_back(it.argument);
    for (const expression::Passage& it : formulas_.tables) series.push_back(it.argument);
    std::vector<Node> at_once = formulas_.velocity_residual;
    add(at_once, formulas_.curvature);
    add(at_once, formulas_.input_slope);
    try {
      rows_.write(series, at_once);
    } catch (const std::invalid_argument& error) {
      throw SceneError("",
                       std::string("cannot be written as C: its formulas have ") + error.what());
    }
    for (const Node node : series) {
      for (int i = 0; i < S; ++i) {
        reads_angles_ = reads_angles_ || scene_.graph->dependsOn(node, slotOf(Source::kAngle, i));
      }
    }
  }

  EmittedScene write() {
    EmittedScene made;
    made.name = name_;
    made.source = writeSource();
    made.header = writeHeader();
    std::string code = withName(kMainCode, name_);
    const std::string from = name_ + "_header.h";
    code.replace(code.find(from), from.size(), name_ + ".h");
    made.main =
        "/* Plays a file of commands (time,topic,value) into a CSV: " + title_ + " */" + code;
    made.readme = writeReadme(scene_, name_, title_);
    made.makefile = writeMakefile(name_);
    return made;
  }

 private:
  int multiplierRow() const { return 1 + 3 * S; }
  int inputRow() const { return multiplierRow() + K_; }
  int pullRow() const { return inputRow() + 3 * U_; }

  std::map<int, int> slots() const {
    std::map<int, int> rows = {{slotOf(Source::kTime), 0}};
    for (int i = 0; i < S; ++i) {
      rows[slotOf(Source::kAngle, i)] = 1 + i;
      rows[slotOf(Source::kVelocity, i)] = 1 + S + i;
      rows[slotOf(Source::kAcceleration, i)] = 1 + 2 * S + i;
    }
    for (int n = 0; n < U_; ++n) {
      rows[slotOf(Source::kInput, n)] = inputRow() + 3 * n;
      rows[slotOf(Source::kInputRate, n)] = inputRow() + 3 * n + 1;
      rows[slotOf(Source::kInputSecondRate, n)] = inputRow() + 3 * n + 2;
    }
    return rows;
  }

  bool isClassical() const { return scene_.principle == Principle::kGauss; }
  int order() const { return MotionSeries::orderFor(scene_.solver.relative_tolerance); }
  bool hasOrder(int low, int high) const {
    return std::any_of(
        scene_.constraints.begin(), scene_.constraints.end(),
        [&](const ConstraintPtr& it) { return it->order() >= low && it->order() <= high; });
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
    const Eigen::MatrixXd diagonal = scene_.inertia.diagonal().asDiagonal();
    const bool is_diagonal = scene_.inertia == diagonal;
    if (isClassical() || (formulas_.inertia_varies && !is_diagonal)) neutral.assign(shafts, 0);
    return neutral;
  }

  template <class Values>
  static std::string constant(const char* type, const char* name, const Values& values) {
    return std::string("static const ") + type + " " + name + "[] = {" + listOf(values) + "};\n";
  }
  std::string rowsOf(const char* name, const std::vector<Node>& nodes) const {
    std::vector<int> rows;
    rows.reserve(nodes.size());
    for (const Node node : nodes) rows.push_back(rows_.rowOf(node));
    return constant("int", name, rows);
  }

  std::string writeHeader() const {
    const std::string capitals = inCapitals(name_);
    std::vector<std::string> inputs;
    for (const CommandInputSettings& input : scene_.inputs) inputs.push_back(input.name);
    std::vector<std::string> constraints;
    for (const ConstraintPtr& it : scene_.constraints) constraints.push_back(it->name());
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
    size("BRANCHES", std::max(1, rows_.branches()), "");
    size("PIECES", std::max(1, rows_.pieces()), "");
    text.erase(text.rfind(','), 1);
    text += "};\n\n/* Indices of the arrays below, in the scene's order. */\n";
    text += writeEnum(capitals + "_SHAFT_", scene_.shafts);
    text += writeEnum(capitals + "_CONSTRAINT_", constraints);
    text += writeEnum(capitals + "_INPUT_", inputs);
    text += withName(kHeaderTypes, name_) + withName(kHeaderFunctions, name_);
    return text + "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
  }

  std::string writeSizes() const {
    const SolverSettings& solver = scene_.solver;
    const bool is_curved =
        std::any_of(formulas_.curvature.begin(), formulas_.curvature.end(),
                    [&](Node node) { return !scene_.graph->isConstant(node, 0.0); });
    std::string text = "enum {\n";
    const auto add = [&text](const std::string& name, const std::string& value) {
      text += "  " + name + " = " + value + ",\n";
    };
    for (const char* it : {"SHAFTS", "CONSTRAINTS", "INPUTS", "ORDER", "ROWS"}) {
      const std::string name = it;
      add(name == "SHAFTS" ? "S" : name == "CONSTRAINTS" ? "K" : name, "SCENE_" + name);
    }
    add("LENGTH", "ORDER + 2");
    add("SIZE", "S + K");
    add("IS_CLASSICAL", std::to_string(static_cast<int>(isClassical())));
    add("IS_CURVED", std::to_string(static_cast<int>(is_curved)));
    add("INERTIA_VARIES", std::to_string(static_cast<int>(formulas_.inertia_varies)));
    add("HAS_ORDER_1", std::to_string(static_cast<int>(hasOrder(1, 1))));
    add("HAS_RESIDUAL", std::to_string(static_cast<int>(hasOrder(1, 2))));
    add("HAS_GIVEN_ACCELERATIONS",
        std::to_string(static_cast<int>(!scene_.initial.acceleration.empty())));
    add("MAY_PROJECT", std::to_string(static_cast<int>(scene_.initial.project)));
    const std::vector<int> neutral = findNeutral();
    add("HAS_NEUTRAL",
        std::any_of(neutral.begin(), neutral.end(), [](int it) { return it != 0; }) ? "1" : "0");
    add("COMPONENTS", isClassical() ? "2 * S" : "3 * S");
    add("FIRST_JUDGED", reads_angles_ ? "0" : "S");
    add("SIGNS", std::to_string(formulas_.signs.size()));
    add("TABLES", std::to_string(formulas_.tables.size()));
    add("CONSTANTS", std::to_string(rows_.constants().size()));
    add("OPERATIONS", std::to_string(rows_.operations().size()));
    text +=
        "  /* rows that are no formulas */\n  TIME = 0,\n  ANGLE = 1,\n  VELOCITY = 1 + S,\n"
        "  ACCELERATION = 1 + 2 * S,\n";
    add("MULTIPLIER", std::to_string(multiplierRow()));
    add("INPUT", std::to_string(inputRow()));
    text += "  PULL = " + std::to_string(pullRow()) + " /* J^-1 R */\n};\n";
    text += "static const double RELATIVE_TOLERANCE = " + literalOf(solver.relative_tolerance) +
            ";\nstatic const double ABSOLUTE_TOLERANCE = " + literalOf(solver.absolute_tolerance) +
            ";\nstatic const double MAXIMUM_STEP = " + literalOf(solver.maximum_step) +
            "; /* s */\n";
    return withName(text, name_);
  }

  std::string writeNames() const {
    const auto list = [&](const char* what, const std::vector<std::string>& names) {
      std::string text = "const char *const " + name_ + "_" + what + "_name[] = {";
      for (const std::string& name : names) text += "\"" + harmless(name) + "\", ";
      return text + (names.empty() || std::string(what) != "shaft" ? "\"\"};\n" : "};\n");
    };
    std::vector<std::string> inputs;
    for (const CommandInputSettings& input : scene_.inputs) inputs.push_back(input.topic);
    std::vector<std::string> constraints;
    for (const ConstraintPtr& it : scene_.constraints) constraints.push_back(it->name());
    std::string text =
        list("shaft", scene_.shafts) + list("constraint", constraints) + list("input", inputs);
    const std::string shafts_end = ", };";
    if (const auto at = text.find(shafts_end); at != std::string::npos) {
      text.replace(at, shafts_end.size(), "};");
    }
    return text;
  }

  std::string writeInputs() const {
    std::vector<int> holds;
    std::vector<double> parameters;
    std::vector<double> initial;
    std::vector<double> minima;
    std::vector<double> maxima;
    std::vector<double> timeouts;
    std::vector<int> falls;
    for (const CommandInputSettings& it : scene_.inputs) {
      holds.push_back(static_cast<int>(it.hold));
      parameters.push_back(it.hold == Hold::kRateLimit        ? it.rate
                           : it.hold == Hold::kFirstOrderHold ? it.period
                                                              : it.time_constant);
      initial.push_back(it.initial);
      minima.push_back(it.minimum);
      maxima.push_back(it.maximum);
      timeouts.push_back(it.timeout);
      falls.push_back(static_cast<int>(it.on_timeout == OnTimeout::kZero));
    }
    return constant("int", "hold_of", holds) + constant("double", "parameter_of", parameters) +
           constant("double", "initial_input", initial) + constant("double", "minimum_of", minima) +
           constant("double", "maximum_of", maxima) + constant("double", "timeout_of", timeouts) +
           constant("int", "falls_to_zero", falls);
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

  /// The text of the check without the sums by fours, whose vectors emitted programs do not have.
  static std::string withoutVectors() {
    std::string text = expression::kSeriesResolutionText;
    const std::string end = "#else\n";
    const std::size_t begin = text.find("#ifdef SERIES_HAS_FOURS");
    text.erase(begin, text.find(end, begin) + end.size() - begin);
    return text.erase(text.find("#endif\n", begin), 7);
  }

  std::string writeOperations() const {
    std::string text = std::string("\n/* ---- The operations that rows are made by. ---- */\n\n") +
                       "typedef double Real;\n#define SERIES_INLINE inline\n#define "
                       "SERIES_RARE\n#define SERIES_STATE int\n" +
                       expression::kSeriesOperationText + withoutVectors() +
                       expression::kSeriesRangesText +
                       "static const struct SeriesOperation operation[] = {\n";
    for (const expression::SeriesOperation& it : rows_.operations()) {
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
    for (const auto& [value, row] : rows_.constants()) {
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
      const char* note;
    };
    std::string text = "\n/* ---- The scene's formulas ---- */\n" + rows_.tables();
    for (const Function& it :
         {Function{"given", Part::kGiven, "Coefficient n of those that read no acceleration."},
          Function{"accelerated", Part::kAccelerated, "Of those that do."},
          Function{"at_once", Part::kAtOnce, "Of those that are asked for at order 0 only."}}) {
      text += std::string("\n/* ") + it.note + " */\nstatic void " + it.name +
              "(row *r, int *b, double *p, int n)\n{\n  (void)r, (void)b, (void)p, (void)n;\n" +
              rows_.statements(it.part) + "}\n";
    }
    return text;
  }

  std::string writeSource() {
    static const char* const kStraightJump = R"c(
static scene_status jump(scene_model *m, const double *u0, const double *du, const double *dQ,
                         const double *df)
{
  double x[SIZE];
  int i;
  (void)u0, (void)du;
  if (!jump_rate(m, dQ, 0, df, x)) return SCENE_SINGULAR;
  for (i = 0; i < S; ++i) m->now.acceleration[i] += x[i];
  return SCENE_OK;
}
)c";
    std::string text = "/* " + title_ + ", written by `simulate --emit-c`. */\n#include \"" +
                       name_ +
                       ".h\"\n\n#include <float.h>\n#include <math.h>\n#include <string.h>\n\n";
    text += writeSizes();
    text += "typedef double row[LENGTH];\n\n" + writeNames() + "\n/* Commanded inputs */\n" +
            writeInputs() + "\n/* The first state */\n" + writeStart() +
            "\n/* Where formulas stand, by shaft and constraint */\n" + writeConstants();
    text +=
        "\n/* ---- Power series: coefficient n of a function, from those of its operands up to n"
        "\n   and its own below n. ---- */\n" +
        writeSeriesFunctions(rows_.functions()) + writeFormulas() + writeOperations();
    for (const char* const part :
         {kInputCode, kMatrixCode, kResolutionCode, kSeriesCode, kProjectionCode, kEdgeCode,
          kJumpCode, jumpsStraight() ? kStraightJump : kPathCode, kStepCode, kInterfaceCode}) {
      text += withName(part, name_);
    }
    return text;
  }

  Simulation& simulation_;
  const Scene& scene_;
  const std::string name_;
  const std::string title_;
  const int S;  // shafts
  const int K_;
  const int U_;
  const SceneFormulas formulas_;
  FormulaRows rows_;
  bool reads_angles_ = false;
};

}  // namespace

std::string nameForC(const std::string& scene_path) {
  std::string name = asIdentifier(std::filesystem::path(scene_path).stem().string());
  const bool is_plain = !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) != 0;
  if (!is_plain) name = "scene_" + name;
  // NAME_play becomes the name of a file, too.
  constexpr std::size_t kLongest = 100;
  if (name.size() > kLongest) name.resize(kLongest);
  // main.c is another file, and the next three are headers that the source reads. With the others a
  // name of the scene (make_step, ZERO_ORDER) would collide with one in the source.
  std::string lower = name;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const char* taken :
       {"main", "math", "float", "string", "command", "enter", "make", "write", "zero"}) {
    if (lower == taken) return "scene_" + name;
  }
  return name;
}

EmittedScene emitScene(Simulation& simulation, const std::string& name, const std::string& title) {
  return Emission(simulation, name, title).write();
}

}  // namespace variator_sim
