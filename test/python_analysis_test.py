#!/usr/bin/python3
"""Linear models and steady states from Python: those of the command line, and of runs."""

import os
import pathlib
import subprocess
import tempfile
import warnings

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402
import yaml  # noqa: E402

from support.scenes import scene_text  # noqa: E402
from support.subtests import TestCase  # noqa: E402
import variator_sim  # noqa: E402
from variator_sim.running import read_commands  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]
CONFIG = FOLDER / "config"
RATIO_STEPS = CONFIG / "ratio_steps.yaml"
VEHICLE = CONFIG / "applications/vbelt_vehicle.yaml"
# Every shipped scene, the instant and the commands that lead there.
SCENES = [(path, 2.0, path.with_suffix(".csv") if path.with_suffix(".csv").exists() else None)
          for path in sorted(CONFIG.glob("*.yaml")) + sorted(CONFIG.glob("applications/*.yaml"))]
ARRAYS = ("A", "B", "C", "D", "x", "u", "y", "x_rate", "time")
# dv/dt = (u - c w^2)/J: steady at w = sqrt(u/c), with the eigenvalue -2 c w/J.
DRAG = scene_text("drive 2.0", [
    "motor on drive from torque, initial: 8.0, max: 100",
    "drag on drive: -0.5*w1*abs(w1)"], "initial: {velocity: [1.0]}")
# One constraint of each order; w2 - i w1 = 0 with i = u + t/10.
ORDERS = scene_text("a 1.0, b 1.0, c 1.0, d 1.0", [
    "motor on a from torque",
    "first of order 1: w2-(u+t/10)*w1",
    "second: e1*e3+sin(phi1)*w3-p",
    "third of order 3: j4-j1"], "inputs: [u, p]",
    "u: {topic: u, hold: second_order_lag, time_constant: 0.2, initial: 0.6}",
    "p: {topic: p, hold: zero_order, initial: 3.0}",
    "initial: {velocity: [5.0, 3.0, 1.0, 0.0], acceleration: [1.0, 1.1, 3.0, 0.0]}")


def simulate(*arguments):
    return subprocess.run([SIMULATE, *map(str, arguments)], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True, timeout=60, check=False)


def run_to(path, instant, commands):
    simulation = variator_sim.Simulation(path)
    for time, topic, value in read_commands(commands):
        if time > instant:
            break
        simulation.advance_to(time)
        simulation.command(topic, value)
    simulation.advance_to(instant)
    return simulation


