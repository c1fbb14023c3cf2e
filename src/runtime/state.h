/* The rest is private; its place is here for a model to need no memory but its own. */
typedef struct {
  int form;
  double start, target, slope, inverse_tau, linear, age, end;
} scene_signal;

/* All that the motion goes on from: a copy of it is a state to come back to. */
typedef struct {
  double time, time_rest, goal, goal_rest;
  double angle[SCENE_SHAFTS];
  double velocity[SCENE_SHAFTS];
  double acceleration[SCENE_SHAFTS];
  double multiplier[SCENE_CONSTRAINTS + 1];
  double reaction[SCENE_SHAFTS]; /* at the start */
  scene_signal input[SCENE_INPUTS + 1];
  double silence[SCENE_INPUTS + 1]; /* s since the last command; -1: there was none */
  int side[SCENE_EVENTS + 1];       /* sign of each event's function; 0 before the motion */
} scene_state;
