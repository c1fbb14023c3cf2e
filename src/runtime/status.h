/* The interface of a scene for a controller. `scene` and `SCENE` stand for its name; the includer
 * defines SCENE_SHAFTS and the other sizes. */

typedef enum {
  SCENE_OK = 0,
  SCENE_BAD_ARGUMENT,   /* a time step that is negative or not finite, an input there is not */
  SCENE_SINGULAR,       /* the constraints' derivatives by the accelerations have lost rank */
  SCENE_NOT_CONVERGED,  /* no state on the constraints was found */
  SCENE_NOT_FINITE,     /* a value is not finite here, or has no power series (sqrt(x) at x = 0) */
  SCENE_TOO_MANY_STEPS, /* SCENE_MOST_STEPS parts of a step, or parts below time's resolution */
  SCENE_CHATTERING,     /* a formula jumps where the motion turns back at once: no branch goes on */
  SCENE_NO_MOTION,      /* a jump leads to no state on the constraints */
  SCENE_INCONSISTENT,   /* the first commands contradict the scene's initial values */
  SCENE_NO_MODES,       /* no modes of the elements that hold go on: rigid ones contradict */
  SCENE_STEP_TOO_LARGE  /* the error of a step of fixed length is a large part of the state */
} scene_status;

/* A change of an element's mode, or an event of the scene, whose number follows the elements'. */
typedef struct {
  double time; /* s */
  int element, from, to;
  double torque;  /* N m, behind it */
  double impulse; /* N m s, of an impact */
} scene_event;

/* The method of steps, and what chooses it (stiffness.h). */
typedef struct {
  int method, suspicions, quiet, wait, made;
  int left;         /* implicit steps before series are tried again */
  double by_series; /* length of the steps before implicit ones, s */
  double ahead;     /* length that the next implicit one may have, s; 0: unknown */
  int is_behind;    /* 1: the last step ended on an event, where another motion begins */
  int is_first;     /* 1: the next step is the first one behind a command */
  double first;     /* length that such an implicit one may have, s; 0: unknown */
} scene_choice;
