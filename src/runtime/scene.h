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
  SCENE_INCONSISTENT    /* the first commands contradict the scene's initial values */
} scene_status;

/* All there is to see at one instant. Torques are generalized: positive ones accelerate. */
typedef struct {
  double time;                               /* s */
  double angle[SCENE_SHAFTS];                /* rad */
  double velocity[SCENE_SHAFTS];             /* rad/s */
  double acceleration[SCENE_SHAFTS];         /* rad/s^2 */
  double applied_torque[SCENE_SHAFTS];       /* N m */
  double reaction_torque[SCENE_SHAFTS];      /* N m, of the constraints */
  double reaction_torque_rate[SCENE_SHAFTS]; /* N m/s */
  double residual[SCENE_CONSTRAINTS + 1];    /* what is left of the constraint, its own unit */
  double multiplier[SCENE_CONSTRAINTS + 1];  /* Lambda of R' = C' Lambda; of gauss, R = C' lambda */
} scene_sample;

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
} scene_state;

/* The motion from one instant as power series of its time from there, divided by the unit. */
typedef struct {
  double row[SCENE_ROWS][SCENE_STRIDE]; /* coefficients of every formula */
  double mode[SCENE_MODES];
  double piece[SCENE_PIECES]; /* polynomials of tables of two variables at the instant */
  double inverse[SCENE_SHAFTS + SCENE_CONSTRAINTS][SCENE_SHAFTS + SCENE_CONSTRAINTS];
  double size[SCENE_CONSTRAINTS + 1]; /* C J^-1 C' of each constraint */
  double unit;                        /* s, a power of 2 */
  int order;                          /* of the coefficients that are known */
  int moves[SCENE_INPUTS + 1]; /* 1: rows of the input have more than their first coefficient */
} scene_series;

typedef struct {
  scene_state now;
  scene_state begun; /* where series[present] begins */
  scene_series series[2];
  int present, is_begun;
  double command[SCENE_INPUTS + 1];
  int is_commanded[SCENE_INPUTS + 1];
  int has_moved, crossings;
  scene_status status;
  double usual;                          /* length of the last step, s */
  double longest[SCENE_CONSTRAINTS + 1]; /* that C J^-1 C' has been */
  long steps, rejections;
} scene_model;

/* None of these allocates, locks, reads a clock or keeps anything outside of the model. */

/* Time 0, the scene's initial state with consistent accelerations. */
void scene_init(scene_model* model);
/* A command at the present: it acts from here on, by the input's hold. Those of one present act
   together; of two to one input the last counts. Values are clamped to the input's limits; those
   that are not finite are refused. At time 0 a zero_order command sets the initial value. */
scene_status scene_command(scene_model* model, int input, double value);
/* Moves on by dt s. After anything but SCENE_OK the model stays at its last good state and says
   the same until scene_init. */
scene_status scene_step(scene_model* model, double dt);
/* The same up to a time, s; nothing happens where that is over. */
scene_status scene_advance_to(scene_model* model, double time);
/* The present, after its commands. */
scene_status scene_read(scene_model* model, scene_sample* sample);
/* The present, s. */
double scene_time(const scene_model* model);
/* A status as a word. */
const char* scene_status_text(scene_status status);
/* Names, as the scene has them; of inputs the topic. */
extern const char* const scene_shaft_name[SCENE_SHAFTS];
extern const char* const scene_constraint_name[SCENE_CONSTRAINTS + 1];
extern const char* const scene_input_name[SCENE_INPUTS + 1];
