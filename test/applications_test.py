#!/usr/bin/python3
"""Every application scene runs its duty cycle of 60 s: no stop, small residuals, plausible motion."""

import csv
import io
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
SCENES = FOLDER / "config/applications"
SECONDS = 60


class ApplicationsTest(TestCase):

    @classmethod
    def setUpClass(cls):
        cls.runs = {}

    def samples(self, name):
        """Samples of the scene with its commands, ten a second, as columns of floats."""
        if name not in self.runs:
            result = subprocess.run(
                [SIMULATE, SCENES / f"{name}.yaml", "--duration", str(SECONDS), "--rate", "10",
                 "--columns", "state,elements,inputs,outputs,energy",
                 "--commands", SCENES / f"{name}.csv"],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=100, check=False,
                env=dict(os.environ, ROS_MASTER_URI="http://localhost:1"))
            self.assertEqual(result.returncode, 0, result.stderr)
            # Its ratio alone follows a speed under `gauss`.
            self.assertEqual(result.stderr.count("take or give energy"), int(name == "vbelt_vehicle"), result.stderr)
            rows = list(csv.DictReader(io.StringIO(result.stdout)))
            self.runs[name] = {key: [float(row[key]) for row in rows] for key in rows[0]}
        return self.runs[name]

    def check_between(self, values, lowest, highest):
        self.assertGreaterEqual(min(values), lowest)
        self.assertLessEqual(max(values), highest)

    def test_every_scene_has_commands_and_a_launch_file(self):
        names = {path.stem for path in SCENES.glob("*.yaml")}
        self.assertEqual(names, {"starting_system", "ship_power_unit", "diesel_locomotive",
                                 "machine_tool", "vbelt_vehicle", "car"})
        for name in names:
            self.assertTrue((SCENES / f"{name}.csv").exists(), name)
            self.assertTrue((FOLDER / f"launch/{name}.launch").exists(), name)

    def test_every_scene_runs_to_its_end_on_its_constraint(self):
        for path in sorted(SCENES.glob("*.yaml")):
            with self.subTest(scene=path.stem):
                run = self.samples(path.stem)
                self.assertEqual(run["time"][-1], SECONDS)
                shafts = [key for key in run if key.endswith("/velocity")]
                self.assertGreaterEqual(len(shafts), 2)
                for key in shafts:
                    self.assertGreater(max(run[key]) - min(run[key]), 1.0, key)
                    self.assertGreater(run[key.replace("velocity", "angle")][-1], 100.0, key)
                for key in run:
                    if key.endswith("/residual"):
                        # Against speeds up to 400 rad/s and 1/s of a ratio.
                        self.check_between(run[key], -1e-10, 1e-10)

    def test_starting_system_follows_the_imposed_jerk(self):
        run = self.samples("starting_system")
        speed = dict(zip(run["time"], run["motor/velocity"]))
        self.assertAlmostEqual(speed[1.5], 0.0, delta=1e-5)
        # 155 rad/s = (jerk T / 2) (14 s); half of it in the middle of the start
        self.assertAlmostEqual(speed[11.0], 77.5, delta=1e-5)
        self.assertAlmostEqual(speed[30.0], 155.0, delta=1e-5)
        self.assertAlmostEqual(speed[60.0], 0.0, delta=1e-4)
        self.check_between(run["motor/reaction_torque"], -1000.0, 1000.0)
        self.check_between(run["fan/velocity"], -0.01, 156.0)
        # C = (1, 0): nothing acts on the fan but the coupling
        self.check_between(run["fan/reaction_torque"], -1e-3, 1e-3)

    def test_ship_runs_in_the_engines_range_with_a_few_percent_of_creep(self):
        run = self.samples("ship_power_unit")
        self.check_between(run["engine/velocity"], 50.0, 110.0)
        self.check_between(run["screw/applied_torque"], -40e3, -4e3)
        slip = [1.0 - screw / (0.22 * shaft)
                for screw, shaft in zip(run["screw/velocity"][20:], run["input/velocity"][20:])]
        self.check_between(slip, 0.005, 0.04)
        self.check_between(run["engine/reaction_torque"], -0.01, 0.01)

    def test_locomotive_accelerates_like_a_train(self):
        run = self.samples("diesel_locomotive")
        radius = 0.525
        pulling = [radius * a for t, a in zip(run["time"], run["axle/acceleration"]) if 3 < t < 51]
        self.check_between(pulling, 0.1, 0.33)
        self.check_between(run["engine/velocity"], 70.0, 85.0)
        # below the adhesion of 120 t
        self.check_between(run["axle/reaction_torque"], -1.0, 0.2 * 120e3 * 9.81 * radius)
        # a variator without loss
        for driving, driven, w1, w2 in zip(run["engine/reaction_torque"],
                                           run["axle/reaction_torque"],
                                           run["engine/velocity"], run["axle/velocity"]):
            self.assertAlmostEqual(driving * w1 + driven * w2, 0.0, delta=1e-3)

    def test_spindle_dips_by_a_few_percent_under_the_cut(self):
        run = self.samples("machine_tool")
        motor = dict(zip(run["time"], run["motor/velocity"]))
        self.check_between([motor[16.0] / motor[14.0]], 0.92, 0.99)
        spindle = dict(zip(run["time"], run["spindle/velocity"]))
        self.assertAlmostEqual(spindle[41.9] / motor[41.9], 0.205 / 0.75, delta=1e-3)
        self.check_between(run["motor/applied_torque"], -20.0, 70.0)
        self.assertAlmostEqual(spindle[60.0], 0.0, delta=1e-3)

    def test_car_gathers_speed_and_the_ratio_follows_the_engine(self):
        run = self.samples("vbelt_vehicle")
        metres = 0.27 / 4.0
        self.check_between([metres * w for w in run["pulley/velocity"]], 5.0, 28.0)
        self.check_between([metres * a for a in run["pulley/acceleration"]], -0.5, 1.2)
        for w1, w2 in zip(run["engine/velocity"], run["pulley/velocity"]):
            self.assertAlmostEqual(w2, w1 * (0.5 + 0.5 * w1**2 / (220.0**2 + w1**2)), delta=1e-9)

    def test_car_is_a_scene_of_forty_lines(self):
        self.assertLessEqual(len((SCENES / "car.yaml").read_text(encoding="utf-8").splitlines()), 40)

    def test_car_pulls_away_shifts_overtakes_brakes_and_climbs(self):
        run = self.samples("car")
        at = {round(t, 1): n for n, t in enumerate(run["time"])}
        speed = [3.6 * v for v in run["road/speed"]]                    # km/h
        self.check_between(speed, -1e-9, 115.0)
        self.check_between([0.3 * a for a in run["wheels/acceleration"]], -5.0, 3.5)
        # It stands with the clutch open, pulls away with a slipping one, and does not stall.
        self.assertEqual(speed[at[1.0]], 0.0)
        self.check_between(run["engine/velocity"], 80.0, 600.0)
        self.assertGreater(run["clutch/slip"][at[1.4]], 50.0)
        self.check_between(run["clutch/slip"][at[3.0]:at[56.0]], -1.0, 2.0)
        # The ratio is what is commanded; reaching 75 km/h takes some 14 s.
        self.check_between(run["variator/ratio"], 0.07 - 1e-12, 0.31)
        self.check_between([speed[at[14.0]]], 70.0, 80.0)
        # Full throttle in a low ratio, then back.
        self.check_between([speed[at[25.0]] - speed[at[20.0]]], 20.0, 35.0)
        self.check_between([0.3 * run["wheels/acceleration"][at[29.0]]], -0.3, 0.3)
        # The brake takes the most of what is lost there.
        self.check_between(run["brake/power"][at[31.0]:at[33.0]], -100e3, -50e3)
        # The hill is where it is, and is met with more torque.
        metres = [0.3 * phi for phi in run["wheels/angle"]]
        for distance, grade in zip(metres, run["outputs/grade"]):
            if distance < 650.0 or distance > 940.0:
                self.assertAlmostEqual(grade, 0.0, delta=1e-12)
            elif 720.0 < distance < 870.0:
                self.assertAlmostEqual(grade, 0.08, delta=1e-12)
        self.assertAlmostEqual(run["outputs/grade"][at[40.0]], 0.08, delta=1e-12)
        self.assertGreater(run["combustion/engine/torque"][at[40.0]], 100.0)
        # It stands again, the engine idling.
        self.check_between([speed[-1]], -1e-3, 1e-3)
        self.check_between([run["engine/velocity"][-1]], 84.0, 86.0)

    def test_car_has_an_energy_account_without_reactions(self):
        run = self.samples("car")
        self.check_between(run["power/reactions"], -1e-6, 1e-6)
        self.check_between(run["energy/reactions"], -1e-3, 1e-3)
        # Power in is power out, and the elements' powers add up.
        for n in range(len(run["time"])):
            self.assertAlmostEqual(run["gearbox/reaction_torque"][n] * run["gearbox/velocity"][n]
                                   + run["wheels/reaction_torque"][n] * run["wheels/velocity"][n],
                                   0.0, delta=1e-6)
            total = sum(run[f"{element}/power"][n]
                        for element in ("combustion", "clutch", "brake", "road"))
            self.assertAlmostEqual(total, run["power/applied"][n], delta=1e-6)
            self.assertLessEqual(run["clutch/power"][n], 0.0)
            self.assertLessEqual(run["brake/power"][n], 0.0)

    def hold(self, name, *words):
        """Samples and events, (element, from, to), of one of the scenes with elements that hold."""
        with tempfile.TemporaryDirectory() as folder:
            events = pathlib.Path(folder, "events.csv")
            result = subprocess.run(
                [SIMULATE, SCENES / f"holding/{name}.yaml", "--duration", str(SECONDS), "--rate", "10", "--columns",
                 "state,elements,outputs,states,variables", "--events", events, *words],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=100, check=False)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.assertLessEqual(len((SCENES / f"holding/{name}.yaml").read_text().splitlines()), 60)
            rows = list(csv.DictReader(io.StringIO(result.stdout)))
            changes = [tuple(line.split(",")[1:4]) for line in events.read_text().splitlines()[1:]]
            return {key.split(" ")[0]: [float(row[key]) for row in rows] for key in rows[0]}, changes

    def test_starting_clutch_locks_and_lets_go(self):
        run, changes = self.hold("starting_clutch", "--commands", SCENES / "starting_system.csv")
        self.assertEqual(changes, [("clutch", "free", "backward"), ("bearings", "stuck", "forward"),
                                   ("clutch", "backward", "stuck"), ("clutch", "stuck", "backward"),
                                   ("clutch", "backward", "free")])
        self.check_between(run["states/clutch_temperature"], 0.0, 80.0)
        self.assertAlmostEqual(run["motor/velocity"][300], run["fan/velocity"][300], delta=1e-9)  # at 30 s

    def test_the_driven_car_follows_its_cycle_in_five_gears(self):
        run, changes = self.hold("car_driven")
        off = [abs(a - b) for a, b in zip(run["outputs/speed"], run["outputs/wanted"])]
        self.assertLess(max(off), 6.0)  # km/h, inside steps that end at a shift, too
        self.check_between(run["gearbox/velocity"], -1e-3, 261.0)
        for name in ("states/fuel", "states/distance"):
            self.assertTrue(all(b >= a for a, b in zip(run[name], run[name][1:])), name)
        self.assertAlmostEqual(run["states/distance"][-1], 0.3 * run["wheels/angle"][-1], delta=1e-8)
        self.assertEqual(max(run["variables/gear"]), 5.0)
        self.assertEqual([change[0] for change in changes].count("up"), 6)
        self.assertEqual(run["brake/mode"][-1], 0.0)  # it holds the car

    def test_a_torque_converter_from_a_file_locks_in_high_gears(self):
        run, changes = self.hold("car_converter")
        off = [abs(a - b) for a, b in zip(run["outputs/speed"], run["outputs/wanted"])]
        self.assertLess(max(off), 7.0)  # km/h
        self.assertEqual(max(run["variables/gear"]), 4.0)
        self.assertGreaterEqual(changes.count(("lock_up", "backward", "stuck")), 1)
        # Behind the fluid the pump and the runner have the torques of the file's straight lines.
        points = [[0, 0.0028, 2.1], [0.4, 0.0027, 1.6], [0.7, 0.0023, 1.2], [0.86, 0.0017, 1], [1, 0, 1]]
        for k, engine in enumerate(run["engine/velocity"]):
            ratio = run["turbine/velocity"][k] / engine
            if not 0.0 <= ratio < 1:
                continue
            low, high = next((a, b) for a, b in zip(points, points[1:]) if ratio <= b[0])
            capacity, gain = (y + (ratio - low[0]) / (high[0] - low[0]) * (z - y) for y, z in zip(low[1:], high[1:]))
            self.assertAlmostEqual(run["pump/engine/torque"][k], -capacity * engine ** 2, delta=1e-9)
            self.assertAlmostEqual(run["runner/turbine/torque"][k], gain * capacity * engine ** 2, delta=1e-9)

    def test_an_electric_motor_is_limited_by_its_temperature(self):
        run, changes = self.hold("car_electric")
        self.assertIn(("warn", "below", "above"), changes)
        self.check_between(run["states/temperature"], 40.0, 110.0)
        self.assertLess(min(run["outputs/limit"]), 80.0)  # %
        off = [abs(a - b) for a, b in zip(run["outputs/speed"], run["outputs/wanted"])]
        self.assertLess(max(off[:550]), 4.5)  # km/h, before the winding is too hot for the hill
        self.assertLess(run["states/charge"][-1], -0.4)  # kW h

    def test_wagons_stick_until_the_drawgear_pulls(self):
        run, changes = self.hold("locomotive_sticking", "--commands", SCENES / "diesel_locomotive.csv")
        self.assertEqual(changes, [("journals", "stuck", "forward")])
        self.assertEqual(set(run["wagons/velocity"][:20]), {0.0})
        self.assertGreater(run["wagons/velocity"][-1], 20.0)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "applications_test", ApplicationsTest)
