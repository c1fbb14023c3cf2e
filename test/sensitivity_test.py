#!/usr/bin/python3
"""Derivatives of runs against central differences of runs at tolerances of 1e-12, and against closed forms."""

import csv
import io
import math
import os
import random

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy as np
import roslib.packages
import rosunit
import variator_sim
import yaml
from support.simulate import SimulateTestCase

TIGHT = {"solver/relative_tolerance": 1e-12, "solver/absolute_tolerance": 1e-12}
#: Random scenes; more on request.
SCENES = int(os.environ.get("VARIATOR_SIM_RANDOM_SYSTEMS", "10"))
COLUMNS = "state,outputs,states"


def value_at(scene, path):
    for key in path.split("/"):
        scene = scene[int(key)] if isinstance(scene, list) else scene[key]
    return scene


def moved(commands, path, by):
    topic, at = path.split("@")
    return [(t, name, v + (by if name == topic and abs(t - float(at)) < 1e-9 else 0.0)) for t, name, v in commands]


def difference(scene, path, duration, times, commands):
    """d columns/d path by central differences and one extrapolation: columns, values, and the samples at which both
    differences agree, those between whose runs no event lies."""
    value = 1.0 if "@" in path else value_at(scene, path)
    h = 3e-4 * (abs(value) or 1.0)

    def run(by):
        is_command = "@" in path
        return variator_sim.simulate(scene, duration, times=times, columns=COLUMNS,
                                     commands=moved(commands, path, by) if is_command else commands,
                                     overrides={**TIGHT, **({} if is_command else {path: value + by})})
    wide = (run(h).values - run(-h).values) / (2.0 * h)
    up, down = run(0.5 * h), run(-0.5 * h)
    narrow = (up.values - down.values) / h
    size = np.maximum(np.abs(narrow).max(axis=0), 1e-3)
    return up.columns, (4.0 * narrow - wide) / 3.0, (np.abs(wide - narrow) < 1e-3 * size).all(axis=1)


