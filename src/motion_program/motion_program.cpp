#include "motion_program/motion_program.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include "expression/c_code.h"
#include "expression/series_dot.h"
#include "expression/series_text.h"
#include "machine_code/kernel_library.h"
#include "motion_program/c_text.h"
#include "variator_sim/errors.h"

namespace variator_sim {

using expression::Node;
using expression::SeriesProgram;
using expression::slotOf;
using expression::Source;

namespace {

/// Orders cost little once a step is made: measured, 0.6 orders for each digit (natural logarithm)
/// of the tolerance are the fastest.
int orderFor(const SolverSettings& solver) {
  const double digits = -std::log(std::max(solver.relative_tolerance, 1e-16));
  return std::max(4, static_cast<int>(std::ceil(1.5 + 0.6 * digits)));
}

bool hasOrder(const Scene& scene, int low, int high) {
  return std::any_of(
      scene.constraints.begin(), scene.constraints.end(),
      [&](const ConstraintPtr& it) { return it->order() >= low && it->order() <= high; });
}

bool isDiagonal(const Eigen::MatrixXd& inertia) {
  const Eigen::MatrixXd diagonal = inertia.diagonal().asDiagonal();
  return inertia == diagonal;
}

}  // namespace

MotionProgram::MotionProgram(const Scene& scene, std::vector<Node> shown)
    : formulas_(collectFormulas(scene)),
      shown_(std::move(shown)),
      program_(compile(scene)),
      rows_(program_, series_) {
  setSizes(scene);
  setLists(scene);
  setInputs(scene);
  setHolds(*scene.graph);
  setMemory(scene);
}

/// Lists the outputs, those that are needed as series first, and makes their rows.
SeriesProgram MotionProgram::compile(const Scene& scene) {
  IS_CLASSICAL = scene.principle == Principle::kGauss ? 1 : 0;
  SCENE_ORDER = orderFor(scene.solver);
  const auto add = [this](const std::vector<Node>& nodes) {
    outputs_.insert(outputs_.end(), nodes.begin(), nodes.end());
  };
  add(formulas_.residual);
  if (IS_CLASSICAL != 0) add(formulas_.entry);
  if (IS_CLASSICAL != 0 || formulas_.has_directions) add(formulas_.direction);
  const std::vector<Node> trial = outputs_;
  if (IS_CLASSICAL == 0) add(formulas_.entry);
  add(formulas_.torque);
  add(formulas_.inertia);
  add(formulas_.inertial_torque);
  add(formulas_.connection);
  add(formulas_.rate);
  for (const expression::Branch& it : formulas_.signs) outputs_.push_back(it.argument);
  for (const expression::Passage& it : formulas_.tables) outputs_.push_back(it.argument);
  for (const SceneHold& it : formulas_.holds) {
    add({it.slip, it.torque, it.power, it.upper, it.lower, it.level, it.gap});
    if (it.load >= 0) add({it.slope[0], it.slope[1], it.base[0], it.base[1]});
  }
  series_ = static_cast<int>(outputs_.size());
  bool reads_angles = false;
  for (const Node node : outputs_) {
    for (int i = 0; i < scene.shaftCount(); ++i) {
      reads_angles = reads_angles || scene.graph->dependsOn(node, slotOf(Source::kAngle, i));
    }
  }
  FIRST_JUDGED = reads_angles ? 0 : scene.shaftCount();
  add(formulas_.velocity_residual);
  add(formulas_.curvature);
  add(formulas_.input_slope);
  add(formulas_.set);
  add(shown_);
  const std::vector<Node> others(outputs_.begin() + static_cast<std::ptrdiff_t>(trial.size()),
                                 outputs_.end());
  try {
    return {*scene.graph, trial, others, listSlots(scene), SCENE_ORDER};
  } catch (const std::invalid_argument& error) {
    throw SceneError("", std::string("cannot be written as C: its formulas have ") + error.what());
  }
}

/// Lists the variables, which have the first rows: the time, the state, multipliers, J^-1 R and,
/// where elements hold, what they and constraints transmit, which no formula reads; sides, states,
/// inputs.
std::vector<int> MotionProgram::listSlots(const Scene& scene) {
  std::vector<int> made = {slotOf(Source::kTime)};
  for (const Source source : {Source::kAngle, Source::kVelocity, Source::kAcceleration}) {
    for (int i = 0; i < scene.shaftCount(); ++i) made.push_back(slotOf(source, i));
  }
  const int rows = scene.constraintCount() + static_cast<int>(formulas_.holds.size());
  TRANSMITS = !formulas_.holds.empty() || formulas_.has_directions ? 1 : 0;
  const int transmitted = IS_CLASSICAL != 0 || TRANSMITS == 0 ? 0 : rows;
  for (int n = 0; n < rows + scene.shaftCount() + transmitted; ++n) {
    made.push_back(slotOf(Source::kJerk, n));
  }
  for (const SceneHold& it : formulas_.holds) {
    side_row.values.push_back(static_cast<int>(made.size()));
    made.push_back(scene.graph->entry(it.side).slot);
  }
  STATE = static_cast<int>(made.size());
  const auto addRow = [&](Source source, int n, int rate) {
    input_row.values.push_back(static_cast<int>(made.size()));
    input_of_row.values.push_back(n);
    input_rate_of_row.values.push_back(rate);
    made.push_back(slotOf(source, n));
  };
  for (const SceneState& state : scene.states) addRow(Source::kInput, state.input, 0);
  for (int n = 0; n < scene.inputCount(); ++n) {
    if (scene.inputs[static_cast<std::size_t>(n)].kind == InputKind::kState) continue;
    int rate = 0;
    for (const Source source : {Source::kInput, Source::kInputRate, Source::kInputSecondRate}) {
      const bool is_read = std::any_of(outputs_.begin(), outputs_.end(), [&](Node node) {
        return scene.graph->dependsOn(node, slotOf(source, n));
      });
      if (is_read) addRow(source, n, rate);
      ++rate;
    }
  }
  return made;
}

int MotionProgram::rowOf(Node node) const {
  const auto found = std::find_if(outputs_.begin(), outputs_.end(),
                                  [&](Node it) { return it.index == node.index; });
  return program_.output(static_cast<int>(found - outputs_.begin()));
}

MotionList<int> MotionProgram::rowsOf(const std::vector<Node>& nodes) const {
  MotionList<int> rows;
  for (const Node node : nodes) rows.values.push_back(rowOf(node));
  return rows;
}

void MotionProgram::setSizes(const Scene& scene) {
  const auto anyEntry = [&](const auto& test) {
    const auto has = [&](Node node) { return test(rowOf(node)); };
    const bool found = std::any_of(formulas_.entry.begin(), formulas_.entry.end(), has) ||
                       std::any_of(formulas_.direction.begin(), formulas_.direction.end(), has);
    return found ? 1 : 0;
  };
  S = scene.shaftCount();
  CONSTRAINTS = scene.constraintCount();
  HOLDS = static_cast<int>(formulas_.holds.size());
  K = CONSTRAINTS + HOLDS;
  INPUTS = scene.inputCount();
  SIZE = S + K;
  IS_CURVED = std::any_of(formulas_.curvature.begin(), formulas_.curvature.end(),
                          [&](Node node) { return !scene.graph->isConstant(node, 0.0); });
  IS_COUPLED = isDiagonal(scene.inertia) ? 0 : 1;
  INERTIA_VARIES = formulas_.inertia_varies ? 1 : 0;
  ENTRIES_VARY = anyEntry([this](int row) { return !program_.isConstant(row); });
  ENTRIES_TURN = anyEntry([this](int row) { return program_.isAccelerated(row); });
  HAS_ORDER_1 = HOLDS > 0 || hasOrder(scene, 1, 1) ? 1 : 0;
  HAS_RESIDUAL = HOLDS > 0 || hasOrder(scene, 1, 2) ? 1 : 0;
  HAS_GIVEN_ACCELERATIONS = scene.initial.acceleration.empty() ? 0 : 1;
  MAY_PROJECT = scene.initial.project ? 1 : 0;
  // C depends on no acceleration and no input (of elements that hold, either): a jump is one
  // projection (jump_map.h).
  JUMPS_STRAIGHT =
      std::all_of(scene.constraints.begin(), scene.constraints.end(), [](const ConstraintPtr& it) {
        return it->nonlinearAccelerations() == 0 && !it->readsInputs();
      });
  COMPONENTS = IS_CLASSICAL != 0 ? 2 * S : 3 * S;
  INPUT_ROW_COUNT = static_cast<int>(input_row.values.size());
  TIME = 0;
  ANGLE = 1;
  VELOCITY = 1 + S;
  ACCELERATION = 1 + 2 * S;
  MULTIPLIER = 1 + 3 * S;
  PULL = 1 + 3 * S + K;
  TRANSMITTED = IS_CLASSICAL != 0 || TRANSMITS == 0 ? MULTIPLIER : PULL + S;
  SCENE_ROWS = rows_.rows();
  SCENE_STRIDE = (std::max(SCENE_ORDER, SeriesProgram::kAlong) + 4) / 4 * 4 + 4;
  SCENE_MODES = std::max(1, rows_.modes());
  SCENE_PIECES = std::max(1, rows_.pieces());
  const double tolerance = scene.solver.relative_tolerance;
  RELATIVE_TOLERANCE = tolerance;
  ABSOLUTE_TOLERANCE = scene.solver.absolute_tolerance;
  MAXIMUM_STEP = scene.solver.maximum_step;
  DECAY = std::pow(std::max(tolerance, 1e-16), 1.0 / SCENE_ORDER);
}

/// Finds the shafts whose reaction no C contains; these are all shafts if C and J, and so the null
/// space, are constant.
std::vector<int> MotionProgram::findNeutral(const Scene& scene) const {
  const auto shafts = static_cast<std::size_t>(S);
  std::vector<int> neutral(shafts, 1);
  bool is_constant = INERTIA_VARIES == 0;
  for (std::size_t n = 0; n < formulas_.entry.size(); ++n) {
    is_constant = is_constant && scene.graph->isConstant(formulas_.entry[n]);
    if (!scene.graph->isConstant(formulas_.entry[n], 0.0)) neutral[n % shafts] = 0;
  }
  if (is_constant) neutral.assign(shafts, 1);
  if (IS_CLASSICAL != 0 || (INERTIA_VARIES != 0 && IS_COUPLED != 0)) neutral.assign(shafts, 0);
  return neutral;
}

void MotionProgram::setLists(const Scene& scene) {
  for (const ConstraintPtr& it : scene.constraints) order_of.values.push_back(it->order());
  order_of.values.resize(static_cast<std::size_t>(K), 1);
  is_neutral.values = findNeutral(scene);
  HAS_NEUTRAL = *std::max_element(is_neutral.values.begin(), is_neutral.values.end());
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < S; ++j) coupling.values.push_back(i == j ? 0.0 : scene.inertia(i, j));
  }
  torque_row = rowsOf(formulas_.torque);
  residual_row = rowsOf(formulas_.residual);
  velocity_residual_row = rowsOf(formulas_.velocity_residual);
  entry_row = rowsOf(formulas_.entry);
  direction_row = rowsOf(formulas_.direction);
  curvature_row = rowsOf(formulas_.curvature);
  input_slope_row = rowsOf(formulas_.input_slope);
  inertia_row = rowsOf(formulas_.inertia);
  inertial_row = rowsOf(formulas_.inertial_torque);
  connection_row = rowsOf(formulas_.connection);
  for (const expression::Branch& it : formulas_.signs) {
    sign_row.values.push_back(rowOf(it.argument));
    sign_jumps.values.push_back(static_cast<int>(it.jumps));
  }
  for (const auto& [row, value] : rows_.constants()) {
    constant_row.values.push_back(row);
    constant_value.values.push_back(value);
  }
  for (const expression::Passage& it : formulas_.tables) {
    passage_row.values.push_back(rowOf(it.argument));
    passage_count.values.push_back(static_cast<int>(it.points.size()));
    passage_jumps.values.push_back(it.smoothness == 0 ? 1 : 0);
    passages.push_back(it.points);
  }
  for (const std::vector<double>& points : passages) {
    passage_points.values.push_back(points.data());
  }
  resolved.values = rows_.resolved();
  SIGNS = static_cast<int>(sign_row.values.size());
  TABLES = static_cast<int>(passages.size());
  CONSTANTS = static_cast<int>(constant_row.values.size());
  RESOLVED = static_cast<int>(resolved.values.size());
}

