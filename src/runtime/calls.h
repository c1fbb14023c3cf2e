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
extern const char* const scene_hold_name[SCENE_HOLDS + 1];
extern const char* const scene_state_name[SCENE_STATES + 1];
extern const char* const scene_variable_name[SCENE_VARIABLES + 1];
extern const char* const scene_event_name[SCENE_HOLDS + SCENE_EVENTS + 1]; /* of scene_event */
