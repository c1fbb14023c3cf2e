#!/usr/bin/python3
"""Warnings and refusals of the offline tool, and the ways out that they name."""

import pathlib

import roslib.packages
import rosunit

from support.scenes import scene_text
from support.simulate import SimulateTestCase, parse

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
RATIO_STEPS = FOLDER / "config/ratio_steps.yaml"


class MessagesTest(SimulateTestCase):
    def test_the_first_clamped_command_of_each_input_is_told(self):
        scene = self.write("clamped.yaml", RATIO_STEPS.read_text().replace(
            "topic: drive_torque", "max: 40\n  topic: drive_torque"))
        commands = self.write("commands.csv", "time,topic,value\n0.1,drive_torque,50\n0.2,load_torque,99\n"
                                              "0.3,drive_torque,60\n0.4,drive_torque,40\n")
        result = self.check_simulate(scene, "--duration", "1", "--commands", commands, "--stats")
        self.assertEqual(result.stderr.count("warning: the command"), 1, result.stderr)
        self.assertIn("the command 50 on 'drive_torque' is above the input's maximum, 40: 40 acts", result.stderr)
        self.assertIn("commands clamped: 2\n", result.stderr)
        below = self.write("below.yaml", pathlib.Path(scene).read_text().replace("max: 40", "min: 0"))
        self.write("commands.csv", "time,topic,value\n0.1,drive_torque,-1\n")
        result = self.simulate(below, "--duration", "1", "--commands", commands)
        self.assertIn("the command -1 on 'drive_torque' is below the input's minimum, 0: 0 acts", result.stderr)

    def test_a_ratio_that_follows_a_speed_is_told_when_it_is_loaded(self):
        def cvt(law):
            return self.write("cvt.yaml", scene_text("drive 0.2, load 2", [
                "motor on drive: 50",
                "fan on load: -0.05*w_load*abs(w_load)",
                f'cvt = {law}, shafts: [drive, load], ratio: "0.3 + 0.002*w_drive"'],
                "principle: gauss", "initial: {velocity: [50, 20]}"))

        scene = cvt("KinematicRatio, reaction: gradient")
        for arguments in (["--times", "10", "--energy"], ["--explain"]):
            result = self.check_simulate(scene, *arguments)
            self.assertEqual(result.stderr.count("warning"), 1, result.stderr)
            self.assertIn("the reactions of the constraint 'cvt' take or give energy", result.stderr)
        # Lossless, as it is without a word: torques in the ratio i (DOP853 at 1e-11).
        result = self.simulate(cvt("KinematicRatio"), "--times", "1,10")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        header, rows = parse(result.stdout)
        for row, drive in zip(rows, (86.0165197, 93.2127741)):
            self.assertAlmostEqual(row[header.index("drive/velocity")], drive, delta=1e-6)
        # The way out that it names: the motion of a transmission whose torques are in the ratio i (DOP853 at 1e-11).
        result = self.simulate(cvt("SlipRatio, time_constant: 0.001"), "--times", "1,10", "--energy")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        header, rows = parse(result.stdout)
        for row, drive, load in zip(rows, (86.0165197, 93.2127741), (40.6026392, 45.3410748)):
            self.assertAlmostEqual(row[header.index("drive/velocity")], drive, delta=5e-3)
            self.assertAlmostEqual(row[header.index("load/velocity")], load, delta=5e-3)
            self.assertLess(abs(row[header.index("energy/reactions")]), 1.0)

    def test_an_integral_is_the_velocity_of_a_shaft_more(self):
        scene = self.write("fuel.yaml", scene_text("wheels 2, fuel 1", [
            "motor on wheels: 3",
            "burnt on fuel: w_wheels^2"]))
        header, rows = parse(self.simulate(scene, "--times", "2").stdout)
        self.assertAlmostEqual(rows[0][header.index("fuel/velocity")], 1.5 ** 2 * 8 / 3, delta=1e-8)

    def test_torques_as_explained_are_no_names_of_formulas(self):
        scene = self.write("output.yaml", RATIO_STEPS.read_text()
                           + "outputs: [torque]\ntorque: {expression: \"Q_engine\"}\n")
        self.check_refused([scene, "--duration", "1"], "torque/expression: unknown name 'Q_engine'", "--explain",
                           "--columns elements")


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "messages_test", MessagesTest)
