/* The data that a program which keeps the state of a motion itself exchanges with the runtime at
 * each step. */

/* The closed form of an input, as scene_signal has it (signals.h). */
typedef struct {
  int form; /* 0 constant, 1 ramp, 2 exponential, 3 critical */
  SCENE_REAL start, target, slope, inverse_tau, linear, age, end;
} vs_exchanged_signal;

/* The state of an element that holds, beside its multiplier. */
typedef struct {
  int mode, counts;
  SCENE_REAL side, heat;
} vs_exchanged_hold;

/* The past of a delayed formula: a ring of the polynomials of steps, the oldest one first. A piece
 * is VS_PIECE doubles and its coefficients (signals.h). */
typedef struct {
  double* pieces;
  int stride, capacity; /* doubles of a piece; pieces */
  int first, count;
  int is_full; /* 1: the last step had no room */
} vs_past;

typedef struct {
  /* In, at a beginning; out, the end of the step */
  SCENE_REAL time, time_rest; /* s; the sum counts */
  SCENE_REAL* state;          /* angles, velocities, accelerations: 3 S */
  SCENE_REAL* multiplier;     /* of gauss: where the iteration begins; K */
  SCENE_REAL* reaction;       /* at the start, S (of J(phi): R / sqrt(J)) */
  SCENE_REAL* longest;        /* that C J^-1 C' has been, K */
  vs_exchanged_signal* input; /* INPUTS */
  vs_exchanged_hold* hold;    /* HOLDS */
  double usual;               /* the length that the next step may have, s; 0: unknown */
  scene_choice choice;
  int* armed;    /* of events: scene_state's */
  vs_past* past; /* of delayed formulas, which the steps go on with */
  /* In */
  int begin;     /* 0: goes on from the state; 1: from the nearest one at time 0; 2: at another */
  int are_given; /* 1: the accelerations are, too; 0: those of least reaction */
  int may_move;  /* 1: to the nearest state that the constraints allow */
  /* Out */
  double made;     /* the length of the step, s */
  double stopped;  /* the instant, s, of a step that failed: its begin, or where no modes go on */
  int passed;      /* the guard that the step passed at its end, or -1 */
  int is_event;    /* 1: the step ends at an event behind which all begins anew */
  int is_still;    /* 1: nothing moves by more than the tolerance in it */
  int is_implicit; /* 1: the step is one of Radau IIA */
  long rejections, corrections;
  double error;              /* of a step of fixed length, in tolerances; 0 of others */
  double rounding;           /* of the state, as it moves accelerations, in tolerances */
  double event;              /* from where on, s of the step, its end stands for all */
  const scene_event* events; /* changes of modes, and events of the scene (host.h) */
  int event_count;
  int culprit; /* an element that cannot begin in its mode, or -1 (host.h) */
  double culprit_torque, culprit_slip; /* that it would hold, N m; rad/s */
} vs_exchange;

/* An element that holds, at an instant (scene_sample). */
typedef struct {
  int mode, counts;
  SCENE_REAL side, multiplier, torque, slip, reserve, heat;
} vs_seen_hold;

/* The quantities of one instant that a host asks for. */
typedef struct {
  SCENE_REAL *angle, *velocity, *acceleration, *torque;  /* Q; S each */
  SCENE_REAL *reaction, *reaction_rate, *covariant_rate; /* R, R', G; S */
  SCENE_REAL *residual, *multiplier;                     /* K */
  SCENE_REAL kinetic;                                    /* J */
  vs_seen_hold* hold;                                    /* of elements that hold, HOLDS */
  SCENE_REAL* on_shaft;                                  /* N m, of each on each shaft: HOLDS S */
  SCENE_REAL* input;                                     /* value, rate, second rate; 3 INPUTS */
  SCENE_REAL* jerk;                                      /* S; 0: not asked for */
} vs_seen;

/* The constants of a program whose text has none: machine code that scenes share. */
typedef struct vs_numbers {
  double relative_tolerance, absolute_tolerance, maximum_step, decay;
  const double* constants; /* of statements */
  const double* coupling;  /* the others: see the lists of these names */
  const double* constant_value;
  const double* const* passage_points;
  const vs_table* table;
  const vs_table_of_two* table_of_two;
  const void* resolved;                     /* struct SeriesOperation */
  const double *restitution, *closes_below; /* of elements that hold */
  const double* delay_of;                   /* s */
} vs_numbers;
