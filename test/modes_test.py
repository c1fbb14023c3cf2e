#!/usr/bin/python3
"""Elements that hold, by simulate and in emitted programs: examples of the Modelica library's package
Rotational beside references of 34 digits, and what does not depend on the order of a scene's elements."""

import csv
import math
import pathlib

import roslib.packages
import rosunit
import variator_sim

from support.scenes import scene_text
from support.simulate import SIMULATE, call
from support.subtests import FolderTestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
# (Bits depend neither on the optimization nor on VS_SMALL, which leaves less to compile.)
STRICT = ["-std=c99", "-DVS_SMALL", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow",
          "-Werror"]
MODES = {"backward": -1, "stuck": 0, "forward": 1, "free": 2}


def read(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


class ModesTest(FolderTestCase):
    def setUp(self):
        super().setUp()
        self.optimization = "-O0"

    def play(self, scene, duration, rate, *options):
        """The samples and the events of the scene's program."""
        made = self.folder / "made"
        self.assertEqual(self.told(scene, "--emit-c", made, status=0), "")
        done = call("gcc", *STRICT, self.optimization, "-o", made / "play", made / "it.c", made / "main.c", "-lm")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        done = call(made / "play", "--duration", duration, "--rate", rate, "--output",
                    made / "o.csv", "--events", made / "e.csv", *options)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return read(made / "o.csv"), read(made / "e.csv")[1]

    def simulate(self, scene, duration, rate, *options):
        """The same by simulate."""
        self.assertEqual(self.told(scene, "--duration", duration, "--rate", rate, "--columns", "state,elements,energy",
                                   "--output", self.folder / "s.csv", "--events", self.folder / "t.csv", *options,
                                   status=0), "")
        return read(self.folder / "s.csv"), read(self.folder / "t.csv")[1]

    def told(self, scene, *words, status=2):
        """What simulate tells of the scene; it ends with the status."""
        path = self.folder / "it.yaml"
        path.write_text(scene)
        done = call(SIMULATE, path, *(words or ("--duration", 1)))
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stderr

    def check_refused(self, scene, *words):
        told = self.told(scene)
        for word in words:
            self.assertIn(word, told)

    def check_example(self, name, duration, events):
        expected = read(FOLDER / f"test/modes/{name}.csv")
        scene = (FOLDER / f"test/modes/{name}.yaml").read_text()
        for run in (self.play, self.simulate):
            with self.subTest(run.__name__):
                samples, found = run(scene, duration, (len(expected[1]) - 1) / duration)
                self.compare(expected, samples)
                if events:
                    self.compare_events(name, found, events)

    def compare(self, of_reference, samples):
        expected_header, expected = of_reference
        header, rows = samples
        self.assertEqual(len(rows), len(expected))
        for k, column in enumerate(expected_header):
            if column not in header:
                continue
            at = header.index(column)
            if column.endswith("/mode"):
                self.assertEqual([float(row[at]) for row in rows], [MODES[row[k]] for row in expected])
                continue
            scale = max(1e-3, max(abs(float(row[k])) for row in expected))
            worst = max(abs(float(a[k]) - float(b[at])) for a, b in zip(expected, rows))
            self.assertLessEqual(worst, 1e-6 * scale, column)

    def compare_events(self, name, found, events):
        for time, element, before, after in read(FOLDER / f"test/modes/{name}.events.csv")[1]:
            if before == "start":
                continue
            same = [float(line[0]) for line in found if line[1:4] == [element, before, after]]
            self.assertLessEqual(min(abs(one - float(time)) for one in same), events, (time, element))

    def test_examples(self):
        # They are from the package Rotational and elsewhere; test/stress/independent/examples.py made their references.
        # OneWayClutch lets go at 1.5e-4 N m there instead of 0, 1.6e-6 s later; angles without modes have no events.
        for name, duration, events in (
                ("CoupledClutches", 1.5, 1e-6), ("Friction", 3.0, 1e-6), ("OneWayClutch", 2.0, 2e-6),
                ("LossyGearDemo1", 0.5, 1e-6), ("Backlash", 1.0, None), ("ElasticBearing", 10.0, None),
                ("First", 1.0, 1e-6), ("LossyGearDemo2", 0.5, 1e-6), ("LossyGearDemo3", 1.0, 1e-6),
                ("RollingWheel", 5.0, 1e-6), ("HeatLosses", 1.0, 1e-6), ("SimpleGearShift", 5.0, 1e-6),
                ("EddyCurrentBrake", 1.0, 1e-6), ("OneWayClutchDisengaged", 2.0, 1e-6), ("DemoFreeWheel", 1.0, 1e-6),
                ("CompareBrakingTorque", 5.0, 1e-6)):
            with self.subTest(name):
                self.optimization = "-O1" if name == "CoupledClutches" else "-O0"  # with its warnings
                self.check_example(name, duration, events)

    def test_lossy_gear_under_gauss(self):
        expected = read(FOLDER / "test/modes/LossyGearDemo1.csv")
        scene = (FOLDER / "test/modes/LossyGearDemo1.yaml").read_text() + "principle: gauss\n"
        samples, found = self.simulate(scene, 0.5, 100)
        self.compare(expected, samples)
        self.compare_events("LossyGearDemo1", found, 1e-6)

    def test_a_formula_and_a_gear_that_change_where_a_shaft_turns_back(self):
        # clamp(w_motor/30, 0, 1) and the side of the gear's losses change at the same instant.
        scene = (FOLDER / "config/applications/holding/car_electric.yaml").read_text()
        scene = scene.replace("car_electric_cycle.csv", str(FOLDER / "config/applications/holding/car_electric_cycle.csv"))
        for tolerance in ("1e-4", "1e-6", "1e-9"):
            settings = [f"--set=solver/{kind}_tolerance={tolerance}" for kind in ("relative", "absolute")]
            (header, rows), found = self.simulate(scene, 53.0, 1000, *settings)
            at = [header.index(name) for name in ("time", "motor/velocity")]
            samples = [[float(row[k]) for k in at] for row in rows]
            turns = [(a[0], b[0]) for a, b in zip(samples, samples[1:]) if a[0] > 3.0 and a[1] < 0.0 <= b[1]]
            last = [float(line[0]) for line in found if line[1:4] == ["gear", "backward", "forward"]][-1]
            self.assertTrue(turns and turns[-1][0] <= last <= turns[-1][1], (tolerance, turns, last))

    def test_the_heat_closes_the_energy_of_lossy_gears(self):
        # No bearing torque is an applied one here: the reactions take what becomes heat.
        scene = (FOLDER / "test/modes/LossyGearDemo1.yaml").read_text()
        (header, rows), _ = self.simulate(scene, 0.5, 100)
        work = [float(row[header.index("energy/applied")]) for row in rows]
        exchanged = sum(abs(b - a) for a, b in zip(work, work[1:]))
        for row in rows:
            left = float(row[header.index("energy/reactions")]) + float(row[header.index("gear/heat")])
            self.assertAlmostEqual(left, 0.0, delta=1e-9 * exchanged)

    def test_the_side_that_drives_changes_where_nothing_passes(self):
        # Without bearing torques both lines of the losses meet at lambda = 0, which rounding alone gives a sign.
        scene = scene_text("s0 1.104, s1 0.137, s2 0.296", [
            "load0 on s0: -4.49 - 0.079*w_s0",
            "load1 on s1: 2.12*sin(22.86*t)",
            "load2 on s2: 10.64*sin(14.91*t)",
            "spring = ElasticCoupling, shafts: [s1, s0], stiffness: 198.6, damping: 1.89",
            "clutch = Clutch, shafts: [s0, s2], ratio: 0.19, capacity: 12.6",
            "gear = KinematicRatio, shafts: [s1, s0], ratio: 1, efficiency: {driving: 0.35, driven: 0.87}"],
            "initial: {velocity: [0, 0, 4.39]}")
        _, events = self.simulate(scene, 2.0, 50)
        times = [float(line[0]) for line in events if line[1] == "gear"]
        for expected, found in zip((0.021603783, 0.115986871, 0.261555735, 0.415227198), times):
            self.assertAlmostEqual(found, expected, delta=1e-8)
        self.assertEqual(len(times), 17)

    def test_massless_shafts_need_a_constraint(self):
        loose = scene_text("a 1.0, b 0", [
            "clutch = Clutch, shafts: [a, b], capacity: 5",
            "brake = Brake, shaft: b, capacity: 5"])
        gear = "constraints: [gear]\ngear: {type: variator_sim/KinematicRatio, shafts: [a, b], ratio: RATIO}\n"
        for text, status in ((loose, 2), (loose + gear.replace("RATIO", '"2 + 0.1*t"'), 2),
                             (loose + gear.replace("RATIO", "2"), 0)):
            told = self.told(text, status=status)
            self.assertEqual("b/inertia: is 0, but no constraint" in told, status == 2)

    def test_faults_of_elements_are_told_by_name(self):
        self.check_refused(scene_text("worm 1, wheel 1", [
            "gear = KinematicRatio, shafts: [worm, wheel], ratio: 0.05, efficiency: {driving: 0.4, driven: 0}"]),
            "gear/efficiency: is 0 where 'wheel' drives", "torque on 'wheel' cannot turn 'worm'")
        # Two imposed speeds and claws that close between them.
        told = self.told(scene_text("a 1, b 1, c 1", [
            'dog = DogClutch, shafts: [a, b], engaged: "if(t < 0.5, 0, 1)", engage_below: 50',
            "one of order 1: w_a - 1 - t",
            "two of order 1: w_b - 2"], "initial: {velocity: [1, 2, 0]}"), status=1)
        self.assertIn("NoModes", told)
        self.assertIn("rigid are 'dog'", told)

    def test_a_commanded_capacity_below_0_is_clamped_and_counted(self):
        commands = self.folder / "commands.csv"
        commands.write_text("time,topic,value\n0.5,c,-2\n")
        for capacity, *keys in (["{topic: c, initial: 5}"],
                                ["{input: c}", "inputs: [c]", "c: {topic: c, initial: 5}"]):
            told = self.told(scene_text("a 1", [
                "push on a: 3", f"brake = Brake, shaft: a, capacity: {capacity}"], *keys), "--duration", 1, "--rate", 2,
                "--commands", commands, "--stats", "--output", self.folder / "s.csv", status=0)
            self.assertIn("commands clamped: 1", told)
            header, rows = read(self.folder / "s.csv")
            self.assertAlmostEqual(float(rows[-1][header.index("a/velocity")]), 1.5, delta=1e-12)

    def test_a_kink_that_a_gear_stays_on_costs_no_steps(self):
        scene = scene_text("a 0.3, b 3.7, c 1.1", [
            "drive on a: 5 + %s",
            "clutch = Clutch, shafts: [a, b], ratio: 0.7, capacity: 60",
            "drag on b: -0.1*w_b*(1 + 0.3*sin(t)) - 0.003*w_a^2",
            "gear: 0.1*(e_c - 0.37*e_a) + w_c - 0.37*w_a"], "principle: gauss", "initial: {velocity: [90, 80, 33.3]}")
        steps = []
        for kink in "0", "max(1.7*w_c/0.37 - 1.7*w_a, 0)":
            told = self.told(scene % kink, "--duration", 30, "--stats", "--output", self.folder / "s.csv", status=0)
            steps.append(int(told.split("\nsteps: ")[1].split("\n")[0]))
        self.assertLess(steps[1], 2.2 * steps[0])  # (117 beside 44 if noise is taken for events)

    def test_an_element_that_others_hold_is_stuck_in_formulas_too(self):
        # Behind 0.4 s the weak brake passes its limit and the strong one holds the rest.
        self.told(scene_text("a 1", [
            "push on a: 10*clamp(t, 0, 1)",
            "weak = Brake, shaft: a, capacity: 4",
            "strong = Brake, shaft: a, capacity: 20"], "states: [z]", "z: {rate: weak_mode}", "outputs: [mode]",
            "mode: {expression: weak_mode}"), "--duration", 5, "--rate", 20, "--columns", "elements,outputs,states",
            "--output", self.folder / "s.csv", status=0)
        header, rows = read(self.folder / "s.csv")
        for column in "weak/mode", "outputs/mode", "states/z":
            self.assertEqual({float(row[header.index(column)]) for row in rows}, {0.0}, column)

    def test_estimated_errors_are_the_errors(self):
        # Events move with the error before them: what is estimated has to contain that.
        for name, duration in (("CoupledClutches", 1.5), ("Friction", 3.0), ("SimpleGearShift", 5.0)):
            with self.subTest(name):
                expected_header, expected = read(FOLDER / f"test/modes/{name}.csv")
                scene = (FOLDER / f"test/modes/{name}.yaml").read_text()
                rate = (len(expected) - 1) / duration
                loose = "solver: {relative_tolerance: 1e-6, absolute_tolerance: 1e-6}\n"
                self.told(scene + loose, "--duration", duration, "--rate", rate, "--error", "--output",
                          self.folder / "s.csv", status=0)
                header, rows = read(self.folder / "s.csv")
                for column in header:
                    told = column + "/estimated_error"
                    if told not in header or column not in expected_header:
                        continue
                    at = expected_header.index(column)
                    for row, line in zip(rows, expected):
                        error = abs(float(row[header.index(column)]) - float(line[at]))
                        estimate = float(row[header.index(told)])
                        self.assertAlmostEqual(error, estimate, delta=1e-3 * estimate + 1e-9)

    def test_sweeps_have_the_motions_of_single_runs(self):
        for name, duration, path, values, metric in (
                ("CoupledClutches", 1.5, "J4/inertia", [0.5, 2.0], "clutch1/heat"),
                ("SimpleGearShift", 5.0, "ring/inertia", [0.0, 0.3], "load/velocity"),
                ("LossyGearDemo1", 0.5, "gear/efficiency", [0.3, 0.7], "gear/heat")):
            scene = (FOLDER / f"test/modes/{name}.yaml").read_text()
            table = variator_sim.sweep(scene, duration, grid={path: values}, rate=40, metrics=[f"final({metric})"])
            for value, found in zip(values, table[f"final({metric})"]):
                run = variator_sim.simulate(scene, duration, rate=40, overrides={path: value},
                                            columns="state,elements")
                self.assertEqual(found, run[metric][-1], (name, value))

    def test_several_events_at_one_instant_in_any_order(self):
        # At 1 s a clutch closes between shafts of one speed, a brake lets go, another one closes and the freewheel
        # begins to be driven; at 2 s two clutches open.
        elements = [
            "push on a: 3*if(t < 1, 0, 1) - w_a",
            "pull on c: 4*sin(3*t)",
            "drag on b: -0.5*w_b",
            'one = Clutch, shafts: [a, b], capacity: "if(t < 1, 0, if(t < 2, 9, 0))"',
            'two = Clutch, shafts: [b, c], capacity: "if(t < 1, 0, if(t < 2, 2, 0))", static: 1.2',
            'hold = Brake, shaft: c, capacity: "if(t < 1, 8, 0)"',
            "wheel = OneWayClutch, shafts: [c, a]"]
        orders = [elements[shift:] + elements[:shift] for shift in range(len(elements))]
        orders += [order[::-1] for order in orders]
        for run, some in (self.simulate, orders), (self.play, orders[3:11:7]):
            runs = []
            for order in some:
                (header, rows), events = run(scene_text("a 1.0, b 2.0, c 0.5", order, "initial: {velocity: [2, 2, 0]}"),
                                             3.0, 20)
                columns = [header.index(f"{shaft}/{q}") for shaft in "abc" for q in ("angle", "velocity")]
                runs.append(([[float(row[c]) for c in columns] for row in rows],
                             sorted((round(float(e[0]), 9), *e[1:4]) for e in events)))
            for rows, events in runs[1:]:
                self.assertEqual(events, runs[0][1])
                for a, b in zip(rows, runs[0][0]):
                    for x, y in zip(a, b):
                        self.assertAlmostEqual(x, y, delta=1e-12 * max(1.0, abs(y)))
            self.assertGreater(sum(event[0] == 1.0 for event in runs[0][1]), 2)

    def test_a_narrow_dip_of_a_capacity_is_not_stepped_over(self):
        scene = scene_text("a 1.0", [
            "load on a: 100",
            'brake = Brake, shaft: a, capacity: "400 - 399*exp(-((t-5.3)/0.001)^2)"'])
        _, events = self.play(scene, 10.0, 1.0)
        self.assertEqual([line[1:4] for line in events],
                         [["brake", "stuck", "forward"], ["brake", "forward", "stuck"]])
        before = 0.001 * math.sqrt(-math.log(300.0 / 399.0))
        self.assertAlmostEqual(float(events[0][0]), 5.3 - before, delta=1e-9)

    def test_an_element_sticks_though_another_one_lets_go(self):
        # At 1/5.5 s both may slide on, or b leaves its stop with a: (3.5 - 3)/2 = 0.25 rad/s^2.
        scene = scene_text("a 1, b 1", [
            "pull on a: 3.5",
            "weight on b: -3",
            "clutch = Clutch, shafts: [a, b], capacity: 2, static: 1.7",
            "backstop = OneWayClutch, shaft: b"], "initial: {velocity: [-1, 0]}")
        swapped = scene.replace("clutch, backstop]", "backstop, clutch]")
        for text in (scene, swapped):
            (header, rows), events = self.simulate(text, 2.0, 2.0)
            self.assertEqual(sorted(line[1:4] for line in events),
                             [["backstop", "stuck", "forward"], ["clutch", "forward", "stuck"]])
            for column in ("a/velocity", "b/velocity"):
                self.assertAlmostEqual(float(rows[-1][header.index(column)]), 0.25 * (2.0 - 1.0 / 5.5), delta=1e-9)

    def test_a_capacity_that_ends_at_0_frees_its_element(self):
        scene = scene_text("a 0.306", [
            "load on a: 2.77 + -0.063*w1 + 9.22*sin(3.78*t)",
            'h0 = Brake, shaft: a, capacity: "5.62*u*(1 + 0.3*sin(z))"',
            "h1 = Brake, shaft: a, capacity: 6.15, static: 1.54",
            "h2 = OneWayClutch, shaft: a, capacity: 1.33"], "inputs: [u]",
            "u: {topic: u, hold: first_order_hold, initial: 1.0, period: 0.5}", "states: [z]",
            "z: {rate: w1, initial: -0.81}", "initial: {velocity: [7.88]}")
        commands = self.folder / "commands.csv"
        commands.write_text("time,topic,value\n0.25,u,0\n")
        _, events = self.simulate(scene, 1.0, 50, "--commands", commands)
        self.assertEqual(events[0][1:4], ["h0", "forward", "free"])
        self.assertAlmostEqual(float(events[0][0]), 0.75, delta=1e-9)

    def test_formulas_read_the_torque_of_the_column(self):
        scene = scene_text("a 1, b 1", [
            "load on b: 6 - 10*t",
            "brake = Brake, shaft: a, capacity: 8",
            "clutch = Clutch, shafts: [b, a], capacity: 5, ratio: 2"], "outputs: [brake_told, clutch_told]",
            "brake_told: {expression: brake_torque}", "clutch_told: {expression: clutch_torque}",
            "initial: {velocity: [1, 3]}")
        self.assertEqual(self.told(scene, "--duration", 2, "--rate", 10, "--columns", "elements,outputs", "--output",
                                   self.folder / "s.csv", status=0), "")
        header, rows = read(self.folder / "s.csv")
        for row in rows:
            for name in ("brake", "clutch"):
                column, told = (float(row[header.index(it)]) for it in (f"{name}/torque", f"outputs/{name}_told"))
                self.assertAlmostEqual(column, told, delta=1e-9)

    def test_an_end_stop_bounces_and_comes_to_rest(self):
        scene = scene_text("valve 1.0", [
            "push on valve: -10",
            "stop = EndStop, shaft: valve, lower: 0, upper: 1.57, restitution: 0.5"],
            "initial: {angle: [1.0], velocity: [8.0]}")
        (header, rows), events = self.play(scene, 4.0, 10)
        self.assertEqual(events[0][1], "stop/upper")
        self.assertEqual(events[-1][1:4], ["stop/lower", "free", "stuck"])
        last = dict(zip(header, map(float, rows[-1])))
        self.assertEqual(last["valve/velocity"], 0.0)
        self.assertAlmostEqual(last["valve/angle"], 0.0, delta=1e-9)
        # Kinetic energy and fall: 1/2 8^2 + 10 1.0 J
        self.assertAlmostEqual(last["stop/lower/heat"] + last["stop/upper/heat"], 42.0, delta=1e-8)

    def test_a_dog_clutch_closes_by_an_impact(self):
        scene = scene_text("a 1.0, b 2.0", [
            "push on a: -3",
            "dog = DogClutch, shafts: [a, b], engaged: {topic: dog, hold: zero_order, initial: 0}, engage_below: 5"],
            "initial: {velocity: [8.0, 0]}")
        commands = self.folder / "commands.csv"
        commands.write_text("time,topic,value\n0.2,dog,1\n2.5,dog,0\n")
        (header, rows), events = self.play(scene, 3.0, 10, "--commands", commands)
        self.assertEqual([line[1:4] for line in events],
                         [["dog", "free", "stuck"], ["dog", "stuck", "free"]])
        self.assertAlmostEqual(float(events[0][0]), 1.0, delta=1e-9)  # 8 - 3 t is 5
        self.assertAlmostEqual(float(events[0][5]), 10.0 / 3.0, delta=1e-9)
        self.assertAlmostEqual(float(rows[-1][header.index("b/velocity")]), 5.0 / 3.0 - 1.5, delta=1e-9)

    def test_what_is_refused(self):
        scene = scene_text("a 1.0, b 1.0", [
            'clutch = Clutch, shafts: [a, b], capacity: 5, ratio: "1+0.1*t"'])
        self.assertIn("generalized_gauss", self.told(scene, "--emit-c", self.folder / "made"))
        self.check_refused(scene, "clutch: its ratio changes", "generalized_gauss")
        scene = scene.replace("1+0.1*t", "1")
        self.check_refused(scene + "initial: {acceleration: [1, 2]}\n", "initial/acceleration: belongs to no scene",
                           "clutch")
        self.check_refused(scene + "constraints: [cap]\ncap: {type: variator_sim/ExpressionConstraint, order: 2, "
                           "expression: e1^2 + e2 - 1}\n", "cap: is not linear in the accelerations", "clutch")

    def test_saved_states_go_on_with_their_modes(self):
        scene = (FOLDER / "test/modes/CoupledClutches.yaml").read_text()
        state = self.folder / "state.yaml"
        (_, rows), events = self.simulate(scene, 1.5, 20, "--save-state", state, "--save-at", 0.8)
        (_, others), later = self.simulate(scene, 0.7, 20, "--from-state", state)
        self.assertEqual(others, rows[-len(others):])
        self.assertEqual(later, [line for line in events if float(line[0]) > 0.8])

    def test_a_state_saved_where_a_clutch_lets_go_goes_on(self):
        """There its slip, which a formula bends at, is 0: a step ends where rounding tells that it has left 0."""
        scene = (FOLDER / "test/modes/saved_at_an_event.yaml").read_text()
        (_, rows), events = self.simulate(scene, 0.5, 2)
        self.assertEqual([event[2:4] for event in events], [["backward", "stuck"], ["stuck", "forward"]])
        (_, others), _ = self.simulate(scene, 0.5, 2, "--save-state", self.folder / "state.yaml", "--save-at", events[1][0])
        for value, other in zip(rows[-1], others[-1]):
            self.assertAlmostEqual(float(value), float(other), delta=1e-7)

    def test_states_follow_what_elements_hold_with(self):
        """By simulate and by the emitted program: torques, modes and reactions in rates and events."""
        scene = scene_text("a 1, b 2, c 1", [
            "pull on a: 20 + 15*t",
            "clutch = Clutch, shafts: [a, b], capacity: 60",
            "drag on b: -0.3*w2",
            "belt = KinematicRatio, shafts: [b, c], ratio: 0.5"], "initial: {velocity: [15, 0, 0]}",
            "states: [heat, held, told, turned]", 'heat: {rate: "-clutch_power"}',
            'held: {rate: "if(abs(clutch_mode) < 0.5, 1, 0)"}',
            'told: {rate: "R_c*w_c + Rr_b + belt_multiplier + j_a"}', 'turned: {rate: "clutch_torque + clutch_slip"}',
            "variables: [passed]", "passed: {initial: 0}", "events: [pass]",
            'pass: {when: "clutch_torque + 50", direction: falling, set: {passed: t}}')
        columns = [f"states/{name}" for name in ("heat", "held", "told", "turned")] + ["variables/passed"]
        for principle in ("generalized_gauss", "gauss"):
            (names, rows), _ = self.play(scene + f"principle: {principle}", 6, 2)
            self.assertEqual(self.told(scene + f"principle: {principle}", "--duration", 6, "--rate", 2, "--columns",
                                       "state,elements,states,variables", "--output", self.folder / "s.csv",
                                       status=0), "")
            header, samples = read(self.folder / "s.csv")
            for row, sample in zip(rows, samples):
                for column in columns:
                    self.assertAlmostEqual(float(row[names.index(column)]), float(sample[header.index(column)]), delta=1e-8)
                self.assertAlmostEqual(float(sample[header.index("states/heat")]), float(sample[header.index("clutch/heat")]),
                                       delta=1e-8)
            self.assertEqual(len(rows), len(samples))
            self.assertGreater(float(rows[-1][names.index("states/held")]), 1.0)

    def test_starts_in_modes_that_the_scene_asks_for(self):
        scene = scene_text("a 1.0", [
            "load on a: -9",
            "brake = Brake, shaft: a, capacity: 8, static: 1.25, initial: STATE"])
        for state, mode in (("auto", "0"), ("stuck", "0"), ("slipping", "-1")):
            (header, rows), _ = self.simulate(scene.replace("STATE", state), 1.0, 1)
            self.assertEqual([row[header.index("brake/mode")] for row in rows], [mode, mode])
        for torque, state in (("-11", "stuck"), ("-7", "slipping")):
            self.check_refused(scene.replace("STATE", state).replace('"-9"', f'"{torque}"'), "brake/initial",
                               f"{torque} N m")
        self.check_refused(scene.replace("STATE", "auto").replace("capacity: 8", "capacity: -8"), "brake/capacity")

    def test_starts_with_an_impact_or_off_the_constraints(self):
        """A freewheel that would slip backwards begins with an impact. Velocities off a constraint are told as such,
        whatever holds beside it."""
        scene = scene_text("a 1.0, b 1.0, c 1.0, d 1.0", [
            "stop = EndStop, shaft: b, lower: -1, upper: 1.6",
            "brake = Brake, shaft: c, capacity: 5",
            "wheel = OneWayClutch, shafts: [a, d]",
            "gear = KinematicRatio, shafts: [a, b], ratio: -0.5"], "initial: {velocity: [1, -0.5, 0, 0]}",
            "principle: gauss")
        (header, rows), _ = self.simulate(scene, 1.0, 1)
        for row in rows:  # 1.25 kg m^2 at 1 rad/s meets 1 kg m^2
            self.assertAlmostEqual(float(row[header.index("d/velocity")]), 1.25 / 2.25, delta=1e-12)
            self.assertAlmostEqual(float(row[header.index("b/velocity")]), -0.5 * 1.25 / 2.25, delta=1e-12)
        for brake in ("", ", initial: slipping"):
            self.check_refused(scene.replace("capacity: 5", "capacity: 5" + brake).replace("-0.5, 0", "-0.501, 0"),
                               "initial/velocity", "residual of 'gear' = -0.001", "[1.0004, -0.5002, 0, 0]")

    def test_energy_closes_with_heat_and_impacts(self):
        scene = scene_text("a 1.0, b 2.0", [
            "push on a: 3*sin(2*t)",
            "clutch = Clutch, shafts: [a, b], capacity: 2",
            "stop = EndStop, shaft: b, lower: -0.5, upper: 0.5, restitution: 0.4"], "initial: {velocity: [3, -2]}",
            "solver: {relative_tolerance: 1e-10, absolute_tolerance: 1e-10}")
        (header, rows), events = self.simulate(scene, 10.0, 100)
        self.assertTrue(any(line[1] == "stop/upper" and float(line[5]) != 0.0 for line in events))
        last = dict(zip(header, map(float, rows[-1])))
        heat = sum(last[f"{name}/heat"] for name in ["clutch", "stop/lower", "stop/upper"])
        pushed = last["energy/kinetic"] - 8.5 + heat
        # The applied torques are the push and the clutch that slides; reactions those of impacts.
        work = last["energy/applied"] + last["clutch/heat"]
        at = header.index("energy/applied")
        exchanged = heat + sum(abs(float(b[at]) - float(a[at])) for a, b in zip(rows, rows[1:]))
        self.assertAlmostEqual(pushed, work, delta=1e-9 * exchanged)

    def test_events_of_the_scene_are_told_beside_the_modes(self):
        scene = (FOLDER / "test/scenes/telling.yaml").read_text()
        # 2 w' = 4 - 10 from 3 rad/s: at rest at 1 s.
        expected = [[1.0, "brake", "forward", "stuck", 4.0, 0.0], [1.5, "release", "below", "above", 0.0, 0.0],
                    [1.5, "brake", "stuck", "forward", 2.0, 0.0]]
        result = variator_sim.simulate(scene, 3.0)
        # Inside the step that ends at the event, too, it holds; behind it 2 w' = 4 - 2.
        for time, speed in zip(result.time, result["wheel/velocity"]):
            self.assertAlmostEqual(speed, max(0.0, 3.0 - 3.0 * time, time - 1.5), delta=1e-8)
        many = ("{shafts: [a], a: {inertia: 1}, variables: [n], n: {initial: 0}, events: [turn],"
                " turn: {when: sin(3000*t), direction: both, set: {n: n + 1}}}")
        steps = variator_sim.Simulation(many)
        steps.advance(2.0)
        self.assertEqual(len(steps.take_events()), 1909)  # zeros of the sine
        self.assertEqual(len(variator_sim.simulate(many, times=[0.0, 2.0]).events), 1909)
        steps = variator_sim.Simulation(scene)
        taken = []
        for _ in range(30):
            steps.advance(0.1)
            taken += steps.take_events()
        self.assertEqual(steps.take_events(), [])
        runs = {"play": self.play(scene, 3.0, 10)[1], "simulate": self.simulate(scene, 3.0, 10)[1],
                "python": [list(event.values()) for event in result.events],
                "steps": [list(event.values()) for event in taken]}
        for name, found in runs.items():
            with self.subTest(name):
                self.assertEqual([line[1:4] for line in found], [line[1:4] for line in expected])
                for line, right in zip(found, expected):
                    for k in (0, 4, 5):
                        self.assertAlmostEqual(float(line[k]), right[k], delta=1e-9)

    def test_linear_models_and_steady_states_are_those_of_the_modes(self):
        scene = scene_text("a 1.0, b 2.0", [
            "motor on a from motor, initial: 4",
            "drag on b: -0.5*w2",
            "clutch = Clutch, shafts: [a, b], capacity: 10"], "states: [heat, way]",
            'heat: {rate: "0.1*w_b^2 - 0.2*heat", initial: 1}', 'way: {rate: "w_b"}', "initial: {velocity: [3, 3]}")
        path = self.folder / "it.yaml"
        # Stuck: 3 w' = u - 0.5 w; heat' = 0.1 w^2 - 0.2 heat at w = 3. Sliding at 5 and 3 rad/s: w_a' = u, 2 w_b' = -0.5 w_b
        stuck = {("b/velocity", "b/velocity"): -1 / 6, ("states/heat", "b/velocity"): 0.6,
                 ("states/heat", "states/heat"): -0.2, ("states/way", "b/velocity"): 1.0, ("b/velocity", "motor"): 1 / 3}
        slides = {("a/velocity", "motor"): 1.0, ("b/velocity", "b/velocity"): -0.25, ("b/velocity", "a/velocity"): 0.0}
        for principle in ("gauss", "generalized_gauss"):
            path.write_text(scene + f"principle: {principle}\n")
            for at, expected, mode in (("0", stuck, "stuck"), ("velocity=[5,3]", slides, "backward")):
                if mode == "backward" and principle == "generalized_gauss":
                    continue  # its states have accelerations
                with self.subTest(principle + mode):
                    file = self.folder / "model.csv"
                    done = call(SIMULATE, path, "--linearize", "--at", at, "--output", file)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    self.assertIn(f"in the mode that holds there: 'clutch' {mode}", done.stdout)
                    found = {(row, column): float(value) for matrix, row, column, value in read(file)[1]
                             if matrix in "AB"}
                    for place, value in expected.items():
                        self.assertAlmostEqual(found[place], value, delta=1e-12)
            done = call(SIMULATE, path, "--trim")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("modes: 'clutch' stuck", done.stderr)
            self.assertIn("velocity: 8.0", done.stdout)  # 4 = 0.5 w
            (self.folder / "steady.yaml").write_text(done.stdout)
            stays = call(SIMULATE, path, "--from-state", self.folder / "steady.yaml", "--duration", 1, "--columns",
                         "state,elements", "--rate", 1, "--output", self.folder / "steady.csv")
            self.assertEqual(stays.returncode, 0, stays.stderr)
            header, rows = read(self.folder / "steady.csv")
            self.assertEqual([row[header.index("clutch/mode")] for row in rows], ["0", "0"])
            self.assertAlmostEqual(float(rows[-1][header.index("b/velocity")]), 8.0, delta=1e-9)
            self.assertIn("value: 32.0", done.stdout)    # 0.2 heat = 0.1 64
            # At 120 rad/s it transmits 40 N m, which 45 N m hold and 35 N m do not.
            for capacity, status in ((45, 0), (35, 1)):
                told = self.told(scene.replace("capacity: 10", f"capacity: {capacity}") + f"principle: {principle}\n",
                                 "--trim", "--set", "motor/initial=40", "--set", "drag/torque=20-0.5*w2", "--set",
                                 "a/inertia=0.5", status=status)
            self.assertIn("'clutch' would not stay stuck, by 5 N m", told)

    def test_dogs_close_by_impacts_alone(self):
        # The slip is 10 - t: 3 at 7 s, whatever rises through 0.5 before. p = 3/(1 + 1).
        for engaged in ('"clamp(t/8, 0, 1)"', '"tanh(t)"', "1"):
            scene = scene_text("a 1, b 1", ["m on a: -1", f"dog = DogClutch, shafts: [a, b], engaged: {engaged}, engage_below: 3"],
                               "initial: {velocity: [10, 0]}")
            _, events = self.simulate(scene, 8.0, 1)
            self.assertEqual([line[1:4] for line in events], [["dog", "free", "stuck"]])
            self.assertAlmostEqual(float(events[0][0]), 7.0, delta=1e-9)
            self.assertAlmostEqual(float(events[0][5]), 1.5, delta=1e-9)
        # p = 1.4374/(1/2.7034 + 1.7501^2/2.43), whatever rounding makes of the slip at its limit.
        slipping = scene_text("a INERTIA, b 2.43", [
            "qb on b: -7.2072*phi_b",
            "cl = Clutch, shafts: [a, b], capacity: 2.2093, static: 1.3897",
            "dog = DogClutch, shafts: [a, b], ratio: 1.7501, engaged: 1, engage_below: 1.4374"],
            "initial: {velocity: [0.6642, -1.9069]}")
        for n in range(12):
            inertia = 2.7034 + 1e-9 * n
            _, events = self.simulate(slipping.replace("INERTIA", repr(inertia)), 1.0, 1)
            closes = [line for line in events if line[1] == "dog"]
            self.assertEqual([line[2:4] for line in closes], [["free", "stuck"]])
            right = 1.4374 / (1 / inertia + 1.7501**2 / 2.43)
            self.assertAlmostEqual(abs(float(closes[0][5])), right, delta=1e-8)
        # One that opens smoothly, at sin(2.01 t) = 0, lets both go on.
        opens = scene_text("a 1, b 1", ["dog = DogClutch, shafts: [a, b], engaged: sin(2.01*t) + 0.5, engage_below: 1"],
                           "initial: {velocity: [1.4, 1.2]}")
        _, events = self.simulate(opens, 3.0, 1)
        self.assertEqual([line[2:4] for line in events], [["stuck", "free"]])
        self.assertAlmostEqual(float(events[0][0]), math.pi / 2.01, delta=1e-9)

    def test_impacts_are_of_what_approaches(self):
        # The stop sends a back with 4.5 rad/s; then what moved apart before locks, and shares the momentum.
        for law in ("OneWayClutch, shafts: [a, b]", "DogClutch, shafts: [a, b], engaged: 1, engage_below: 4.6"):
            scene = scene_text("a 0.5, b 1.6, w 10", [
                "stop = EndStop, shaft: a, lower: 0, restitution: 0.9",
                f"lock = {law}",
                "clutch = Clutch, shafts: [b, w], capacity: 1"], "initial: {angle: [1, 0, 0], velocity: [-5, 0, 0]}")
            (header, rows), _ = self.simulate(scene, 0.2, 10)
            last = dict(zip(header, map(float, rows[-1])))
            for shaft, right in (("a", 2.25 / 2.1), ("b", 2.25 / 2.1), ("w", 0.0)):
                self.assertAlmostEqual(last[f"{shaft}/velocity"], right, delta=1e-8)
            heat = sum(last[name] for name in header if name.endswith("/heat"))
            self.assertAlmostEqual(last["energy/kinetic"] + heat, 6.25, delta=1e-8)
        # A stop and a backstop of one shaft: at rest on the stop. Two stops behind a gear: the stiffer one decides.
        stop = "EndStop, shaft: a, lower: -9, upper: 1, restitution: 0.3"
        one = scene_text("a 1", ["m on a: 5", f"stop = {stop}", "back = OneWayClutch, shaft: a"])
        gear = scene_text("a 1, b 1", [
            f"first = {stop}",
            "second = EndStop, shaft: b, lower: -9, upper: 2, restitution: 0.8",
            "g = KinematicRatio, shafts: [a, b], ratio: 2"], "initial: {velocity: [1, 2]}")
        for scene, right in ((one, 0.0), (gear, -0.8)):
            (header, rows), _ = self.simulate(scene, 1.5, 1)
            self.assertAlmostEqual(float(rows[-1][header.index("a/velocity")]), right, delta=1e-9)
        (self.folder / "it.yaml").write_text(one)
        done = call(SIMULATE, self.folder / "it.yaml", "--duration", 1, "--set", "initial/angle=[1.25]")
        self.assertIn("initial/angle: the start lies 0.25 rad beyond 'stop/upper'", done.stderr)
        # Not even a tolerance of 1e-13 misses one: -g t + 0.5/9 (3 t - sin 3 t) falls 1 rad.
        ball = scene_text("a 1", ["q on a: -9.81 + 0.5*sin(3*t)", "s = EndStop, shaft: a, lower: 0, restitution: 0.8"],
                          "initial: {angle: [HEIGHT]}")
        tight = [f"--set=solver/{kind}_tolerance=1e-13" for kind in ("relative", "absolute")]
        for n in range(16):
            _, events = self.simulate(ball.replace("HEIGHT", repr(1.0 + 0.001 * n)), 0.5, 1, *tight)
            self.assertGreater(float(events[0][5]), 7.0)

    def test_a_lock_whose_row_comes_near_to_a_variators(self):
        # The brake and the variator hold x0 and x1, whatever the clutch between these does.
        scene = scene_text("x0 0.731, x1 0.572, x2 1.494", [
            "q5 on x2: 41.5*sin(11.0*t + 1.7)",
            "g7 = KinematicRatio, shafts: [x1, x0], ratio: 1.31 + 0.06*sin(4.7*t)",
            "c8 = Clutch, shafts: [x1, x0], ratio: 0.9 + 0.19*sin(4.7*t), capacity: 12.0",
            "c9 = Clutch, shafts: [x2, x0], capacity: 4.5",
            "c10 = Brake, shaft: x0, capacity: 41.2"], "principle: gauss")
        times = [0.1 * n for n in range(1, 51)]
        alone = variator_sim.simulate(scene, 5.0, times=times, overrides={"c8/capacity": 0.0})
        for order in ("c8, c9, c10", "c10, c9, c8"):
            result = variator_sim.simulate(scene.replace("c8, c9, c10", order), 5.0, times=times)
            for n in range(len(times)):
                self.assertAlmostEqual(result["x0/velocity"][n], 0.0, delta=1e-12)
                self.assertAlmostEqual(result["x2/velocity"][n], alone["x2/velocity"][n], delta=1e-7)

    def test_a_gear_and_a_freewheel_of_nearly_the_same_ratio(self):
        # Backwards they lock each other: where the spring has stopped both shafts they stay.
        scene = scene_text("a 1.1004, b 2.3882", [
            "qa on a: 0.7015-0.2718*w_a*abs(w_a)",
            "qb on b: -6.1144*phi_b",
            "fr = Friction, shaft: a, coulomb: 0.726",
            "g = KinematicRatio, shafts: [b, a], ratio: 1.2025, efficiency: {driving: 0.8348, driven: 0.8529}",
            "stop = EndStop, shaft: a, lower: -0.4345, upper: 0.6765, restitution: 0.4136",
            "ow = OneWayClutch, shafts: [a, b], ratio: RATIO"],
            "principle: gauss", "initial: {velocity: [0.1786, 1.0837], project: true}")
        for n in range(6):
            result = variator_sim.simulate(scene.replace("RATIO", repr(1.2097 - 0.0007 * n)), 5.0, times=[1.0, 5.0])
            self.assertAlmostEqual(result["b/velocity"][0], 0.18010318, delta=1e-8)
            self.assertEqual(result["b/velocity"][1], 0.0)
            self.assertEqual({event["to"] for event in result.events[-3:]}, {"stuck"})

    def test_what_holds_more_at_rest_sticks_beside_losses_too(self):
        # Either the brake holds 66.8 of its 70.2 N m, or the clutch between engine and mg1 holds.
        lines = {
            "p": "p of order 1: w_mg1 + 3.17*w_ring - 4.17*w_engine",
            "g": "g = KinematicRatio, shafts: [ring, mg2], ratio: 2.35, efficiency: {driving: 0.93, driven: 0.94}",
            "m": "motor on engine: 92.07", "l": "load on mg1: 11.1",
            "b": "brake = Brake, shaft: mg1, capacity: 58.5, static: 1.2",
            "c": "clutch = Clutch, shafts: [engine, mg1], capacity: 48"}
        for order in "mlbcpg", "mlbcgp", "cbmlpg", "cbmlgp":
            for principle in ("gauss", "generalized_gauss"):
                text = scene_text("engine 0.281, mg1 0.05, ring 0.172, mg2 0.043", [lines[name] for name in order],
                                  f"principle: {principle}")
                result = variator_sim.simulate(text, 0.01, times=[0.0], columns="state,elements")
                self.assertEqual((result["brake/mode"][0], result["clutch/mode"][0]), (0.0, -1.0))
                self.assertAlmostEqual(result["engine/acceleration"][0], 43.18540703, delta=1e-7)

    def test_formulas_that_only_touch_their_bends(self):
        # 1.725 w' = sin(om t) - 0.1 w: the clamp has nothing to do.
        scene = scene_text("a 1.5, b 0.9", [
            'q = ExpressionTorque, shaft: a, torque: "clamp(sin(om*t), -1, 1) - 0.1*w_a", parameters: {om: 2.5}',
            "g = KinematicRatio, shafts: [a, b], ratio: 0.5"])
        r = 0.1 / 1.725
        for n in range(40):
            om = 2.5 + 0.01 * n
            for principle in ("gauss", "generalized_gauss"):
                result = variator_sim.simulate(scene + f"principle: {principle}\n", 6.0, times=[6.0],
                                               overrides={"q/parameters/om": om})
                right = (r * math.sin(6 * om) - om * math.cos(6 * om) + om * math.exp(-6 * r)) / (om**2 + r**2) / 1.725
                self.assertAlmostEqual(result["a/velocity"][0], right, delta=1e-6)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "modes_test", ModesTest)