void MotionProgram::setInputs(const Scene& scene) {
  for (const CommandInputSettings& it : scene.inputs) {
    hold_of.values.push_back(static_cast<int>(it.hold));
    parameter_of.values.push_back(it.hold == Hold::kRateLimit        ? it.rate
                                  : it.hold == Hold::kFirstOrderHold ? it.period
                                                                     : it.time_constant);
    initial_input.values.push_back(it.initial);
    minimum_of.values.push_back(it.minimum);
    maximum_of.values.push_back(it.maximum);
    timeout_of.values.push_back(it.timeout);
    falls_to_zero.values.push_back(it.on_timeout == OnTimeout::kZero ? 1 : 0);
  }
}

/// The torques that elements hold with and their limits are series that no error of the state
/// judges.
void MotionProgram::setHolds(const expression::Graph& graph) {
  const auto watch = [&](Node node) {
    if (!graph.isConstant(node)) watched_row.values.push_back(rowOf(node));
  };
  for (int n = 0; n < K && TRANSMITS != 0; ++n) watched_row.values.push_back(TRANSMITTED + n);
  for (int m = 0; m < K; ++m) {
    const auto C = formulas_.entry.begin() + m * S;
    const bool differs = !std::equal(C, C + S, formulas_.direction.begin() + m * S);
    has_direction.values.push_back(differs ? 1 : 0);
    for (int i = 0; i < S && differs; ++i)
      watch(formulas_.direction[static_cast<std::size_t>(m * S + i)]);
  }
  for (const SceneHold& it : formulas_.holds) {
    for (const Node node : {it.upper, it.lower, it.level}) watch(node);
    load_of.values.push_back(it.load);
    for (int k = 0; k < 2; ++k) {
      const Node none = it.upper;  // where there are no losses
      slope_row.values.push_back(rowOf(it.load < 0 ? none : it.slope[k]));
      base_row.values.push_back(rowOf(it.load < 0 ? none : it.base[k]));
      if (it.load >= 0) watch(it.slope[k]);
      if (it.load >= 0) watch(it.base[k]);
    }
    slip_row.values.push_back(rowOf(it.slip));
    slide_row.values.push_back(rowOf(it.torque));
    heat_row.values.push_back(rowOf(it.power));
    upper_row.values.push_back(rowOf(it.upper));
    lower_row.values.push_back(rowOf(it.lower));
    level_row.values.push_back(rowOf(it.level));
    gap_row.values.push_back(rowOf(it.gap));
    has_upper.values.push_back(it.law.upper.has_value() ? 1 : 0);
    has_lower.values.push_back(it.law.lower.has_value() ? 1 : 0);
    has_level.values.push_back(it.law.level.has_value() ? 1 : 0);
    has_gap.values.push_back(it.law.gap.has_value() ? 1 : 0);
    slides_backward.values.push_back(it.law.slides_backward ? 1 : 0);
    begins_in.values.push_back(static_cast<int>(it.law.begins));
    restitution.values.push_back(it.law.restitution);
    closes_below.values.push_back(it.law.closes_below);
  }
  WATCHED = static_cast<int>(watched_row.values.size());
}

