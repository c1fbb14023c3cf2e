#!/usr/bin/python3
"""Scenes made at random with every law, hold, table and order together. One seed, one scene.

    random_scenes.py SEED [--shafts N]     prints scene and commands

Laws are chosen so that a scene has a motion worth comparing: constraint m always reads shaft m + 1
(so the rows of C stay independent), drives are balanced by resistances, and constraints that say
nothing at rest (PowerFlow, TractionCurve) get shafts that turn.
"""
import argparse
import random

import yaml

import motion

P = "variator_sim/"


class Maker:
    def __init__(self, seed, most_shafts):
        self.r = random.Random(f"independent {seed}")
        self.s = self.r.randint(1, most_shafts)
        self.shafts = [f"s{i + 1}" for i in range(self.s)]
        self.duration = round(self.r.uniform(1.0, 3.0), 3)
        self.holds = {}  # topic: (hold, typical values)
        self.scene = {}
        self.formal = False

    def u(self, a, b, digits=3):
        return round(self.r.uniform(a, b), digits)

    def chance(self, p):
        return self.r.random() < p

    # --- values --------------------------------------------------------------------------------

    def input(self, low, high, holds=None, clamp=True):
        """The keys of a commanded input; remembers what to command."""
        hold = self.r.choice(holds or ["zero_order", "zero_order", "first_order_lag", "rate_limit",
                                       "first_order_hold", "second_order_lag"])
        if self.formal and hold == "zero_order" and holds is None and self.chance(0.5):
            hold = "first_order_lag"
        topic = f"c{len(self.holds) + 1}"
        d = {"topic": topic, "hold": hold, "initial": self.u(low, high)}
        if hold in ("first_order_lag", "second_order_lag"):
            d["time_constant"] = self.u(0.05, 0.6)
        elif hold == "rate_limit":
            d["rate"] = self.u(0.5, 5.0) * (high - low)
            d["rate"] = round(d["rate"], 3) or 0.1
        elif hold == "first_order_hold":
            d["period"] = self.u(0.05, 0.5)
        if clamp and self.chance(0.2):
            d["min"], d["max"] = round(low, 3), round(high, 3)
            d["initial"] = min(max(d["initial"], d["min"]), d["max"])
        if self.chance(0.25):
            d["timeout"] = self.u(0.1, 0.8)
            d["on_timeout"] = self.r.choice(["hold", "zero"]) if low <= 0.0 <= high else "hold"
        self.holds[topic] = (low, high)
        return d

    def table(self, low, high):
        n = self.r.randint(2, 5)
        times = sorted({self.u(-0.2, self.duration) for _ in range(n)})
        if len(times) < 2:
            times = [0.1, 0.9]
        return {"times": times, "values": [self.u(low, high) for _ in times]}

    def value(self, low, high, holds=None):
        kind = self.r.random()
        if kind < 0.35:
            return self.u(low, high)
        return self.table(low, high) if kind < 0.6 else self.input(low, high, holds)

    def number_or_input(self, low, high):
        return self.u(low, high) if self.chance(0.5) else self.input(low, high)

    # --- torques -------------------------------------------------------------------------------

    def expression(self, i):
        """A torque formula for shaft i (1-based), with the kinks and jumps of real laws."""
        r, w, p = self.r, f"w{i}", f"phi{i}"
        other = r.randint(1, self.s)
        a, b, z = self.u(0.2, 3.0), self.u(0.1, 1.0), self.u(1.0, 7.0)
        c = self.u(0.3, 0.95)
        kinds = [
            f"{a}*sin({z}*t) - {b}*{w}",
            f"{a} - {b}*{w}^3/(1+{w}^2)",
            f"-{b}*{w}*abs({w})/(1+0.1*abs({w}))",
            f"{a}*max(0, sin({z}*{p}) - {c}) - {b}*{w}",
            f"{10 * a:g}*max(0, sin({3 * z:.3g}*t) - {c})",
            f"{20 * a:g}*max(0, sin({6 * z:.3g}*t) - {self.u(0.9, 0.995)}) - {b}*{w}",  # narrow pulses
            f"{20 * a:g}*max(0, sin({z}*{p}) - {self.u(0.9, 0.995)}) - {b}*{w}",
            f"min({a}, max(-{a}, {b}*({z} - {w})))",
            f"{a}*tanh({w}/{b}) * -1 + {b}*cos(w{other} - t)",
            f"{a}*abs(sin({z}*{p} + {b})) - {b}*{w}",
            f"{a}*sign(sin({z}*t + {b})) - {b}*{w}",
            f"{a}*sign(sin({z}*{p} + {b})) - {b}*{w}",
            f"{a}*atan2(sin({p}), 2 + cos(phi{other})) - {b}*{w}",
            f"{a}*exp(-({w}/{z})^2) - {b}*{w}",
            f"{a}*sqrt(1+{w}^2) - {b}*{w}^3 + log(2+sin({z}*t))",
            f"k*sinh({b}*cos(phi{other})) - d*{w}*cosh({b}*sin(t)) + pow(1.5+sin(t), {b})",
            f"{a}*min(abs({w}), {z})*max(-1, min(1, {b}*sin({z}*t))) - {b}*{w}",
            f"{a}*max(w{other} - {w}, 0) - {b}*{w} - {b}*max({w} - w{other}, 0)",
        ]
        text = r.choice(kinds)
        d = {"type": P + "ExpressionTorque", "shaft": self.shafts[i - 1], "torque": text}
        if text.startswith("k*"):
            d["parameters"] = {"k": a, "d": b}
        return d

    def drive(self, i):
        shaft, r = self.shafts[i], self.r
        kind = r.choice(["commanded", "kloss", "table", "dc", "circuit", "diesel", "expression"])
        if kind == "commanded":
            d = {"type": P + "CommandedTorque", "shaft": shaft, **self.input(-6.0, 8.0)}
            if self.chance(0.5):
                d["gain"] = self.u(-1.5, 1.5)
            return d
        if kind == "expression":
            return self.expression(i + 1)
        if kind == "diesel":
            d = {"type": P + "DieselEngine", "shaft": shaft,
                 "full_load": {"speed": [-2.0, self.u(0, 2), self.u(3, 6), self.u(7, 10), 14.0],
                               "torque": [0, self.u(1, 4), self.u(5, 9), self.u(4, 8), 0]},
                 "rack": self.number_or_input(0.1, 0.9)}
            if self.chance(0.5):
                d["friction"] = {"constant": self.u(0.1, 1), "linear": self.u(0, 0.2),
                                 "regularization_speed": self.u(0.5, 2)}
            if self.chance(0.5):
                d["idle_governor"] = {"speed": self.u(2, 5), "band": self.u(0.5, 2)}
            return d
        d = {"type": P + "MotorCurve", "shaft": shaft,
             "characteristic": "dc" if kind == "circuit" else kind}
        if self.chance(0.3):
            d["direction"] = -1
        if kind == "kloss":
            d.update(breakdown_torque=self.u(3, 10), synchronous_speed=self.u(6, 15),
                     critical_slip=self.u(0.15, 0.6))
        elif kind == "table":
            d["table"] = {"speed": [self.u(-3, -1), self.u(0, 2), self.u(3, 5), self.u(6, 9)],
                          "torque": [self.u(2, 8), self.u(2, 8), self.u(1, 6), self.u(-3, 0)],
                          "beyond": r.choice(["constant", "linear"])}
        elif kind == "dc":
            d.update(stall_torque=self.u(3, 9), no_load_speed=self.u(5, 15))
        else:
            d.update(torque_constant=self.u(0.3, 1), resistance=self.u(0.5, 2),
                     voltage=self.number_or_input(-5.0, 12.0))
        if kind != "circuit" and self.chance(0.7):
            d["command"] = self.number_or_input(0.1, 1.0)
        return d

    def resistance(self, i):
        shaft, r = self.shafts[i], self.r
        kind = r.choice(["friction", "propeller", "screw", "davis", "road", "cut", "viscous", "expression"])
        if kind == "expression":
            return self.expression(i + 1)
        if kind == "viscous":
            return {"type": P + "ExpressionTorque", "shaft": shaft, "torque": f"-{self.u(0.1, 1)}*w{i + 1}"}
        if kind == "friction":
            d = {"type": P + "Friction", "shaft": shaft, "coulomb": self.u(0.1, 2),
                 "viscous": self.u(0, 0.3), "regularization_speed": self.u(0.1, 1)}
            if self.chance(0.5):
                d["static"] = round(d["coulomb"] + self.u(0, 1), 3)
                d["stribeck_speed"] = self.u(0.3, 2)
            return d
        if kind == "propeller":
            d = {"type": P + "Propeller", "shaft": shaft, "coefficient": self.u(0.01, 0.2)}
            if self.chance(0.5):
                d["regularization_speed"] = self.u(0.1, 1)
            return d
        if kind == "screw":
            d = {"type": P + "Propeller", "shaft": shaft, "torque_coefficient": self.u(0.02, 0.05),
                 "diameter": self.u(0.3, 0.6), "regularization_speed": self.u(0.2, 1)}
            if self.chance(0.5):
                d["advance"] = {"speed": self.u(0, 3), "slope": self.u(0.01, 0.04)}
            return d
        if kind in ("davis", "road"):
            d = {"type": P + "VehicleResistance", "shaft": shaft, "law": kind,
                 "wheel_radius": self.u(0.2, 0.5), "ratio": self.u(1, 4), "mass": self.u(5, 30),
                 "regularization_speed": self.u(0.1, 0.5)}
            if kind == "davis":
                d.update(constant=self.u(0, 8), linear=self.u(0, 2), quadratic=self.u(0, 0.5))
            else:
                d.update(rolling_coefficient=self.u(0.005, 0.03), drag_area=self.u(0.2, 1))
            if self.chance(0.6):
                grade = self.table(-0.1, 0.1)
                d["grade"] = {"time": grade["times"], "grade": grade["values"]}
                if self.chance(0.3):
                    d["grade"] = self.u(-0.1, 0.1)
            return d
        begin, ramp = self.u(0, 1), self.u(0.02, 0.4)
        d = {"type": P + "CuttingTorque", "shaft": shaft, "torque": self.u(0.5, 5), "begin": begin,
             "ramp": ramp, "regularization_speed": self.u(0.1, 1)}
        if self.chance(0.7):
            d["end"] = round(begin + ramp + self.u(0, 1), 3)
        if self.chance(0.5):
            d["tooth_passing"] = {"teeth": r.randint(1, 6), "amplitude": self.u(0, 1), "phase": self.u(0, 3)}
        return d

    def between(self, a, b):
        shafts = [self.shafts[a], self.shafts[b]]
        ratio = self.r.choice([1.0, self.u(0.3, 2), -self.u(0.3, 2)])
        if self.chance(0.7):
            return {"type": P + "ElasticCoupling", "shafts": shafts, "stiffness": self.u(1, 60),
                    "damping": self.u(0, 2), "ratio": ratio}
        return {"type": P + "Friction", "shafts": shafts, "coulomb": self.u(0.5, 4), "ratio": ratio,
                "regularization_speed": self.u(0.2, 1)}

    # --- constraints ---------------------------------------------------------------------------

    def constraint(self, m, J):
        """Constraint m, between shafts m and m + 1 (0-based)."""
        r, a, b = self.r, m + 1, m + 2
        shafts = [self.shafts[m], self.shafts[m + 1]]
        kinds = ["slip", "slip_formula", "nonlinear", "kinematic", "belt", "first", "first_angle", "first_kink",
                 "magnitude", "power", "efficiency", "traction", "gear", "turning", "abs_formula",
                 "abs_acceleration", "sine_acceleration"]
        if not self.gauss or self.formal:
            kinds += ["imposed", "imposed_table", "jerk_limit", "third"]
        kind = r.choice(kinds)
        ratio = lambda: self.u(0.3, 1.5)
        E = {"type": P + "ExpressionConstraint", "order": 2}
        if kind == "slip":
            return {"type": P + "SlipRatio", "shafts": shafts, "time_constant": self.u(0.05, 0.6),
                    "ratio": self.value(0.3, 1.4)}
        if kind == "slip_formula":
            return {**E, "expression": f"tau*(e{b}-u*e{a}) + w{b}-u*w{a}",
                    "parameters": {"tau": self.u(0.05, 0.6), "u": ratio()}}
        if kind == "nonlinear":
            return {**E, "expression": f"tau*(e{b}-u*e{a})*(1+{self.u(0.002, 0.03)}*(e{a}^2+e{b}^2)) + w{b}-u*w{a}",
                    "parameters": {"tau": self.u(0.1, 0.6), "u": ratio()}}
        if kind == "turning":
            z = self.u(0.5, 3)
            return {**E, "expression": f"{self.u(0.1, 0.5)}*(e{b}-(0.7+0.2*sin({z}*t))*e{a}) + w{b}-(0.7+0.2*sin({z}*t))*w{a}"}
        if kind == "abs_formula":
            return {**E, "expression": f"{self.u(0.1, 0.5)}*(e{b}-u*e{a}) + w{b}-u*w{a} + {self.u(0.01, 0.2)}*abs(w{a}-{self.u(0, 4)}) - max(0, sin({self.u(2, 9)}*phi{b})-{self.u(0.5, 0.95)})",
                    "parameters": {"u": ratio()}}
        if kind == "abs_acceleration":
            tau, u = self.u(0.1, 0.5), ratio()
            return {**E, "expression": f"{tau}*(e{b}-{u}*e{a}) + w{b}-{u}*w{a} + {round(tau * u * self.u(0.1, 0.8), 4)}*abs(e{a}-{self.u(-2, 2)})"}
        if kind == "sine_acceleration":
            tau, u = self.u(0.1, 0.5), ratio()
            return {**E, "expression": f"{tau}*(e{b}-{u}*e{a}) + w{b}-{u}*w{a} + {round(tau * u * self.u(0.05, 0.5), 4)}*sin(e{a})"}
        if kind == "gear":
            return {**E, "expression": f"e{b} - {ratio()}*e{a}"}
        if kind == "kinematic":
            return {"type": P + "KinematicRatio", "shafts": shafts,
                    "ratio": self.value(0.3, 1.4, ["second_order_lag"])}
        if kind == "belt":
            low = self.u(0.3, 0.6)
            d = {"type": P + "VBeltRatio", "shafts": shafts, "ratio_low": low,
                 "ratio_high": round(low + self.u(0.2, 1), 3), "speed": self.u(3, 8), "width": self.u(0.6, 2)}
            if self.chance(0.4):
                d["load"], d["load_torque"] = self.value(0, 5, ["second_order_lag"]), self.u(5, 20)
            return d
        if kind == "first":
            return {**E, "order": 1, "expression": f"w{b} - (0.8+0.3*sin({self.u(0.5, 3)}*t))*w{a}"}
        if kind == "first_kink":
            return {**E, "order": 1, "expression": f"w{b} - ({ratio()}+{self.u(-0.2, 0.2)}*abs(t-{self.u(0.1, 1.5)}))*w{a}"}
        if kind == "first_angle":
            return {**E, "order": 1, "expression": f"w{b} - (0.8+0.2*cos(phi{a}))*w{a} - {self.u(-0.5, 0.5)}"}
        if kind == "magnitude":
            return {"type": P + "AccelerationMagnitude", "shafts": shafts, "magnitude": self.u(1, 5)}
        if kind == "power":
            return {"type": P + "PowerFlow", "shafts": shafts, "inertias": [J[m], J[m + 1]],
                    "power": self.value(-5, 20)}
        if kind == "efficiency":
            return {"type": P + "PowerFlow", "shafts": shafts, "inertias": [J[m], J[m + 1]],
                    "efficiency": self.u(0.7, 1), "smoothing_power": self.u(0.5, 4)}
        if kind == "traction":
            return {"type": P + "TractionCurve", "shafts": shafts, "ratio": self.value(0.4, 1.3),
                    "inertia": J[m + 1], "nominal_torque": self.u(3, 15), "nominal_slip": self.u(0.03, 0.2),
                    "sharpness": self.u(0.5, 2), "load": self.value(0, 3), "load_square": self.u(0, 0.05),
                    "regularization_speed": self.u(0.1, 1)}
        if kind == "imposed":
            return {"type": P + "ImposedJerk", "shaft": shafts[1], "velocity_change": self.u(-4, 8),
                    "duration": self.u(0.1, 1.5), "start": self.u(0, 1.5)}
        if kind == "imposed_table":
            return {"type": P + "ImposedJerk", "shaft": shafts[1], "jerk": self.value(-4, 4)}
        if kind == "jerk_limit":
            return {"type": P + "JerkLimit", "shaft": shafts[1], "limit": self.u(3, 15),
                    "time_constant": self.u(0.05, 0.4), "acceleration": self.value(-3, 3)}
        return {**E, "order": 3, "expression": f"{self.u(0.5, 2)}*j{b} - (0.5+0.3*sin(phi{a}))*j{a} + {self.u(1, 4)}*(e{b}-0.5*e{a}) + {self.u(0, 3)}*sin(w{a})"}

    # --- the scene -----------------------------------------------------------------------------

    def make(self):
        r, s = self.r, self.s
        self.gauss = self.chance(0.35)
        self.formal = self.gauss and self.chance(0.25)
        J = [self.u(0.5, 3) for _ in range(s)]
        scene = self.scene = {"shafts": self.shafts}
        for i, shaft in enumerate(self.shafts):
            scene[shaft] = {"inertia": J[i]}
            if self.chance(0.25):
                scene[shaft] = {"inertia": {"mean": J[i], "harmonics": [
                    {"order": r.randint(1, 3), "cos": round(0.1 * J[i] * r.uniform(-1, 1), 4),
                     "sin": round(0.1 * J[i] * r.uniform(-1, 1), 4)} for _ in range(r.randint(1, 2))]}}
        if s > 1 and self.chance(0.3):
            i, m = r.sample(range(s), 2)
            scene["inertia_coupling"] = [[self.shafts[i], self.shafts[m],
                                          round(0.3 * min(J) * r.uniform(-1, 1), 4)]]
        torques = []
        for i in range(s):
            if self.chance(0.8):
                torques.append(self.drive(i))
            for _ in range(r.choice([1, 1, 2])):
                torques.append(self.resistance(i))
        if s > 1 and self.chance(0.4):
            torques.append(self.between(*r.sample(range(s), 2)))
        r.shuffle(torques)
        scene["torques"] = [f"t{i + 1}" for i in range(len(torques))]
        for i, d in enumerate(torques):
            scene[f"t{i + 1}"] = d
        constraints = [self.constraint(m, J) for m in range(s - 1) if self.chance(0.8)]
        r.shuffle(constraints)
        if constraints:
            scene["constraints"] = [f"k{i + 1}" for i in range(len(constraints))]
            for i, d in enumerate(constraints):
                scene[f"k{i + 1}"] = d
        if self.gauss:
            scene["principle"] = "gauss"
        commands = []
        instants = [0.0] + [self.u(0.01, self.duration) for _ in range(4)]
        for topic, (low, high) in self.holds.items():
            for _ in range(r.randint(0, 4)):
                t = r.choice(instants) if self.chance(0.6) else self.u(0, self.duration)
                spread = 1.3 if self.chance(0.1) else 1.0
                commands.append((t, topic, round(low + (high - low) * (0.5 + spread * (r.random() - 0.5)), 3)))
        # an input without clamps is kept in its range: outside, a law may not be defined
        inputs = list(find_inputs(scene))
        clamped = {d["topic"] for d in inputs if "min" in d}
        low_high = self.holds
        commands = [(t, c, v if c in clamped else round(min(max(v, low_high[c][0]), low_high[c][1]), 3))
                    for t, c, v in commands]
        commands.sort(key=lambda c: c[0])
        scene["initial"] = {"angle": [self.u(-2, 2) for _ in range(s)],
                            "velocity": [self.u(1, 6) for _ in range(s)]}
        self.times = sorted({0.0, self.duration, *(self.u(0.001, self.duration, 7) for _ in range(5))})
        self.commands = commands
        self._settle()
        return scene, commands, self.times

    def _settle(self):
        """Consistent velocities, and in some scenes accelerations that are not those of least reaction."""
        m = motion.Motion(self.scene, [c for c in self.commands if c[0] == 0.0], 1e-9)
        self.scene["initial"]["velocity"] = m.w
        if not m.gauss and self.chance(0.4):
            # They are looked at when the scene is loaded, before any command is known.
            read = {d["topic"] for c in self.scene.get("constraints", [])
                    for d in find_inputs(self.scene[c])}
            self.commands[:] = [c for c in self.commands if c[0] > 0.0 or c[1] not in read]
            m = motion.Motion(self.scene, [c for c in self.commands if c[0] == 0.0], 1e-9)
            m.disturb(0.5, self.r.randint(0, 10 ** 6))
            self.scene["initial"].update(angle=m.q, velocity=m.w, acceleration=m.e)


