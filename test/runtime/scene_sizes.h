/* A scene by hand, for a compiler to see the text of src/runtime: a swing phi'' = -sin(phi) whose
 * acceleration a second shaft follows by a constraint of order 2, epsilon_2 - 2 epsilon_1 + omega_2
 * - 2 omega_1 = 0, and an input that is added to its torque. */
enum {
  SCENE_SHAFTS = 2,
  SCENE_CONSTRAINTS = 1,
  SCENE_INPUTS = 1,
  SCENE_HOLDS = 0,
  SCENE_MOBILITY = 2,
  SCENE_MATRIX = 1,
  SCENE_WORK = 1,
  SCENE_PIVOTS = 1,
  SCENE_MOST_EVENTS = 1,
  SCENE_STATES = 0,
  SCENE_VARIABLES = 0,
  SCENE_EVENTS = 0,
  SCENE_ORDER = 18,
  SCENE_MOST_STEPS = 10000,
  SCENE_ROWS = 23,
  SCENE_STRIDE = 24,
  SCENE_MODES = 1,
  SCENE_PIECES = 1
};