void MotionProgram::setMemory(const Scene& scene) {
  int count = 0;
  for (const CommandInputSettings& it : scene.inputs) {
    takes_commands.values.push_back(it.kind == InputKind::kCommanded ? 1 : 0);
    if (it.kind == InputKind::kVariable) variable_input.values.push_back(count);
    ++count;
  }
  for (const SceneState& it : scene.states) state_input.values.push_back(it.input);
  rate_row = rowsOf(formulas_.rate);
  set_row = rowsOf(formulas_.set);
  for (const SceneEvent& it : scene.events) {
    event_direction.values.push_back(static_cast<int>(it.direction));
    set_begin.values.push_back(static_cast<int>(set_input.values.size()));
    for (const auto& set : it.sets) set_input.values.push_back(set.first);
  }
  set_begin.values.push_back(static_cast<int>(set_input.values.size()));
  STATES = static_cast<int>(scene.states.size());
  VARIABLES = static_cast<int>(variable_input.values.size());
  EVENTS = static_cast<int>(scene.events.size());
  FIRST_EVENT = SIGNS - EVENTS;
}

// --- C -------------------------------------------------------------------------------------------

std::vector<int> MotionProgram::structure() const {
  expression::CodeStructure made;
  program_.addStructure(&made);
  std::vector<int>& words = made.words;
#define VARIATOR_SIM_ADD(name) words.push_back(name);
  VARIATOR_SIM_MOTION_SIZES(VARIATOR_SIM_ADD)
  VARIATOR_SIM_MOTION_EXTENTS(VARIATOR_SIM_ADD)
#undef VARIATOR_SIM_ADD
  const auto addIfShared = [&words](const auto& values) {
    if constexpr (std::is_same_v<std::decay_t<decltype(values)>, std::vector<int>>) {
      words.push_back(static_cast<int>(values.size()));
      words.insert(words.end(), values.begin(), values.end());
    }
  };
#define VARIATOR_SIM_ADD(type, name) addIfShared(name.values);  // NOLINT: a member
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_ADD)
#undef VARIATOR_SIM_ADD
  return words;
}

