#!/usr/bin/python3
"""Scenes written as C: they compile without a warning, agree with `simulate`, allocate nothing."""

import pathlib
import re
import shutil

import roslib.packages
import rosunit

from support.scenes import scene_text
from support.simulate import SIMULATE, call, parse
from support.subtests import FolderTestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]

# Symbols of the library of mathematics, and those that compilers add on their own account.
FREESTANDING = set("""acos asin atan atan2 cos cosh exp expm1 fabs fmax fmin frexp ldexp log pow sin
                      sincos sinh sqrt tan tanh memcpy memset memmove __stack_chk_fail
                      _GLOBAL_OFFSET_TABLE_""".split())


def plant(*keys, motor="8*(1-w1/40)", variator="0.3*(e2-0.8*e1)+w2-0.8*w1"):
    return scene_text("drive 0.5, load 1.2", [
        f"motor on drive: {motor}", "drag on load: -0.1*w2", f"variator: {variator}"], *keys)


class Scene:
    def __init__(self, scene, commands="", duration=5.0, rate=50.0, allowed=1e-8):
        self.scene = scene
        self.commands = commands
        self.duration = duration
        self.rate = rate
        self.allowed = allowed


def shipped(path, **options):
    path = FOLDER / path
    commands = path.with_suffix(".csv")
    text = commands.read_text() if commands.exists() else ""
    return Scene(path.read_text(), text, **options)


EDGES = (FOLDER / "test/scenes/c/edges.yaml").read_text()
BRAKE = (FOLDER / "test/scenes/c/edges.csv").read_text()
GAUSS = EDGES.replace("initial:", "principle: gauss\ninitial:").replace("0.01*(e1^2+e1*e2)+", "")

# The same where the least reaction is followed along a curved constraint.
CURVED = EDGES.replace("initial:", "principle: gauss\ninitial:")

# A ratio that bends beside a constraint whose C turns with the accelerations: they jump along a curve.
BENT_CURVED = (FOLDER / "test/scenes/c/bent.yaml").read_text().replace("[ratio, jerk]", "[ratio, power]").replace(
    'jerk: {type: variator_sim/ExpressionConstraint, order: 3, expression: "j2-0.3*j1-cos(t)"}',
    "power: {type: variator_sim/PowerFlow, shafts: [a, b], inertias: [1.0, 2.0], efficiency: 0.8,"
    " smoothing_power: 2.0}")

SCENES = {
    "ship": shipped("config/ship.yaml", allowed=1e-7),
    "demo": Scene((FOLDER / "config/ship.yaml").read_text(),
                  (FOLDER / "config/demo_profile.csv").read_text(), 12.0, allowed=1e-6),
    "ratio_steps": shipped("config/ratio_steps.yaml", allowed=1e-7),
    "order_1": shipped("benchmark/scenes/order1.yaml", allowed=1e-7),
    "order_3": shipped("benchmark/scenes/order3.yaml", allowed=1e-7),
    # (Its reaction rates jump at 6 s, which is no instant of these.)
    "machine_tool": shipped("config/applications/machine_tool.yaml", duration=20.0, rate=33.3,
                            allowed=1e-7),
    "gauss": Scene(GAUSS, BRAKE),
    "curved": Scene(CURVED, "time,topic,value\n1.5,brake,1\n2.505,brake,0\n"),
    "bent_curved": Scene(BENT_CURVED),
    # (Sampled rarely: each call steps to its end.)
    "flat": shipped("test/scenes/c/flat.yaml", duration=20.0, rate=0.25),
    "two_constraints_gauss": Scene((FOLDER / "test/scenes/c/two_constraints.yaml").read_text().replace(
        "generalized_gauss", "gauss")),
    **{name: shipped(f"test/scenes/c/{name}.yaml")
       for name in ("tables", "edges", "holds", "bent", "two_constraints", "lines", "memory")},
}


