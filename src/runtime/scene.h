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
  /* of elements that hold */
  int mode[SCENE_HOLDS + 1];       /* -1 slides backward, 0 holds, 1 slides forward, 2 free */
  double torque[SCENE_HOLDS + 1];  /* N m, against the slip: has its sign while it slides */
  double slip[SCENE_HOLDS + 1];    /* rad/s */
  double reserve[SCENE_HOLDS + 1]; /* N m, how much more it would hold; 0 while it does not hold */
  double heat[SCENE_HOLDS + 1];    /* J since the start */
  double state[SCENE_STATES + 1];  /* that is integrated with the motion, its own unit */
  double variable[SCENE_VARIABLES + 1]; /* constant between events, its own unit */
} scene_sample;
