#!/usr/bin/python3
"""examples/optimise finds what its recording was made with."""

import importlib.util
import os
import pathlib
import tempfile
import unittest
import warnings

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402

import variator_sim  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE)) / "examples/optimise"


class OptimiseTest(unittest.TestCase):

    def test_the_fit_finds_what_was_recorded(self):
        specification = importlib.util.spec_from_file_location("fit", FOLDER / "fit.py")
        example = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(example)
        recording = variator_sim.read_run(FOLDER / "recording.csv")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            values, deviations = example.fit(recording)
        errors = values - example.TRUTH
        self.assertLess(numpy.abs(errors / deviations).max(), 4.0)
        self.assertLess(numpy.abs(deviations / example.TRUTH).max(), 0.005)
        # The remainder is the noise.
        run = example.run(values, recording["time"])
        left = numpy.concatenate([run[name] - recording[name] for name in example.COLUMNS])
        self.assertLess(abs(numpy.sqrt(numpy.mean(left ** 2)) / example.NOISE - 1.0), 0.15)
        with tempfile.TemporaryDirectory() as folder:
            again = pathlib.Path(folder) / "recording.csv"
            example.record(again)
            made = variator_sim.read_run(again)
        # To the last digit of the file and its rounding.
        numpy.testing.assert_allclose(made.values, recording.values, atol=2e-4)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "optimise_test", OptimiseTest)