class EmitCTest(FolderTestCase):
    def need(self, *programs):
        for program in programs:
            if shutil.which(program) is None:
                self.skipTest(f"{program} is not installed (scripts/install_dependencies --with-tests)")

    def emit(self, name, scene):
        """The folder of its program."""
        path = self.folder / f"{name}.yaml"
        path.write_text(scene)
        done = call(SIMULATE, path, "--emit-c", self.folder / name)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, "")
        return self.folder / name

    def compile(self, name, compiler, *options):
        """Compiles it; with -O2 as users do, else with less to compile, to the same bits."""
        folder = self.folder / name
        program = folder / "play"
        small = [] if "-O2" in options else ["-DVS_SMALL"]
        done = call(compiler, *STRICT, *small, *options, "-o", program, folder / "main.c",
                    folder / f"{name}.c", "-lm")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return program

    def arguments(self, name):
        scene = SCENES[name]
        words = ["--duration", str(scene.duration), "--rate", str(scene.rate)]
        if scene.commands:
            path = self.folder / f"{name}.csv"
            path.write_text(scene.commands)
            words += ["--commands", str(path)]
        return words

    def compare(self, expected, got, allowed):
        """In parts of 1 + the largest magnitude of a column."""
        self.assertEqual(expected[0], got[0])
        self.assertEqual(len(expected[1]), len(got[1]))
        for i, name in enumerate(expected[0]):
            a = [row[i] for row in expected[1]]
            b = [row[i] for row in got[1]]
            size = 1.0 + max(map(abs, a))
            error, at = max((abs(x - y) / size, row[0]) for x, y, row in zip(a, b, expected[1]))
            self.assertLessEqual(error, allowed, f"{name} at {at} s")

    def check_agrees(self, name):
        scene = SCENES[name]
        self.emit(name, scene.scene)
        words = self.arguments(name)
        expected = call(SIMULATE, self.folder / f"{name}.yaml", *words, "--columns", "state,states,variables")
        self.assertEqual(expected.returncode, 0, expected.stderr)
        got = call(self.compile(name, "gcc", "-O0"), *words)
        self.assertEqual((got.returncode, got.stderr), (0, ""))
        self.compare(parse(expected.stdout), parse(got.stdout), scene.allowed)

    def test_compiles_with_clang(self):
        self.need("clang")
        for name in ("ship", "edges", "tables", "two_constraints_gauss", "holds"):
            with self.subTest(scene=name):
                self.emit(name, SCENES[name].scene)
                self.compile(name, "clang", "-O0")

    def test_compiles_where_nothing_is_there_to_count(self):
        self.emit("lone", scene_text("a 1", []))
        program = self.compile("lone", "gcc", "-O2")
        done = call(program, "--duration", 1, "--rate", 1)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(parse(done.stdout)[1], [[0.0] * 7, [1.0] + [0.0] * 6])

    def test_needs_the_library_of_mathematics_only(self):
        for name in ("ship", "edges", "tables", "two_constraints_gauss"):
            folder = self.emit(name, SCENES[name].scene)
            done = call("gcc", *STRICT, "-DVS_SMALL", "-O1", "-c", folder / f"{name}.c", "-o", folder / "scene.o")
            self.assertEqual(done.returncode, 0, done.stderr)
            symbols = {line.split()[-1] for line in call("nm", "-u", folder / "scene.o").stdout.splitlines()}
            self.assertGreater(len(symbols), 3)
            self.assertEqual(symbols - FREESTANDING, set())
        program = self.compile("ship", "gcc", "-O1")
        symbols = call("nm", "-u", program).stdout
        for forbidden in ("malloc", "calloc", "realloc", "free"):
            self.assertNotIn(f" {forbidden}@", symbols)

    def test_no_memory_but_the_models_is_written_to(self):
        folder = self.emit("edges", SCENES["edges"].scene)
        done = call("gcc", "-std=c99", "-O0", "-c", folder / "edges.c", "-o", folder / "scene.o")
        self.assertEqual(done.returncode, 0, done.stderr)
        kinds = {line.split()[-2] for line in call("nm", folder / "scene.o").stdout.splitlines()}
        self.assertEqual(kinds & set("bBCgGsS"), set())  # nothing that begins as zero

    def test_runs_on_arm64(self):
        self.need("aarch64-linux-gnu-gcc", "qemu-aarch64")
        for name in ("ship", "edges"):
            self.emit(name, SCENES[name].scene)
            words = self.arguments(name)
            expected = call(SIMULATE, self.folder / f"{name}.yaml", *words)
            program = self.compile(name, "aarch64-linux-gnu-gcc", "-O0", "-static")
            got = call("qemu-aarch64", program, *words)
            self.assertEqual((got.returncode, got.stderr), (0, ""))
            self.compare(parse(expected.stdout), parse(got.stdout), SCENES[name].allowed)

    def test_runs_clean_under_the_sanitizers(self):
        for name in ("edges", "tables", "two_constraints_gauss"):
            self.emit(name, SCENES[name].scene)
            program = self.compile(name, "gcc", "-O0", "-fsanitize=address,undefined",
                                   "-fno-sanitize-recover=all")
            got = call(program, *self.arguments(name))
            self.assertEqual((got.returncode, got.stderr), (0, ""))

    def test_more_commands_than_the_player_has_room_for_are_refused(self):
        self.emit("tables", SCENES["tables"].scene)
        commands = self.folder / "many.csv"
        commands.write_text("time,topic,value\n" + "0.5,throttle,0.5\n" * 10001)
        words = ["--duration", "0.1", "--commands", commands]
        got = call(self.compile("tables", "gcc", "-O0"), *words)
        self.assertEqual((got.returncode, got.stdout), (2, ""))
        self.assertIn("many.csv: more than 10000 commands: compile main.c with a larger -DMOST_COMMANDS=N", got.stderr)
        got = call(self.compile("tables", "gcc", "-O0", "-DMOST_COMMANDS=10001"), *words)
        self.assertEqual((got.returncode, got.stderr), (0, ""))

    def test_make_and_the_readme(self):
        folder = self.emit("3 shafts-x", SCENES["holds"].scene)
        self.assertEqual({path.name for path in folder.iterdir()},
                         {"scene_3_shafts_x.c", "scene_3_shafts_x.h", "main.c", "README.md", "Makefile"})
        self.assertEqual(call("make", "-C", folder).returncode, 0)
        done = call(folder / "scene_3_shafts_x_play", "--duration", 0.1)
        self.assertEqual(done.returncode, 0, done.stderr)
        # A stream without an end is rejected.
        for commands in ("/dev/zero", folder / "long.csv"):
            (folder / "long.csv").write_text("time,topic,value\n" + "#" * 1000 + "\n")
            done = call(folder / "scene_3_shafts_x_play", "--duration", 0.1, "--commands", commands)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("a line is too long", done.stderr)
        readme = (folder / "README.md").read_text()
        for word in ("scene_3_shafts_x_step", "deep/d", "second_order_lag, 0.1 s",
                     "0 after 0.7 s without a command", "| 0 | variator | 1 |"):
            self.assertIn(word, readme)
        self.assertIn("SCENE_3_SHAFTS_X_INPUT_DEEP_D", (folder / "scene_3_shafts_x.h").read_text())

    def test_overwrites_what_it_wrote_and_nothing_else(self):
        path = self.folder / "plant.yaml"
        path.write_text(plant())
        written = ("plant.h", "plant.c", "main.c", "README.md", "Makefile")

        def emit(folder):
            return call(SIMULATE, path, "--emit-c", folder)

        folder = self.folder / "ours"
        folder.mkdir()
        (folder / "notes.txt").write_text("mine")
        self.assertEqual(emit(folder).returncode, 0)
        for name in written:
            with self.subTest(file=name):
                self.assertEqual(emit(folder).returncode, 0)
                before = {other: (folder / other).read_text() for other in written}
                (folder / name).write_text("# mine\n" + before[name])
                done = emit(folder)
                self.assertEqual(done.returncode, 3, done.stderr)
                self.assertIn(f"{folder / name}: is there", done.stderr)
                self.assertEqual({other: (folder / other).read_text() for other in written},
                                 {**before, name: "# mine\n" + before[name]})
                (folder / name).write_text(before[name])
        self.assertEqual((folder / "notes.txt").read_text(), "mine")

        theirs = self.folder / "theirs"
        theirs.mkdir()
        for name in written:
            for text in ("mine\n", "", "Written by `simulate --emit-c` from plant.yaml.\n"):
                with self.subTest(file=name, text=text):
                    (theirs / name).write_text(text)
                    self.assertEqual(emit(theirs).returncode, 3)
                    self.assertEqual([(file.name, file.read_text()) for file in theirs.iterdir()],
                                     [(name, text)])
                    (theirs / name).unlink()
        target = self.folder / "target"
        target.write_text((folder / "Makefile").read_text())
        (theirs / "Makefile").symlink_to(target)
        self.assertEqual(emit(theirs).returncode, 3)
        self.assertEqual(list(theirs.iterdir()), [theirs / "Makefile"])

    def test_no_name_of_a_scene_makes_one_that_is_taken(self):
        folder = self.emit("holds", SCENES["holds"].scene)
        text = "".join(path.read_text() for path in folder.glob("*.[ch]"))
        words = set(re.findall(r"[A-Za-z]\w*", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)))
        ends = {word[len("holds"):].lower() for word in words if word.lower().startswith("holds_")}
        names = {word[:-len(end)].lower() for word in words for end in ends
                 if word.lower().endswith(end) and len(word) > len(end)} - {"holds"}
        self.assertIn("vs_zero", names)
        for name in names:
            folder = self.emit(name, SCENES["holds"].scene)
            source, = [path for path in folder.glob("*.c") if path.name != "main.c"]
            done = call("gcc", *STRICT, "-fsyntax-only", folder / "main.c", source)
            self.assertEqual((done.returncode, done.stderr), (0, ""))

    def run_harness(self, name, body):
        """Runs `body` in a main of its own; its output."""
        folder = self.folder / name
        (folder / "own.c").write_text(
            f'#include <math.h>\n#include <stdio.h>\n#include "{name}.h"\n'
            f"static {name}_model m;\nint main(void) {{\n  {name}_sample s;\n{body}\n  return 0;\n}}\n")
        done = call("gcc", "-std=c99", "-O0", "-o", folder / "own", folder / "own.c",
                    folder / f"{name}.c", "-lm")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = call(folder / "own")
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_short_steps_and_long_ones_make_one_motion(self):
        # One of the short ones ends where the torque jumps.
        self.emit("edges", EDGES.replace("1.003", "1"))
        out = self.run_harness("edges", """
  int k, i;
  for (k = 0; k < 2; ++k) {
    edges_init(&m);
    if (k == 0) edges_advance_to(&m, 3.0);
    for (i = 0; i < 3000 && k == 1; ++i) if (edges_step(&m, 0.001) != EDGES_OK) return 1;
    if (edges_read(&m, &s) != EDGES_OK) return 2;
    printf("%.17g %.17g %.17g\\n", s.time, s.angle[EDGES_SHAFT_LOAD], s.acceleration[EDGES_SHAFT_LOAD]);
  }
""")
        long, short = [list(map(float, line.split())) for line in out.splitlines()]
        done = call(SIMULATE, self.folder / "edges.yaml", "--times", "3")
        header, rows = parse(done.stdout)
        for got in (long, short):
            self.assertAlmostEqual(got[0], 3.0, delta=1e-12)
            self.assertAlmostEqual(got[1], rows[0][header.index("load/angle")], delta=1e-8)
            self.assertAlmostEqual(got[2], rows[0][header.index("load/acceleration")], delta=1e-8)

    def test_statuses(self):
        self.emit("edges", SCENES["edges"].scene)
        out = self.run_harness("edges", """
  edges_state kept;
  edges_init(&m);
  printf("%d %d %d ", edges_step(&m, -1.0), edges_step(&m, NAN), edges_command(&m, 1, 0.0));
  printf("%d %d ", edges_command(&m, 0, NAN), edges_command(&m, -1, 1.0));
  edges_step(&m, 0.5);
  kept = m.now;
  edges_step(&m, 0.5);
  edges_read(&m, &s);
  m.now = kept;
  edges_step(&m, 0.5);
  printf("%d ", -s.angle[0] == -m.now.angle[0]);
  m.now.velocity[0] = NAN;
  printf("%s", edges_status_text(edges_step(&m, 0.5)));
""")
        self.assertEqual(out.split(maxsplit=6)[:6], ["1", "1", "1", "1", "1", "1"])
        self.assertNotIn("ok", out)

    def check_stops(self, name, scene, reason, at, within=1e-4):
        self.emit(name, scene)
        done = call(self.compile(name, "gcc", "-O0"), "--duration", 5, "--rate", 100)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(reason, done.stderr)
        self.assertAlmostEqual(float(done.stderr.split()[2]), at, delta=within)
        last = parse(done.stdout)[1][-1][0]
        self.assertLessEqual(last, at)
        self.assertGreater(last, at - 0.021)

    def test_stops_where_the_motion_ends(self):
        fold = ["m on a: 1", "k: 0.05*e2+e1^3-3*e1+t"]
        for name, scene, words, *times in (
                ("ends", plant(motor="sqrt(1-t)"), "", 1.0),
                ("dry", scene_text("a 1", ["dry on a: -2*sign(w1)"], "initial: {velocity: [3.0]}"),
                 "chattering", 1.5),
                ("gap", plant(variator="0.3*(e2-0.8*e1)+if(t < 1, 0, 0.1)+w2-0.8*w1"),
                 "a jump leads to no state", 1.0, 0.011),
                ("rank", plant(variator="(1-t)*(e2-0.8*e1)+w2-0.8*w1"), "", 1.0),
                # Everything is finite on both sides and steps could well go over it.
                ("passes", plant(variator="(1.003-t)*(e2-0.8*e1)"), "singular", 1.003),
                ("fold", scene_text("a 1.0, b 2.0", fold, "principle: gauss",
                                    "initial: {velocity: [0.0, 0.0]}"), "", 1.99979)):
            with self.subTest(name):
                self.check_stops(name, scene, words, *times)

    def check_refused(self, scene, *parts):
        path = self.folder / "refused.yaml"
        path.write_text(scene)
        done = call(SIMULATE, path, "--emit-c", self.folder / "refused")
        self.assertEqual(done.returncode, 2, done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)
        self.assertFalse((self.folder / "refused").exists())

    def test_refuses_by_name_what_it_cannot_write(self):
        bent = plant("principle: gauss", variator="0.3*(e2-0.8*e1)+0.01*abs(e1)+w2-0.8*w1")
        self.check_refused(bent, "variator", "accelerations", "sqrt(x^2+1e-12)")

    def test_usage(self):
        path = self.folder / "s.yaml"
        path.write_text(plant())
        self.assertIn("exclude", call(SIMULATE, path, "--emit-c", "x", "--explain").stderr)
        self.assertEqual(call(SIMULATE, path, "--emit-c").returncode, 2)
        (self.folder / "file").write_text("")
        done = call(SIMULATE, path, "--emit-c", self.folder / "file")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn(str(self.folder / "file"), done.stderr)


def add_scene(name):
    setattr(EmitCTest, f"test_agrees_with_simulate_{name}", lambda self: self.check_agrees(name))


for scene_name in SCENES:
    add_scene(scene_name)

if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "emit_c_test", EmitCTest)
