#include <float.h>
#include <math.h>
#include <string.h>

#include "runtime/scene_sizes.h"
/* */
#include "runtime/status.h"
/* */
#include "runtime/scene.h"
/* */
#include "runtime/state.h"
/* */
#include "runtime/series.h"
/* */
#include "runtime/model.h"
/* */
#include "runtime/calls.h"

enum {
  S = SCENE_SHAFTS,
  CONSTRAINTS = SCENE_CONSTRAINTS,
  HOLDS = SCENE_HOLDS,
  TRANSMITS = 0,
  K = CONSTRAINTS + HOLDS,
  BLOCKS = 1,
  GROUPS = 3,
  INPUTS = SCENE_INPUTS,
  VS_STRIDE = SCENE_STRIDE,
  SIZE = S + K,
  MOST_SHAFTS = S,
  MOST_CONSTRAINTS = K,
  MOST_HOLDS = HOLDS,
  MOST_INPUTS = INPUTS,
  MOST_EVENTS = 0,
  STATES = 0,
  STATE = 10,
  VARIABLES = 0,
  EVENTS = 0,
  DELAYS = 0,
  FIRST_EVENT = 0,
  MOST_SIZE = SIZE,
  IS_CLASSICAL = 0,
  IS_CURVED = 0,
  IS_COUPLED = 0,
  INERTIA_VARIES = 0,
  IS_GENERAL = 0,
  ENTRIES_TURN = 0,
  HAS_ORDER_1 = 0,
  HAS_RESIDUAL = 1,
  HAS_GIVEN_ACCELERATIONS = 0,
  MAY_PROJECT = 0,
  HAS_NEUTRAL = 0,
  JUMPS_STRAIGHT = 1,
  COMPONENTS = 3 * S,
  FIRST_JUDGED = 0,
  SIGNS = 0,
  TABLES = 0,
  CONSTANTS = 4,
  INPUT_ROW_COUNT = 1,
  TIME = 0,
  ANGLE = 1,
  VELOCITY = 3,
  ACCELERATION = 5,
  MULTIPLIER = 7,
  PULL = 8,
  TRANSMITTED = MULTIPLIER,
  /* 10: input, 11: sin, 12: cos, 13: rate, 14: torque, 15: residual, 16 .. 19: constants 0, 1, -2,
     1 */
  ZERO = 16,
  READS_ACCELERATIONS = 0,
  CHOOSES_METHOD = 0,
  RESTS = 0,
  IS_FORMAL = 0,
  IS_GAUSS = 0,
  HAS_CONNECTION = 0,
  TOLD_MULTIPLIER = MULTIPLIER,
  HAS_SERIES = 1,
  BY_STAGES = 0,
  SERIES_LEAD = 0,
  SHOWN = 20
};
static const double RELATIVE_TOLERANCE = 1e-12, ABSOLUTE_TOLERANCE = 1e-12, MAXIMUM_STEP = 10.0,
                    DECAY = 0.21;
const char* const scene_shaft_name[] = {"swing", "follower"};
const char* const scene_constraint_name[] = {"slip", ""};
const char* const scene_input_name[] = {"torque", ""};
const char* const scene_hold_name[] = {""};
const char* const scene_state_name[] = {""};
const char* const scene_variable_name[] = {""};
static const int input_row[] = {10}, input_of_row[] = {0}, input_rate_of_row[] = {0};
static const int hold_of[] = {1}, falls_to_zero[] = {0};
static const int takes_commands[] = {1}, state_input[] = {0}, state_is_wanted[] = {0},
                 rate_row[] = {0}, variable_input[] = {0};
static const int event_direction[] = {0}, set_begin[] = {0}, set_input[] = {0}, set_row[] = {0};
static const double parameter_of[] = {0.5}, initial_input[] = {0.0}, minimum_of[] = {-1.0},
                    maximum_of[] = {1.0}, timeout_of[] = {0.0};
static const double initial_angle[] = {1.0, 0.0}, initial_velocity[] = {0.0, 0.0},
                    initial_multiplier[] = {0.0};
static const double initial_acceleration[] = {-0.84147098480789650665, -1.6829419696157930133};
static const int order_of[] = {2}, is_neutral[] = {0, 0};
static const double coupling[] = {0.0, 0.0, 0.0, 0.0};
static const int torque_row[] = {14, ZERO}, residual_row[] = {15}, velocity_residual_row[] = {ZERO};
static const int entry_begin[] = {0, 2}, entry_shaft[] = {0, 1}, entry_varies[] = {0, 0};
static const int entry_row[] = {18, 17}, direction_row[] = {18, 17}, has_direction[] = {0},
                 load_of[] = {-1}, slope_row[] = {0}, base_row[] = {0},
                 curvature_row[] = {ZERO, ZERO, ZERO, ZERO}, input_slope_row[] = {ZERO};