def find_inputs(x):
    if isinstance(x, dict):
        if "topic" in x:
            yield x
        for y in x.values():
            yield from find_inputs(y)


def features(scene):
    """The laws, holds and functions of a scene, as a set of texts."""
    found = {scene.get("principle", "generalized_gauss"), f"{len(scene['shafts'])} shafts"}
    for name in scene["torques"] + scene.get("constraints", []):
        d = scene[name]
        kind = d["type"].split("/")[1]
        text = str(d.get("torque", "")) + str(d.get("expression", ""))
        found.add(" ".join([kind, *(str(d[x]) for x in ("order", "law", "characteristic") if x in d)]))
        found.update(f for f in ("abs", "min", "max", "sign", "sinh", "atan2", "exp") if f + "(" in text)
        found.update(f"{kind} {x}" for x in ("power", "efficiency", "voltage", "grade", "idle_governor",
                                             "tooth_passing", "advance", "static", "jerk") if x in d)
        found.update(f"table of {kind}" for x in d.values() if isinstance(x, dict) and "times" in x)
        if "abs(e" in text or "sin(e" in text:
            found.add("curved in accelerations")
    for d in find_inputs(scene):
        found.update([d["hold"], *(x for x in ("min", "timeout") if x in d)])
    if "sign" in found:
        found.add("sign " + scene.get("principle", "generalized_gauss"))
    if "inertia_coupling" in scene:
        found.add("inertia_coupling")
    if any(isinstance(scene[x]["inertia"], dict) for x in scene["shafts"]):
        found.add("harmonics")
    if "acceleration" in scene["initial"]:
        found.add("acceleration given")
    return found


def make(seed, most_shafts=3):
    """(scene, commands, times) of a seed. Raises motion.Unable where its start is not unique."""
    return Maker(seed, most_shafts).make()


def write_commands(commands):
    return "time,topic,value\n" + "".join(f"{t!r},{c},{v!r}\n" for t, c, v in commands)


class Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data):
        return True


def represent_float(dumper, x):
    text = repr(x)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


Dumper.add_representer(float, represent_float)


def write_scene(scene):
    return yaml.dump(scene, Dumper=Dumper, sort_keys=False, default_flow_style=None, width=1000)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("--shafts", type=int, default=3)
    arguments = parser.parse_args()
    made = make(arguments.seed, arguments.shafts)
    print(write_scene(made[0]))
    print(write_commands(made[1]))
