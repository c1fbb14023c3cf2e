typedef struct {
  scene_state now;
  scene_state begun; /* where series[present] begins */
  scene_series series[2];
  int present, is_begun;
  SCENE_REAL command[SCENE_INPUTS + 1];
  int is_commanded[SCENE_INPUTS + 1];
  int has_moved, crossings;
  scene_status status;
  int passed;     /* the event of the last step, or -1 */
  int has_set;    /* 1: events have set values at the present */
  double usual;   /* length of the last step, s */
  double at_rest; /* s: that the next step may have, where the last one was still; or 0 */
  double reached; /* the end of the last step, in units */
  double damped;  /* length of the last implicit step, s (vs_settle_implicitly) */
  scene_choice choice;
  double fixed; /* s, the length of all steps, whatever their error; 0: it is chosen */
  double error; /* of the last step of such a length, in tolerances */
  double noise[SCENE_SHAFTS]; /* accelerations that rounding makes at the step's end */
  double rounding;            /* the same in tolerances; 0: not asked for, or nothing */
  double event; /* that the last step has passed, in units: from there on its end stands for all */
  double longest[SCENE_CONSTRAINTS + SCENE_HOLDS + 1]; /* that C J^-1 C' has been */
  long steps, rejections, corrections; /* the last: of accelerations, by Newton's iteration */
  int is_first; /* 1: modes are decided of a state before which there was no motion */
  SCENE_REAL memory[SCENE_SHAFTS]; /* the part of R that is not C' multiplier, while modes change */
  scene_event event_of[SCENE_MOST_EVENTS]; /* the last ones: number n at n % MOST_EVENTS */
  long events;
  int meets[SCENE_HOLDS + 1]; /* 1: an element is rigid at the present instant (impacts.h) */
  int moves[SCENE_HOLDS + 1]; /* 1: it can be stuck there behind an impact only */
  int culprit;                /* the element in another mode than it is to begin in, or -1 */
#ifndef VS_INTERPRETED
  double work[SCENE_WORK];
  int pivot[SCENE_PIVOTS];
#endif
  double culprit_torque, culprit_slip;
} scene_model;