static const int inertia_row[] = {17, 19}, inertial_row[] = {ZERO, ZERO},
                 connection_row[] = {ZERO, ZERO}, pair_row[] = {ZERO}, turn_row[] = {ZERO};
static const int sign_row[] = {0}, sign_jumps[] = {0}, passage_row[] = {0}, passage_count[] = {0},
                 passage_jumps[] = {0};
static const double* const passage_points[] = {0};
static const int constant_row[] = {16, 17, 18, 19};
static const double constant_value[] = {0.0, 1.0, -2.0, 1e-9};
static const int entry_place[] = {0, 1}, block_begin[] = {0, 3}, block_shafts[] = {2},
                 block_unknown[] = {0, 1, 2}, block_matrix[] = {0};
static const int group_of[] = {-1, -1, 0, 1, 2, -1}, link_begin[] = {0, 2, 4, 7},
                 linked[] = {0, 2, 1, 2, 0, 1, 2}, place_of[] = {0, 1, 2},
                 envelope_begin[] = {0, 1, 0}, envelope_end[] = {3, 3, 3};
static const int shown_row[] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,
                                10, 11, 12, 13, 14, 15, 16, 17, 18, 19};
enum { WATCHED = 0 };
static const int watched_row[] = {0}, side_row[] = {0}, mode_row[] = {0}, counts_row[] = {0},
                 slip_row[] = {0}, slide_row[] = {0}, upper_row[] = {0}, lower_row[] = {0},
                 level_row[] = {0}, gap_row[] = {0}, has_upper[] = {0}, has_lower[] = {0},
                 has_level[] = {0}, has_gap[] = {0}, slides_backward[] = {0}, begins_in[] = {0};
static const double restitution[] = {0.0}, closes_below[] = {0.0}, delay_of[] = {0.0};
static const int delay_input[] = {0}, delayed_row[] = {0};
#define VS_EACH_ORDER(X) \
  X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11) X(12) X(13) X(14) X(15) X(16) X(17) X(18)

#include "runtime/operations.h"
/* */
/* */
#include "runtime/table_data.h"
/* */
#include "runtime/tables.h"

VS_INLINE void vs_given(scene_series* it, int n) {
  vs_row* const r = it->row;
  vs_differentiate(r[13], r[1], n);
  vs_sine_cosine(r[11], r[12], r[1], r[13], SCENE_ORDER, n);
  r[14][n] = r[10][n] - r[11][n];
}

VS_INLINE void vs_tried(scene_series* it, int n) {
  vs_row* const r = it->row;
  r[15][n] = r[6][n] - 2.0 * r[5][n] + r[4][n] - 2.0 * r[3][n];
}

VS_INLINE void vs_corrected(scene_series* it, int n, const Real* de) {
  it->row[15][n] += de[1] - 2.0 * de[0];
}

VS_INLINE void vs_rest(scene_series* it, int n) {
  (void)it, (void)n;
}

VS_INLINE void vs_at_once(scene_series* it, int n) {
  (void)it, (void)n;
}

#include "expression/series_operation.inc"
/* */
#include "expression/series_resolution.inc"
/* */
#include "expression/series_ranges.inc"
enum { RESOLVED = 3 };
static const struct SeriesOperation resolved[] = {
    {kSeriesSine, 11, 12, 1, -1, 99, -1, 99, 0.0, 0.0},
    {kSeriesSum, 14, -1, 10, 11, 99, -1, 99, 1.0, -1.0},
    {kSeriesSum, 15, -1, 6, 5, 99, -1, 99, 1.0, -2.0}};

static Real vs_hides(const scene_series* it, const Real* powers, int last) {
  (void)it, (void)powers, (void)last;
  return 1.0;
}

#include "runtime/radau_tables.h"
/* */
#include "runtime/signals.h"
/* */
#include "runtime/inputs.h"
/* */
#include "runtime/algebra.h"
/* */
#include "runtime/resolution.h"
/* */
#include "runtime/orders.h"
/* */
#include "runtime/roots.h"
/* */
#include "runtime/projection.h"
/* */
#include "runtime/conditions.h"
/* */
#include "runtime/impacts.h"
//
#include "runtime/modes.h"
/* */
#include "runtime/events.h"
/* */
#include "runtime/crossings.h"
/* */
#include "runtime/linear_systems.h"
/* */
#include "runtime/stages.h"
/* */
#include "runtime/implicit.h"
/* */
#include "runtime/stiffness.h"
/* */
#include "runtime/trial.h"
/* */
#include "runtime/step.h"
/* */
#include "runtime/commands.h"
/* */
#include "runtime/memory.h"
/* */
#include "runtime/interface.h"
