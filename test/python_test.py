#!/usr/bin/python3
"""The Python module: the same motion as `simulate`, its errors, its types. No ROS master."""

import concurrent.futures
import copy
import csv
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from unittest import mock

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402
import yaml  # noqa: E402

from support.scenes import scene_text  # noqa: E402
from support.simulate import fake_compiler  # noqa: E402
from support.subtests import TestCase  # noqa: E402
import variator_sim  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]
SHIP = FOLDER / "config/ship.yaml"
STEPS = FOLDER / "test/cases/torque_steps/scene.yaml"
STEP_COMMANDS = FOLDER / "test/cases/torque_steps/commands.csv"
STOPS = FOLDER / "test/scenes/stops.yaml"
OBSERVED = FOLDER / "test/scenes/observed.yaml"
MOTOR = "motor on drive from torque, max: 100"
FREE = scene_text("drive 2.0", [MOTOR])
SPRING = scene_text("drive 2.0", [MOTOR, "spring on drive: -100*phi1"], "initial: {velocity: [3]}")


def from_command_line(*arguments):
    text = subprocess.run([SIMULATE, *map(str, arguments)], check=True, text=True, timeout=60,
                          stdout=subprocess.PIPE).stdout
    rows = list(csv.reader(text.splitlines()))
    return rows[0], numpy.array(rows[1:], dtype=float)