std::string MotionProgram::writeExtents() const {
  std::string text = "enum {\n  SCENE_SHAFTS = " + std::to_string(S) +
                     ",\n  SCENE_CONSTRAINTS = " + std::to_string(CONSTRAINTS) +
                     ",\n  SCENE_INPUTS = " + std::to_string(INPUTS) +
                     ",\n  SCENE_HOLDS = " + std::to_string(HOLDS) +
                     ",\n  SCENE_MATRIX = " + std::to_string(SIZE) + ",\n  SCENE_MOST_EVENTS = " +
                     std::to_string(HOLDS > 0 || EVENTS > 0 ? 64 : 1) +
                     ",\n  SCENE_STATES = " + std::to_string(STATES) +
                     ",\n  SCENE_VARIABLES = " + std::to_string(VARIABLES) +
                     ",\n  SCENE_EVENTS = " + std::to_string(EVENTS);
#define VARIATOR_SIM_WRITE(name) text += ",\n  " #name " = " + std::to_string(name);
  VARIATOR_SIM_MOTION_EXTENTS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  return text + "\n};\n";
}

std::string MotionProgram::writeLists(bool shares) const {
  std::string text = "enum {\n  VS_STRIDE = SCENE_STRIDE,\n  MOST_SHAFTS = " + std::to_string(S) +
                     ",\n  MOST_CONSTRAINTS = " + std::to_string(K) +
                     ",\n  MOST_HOLDS = " + std::to_string(HOLDS) +
                     ",\n  MOST_INPUTS = " + std::to_string(INPUTS) +
                     ",\n  MOST_EVENTS = " + std::to_string(EVENTS) +
                     ",\n  MOST_SIZE = " + std::to_string(SIZE);
#define VARIATOR_SIM_WRITE(name) text += ",\n  " #name " = " + std::to_string(name);
  VARIATOR_SIM_MOTION_SIZES(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  text += "\n};\n";
  if (shares) return text + writeSharedLists();
#define VARIATOR_SIM_WRITE(name) \
  text += "static const double " #name " = " + literalOf(name) + ";\n";
  VARIATOR_SIM_MOTION_NUMBERS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  text += "\n/* The rows of formulas, by shaft and constraint, and the commanded inputs */\n";
#define VARIATOR_SIM_WRITE(type, name) \
  text += arrayOf(#type, #name, name.values);  // NOLINT: a member
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_WRITE)
  VARIATOR_SIM_MOTION_COMMANDS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  std::vector<std::string> names;
  for (const std::vector<double>& points : passages) {
    names.push_back("passage_" + std::to_string(names.size()));
    text += arrayOf("double", names.back(), points);
  }
  return text + arrayOf("double *const", "passage_points", names);
}

/// Writes those lists that the structure of the scene determines, and where the others are.
std::string MotionProgram::writeSharedLists() const {
  std::string text;
  const auto add = [&text](const std::string& name, const std::vector<int>& values) {
    text += arrayOf("int", name, values);
  };
  const auto addIfShared = [&](const std::string& name, const auto& values) {
    if constexpr (std::is_same_v<std::decay_t<decltype(values)>, std::vector<int>>)
      add(name, values);
  };
#define VARIATOR_SIM_WRITE(type, name) addIfShared(#name, name.values);  // NOLINT: a member
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  return text + arrayOf("double", "timeout_of", std::vector<double>(timeout_of.values.size())) +
         R"c(#define RELATIVE_TOLERANCE it->numbers->relative_tolerance
#define ABSOLUTE_TOLERANCE it->numbers->absolute_tolerance
#define MAXIMUM_STEP m->series[0].numbers->maximum_step
#define DECAY it->numbers->decay
#define coupling it->numbers->coupling
#define constant_value m->series[0].numbers->constant_value
#define passage_points it->numbers->passage_points
#define restitution it->numbers->restitution
#define closes_below it->numbers->closes_below
#define resolved ((const struct SeriesOperation*)it->numbers->resolved)
)c";
}

