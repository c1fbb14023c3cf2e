#!/usr/bin/python3
"""FMUs that `simulate --emit-fmu` writes, by an importer of their own (support/fmu.py)."""

import csv
import io
import math
import os
import pathlib
import random
import shutil
import subprocess
import tempfile
import unittest

import roslib.packages
import rosunit

from support.fmu import DISCARD, ERROR, OK, Archive, Instance
from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]
SCHEMAS = os.environ.get("VARIATOR_SIM_FMI_SCHEMAS", "/usr/share/fmi")
PATIENCE = 300.0  # s; only a failure takes as long
SCENES = {"memory": "test/scenes/c/memory", "slip": "test/fmu/slip", "engine": "test/fmu/engine",
          "vehicle": "test/fmu/vehicle", "locomotive": "config/applications/diesel_locomotive"}
# The quantities of the motion itself; others round in another order.
MOTION = ("angle", "velocity", "acceleration", "applied_torque", "reaction_torque", "reaction_torque_rate", "residual",
          "multiplier", "slip", "reserve", "heat")


def call(*words, **options):
    return subprocess.run(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          timeout=PATIENCE, check=False, **options)


def parse(text):
    rows = [line for line in csv.reader(io.StringIO(text)) if line and not line[0].startswith("#")]
    return [dict(zip(rows[0], row)) for row in rows[1:]]


class FmuTest(TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.archives = {}

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def archive(self, name, version=3):
        """The FMU of a scene, written once."""
        if (name, version) not in self.archives:
            path = self.folder / f"{name}{version}.fmu"
            done = call(SIMULATE, FOLDER / (SCENES[name] + ".yaml"), "--emit-fmu", path, "--fmi", version)
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
        instance = Instance(self.archive("vehicle"))
        self.assertEqual(instance.try_set({"initial/gearbox/velocity": 51.0}), OK)
        self.assertEqual(instance.initialize(), ERROR)
        self.assertIn("contradict", instance.log[-1][1])
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
            self.assertEqual(instance.enter(start=1.0), ERROR)
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
            self.assertEqual(call(SIMULATE, scene, "--emit-fmu", path, "--fmi", version).returncode, 0)
            instance = Instance(Archive(path, self.folder / f"ends{version}"))
            self.assertEqual(instance.initialize(), OK, instance.log)
            self.assertEqual(instance.step(0.0, 0.5), OK)
            self.assertEqual(instance.step(0.5, 1.0), DISCARD)
            self.assertIn("the motion stops at", instance.log[-1][1])
            if version == 3:
                self.assertTrue(instance.ends)
                self.assertAlmostEqual(instance.reached, 1.0, delta=1e-3)
            self.assertEqual(instance.step(instance.get(["time"])[0], 1.0), DISCARD)
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
        done = call(SIMULATE, scene, "--emit-fmu", "/no/folder/x.fmu")
        self.assertEqual(done.returncode, 3)
        self.assertIn("/no/folder/x.fmu", done.stderr)

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
                    done = call("gcc", "-std=c11", "-O1", *flags, "-fPIC", "-shared", "-o", library,
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
