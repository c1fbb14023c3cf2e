#include "emit_c/readme.h"

#include <algorithm>

#include "motion_program/c_text.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

namespace {

std::string numberOf(double value) {
  return ParameterTree::real(value).toText();
}

std::string holdOf(const CommandInputSettings& input) {
  std::string text = toString(input.hold);
  switch (input.hold) {
    case Hold::kZeroOrder:
      break;
    case Hold::kFirstOrderLag:
    case Hold::kSecondOrderLag:
      text += ", " + numberOf(input.time_constant) + " s";
      break;
    case Hold::kRateLimit:
      text += ", " + numberOf(input.rate) + " per s";
      break;
    case Hold::kFirstOrderHold:
      text += ", " + numberOf(input.period) + " s";
      break;
  }
  if (input.timeout > 0.0) {
    text += std::string("; ") + (input.on_timeout == OnTimeout::kZero ? "0" : "held") + " after " +
            numberOf(input.timeout) + " s without a command";
  }
  return text;
}

std::string tablesOf(const Scene& scene) {
  std::string text = "| index | shaft |\n|---|---|\n";
  int index = 0;
  for (const std::string& shaft : scene.shafts) {
    text += "| " + std::to_string(index++) + " | " + shaft + " |\n";
  }
  index = 0;
  const auto takes_commands = [](const auto& it) { return it.kind == InputKind::kCommanded; };
  if (std::any_of(scene.inputs.begin(), scene.inputs.end(), takes_commands)) {
    text += "\n| input | topic | first value | clamped to | hold |\n|---|---|---|---|---|\n";
  }
  for (const CommandInputSettings& input : scene.inputs) {
    const int own = index++;
    if (!takes_commands(input)) continue;
    text += "| " + std::to_string(own) + " | " + input.topic + " | " + numberOf(input.initial) +
            " | " + numberOf(input.minimum) + " .. " + numberOf(input.maximum) + " | " +
            holdOf(input) + " |\n";
  }
  index = 0;
  if (!scene.constraints.empty()) text += "\n| constraint | name | order |\n|---|---|---|\n";
  for (const ConstraintPtr& constraint : scene.constraints) {
    text += "| " + std::to_string(index++) + " | " + constraint->name() + " | " +
            std::to_string(constraint->order()) + " |\n";
  }
  return text;
}

const char* const kUse = R"md(
Freestanding C99 of one drivetrain: `scene_@.c` and `scene_@.h` need the library of mathematics and
nothing else. Nothing is allocated, and all memory is the `scene_model` that you give.

## Try it

    make
    ./scene_play --duration 10 --rate 100 --output motion.csv
    ./scene_play --duration 10 --commands commands.csv
    ./scene_play --duration 10 --events events.csv   # changes of modes, and the scene's events

`commands.csv` has the header `time,topic,value`. The columns are those of `simulate`. The exit status
is 0, 1 when the motion stopped (the reason is on standard error), 2 for bad usage.

## In a controller

    #include "scene_@.h"

    static scene_model model;           /* some kB: not on a small stack */
    scene_sample sample;

    scene_init(&model);
    for (;;) {
      scene_command(&model, 0, demand); /* an input's index; acts from the present on */
      if (scene_step(&model, 0.001) != SCENE_OK) {
        /* stopped, at the last good state: scene_status_text tells why; scene_init begins anew */
      }
      scene_read(&model, &sample);      /* angle, velocity, acceleration, torques, .. */
    }

`model.now` is the whole state: a copy of it, written back, is a way to go on from there.
)md";

const char* const kLimits = R"md(
## What it does

At each step the motion is expanded into power series of the order `SCENE_ORDER` that the scene's tolerances
ask for (relative @RELATIVE@, absolute @ABSOLUTE@). A call makes as many parts of a step as the last
coefficients ask for, and ends one where a formula changes its branch (abs, min, max, sign, if, points
of tables). A command that jumps moves the accelerations by the jump map of `simulate`.

## What it does not do

- It has one method. `solver/stepper` and `solver/step` of the scene are not read: a stiff motion costs
  many parts of a step, and `SCENE_TOO_MANY_STEPS` stops it at SCENE_MOST_STEPS of them in one call.
- Where a formula has no power series (sqrt(x) at x = 0) or no value it stops: `SCENE_NOT_FINITE`.
- It stops for `SCENE_CHATTERING` where a formula jumps and the motion turns back at once (dry friction
  by `sign` at rest; an element that holds does not), as `simulate` does.
- Commands at time 0 find the first accelerations anew by Newton's iteration from those of the scene.
  Where a constraint is not linear in the accelerations that is the stationary reaction nearby;
  `simulate` looks for the least of all.
- Commands that are clamped are not counted. Outputs of elements, energies and `outputs` of the scene
  are not emitted. States and variables are in `scene_sample`.
)md";

}  // namespace

std::string writeReadme(const Scene& scene, const std::string& name, const std::string& title) {
  // (Names from the scene are not replaced: one may contain the placeholder of the scene's name.)
  const auto complete = [&](std::string text) {
    replaceAll(text, "scene_@", name);
    replaceAll(text, "@RELATIVE@", numberOf(scene.solver.relative_tolerance));
    replaceAll(text, "@ABSOLUTE@", numberOf(scene.solver.absolute_tolerance));
    return withName(text, name);
  };
  return "# " + name + "\n\nWritten by `simulate --emit-c` from " + title + ".\n" + complete(kUse) +
         "\n" + tablesOf(scene) + complete(kLimits);
}

std::string writeMakefile(const std::string& name) {
  return "CFLAGS = -std=c99 -O2 -Wall -Wextra\n\n" + name + "_play: main.c " + name + ".c " + name +
         ".h\n\t$(CC) $(CFLAGS) -o $@ main.c " + name + ".c -lm\n\nclean:\n\trm -f " + name +
         "_play\n\n.PHONY: clean\n";
}

}  // namespace variator_sim
