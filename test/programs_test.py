#!/usr/bin/python3
"""Every program: what it says when its help cannot be written, or when what it needs is missing."""

import os
import pathlib
import subprocess
import tempfile

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
# Programs that read a recording or connect to a node at once.
NEEDING_THE_PACKAGE = ("drivetrain_markers", "duty_cycle", "panel", "plot_bag", "ratio_controller",
                       "speed_controller", "sweep", "torque_profile")


def run(*words, **more):
    return subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                          timeout=60, check=False, **more)


class ProgramsTest(TestCase):

    def test_output_that_cannot_be_written_is_an_error(self):
        programs = [roslib.packages.find_node(PACKAGE, name)[0] for name in ("simulate", "variator_sim_node")]
        programs += [FOLDER / "scripts" / name for name in ("plot", "sweep")]
        for program in programs:
            with self.subTest(program=program), open("/dev/full", "w", encoding="utf-8") as full:
                done = run(program, "--help", stdout=full)
                self.assertNotEqual(done.returncode, 0)
                self.assertIn("No space left on device", done.stderr)

    def test_what_cannot_be_printed_is_told(self):
        """By the name of the output, with the exit status of simulate."""
        ship, run_of_it = FOLDER / "config/ship.yaml", FOLDER / "examples/optimise/recording.csv"
        with tempfile.TemporaryDirectory() as folder:
            for words in (["scene_urdf", ship],
                          ["sweep", ship, "--duration", "0.1", "--metric", "final(load/velocity)"],
                          ["plot", run_of_it, run_of_it, "--columns", "*", "--compare", "--output", folder + "/x.png"]):
                with self.subTest(words=words), open("/dev/full", "w", encoding="utf-8") as full:
                    done = run(FOLDER / "scripts" / words[0], *words[1:], stdout=full)
                    self.assertEqual((done.returncode, done.stderr.count("\n")), (3, 1), done.stderr)
                    self.assertRegex(done.stderr, f"^{words[0]}: .*standard output")

    def test_what_is_missing_is_told(self):
        """In one line, by name."""
        for name in NEEDING_THE_PACKAGE:
            with self.subTest(program=name):
                done = run(FOLDER / "scripts" / name, "--help", env={"PATH": os.environ["PATH"]},
                           stdout=subprocess.DEVNULL)
                self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
                self.assertIn(f"{name}: No module named 'variator_sim'; build the package and run '. devel/setup.bash'",
                              done.stderr)
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "visualization_msgs.py").write_text(
                "raise ModuleNotFoundError(\"No module named 'visualization_msgs'\")", encoding="utf-8")
            path = folder + os.pathsep + os.environ["PYTHONPATH"]
            done = run(FOLDER / "scripts/drivetrain_markers", "--help", env={**os.environ, "PYTHONPATH": path},
                       stdout=subprocess.DEVNULL)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
        self.assertIn("'visualization_msgs'", done.stderr)
        self.assertIn("apt install python3-visualization-msgs", done.stderr)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "programs_test", ProgramsTest)
