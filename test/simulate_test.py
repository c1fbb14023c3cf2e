#!/usr/bin/python3
"""The offline tool as its users see it: files, streams, exit statuses."""

import math
import os
import pathlib
import pty
import resource
import signal
import subprocess
import time

import rosbag
import roslib.packages
import rosunit

from support import faulty_package
from support.scenes import scene_text
from support.simulate import SIMULATE, SimulateTestCase, fake_compiler, parse

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SHIP = str(FOLDER / "config/ship.yaml")
RATIO_STEPS = str(FOLDER / "config/ratio_steps.yaml")

QUANTITIES = ["angle", "velocity", "acceleration", "applied_torque", "reaction_torque",
              "reaction_torque_rate"]
SHIP_HEADER = (["time"] + [f"{shaft}/{quantity}" for shaft in ("drive", "load")
                           for quantity in QUANTITIES]
               + ["variator/residual", "variator/multiplier"])

ENERGY = ["energy/kinetic", "energy/applied", "energy/reactions", "power/applied",
          "power/reactions"]

OBSERVED = str(FOLDER / "test/scenes/observed.yaml")
ELEMENTS = ["engine/drive/torque", "engine/power", "spring/drive/torque", "spring/load/torque",
            "spring/power", "spring/twist", "spring/transmitted_torque", "bearing/load/torque",
            "bearing/power", "bearing/slip", "bearing/transmitted_torque", "drag/load/torque",
            "drag/power", "belt/slip", "belt/ratio"]
INPUTS = ["inputs/engine/torque", "inputs/ratio"]
OUTPUTS = ["outputs/jolt", "outputs/no_value", "outputs/speed_ratio"]

CAR = FOLDER / "test/scenes/car.yaml"
CAR_COMMANDS = str(FOLDER / "test/scenes/car.csv")

# The torque has no value after 1 s.
STOPPING_SCENE = scene_text("drive 1.0", ["motor on drive: sqrt(1 - t)"])

# It stands on its head, nearly, and leaves by what the steps do wrong.
PENDULUM = scene_text("arm 1.0", ["gravity on arm: 25*sin(phi_arm)"], "initial: {angle: [1.0e-9]}")