std::string MotionProgram::writeResolution(bool shares) const {
  std::string text =
      std::string("\n/* ---- Whether the series show all of their functions. ---- */\n\n") +
      expression::kSeriesOperationText + expression::kSeriesResolutionText +
      expression::kSeriesRangesText;
  if (shares) return text + writeHiding();
  text += "static const struct SeriesOperation resolved[] = {\n";
  for (const expression::SeriesOperation& it : resolved.values) {
    text += "    {";
    for (const int n : {it.kind, it.result, it.second, it.a, it.b, it.degree, it.state, it.power}) {
      text += std::to_string(n) + ", ";
    }
    text += literalOf(it.f) + ", " + literalOf(it.g) + "},\n";
  }
  return text + "    {0, 0, -1, 0, -1, 0, -1, 0, 0.0, 0.0}};\n" + writeHiding();
}

/// Writes the screen of vs_is_resolved, with the reach of each row once.
std::string MotionProgram::writeHiding() const {
  const auto row = [](int n) { return "r[" + std::to_string(n) + "]"; };
  std::string reaches;
  std::string sums;
  std::set<int> reached;
  const auto reach = [&](int n) {
    const std::string name = std::to_string(n);
    if (reached.insert(n).second) {
      reaches += "  Real u" + name + ", w" + name + " = seriesReach(" + row(n) + ", p, last, &u" +
                 name + ");\n";
    }
    return "w" + name + ", u" + name;
  };
  for (const expression::SeriesOperation& op : resolved.values) {
    if (!expression::seriesMayHide(&op, 0)) continue;
    const int b = op.b < 0 ? op.a : op.b;
    if (op.degree <= SCENE_ORDER) sums += "  if (last < " + std::to_string(op.degree) + ")\n";
    sums += "  sum += seriesHides(" + std::to_string(op.kind);
    for (const int n : {op.result, op.second, op.a, b}) sums += ", " + row(n < 0 ? op.a : n);
    sums += ", " + reach(op.kind == expression::kSeriesQuotient ? b : op.a) + ", " + reach(b) +
            ", p, last);\n";
  }
  return "\n/* 0 where no operation has more unresolved than visible terms. */\n"
         "VS_INLINE Real vs_hides(const scene_series* it, const Real* p, int last) {\n"
         "  const vs_row* const r = it->row;\n  Real sum = 0.0;\n  (void)r, (void)p, "
         "(void)last;\n" +
         reaches + sums + "  return sum;\n}\n";
}

