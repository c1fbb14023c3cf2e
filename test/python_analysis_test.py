#!/usr/bin/python3
"""Linear models and steady states from Python: those of the command line, and of runs."""

import os
import pathlib
import subprocess
import tempfile
import unittest
import warnings

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402
import yaml  # noqa: E402

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
DRAG = """
shafts: [drive]
drive: {inertia: 2.0}
torques: [motor, drag]
motor: {type: variator_sim/CommandedTorque, shaft: drive, topic: torque, initial: 8.0, max: 100}
drag: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "-0.5*w1*abs(w1)"}
initial: {velocity: [1.0]}
"""


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


class PythonAnalysisTest(unittest.TestCase):

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
                (lambda: simulation.linearize().save("model.txt"), ValueError, "model.txt.*npz"),
                (lambda: simulation.linearize().save("/no/folder/model.npz"), OSError, "/no/folder"),
                (lambda: simulation.linearize({"shfts": {}}), variator_sim.SceneError, "shafts")]:
            with self.subTest(words=words), self.assertRaisesRegex(kind, words):
                fault()
        stops = variator_sim.Simulation(FOLDER / "test/scenes/stops.yaml")
        with self.assertRaises(variator_sim.MotionStopped):
            stops.advance(10.0)
        with self.assertRaises(variator_sim.MotionStopped):
            stops.linearize()


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "python_analysis_test", PythonAnalysisTest)
