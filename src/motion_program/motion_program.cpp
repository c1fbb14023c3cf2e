#include "motion_program/motion_program.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

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

}  // namespace

MotionProgram::MotionProgram(const Scene& scene, std::vector<Node> shown, Steps steps)
    : stepper(steps == Steps::kByStepper || scene.solver.stepper == StepperKind::kAuto
                  ? scene.solver.stepper
                  : StepperKind::kTaylor),
      fixed_step(isFixedStep(stepper) ? scene.solver.step : 0.0),
      formulas_(collectFormulas(scene)),
      shown_(std::move(shown)),
      program_(compile(scene)) {
  setSizes(scene);
  setLists(scene);
  setInputs(scene);
  setHolds(*scene.graph);
  setMemory(scene);
  setStages(scene);
  listShown();
}

/// The rows of implicit steps that are polynomials: time and state, outputs, and arguments that the
/// check of steps reads.
void MotionProgram::listShown() {
  std::set<int> shown;
  for (int r = 0; r < STATE + STATES; ++r) shown.insert(r);
  for (std::size_t n = 0; n < series_; ++n) shown.insert(rowOf(outputs_[n]));
  for (const expression::SeriesOperation& it : resolved.values) {
    for (const int r : {it.result, it.second, it.a, it.b}) {
      if (expression::seriesMayHide(&it, 0) && r >= 0) shown.insert(r);
    }
  }
  shown_row.values.assign(shown.begin(), shown.end());
  SHOWN = static_cast<int>(shown.size());
}

/// Lists the outputs, those that are needed as series first, and makes their rows.
SeriesProgram MotionProgram::compile(const Scene& scene) {
  IS_FORMAL = isFormal(scene) ? 1 : 0;
  IS_GAUSS = scene.principle == Principle::kGauss ? 1 : 0;
  IS_CLASSICAL = IS_GAUSS != 0 && IS_FORMAL == 0 ? 1 : 0;
  SCENE_ORDER = orderFor(scene.solver);
  const auto add = [this](const std::vector<Node>& nodes) {
    outputs_.insert(outputs_.end(), nodes.begin(), nodes.end());
  };
  add(formulas_.residual);
  if (IS_CLASSICAL != 0) add(formulas_.entry);
  if (IS_CLASSICAL != 0 || formulas_.has_directions) add(formulas_.direction);
  const std::size_t tried = outputs_.size();
  if (IS_CLASSICAL == 0) add(formulas_.entry);
  add(formulas_.torque);
  add(formulas_.inertia);
  add(formulas_.inertial_torque);
  add(formulas_.connection);
  add(formulas_.pair);
  add(formulas_.turn);
  add(formulas_.rate);
  add(formulas_.delayed);
  for (const expression::Branch& it : formulas_.signs) outputs_.push_back(it.argument);
  for (const expression::Passage& it : formulas_.tables) outputs_.push_back(it.argument);
  for (const SceneHold& it : formulas_.holds) add(nodesOf(it));
  series_ = outputs_.size();
  bool reads_angles = false;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    reads_angles = reads_angles || scene.graph->dependsOn(outputs_, slotOf(Source::kAngle, i));
  }
  FIRST_JUDGED = reads_angles ? 0 : scene.shaftCount();
  add(formulas_.velocity_residual);
  add(formulas_.curvature);
  add(formulas_.input_slope);
  add(formulas_.set);
  add(shown_);
  try {
    return {*scene.graph, outputs_, tried, series_, listSlots(scene)};
  } catch (const std::invalid_argument& error) {
    throw SceneError("", std::string("the formulas have ") + error.what());
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
  const auto heldOf = [](expression::HeldValue value, int hold) {
    return slotOf(Source::kHeld, expression::heldSlot(value, hold));
  };
  // (Those of elements that hold stand where the last rows transmit.)
  const std::size_t first_held =
      1 + 3 * scene.shafts.size() + static_cast<std::size_t>(scene.constraintCount()) +
      (transmitted > 0 ? scene.shafts.size() + static_cast<std::size_t>(rows) : 0);
  int hold = 0;
  for (const SceneHold& it : formulas_.holds) {
    made[first_held + static_cast<std::size_t>(hold)] =
        heldOf(expression::HeldValue::kMultiplier, hold);
    side_row.values.push_back(static_cast<int>(made.size()));
    made.push_back(scene.graph->entry(it.side).slot);
    mode_row.values.push_back(static_cast<int>(made.size()));
    made.push_back(heldOf(expression::HeldValue::kMode, hold));
    counts_row.values.push_back(static_cast<int>(made.size()));
    made.push_back(heldOf(expression::HeldValue::kCounts, hold++));
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
      const bool is_read = scene.graph->dependsOn(outputs_, slotOf(source, n));
      if (is_read) addRow(source, n, rate);
      ++rate;
    }
  }
  return made;
}

MotionList<int> MotionProgram::rowsOf(const std::vector<Node>& nodes) const {
  MotionList<int> rows;
  for (const Node node : nodes) rows.values.push_back(rowOf(node));
  return rows;
}

