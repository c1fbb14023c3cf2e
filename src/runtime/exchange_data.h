/* The data that a program which keeps the state of a motion itself exchanges with the runtime at
 * each step. */

/* The closed form of an input, as scene_signal has it (inputs.h). */
typedef struct {
  int form; /* 0 constant, 1 ramp, 2 exponential, 3 critical */
  double start, target, slope, inverse_tau, linear, age, end;
} vs_exchanged_signal;

typedef struct {
  /* In, at a beginning; out, the end of a step. */
  double time, time_rest;     /* s; the sum counts */
  double* state;              /* angles, velocities, accelerations: 3 S */
  double* multiplier;         /* of gauss: where the iteration begins; K */
  double* reaction;           /* at the start, S (of J(phi): R / sqrt(J)) */
  double* longest;            /* that C J^-1 C' has been, K (host.h) */
  vs_exchanged_signal* input; /* INPUTS */
  int* side;                  /* of events: scene_state's (host.h) */
  /* In (host.h) */
  int begin;     /* 0: goes on from the state; 1: from the nearest one at time 0; 2: at another */
  int are_given; /* 1: the accelerations are, too; 0: those of least reaction */
  int may_move;  /* 1: to the nearest state that the constraints allow */
  /* In, at a beginning; out */
  double usual; /* the length that the next step may have, s; 0: unknown */
  /* Out */
  double made;               /* the length of the step, s */
  double* jerk;              /* S; 0 of gauss */
  double* torque;            /* Q and Q', S; Q' 0 of gauss */
  double* torque_rate;       /* the same */
  double* entry;             /* C, K S */
  double* size;              /* C J^-1 C' of each constraint, K */
  const double* const* rows; /* coefficients of the step: angles to accelerations, torques; 4 S */
  int last;                  /* the order of the accelerations' */
  double unit;               /* s */
  int passed;                /* the guard that the step passed at its end, or -1 */
  int is_still;              /* 1: nothing moves by more than the tolerance in it (host.h) */
  int is_event;              /* 1: the step ends at an event behind which all begins anew */
  double event;              /* of such a step: from where on its end stands for all, s */
  long rejections;
} vs_exchange;

/* What a host sees of an instant. */
typedef struct {
  double *angle, *velocity, *acceleration, *torque; /* Q; S each */
  double *reaction, *reaction_rate;                 /* R, R'; S */
  double *residual, *multiplier;                    /* K */
  double kinetic;                                   /* J */
  double* input;                                    /* of states and variables the value; INPUTS */
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
  const void* resolved; /* struct SeriesOperation */
} vs_numbers;
