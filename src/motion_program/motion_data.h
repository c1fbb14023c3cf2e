/// The numbers, flags and lists of a scene that the texts of src/runtime read.
#pragma once

#include <vector>

#include "expression/series_operation.h"

namespace variator_sim {

/// Constants that the texts read as an array.
template <class Value>
struct MotionList {
  std::vector<Value> values;

  operator const Value*() const { return values.data(); }  // NOLINT: as an array does
};

// clang-format off
// The names are those of the texts: numbers of things and flags,
#define VARIATOR_SIM_MOTION_SIZES(F)                                                          \
  F(S) F(K) F(BLOCKS) F(GROUPS) F(CONSTRAINTS) F(HOLDS) F(TRANSMITS) F(WATCHED) F(INPUTS) F(SIZE) F(IS_CLASSICAL) \
  F(IS_FORMAL) F(IS_GAUSS) F(HAS_CONNECTION) F(TOLD_MULTIPLIER)                          \
  F(IS_CURVED) F(IS_COUPLED) F(INERTIA_VARIES) F(IS_GENERAL) F(ENTRIES_TURN)                   \
  F(HAS_ORDER_1) F(HAS_RESIDUAL) F(HAS_GIVEN_ACCELERATIONS)                                   \
  F(MAY_PROJECT) F(HAS_NEUTRAL) F(JUMPS_STRAIGHT) F(COMPONENTS) F(FIRST_JUDGED) F(SIGNS)      \
  F(TABLES) F(CONSTANTS) F(INPUT_ROW_COUNT) F(RESOLVED) F(STATES) F(STATE) F(VARIABLES)       \
  F(EVENTS) F(FIRST_EVENT) F(DELAYS) F(READS_ACCELERATIONS) F(CHOOSES_METHOD) F(RESTS)       \
  F(HAS_SERIES) F(BY_STAGES) F(SERIES_LEAD) F(SHOWN)                                          \
  F(TIME) F(ANGLE) F(VELOCITY) F(ACCELERATION) F(MULTIPLIER) F(PULL) F(TRANSMITTED)
// the sizes of a series,
#define VARIATOR_SIM_MOTION_EXTENTS(F) \
  F(SCENE_ORDER) F(SCENE_ROWS) F(SCENE_STRIDE) F(SCENE_MODES) F(SCENE_PIECES) \
  F(SCENE_MOBILITY) F(SCENE_MATRIX) F(SCENE_WORK) F(SCENE_PIVOTS)
// numbers,
#define VARIATOR_SIM_MOTION_NUMBERS(F) \
  F(RELATIVE_TOLERANCE) F(ABSOLUTE_TOLERANCE) F(MAXIMUM_STEP) F(DECAY)
// and lists: rows of formulas by shaft and constraint, inputs, points of tables, elements that hold.
#define VARIATOR_SIM_MOTION_LISTS(F)                                                            \
  F(int, order_of) F(int, is_neutral) F(int, shown_row) F(int, torque_row)                    \
  F(int, residual_row) F(int, velocity_residual_row) F(int, entry_row) F(int, direction_row)    \
  F(int, has_direction) F(int, entry_begin) F(int, entry_shaft) F(int, entry_varies)         \
  F(int, entry_place) F(int, block_begin) F(int, block_shafts) F(int, block_unknown)            \
  F(int, block_matrix) F(int, group_of) F(int, link_begin) F(int, linked) F(int, place_of)       \
  F(int, envelope_begin) F(int, envelope_end)                                                   \
  F(int, load_of) F(int, slope_row) F(int, base_row) F(int, curvature_row) \
  F(int, input_slope_row) F(int, inertia_row) F(int, inertial_row) F(int, connection_row)       \
  F(int, pair_row) F(int, turn_row)                                                             \
  F(int, sign_row) F(int, sign_jumps) F(int, constant_row)            \
  F(int, input_row) F(int, input_of_row) F(int, input_rate_of_row)        \
  F(int, passage_row) F(int, passage_count) F(int, passage_jumps)                               \
  F(int, watched_row) F(int, side_row) F(int, mode_row) F(int, counts_row) F(int, slip_row)     \
  F(int, slide_row)                                                                             \
  F(int, upper_row) F(int, lower_row) F(int, level_row) F(int, gap_row) F(int, has_upper)       \
  F(int, has_lower) F(int, has_level) F(int, has_gap) F(int, slides_backward)                   \
  F(int, begins_in)                                                                             \
  F(int, takes_commands) F(int, state_input) F(int, state_is_wanted) F(int, rate_row) F(int, variable_input)                \
  F(int, delay_input) F(int, delayed_row)                                    \
  F(int, event_direction) F(int, set_begin) F(int, set_input) F(int, set_row)
// Lists of numbers, which kernels read from vs_numbers (but timeouts, which are their host's).
#define VARIATOR_SIM_MOTION_NUMBER_LISTS(F)                                                     \
  F(double, coupling) F(double, constant_value) F(double, timeout_of) F(double, restitution)    \
  F(double, closes_below) F(double, delay_of)
// Lists of commands, which kernels leave to their host: one suits all holds of an input.
#define VARIATOR_SIM_MOTION_COMMANDS(F)                                                         \
  F(int, hold_of) F(double, parameter_of) F(double, initial_input) F(double, minimum_of)        \
  F(double, maximum_of) F(int, falls_to_zero)
// clang-format on

struct MotionData {
// NOLINTBEGIN(readability-identifier-naming,bugprone-macro-parentheses): names of C
#define VARIATOR_SIM_SIZE(name) int name = 0;
#define VARIATOR_SIM_NUMBER(name) double name = 0.0;
#define VARIATOR_SIM_LIST(type, name) MotionList<type> name;
  VARIATOR_SIM_MOTION_SIZES(VARIATOR_SIM_SIZE)
  VARIATOR_SIM_MOTION_EXTENTS(VARIATOR_SIM_SIZE)
  VARIATOR_SIM_MOTION_NUMBERS(VARIATOR_SIM_NUMBER)
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_LIST)
  VARIATOR_SIM_MOTION_NUMBER_LISTS(VARIATOR_SIM_LIST)
  VARIATOR_SIM_MOTION_COMMANDS(VARIATOR_SIM_LIST)
#undef VARIATOR_SIM_SIZE
#undef VARIATOR_SIM_NUMBER
#undef VARIATOR_SIM_LIST
  // NOLINTEND(readability-identifier-naming,bugprone-macro-parentheses)
  std::vector<std::vector<double>> passages;         ///< points of each
  MotionList<const double*> passage_points;          ///< the same, as an array
  MotionList<expression::SeriesOperation> resolved;  ///< operations of rows that are series
};

}  // namespace variator_sim
