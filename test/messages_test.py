#!/usr/bin/python3
"""Warnings and refusals of the offline tool, and the ways out that they name."""

import os
import pathlib
import subprocess
import tempfile

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]
RATIO_STEPS = FOLDER / "config/ratio_steps.yaml"


def parse(text):
    lines = [line.split(",") for line in text.splitlines()]
    return lines[0], [[float(value) for value in line] for line in lines[1:]]


class MessagesTest(TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def simulate(self, *arguments):
        return subprocess.run([SIMULATE, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False,
                              env=dict(os.environ, ROS_MASTER_URI="http://localhost:1"))

    def test_the_first_clamped_command_of_each_input_is_told(self):
        scene = self.write("clamped.yaml", RATIO_STEPS.read_text().replace(
            "topic: drive_torque", "max: 40\n  topic: drive_torque"))
        commands = self.write("commands.csv", "time,topic,value\n0.1,drive_torque,50\n0.2,load_torque,99\n"
                                              "0.3,drive_torque,60\n0.4,drive_torque,40\n")
        result = self.simulate(scene, "--duration", "1", "--commands", commands, "--stats")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr.count("warning: the command"), 1, result.stderr)
        self.assertIn("the command 50 on 'drive_torque' is above the input's maximum, 40: 40 acts", result.stderr)
        self.assertIn("commands clamped: 2\n", result.stderr)
        below = self.write("below.yaml", scene.read_text().replace("max: 40", "min: 0"))
        self.write("commands.csv", "time,topic,value\n0.1,drive_torque,-1\n")
        result = self.simulate(below, "--duration", "1", "--commands", commands)
        self.assertIn("the command -1 on 'drive_torque' is below the input's minimum, 0: 0 acts", result.stderr)

    def test_a_ratio_that_follows_a_speed_is_told_when_it_is_loaded(self):
        cvt = """
shafts: [drive, load]
drive: {inertia: 0.2}
load: {inertia: 2}
torques: [motor, fan]
motor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: 50}
fan: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.05*w_load*abs(w_load)"}
constraints: [cvt]
cvt: {type: variator_sim/%s, shafts: [drive, load], ratio: "0.3 + 0.002*w_drive"}
principle: gauss
initial: {velocity: [50, 20]}
"""
        scene = self.write("cvt.yaml", cvt % "KinematicRatio, reaction: gradient")
        for arguments in (["--times", "10", "--energy"], ["--explain"]):
            result = self.simulate(scene, *arguments)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual(result.stderr.count("warning"), 1, result.stderr)
            self.assertIn("the reactions of the constraint 'cvt' take or give energy", result.stderr)
        # Lossless, as it is without a word: torques in the ratio i (DOP853 at 1e-11).
        result = self.simulate(self.write("lossless.yaml", cvt % "KinematicRatio"), "--times", "1,10")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        header, rows = parse(result.stdout)
        for row, drive in zip(rows, (86.0165197, 93.2127741)):
            self.assertAlmostEqual(row[header.index("drive/velocity")], drive, delta=1e-6)
        # The way out that it names: the motion of a transmission whose torques are in the ratio i (DOP853 at 1e-11).
        scene = self.write("slip.yaml", cvt % "SlipRatio, time_constant: 0.001")
        result = self.simulate(scene, "--times", "1,10", "--energy")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        header, rows = parse(result.stdout)
        for row, drive, load in zip(rows, (86.0165197, 93.2127741), (40.6026392, 45.3410748)):
            self.assertAlmostEqual(row[header.index("drive/velocity")], drive, delta=5e-3)
            self.assertAlmostEqual(row[header.index("load/velocity")], load, delta=5e-3)
            self.assertLess(abs(row[header.index("energy/reactions")]), 1.0)

    def test_an_integral_is_the_velocity_of_a_shaft_more(self):
        scene = self.write("fuel.yaml", """
shafts: [wheels, fuel]
wheels: {inertia: 2}
fuel: {inertia: 1}
torques: [motor, burnt]
motor: {type: variator_sim/ExpressionTorque, shaft: wheels, torque: "3"}
burnt: {type: variator_sim/ExpressionTorque, shaft: fuel, torque: "w_wheels^2"}
""")
        header, rows = parse(self.simulate(scene, "--times", "2").stdout)
        self.assertAlmostEqual(rows[0][header.index("fuel/velocity")], 1.5 ** 2 * 8 / 3, delta=1e-8)

    def test_torques_as_explained_are_no_names_of_formulas(self):
        scene = self.write("output.yaml", RATIO_STEPS.read_text()
                           + "outputs: [torque]\ntorque: {expression: \"Q_engine\"}\n")
        result = self.simulate(scene, "--duration", "1")
        self.assertEqual(result.returncode, 2, result.stderr)
        for words in ("torque/expression: unknown name 'Q_engine'", "--explain", "--columns elements"):
            self.assertIn(words, result.stderr)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "messages_test", MessagesTest)
