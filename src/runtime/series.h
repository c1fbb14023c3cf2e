/* Constants of programs that share their text. */
struct vs_numbers;

/* The motion from one instant as power series of its time from there, divided by the unit. */
typedef struct {
  const struct vs_numbers* numbers;
  SCENE_REAL row[SCENE_ROWS][SCENE_STRIDE]; /* coefficients of every formula */
  double mode[SCENE_MODES];
  SCENE_REAL piece[SCENE_PIECES];      /* polynomials of tables of two variables at the instant */
  SCENE_REAL mobility[SCENE_MOBILITY]; /* J^-1, or its diagonal where no inertia is coupled */
  int has_mobility;
  SCENE_REAL inverse[SCENE_MATRIX]; /* of A, or of the whole system */
  int is_whole;
  double slack;       /* see vs_noise */
  double distance;    /* see vs_invert */
  double all_torques; /* vs_size_of_all, order 0, which each condition asks for */
  int is_in[SCENE_CONSTRAINTS + SCENE_HOLDS + 1];       /* 1: the constraint is in A */
  SCENE_REAL size[SCENE_CONSTRAINTS + SCENE_HOLDS + 1]; /* C J^-1 D' of each constraint */
  int counts[SCENE_HOLDS + 1]; /* 1: the row of an element that holds is on */
  double unit;                 /* s, a power of 2 */
  int method;                  /* by which its polynomials were made */
  int is_path;                 /* 1: see vs_order */
  int order;                   /* of the coefficients that are known */
  int moves[SCENE_INPUTS + 1]; /* 1: rows of the input have more than their first coefficient */
} scene_series;
