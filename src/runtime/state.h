/* The numbers of a motion. */
#ifndef SCENE_REAL
#define SCENE_REAL double
#endif

/* The rest is private; its place is here for a model to need no memory but its own. */
typedef struct {
  int form;
  SCENE_REAL start, target, slope, inverse_tau, linear, age, end;
  const double* piece; /* of the past, of a delayed formula */
} scene_signal;

/* All that the motion goes on from: a copy of it is a state to come back to. */
typedef struct {
  SCENE_REAL time, time_rest, goal, goal_rest;
  SCENE_REAL angle[SCENE_SHAFTS];
  SCENE_REAL velocity[SCENE_SHAFTS];
  SCENE_REAL acceleration[SCENE_SHAFTS];
  /* lambda of gauss; with elements that hold its like otherwise, the integral of Lambda */
  SCENE_REAL multiplier[SCENE_CONSTRAINTS + SCENE_HOLDS + 1];
  SCENE_REAL reaction[SCENE_SHAFTS]; /* at the start */
  int mode[SCENE_HOLDS + 1];
  SCENE_REAL
  side[SCENE_HOLDS + 1];       /* of formulas: 1, -1, 0; larger at a limit that others hold, too */
  int told[SCENE_HOLDS + 1];   /* the modes that formulas read and samples show (vs_told_mode) */
  int counts[SCENE_HOLDS + 1]; /* 1: the row of an element that holds is independent of others */
  SCENE_REAL heat[SCENE_HOLDS + 1];
  scene_signal input[SCENE_INPUTS + 1];
  double silence[SCENE_INPUTS + 1]; /* s since the last command; -1: there was none */
  int armed[SCENE_EVENTS + 1];      /* sign of each event's function; 0 before the motion */
} scene_state;
