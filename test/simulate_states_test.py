#!/usr/bin/python3
"""Runs of `simulate` that save states, go on from them, and end at rest."""

import os
import pathlib
import resource
import stat
import threading

import roslib.packages
import rosunit
import yaml

from support.scenes import scene_text
from support.simulate import SimulateTestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
STEPS = str(FOLDER / "test/cases/torque_steps/scene.yaml")

COMMANDS = """time,topic,value
0.25,drive_torque,4
1,drive_torque,9
1,load_torque,2
1.5,drive_torque,3
"""

# Velocities fall with a time constant of 1/5 s once the torque is constant.
RESTING = scene_text("drive 1.0", [
    "motor on drive from torque, TIMEOUT",
    "drag on drive: -5*w1 + NOISE"], "initial: {velocity: [3.0]}")


def resting(noise="0", timeout="hold: zero_order"):
    return RESTING.replace("NOISE", noise).replace("TIMEOUT", timeout)


class SimulateStatesTest(SimulateTestCase):

    def lines(self, *arguments):
        return self.check_simulate(*arguments).stdout.splitlines()

    def test_an_input_that_contradicts_itself_is_refused(self):
        holds = {"rate_limit, rate: 3": {"until": 1.5, "target": 0.0, "value": 4.0},
                 "first_order_hold, period: 2": {"until": 1.9, "since": -0.4},
                 "first_order_lag, time_constant: 0.5": {"until": 3.0},
                 "second_order_lag, time_constant: 0.5": {"until": 90.0}}
        commands = self.write("commands.csv", "time,topic,value\n0.5,torque,5\n")
        for hold, changes in holds.items():
            scene = self.write("scene.yaml", resting(timeout="hold: " + hold))
            state = self.folder / "state.yaml"
            self.lines(scene, "--commands", commands, "--duration", "1", "--save-state", str(state))
            whole = ["--from-state", str(state), "--duration", "0.3", "--rate", "10"]
            self.lines(scene, *whole)
            for key, value in changes.items():
                with self.subTest(hold=hold, key=key):
                    wrong = yaml.safe_load(state.read_text())
                    wrong["inputs"]["torque"][key] = value
                    bad = self.write("bad.yaml", yaml.safe_dump(wrong))
                    self.check_refused([scene, "--from-state", bad, *whole[2:]],
                                       "inputs/torque/until", "contradicts", "ends at ")

    # --- states -----------------------------------------------------------------------------------

    def test_a_run_goes_on_to_the_bit(self):
        commands = self.write("commands.csv", COMMANDS)
        state = str(self.folder / "state.yaml")
        for save_at in ("0", "0.5", "1", "1.237"):
            whole = self.lines(STEPS, "--commands", commands, "--duration", "3", "--columns",
                               "state,energy,inputs", "--save-state", state, "--save-at", save_at)
            rest = self.lines(STEPS, "--commands", commands, "--duration", str(3 - float(save_at)),
                              "--columns", "state,energy,inputs", "--from-state", state)
            with self.subTest(save_at=save_at):
                later = [line for line in whole[1:] if float(line.split(",")[0]) >= float(save_at)]
                self.assertGreater(len(later), 100)
                # That at 1.237 s is in none of the whole run's samples.
                self.assertEqual(rest[-len(later):], later)
                self.assertLessEqual(len(rest), len(later) + 2)

    def test_a_jump_in_time_acts_once(self):
        """The step over it ends 1e-14 s behind it, and stands for instants a rounding before it, too."""
        scene = self.write("scene.yaml", """
shafts: [a, b]
a: {inertia: 1}
b: {inertia: 1}
torques: [q]
q: {type: variator_sim/ExpressionTorque, shaft: a, torque: "if(t < 1, 0, 1)"}
constraints: [gear]
gear: {type: variator_sim/KinematicRatio, shafts: [a, b], ratio: "1 + 0.1*sin(t)"}
""")
        state = str(self.folder / "state.yaml")
        for save_at in ("0.5", "0.9999999999999998", "0.9999999999999999", "0.99999999999999"):
            end = self.lines(scene, "--times", "2", "--save-state", state, "--save-at", save_at)[-1]
            self.assertAlmostEqual(float(end.split(",")[2]), 0.4581483603, delta=1e-8)

    def test_the_state_of_the_end_is_saved(self):
        state = str(self.folder / "state.yaml")
        last = self.lines(STEPS, "--duration", "0.7", "--save-state", state)[-1]
        self.assertEqual(self.lines(STEPS, "--times", "0.7", "--from-state", state)[-1], last)
        text = pathlib.Path(state).read_text(encoding="utf-8")
        for word in ("variator_sim_state: 1", "drive:", "load:", "velocity:", "time: 0.7"):
            self.assertIn(word, text)

    def test_a_state_may_be_written_by_hand(self):
        scene = self.write("scene.yaml", resting())
        state = self.write("state.yaml", "time: 2\nshafts: {drive: {velocity: 7.5}}\n"
                                         "inputs: {torque: {value: 10}}\n")
        row = self.lines(scene, "--times", "2", "--from-state", state)[-1].split(",")
        self.assertEqual([float(word) for word in row[:4]], [2.0, 0.0, 7.5, -27.5])

    def test_states_that_contradict_the_constraints_are_refused_or_projected(self):
        state = self.write("state.yaml", "shafts: {drive: {velocity: 12, acceleration: 3}}\n")
        self.check_refused([STEPS, "--duration", "1", "--from-state", state], state,
                           "accelerations", "residual of 'variator' = ", "consistent accelerations near them are")
        row = self.lines(STEPS, "--times", "0", "--from-state", state, "--set",
                         "initial/project=true")[-1].split(",")
        self.assertEqual(float(row[2]), 12.0)

    def test_faults_of_states_name_their_key(self):
        good = str(self.folder / "good.yaml")
        self.lines(STEPS, "--duration", "0.1", "--save-state", good)
        text = pathlib.Path(good).read_text(encoding="utf-8")
        for change, *words in (
                (("  drive:\n    acc", "  drvie:\n    acc"), "shafts/drvie: unknown key", "'drive'"),
                (("state: 1", "state: 2"), "variator_sim_state: 2 is out of range; allowed: the integer 1\n"),
                (("time: ", "velocity: [1, 2]\ntime: "),
                 "velocity: stands below 'shafts' and the shaft in a state: shafts: {drive: {velocity: 1.5}}\n"),
                (("time: ", "load: {angle: 1}\ntime: "),
                 "load: stands below 'shafts' and the shaft in a state: shafts: {load: {velocity: 1.5}}\n"),
                (("time: 0.1", "time: -0.1"), "time: "),
                (("velocity: ", "velocity: x"), "shafts/drive/velocity: expected a finite number"),
                (("  load_torque:", "  laod_torque:"), "inputs/laod_torque", "'load_torque'"),
                (("kinetic_at_start", "kinetic_at_strat"), "history/energy/kinetic_at_start"),
                (("time: ", "tmie: "), "tmie: unknown key", "'time'")):
            with self.subTest(change=change):
                self.assertIn(change[0], text)
                bad = self.write("bad.yaml", text.replace(*change))
                self.check_refused([STEPS, "--duration", "1", "--from-state", bad], bad, *words)
        self.check_refused([STEPS, "--duration", "1", "--from-state", "none.yaml"], "none.yaml")
        self.check_refused([STEPS, "--duration", "1", "--save-at", "0.5"], "--save-state")
        self.check_refused([STEPS, "--duration", "1", "--save-state", good, "--save-at", "1.5"],
                           "--save-at: 1.5 s is outside of the run, from 0 to 1 s")
        self.check_refused([STEPS, "--times", "0.05", "--from-state", good], "--times: 0.05 s")
        scene = self.write("scene.yaml", resting())
        other_name = f"{self.folder}/./scene.yaml"
        self.check_refused([scene, "--duration", "1", "--save-state", other_name], "is the scene")
        self.assertEqual(pathlib.Path(scene).read_text(encoding="utf-8"), resting())

    def test_a_state_that_cannot_be_written(self):
        result = self.simulate(STEPS, "--duration", "0.1", "--save-state", "/dev/full")
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("/dev/full", result.stderr)
        self.assertIn("No space left", result.stderr)

    def test_what_is_saved_takes_the_place_of_the_old_file_at_once(self):
        def limit_files():
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
        wheel = self.write("wheel.yaml", resting())
        for name, words in (("keep.yaml", (STEPS, "--duration", "0.1", "--save-state")),
                            ("steady.yaml", (wheel, "--trim", "--fix", "torque=1", "--output")),
                            ("model.csv", (wheel, "--linearize", "--at", "0", "--output"))):
            kept = self.write(name, "old")
            os.chmod(kept, 0o640)
            link = self.folder / ("link_" + name)
            link.symlink_to(name)
            with self.subTest(file=name):
                result = self.simulate(*words, kept, preexec_fn=limit_files)
                self.assertEqual(result.returncode, 3, result.stderr)
                self.assertIn(f"{kept}: cannot be written: File too large", result.stderr)
                self.assertEqual(pathlib.Path(kept).read_text(encoding="utf-8"), "old")
                result = self.simulate(*words, str(link))
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertTrue(link.is_symlink())
                self.assertGreater(os.stat(kept).st_size, 100)
                self.assertEqual(stat.S_IMODE(os.stat(kept).st_mode), 0o640)
        self.assertEqual([path.name for path in self.folder.iterdir() if path.suffix == ".part"], [])
        # A link that leads to nothing yet, and a FIFO.
        link = self.folder / "new.yaml"
        link.symlink_to("target.yaml")
        fifo = self.folder / "fifo.yaml"
        os.mkfifo(fifo)
        read = []
        reader = threading.Thread(daemon=True, target=lambda: read.append(fifo.read_bytes()))
        reader.start()
        for path in (link, fifo):
            self.simulate(STEPS, "--duration", "0.1", "--save-state", str(path))
        reader.join(60)
        self.assertTrue(link.is_symlink())
        self.assertEqual(read, [(self.folder / "target.yaml").read_bytes()])

    # --- rest -------------------------------------------------------------------------------------

    def test_a_run_ends_at_rest(self):
        for text in (resting(), resting() + "solver: {sleep: false}\n", resting("1e-9*sin(t)")):
            scene = self.write("scene.yaml", text)
            result = self.simulate(scene, "--duration", "1000", "--rate", "10", "--until-rest")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("at rest since", result.stderr)
            end = [float(word) for word in result.stdout.splitlines()[-1].split(",")]
            # 5 * 3 exp(-5 t) <= 1e-6 from 3.3 s on.
            since = float(result.stderr.partition("at rest since ")[2].split()[0])
            self.assertAlmostEqual(since, 3.3, delta=0.06)
            self.assertGreaterEqual(end[0], since)
            self.assertLessEqual(end[0], since + 10.0)

    def test_rest_waits_for_commands_and_timeouts(self):
        commands = self.write("commands.csv", "time,topic,value\n20,torque,10\n")
        timeout = "timeout: 30, on_timeout: zero"
        for text, since in ((resting(), 23.0), (resting(timeout=timeout), 53.0)):
            scene = self.write("scene.yaml", text)
            result = self.simulate(scene, "--duration", "1000", "--commands", commands,
                                   "--until-rest")
            self.assertEqual(result.returncode, 0, result.stderr)
            found = float(result.stderr.partition("at rest since ")[2].split()[0])
            self.assertAlmostEqual(found, since, delta=0.5)

    def test_a_motion_without_rest_says_so(self):
        scene = self.write("scene.yaml", resting("sin(t)"))
        result = self.simulate(scene, "--duration", "20", "--until-rest")
        self.assertEqual(result.returncode, 4, result.stderr)
        self.assertIn("not at rest by the end of the duration, at 20 s", result.stderr)
        self.assertEqual(float(result.stdout.splitlines()[-1].split(",")[0]), 20.0)
        self.check_refused([scene, "--times", "1", "--until-rest"], "--until-rest", "--duration")


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "simulate_states_test", SimulateStatesTest)