std::string MotionProgram::writeMotion(const std::string& operations, bool shares) const {
  // A function for each order, unless a scene has so many rows that compiling them takes long.
  constexpr int kMostRows = 200;
  std::string text = writeLists(shares);
  if (SCENE_ROWS <= kMostRows) text += writeOrders(shares);
  return text + operations + (shares ? "" : kTableData) + kTableFunctions +
         "\n/* ---- The scene's formulas: coefficients n ---- */\n" + rows_.write(shares) +
         writeResolution(shares) + kMotion;
}

std::string MotionProgram::writeOrders(bool in_units) const {
  std::string each = "#define VS_EACH_ORDER(X)";
  std::string here = "#define VS_ORDERS_HERE(X)";
  std::string text;
  for (int n = 1; n <= SCENE_ORDER; ++n) {
    const std::string order = std::to_string(n);
    std::ostringstream own;
    each += " X(" + order + ")";
    here += " VS_ORDER_" + order + "(X)";
    // The last unit has all else to compile.
    own << "#if UNITS == 1 || " << n << " % (UNITS - 1) == UNIT\n#define VS_ORDER_" << n << "(X) X("
        << n << ")\n#else\n#define VS_ORDER_" << n << "(X)\n#endif\n";
    text += own.str();
  }
  if (!in_units) return "#ifndef VS_SMALL\n" + each + "\n#endif\n";
  return each + "\n" + text + here +
         "\n#define VS_ORDER_STORAGE __attribute__((visibility(\"hidden\")))\n";
}

std::string MotionProgram::writeKernel() const {
  return std::string(expression::arithmeticOfCode()) +
         "#include <float.h>\n#include <math.h>\n#include <string.h>\n" + writeExtents() +
         kSceneHeader + kTableData + kExchangeData +
         writeMotion(expression::kOperationsText, true) + kExchange + kCommands + kHost +
         KernelLibrary::kLastUnit + kHostKernel + KernelLibrary::kEndOfUnit;
}

}  // namespace variator_sim
