/* Plays a file of commands (time,topic,value) into a CSV. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene.h"

typedef struct {
  double time, value;
  int input;
} command;

#ifndef MOST_COMMANDS
#define MOST_COMMANDS 10000
#endif

static command commands[MOST_COMMANDS];
static int command_count;
static scene_model model;
static FILE* events;
static long written_events;

static int fail(const char* where, const char* what) {
  fprintf(stderr, "%s: %s\n", where, what);
  return 2;
}

static int find_input(const char* name) {
  int i;
  for (i = 0; i < SCENE_INPUTS; ++i) {
    if (name[0] != '\0' && strcmp(scene_input_name[i], name) == 0) return i;
  }
  return -1;
}

/* time,topic,value in any order of time */
static int read_commands(const char* path) {
  FILE* const file = fopen(path, "r");
  char line[512];
  int has_header = 0;
  if (file == NULL) return fail(path, "cannot be read");
  while (fgets(line, (int)sizeof line, file) != NULL) {
    command read;
    char *topic, *value, *end, *value_end;
    const size_t length = strcspn(line, "\n");
    int i;
    if (line[length] == '\0' && (length == 0 || length + 1 == sizeof line)) {
      return fail(path, "a line is too long");
    }
    line[strcspn(line, "\r\n")] = '\0';
    if (line[strspn(line, " \t")] == '\0' || line[0] == '#') continue;
    if (!has_header) {
      has_header = strcmp(line, "time,topic,value") == 0;
      if (!has_header) return fail(path, "the header is not time,topic,value");
      continue;
    }
    topic = strchr(line, ',');
    value = topic == NULL ? NULL : strchr(topic + 1, ',');
    if (value == NULL) return fail(line, "not three columns");
    *topic++ = *value++ = '\0';
    read.time = strtod(line, &end);
    read.value = strtod(value, &value_end);
    read.input = find_input(topic);
    if (end == line || *end != '\0' || !isfinite(read.time) || read.time < 0.0) {
      return fail(line, "not a time");
    }
    if (value_end == value || *value_end != '\0') return fail(value, "not a number");
    if (read.input < 0) return fail(topic, "the scene has no such topic");
    if (command_count == MOST_COMMANDS) {
      fprintf(stderr, "%s: more than %d commands: compile main.c with a larger -DMOST_COMMANDS=N\n",
              path, MOST_COMMANDS);
      return 2;
    }
    for (i = command_count++; i > 0 && commands[i - 1].time > read.time; --i) {
      commands[i] = commands[i - 1];
    }
    commands[i] = read;
  }
  fclose(file);
  return has_header ? 0 : fail(path, "no header time,topic,value");
}

static void write_header(FILE* out) {
  static const char* const columns[] = {"angle",           "velocity",
                                        "acceleration",    "applied_torque",
                                        "reaction_torque", "reaction_torque_rate"};
  static const char* const of_holds[] = {"mode", "torque", "slip", "reserve", "heat"};
  int i, c;
  fputs("time", out);
  for (i = 0; i < SCENE_SHAFTS; ++i) {
    for (c = 0; c < 6; ++c) fprintf(out, ",%s/%s", scene_shaft_name[i], columns[c]);
  }
  for (i = 0; i < SCENE_CONSTRAINTS; ++i) {
    fprintf(out, ",%s/residual,%s/multiplier", scene_constraint_name[i], scene_constraint_name[i]);
  }
  for (i = 0; i < SCENE_HOLDS; ++i) {
    for (c = 0; c < 5; ++c) fprintf(out, ",%s/%s", scene_hold_name[i], of_holds[c]);
  }
  for (i = 0; i < SCENE_STATES; ++i) fprintf(out, ",states/%s", scene_state_name[i]);
  for (i = 0; i < SCENE_VARIABLES; ++i) fprintf(out, ",variables/%s", scene_variable_name[i]);
  fputc('\n', out);
}