class PythonAnalysisTest(TestCase):

    def check_same(self, model, path):
        with numpy.load(path) as file:
            for name in ARRAYS:
                numpy.testing.assert_array_equal(getattr(model, name), file[name], err_msg=name)
            for name in ("states", "inputs", "outputs"):
                self.assertEqual(getattr(model, name), list(file[name]))

    # --- linear models ----------------------------------------------------------------------------

    def test_models_are_those_of_the_command_line(self):
        self.assertGreater(len(SCENES), 8)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "model.npz")
            mine = os.path.join(folder, "mine.npz")
            for path, instant, commands in SCENES:
                for full in (False, True):
                    with self.subTest(scene=path.name, full=full):
                        words = ["--commands", commands] if commands else []
                        words += ["--full"] if full else []
                        told = simulate(path, "--linearize", "--at", instant, "--output", file,
                                        *words)
                        self.assertEqual(told.returncode, 0, told.stderr)
                        simulation = run_to(path, instant, commands)
                        model = simulation.linearize(full=full)
                        self.check_same(model, file)
                        self.assertTrue(str(model).startswith(told.stdout.split("\n\n")[0]))
                        model.save(mine)
                        self.check_same(model, mine)
                        self.assertEqual(simulation.time, instant)

    def test_models_are_differences_of_runs(self):
        """A step of each command at a steady state: central differences against the model."""
        span = 0.4
        for path, fix, free in [(RATIO_STEPS, {"drive_torque": 5, "w_drive": 10}, "load_torque"),
                                (VEHICLE, None, None)]:
            simulation = variator_sim.Simulation(path, {"solver/relative_tolerance": 1e-12,
                                                        "solver/absolute_tolerance": 1e-12})
            state = simulation.trim(fix, free)[0].state
            model = simulation.linearize(state)
            shafts = [name for name in model.outputs if name in simulation.sample().keys()]
            rows = [model.outputs.index(name) for name in shafts]
            for i, topic in enumerate(simulation.topics):
                with self.subTest(scene=path.name, topic=topic):
                    h = 1e-4 * max(1.0, abs(model.u[i]))
                    ends = []
                    for sign in (1.0, -1.0):
                        simulation.reset()
                        simulation.set_state(state)
                        sample = simulation.step(span, {topic: model.u[i] + sign * h})
                        ends.append(numpy.array([sample[name] for name in shafts]))
                    measured = (ends[0] - ends[1]) / (2.0 * h)
                    # x' = A x + b from 0 by the exponential of [[A, b], [0, 0]].
                    n = len(model.states)
                    whole = numpy.zeros((n + 1, n + 1))
                    whole[:n, :n], whole[:n, n] = model.A, model.B[:, i]
                    x, term = numpy.zeros(n + 1), numpy.eye(n + 1)[:, n]
                    for k in range(1, 80):
                        x, term = x + term, whole @ term * (span / k)
                    predicted = (model.C @ x[:n] + model.D[:, i])[rows]
                    numpy.testing.assert_allclose(measured, predicted, rtol=0,
                                                  atol=1e-6 * numpy.abs(predicted).max())

    def test_a_model_by_hand(self):
        simulation = variator_sim.Simulation(DRAG)
        simulation.advance(3.0)
        before = simulation.sample()["drive/velocity"]
        model = simulation.linearize({"shafts": {"drive": {"velocity": 4.0, "acceleration": 0.0}}})
        place = model.states.index("drive/velocity")
        self.assertAlmostEqual(model.A[place, place], -0.5 * 2 * 4.0 / 2.0)
        self.assertAlmostEqual(min(model.eigenvalues.real), -2.0)
        self.assertEqual(model.time, 3.0)
        self.assertEqual(simulation.sample()["drive/velocity"], before)
        # The motion goes on, to the bit, like one without the request.
        other = variator_sim.Simulation(DRAG)
        simulation.advance_to(9.0)
        other.advance_to(9.0)
        self.assertEqual(simulation.sample()["drive/angle"], other.sample()["drive/angle"])
        self.assertIn("2 states, 1 inputs", repr(model))
        model.A[0, 0] = 7.0  # a copy
        self.assertNotEqual(model.A[0, 0], 7.0)

    # --- steady states ----------------------------------------------------------------------------

    def test_steady_states_are_those_of_the_command_line(self):
        for path, fix, free in [
                (RATIO_STEPS, {"drive_torque": 5.0, "w_drive": 10.0}, ["load_torque"]),
                (RATIO_STEPS, {"drive_torque": 5.0, "w_drive": 10.0}, {"load_torque": 1.0}),
                (VEHICLE, None, None), (VEHICLE, {"throttle": 0.5}, None)]:
            with self.subTest(scene=path.name, fix=fix, free=free):
                words = [f"--fix={name}={value}" for name, value in (fix or {}).items()]
                starts = free.items() if isinstance(free, dict) else [(n, None) for n in free or ()]
                words += ["--free=" + (name if start is None else f"{name}={start}")
                          for name, start in starts]
                told = simulate(path, "--trim", *words)
                self.assertEqual(told.returncode, 0, told.stderr)
                found = variator_sim.Simulation(path).trim(fix, free)
                parts = told.stdout.split("# another:\n")
                self.assertEqual(len(found), len(parts))
                for part, steady in zip(parts, found):
                    self.assertIn(steady.stability, part)
                    self.assertLessEqual(steady.residual, 1e-10)
                    self.assertEqual(steady.undetermined, [])
                    lines = [line for line in part.splitlines() if "residual" not in line]
                    text = "\n".join(line[2:] if line.startswith("# ") else line for line in lines)
                    self.assertEqual(steady.state, yaml.safe_load(text))

    def test_a_run_that_starts_there_stays(self):
        simulation = variator_sim.Simulation(VEHICLE)
        found = simulation.trim({"throttle": 0.5})
        steady = next(it for it in found if it.stability.startswith("stable"))
        simulation.set_state(steady.state)
        before = simulation.sample().velocity
        simulation.advance(1.0)
        numpy.testing.assert_allclose(simulation.sample().velocity, before, rtol=1e-8, atol=1e-9)

    def test_starts_of_what_is_free(self):
        simulation = variator_sim.Simulation(DRAG)
        [steady] = simulation.trim({"w_drive": 6.0}, {"torque": 10.0})
        self.assertAlmostEqual(steady.state["inputs"]["torque"]["value"], 18.0)
        self.assertEqual(len(simulation.trim({"w_drive": 6.0}, "torque")), 1)

    def test_none_and_too_many_are_told(self):
        simulation = variator_sim.Simulation(DRAG)
        with self.assertRaisesRegex(variator_sim.NoSteadyState, "no steady state"):
            simulation.trim({"w_drive": 100.0}, ["torque"])
        with self.assertWarnsRegex(UserWarning, "infinitely many"):
            found = simulation.trim(free="torque")
        self.assertTrue(found[0].undetermined)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.assertEqual(len(simulation.trim()), 1)

    def test_faults_name_what_is_allowed(self):
        simulation = variator_sim.Simulation(DRAG)
        for fault, kind, words in [
                (lambda: simulation.trim({"w_drvie": 1}), variator_sim.SceneError, "'w_drive'"),
                (lambda: simulation.trim({"w_drive": float("nan")}), variator_sim.SceneError,
                 "w_drive.*finite"),
                (lambda: simulation.trim({"w_drive": {}}), TypeError, "fix: 'w_drive': {}; allowed: a number"),
                (lambda: simulation.trim(free={"torque": "x"}), TypeError, "free: 'torque': 'x'; allowed: a number"),
                (lambda: simulation.trim(free=0), TypeError, "free: 0; allowed: a name, a list .* or a dict"),
                (lambda: simulation.trim([1]), variator_sim.SceneError, "fix: 1 is not a text"),
                (lambda: simulation.linearize().save("model.txt"), ValueError, "model.txt.*npz"),
                (lambda: simulation.linearize().save("/no/folder/model.npz"), OSError, "/no/folder"),
                (lambda: simulation.linearize({"shfts": {}}), variator_sim.SceneError, "shafts")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                fault()
        stops = variator_sim.Simulation(FOLDER / "test/scenes/stops.yaml")
        with self.assertRaises(variator_sim.MotionStopped):
            stops.advance(10.0)
        for fault in (stops.linearize, lambda: stops.residuals([0.0, 0.0])):
            with self.assertRaises(variator_sim.MotionStopped):
                fault()

    # --- constraints over accelerations -----------------------------------------------------------

    def test_residuals_at_given_accelerations(self):
        simulation = variator_sim.Simulation(ORDERS)
        self.assertEqual(simulation.orders, [1, 2, 3])
        simulation.command("u", 0.8)
        simulation.advance(0.3)
        simulation.command("p", 4.0)
        rates = variator_sim.Simulation(ORDERS)  # of the lag, by differences
        rates.command("u", 0.8)
        rates.advance_to(0.3 - 1e-5)
        before = rates.inputs["u"]
        rates.advance_to(0.3 + 1e-5)
        ratio_rate = 0.1 + (rates.inputs["u"] - before) / 2e-5
        now, state = simulation.sample(), simulation.state()
        e = numpy.random.default_rng(1).uniform(-5.0, 5.0, (3, 2, 4))
        found = simulation.residuals(e)
        self.assertEqual(found.shape, (3, 2, 3))
        ratio = simulation.inputs["u"] + 0.03
        self.assertGreater(ratio, 0.66)
        numpy.testing.assert_allclose(
            found[..., 0], e[..., 1] - ratio * e[..., 0] - ratio_rate * now.velocity[0], rtol=1e-7)
        numpy.testing.assert_allclose(
            found[..., 1], e[..., 0] * e[..., 2] + numpy.sin(now.angle[0]) * now.velocity[2] - 4.0)
        self.assertTrue(numpy.isnan(found[..., 2]).all())
        numpy.testing.assert_allclose(simulation.residuals(now.acceleration)[:2], 0.0, atol=1e-12)
        self.assertEqual(simulation.state(), state)

    def test_arrays_of_accelerations(self):
        simulation = variator_sim.Simulation(CONFIG / "acceleration_circle.yaml")
        grid = numpy.arange(24.0).reshape(3, 4, 2)
        expected = (grid ** 2).sum(axis=-1, keepdims=True) - 4.0
        for e in (grid, grid.tolist(), grid.astype(int), numpy.asfortranarray(grid),
                  numpy.repeat(grid, 2, axis=0)[::2]):
            numpy.testing.assert_array_equal(simulation.residuals(e), expected)
        self.assertEqual(simulation.residuals(numpy.zeros((0, 2))).shape, (0, 1))
        self.assertEqual(variator_sim.Simulation(DRAG).residuals([[1.0]]).shape, (1, 0))
        for e, kind, words in [([1, 2, 3], ValueError, "3 in the last.* 2, .*drive, load"),
                               (1.0, ValueError, "one number.* 2, one for each shaft"),
                               ([[1, 2], [3, float("nan")]], ValueError, "nan for shaft 'load'"),
                               ([float("inf"), 2], ValueError, "inf for shaft 'drive'.*finite"),
                               ("fast", TypeError, "accelerations")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                simulation.residuals(e)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "python_analysis_test", PythonAnalysisTest)