bool MotionProgram::areAccelerated(const MotionList<int>& rows) const {
  return std::any_of(rows.values.begin(), rows.values.end(),
                     [this](int row) { return program_.isAccelerated(row); });
}

void MotionProgram::setSizes(const Scene& scene) {
  S = scene.shaftCount();
  CONSTRAINTS = scene.constraintCount();
  HOLDS = static_cast<int>(formulas_.holds.size());
  K = CONSTRAINTS + HOLDS;
  INPUTS = scene.inputCount();
  SIZE = S + K;
  IS_CURVED = std::any_of(formulas_.curvature.begin(), formulas_.curvature.end(),
                          [&](Node node) { return !scene.graph->isConstant(node, 0.0); });
  IS_GENERAL = formulas_.pair.empty() ? 0 : 1;
  IS_COUPLED = scene.inertia.isDiagonal(0.0) && IS_GENERAL == 0 ? 0 : 1;
  INERTIA_VARIES = formulas_.inertia_varies ? 1 : 0;
  HAS_CONNECTION = INERTIA_VARIES != 0 && IS_GAUSS == 0 ? 1 : 0;
  HAS_GIVEN_ACCELERATIONS = scene.initial.acceleration.empty() ? 0 : 1;
  MAY_PROJECT = scene.initial.project ? 1 : 0;
  // C depends on no acceleration and no input (of elements that hold, either): a jump is one
  // projection (jump_map.h).
  JUMPS_STRAIGHT =
      std::all_of(scene.constraints.begin(), scene.constraints.end(), [](const ConstraintPtr& it) {
        return it->nonlinearAccelerations().none() && !it->readsInputs();
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
  TOLD_MULTIPLIER = IS_FORMAL != 0 ? TRANSMITTED : MULTIPLIER;
  SCENE_ROWS = program_.rows();
  SCENE_STRIDE = (std::max(SCENE_ORDER, SeriesProgram::kAlong) + 4) / 4 * 4 + 4;
  SCENE_MODES = std::max(1, program_.modes());
  SCENE_PIECES = std::max(1, program_.pieces());
  SCENE_MOBILITY = IS_COUPLED != 0 ? S * S : S;
  const double tolerance = scene.solver.relative_tolerance;
  RELATIVE_TOLERANCE = tolerance;
  ABSOLUTE_TOLERANCE = scene.solver.absolute_tolerance;
  MAXIMUM_STEP = std::max(scene.solver.maximum_step, fixed_step);
  DECAY = std::pow(std::max(tolerance, 1e-16), 1.0 / SCENE_ORDER);
}

/// The memory of implicit steps (vs_stages).
void MotionProgram::setStages(const Scene& scene) {
  constexpr int kStages = 5;
  constexpr int kPairs = 2;
  const bool reads =
      (IS_GAUSS != 0 && IS_CURVED != 0) || areAccelerated(torque_row) || areAccelerated(rate_row);
  READS_ACCELERATIONS = reads ? 1 : 0;
  const bool reads_time = scene.graph->dependsOn(outputs_, slotOf(Source::kTime));
  RESTS = scene.solver.sleep && !reads_time ? 1 : 0;
  CHOOSES_METHOD = stepper == StepperKind::kAuto ? 1 : 0;
  HAS_SERIES = formulas_.no_text ? 0 : 1;
  requireSeries();
  const bool is_by_series = stepper == StepperKind::kAuto || stepper == StepperKind::kTaylor ||
                            stepper == StepperKind::kTaylorFixed;
  BY_STAGES = HAS_SERIES == 0 || !is_by_series ? 1 : 0;
  SERIES_LEAD = BY_STAGES != 0 && HAS_SERIES != 0 ? 1 : 0;
  const int unknowns = SIZE + STATES;
  const int directions = 3 * S + STATES;
  SCENE_WORK = 3 * kStages * unknowns + 2 * (kStages + 1) * S + kStages * INPUT_ROW_COUNT +
               3 * SCENE_ROWS + S + directions * (unknowns + S) +
               (1 + 2 * kPairs) * unknowns * unknowns;
  SCENE_PIVOTS = 3 * (1 + kPairs) * unknowns;
  const Links links = findLinks(scene);
  listPlaces(links);
  listGroups(links);
  if (CHOOSES_METHOD == 0 && BY_STAGES == 0) SCENE_WORK = SCENE_PIVOTS = 1;
}

void MotionProgram::requireSeries() const {
  if (HAS_SERIES != 0 || (stepper != StepperKind::kTaylor && stepper != StepperKind::kTaylorFixed))
    return;
  throw SceneError("solver/stepper", inQuotes(toString(stepper)) +
                                         " needs a motion that has power series, and this one has "
                                         "none: " +
                                         inQuotes(formulas_.no_text->keyPath()) +
                                         " calls a function of its plugin; allowed here: auto and "
                                         "all the others");
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
  if (IS_FORMAL != 0) neutral.assign(shafts, 1);  // R - D' lambda = 0
  return neutral;
}

void MotionProgram::setLists(const Scene& scene) {
  for (const ConstraintPtr& it : scene.constraints) order_of.values.push_back(it->order());
  order_of.values.resize(static_cast<std::size_t>(K), 1);
  const int lowest = K > 0 ? *std::min_element(order_of.values.begin(), order_of.values.end()) : 3;
  HAS_ORDER_1 = lowest == 1 ? 1 : 0;
  HAS_RESIDUAL = lowest < 3 ? 1 : 0;
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
  ENTRIES_TURN = areAccelerated(entry_row) || areAccelerated(direction_row) ? 1 : 0;
  listEntries(*scene.graph);
  listBlocks(scene);
  curvature_row = rowsOf(formulas_.curvature);
  input_slope_row = rowsOf(formulas_.input_slope);
  inertia_row = rowsOf(formulas_.inertia);
  inertial_row = rowsOf(formulas_.inertial_torque);
  connection_row = rowsOf(formulas_.connection);
  pair_row = rowsOf(formulas_.pair);
  turn_row = rowsOf(formulas_.turn);
  for (const expression::Branch& it : formulas_.signs) {
    sign_row.values.push_back(rowOf(it.argument));
    sign_jumps.values.push_back(static_cast<int>(it.jumps));
  }
  for (const auto& [row, value] : program_.constants()) {
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
  resolved.values = program_.resolved();
  SIGNS = static_cast<int>(sign_row.values.size());
  TABLES = static_cast<int>(passages.size());
  SCENE_MODES += SIGNS + TABLES;  // VS_RESTS
  CONSTANTS = static_cast<int>(constant_row.values.size());
  RESOLVED = static_cast<int>(resolved.values.size());
}

/// The shafts of each constraint: those on which C or D is not zero everywhere.
void MotionProgram::listEntries(const expression::Graph& graph) {
  std::size_t n = 0;
  for (int p = 0; p < K; ++p) {
    entry_begin.values.push_back(static_cast<int>(entry_shaft.values.size()));
    for (int i = 0; i < S; ++i, ++n) {
      const Node C = formulas_.entry[n];
      const Node D = formulas_.direction[n];
      if (graph.isConstant(C, 0.0) && graph.isConstant(D, 0.0)) continue;
      entry_shaft.values.push_back(i);
      entry_varies.values.push_back(graph.isConstant(C) && graph.isConstant(D) ? 0 : 1);
    }
  }
  entry_begin.values.push_back(static_cast<int>(entry_shaft.values.size()));
}

void MotionProgram::setInputs(const Scene& scene) {
  for (const CommandInputSettings& it : scene.inputs) {
    hold_of.values.push_back(static_cast<int>(it.hold));
    parameter_of.values.push_back(it.hold_parameter);
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
    const bool differs =
        IS_FORMAL != 0 || !std::equal(C, C + S, formulas_.direction.begin() + m * S);
    has_direction.values.push_back(differs ? 1 : 0);
    for (int i = 0; i < S && differs; ++i)
      watch(formulas_.direction[static_cast<std::size_t>(m) * static_cast<std::size_t>(S) +
                                static_cast<std::size_t>(i)]);
  }
  for (const Node node : formulas_.pair) watch(node);
  for (const Node node : formulas_.turn) watch(node);
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
  for (const Node node : formulas_.delayed) watch(node);
  WATCHED = static_cast<int>(watched_row.values.size());
}

void MotionProgram::setMemory(const Scene& scene) {
  int count = 0;
  for (const CommandInputSettings& it : scene.inputs) {
    takes_commands.values.push_back(it.kind == InputKind::kCommanded ? 1 : 0);
    if (it.kind == InputKind::kDelayed) {
      delay_input.values.push_back(count);
      delay_of.values.push_back(it.delay);
    }
    if (it.kind == InputKind::kVariable) variable_input.values.push_back(count);
    ++count;
  }
  for (const SceneState& it : scene.states) {
    state_input.values.push_back(it.input);
    state_is_wanted.values.push_back(it.is_read ? 1 : 0);
  }
  delayed_row = rowsOf(formulas_.delayed);
  DELAYS = static_cast<int>(delay_input.values.size());
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

std::vector<const MotionList<double>*> MotionProgram::numberLists() const {
  return {&coupling,      &constant_value, &restitution, &closes_below, &parameter_of,
          &initial_input, &minimum_of,     &maximum_of,  &timeout_of};
}

std::vector<double> MotionProgram::numbers() const {
  std::vector<double> made = program_.numbers();
  const auto add = [&made](const std::vector<double>& more) {
    made.insert(made.end(), more.begin(), more.end());
  };
  for (const expression::DenseTable& it : program_.tables()) {
    for (const std::vector<double>& axis : it.points) add(axis);
    add(it.pieces);
  }
  for (const std::vector<double>& it : passages) add(it);
  for (const MotionList<double>* it : numberLists()) add(it->values);
  return made;
}

std::vector<double> MotionProgram::otherNumbers() const {
  std::vector<double> made = {fixed_step, RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE, MAXIMUM_STEP,
                              DECAY};
  made.insert(made.end(), delay_of.values.begin(), delay_of.values.end());
  return made;
}

}  // namespace variator_sim