class SensitivityTest(SimulateTestCase):
    def check(self, scene, paths, duration, commands=(), bound=1e-6, count=23):
        # (No sample lies on an event.)
        times = np.linspace(0.0, duration, count) + 1e-3 * math.sqrt(0.5)
        run = variator_sim.simulate(scene, times[-1], times=times, commands=list(commands), columns=COLUMNS,
                                    gradient=paths)
        for path in paths:
            columns, expected, is_known = difference(scene, path, times[-1], times, list(commands))
            self.assertGreaterEqual(is_known.sum(), count - 2)
            seen = 0
            for column, values in zip(columns, expected.T):
                name = f"d({column})/d({path})"
                if name not in run.columns:
                    continue
                seen += 1
                size = max(np.abs(values).max(), 1e-3)
                with self.subTest(derivative=name):
                    self.assertLess(np.abs(run[name] - values)[is_known].max() / size, bound)
            self.assertGreaterEqual(seen, 5)

    def make_random(self, seed):
        """Two shafts, a law with a kink, a command, and a clutch, a freewheel, a stop or a constraint."""
        rng = random.Random(seed)
        number = lambda low, high: round(rng.uniform(low, high), 3)
        hold = rng.choice([{"hold": "zero_order"}, {"hold": "first_order_lag", "time_constant": number(0.1, 0.5)},
                           {"hold": "rate_limit", "rate": number(3.0, 6.0)},
                           {"hold": "first_order_hold", "period": number(0.3, 0.5)},
                           {"hold": "second_order_lag", "time_constant": number(0.1, 0.3)}])
        scene = {"shafts": ["a", "b"], "a": {"inertia": number(0.5, 2)}, "b": {"inertia": number(0.5, 2)},
                 "torques": ["m", "d", "x"], "principle": rng.choice(["gauss", "generalized_gauss"]),
                 "m": {"type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "m", "initial": number(1, 3), **hold},
                 "d": {"type": "variator_sim/ExpressionTorque", "shaft": "b", "parameters": {"c": number(0.1, 0.5),
                                                                                            "k": number(1.2, 2)},
                       "torque": "-c*w2*abs(w2) - if(w2 > k, 2*(w2 - k), 0) + sin(2*t)"},
                 "x": {"type": "variator_sim/ElasticCoupling", "shafts": ["a", "b"], "stiffness": number(3, 9),
                       "damping": number(0.1, 0.5)},
                 "states": ["work"], "work": {"rate": "m_power", "initial": 0.5},
                 "outputs": ["y"], "y": {"expression": "w_a*phi_b"},
                 "initial": {"angle": [0, 0], "velocity": [number(0.5, 1.5), number(0.3, 1.0)]}}
        paths = ["a/inertia", "m/initial", "m@0.4", "d/parameters/k", "initial/velocity/1", "work/initial"]
        paths += ["m/" + key for key in hold if key != "hold"]
        kind = ["clutch", "freewheel", "stop", "second order", "first order", "event"][seed % 6]
        if kind == "clutch":
            scene["x"] = {"type": "variator_sim/Clutch", "shafts": ["a", "b"], "capacity": number(2, 4)}
            paths.append("x/capacity")
        elif kind == "freewheel":
            scene["x"] = {"type": "variator_sim/OneWayClutch", "shafts": ["a", "b"]}
        elif kind == "stop":
            scene["torques"].append("stop")
            scene["stop"] = {"type": "variator_sim/EndStop", "shaft": "b", "lower": -1, "upper": number(0.8, 1.6),
                             "restitution": number(0.3, 0.7)}
            paths += ["stop/upper", "stop/restitution"]
        elif kind == "event":
            scene.update({"variables": ["gear"], "gear": {"initial": 1.0}, "events": ["up"], "up": {
                "when": "phi_b - 0.9", "direction": "rising", "set": {"gear": "gear + 0.5", "work": "0.5*work"}}})
            scene["d"]["torque"] += " + gear - 1"
            paths.append("gear/initial")
        elif kind == "second order":
            scene.update({"constraints": ["v"], "v": {"type": "variator_sim/ExpressionConstraint", "order": 2,
                          "expression": "tau*(e2 - u*e1) + w2 - u*w1 + 0.01*e1^2",
                          "parameters": {"tau": number(0.2, 0.5), "u": number(0.4, 0.8)}}})
            paths += ["v/parameters/tau", "v/parameters/u"]
        else:
            scene.update({"constraints": ["v"], "v": {"type": "variator_sim/ExpressionConstraint", "order": 1,
                          "expression": "w2 - (u + 0.1*t)*w1", "parameters": {"u": number(0.4, 0.8)}}})
            scene["initial"].update({"project": True})
            paths.append("v/parameters/u")
        return kind, scene, paths

    def test_random_scenes(self):
        for seed in range(SCENES):
            kind, scene, paths = self.make_random(seed)
            with self.subTest(seed=seed, kind=kind):
                self.check(scene, paths, 2.0, [(0.4, "m", 4.0), (1.1, "m", 1.5)])

    def test_kink_behind_a_short_step(self):
        """The end of a step behind a kink, moved by its derivatives alone, lay before the kink again for some k."""
        scene = {"shafts": ["a", "b"], "torques": ["load", "drive", "clutch"],
                 "a": {"inertia": {"mean": 1.913, "harmonics": [{"order": 1, "cos": 0.054, "sin": 0.152}]}},
                 "b": {"inertia": 1.831},
                 "load": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "-1.6019", "reaction_on": "b"},
                 "drive": {"type": "variator_sim/ExpressionTorque", "shaft": "b", "torque": "clamp(M*sin(3*t), -k, k)",
                           "parameters": {"M": 5.351, "k": 1.607}},
                 "clutch": {"type": "variator_sim/Clutch", "shafts": ["b", "a"], "capacity": 4.955, "ratio": 1.372},
                 "initial": {"angle": [-0.26, -0.162], "velocity": [4.573, 5.998]}}
        for k in np.linspace(1.2, 2.2, 101).round(4).tolist() + [1.607]:
            scene["drive"]["parameters"]["k"] = k
            with self.subTest(k=k):
                self.check(scene, ["drive/parameters/k"], 0.3, count=8)

    def test_table(self):
        """A table's values and points, smooth and of straight lines."""
        for interpolation in ("smooth", "linear"):
            scene = {"shafts": ["a"], "a": {"inertia": 1.0}, "torques": ["m"], "tables": ["tab"],
                     "tab": {"x": [0, 1, 2, 4, 8], "values": [1.0, 1.2, 0.9, 0.8, 0.1], "interpolation": interpolation},
                     "m": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "k*tab(w_a)",
                           "parameters": {"k": 1.0}}}
            self.check(scene, ["tab/values/2", "tab/x/2", "m/parameters/k"], 5.0)

    def test_closed_form(self):
        """J w' = u + v - c w with commands u and v at 0: w(t) = F/c + (w0 - F/c) exp(-c t / J), F = u + v."""
        J, c, u, v, w0 = 2.0, 0.7, 0.4, 0.6, 3.0
        scene = {"shafts": ["a"], "a": {"inertia": J}, "torques": ["m", "n", "d"],
                 "m": {"type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "u", "hold": "zero_order"},
                 "n": {"type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "v", "hold": "zero_order"},
                 "d": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "-c*w1", "parameters": {"c": c}},
                 "initial": {"velocity": [w0]}, "solver": {"relative_tolerance": 1e-11, "absolute_tolerance": 1e-11}}
        paths = ["a/inertia", "d/parameters/c", "u@0", "v@0", "initial/velocity/0"]
        run = variator_sim.simulate(scene, 3.0, rate=10, commands=[(0, "u", u), (0, "v", v)], gradient=paths)
        t = run.time
        decay = np.exp(-c * t / J)
        u += v
        expected = {"a/inertia": (w0 - u / c) * decay * c * t / J ** 2,
                    "d/parameters/c": -u / c ** 2 * (1 - decay) - (w0 - u / c) * decay * t / J,
                    "u@0": (1 - decay) / c, "v@0": (1 - decay) / c, "initial/velocity/0": decay}
        for path, values in expected.items():
            np.testing.assert_allclose(run[f"d(a/velocity)/d({path})"], values, atol=1e-11)

    def test_equal_commands(self):
        """Commands of the value that the input has change nothing, but have derivatives."""
        scene = {"shafts": ["a"], "a": {"inertia": 1.0}, "torques": ["m"], "m": {
            "type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "u", "hold": "zero_order", "initial": 1.0}}
        run = variator_sim.simulate(scene, 3.0, times=[3.0], commands=[(1.0, "u", 1.0), (2.0, "u", 1.0)],
                                    gradient=["u@1.0", "u@2.0"])
        self.assertAlmostEqual(run["d(a/velocity)/d(u@1.0)"][0], 1.0, 12)
        self.assertAlmostEqual(run["d(a/velocity)/d(u@2.0)"][0], 1.0, 12)
        self.assertAlmostEqual(run["d(a/angle)/d(u@1.0)"][0], 1.5, 12)

    def test_commands_of_one_instant(self):
        """On e_a^2 + e_b^2 = 4 both move on one straight line, in any order. At rest before, dQ = (k u, -3 v) at t = 1:
        references of quadruple precision by differences of the jump map."""
        scene = {"shafts": ["a", "b"], "a": {"inertia": 1.0}, "b": {"inertia": 1.0}, "inputs": ["u", "v"],
                 "u": {"topic": "u", "initial": 0.0}, "v": {"topic": "v", "initial": 0.0}, "torques": ["m", "l"],
                 "m": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "k*u", "parameters": {"k": 2.0}},
                 "l": {"type": "variator_sim/ExpressionTorque", "shaft": "b", "torque": "-3*v"}, "constraints": ["c"],
                 "c": {"type": "variator_sim/AccelerationMagnitude", "shafts": ["a", "b"], "magnitude": 2.0},
                 "initial": {"acceleration": [0.5, math.sqrt(3.75)]}}
        commands = [(1.0, "u", 1.0), (1.0, "v", 1.0)]
        for order in (commands, commands[::-1]):
            run = variator_sim.simulate(scene, 2.0, times=[1.0, 2.0], commands=order, columns=COLUMNS,
                                        gradient=["m/parameters/k", "u@1", "v@1"])
            for path, value in (("m/parameters/k", -0.0820173557), ("u@1", -0.1640347115), ("v@1", -0.4742862038)):
                np.testing.assert_allclose(run[f"d(a/acceleration)/d({path})"], value, atol=1e-8)
            self.check(scene, ["m/parameters/k", "u@1", "v@1"], 2.0, order)

    def test_timeout(self):
        """J w' = u, u = 2 from 0.2 s on until it falls to 0 at 0.2 s + timeout: dw = 2 dtimeout."""
        scene = {"shafts": ["a"], "a": {"inertia": 1.0}, "torques": ["m"], "m": {
            "type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "u", "initial": 1.0, "timeout": 0.5,
            "on_timeout": "zero"}}
        run = variator_sim.simulate(scene, 2.0, times=[0.5, 1.0, 2.0], commands=[(0.2, "u", 2.0)],
                                    gradient=["m/timeout", "u@0.2"])
        np.testing.assert_allclose(run["d(a/velocity)/d(m/timeout)"], [0.0, 2.0, 2.0], atol=1e-9)
        np.testing.assert_allclose(run["d(a/angle)/d(m/timeout)"], [0.0, 0.6, 2.6], atol=1e-9)
        np.testing.assert_allclose(run["d(a/velocity)/d(u@0.2)"], [0.3, 0.5, 0.5], atol=1e-9)

    def test_timeouts_beside_commands(self):
        """Timeouts of all holds, two of them of one command's instant, and one that a command at its instant ends."""
        for hold in ({"hold": "zero_order"}, {"hold": "first_order_lag", "time_constant": 0.2},
                     {"hold": "rate_limit", "rate": 3.0}, {"hold": "second_order_lag", "time_constant": 0.1}):
            scene = {"shafts": ["a", "b"], "a": {"inertia": 1.0}, "b": {"inertia": 2.0}, "torques": ["m", "n", "l"],
                     "m": {"type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "u", "initial": 1.0,
                           "timeout": 0.5, "on_timeout": "zero"},
                     "n": {"type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "n", "initial": 1.0, "max": 1.75,
                           "timeout": 0.4, "on_timeout": "zero", **hold},
                     "l": {"type": "variator_sim/ExpressionTorque", "shaft": "b", "torque": "-c*w_b",
                           "parameters": {"c": 0.5}},
                     "constraints": ["g"], "g": {"type": "variator_sim/KinematicRatio", "shafts": ["a", "b"],
                                                 "ratio": {"times": [0, 1, 2], "values": [0.4, 0.8, 0.6]}},
                     "principle": "gauss", "initial": {"velocity": [2.0, 0.8]}}
            with self.subTest(hold["hold"]):
                self.check(scene, ["n/timeout", "n/max", "m/timeout", "l/parameters/c"], 2.0,
                           [(0.2, "u", 3.0), (0.3, "n", 2.0), (0.3, "u", 2.5), (1.2, "n", 1.5), (1.4, "n", 1.0)])

    def test_refuses_what_has_no_derivative(self):
        scene = {"shafts": ["a"], "a": {"inertia": 1.0}, "torques": ["m"],
                 "m": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "1 - w_a"},
                 "solver": {"maximum_step": 0.5, "relative_tolerance": 1e-9}}
        for paths in (["solver/maximum_step"], ["a/inertia", "solver/relative_tolerance"],
                      ["a/inertia", "solver/maximum_step", "initial/velocity/0"]):
            scene["initial"] = {"velocity": [1.0]}
            with self.subTest(paths), self.assertRaisesRegex(variator_sim.SceneError, "solver/.*has no derivative"):
                variator_sim.simulate(scene, 1.0, gradient=paths)

    def test_application_scenes_to_their_ends(self):
        # Their couplings twist by the small difference of large angles: rounding asks for coarser steps here.
        fine = {key: 1e-10 for key in TIGHT}
        for name, path, by in (("ship_power_unit", "screw/inertia", 4.0), ("starting_system", "fan/inertia", 0.06)):
            place = os.path.join(roslib.packages.get_pkg_dir("variator_sim"), "config/applications", name)
            with open(place + ".csv", encoding="utf-8") as file:
                rows = [row for row in csv.reader(file) if not row[0].startswith(("#", "time"))]
            commands = [(float(t), topic, float(v)) for t, topic, v in rows]
            with open(place + ".yaml", encoding="utf-8") as file:
                scene = yaml.safe_load(file)
            settings = {"rate": 1.0, "commands": commands, "columns": COLUMNS}
            run = variator_sim.simulate(scene, 60.0, gradient=[path], **settings)
            value = value_at(scene, path)
            up, down = (variator_sim.simulate(scene, 60.0, overrides={**fine, path: value + by * side}, **settings)
                        for side in (1.0, -1.0))
            for column in (it for it in up.columns if it.endswith(("/velocity", "/angle"))):
                expected = (up[column] - down[column]) / (2.0 * by)
                size = max(np.abs(expected).max(), 1e-3)
                with self.subTest(scene=name, column=column):
                    self.assertLess(np.abs(run[f"d({column})/d({path})"] - expected).max() / size, 1e-4)

    def test_lag_at_rest(self):
        """An input at rest whose derivative moves: J w' = u, u a critical lag of the command, which changes nothing:
        dw(t) = ((t - 1) - 2 tau + exp(-x) ((t - 1) + 2 tau)) / J, x = (t - 1)/tau."""
        tau, J = 0.1, 2.0
        scene = {"shafts": ["a"], "a": {"inertia": J}, "torques": ["m"], "m": {
            "type": "variator_sim/CommandedTorque", "shaft": "a", "topic": "u", "hold": "second_order_lag",
            "time_constant": tau, "initial": 1.0}}
        run = variator_sim.simulate(scene, 5.0, rate=3, commands=[(1.0, "u", 1.0)], gradient=["u@1.0"])
        after = np.maximum(run.time - 1.0, 0.0)
        expected = (after - 2 * tau + np.exp(-after / tau) * (after + 2 * tau)) / J
        np.testing.assert_allclose(run["d(a/velocity)/d(u@1.0)"], expected, atol=1e-9)

    def test_command_line(self):
        scene = self.write("scene.yaml", "shafts: [a]\na: {inertia: \"2 kg m^2\"}\ntorques: [m]\nm: {type: "
                           "variator_sim/ExpressionTorque, shaft: a, torque: \"2 + 2\"}\n")
        done = self.check_simulate(scene, "--duration", "1", "--rate", "1", "--columns", "state,energy",
                                   "--sensitivity", "a/inertia")
        rows = list(csv.reader(io.StringIO(done.stdout)))
        self.assertEqual(rows[0][-5:-3], ["d(a/angle)/d(a/inertia)", "d(a/velocity)/d(a/inertia)"])
        self.assertAlmostEqual(float(rows[-1][-4]), -1.0, 10)  # w = 4 t / J
        for path, word in {"a/inertja": "a/inertia", "m/torque": "a number", "m@1": "topic", "a": "a number",
                           "torques": "a number"}.items():
            with self.subTest(path=path):
                self.check_refused([scene, "--duration", "1", "--sensitivity", path], word)
        self.check_refused([scene, "--duration", "1", "--sensitivity", "a/inertia", "--output", "x.bag"], "--sensitivity")

    def test_python_refuses(self):
        scene = {"shafts": ["a"], "a": {"inertia": 1.0}}
        with self.assertRaisesRegex(ValueError, "gradient"):
            variator_sim.simulate(scene, 1.0, gradient=["a/inertia"], controller=lambda sample: None)
        with self.assertRaisesRegex(variator_sim.SceneError, "a/inertia"):
            variator_sim.simulate(scene, 1.0, gradient=["a/inertja"])


if __name__ == "__main__":
    rosunit.unitrun("variator_sim", "sensitivity_test", SensitivityTest)
