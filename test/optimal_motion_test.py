#!/usr/bin/python3
"""Optimal programmes against closed forms, and the least fuel of a car from rest to 80 km/h."""

import csv
import os
import pathlib
import subprocess
import sys
from unittest import mock

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy as np
import roslib.packages
import rosunit
import variator_sim
from support.simulate import SimulateTestCase
from variator_sim import optimal

FOLDER = pathlib.Path(roslib.packages.get_pkg_dir("variator_sim"))


def kinematic_start():
    """A load of J = 2 kg m^2 whose acceleration is imposed; cost: the integral of its reaction squared."""
    return {"shafts": ["drive", "load"], "drive": {"inertia": 1.0}, "load": {"inertia": 2.0}, "inputs": ["wanted"],
            "wanted": {"topic": "wanted", "hold": "zero_order", "initial": 0.0, "min": -50.0, "max": 50.0},
            "constraints": ["law"], "law": {"type": "variator_sim/ExpressionConstraint", "order": 2,
                                            "expression": "e_load - wanted"},
            "principle": "gauss", "states": ["cost"], "cost": {"rate": "(2*e_load)^2", "initial": 0.0}}


class OptimalMotionTest(SimulateTestCase):
    def test_kinematic_start(self):
        """Least integral of R^2, R = J e, from rest to angle F and speed W at T: by the conditions of stationarity e is
        linear in time. For accelerations e_k constant over h, with the middles m_k of their intervals, the sums
        h sum e_k = W and h sum e_k (T - m_k) = F ask for e_k = a + b (T - m_k)."""
        J, T, W, F, n = 2.0, 4.0, 6.0, 9.0, 16
        h = T / n
        left = T - h * (np.arange(n) + 0.5)
        a, b = np.linalg.solve([[n, left.sum()], [left.sum(), (left ** 2).sum()]], [W / h, F / h])
        expected = J ** 2 * h * ((a + b * left) ** 2).sum()
        # Without the intervals: e = a + b (T - t), integral of e^2 = 4 W^2/T - 12 W F/T^2 + 12 F^2/T^3.
        exact = J ** 2 * (4 * W ** 2 / T - 12 * W * F / T ** 2 + 12 * F ** 2 / T ** 3)
        self.assertLess(abs(expected / exact - 1), 4.0 / n ** 2)
        found = variator_sim.optimise(kinematic_start(), "wanted", "cost",
                                      [f"w_load({T}) = {W}", f"phi_load({T}) = {F}"], knots=n)
        self.assertLess(abs(found.cost / expected - 1), 1e-4)
        self.assertEqual(found.describe_constant(9), "no constant commands meet the conditions")
        np.testing.assert_allclose([value for _, _, value in found.commands], a + b * left, atol=1e-3)

    def test_largest_angle(self):
        """The largest angle from rest to rest within bounds of the torque: the one bound, then the other,
        phi = e (T/2)^2; with a bound of the rate at most that."""
        for rate, knots in ((20.0, 8), (5.0, 16)):
            found = variator_sim.optimise(kinematic_start(), "wanted", "-phi_load", "w_load(4) = 0", knots=knots,
                                          bounds={"wanted": (-5.0, 5.0)}, rates={"wanted": rate}, start={"wanted": 0.0})
            values = np.array([value for _, _, value in found.commands])
            self.assertLess(np.abs(values).max(), 5.0 + 1e-6)
            self.assertLess(np.abs(np.diff(values)).max(), rate * 4.0 / knots + 1e-6)
            if rate == 20.0:
                self.assertAlmostEqual(found.cost, 20.0, 3)
                np.testing.assert_allclose(values, np.repeat([5.0, -5.0], 4), atol=1e-3)
            else:
                self.assertLess(found.cost, 20.0 - 0.1)

    def test_car(self):
        """The shipped car: at least 5 % less fuel than with the best constant commands; the file plays the same."""
        scene = str(FOLDER / "config" / "applications" / "optimal" / "optimal_start.yaml")
        script = [sys.executable, str(FOLDER / "scripts" / "optimise"), scene, "--control", "ratio", "--control", "throttle",
                  "--knots", "10", "--minimise", "fuel", "--subject", "w_wheels(20) = 74.07", "--bounds", "ratio=0.06:0.4",
                  "--rate", "ratio=0.1", "--output", str(self.folder / "start.csv"), "--picture",
                  str(self.folder / "start.png")]
        done = subprocess.run(script, stderr=subprocess.PIPE, text=True, timeout=60, check=False, env=self.environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater((self.folder / "start.png").stat().st_size, 10000)
        optimum, constant = (float(done.stderr.split(word)[1].split()[0].rstrip(",;"))
                             for word in ("fuel = ", "constant commands "))
        self.assertLess(optimum, 0.95 * constant)
        played = variator_sim.simulate(scene, 20.0, commands=str(self.folder / "start.csv"), columns="state,states")
        self.assertAlmostEqual(played["states/fuel"][-1] / optimum, 1.0, 6)
        self.assertAlmostEqual(played["wheels/velocity"][-1], 74.07, 3)
        with open(self.folder / "start.csv", encoding="utf-8") as file:
            ratios = [float(row["value"]) for row in csv.DictReader(file) if row["topic"] == "ratio"]
        self.assertLess(np.abs(np.diff(ratios)).max(), 0.1 * 2.0 + 1e-6)

    def test_interrupted(self):
        """The best programme so far that satisfies the conditions is kept."""
        whole, has_come = optimal.Problem.evaluate, []

        def evaluate(problem, x):
            if problem.best[1] is not None and not has_come:
                has_come.append(True)
                raise KeyboardInterrupt
            return whole(problem, x)

        subject = ["w_load(4.0) = 6.0", "phi_load(4.0) = 9.0"]
        with mock.patch.object(optimal.Problem, "evaluate", evaluate), self.assertRaises(KeyboardInterrupt) as caught:
            optimal.optimise(kinematic_start(), "wanted", "cost", subject, knots=16)
        programme = caught.exception.programme
        self.assertEqual(programme.message, "interrupted")
        self.assertAlmostEqual(programme.result["load/velocity"][-1], 6.0, places=3)
        self.assertAlmostEqual(programme.result["load/angle"][-1], 9.0, places=3)

    def test_outputs_are_tried_before_the_search(self):
        script = [sys.executable, str(FOLDER / "scripts" / "optimise"),
                  str(FOLDER / "config" / "applications" / "optimal" / "optimal_start.yaml"), "--control", "ratio",
                  "--minimise", "petrol", "--subject", "speed(20) = 80"]
        for option in ("--output", "--picture"):
            with self.subTest(option=option):
                path = str(self.folder / "none" / "start.csv")
                done = subprocess.run([*script, option, path], stderr=subprocess.PIPE, text=True, timeout=60, check=False,
                                      env=self.environment)
                self.assertEqual(done.returncode, 3, done.stderr)
                self.assertIn(f"No such file or directory: '{path}'", done.stderr)

    def test_refused(self):
        scene = kinematic_start()
        for arguments, word in ((("wnted", "cost", ["w_load(2) = 1"]), "wanted"),
                                (("wanted", "costs", ["w_load(2) = 1"]), "cost"),
                                (("wanted", "cost", ["w_load(2) < 1"]), "<="), (("wanted", "cost"), "duration")):
            with self.subTest(arguments=arguments), self.assertRaisesRegex(ValueError, word):
                optimal.optimise(scene, *arguments, knots=4)
        good = dict(subject=["w_load(2) = 1"], knots=4)
        for arguments, word in (
                (dict(controls=["wanted", "wanted"]), "control: 'wanted' is given twice"),
                (dict(minimise="cots"), "minimise: 'cots' .*did you mean 'cost'.*allowed: w_SHAFT"),
                (dict(subject="w_lod(2) = 1"), r"subject: 'w_lod\(2\) = 1': 'w_lod' is no quantity"),
                (dict(bounds={"wantd": (1, 2)}), "bounds: 'wantd' is no control .did you mean 'wanted'"),
                (dict(bounds={"wanted": (2, 1)}), "bounds: 'wanted': from 2 to 1; allowed: the lower one first"),
                (dict(bounds={"wanted": 2}), "bounds: 'wanted': 2; allowed: two numbers"),
                (dict(bounds={"wanted": (-99, 1)}), "bounds: 'wanted': .*within the scene's limits, -50 to 50"),
                (dict(start={"wanted": 99}), "start: 'wanted': 99; allowed: within its bounds, -50 to 50"),
                (dict(start={"wantd": 9}), "start: 'wantd' is no control .did you mean 'wanted'"),
                (dict(rates={"wantd": 9}), "rate: 'wantd' is no control .did you mean 'wanted'"),
                (dict(rates={"wanted": float("nan")}), "rate: 'wanted': nan; allowed: a finite number > 0"),
                (dict(subject=5), "subject: 5; allowed: a text"), (dict(minimise=5), "minimise: 5; allowed: a name"),
                (dict(rates=5), "rates: 5; allowed: a dict"), (dict(bounds=5), "bounds: 5; allowed: a dict"),
                (dict(knots=0), "knots: 0; allowed: a whole number >= 1")):
            with self.subTest(arguments=arguments), self.assertRaisesRegex(ValueError, word):
                optimal.optimise(scene, **{"controls": "wanted", "minimise": "cost", **good, **arguments})
        with self.assertRaisesRegex(RuntimeError, "no programme"):
            optimal.optimise(scene, "wanted", "cost", ["w_load(2) = 900"], knots=4)


if __name__ == "__main__":
    rosunit.unitrun("variator_sim", "optimal_motion_test", OptimalMotionTest)