class PythonTest(TestCase):

    def check_same(self, result, columns, values):
        self.assertEqual(result.columns, columns)
        numpy.testing.assert_array_equal(result.values, values)

    def test_a_run_is_that_of_the_command_line(self):
        self.check_same(variator_sim.simulate(SHIP, 2.0, rate=50),
                        *from_command_line(SHIP, "--duration", 2, "--rate", 50))

    def test_commands_columns_times_and_overrides(self):
        groups = "state,elements,inputs,energy"
        expected = from_command_line(STEPS, "--times", "0,0.5,1.75", "--commands", STEP_COMMANDS,
                                     "--columns", groups, "--set", "solver/relative_tolerance=1e-6")
        overrides = {"solver/relative_tolerance": 1e-6}
        listed = variator_sim.running.read_commands(STEP_COMMANDS)
        by_topic = {}
        for instant, topic, value in listed:
            by_topic.setdefault(topic, []).append((instant, value))
        self.assertGreater(len(listed), 2)
        for commands in (STEP_COMMANDS, listed, by_topic):
            with self.subTest(commands=type(commands)):
                self.check_same(
                    variator_sim.simulate(STEPS, times=[0, 0.5, 1.75], commands=commands,
                                          columns=groups.split(","), overrides=overrides),
                    *expected)

    def test_scenes_as_text_and_dict(self):
        tree = yaml.safe_load(SHIP.read_text(encoding="utf-8"))
        tree["initial"]["velocity"] = numpy.array([5.0, 2.0])
        expected = variator_sim.simulate(str(SHIP), 0.5)
        for scene in (SHIP.read_text(encoding="utf-8"), tree):
            numpy.testing.assert_array_equal(variator_sim.simulate(scene, 0.5).values,
                                             expected.values)

    def test_a_file_of_a_result_is_that_of_the_command_line(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "out.csv")
            variator_sim.simulate(SHIP, 0.1).to_csv(path)
            with open(path, encoding="utf-8") as file:
                rows = list(csv.reader(file))
        columns, values = from_command_line(SHIP, "--duration", 0.1)
        self.assertEqual(rows[0], columns)
        numpy.testing.assert_array_equal(numpy.array(rows[1:], dtype=float), values)

    def test_a_motion_that_stops_tells_why_and_leaves_its_samples(self):
        with self.assertRaises(variator_sim.MotionStopped) as caught:
            variator_sim.simulate(STOPS, 10.0)
        error = caught.exception
        self.assertEqual(error.reason, "NonFiniteValue")
        self.assertEqual(error.torque, "motor")
        self.assertIsNone(error.constraint)
        self.assertAlmostEqual(error.time, 0.3)
        self.assertEqual(error.sample.time, error.time)
        self.assertEqual(len(error.result["time"]), 30)

    def test_a_stop_has_the_element_that_its_message_names(self):
        for torque, reason in (("1 - 3*sign(w_a)", "Chattering"), ("-9*w_a^-3", "StepUnderflow"),
                               ("100*cos(5e4*t)", "StepLimit")):
            scene = scene_text("a 1", [f"q on a: {torque}"], "initial: {velocity: [1]}", "principle: gauss",
                               "solver: {maximum_steps: 1000}")
            with self.subTest(reason=reason), self.assertRaises(variator_sim.MotionStopped) as caught:
                variator_sim.simulate(scene, 10.0)
            self.assertEqual(caught.exception.reason, reason)
            self.assertIn("torque 'q'", str(caught.exception))
            self.assertEqual((caught.exception.torque, caught.exception.constraint), ("q", None))

    def test_doubts_are_warnings(self):
        with self.assertWarnsRegex(UserWarning, "the reactions have fed in"):
            variator_sim.simulate(SHIP, 2.0)
        with self.assertWarnsRegex(UserWarning, "the command 200 on 'torque' is above"):
            variator_sim.simulate(FREE, 1.0, commands={"torque": [(0.1, 200.0), (0.2, 300.0)]})
        with self.assertWarnsRegex(UserWarning, "fixed steps of 0.2 s are crude"):
            variator_sim.simulate(SPRING + "solver: {stepper: rk4, step: 0.2}\n", 1.0)
        with self.assertWarnsRegex(UserWarning, "1 commands lie outside"):
            variator_sim.simulate(FREE, 1.0, commands=[(2.0, "torque", 1.0)])

    def test_until_rest(self):
        scene = scene_text("drive 2.0", [MOTOR, "drag on drive: -5*w1"], "initial: {velocity: [3]}")
        result = variator_sim.simulate(scene, 1000.0, until_rest=True)
        self.assertLess(result.time[-1], 100.0)

    # --- step by step -----------------------------------------------------------------------------

    def test_lockstep(self):
        simulation = variator_sim.Simulation(FREE)
        self.assertEqual(simulation.topics, ["torque"])
        sample = simulation.step(0.5, {"torque": 4.0})
        numpy.testing.assert_allclose(sample.velocity, [1.0], rtol=1e-12)
        self.assertEqual(sample["drive/velocity"], sample.velocity[0])
        self.assertTrue(simulation.command("torque", 0.0))
        simulation.advance(0.5)
        simulation.advance_to(2.0)
        self.assertAlmostEqual(simulation.sample().angle[0], 0.25 + 1.5)
        self.assertEqual(simulation.time, 2.0)
        with self.assertWarnsRegex(UserWarning, "the command 200 on 'torque' is above .* 100"):
            self.assertFalse(simulation.command("torque", 200.0))
        self.assertEqual(simulation.inputs, {"torque": 100.0})
        self.assertEqual(simulation.statistics["commands_clamped"], 1)
        simulation.reset()
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # once per input
            self.assertFalse(simulation.command("torque", 300.0))
            simulation.reset()
        self.assertEqual(simulation.time, 0.0)
        self.assertEqual(simulation.sample().velocity[0], 0.0)

    def test_a_controller_is_lockstep(self):
        def controller(sample):
            return {"torque": 6.0 * (10.0 - sample["drive/velocity"])} if sample.time < 0.995 else None

        result = variator_sim.simulate(FREE, 1.5, rate=40, columns="state,inputs", controller=controller, period=0.02)
        simulation = variator_sim.Simulation(FREE)
        for k in range(75):
            for topic, value in (controller(simulation.sample()) or {}).items():
                simulation.command(topic, value)
            if k % 5 == 0:  # an instant of both the controller and the samples
                row = simulation.record("state,inputs")
            simulation.advance_to(round((k + 1) * 0.02, 9))
        row = simulation.record("state,inputs")
        self.assertEqual(row.columns, result.columns)
        numpy.testing.assert_allclose(result.time, numpy.arange(61) / 40)
        numpy.testing.assert_allclose(result.values[::4], row.values, rtol=1e-12, atol=1e-12)
        # J w' = u in steps: e becomes (1 - 6*0.02/2) e in each
        self.assertAlmostEqual(result["drive/velocity"][40], 10.0 * (1.0 - 0.94 ** 50), places=8)

        times = variator_sim.simulate(FREE, times=[0.1, 0.11, 1.0], controller=lambda sample: None,
                                      commands={"torque": [(0.105, 2.0)]})
        numpy.testing.assert_allclose(times["drive/velocity"], [0.0, 0.005, 0.895], atol=1e-12)
        for fault, kind, words in [
                (lambda: variator_sim.simulate(FREE, 1, controller=5), ValueError, "a function"),
                (lambda: variator_sim.simulate(FREE, 1, controller=lambda s: 5.0), TypeError, "5.0; allowed: a dict"),
                (lambda: variator_sim.simulate(FREE, 1, controller=lambda s: {"torqe": 1}), ValueError, "'torque'"),
                (lambda: variator_sim.simulate(FREE, 1, controller=lambda s: {"torque": None}), TypeError,
                 "'torque': None; allowed: finite numbers by topic"),
                (lambda: variator_sim.simulate(FREE, 1, controller=lambda s: {"torque": "3"}), TypeError, "'torque': '3'"),
                (lambda: variator_sim.simulate(FREE, 1, controller=lambda s: {5: 3.0}), TypeError, "5: 3.0"),
                (lambda: variator_sim.simulate(FREE, 1, controller=controller, period=1e-12), ValueError, "period: 1e-12 makes 1e.12 calls"),
                (lambda: variator_sim.simulate(FREE, 1, controller=controller, period="x"), ValueError, "> 0 s"),
                (lambda: variator_sim.simulate(FREE, 1, controller=controller, period=0), ValueError, "> 0 s"),
                (lambda: variator_sim.simulate(FREE, 1, controller=controller, until_rest=True), ValueError,
                 "no until_rest")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                fault()
        with self.assertRaises(variator_sim.MotionStopped) as stop:
            variator_sim.simulate(STOPS, 10.0, controller=lambda sample: None)
        self.assertGreater(len(stop.exception.result.time), 1)

        def failing(sample):
            if sample.time > 0.495:
                raise fault
            return {"torque": 4.0}

        for fault in (ZeroDivisionError("mine"), KeyboardInterrupt()):
            with self.subTest(fault=fault), self.assertRaises(type(fault)) as caught:
                variator_sim.simulate(FREE, 1.0, controller=failing)
            self.assertEqual(len(caught.exception.result.time), 50)
            self.assertAlmostEqual(caught.exception.result["drive/velocity"][-1], 2.0 * 0.49)

    def test_recordings(self):
        simulation = variator_sim.Simulation(FREE)
        for _ in range(3):
            simulation.step(0.5, {"torque": 4.0})
            recording = simulation.record()
        numpy.testing.assert_array_equal(recording.time, [0.5, 1.0, 1.5])
        numpy.testing.assert_allclose(recording["drive/velocity"], [1.0, 2.0, 3.0])
        simulation.command("torque", 0.0)
        self.assertEqual(len(simulation.record().time), 3)  # the same instant, after a command
        self.assertEqual(recording["drive/applied_torque"][-1], 0.0)
        simulation.reset()
        self.assertEqual(len(simulation.record().time), 1)
        self.assertEqual(simulation.record(["inputs"]).columns, ["time", "inputs/torque"])

    def test_units_of_outputs(self):
        scene = FREE + ("outputs: [speed, power]\nspeed: {expression: w_drive, unit: rpm}\n"
                        "power: {expression: 2*w_drive}\ninitial: {velocity: [600 rpm]}\n")
        result = variator_sim.simulate(scene, 1.0, rate=1, columns="outputs")
        self.assertEqual(result.units, {"outputs/speed": "rpm"})
        numpy.testing.assert_allclose(result["outputs/speed"], [600.0, 600.0])
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "run.csv"
            result.to_csv(path)
            (pathlib.Path(folder) / "scene.yaml").write_text(scene, encoding="utf-8")
            columns, _ = from_command_line(pathlib.Path(folder) / "scene.yaml", "--duration", 1, "--rate", 1,
                                           "--columns", "outputs")
            self.assertEqual(path.read_text(encoding="utf-8").splitlines()[0], ",".join(columns))
            again = variator_sim.read_run(path)
        self.assertEqual(columns, ["time", "outputs/speed [rpm]", "outputs/power"])
        self.assertEqual(again.columns, result.columns)
        self.assertEqual(again.units, result.units)
        import matplotlib
        matplotlib.use("Agg")
        _, axes = result.plot(["outputs/*"])
        self.assertEqual([axis.get_ylabel() for axis in axes], ["Outputs, rpm", "Outputs"])

    def test_short_ways_are_the_long_ones(self):
        short, long = variator_sim.Simulation(SHIP), variator_sim.Simulation(SHIP)
        for k in range(300):
            short.advance(0.001)
            long.advance(duration=0.001)
            self.assertEqual(short.time, long.time)
            for column in ("time", "drive/velocity", "load/reaction_torque_rate",
                           "variator/multiplier"):
                self.assertEqual(short[column], long.sample()[column])
        short.advance(1)  # no float
        self.assertEqual(short.time, long.time + 1)
        with self.assertRaises(TypeError):
            short.advance(0.1, 0.2)
        with self.assertRaises(TypeError):
            variator_sim.Simulation.advance(0.1)
        for column in ("load/velocty", 3, []):
            with self.assertRaisesRegex(KeyError, "load/velocity"):
                short[column]
        stops = variator_sim.Simulation(STOPS)
        for fault in (lambda: stops.advance(10.0), lambda: stops["time"],
                      lambda: stops.advance(0.001)):
            with self.assertRaises(variator_sim.MotionStopped):
                fault()

    def test_columns_of_samples(self):
        simulation = variator_sim.Simulation(OBSERVED)
        simulation.advance(0.1)
        sample = simulation.sample()
        values = variator_sim.simulate(OBSERVED, times=[0.1]).values[0]
        self.assertEqual([sample[column] for column in sample.keys()], list(values))

    def test_samples_are_mappings_and_travel(self):
        simulation = variator_sim.Simulation(OBSERVED)
        sample = simulation.sample()
        self.assertEqual(list(sample), sample.keys())
        self.assertEqual(len(sample), len(list(sample)))
        self.assertTrue("drive/velocity" in sample and "velocity" not in sample and 3 not in sample)
        for like in (simulation.sample(), copy.copy(sample), copy.deepcopy(sample), pickle.loads(pickle.dumps(sample)),
                     variator_sim.Simulation(OBSERVED).sample()):
            self.assertTrue(like == sample and not like != sample)
            self.assertEqual(dict(like), dict(sample))
            self.assertEqual(list(like.reaction_torque), list(sample.reaction_torque))
        simulation.advance(0.1)
        self.assertNotEqual(simulation.sample(), sample)
        self.assertNotEqual(variator_sim.Simulation(FREE).sample(), sample)
        self.assertNotEqual(sample, 3)
        self.assertRegex(repr(sample), r"^Sample\(time=0, drive/angle=.*, load/velocity=.*\)$")
        with self.assertRaises(AttributeError):
            sample.velocity = [0.0, 0.0]

    def test_stops_travel(self):
        with self.assertRaises(variator_sim.MotionStopped) as caught:
            variator_sim.simulate(STOPS, 10.0)
        stop = caught.exception
        with concurrent.futures.ProcessPoolExecutor(1) as pool:
            from_another_process = pool.submit(variator_sim.simulate, STOPS, 10.0).exception()
        for other in (copy.copy(stop), pickle.loads(pickle.dumps(stop)), from_another_process):
            self.assertIs(type(other), variator_sim.MotionStopped)
            self.assertEqual([str(other), other.reason, other.time, other.sample, other.constraint, other.torque],
                             [str(stop), stop.reason, stop.time, stop.sample, stop.constraint, stop.torque])
            numpy.testing.assert_array_equal(other.result.values, stop.result.values)

    def test_wrong_arguments_of_a_simulation(self):
        simulation = variator_sim.Simulation(FREE)
        for call, kind, words in [
                (lambda: simulation.command("torque", None), TypeError, "'torque': None; allowed: a number"),
                (lambda: simulation.command("torque", "1"), TypeError, "'torque': '1'; allowed: a number"),
                (lambda: simulation.command("torque", 10**400), TypeError, "'torque': 10+; allowed: a number"),
                (lambda: simulation.step(0.1, {"torque": None}), TypeError, "'torque': None; allowed: a number"),
                (lambda: simulation.step("a"), TypeError, "duration: 'a'; allowed: a number"),
                (lambda: simulation.step(0.1, 3), TypeError, "commands: 3; allowed: a dict such as"),
                (lambda: simulation.advance(None), TypeError, "duration: None; allowed: a number"),
                (lambda: simulation.advance_to([]), TypeError, r"time: \[\]; allowed: a number"),
                (lambda: simulation.set_state("file"), TypeError, "state: 'file'; allowed: a dict such as"),
                (lambda: simulation.linearize("file"), TypeError, "state: 'file'; allowed: a dict such as"),
                (lambda: variator_sim.Simulation(FREE, "a=b"), TypeError, "overrides: 'a=b'; allowed: a dict such as"),
                (lambda: variator_sim.Simulation(FREE, {"drive/inertia": 10**30}), variator_sim.SceneError,
                 "drive/inertia: 10+; allowed: an integer of 64 bits, or a float such as 1e.30")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                call()
        self.assertTrue(simulation.command("torque", 1))
        self.assertEqual(simulation.step(1, {"torque": numpy.float64(2)}).time, 1.0)

    def test_samples_are_copies(self):
        simulation = variator_sim.Simulation(SHIP)
        first = simulation.sample()
        velocity = first.velocity
        simulation.advance(1.0)
        self.assertEqual(list(velocity), [5.0, 2.0])
        self.assertEqual(list(first.velocity), [5.0, 2.0])

    def test_states_go_on_to_the_bit(self):
        simulation = variator_sim.Simulation(SHIP)
        simulation.step(0.7, {"drive_torque": 20.0})
        state = simulation.state()
        expected = simulation.step(1.0).velocity
        other = variator_sim.Simulation(SHIP)
        other.set_state(yaml.safe_load(yaml.safe_dump(state)))
        self.assertEqual(list(other.step(1.0).velocity), list(expected))
        with self.assertRaisesRegex(variator_sim.SceneError, "velocty"):
            other.set_state({"velocty": [1, 2]})

    def test_what_can_be_seen(self):
        simulation = variator_sim.Simulation(OBSERVED)
        simulation.advance(0.1)
        groups = {"elements": simulation.elements, "inputs": simulation.inputs,
                  "outputs": simulation.outputs}
        for group, values in groups.items():
            columns = simulation.columns(group)[1:]
            prefix = "" if group == "elements" else group + "/"
            self.assertEqual(columns, [prefix + name for name in values])
            self.assertTrue(values)
        self.assertIn("kinetic", simulation.energy)

    def test_faults_name_what_is_allowed(self):
        simulation = variator_sim.Simulation(FREE)
        for fault, kind, words in [
                (lambda: variator_sim.Simulation(FREE, {"drive/inrtia": 1}),
                 variator_sim.SceneError, "drive/inrtia.*'inertia'"),
                (lambda: variator_sim.Simulation(FREE, {"drive/inertia": object()}),
                 variator_sim.SceneError, "drive/inertia.*neither a number"),
                (lambda: simulation.command("torqe", 1), ValueError, "did you mean 'torque'"),
                (lambda: simulation.command("torque", float("nan")), ValueError, "finite"),
                (lambda: simulation.advance(-1), ValueError, "-1 s.*>= 0"),
                (lambda: simulation.advance(float("nan")), ValueError, ">= 0"),
                (lambda: simulation.advance(float("inf")), ValueError, "finite"),
                (lambda: simulation.sample()["drive/velocty"], KeyError, "drive/velocity"),
                (lambda: variator_sim.simulate(FREE, 1, columns="stat"), ValueError, "'state'"),
                (lambda: variator_sim.simulate(FREE), ValueError, "duration"),
                (lambda: variator_sim.simulate(FREE, times=[1, 0.5]), ValueError, "ascending"),
                (lambda: variator_sim.simulate(FREE, 1, commands={"torqe": [(0, 1)]}), ValueError,
                 "'torque'"),
                (lambda: variator_sim.simulate(FREE, 1, commands={"torque": 0.4}), ValueError,
                 r"'torque': 0.4; allowed: pairs .*{'torque': \[\(0.0, 0.4\)\]}"),
                (lambda: variator_sim.simulate(FREE, 1, commands={"torque": (1, 0.4)}), ValueError, "'torque': .* pairs"),
                (lambda: variator_sim.simulate(FREE, 1, commands=[0.4]), ValueError, r"\[0.4\]; allowed: tuples"),
                (lambda: variator_sim.simulate(FREE, 1, overrides="a=b"), ValueError, "overrides: 'a=b'; allowed: a dict such"),
                (lambda: variator_sim.simulate(FREE, 1, overrides=5), ValueError, "overrides: 5; allowed: a dict"),
                (lambda: variator_sim.sweep(FREE, 1, overrides=5, metrics="final(time)"), ValueError, "overrides: 5; allowed"),
                (lambda: variator_sim.simulate(FREE, 1, state="file"), ValueError, "state: 'file'; allowed: a dict such"),
                (lambda: variator_sim.simulate(FREE, 1, state={"shafts": {"drive": {"velocity": 10**30}}}), ValueError,
                 "state/shafts/drive/velocity: 10+; allowed: .* a float such as 1e.30"),
                (lambda: variator_sim.simulate(FREE, 1, overrides={"drive/inertia": 10**400}), ValueError,
                 "drive/inertia: 10+; allowed: .* a float such as"),
                (lambda: variator_sim.simulate(FREE, 1, rate=1e12), ValueError, r"rate: 1e\+12 makes 1e\+12 samples; allowed"),
                (lambda: variator_sim.simulate(FREE, 1, rate="x"), ValueError, "rate: 'x'; allowed: a finite number > 0"),
                (lambda: variator_sim.simulate(FREE, "x"), ValueError, "duration: 'x'; allowed: a finite number >= 0"),
                (lambda: variator_sim.simulate(FREE, times="x"), ValueError, "times: 'x'; allowed"),
                (lambda: variator_sim.simulate(FREE, 1, gradient=5), ValueError, "gradient: 5; allowed: a text"),
                (lambda: variator_sim.simulate(FREE, 1, columns=5), ValueError, "columns: 5; allowed: a text"),
                (lambda: variator_sim.simulate(FREE, 1, columns=[5]), ValueError, r"columns: \[5\]; allowed: a text"),
                (lambda: variator_sim.simulate(FREE, 1, commands=5), ValueError, r"commands: \[5\]; allowed"),
                (lambda: variator_sim.simulate("no.yaml", 1), variator_sim.SceneError, "no.yaml")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                fault()

    def test_another_thread_goes_on_meanwhile(self):
        # Stiff and long enough for many blocks; the thread that moves it must not block the others.
        simulation = variator_sim.Simulation(SHIP, {"solver/maximum_step": 1e-4})
        mover = threading.Thread(target=simulation.advance, args=(20.0,))
        mover.start()
        counted = 0
        refused = 0
        while mover.is_alive():
            counted += 1
            try:
                simulation.sample()
            except RuntimeError as error:
                refused += "another thread" in str(error)
            time.sleep(0)
        mover.join()
        self.assertGreater(refused, 10)
        self.assertEqual(simulation.time, 20.0)

    def hear(self, call):
        """Ctrl-C shortly after the beginning of a call that lasts long; s until it is heard."""
        begin = time.monotonic()
        # (Another process: a thread would wait for the interpreter's lock.)
        with subprocess.Popen(["sh", "-c", f"sleep 0.1; kill -INT {os.getpid()}"]) as sender:
            with self.assertRaises(KeyboardInterrupt):
                call()
                sender.wait()
                self.fail("the call has ended before")
        return time.monotonic() - begin - 0.1

    def test_ctrl_c_leaves_the_samples(self):
        with subprocess.Popen(["sh", "-c", f"sleep 0.5; kill -INT {os.getpid()}"]) as sender:
            with self.assertRaises(KeyboardInterrupt) as caught:
                variator_sim.simulate(SHIP, 1e9, rate=0.01)
                sender.wait()
        instants = caught.exception.result.time
        self.assertGreater(len(instants), 1)
        self.assertEqual(list(instants), [100.0 * k for k in range(len(instants))])

    def test_ctrl_c_is_heard_in_every_call(self):
        terms = "*".join(f"(w1+{i}e-9)" for i in range(24000))
        large = scene_text("drive 2", [f"m on drive: {terms}"])
        harmonics = ", ".join(f"{{order: {n + 1}, cos: 0.001}}" for n in range(1000))
        rippled = variator_sim.Simulation("shafts: [a, b]\n" + "".join(
            f"{shaft}: {{inertia: {{mean: 1e6, harmonics: [{harmonics}]}}}}\n" for shaft in "ab"))
        moved = variator_sim.Simulation(SHIP)
        # By dopri5 a step is as short as the stiffness asks for: 3e8 in one second of the motion.
        crawl = scene_text("a 1", ["drag on a: sin(t) - 1e9*w_a"],
                           "solver: {stepper: dopri5, maximum_steps: 2000000000}")
        crawls = variator_sim.Simulation(crawl)
        for name, call in [
                ("crawl", lambda: crawls.advance_to(1e6)), ("crawl, simulate", lambda: variator_sim.simulate(crawl, 1e6)),
                ("crawl, sweep", lambda: variator_sim.sweep(crawl, 1e6, grid={"a/inertia": [1.0, 2.0]}, times=[1e6],
                                                            metrics=["final(a/velocity)"], threads=2)),
                ("advance", lambda: moved.advance(1e9)),
                ("simulate", lambda: variator_sim.simulate(SHIP, 1e9, rate=1e-3)),
                ("sweep", lambda: variator_sim.sweep(SHIP, 1e9, grid={"drive/inertia": [1.0, 1.1]},
                                                     metrics=["final(load/velocity)"], threads=2)),
                ("scene", lambda: variator_sim.Simulation(large)), ("trim", rippled.trim),
                ("linearize", rippled.linearize)]:
            with self.subTest(call=name):
                self.assertLess(self.hear(call), 5.0)
        # The motions go on from where they were.
        self.assertGreater(crawls.time, 0.0)
        crawls.advance(1e-9)
        self.assertTrue(0.0 < moved.time < 1e9)
        moved.advance(1.0)
        other = variator_sim.Simulation(SHIP)
        other.advance_to(moved.time)
        self.assertEqual(list(other.sample().velocity), list(moved.sample().velocity))

    def test_ctrl_c_is_heard_while_a_compiler_runs(self):
        with tempfile.TemporaryDirectory() as folder:
            environment = {"PATH": fake_compiler(folder, "exec sleep 30"), "VARIATOR_SIM_CACHE": folder + "/cache"}
            simulation = variator_sim.Simulation(FREE)
            with mock.patch.dict(os.environ, environment):
                self.assertLess(self.hear(simulation.compile), 4.0)
                self.assertLess(self.hear(lambda: variator_sim.Simulation(FREE, {"solver/machine_code": "always"})),
                                4.0)

    def test_values_without_an_end(self):
        endless, twice, deep = [], [], 0.0
        endless.append(endless)
        twice += [twice, twice]
        tree = {}
        tree["a"] = tree
        for _ in range(200000):
            deep = [deep]
        shared = 0.0
        for _ in range(60):
            shared = [shared, shared]
        simulation = variator_sim.Simulation(FREE)
        state = simulation.state()
        state["history"] = state
        for value, words in ((endless, "nested more than 64 deep"), (twice, "nested more than 64 deep"),
                             (deep, "nested more than 64 deep"), (shared, "more than 1000000 values"),
                             ((endless,), "nested more than 64 deep")):
            with self.subTest(words=words), self.assertRaisesRegex(variator_sim.SceneError, words):
                variator_sim.Simulation(FREE, {"initial/velocity": value})
        for call in (lambda: variator_sim.Simulation(tree), lambda: simulation.set_state(state),
                     lambda: variator_sim.sweep(tree, 1.0, metrics=["final(time)"])):
            with self.assertRaisesRegex(variator_sim.SceneError, "nested more than 64 deep"):
                call()
        with self.assertRaisesRegex(variator_sim.SceneError, "more than 64 keys"):
            variator_sim.Simulation(FREE, {"a/" * 100000 + "b": 1.0})
        while isinstance(deep, list):  # (Python's own way to end it is recursive)
            deep = deep.pop()

    def test_half_of_a_surrogate_pair(self):
        simulation = variator_sim.Simulation(FREE)
        half = "\ud800"
        for call, kind in [
                (lambda: variator_sim.Simulation(FREE, {half: 1}), ValueError),
                (lambda: variator_sim.Simulation(FREE, {"drive/inertia": half}), ValueError),
                (lambda: variator_sim.Simulation({half: 1}), ValueError),
                (lambda: variator_sim.Simulation(FREE + half), ValueError),
                (lambda: variator_sim.Simulation(half), ValueError),
                (lambda: variator_sim.simulate(FREE, 1, commands=half), ValueError),
                (lambda: simulation.step(0.1, {half: 1}), ValueError),
                (lambda: simulation.step(0.1, {1: 1}), ValueError),
                (lambda: simulation.sample()[half], KeyError), (lambda: simulation[half], KeyError),
                (lambda: simulation.trim(fix={half: 1}), ValueError)]:
            with self.assertRaises(kind):
                call()
        # A file's name need be no UTF-8.
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, os.fsdecode(b"\xff.yaml"))
            pathlib.Path(path).write_text(FREE, encoding="utf-8")
            self.assertEqual(variator_sim.Simulation(path).shafts, ["drive"])
            with self.assertRaisesRegex(ValueError, r"\\xff.csv"):
                variator_sim.simulate(FREE, 1, commands=os.path.join(folder, os.fsdecode(b"\xff.csv")))

    def test_objects_that_nothing_has_made(self):
        compiled = variator_sim.Simulation.__base__
        for name in [name for name in vars(compiled) if not name.startswith("__")] + ["__repr__"]:
            with self.subTest(name=name), self.assertRaises(TypeError):
                value = getattr(compiled.__new__(compiled), name)
                value()
                raise TypeError(repr(value))  # of an object as any other
        with self.assertRaises(TypeError):
            variator_sim.Simulation.__new__(variator_sim.Simulation)["time"]

    def test_files_that_cannot_be_written_leave_the_old_ones(self):
        simulation = variator_sim.Simulation(SHIP)
        result = variator_sim.simulate(SHIP, 0.1)
        with tempfile.TemporaryDirectory() as folder:
            for name, write in (("run.csv", result.to_csv), ("model.npz", simulation.linearize().save)):
                path = pathlib.Path(folder) / name
                path.write_text("old", encoding="utf-8")
                link = pathlib.Path(folder) / ("link-" + name)
                link.symlink_to(path)
                with mock.patch.object(os, "fsync", side_effect=OSError(28, "No space left on device")):
                    with self.assertRaisesRegex(OSError, "No space"):
                        write(link)
                self.assertEqual(path.read_text(encoding="utf-8"), "old")
                write(link)
                self.assertTrue(link.is_symlink())
                self.assertGreater(path.stat().st_size, 100)
            self.assertEqual(len(os.listdir(folder)), 4)

    def test_no_locale_changes_a_number(self):
        script = """
import locale, os, sys, variator_sim, warnings
if "LOCPATH" in os.environ:
    locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
    assert locale.localeconv()["decimal_point"] == ","
warnings.simplefilter("ignore")
scene, stops, spring = sys.argv[1:]
crude = variator_sim.Simulation(spring, {"solver/stepper": "rk4", "solver/step": 0.2})
crude.advance(2.5)
simulation = variator_sim.Simulation(scene)
simulation.advance(2.5)
print(crude.doubts, simulation.doubts, simulation.linearize(), repr(simulation.sample()), simulation.stepper)
for call in (lambda: simulation.advance(-0.5), lambda: variator_sim.simulate(stops, 10.0),
             lambda: variator_sim.Simulation(scene, {"drive/inertia": -1.5})):
    try:
        call()
    except (ValueError, RuntimeError) as error:
        print(error)
"""
        with tempfile.TemporaryDirectory() as folder:
            made = subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", folder + "/de_DE.UTF-8"],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
            if made.returncode != 0:
                self.skipTest("the sources of a locale with decimal commas are not installed")
            texts = [subprocess.run([sys.executable, "-c", script, str(SHIP), str(STOPS), SPRING],
                                    env={**os.environ, **environment}, check=True, text=True, timeout=60,
                                    stdout=subprocess.PIPE).stdout for environment in ({}, {"LOCPATH": folder})]
        self.assertIn("fixed steps of 0.2 s are crude", texts[0])
        self.assertEqual(*texts)

    def test_pictures(self):
        import matplotlib
        matplotlib.use("Agg")
        result = variator_sim.simulate(OBSERVED, 0.5, columns="state,elements,outputs,energy")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "out.png"
            _, axes = result.plot(title="Observed", path=path)
            self.assertGreater(path.stat().st_size, 10000)
        self.assertEqual([len(axis.get_lines()) for axis in axes], [3] * 4)  # shafts and the zero
        _, axes = result.plot(["load/velocity", "engine/power", "energy/kinetic"])
        self.assertEqual([axis.get_ylabel() for axis in axes],
                         ["Speed, rad/s", "Power, W", "Energy, J"])

    def test_typed(self):
        folder = pathlib.Path(variator_sim.running.__file__).parent
        self.assertTrue((folder / "py.typed").exists())
        stub = (folder / "_core.pyi").read_text(encoding="utf-8")
        for name in vars(variator_sim.Simulation.__base__):
            if not name.startswith("_"):
                self.assertIn(f"def {name}(", stub)
        for kind in (variator_sim.Simulation, variator_sim.Sample, variator_sim.LinearModel, variator_sim.SteadyState):
            for name, value in vars(kind).items():
                if not name.startswith("_"):
                    self.assertTrue(value.__doc__, name)

    def test_messages_lie_beside(self):
        from variator_sim.msg import DrivetrainState
        from variator_sim.srv import Step
        self.assertEqual(DrivetrainState._type, "variator_sim/DrivetrainState")
        self.assertEqual(Step._type, "variator_sim/Step")


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "python_test", PythonTest)
