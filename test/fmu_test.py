#!/usr/bin/python3
"""FMUs that `simulate --emit-fmu` writes, by an importer of their own (support/fmu.py)."""

import csv
import io
import math
import os
import pathlib
import random
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import roslib.packages
import rosunit

from support.fmu import DISCARD, ERROR, OK, Archive, Instance
from support.simulate import SIMULATE, call
from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SCHEMAS = os.environ.get("VARIATOR_SIM_FMI_SCHEMAS", "/usr/share/fmi")
SCENES = {"memory": "test/scenes/c/memory", "slip": "test/fmu/slip", "ramps": "test/fmu/ramps",
          "engine": "test/fmu/engine", "vehicle": "test/fmu/vehicle",
          "locomotive": "config/applications/diesel_locomotive"}
# The quantities of the motion itself; others round in another order.
MOTION = ("angle", "velocity", "acceleration", "applied_torque", "reaction_torque", "reaction_torque_rate", "residual",
          "multiplier", "slip", "reserve", "heat")


def parse(text):
    rows = [line for line in csv.reader(io.StringIO(text)) if line and not line[0].startswith("#")]
    return [dict(zip(rows[0], row)) for row in rows[1:]]


class FmuTest(TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.archives = {}
        # A binary for the other machine, half of the compiler's work, is in one FMU: that of test_members.
        programs = cls.folder / "programs"
        programs.mkdir()
        for name in ("as", "cc", "ld"):
            (programs / name).symlink_to(shutil.which(name))
        cls.of_this_machine = dict(os.environ, PATH=str(programs))

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def archive(self, name, version=3):
        """The FMU of a scene, written once."""
        if (name, version) not in self.archives:
            path = self.folder / f"{name}{version}.fmu"
            environment = None if name == "engine" else self.of_this_machine
            done = call(SIMULATE, FOLDER / (SCENES[name] + ".yaml"), "--emit-fmu", path, "--fmi", version,
                        env=environment)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
            self.archives[name, version] = Archive(path, self.folder / f"{name}{version}")
        return self.archives[name, version]

    def start(self, name, version=3, **options):
        instance = Instance(self.archive(name, version), **options)
        self.assertEqual(instance.initialize(), OK, instance.log)
        return instance

    # --- the archive ---

    def test_members(self):
        for version, platform in ((2, "linux64"), (3, "x86_64-linux")):
            members = self.archive("engine", version).members
            expected = {"modelDescription.xml", "documentation/index.html", "sources/engine.c"}
            if os.uname().machine == "x86_64":
                expected.add(f"binaries/{platform}/engine.so")
            if version == 3:
                expected |= {"sources/buildDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml"}
            self.assertEqual({it for it in members if "aarch64" not in it}, expected)
            if shutil.which("aarch64-linux-gnu-gcc"):
                self.assertIn("binaries/aarch64-linux/engine.so", members)

    @unittest.skipUnless(pathlib.Path(SCHEMAS).is_dir() and shutil.which("xmllint"),
                         "no schemas of FMI (VARIATOR_SIM_FMI_SCHEMAS) or no xmllint")
    def test_schemas(self):
        for name in ("memory", "slip", "engine"):
            for version in (2, 3):
                files = {"ModelDescription": "modelDescription.xml"}
                if version == 3:
                    files["BuildDescription"] = "sources/buildDescription.xml"
                    files["TerminalsAndIcons"] = "terminalsAndIcons/terminalsAndIcons.xml"
                for kind, path in files.items():
                    schema = pathlib.Path(SCHEMAS) / f"fmi{version}" / f"fmi{version}{kind}.xsd"
                    done = call("xmllint", "--noout", "--schema", schema, self.archive(name, version).folder / path)
                    self.assertEqual(done.returncode, 0, done.stderr)

    def test_description(self):
        for version in (2, 3):
            archive = self.archive("slip", version)
            variables = archive.variables
            self.assertEqual(len(set(archive.reference.values())), len(variables))
            self.assertEqual([archive.start(it) for it in ("inputs/torque", "inputs/capacity",
                                                           "initial/motor/velocity")], [5.0, 20.0, 30.0])
            capacity = variables["inputs/capacity"] if version == 3 else variables["inputs/capacity"][0]
            self.assertEqual((float(capacity.get("min")), float(capacity.get("max"))), (0.0, 40.0))
            self.assertEqual(variables["clutch/mode"].get("variability"), "discrete")
            self.assertIn("outputs/ratio", variables)
        units = {it.get("name"): it[0].attrib for it in self.archive("engine").root.find("UnitDefinitions")}
        self.assertAlmostEqual(float(units["rpm"]["factor"]), math.pi / 30)
        self.assertEqual(units["N m"], {"kg": "1", "m": "2", "s": "-2"})

    def test_sources_compile_without_warnings(self):
        for name, version in (("slip", 2), ("memory", 3)):
            archive = self.archive(name, version)
            done = call("gcc", "-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-unused-variable", "-fsyntax-only",
                        archive.folder / "sources" / f"{archive.name}.c")
            self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_nothing_but_mathematics_and_its_memory_is_called(self):
        for version in (2, 3):
            done = call("nm", "-D", "-u", self.archive("slip", version).binary)
            used = {line.split()[-1].split("@")[0] for line in done.stdout.splitlines()}
            for name in ("fopen", "open", "socket", "abort", "exit", "__assert_fail", "printf", "pthread_create"):
                self.assertNotIn(name, used)
            self.assertLessEqual(used & {"malloc", "calloc", "free", "realloc"}, {"malloc", "calloc", "free"})
            done = call("nm", "-D", "--defined-only", self.archive("slip", version).binary)
            for line in done.stdout.splitlines():
                self.assertRegex(line.split()[-1], f"^fmi{version}")

    # --- the motion ---

    def check_like_simulate(self, name, version, duration, step):
        """Equal to the bit at communication points."""
        scene = FOLDER / SCENES[name]
        path = scene.with_suffix(".csv")
        commands = parse(path.read_text()) if path.exists() else []
        commands = [(float(it["time"]), "inputs/" + it["topic"], float(it["value"])) for it in commands]
        times = sorted({k * step for k in range(round(duration / step) + 1)}
                       | {it[0] for it in commands if it[0] <= duration})
        options = ["--commands", path] if commands else []
        done = call(SIMULATE, scene.with_suffix(".yaml"), "--times", ",".join(map(repr, times)), "--columns",
                    "state,elements,outputs,states,variables", *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        instance = self.start(name, version)
        now, compared, modes = 0.0, 0, set()
        for row in parse(done.stdout):
            goal = float(row["time"])
            if goal > now:
                self.assertEqual(instance.step(now, goal - now), OK, instance.log)
                self.assertEqual(now + (goal - now), goal)
            now = goal
            for at, reference, value in commands:
                if at == goal:
                    self.assertEqual(instance.try_set({reference: value}), OK)
            # FMUs have no torques of elements with modes on single shafts.
            columns = [it for it in row if not it.endswith("/mode")
                       and (it in instance.archive.reference or not it.startswith("clutch/"))]
            for column, value in zip(columns, instance.get(columns)):
                expected = float(row[column])
                if column.split("/")[-1] in MOTION or column.split("/")[0] in ("states", "variables"):
                    # (The start is sampled by other equations.)
                    tolerance = 1e-12 * (1 + abs(expected)) if goal == 0.0 else 0.0
                    self.assertLessEqual(abs(value - expected), tolerance, (column, goal))
                    compared += 1
                elif not math.isnan(expected):
                    self.assertAlmostEqual(value, expected, delta=1e-12 * (1 + abs(expected)), msg=(column, goal))
            for mode in instance.archive.modes():
                self.assertEqual(instance.mode(mode), int(row[mode]))
                modes.add(int(row[mode]))
        self.assertGreater(compared, 100)
        instance.free()
        return modes

    def test_equals_simulate_memory(self):
        for version in (2, 3):
            self.check_like_simulate("memory", version, 10.0, 0.05)

    def test_equals_simulate_slip(self):
        for version in (2, 3):
            self.assertEqual(self.check_like_simulate("slip", version, 5.0, 0.02), {-1, 0, 2})

    def test_equals_simulate_ramps(self):
        for version in (2, 3):
            self.check_like_simulate("ramps", version, 5.0, 0.05)

    def test_equals_simulate_locomotive(self):
        self.check_like_simulate("locomotive", 3, 60.0, 0.1)

    def test_no_communication_step_changes_the_motion(self):
        ends = []
        for count in (1, 7, 1000):
            instance = self.start("memory")
            times = [7.0 * k / count for k in range(count + 1)]
            for at, end in zip(times, times[1:]):
                self.assertEqual(instance.step(at, end - at), OK, instance.log)
            # (The last end may be another one in its last bit.)
            ends.append(instance.get(["time", "motor/angle", "wheel/velocity", "states/heat"]))
            instance.free()
        for end in ends[1:]:
            for value, expected in zip(end, ends[0]):
                self.assertAlmostEqual(value, expected, delta=1e-12 * (1 + abs(expected)))

    def test_parameters_move_the_start(self):
        scene = FOLDER / "test/fmu/vehicle.yaml"
        instance = Instance(self.archive("vehicle"))
        self.assertEqual(instance.try_set({"initial/gearbox/velocity": 50.0, "initial/wheels/velocity": 10.0,
                                           "initial/wheels/angle": 3.0}), OK)
        self.assertEqual(instance.initialize(), OK, instance.log)
        self.assertEqual(instance.step(0.0, 2.0), OK)
        done = call(SIMULATE, scene, "--times", 2, "--set", "initial/velocity=[50, 10]", "--set",
                    "initial/angle=[0, 3]")
        row = parse(done.stdout)[0]
        for name in ("wheels/angle", "wheels/velocity", "gearbox/reaction_torque"):
            self.assertAlmostEqual(instance.get([name])[0], float(row[name]), delta=1e-7 * abs(float(row[name])))
        self.assertEqual(instance.try_set({"initial/wheels/angle": 0.0}), ERROR)
        instance.free()
        for version in (2, 3):
            instance = Instance(self.archive("vehicle", version))
            self.assertEqual(instance.try_set({"initial/gearbox/velocity": 51.0}), OK)
            self.assertEqual(instance.enter(), OK)
            # Values that are no motion's are not shown as one's; the start values are.
            self.assertEqual(instance.try_get(["gearbox/velocity"])[0], DISCARD)
            self.assertEqual(instance.get(["initial/gearbox/velocity"]), [51.0])
            self.assertEqual(instance.call("ExitInitializationMode"), ERROR)
            self.assertIn("the initial values, or the first inputs, contradict each other", instance.log[-1][1])
            self.assertEqual(instance.try_set({"initial/gearbox/velocity": 50.0, "initial/wheels/velocity": 10.0}), OK)
            self.assertEqual(instance.try_get(["gearbox/velocity"])[0], OK)
            instance.free()

    def test_start_time(self):
        names = ["motor/angle", "motor/velocity", "load/velocity", "clutch/torque", "clutch/heat"]
        for version in (2, 3):
            ends = []
            for start in (0.0, 64.0):  # the scene reads no t
                instance = Instance(self.archive("slip", version))
                self.assertEqual(instance.initialize(start), OK, instance.log)
                self.assertEqual(instance.get(["time"]), [start])
                for k in range(20):
                    self.assertEqual(instance.try_set({"inputs/torque": 20.0 * (k % 3)}), OK)
                    self.assertEqual(instance.step(start + 0.125 * k, 0.125), OK, instance.log)
                ends.append(instance.get(names))
                instance.free()
            for value, expected in zip(ends[1], ends[0]):
                self.assertAlmostEqual(value, expected, delta=1e-8 * (1 + abs(expected)))
            instance = Instance(self.archive("slip", version))
            for start in (-1.0, math.nan, math.inf, 1e12):
                self.assertEqual(instance.enter(start), ERROR)
                self.assertIn("start time is", instance.log[-1][1])
                self.assertIn("allowed: from 0", instance.log[-1][1])
            self.assertEqual(instance.initialize(3.0), OK, instance.log)
            instance.free()

    def test_stop_time(self):
        for version in (2, 3):
            instance = Instance(self.archive("slip", version))
            self.assertEqual(instance.enter(2.0, 1.0), ERROR)
            self.assertIn("the stop time is before the start time", instance.log[-1][1])
            self.assertEqual(instance.enter(2.0, math.nan), ERROR)
            self.assertEqual(instance.initialize(2.0, 2.3), OK, instance.log)
            for k in range(3):  # the sum of tenths is not 0.3
                self.assertEqual(instance.step(2.0 + 0.1 * k, 0.1), OK, instance.log)
            self.assertEqual(instance.step(instance.get(["time"])[0], 0.001), ERROR)
            self.assertIn("the step ends behind the stop time", instance.log[-1][1])
            self.assertEqual(instance.call("Reset"), OK)
            self.assertEqual(instance.initialize(), OK, instance.log)
            self.assertEqual(instance.step(0.0, 5.0), OK, instance.log)
            instance.free()

    # --- parameters ---

    def check_parameters(self, name, version, values, until, columns):
        """A motion with other numbers is that of `simulate --set`."""
        scene = FOLDER / (SCENES[name] + ".yaml")
        words = [word for path, value in values.items() for word in ("--set", f"{path}={value!r}")]
        done = call(SIMULATE, scene, "--times", f"{until / 2!r},{until!r}", "--columns", "state,states", *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        instance = Instance(self.archive(name, version))
        self.assertEqual(instance.try_set({"scene/" + path: value for path, value in values.items()}), OK, instance.log)
        self.assertEqual(instance.initialize(), OK, instance.log)
        now = 0.0
        for row in parse(done.stdout):
            self.assertEqual(instance.step(now, until / 2), OK, instance.log)
            now = float(row["time"])
            for column, value in zip(columns, instance.get(columns)):
                self.assertAlmostEqual(value, float(row[column]), delta=1e-12 * (1 + abs(value)), msg=(values, column))
        self.assertEqual(instance.try_set({"scene/" + next(iter(values)): 1.0}), ERROR)
        instance.free()

    def test_numbers_of_the_scene(self):
        columns = ["motor/angle", "load/velocity", "motor/applied_torque", "load/reaction_torque"]
        for version in (2, 3):
            for values in ({"load/inertia": 3.25, "motor/inertia": 0.1}, {"engine/time_constant": 0.37},
                           {"load/inertia": 1.5000001}, {"solver/absolute_tolerance": 1e-6, "load/inertia": 2.0}):
                self.check_parameters("slip", version, values, 4.0, columns)
        columns = ["motor/angle", "wheel/velocity", "wheel/acceleration", "states/cruise", "states/ratio_now"]
        for values in ({"motor/inertia": 1.0, "wheel/inertia": 1.0}, {"cruise/ki": 1.5, "wheel/inertia": 2.5}):
            self.check_parameters("memory", 3, values, 3.0, columns[:3] + columns[4:])
        # Divisors, and products of two numbers.
        self.check_parameters("locomotive", 3, {"train/wheel_radius": 0.6, "diesel/friction/regularization_speed": 1.3,
                                                "train/quadratic": 25.0, "regulator/parameters/band": 3.0}, 4.0,
                              ["engine/angle", "axle/velocity", "axle/reaction_torque"])

    def test_numbers_of_parts(self):
        """They are those of `--set`, whose path leads into the part; what is a sum is no parameter."""
        (self.folder / "axle.yaml").write_text(
            "shafts: [input, left, right]\ninput: {inertia: 0.1}\nleft: {inertia: 0.5}\nright: {inertia: 0.6}\n"
            "torques: [drag]\n"
            "drag: {type: variator_sim/ExpressionTorque, shaft: left, torque: -k*w_left, parameters: {k: 0.5}}\n"
            "constraints: [diff]\ndiff: {type: variator_sim/ExpressionConstraint, order: 1,\n"
            "  expression: w_input - (w_left + w_right)/2}\n")
        (self.folder / "parts.yaml").write_text(
            "shafts: [engine, cardan]\nengine: {inertia: 1.2}\ncardan: {inertia: 0.2}\ntorques: [m, c]\n"
            "m: {type: variator_sim/ExpressionTorque, shaft: engine, torque: 20*sin(t) + 0.1*w_front/left}\n"
            "c: {type: variator_sim/ElasticCoupling, shafts: [engine, cardan], stiffness: 9, damping: 1}\n"
            "parts: [front]\nfront: {file: axle.yaml, connect: {input: cardan}}\n")
        SCENES["parts"] = str(self.folder / "parts")
        numbers = [it for it in self.archive("parts").variables if it.startswith("scene/")]
        self.assertNotIn("scene/cardan/inertia", numbers)
        self.assertEqual(self.archive("parts").start("scene/front/left/inertia"), 0.5)
        for values in ({"front/left/inertia": 0.9}, {"front/drag/parameters/k": 2.0, "engine/inertia": 3.0}):
            self.check_parameters("parts", 3, values, 2.0, ["engine/velocity", "cardan/angle", "front/right/velocity"])

    def test_given_accelerations_are_moved_anew(self):
        """They are nearest to the scene's by the inertias that are set, and not to those of other ones."""
        scene = self.folder / "circle.yaml"
        scene.write_text("shafts: [a, b]\na: {inertia: 1.5}\nb: {inertia: 1.5}\nconstraints: [c]\n"
                         "c: {type: variator_sim/ExpressionConstraint, order: 2, expression: \"e1^2 + e2^2 - p^2\",\n"
                         "  parameters: {p: 2}}\ninitial: {acceleration: [1.0, 1.6], project: true}\n")
        path = self.folder / "circle.fmu"
        self.assertEqual(call(SIMULATE, scene, "--emit-fmu", path, env=self.of_this_machine).returncode, 0)
        archive = Archive(path, self.folder / "circle")
        for values in ({}, {"b/inertia": 12.0}, {"c/parameters/p": 3.0, "a/inertia": 4.0}):
            words = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
            row = parse(call(SIMULATE, scene, "--times", 0, *words).stdout)[0]
            instance = Instance(archive)
            self.assertEqual(instance.try_set({"scene/" + name: value for name, value in values.items()}), OK)
            self.assertEqual(instance.initialize(), OK, instance.log)
            for name in ("a/acceleration", "b/acceleration", "b/reaction_torque"):
                self.assertAlmostEqual(instance.get([name])[0], float(row[name]), delta=1e-9, msg=values)
            instance.free()

    def test_tolerances(self):
        ends = []
        for tolerance in (1e-9, 1e-5, 1e-12):
            instance = Instance(self.archive("memory"))
            self.assertEqual(instance.try_set({"scene/solver/relative_tolerance": tolerance,
                                               "scene/solver/absolute_tolerance": tolerance}), OK, instance.log)
            self.assertEqual(instance.initialize(), OK, instance.log)
            self.assertEqual(instance.step(0.0, 5.0), OK, instance.log)
            ends.append(instance.get(["motor/angle"])[0])
            instance.free()
        self.assertNotEqual(ends[1], ends[0])
        self.assertLess(abs(ends[1] - ends[2]), 1e-2)
        self.assertLess(abs(ends[0] - ends[2]), 1e-6)

    def test_parameters_that_are_refused(self):
        for version in (2, 3):
            archive = self.archive("slip", version)
            names = [it for it in archive.variables if it.startswith("scene/")]
            self.assertNotIn("scene/engine/max", names)
            self.assertNotIn("scene/initial/velocity", names)
            instance = Instance(archive)
            for path, value in (("load/inertia", 0.0), ("load/inertia", -1.0), ("engine/time_constant", 0.0),
                                ("solver/relative_tolerance", 0.5), ("solver/maximum_step", -1.0)):
                self.assertEqual(instance.try_set({"scene/" + path: value}), ERROR, path)
                self.assertIn(f"scene/{path} is {value:g}; allowed: ", instance.log[-1][1])
            self.assertEqual(instance.try_set({"scene/load/inertia": math.nan}), DISCARD)
            self.assertEqual(instance.initialize(), OK)
            instance.free()

    # --- derivatives ---

    def test_derivatives_are_those_of_the_motion(self):
        outputs = ["motor/acceleration", "load/acceleration", "motor/applied_torque", "motor/reaction_torque",
                   "motor/reaction_torque_rate", "clutch/torque", "clutch/reserve", "motor/angle"]
        inputs = ["inputs/torque", "inputs/capacity"]
        for version in (2, 3):
            instance = self.start("slip", version)
            modes = set()
            for at, length in ((0.0, 0.25), (0.25, 0.25), (0.5, 2.0), (2.5, 1.0)):
                self.assertEqual(instance.step(at, length), OK)
                modes.add(instance.mode("clutch/mode"))
                state, columns = instance.copy(), []
                before = instance.get(outputs)
                for name in inputs:
                    status, slopes = instance.differentiate(outputs, [name], [1.0])
                    self.assertEqual(status, OK, instance.log)
                    columns.append(slopes)
                    moved, u, h = [], instance.get([name])[0], 1e-3
                    for sign in (1, -1):
                        self.assertEqual(instance.try_set({name: u + sign * h}), OK)
                        moved.append(instance.get(outputs))
                        self.assertEqual(instance.take(state), OK)
                    for slope, plus, minus in zip(slopes, *moved):
                        expected = (plus - minus) / (2 * h)
                        self.assertAlmostEqual(slope, expected, delta=1e-8 * (1 + abs(expected)))
                self.assertEqual(instance.get(outputs), before)  # nothing has moved
                status, both = instance.differentiate(outputs, inputs, [2.0, -3.0])
                for value, a, b in zip(both, *columns):
                    self.assertAlmostEqual(value, 2 * a - 3 * b, delta=1e-12 * (abs(a) + abs(b)))
                if version == 3:
                    seeds = [0.5 * n - 1 for n in range(len(outputs))]
                    status, adjoint = instance.differentiate(outputs, inputs, seeds, adjoint=True)
                    self.assertEqual(status, OK)
                    for value, column in zip(adjoint, columns):
                        expected = sum(map(lambda a, b: a * b, seeds, column))
                        self.assertAlmostEqual(value, expected, delta=1e-12 * (1 + abs(expected)))
                instance.free_state(state)
            self.assertEqual(modes, {-1, 0})
            for unknown, known in (("inputs/torque", "inputs/torque"), ("time", "inputs/torque"),
                                   ("motor/angle", "motor/angle"), ("motor/angle", "initial/motor/angle")):
                self.assertEqual(instance.differentiate([unknown], [known], [1.0])[0], ERROR)
            instance.free()

    def test_derivatives_are_those_of_the_linear_model(self):
        outputs = [f"{shaft}/{quantity}" for shaft in ("motor", "wheel")
                   for quantity in ("angle", "velocity", "acceleration", "applied_torque", "reaction_torque")]
        path = self.folder / "linear.csv"
        done = call(SIMULATE, FOLDER / (SCENES["memory"] + ".yaml"), "--linearize", "--at", 0.7, "--output", path)
        self.assertEqual(done.returncode, 0, done.stderr)
        entries = {(it["matrix"], it["row"], it["column"]): float(it["value"]) for it in parse(path.read_text())}
        instance = self.start("memory")
        self.assertEqual(instance.step(0.0, 0.7), OK)
        for name in ("throttle", "stop"):  # of `stop`, which is at its limit, from one side
            status, slopes = instance.differentiate(outputs, ["inputs/" + name], [1.0])
            self.assertEqual(status, OK, instance.log)
            for output, slope in zip(outputs, slopes):
                expected = entries["D", output, name]
                self.assertAlmostEqual(slope, expected, delta=1e-9 * (1 + abs(expected)), msg=(output, name))
        instance.free()

    def test_derivatives_at_the_start(self):
        instance = Instance(self.archive("engine"))
        self.assertEqual(instance.enter(), OK)
        # Q = 0.2 (120 - 0.2 w), J = 0.2
        for name, expected in (("initial/engine/velocity", -0.2), ("inputs/throttle", 500.0), ("inputs/load", -5.0),
                               ("scene/engine/inertia", -0.2 * 100 / 0.2**2)):
            status, slopes = instance.differentiate(["engine/acceleration"], [name], [1.0])
            self.assertEqual(status, OK, instance.log)
            self.assertAlmostEqual(slopes[0], expected, delta=1e-9 * abs(expected), msg=name)
        instance.free()

    def test_returns_early_at_events(self):
        instance = self.start("memory", events=True, early=True)
        self.assertEqual(instance.call("EnterStepMode"), OK)
        now, events = 0.0, []
        while now < 2.9:
            self.assertEqual(instance.step(now, 2.9 - now), OK, instance.log)
            self.assertEqual((instance.early, instance.event), (instance.reached < 2.9, instance.reached < 2.9))
            now = instance.reached
            if instance.event:
                events.append((now, instance.get(["variables/gear"])[0]))
                self.assertEqual(instance.call("EnterEventMode"), OK)
                self.assertEqual(instance.call("EnterStepMode"), OK)
        self.assertIn(2.0, [gear for _, gear in events])
        whole = self.start("memory")
        self.assertEqual(whole.step(0.0, 2.9), OK)
        names = ["motor/angle", "wheel/velocity", "states/heat"]
        self.assertEqual(instance.get(names), whole.get(names))
        instance.free()
        whole.free()

    # --- instances and their states ---

    def test_copies_of_the_state(self):
        for version in (2, 3):
            instance, other = self.start("slip", version), self.start("slip", version)
            names = ["motor/angle", "load/velocity", "clutch/torque", "clutch/heat", "time"]

            def go_on(it, begin):
                for k in range(20):
                    self.assertEqual(it.try_set({"inputs/torque": 40.0 * (k % 3), "inputs/capacity": 5.0 + k}), OK)
                    self.assertEqual(it.step(begin + 0.05 * k, 0.05), OK, it.log)
                return it.get(names), it.mode("clutch/mode")

            go_on(instance, 0.0)
            state = instance.copy()
            data = instance.serialize(state)
            expected = go_on(instance, 1.0)
            self.assertEqual(instance.take(state), OK)
            self.assertEqual(go_on(instance, 1.0), expected)
            status, copied = other.deserialize(data)
            self.assertEqual(status, OK)
            self.assertEqual(other.take(copied), OK)
            self.assertEqual(go_on(other, 1.0), expected)
            # Damaged bytes and too few of them are refused.
            damaged = bytes([data[100] ^ 1 if n == 100 else byte for n, byte in enumerate(data)])
            for wrong in (damaged, data[:-1], b""):
                if wrong:
                    self.assertEqual(other.deserialize(wrong)[0], ERROR)
            self.assertEqual(instance.take(None), ERROR)
            instance.free_state(state)
            other.free_state(copied)
            instance.free()
            other.free()

    def test_two_instances_know_nothing_of_each_other(self):
        for version in (2, 3):
            names = ["motor/angle", "load/velocity", "clutch/heat"]
            alone = []
            for torque in (10.0, 50.0):
                instance = self.start("slip", version)
                for k in range(100):
                    instance.try_set({"inputs/torque": torque})
                    self.assertEqual(instance.step(0.01 * k, 0.01), OK)
                alone.append(instance.get(names))
                instance.free()
            both = [self.start("slip", version), self.start("slip", version)]
            for k in range(100):
                for instance, torque in zip(both, (10.0, 50.0)):
                    instance.try_set({"inputs/torque": torque})
                    self.assertEqual(instance.step(0.01 * k, 0.01), OK)
            self.assertEqual([it.get(names) for it in both], alone)
            self.assertNotEqual(alone[0], alone[1])
            for instance in both:
                instance.free()

    def test_reset(self):
        for version in (2, 3):
            instance = self.start("slip", version)
            first = instance.get(["motor/angle", "load/acceleration", "time"])
            instance.try_set({"inputs/torque": 60.0})
            self.assertEqual(instance.step(0.0, 1.0), OK)
            self.assertNotEqual(instance.get(["motor/angle", "load/acceleration", "time"]), first)
            self.assertEqual(instance.call("Reset"), OK)
            self.assertEqual(instance.initialize(), OK)
            self.assertEqual(instance.get(["motor/angle", "load/acceleration", "time"]), first)
            instance.free()

    def test_random_inputs(self):
        for version in (2, 3):
            numbers = random.Random(4)
            instance = self.start("slip", version)
            now = 0.0
            for _ in range(1000):
                values = {"inputs/torque": numbers.choice([0.0, numbers.uniform(-100, 100), 1e300, -1e300]),
                          "inputs/capacity": numbers.choice([0.0, numbers.uniform(-10, 60), 40.0])}
                self.assertEqual(instance.try_set(values), OK)
                length = numbers.choice([0.0, 1e-9, 1e-3, 0.1 * numbers.random()])
                self.assertEqual(instance.step(now, length), OK, instance.log)
                now += length
                self.assertTrue(all(map(math.isfinite, instance.get(["motor/velocity", "load/acceleration"]))))
                self.assertIn(instance.mode("clutch/mode"), (-1, 0, 1, 2))
            instance.free()

    # --- calls that are refused ---

    def test_illegal_calls(self):
        for version in (2, 3):
            archive = self.archive("slip", version)
            self.assertIsNone(Instance(archive, token="{another}").c)
            instance = Instance(archive)
            self.assertEqual(instance.try_get(["motor/angle"])[0], ERROR)
            self.assertEqual(instance.step(0.0, 1.0), ERROR)
            self.assertEqual(instance.call("ExitInitializationMode"), ERROR)
            self.assertEqual(instance.enter(start=-1.0), ERROR)
            self.assertEqual(instance.call("Terminate"), ERROR)
            self.assertEqual(instance.initialize(), OK)
            self.assertEqual(instance.call("ExitInitializationMode"), ERROR)
            for values in ({"motor/angle": 1.0}, {"time": 1.0}, {10000: 1.0}, {"initial/motor/angle": 1.0},
                           {archive.reference["clutch/mode"]: 1.0}):
                self.assertEqual(instance.try_set(values), ERROR, values)
            self.assertEqual(instance.try_set({"inputs/torque": math.nan}), DISCARD)
            self.assertEqual(instance.try_get([10000])[0], ERROR)
            self.assertEqual(instance.try_get([archive.reference["clutch/mode"]])[0], ERROR)
            for at, length in ((0.5, 0.1), (0.0, -0.1), (0.0, math.inf), (math.nan, 0.1), (0.0, math.nan)):
                self.assertEqual(instance.step(at, length), ERROR, (at, length))
            self.assertEqual(instance.step(0.0, 0.1), OK)
            if version == 3:
                self.assertEqual(instance.call("EnterEventMode"), ERROR)
                self.assertEqual(instance.call("EnterConfigurationMode"), ERROR)
                self.assertEqual(instance.call("EnterContinuousTimeMode"), ERROR)
            self.assertEqual(instance.call("Terminate"), OK)
            self.assertEqual(instance.step(0.1, 0.1), ERROR)
            self.assertEqual(instance.try_get(["motor/angle"])[0], OK)
            self.assertGreater(len(instance.log), 15)
            instance.free()

    def test_a_motion_that_stops_is_discarded(self):
        scene = self.folder / "ends.yaml"
        scene.write_text("shafts: [a]\na: {inertia: 1}\ntorques: [m]\n"
                         "m: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"sqrt(1-t)\"}\n")
        for version in (2, 3):
            path = self.folder / f"ends{version}.fmu"
            done = call(SIMULATE, scene, "--emit-fmu", path, "--fmi", version, env=self.of_this_machine)
            self.assertEqual(done.returncode, 0, done.stderr)
            archive = Archive(path, self.folder / f"ends{version}")
            instance = Instance(archive)
            self.assertEqual(instance.initialize(), OK, instance.log)
            self.assertEqual(instance.step(0.0, 0.5), OK)
            self.assertEqual(instance.step(0.5, 1.0), DISCARD)
            self.assertIn("the motion stops at", instance.log[-1][1])
            if version == 3:
                self.assertTrue(instance.ends)
                self.assertAlmostEqual(instance.reached, 1.0, delta=1e-3)
            self.assertEqual(instance.step(instance.get(["time"])[0], 1.0), DISCARD)
            instance.free()
            # From another start on: w = 2/3 ((1 - t_0)^1.5 - (1 - t)^1.5)
            instance = Instance(archive)
            self.assertEqual(instance.initialize(0.5), OK, instance.log)
            self.assertEqual(instance.step(0.5, 0.25), OK, instance.log)
            speed, acceleration = instance.get(["a/velocity", "a/acceleration"])
            self.assertAlmostEqual(speed, 2 / 3 * (0.5**1.5 - 0.25**1.5), delta=1e-9)
            self.assertAlmostEqual(acceleration, 0.5, delta=1e-12)
            instance.free()

    def test_usage(self):
        scene = FOLDER / "test/fmu/engine.yaml"
        for words, message in ((["--emit-fmu", "x.zip"], "does not end in .fmu"),
                               (["--emit-fmu", "x.fmu", "--fmi", "1"], "allowed: 2, 3"),
                               (["--fmi", "2", "--duration", "1"], "--fmi belongs to --emit-fmu"),
                               (["--emit-fmu", "x.fmu", "--explain"], "exclude each other")):
            done = call(SIMULATE, scene, *words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn(message, done.stderr)

    def blocking_compiler(self):
        """A folder of programs, the compiler of which takes long; a file says that it runs."""
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        (folder / "cc").write_text(f"#!/bin/sh\n/usr/bin/touch {folder}/runs\nexec /usr/bin/sleep 100\n", encoding="utf-8")
        (folder / "cc").chmod(0o755)
        return folder

    def test_a_folder_that_is_missing_is_told_before_anything_is_compiled(self):
        folder = self.blocking_compiler()
        for path, words in (("/no/folder/x.fmu", "No such file or directory: folder '/no/folder'"),
                            (folder, "Is a directory")):
            if path == folder:
                path = folder / "x.fmu"
                path.mkdir()
            done = call(SIMULATE, FOLDER / "test/fmu/engine.yaml", "--emit-fmu", path, env=dict(os.environ, PATH=str(folder)))
            self.assertEqual(done.returncode, 3)
            self.assertEqual(done.stderr, f"simulate: {path}: cannot be written: {words}\n")
        self.assertFalse((folder / "runs").exists())

    def test_control_c_is_heard_while_it_compiles(self):
        folder = self.blocking_compiler()
        path = folder / "x.fmu"
        with subprocess.Popen([SIMULATE, str(FOLDER / "test/fmu/engine.yaml"), "--emit-fmu", str(path)],
                              stderr=subprocess.PIPE, text=True, env=dict(os.environ, PATH=str(folder))) as process:
            end = time.monotonic() + 30.0
            while not (folder / "runs").exists():
                self.assertLess(time.monotonic(), end)
                time.sleep(0.01)
            begin = time.monotonic()
            process.send_signal(signal.SIGINT)
            words = process.communicate(timeout=30)[1]
        self.assertLess(time.monotonic() - begin, 3.0)
        self.assertEqual(process.returncode, 130)
        self.assertEqual(words, f"simulate: interrupted; '{path}' is not written\n")
        self.assertEqual({it.name for it in folder.iterdir()}, {"cc", "runs"})

    # --- a foreign master ---

    def run_master(self, flags, step):
        """The angles at 3 s of engine and vehicle by the master in C, and its allocations."""
        master = self.folder / f"master{len(flags)}"
        if not master.exists():
            done = call("gcc", "-std=c99", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", *flags, "-rdynamic", "-o",
                        master, FOLDER / "test/fmu/master.c", "-ldl")
            self.assertEqual(done.returncode, 0, done.stderr)
        words = []
        names = {"engine": ("inputs/load", "inputs/throttle", "engine/velocity", "engine/angle"),
                 "vehicle": ("inputs/drive", "gearbox/velocity", "wheels/angle")}
        for name, variables in names.items():
            archive = self.archive(name)
            library = archive.binary
            if flags:
                library = self.folder / f"{name}-checked.so"
                if not library.exists():
                    done = call("gcc", "-std=c11", "-O1", "-DVS_SMALL", *flags, "-fPIC", "-shared", "-o", library,
                                archive.folder / "sources" / f"{name}.c", "-lm")
                    self.assertEqual(done.returncode, 0, done.stderr)
            words += [library, archive.token] + [archive.reference[it] for it in variables]
        done = call(master, *words, round(3.0 / step), step)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        lines = done.stdout.split("\n")
        self.assertEqual(lines[0].split()[:2], lines[1].split()[:2])  # from copies of the state
        self.assertEqual([int(line.split()[2]) for line in lines[:2]], [0, 0])  # printing is behind
        return [float(it) for it in lines[0].split()[:2]]

    def test_a_master_in_c_couples_two(self):
        done = call(SIMULATE, FOLDER / "test/fmu/coupled.yaml", "--times", 3)
        row = parse(done.stdout)[0]
        expected = [float(row["engine/angle"]), float(row["wheels/angle"])]
        errors = []
        for step in (2e-3, 1e-3):
            got = self.run_master([], step)
            errors.append(max(abs(a - b) for a, b in zip(got, expected)))
        # Exchanged values are constant between communication points: the error is of first order.
        self.assertLess(errors[1], 0.6 * errors[0])
        self.assertLess(errors[1], 0.1)

    def test_a_master_under_the_sanitizers(self):
        plain = self.run_master([], 0.01)
        checked = self.run_master(["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"], 0.01)
        for a, b in zip(plain, checked):
            self.assertAlmostEqual(a, b, delta=1e-9 * abs(a))


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "fmu_test", FmuTest)