static void write_sample(FILE* out, double time, const scene_sample* sample) {
  int i;
  fprintf(out, "%.17g", time);
  for (i = 0; i < SCENE_SHAFTS; ++i) {
    fprintf(out, ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", sample->angle[i], sample->velocity[i],
            sample->acceleration[i], sample->applied_torque[i], sample->reaction_torque[i],
            sample->reaction_torque_rate[i]);
  }
  for (i = 0; i < SCENE_CONSTRAINTS; ++i) {
    fprintf(out, ",%.17g,%.17g", sample->residual[i], sample->multiplier[i]);
  }
  for (i = 0; i < SCENE_HOLDS; ++i) {
    fprintf(out, ",%d,%.17g,%.17g,%.17g,%.17g", sample->mode[i], sample->torque[i], sample->slip[i],
            sample->reserve[i], sample->heat[i]);
  }
  for (i = 0; i < SCENE_STATES; ++i) fprintf(out, ",%.17g", sample->state[i]);
  for (i = 0; i < SCENE_VARIABLES; ++i) fprintf(out, ",%.17g", sample->variable[i]);
  fputc('\n', out);
}

/* Changes of modes and events since the last call. */
static void write_events(void) {
  static const char* const modes[] = {"backward", "stuck", "forward", "free", "below", "above"};
  if (written_events < model.events - SCENE_MOST_EVENTS)
    written_events = model.events - SCENE_MOST_EVENTS; /* older ones are lost */
  for (; events != NULL && written_events < model.events; ++written_events) {
    const scene_event* const it = &model.event_of[written_events % SCENE_MOST_EVENTS];
    fprintf(events, "%.17g,%s,%s,%s,%.17g,%.17g\n", it->time, scene_event_name[it->element],
            modes[it->from + 1], modes[it->to + 1], it->torque, it->impulse);
  }
}

/* Samples at k / rate and at the end, commands at their times. */
static scene_status play(FILE* out, double duration, double rate) {
  scene_sample sample;
  scene_status status = SCENE_OK;
  double index = 0.0;
  int next = 0;
  scene_init(&model);
  write_header(out);
  while (status == SCENE_OK) {
    const double sampled = fmin(index / rate, duration);
    const double commanded = next < command_count ? commands[next].time : INFINITY;
    const double time = fmin(sampled, commanded);
    status = scene_advance_to(&model, time);
    write_events();
    if (status != SCENE_OK) break;
    for (; next < command_count && commands[next].time <= time; ++next) {
      if (scene_command(&model, commands[next].input, commands[next].value) != SCENE_OK) {
        fprintf(stderr, "a command is refused: it is not finite\n");
      }
    }
    if (sampled > time) continue;
    status = scene_read(&model, &sample);
    write_events();
    if (status != SCENE_OK) break;
    write_sample(out, time, &sample);
    if (time >= duration) return SCENE_OK;
    index += 1.0;
  }
  fprintf(stderr, "stopped at %.17g s: %s\n", scene_time(&model), scene_status_text(status));
  return status;
}

int main(int argc, char** argv) {
  double duration = -1.0;
  double rate = 100.0;
  FILE* out = stdout;
  const char* path = NULL;
  scene_status status;
  int i;
  for (i = 1; i < argc; i += 2) {
    char* end = NULL;
    int is_number = 0;
    double number;
    if (i + 1 == argc)
      return fail(argv[i],
                  "needs a value (--duration S [--rate HZ] "
                  "[--commands FILE.csv] [--output FILE.csv] [--events FILE.csv])");
    number = strtod(argv[i + 1], &end);
    is_number = end != argv[i + 1] && *end == '\0' && isfinite(number);
    if (strcmp(argv[i], "--commands") == 0) {
      if (read_commands(argv[i + 1]) != 0) return 2;
    } else if (strcmp(argv[i], "--events") == 0) {
      events = fopen(argv[i + 1], "w");
      if (events == NULL) return fail(argv[i + 1], "cannot be written");
      fputs("time,element,from,to,torque,impulse\n", events);
    } else if (strcmp(argv[i], "--output") == 0) {
      path = argv[i + 1];
    } else if (strcmp(argv[i], "--duration") == 0 && is_number && number >= 0.0) {
      duration = number;
    } else if (strcmp(argv[i], "--rate") == 0 && is_number && number > 0.0) {
      rate = number;
    } else {
      return fail(argv[i], "not an option, or not a value of it");
    }
  }
  if (duration < 0.0) return fail("--duration", "is missing (s)");
  if (path != NULL) out = fopen(path, "w");
  if (out == NULL) return fail(path, "cannot be written");
  status = play(out, duration, rate);
  if (events != NULL && fclose(events) != 0) return fail("the events", "could not be written");
  if (fflush(out) != 0 || ferror(out)) return fail("the output", "could not be written");
  return status == SCENE_OK ? 0 : 1;
}