class SimulateTest(SimulateTestCase):

    def interrupted(self, words, order, status, ready, scene=SHIP, within=5.0):
        """What a run tells that gets a signal when it is ready, or after as many s, and ends with the status."""
        with subprocess.Popen([SIMULATE, scene, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                              env=self.environment) as process:
            end = time.monotonic() + 30.0
            if not callable(ready):
                time.sleep(ready)
            while callable(ready) and not ready():
                self.assertLess(time.monotonic(), end)
                time.sleep(0.01)
            begin = time.monotonic()
            process.send_signal(order)
            told = process.communicate(timeout=60)[1]
            self.assertLess(time.monotonic() - begin, within)
            self.assertEqual(process.returncode, status, told)
        return told

    def samples(self, *arguments):
        return parse(self.check_simulate(*arguments).stdout)

    def test_help(self):
        result = self.check_simulate("--help")
        self.assertIn("--duration", result.stdout)
        self.assertEqual(result.stderr, "")

    def test_values_can_be_set(self):
        _, (start,) = self.samples(SHIP, "--times", "0", "--set", "initial/velocity=[5, 3]",
                                   "--set=initial/velocity/0=4", "--set", "drive/inertia=2.5")
        row = dict(zip(SHIP_HEADER, start))
        self.assertEqual((row["drive/velocity"], row["load/velocity"]), (4.0, 3.0))
        # R = J epsilon - Q
        self.assertAlmostEqual(row["drive/reaction_torque"],
                               2.5 * row["drive/acceleration"] - row["drive/applied_torque"])

    def test_a_scene_may_have_overrides_of_its_own(self):
        scene = self.write("own.yaml", STOPPING_SCENE + "overrides: motor/torque=1 drive/inertia=2\n")
        _, (row,) = self.samples(scene, "--times", "0", "--set", "drive/inertia=4")
        self.assertEqual(row[3:5], [0.25, 1.0])

    def test_misspelt_overrides_meet_the_nearest_path(self):
        for override, *words in (
                ("drvie/inertia=1", SHIP + " with --set: drvie: unknown key", "did you mean 'drive'?"),
                ("drive/inertai=1", "drive/inertai: unknown key", "did you mean 'inertia'?"),
                ("sovler/step=1", "sovler: unknown key", "did you mean 'solver'?"),
                ("initial/velocty/0=1", "--set: initial/velocty/0:", "'initial/velocity/0'"),
                ("drive/inertia=x", "drive/inertia: unknown name 'x'"),
                ("drive/inertia=[1", "--set: value of 'drive/inertia':1:"),
                ("drive/inertia", "--set: 'drive/inertia' is not an override", "PATH=VALUE")):
            self.check_refused([SHIP, "--duration", "1", "--set", override], *words)

    def test_equations_need_no_duration(self):
        result = self.check_simulate("config/ship.yaml", "--explain", cwd=FOLDER)
        golden = (FOLDER / "doc/explained_ship.txt").read_text(encoding="utf-8")
        self.assertEqual(result.stdout, golden)

    def test_equations_in_latex(self):
        result = self.check_simulate("--explain", "--latex", SHIP)
        self.assertTrue(result.stdout.startswith("\\documentclass"))
        self.assertTrue(result.stdout.endswith("\\end{document}\n"))
        self.assertIn("\\omega_{\\mathrm{drive}}", result.stdout)
        self.check_refused([SHIP, "--latex"], "--latex", "--explain")

    def test_every_shipped_scene_is_explained(self):
        for scene in sorted((FOLDER / "config").glob("**/*.yaml")):
            with self.subTest(scene=scene.name):
                result = self.check_simulate(str(scene), "--explain")
                self.assertIn("equations of motion", result.stdout)
                for line in result.stdout.splitlines():
                    self.assertLessEqual(len(line), 120)

    def test_header_and_times_at_a_rate(self):
        header, rows = self.samples(SHIP, "--duration", "1", "--rate", "10")
        self.assertEqual(header, SHIP_HEADER)
        self.assertEqual([row[0] for row in rows], [k / 10 for k in range(11)])
        self.assertTrue(all(len(row) == len(header) for row in rows))

    def test_rate_is_100_by_default(self):
        _, rows = self.samples(SHIP, "--duration", "0.07")
        self.assertEqual([row[0] for row in rows], [k / 100 for k in range(8)])

    def test_the_end_is_sampled(self):
        _, rows = self.samples(SHIP, "--duration", "0.25", "--rate=10")
        self.assertEqual([row[0] for row in rows], [0, 0.1, 0.2, 0.25])
        _, rows = self.samples(SHIP, "--duration", "0")
        self.assertEqual([row[0] for row in rows], [0])

    def test_given_times(self):
        _, rows = self.samples(SHIP, "--times", "0,0.125,0.5")
        self.assertEqual([row[0] for row in rows], [0, 0.125, 0.5])
        _, later = self.samples(SHIP, "--times", "0.125,0.5", "--duration", "2")
        self.assertEqual(later, rows[1:])

    def test_bad_usage(self):
        self.check_refused([], "no scene", "--help")
        self.check_refused([SHIP], "--duration is missing")
        self.check_refused([SHIP, "--duration"], "--duration needs a value")
        self.check_refused([SHIP, "--duration", "abc"], "'abc'")
        self.check_refused([SHIP, "--duration", "nan"], "'nan'")
        self.check_refused([SHIP, "--duration", "-1"], "at least 0")
        self.check_refused([SHIP, "--duration", "1", "--rate", "0"], "above 0")
        self.check_refused([SHIP, "--duration", "1", "--times", "0,2"], "after the --duration")
        self.check_refused([SHIP, "--times", "1,0.5"], "ascending")
        self.check_refused([SHIP, "--times", "0,,1"], "--times")
        self.check_refused([SHIP, "--times", "-1,0"], "below 0")
        self.check_refused([SHIP, "--times", "1", "--rate", "5"], "exclude each other")
        self.check_refused([SHIP, "--duratoin", "1"], "did you mean '--duration'")
        self.check_refused([SHIP, SHIP, "--duration", "1"], "one word too many")
        self.check_refused([SHIP, "--duration", "1", "--output", "a.txt"], ".csv", ".bag")
        self.check_refused([SHIP, "--duration", "1", "--stats=1"], "takes no value")
        self.check_refused([SHIP, "--duration", "1", "--energy=1"], "takes no value")
        self.check_refused([SHIP, "--duration", "1", "--error=1"], "takes no value")
        self.check_refused([SHIP, "--duration", "1", "--error", "--columns", "energy"],
                           "--error", "'state'")
        self.check_refused([SHIP, "--duration", "1", "--columns"], "needs a value")
        self.check_refused([SHIP, "--duration", "1", "--columns", "state,enrgy"], "'enrgy'",
                           "did you mean 'energy'",
                           "allowed: state, elements, inputs, outputs, states, variables, "
                           "principle, energy")
        self.check_refused([SHIP, "--duration", "1", "--columns", "element"],
                           "did you mean 'elements'")
        self.check_refused([SHIP, "--duration", "1", "--columns", "state,"], "''")
        self.check_refused([SHIP, "--duration", "1", "--columns", "energy,energy"], "twice")

    def test_columns_of_energy_stand_behind_the_others_and_change_none(self):
        plain = self.simulate(SHIP, "--duration", "3", "--rate", "30").stdout.splitlines()
        both = self.simulate(SHIP, "--duration", "3", "--rate", "30", "--energy").stdout.splitlines()
        self.assertEqual([line.rsplit(",", 5)[0] for line in both], plain)
        self.assertEqual(both[0].split(",")[-5:], ENERGY)
        for groups in ("state,energy", "energy,state"):
            result = self.simulate(SHIP, "--duration", "3", "--rate", "30", "--columns", groups)
            self.assertEqual(result.stdout.splitlines(), both)
        header, rows = self.samples(SHIP, "--duration", "3", "--rate", "30", "--columns", "energy")
        self.assertEqual(header, ["time"] + ENERGY)
        self.assertEqual(rows, [row[:1] + row[-5:] for row in parse("\n".join(both))[1]])
        kinetic, applied, reactions = (header.index(name) for name in ENERGY[:3])
        for row in rows:
            self.assertAlmostEqual(row[kinetic] - rows[0][kinetic], row[applied] + row[reactions],
                                   delta=1e-9 * row[kinetic])

    def test_estimated_errors_stand_behind_their_columns_and_change_none(self):
        commands = self.write("commands.csv", "time,topic,value\n0.2,engine/torque,25\n0.4,ratio,0.8\n")
        run = [OBSERVED, "--duration", "1", "--commands", commands, "--columns",
               "state,elements,inputs,outputs,energy"]
        for times in (["--rate", "50"], ["--times", "0.1,0.4,0.4,0.9"]):
            header, plain = self.samples(*run, *times)
            with_errors, rows = self.samples(*run, *times, "--error")
            errors = [i for i, name in enumerate(with_errors) if name.endswith("/estimated_error")]
            self.assertEqual([with_errors[i] for i in errors],
                             [f"{shaft}/{column}/estimated_error" for shaft in ("drive", "load")
                              for column in ("angle", "velocity", "acceleration")])
            for i in errors:
                self.assertEqual(with_errors[i], with_errors[i - 1] + "/estimated_error")
            kept = [i for i in range(len(with_errors)) if i not in errors]
            self.assertEqual([with_errors[i] for i in kept], header)
            self.assertEqual(repr([[row[i] for i in kept] for row in rows]), repr(plain))
            for row in rows:
                for i in errors:
                    self.assertTrue(0.0 <= row[i] <= 1e-7 * (1.0 + abs(row[i - 1])), (row[0], row[i]))
            self.assertGreater(max(rows[-1][i] for i in errors), 0.0)

    def test_estimates_that_are_worthless_are_told(self):
        scene = self.write("pendulum.yaml", PENDULUM)
        result = self.check_simulate(scene, "--duration", "12", "--rate", "10", "--error")
        self.assertEqual(result.stderr.count("estimated errors are not to be trusted from t = "), 1)

    def test_a_bag_has_estimated_errors_when_asked_for(self):
        for option, count in (([], 0), (["--error"], 2)):
            path = os.path.join(self.folder, f"errors{count}.bag")
            self.simulate(SHIP, "--duration", "1", "--rate", "10", "--output", path, *option)
            with rosbag.Bag(path) as bag:
                states = [message for _, message, _ in bag.read_messages("state")]
            for state in states:
                for errors in (state.angle_error, state.velocity_error, state.acceleration_error):
                    self.assertEqual(len(errors), count)
                    self.assertTrue(all(0.0 <= error < 1e-6 for error in errors))

    def test_columns_of_quantities_stand_in_one_order_and_change_no_other(self):
        commands = self.write("commands.csv", "time,topic,value\n0.2,engine/torque,25\n0.4,ratio,0.8\n")
        run = [OBSERVED, "--duration", "1", "--rate", "50", "--commands", commands]
        plain = self.simulate(*run, "--energy").stdout.splitlines()
        everything = self.simulate(*run, "--columns",
                                   "energy,outputs,inputs,elements,state").stdout.splitlines()
        header = everything[0].split(",")
        begin = len(plain[0].split(",")) - len(ENERGY)
        self.assertEqual(header[begin:-len(ENERGY)], ELEMENTS + INPUTS + OUTPUTS)
        for line, expected in zip(everything, plain):
            words = line.split(",")
            self.assertEqual(",".join(words[:begin] + words[-len(ENERGY):]), expected)
        header, rows = self.samples(*run, "--columns", "inputs,elements")
        self.assertEqual(header, ["time"] + ELEMENTS + INPUTS)
        end = begin + len(ELEMENTS + INPUTS)
        self.assertEqual(rows, [row[:1] + row[begin:end] for row in parse("\n".join(everything))[1]])

    def test_elements_add_up_and_inputs_are_those_in_force(self):
        commands = self.write("commands.csv", "time,topic,value\n0.2,engine/torque,25\n0.4,ratio,0.8\n")
        for principle in ("generalized_gauss", "gauss"):
            with self.subTest(principle):
                self.check_elements_and_inputs(*self.samples(
                    OBSERVED, "--duration", "2", "--rate", "50", "--commands", commands, "--set", f"principle={principle}",
                    "--columns", "state,elements,inputs,outputs,energy"))

    def check_elements_and_inputs(self, header, rows):
        for row in rows:
            at = dict(zip(header, row))
            for shaft, elements in (("drive", ["engine", "spring"]),
                                    ("load", ["spring", "bearing", "drag"])):
                self.assertAlmostEqual(sum(at[f"{element}/{shaft}/torque"] for element in elements),
                                       at[f"{shaft}/applied_torque"], delta=5e-12)
            powers = [at[f"{element}/power"] for element in ("engine", "spring", "bearing", "drag")]
            self.assertAlmostEqual(sum(powers), at["power/applied"], delta=1e-10)
            self.assertEqual(at["engine/power"], at["engine/drive/torque"] * at["drive/velocity"])
            self.assertLess(at["bearing/power"], 0.0)
            time = at["time"]
            lagged = 4 if time < 0.2 else 10 - 6 * math.exp(-(time - 0.2) / 0.2)
            self.assertAlmostEqual(at["inputs/engine/torque"], lagged, delta=1e-12)
            ratio = min(0.8, 0.5 + 0.5 * max(0, time - 0.4))
            self.assertAlmostEqual(at["inputs/ratio"], ratio, delta=1e-14)
            self.assertAlmostEqual(at["belt/slip"],
                                   at["load/velocity"] - ratio * at["drive/velocity"], delta=1e-12)
            self.assertAlmostEqual(at["outputs/jolt"], at["drive/acceleration"]
                                   - 3 * at["load/acceleration"] + time, delta=1e-12)
            self.assertAlmostEqual(at["outputs/speed_ratio"],
                                   2 * at["load/velocity"] / at["drive/velocity"], delta=1e-14)
            self.assertTrue(math.isnan(at["outputs/no_value"]))

    def test_a_value_that_does_not_exist_is_nan_and_stops_nothing(self):
        result = self.check_simulate(OBSERVED, "--times", "0,0.5", "--columns", "outputs")
        self.assertEqual([line.split(",")[2] for line in result.stdout.splitlines()],
                         ["outputs/no_value", "nan", "nan"])

    def test_a_scene_without_a_group_has_no_columns_of_it(self):
        header, _ = self.samples(str(FOLDER / "test/cases/crank_elastic/scene.yaml"),
                                 "--duration", "0.1", "--columns", "inputs,outputs")
        self.assertEqual(header, ["time"])

    def test_a_bag_of_quantities(self):
        path = str(self.folder / "out.bag")
        arguments = [OBSERVED, "--duration", "0.5", "--rate", "10", "--columns",
                     "outputs,elements,inputs"]
        self.check_simulate(*arguments, "--output", path)
        text = self.simulate(*arguments).stdout
        columns = {"elements": ELEMENTS, "inputs": INPUTS, "outputs": OUTPUTS}
        with rosbag.Bag(path) as bag:
            topics = bag.get_type_and_topic_info().topics
            self.assertEqual(set(topics), {"elements", "inputs", "outputs", "scene"})
            for topic, names in columns.items():
                header, rows = parse(text)
                index = [header.index(name) for name in names]
                messages = [message for _, message, _ in bag.read_messages(topic)]
                self.assertEqual(len(messages), len(rows))
                for message, row in zip(messages, rows):
                    prefix = "" if topic == "elements" else topic + "/"
                    self.assertEqual([prefix + name for name in message.name], names)
                    self.assertEqual(message.time, row[0])
                    self.assertEqual(message.header.stamp.to_sec(), row[0])
                    # NaN has no equal.
                    self.assertEqual(repr(list(message.value)), repr([row[i] for i in index]))

    def test_a_bag_of_energies(self):
        path = str(self.folder / "out.bag")
        arguments = [SHIP, "--duration", "0.5", "--rate", "10", "--columns", "energy"]
        self.check_simulate(*arguments, "--output", path)
        _, rows = self.samples(*arguments)
        with rosbag.Bag(path) as bag:
            self.assertEqual(set(bag.get_type_and_topic_info().topics), {"scene", "energy"})
            energies = [message for _, message, _ in bag.read_messages("energy")]
        self.assertEqual([[m.time, m.kinetic, m.applied, m.reactions, m.applied_power,
                           m.reaction_power] for m in energies], rows)

    def test_reactions_that_drive_a_car_are_told_once(self):
        commands, scene = CAR_COMMANDS, str(CAR)
        arguments = ["--duration", "13", "--rate", "10", "--commands", commands, "--columns",
                     "energy"]
        result = self.check_simulate(scene, *arguments, "--stats")
        self.assertEqual(result.stderr.count("warning"), 1, result.stderr)
        for word in ("generalized_gauss", "fed in", "%", "doc/theory.md", "principle: gauss"):
            self.assertIn(word, result.stderr)
        last = parse(result.stdout)[1][-1]
        self.assertGreater(last[3], 0.05 * last[2])
        stats = dict(line.split(": ", 1) for line in result.stderr.splitlines()
                     if not line.startswith("simulate:"))
        account = [float(stats[name].split()[0]) for name in
                   ("kinetic energy change", "energy of the applied torques",
                    "energy of the reactions")]
        for value, expected in zip(account, (last[2] + last[3], last[2], last[3])):
            self.assertAlmostEqual(value, expected, delta=1e-5 * abs(expected))

        classical = self.write("classical.yaml", CAR.read_text() + "principle: gauss\n")
        result = self.check_simulate(classical, *arguments)
        self.assertEqual(result.stderr, "")
        last = parse(result.stdout)[1][-1]
        self.assertLess(abs(last[3]), 0.01 * last[2])

    def test_bad_scene(self):
        self.check_refused(["/nowhere.yaml", "--duration", "1"], "/nowhere.yaml")
        scene = self.write("scene.yaml", STOPPING_SCENE.replace("inertia: 1.0", "inertia: -1"))
        self.check_refused([scene, "--duration", "1"], "scene.yaml: drive/inertia", "-1")
        scene = self.write("scene.yaml", STOPPING_SCENE.replace("inertia: 1.0", "inertai: 1"))
        self.check_refused([scene, "--duration", "1"], "'inertai'", "'inertia'")

    def test_a_zero_order_command_jumps_at_its_sample(self):
        commands = self.write("commands.csv", "time,topic,value\n0,drive_torque,4\n"
                                              "0.5,drive_torque,9\n0.5,load_torque,5\n")
        header, rows = self.samples(RATIO_STEPS, "--times", "0,0.499,0.5", "--commands", commands)
        column = header.index("drive/applied_torque")
        self.assertEqual([row[column] for row in rows], [4, 4, 9])
        residual = header.index("variator/residual")
        self.assertTrue(all(abs(row[residual]) < 1e-8 for row in rows))

    def test_commands_act_between_samples(self):
        commands = self.write("commands.csv", "time,topic,value\n0.3,drive_torque,9\n")
        header, with_command = self.samples(RATIO_STEPS, "--times", "0,1", "--commands", commands)
        _, without = self.samples(RATIO_STEPS, "--times", "0,1")
        column = header.index("drive/velocity")
        self.assertEqual(with_command[0], without[0])
        self.assertGreater(with_command[1][column], without[1][column] + 1.0)

    def test_unknown_topic(self):
        commands = self.write("commands.csv", "time,topic,value\n0,drive_torqe,4\n")
        self.check_refused([RATIO_STEPS, "--duration", "1", "--commands", commands],
                           "commands.csv:2", "'drive_torqe'", "did you mean 'drive_torque'")
        circle = str(FOLDER / "config/acceleration_circle.yaml")
        self.check_refused([circle, "--duration", "1", "--commands", commands], "no commands")

    def test_bad_command_file(self):
        commands = self.write("commands.csv", "time,topic,value\n0,drive_torque,much\n")
        self.check_refused([RATIO_STEPS, "--duration", "1", "--commands", commands],
                           "commands.csv:2", "much")

    def test_commands_after_the_end_are_ignored_with_a_note(self):
        commands = self.write("commands.csv", "time,topic,value\n0.5,drive_torque,1\n"
                                              "7,drive_torque,4\n8,drive_torque,5\n")
        result = self.check_simulate(RATIO_STEPS, "--duration", "1", "--commands", commands, "--stats")
        self.assertIn("2 commands lie after the end", result.stderr)
        self.assertIn("commands accepted: 1\n", result.stderr)

    def test_commands_that_are_not_finite_are_refused_with_one_warning(self):
        good = self.write("good.csv", "time,topic,value\n0.2,drive_torque,3\n")
        bad = self.write("bad.csv", "time,topic,value\n0.1,drive_torque,nan\n"
                                    "0.2,drive_torque,3\n0.3,drive_torque,-inf\n")
        expected = self.simulate(RATIO_STEPS, "--duration", "1", "--commands", good)
        result = self.check_simulate(RATIO_STEPS, "--duration", "1", "--commands", bad, "--stats")
        self.assertEqual(result.stdout, expected.stdout)
        self.assertEqual(result.stderr.count("warning"), 1)
        self.assertIn("2 commands refused", result.stderr)
        self.assertIn("bad.csv:2, on 'drive_torque'", result.stderr)
        self.assertIn("commands refused: 2\n", result.stderr)

    def test_a_stopped_motion_keeps_its_samples(self):
        scene = self.write("scene.yaml", STOPPING_SCENE)
        output = self.folder / "out.csv"
        result = self.simulate(scene, "--duration", "2", "--rate", "10", "--output", str(output))
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("NonFiniteValue", result.stderr)
        _, rows = parse(output.read_text(encoding="utf-8"))
        self.assertGreaterEqual(len(rows), 9)
        self.assertEqual([row[0] for row in rows], [k / 10 for k in range(len(rows))])

    def test_stats(self):
        result = self.simulate(SHIP, "--duration", "10", "--stats")
        stats = dict(line.split(": ", 1) for line in result.stderr.splitlines()
                     if not line.startswith("simulate:"))
        self.assertEqual(stats["samples"], "1001")
        self.assertEqual(stats["simulated time"], "10 s")
        self.assertGreater(int(stats["steps"]), 10)
        self.assertGreaterEqual(int(stats["right-hand sides"]), int(stats["steps"]))
        self.assertEqual(stats["commands refused"], "0")
        self.assertGreater(float(stats["times real time"]), 1.0)
        self.assertGreater(float(stats["wall time"].split()[0]), 0.0)
        for name in ("stepper", "not computed", "rejected steps", "projections", "jumps", "commands clamped",
                     "output wall time", "kinetic energy change", "energy of the applied torques",
                     "energy of the reactions"):
            self.assertIn(name, stats)
        self.assertIn(" J (estimated", stats["energy of the reactions"])

    def formulas_by(self, scene):
        """The line of --stats, the notes about it, and the samples."""
        result = self.check_simulate(scene, "--duration", "1", "--stats")
        lines = result.stderr.splitlines()
        stats = dict(line.split(": ", 1) for line in lines)
        return (stats["formulas by"], [line for line in lines if "simulate: note: " in line],
                result.stdout)

    def ship_with_machine_code(self, choice):
        text = pathlib.Path(SHIP).read_text(encoding="utf-8")
        self.assertNotIn("solver:", text)
        return self.write("ship.yaml", text + f"\nsolver: {{machine_code: {choice}}}\n")

    def test_compile_makes_machine_code_for_later_runs(self):
        by, notes, interpreted = self.formulas_by(SHIP)
        self.assertEqual((by, notes), ("the interpreter: it is not in the cache yet", []))
        self.assertFalse((self.folder / "cache").exists())
        for how in ("compiled in ", "from the cache"):
            result = self.simulate(SHIP, "--compile")
            self.assertEqual((result.returncode, result.stdout), (0, ""), result.stderr)
            self.assertTrue(result.stderr.startswith(
                f"simulate: formulas are run by machine code, {how}"), result.stderr)
        self.assertEqual(len(list((self.folder / "cache").iterdir())), 1)
        self.assertEqual(self.formulas_by(SHIP),
                         ("machine code, from the cache", [], interpreted))
        never = self.ship_with_machine_code("never")
        self.assertEqual(self.formulas_by(never),
                         ("the interpreter: 'solver/machine_code' is 'never'", [], interpreted))
        self.check_refused([SHIP, "--compile", "--explain"], "--compile", "--explain")
        self.check_refused([SHIP, "--compile=1"], "takes no value")

    def test_always_compiles_before_the_run(self):
        scene = self.ship_with_machine_code("always")
        by, notes, _ = self.formulas_by(scene)
        self.assertTrue(by.startswith("machine code, compiled in "), by)
        self.assertEqual(notes, [])

    def test_runs_without_a_compiler_and_says_so_once(self):
        _, _, interpreted = self.formulas_by(SHIP)
        self.environment["PATH"] = str(self.folder)
        reason = "the interpreter: no compiler (cc) was found"
        self.assertEqual(self.formulas_by(self.ship_with_machine_code("always")),
                         (reason, [f"simulate: note: formulas are run by {reason}"], interpreted))
        self.assertEqual(self.formulas_by(SHIP)[1:], ([], interpreted))
        result = self.simulate(SHIP, "--compile")
        self.assertEqual(result.returncode, 3)
        self.assertEqual(result.stderr, f"simulate: formulas are run by {reason}\n")

    def test_choice_of_machine_code_is_checked(self):
        self.check_refused([self.ship_with_machine_code("sometimes"), "--duration", "1"],
                           "solver/machine_code", "'sometimes'", "auto, never, always")

    def test_bag_equals_csv(self):
        path = str(self.folder / "out.bag")
        result = self.simulate(SHIP, "--duration", "0.405", "--rate", "20", "--output", path)
        self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))
        header, rows = self.samples(SHIP, "--duration", "0.405", "--rate", "20")
        with rosbag.Bag(path) as bag:
            scenes = [message for _, message, _ in bag.read_messages("scene")]
            states = [message for _, message, _ in bag.read_messages("state")]
            joints = [message for _, message, _ in bag.read_messages("joint_states")]
        self.assertEqual([scene.shafts for scene in scenes], [["drive", "load"]])
        self.assertEqual(len(states), len(rows))
        self.assertEqual(len(joints), len(rows))
        for row, state, joint in zip(rows, states, joints):
            values = [state.time]
            for i in range(2):
                values += [getattr(state, quantity)[i] for quantity in QUANTITIES]
            values += [state.residual[0], state.multiplier[0]]
            self.assertEqual(values, row)
            self.assertEqual(state.header.stamp.to_nsec(), round(row[0] * 1e9))
            self.assertEqual(joint.header.stamp, state.header.stamp)
            self.assertEqual(joint.name, ["drive", "load"])
            self.assertEqual(list(joint.velocity), [row[header.index("drive/velocity")],
                                                    row[header.index("load/velocity")]])

    def test_a_reader_that_goes_away_ends_the_run_quietly(self):
        with subprocess.Popen([SIMULATE, SHIP, "--duration", "1e9"], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, env=self.environment) as process:
            process.stdout.readline()
            process.stdout.close()
            self.assertEqual(process.wait(timeout=30), 0)
            self.assertEqual(process.stderr.read(), b"")

    def test_output_that_cannot_be_written(self):
        for name in ("nowhere/out.csv", "nowhere/out.bag"):
            result = self.simulate(SHIP, "--duration", "1", "--output", str(self.folder / name))
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assertIn("nowhere", result.stderr)
        with open("/dev/full", "w", encoding="utf-8") as full:
            result = self.simulate(SHIP, "--duration", "1", stdout=full)
        self.assertEqual(result.returncode, 3)
        self.assertIn("No space left", result.stderr)

    def test_a_bag_that_does_not_fit_keeps_what_was_written(self):
        path = str(self.folder / "out.bag")
        limit = 1000000

        def limit_files():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        result = self.simulate(SHIP, "--duration", "1000", "--rate", "1000", "--output", path,
                               preexec_fn=limit_files)
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("out.bag: ", result.stderr)
        self.assertIn("File too large", result.stderr)
        self.assertIn("rosbag reindex", result.stderr)
        with rosbag.Bag(path, "a", allow_unindexed=True) as bag:
            for _ in bag.reindex():
                pass
            self.assertGreater(bag.get_message_count("state"), 1000)
            self.assertEqual(bag.get_message_count("scene"), 1)
        # Nothing fits at all.
        full = self.folder / "full.bag"
        full.symlink_to("/dev/full")
        result = self.simulate(SHIP, "--duration", "1", "--output", str(full))
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("No space left", result.stderr)

    def test_the_shortest_run_ends(self):
        self.check_simulate(SHIP, "--duration", "5e-324")

    def test_plot_bag_names_what_is_no_bag(self):
        garbage = self.folder / "garbage.bag"
        garbage.write_bytes(bytes(range(256)) * 8)
        for bag in (garbage, self.folder, self.folder / "none.bag"):
            result = subprocess.run([FOLDER / "scripts/plot_bag", str(bag)], capture_output=True, text=True,
                                    env=self.environment, timeout=60, check=False)
            self.assertNotEqual(result.returncode, 0, bag)
            self.assertTrue(result.stderr.startswith(f"plot_bag: {bag}: "), result.stderr)

    def test_plot_bag_reads_damaged_bags_without_a_traceback(self):
        whole = self.folder / "whole.bag"
        self.simulate(SHIP, "--duration", "0.1", "--output", whole)
        bytes_of_whole = whole.read_bytes()
        damaged = {"cut": bytes_of_whole[:len(bytes_of_whole) // 2],
                   "fields": bytes_of_whole.replace(b"string[] shafts", b"string[] shifts"),
                   "numbers": bytes_of_whole.replace(b"float64[] velocity", b"float32[] velocity")}
        for name, content in damaged.items():
            self.assertNotEqual(content, bytes_of_whole, name)
            bag = self.folder / f"{name}.bag"
            bag.write_bytes(content)
            result = subprocess.run([FOLDER / "scripts/plot_bag", str(bag)], capture_output=True, text=True,
                                    env=self.environment, timeout=60, check=False)
            self.assertEqual(result.returncode, 1, name)
            self.assertIn(f"plot_bag: {bag}: ", result.stderr)  # behind rosbag's own warnings
            self.assertNotIn("Traceback", result.stderr)

    def test_what_is_read_is_not_written_over(self):
        scene = self.folder / "scene.csv"
        text = pathlib.Path(SHIP).read_text(encoding="utf-8")
        scene.write_text(text, encoding="utf-8")
        for output in (scene, self.folder / "." / "scene.csv"):
            result = self.simulate(str(scene), "--duration", "1", "--output", str(output))
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn("--output: ", result.stderr)
            self.assertIn("is the scene", result.stderr)
        self.assertEqual(scene.read_text(encoding="utf-8"), text)

    def test_a_closed_terminal_keeps_the_samples(self):
        output = self.folder / "out.bag"
        told = self.interrupted(["--duration", "1e9", "--rate", "0.1", "--output", str(output)], signal.SIGHUP, 129,
                                output.exists)
        self.assertIn("interrupted at ", told)
        with rosbag.Bag(str(output)) as bag:  # it has its index
            self.assertGreater(bag.get_message_count(), 0)

    def test_a_compiler_that_does_not_end_is_ended_with_the_run(self):
        compilers, cache = self.folder / "compilers", self.folder / "cache"
        self.environment["PATH"] = fake_compiler(self.folder, f"sleep 1000 & echo $! >> {compilers}\nwait")
        for words, order, code in (
                (["--duration", "1", "--set", "solver/machine_code=always"], signal.SIGTERM, 143),
                (["--duration", "1", "--set", "solver/machine_code=always"], signal.SIGINT, 130),
                (["--compile"], signal.SIGTERM, 143), (["--compile"], signal.SIGKILL, -9)):
            with self.subTest(words=words, order=order):
                compilers.unlink(missing_ok=True)
                self.interrupted(words, order, code, lambda: compilers.exists() and compilers.read_text())
                end = time.monotonic() + 5.0
                while any(pathlib.Path("/proc", pid).exists()
                          for pid in compilers.read_text().split()) or list(cache.iterdir()):
                    self.assertLess(time.monotonic(), end, "compilers, or their files, are left")
                    time.sleep(0.01)

    def test_machine_code_that_is_asked_for_is_waited_for(self):
        self.environment["PATH"] = fake_compiler(self.folder, 'sleep 6\nPATH=/usr/bin:/bin\nexec cc "$@"')
        result = self.check_simulate(self.write("scene.yaml", scene_text("a 1", [])), "--compile")
        self.assertIn("machine code, compiled in ", result.stderr)

    def test_a_long_advance_is_interrupted(self):
        # 1e9 s to the first sample after the start.
        scene = self.write("scene.yaml", scene_text("a 1", ["it on a: cos(1e4*t)"],
                                                    "solver: {maximum_steps: 1000000000, machine_code: never}"))
        output = self.folder / "out.csv"
        for words in (["--times", "0,1e9", "--energy"], ["--linearize", "--at", "1e9"]):
            with self.subTest(words=words):
                told = self.interrupted([*words, "--output", str(output)], signal.SIGTERM, 143, 1.0, scene)
                self.assertIn("interrupted at ", told)
                self.assertLessEqual(output.read_text().count("\n") if output.exists() else 0, 2)  # header and start

    def test_a_run_that_crawls_hears_signals(self):
        # By dopri5 a step is as short as the stiffness asks for: 3e8 in one second of the motion.
        scene = self.write("crawl.yaml", scene_text("a 1", ["drag on a: sin(t) - 1e9*w_a"],
                                                    "solver: {stepper: dopri5, maximum_steps: 2000000000}"))
        for order, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
            output = self.folder / f"{status}.csv"
            told = self.interrupted(["--times", "0,1e-9,1e6", "--output", str(output)], order, status, 2.0, scene)
            self.assertIn("simulate: interrupted at ", told)
            rows = parse(output.read_text(encoding="utf-8"))[1]
            self.assertEqual(len(rows), 2)  # what lay before the crawl

    def test_a_part_that_is_missing_is_told_with_its_scene(self):
        scene = self.write("scene.yaml", "shafts: [a]\na: {inertia: 1}\nparts: [p]\np: {file: none.yaml}\n")
        self.check_refused([scene, "--duration", "1"], f"simulate: {scene}: p/file: {self.folder}/none.yaml:1:1: cannot be read")

    def test_a_command_out_of_all_proportion_is_told(self):
        scene = self.write("ratio.yaml", scene_text("a 1, b 1", [
            "gear = KinematicRatio, shafts: [a, b], ratio: {topic: ratio, initial: 0.5, hold: second_order_lag, "
            "time_constant: 0.2}"]))
        commands = self.write("commands.csv", "time,topic,value\n0.1,ratio,1e308\n")
        result = self.simulate(scene, "--duration", "1", "--commands", commands)
        self.assertEqual(result.returncode, 1)
        self.assertIn("; the command 1e+308 on 'ratio' is out of all proportion: 'min' and 'max' of the input bound "
                      "what is taken; last good state: ", result.stderr)

    def test_a_plugin_that_throws_ends_its_motion_and_no_sample_is_lost(self):
        self.environment.update(faulty_package.environment(self.folder))
        for how, words in (("throws", "the sensor is off"), ("throws_a_number", "an exception of type int")):
            scene = self.write("throws.yaml", faulty_package.scene(how, 0.55))
            result = self.simulate(scene, "--duration", "1", "--rate", "10")
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertEqual([row[0] for row in parse(result.stdout)[1]], [0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
            self.assertRegex(result.stderr, f"at t = 0.5.*torque 'drag', whose function threw: {words}.*last good state")
        scene = self.write("throws.yaml", faulty_package.scene("throws"))
        self.check_refused([scene, "--duration", "1"], "drag: 'variator_sim_faulty/Torque' cannot be configured: "
                           "an exception of type int")

    def test_a_plugin_that_blocks_ends_at_the_first_control_c(self):
        self.environment.update(faulty_package.environment(self.folder))
        scene = self.write("blocks.yaml", faulty_package.scene("blocks", 0.55))
        output = self.folder / "out.csv"

        def blocks():
            ready = output.exists() and output.stat().st_size > 2000
            time.sleep(0.5 if ready else 0.0)  # (nothing tells that it blocks)
            return ready

        told = self.interrupted(["--duration", "1", "--rate", "100", "--output", str(output)], signal.SIGINT, 130, blocks,
                                scene, within=3.0)
        self.assertIn("simulate: interrupted, while a step does not end", told)
        self.assertGreater(len(parse(output.read_text(encoding="utf-8"))[1]), 10)

    def test_interrupt_keeps_the_samples_and_a_terminal_shows_progress(self):
        output = self.folder / "out.csv"
        terminal, end = pty.openpty()
        with subprocess.Popen([SIMULATE, SHIP, "--duration", "1e9", "--rate", "0.1",
                               "--output", str(output)], stderr=end,
                              env=self.environment) as process:
            os.close(end)
            shown = b""
            deadline = time.monotonic() + 30
            while b"times real time" not in shown and time.monotonic() < deadline:
                shown += os.read(terminal, 4096)
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(timeout=30), 130)
        while True:
            try:
                shown += os.read(terminal, 4096)
            except OSError:  # a terminal that no one writes to any more
                break
        os.close(terminal)
        self.assertIn(b" left", shown)
        self.assertIn(b"\r\x1b[Ksimulate: interrupted at ", shown)
        text = output.read_text(encoding="utf-8")
        self.assertEqual(text[-1], "\n")
        header, rows = parse(text)
        self.assertGreater(len(rows), 100)
        self.assertEqual(len(rows[-1]), len(header))


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "simulate_test", SimulateTest)
