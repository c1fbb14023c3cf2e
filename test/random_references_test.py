#!/usr/bin/python3
"""Scenes made at random, with every law, hold and order, against an independent reference.

The references in test/stress/independent/references.json were computed with SciPy from the documents
alone (test/stress/independent/motion.py); this test needs no SciPy. They are renewed by

    test/stress/independent/compare.py - --write test/stress/independent/references.json

and many more scenes are compared by `compare.py SIMULATE --seeds 1:1000`.
"""

import json
import pathlib
import subprocess
import tempfile

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
REFERENCES = FOLDER / "test/stress/independent/references.json"
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]

ALLOWED = 100.0  # tolerances, of 1e-9 absolute and 1e-9 of the largest magnitude of the column so far


def simulate(reference, *options):
    """Columns by name; raises where the motion does not reach the end."""
    with tempfile.TemporaryDirectory() as folder:
        scene, commands = pathlib.Path(folder) / "scene.yaml", pathlib.Path(folder) / "commands.csv"
        scene.write_text(reference["scene"])
        call = [SIMULATE, str(scene), "--times", ",".join(map(repr, reference["times"])), *options]
        if reference["commands"]:
            commands.write_text(reference["commands"])
            call += ["--commands", str(commands)]
        done = subprocess.run(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              timeout=60, check=False)
    if done.returncode != 0:
        raise AssertionError(f"exit status {done.returncode}: {done.stderr.strip()}")
    lines = [line.split(",") for line in done.stdout.splitlines()]
    return {name: [float(line[i]) for line in lines[1:]] for i, name in enumerate(lines[0])}


def worst_error(expected, got):
    """The largest error of a column in tolerances."""
    worst = largest = 0.0
    for a, b in zip(expected, got):
        largest = max(largest, abs(a))
        error = abs(a - b) / (1e-9 + 1e-9 * largest)
        worst = max(worst, error if error == error else float("inf"))
    return worst


def count_estimates(reference, tolerance):
    """How many estimated errors there are, and how many are within a factor of ten of the true one.

    A value that the references do not resolve counts as right if its estimate is as small.
    """
    got = simulate(reference, "--error", "--set", f"solver/relative_tolerance={tolerance}",
                   "--set", f"solver/absolute_tolerance={tolerance}")
    good = total = 0
    for name, estimates in got.items():
        if not name.endswith("/estimated_error"):
            continue
        column = name[:-len("/estimated_error")]
        largest = 0.0
        for value, exact, estimate in zip(got[column], reference["columns"][column], estimates):
            largest = max(largest, abs(exact))
            error, unknown = abs(value - exact), 1e-11 * (1.0 + largest)
            total += 1
            good += (max(error, estimate) <= unknown
                     or 0.1 * estimate <= error <= 10.0 * estimate)
    return good, total


class RandomReferences(TestCase):
    def test_estimated_errors_are_within_a_factor_of_ten(self):
        counts = [count_estimates(reference, "1e-6")
                  for reference in json.loads(REFERENCES.read_text())]
        good, total = map(sum, zip(*counts))
        self.assertGreater(total, 1000)
        self.assertGreaterEqual(good, 0.95 * total)

    def test_every_column_is_that_of_the_reference(self):
        references = json.loads(REFERENCES.read_text())
        self.assertGreaterEqual(len(references), 30)
        for reference in references:
            with self.subTest(seed=reference["seed"]):
                try:
                    got = simulate(reference)
                except AssertionError as error:
                    self.fail(f"{error}\n{reference['scene']}\n{reference['commands']}")
                self.assertEqual(got["time"], reference["times"])
                errors = {name: worst_error(column, got[name])
                          for name, column in reference["columns"].items()}
                name = max(errors, key=errors.get)
                self.assertLess(errors[name], ALLOWED,
                                f"{name}\n{reference['scene']}\n{reference['commands']}")


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "random_references_test", RandomReferences)
