#!/usr/bin/python3
"""References of the Modelica library's package Rotational for test/modes, by the solver of holding.py.

    examples.py FOLDER     writes NAME.csv and NAME.events.csv of each

The numbers are those of Modelica.Mechanics.Rotational.Examples, version 4. Two tolerances say how exact
they are.
"""
import csv
import math
import pathlib
import sys

import numpy as np

import holding


class Example:
    """A machine whose torques are a function of t, angles, velocities and the instants that are over."""

    def __init__(self, shafts, inertia, torque, velocity=None, elements=(), gears=(), breaks=(), rows=(),
                 speeds=lambda t: [], rates=lambda t: []):
        self.shafts, self.count, self.inertia = shafts, len(shafts), inertia
        self.velocity = velocity or [0.0] * len(shafts)
        self.elements, self.gears, self.breaks, self.rows = list(elements), list(gears), list(breaks), list(rows)
        self.speeds, self.rates, self.law = speeds, rates, torque

    def torque(self, t, y, after):
        return np.array(self.law(t, y[:self.count], y[self.count:2 * self.count], after), dtype=float)

    def capacity(self, h, t, after):
        return self.elements[h]["capacity"](t, after)


def hold(name, kind, pair, capacity, static=1.0, **more):
    return dict(name=name, kind=kind, pair=pair, ratio=1.0, capacity=capacity, static=static, **more)


def gear(name, a, b, ratio, loss):
    return dict(name=name, a=a, b=b, ratio=ratio, loss=loss)


def link(x, v, k, c, gap=0.0):
    """The torque of a spring with a damper, which with a gap pushes only."""
    if gap == 0.0:
        return k * x + c * v
    q, rate = abs(x) - gap / 2, math.copysign(1.0, x) * v
    return 0.0 if q <= 0.0 else math.copysign(k * q + min(max(c * rate, -k * q), k * q), x)


def ramp(t, begin, duration):
    return min(max((t - begin) / duration, 0.0), 1.0)


def first(t, phi, w, after):
    spring = link(phi[1] - phi[2], 0.0, 1e4, 0.0)
    return [10 * math.sin(10 * math.pi * t), -spring - 10 * w[1], spring]


def heat_losses(t, phi, w, after):
    T12 = link(phi[0] - phi[1], w[0] - w[1], 1e4, 20)
    T23 = link(phi[1] - phi[2], w[1] - w[2], 1e5, 100, 0.001)
    T34 = link(phi[2] - phi[3], 0.0, 1e4, 0)
    return [20 * math.sin(10 * math.pi * t) - 10 * w[0] - T12, T12 - T23, T23 - T34, T34, 0, 0, 0]


def gear_shift(t, phi, w, after):
    return [20.0 if 0.5 in after else 0.0, 0.0, -20 * (w[2] / 10.471975511966) * abs(w[2] / 10.471975511966)]


def eddy(t, phi, w, after):
    """Its second shaft is the heat, J, and K of 1 J/K, as a speed."""
    x = w[0] / (10 * (1 + 3.92e-3 * w[1]))
    T = 200 * ramp(t, 0.1, 0.1) * x / (1 + x * x)
    return [-T, T * w[0]]


def braking(t, phi, w, after):
    return [-100 * min(max(w[0], -1), 1), -w[1], -0.01 * w[2] * abs(w[2]),
            -1e4 * w[3] if abs(w[3]) < 1 else -1e4 / w[3]]


FIVE_PI = 10 * math.pi
EXAMPLES = {
    "First": (1.0, 40, Example(["inertia1", "inertia2", "inertia3"], [0.1, 2, 2], first,
                               rows=[[-0.1, 1, 0]], speeds=lambda t: [0.0], rates=lambda t: [0.0])),
    "LossyGearDemo2": (0.5, 50, Example(
        ["Inertia1", "Inertia2"], [1, 1.5], lambda t, phi, w, after: [10 * math.sin(2 * math.pi * t), -10 + 2.5 * t],
        elements=[hold("bearingFriction", "Brake", [None, 0], lambda t, after: 0.5, viscous=0.5)],
        gears=[gear("gear", 0, 1, 0.5, lambda w: (0.5, 0.5, 0.0, 0.0))])),
    "LossyGearDemo3": (1.0, 30, Example(
        ["Inertia1", "Inertia2"], [0.001, 0.001], lambda t, phi, w, after: [0.0, 1.0 if 0.5 in after else 0.0],
        [10.0, 10.0], gears=[gear("gear", 0, 1, 1.0, lambda w: (0.25, 0.25, 0.625, 2.5))], breaks=[0.5])),
    "RollingWheel": (5.0, 50, Example(
        ["inertia", "mass"], [1, 1],
        lambda t, phi, w, after: [10.0 if 0.1 in after else 0.0, -0.4 * w[1] * abs(w[1])],
        breaks=[0.1], rows=[[-1, 1]], speeds=lambda t: [0.0], rates=lambda t: [0.0])),
    "HeatLosses": (1.0, 100, Example(
        ["inertia1", "inertia2", "inertia3", "inertia4", "gear_b", "inertia5", "inertia6"],
        [2, 2, 2, 2, 0, 2, 2], heat_losses,
        elements=[hold("bearingFriction", "Brake", [None, 2], lambda t, after: 1.0),
                  hold("clutch", "Clutch", [4, 5], lambda t, after: 5 * math.sin(0.4 * math.pi * t)),
                  hold("oneWayClutch", "OneWayClutch", [5, 6],
                       lambda t, after: 0.5 * math.sin(0.4 * math.pi * t)),
                  hold("brake", "Brake", [None, 6], lambda t, after: math.sin(0.4 * math.pi * t))],
        gears=[gear("lossyGear", 3, 4, 0.5, lambda w: (0.8 - 0.1 * w, 0.8 - 0.1 * w, 1 + w, 1 + w))])),
    "SimpleGearShift": (5.0, 50, Example(
        ["engine", "ring", "load"], [1, 0, 10], gear_shift,
        elements=[hold("clutch", "Clutch", [0, 1], lambda t, after: 100 * ramp(t, 2, 0.1) if 2.0 in after else 0.0),
                  hold("brake", "Brake", [None, 1],
                       lambda t, after: 0.0 if 2.1 in after else 100 * (1 - ramp(t, 2, 0.1)))],
        breaks=[0.5, 2.0, 2.1], rows=[[-1, -1.5, 2.5]], speeds=lambda t: [0.0], rates=lambda t: [0.0])),
    "EddyCurrentBrake": (1.0, 50, Example(["inertia", "heat"], [1, 1], eddy, [20.0, 0.0], breaks=[0.1, 0.2])),
    "OneWayClutchDisengaged": (2.0, 50, Example(
        ["inertiaIn", "inertiaOut"], [1, 1], lambda t, phi, w, after: [0.3 + 10 * math.sin(4 * math.pi * t), -0.3],
        [-0.5, 0.0], elements=[hold("oneWayClutch", "OneWayClutch", [0, 1], lambda t, after: 0.0)])),
    "DemoFreeWheel": (1.0, 50, Example(
        ["inertia1", "inertia2"], [1, 1], lambda t, phi, w, after: [0.0, -5 * w[1]],
        elements=[hold("freeWheel", "OneWayClutch", [0, 1], lambda t, after: 0.0)],
        rows=[[1, 0]], speeds=lambda t: [5 * math.sin(FIVE_PI * t)],
        rates=lambda t: [5 * FIVE_PI * math.cos(FIVE_PI * t)])),
    "CompareBrakingTorque": (5.0, 40, Example(["inertia1", "inertia2", "inertia3", "inertia4"], [1, 1, 1, 1],
                                              braking, [100.0] * 4)),
}
NAMES = {-1: "backward", 0: "stuck", 1: "forward", 2: "free"}


def write(name, folder):
    duration, rate, example = EXAMPLES[name]
    times = [k / rate for k in range(round(duration * rate) + 1)]
    solver, other = holding.Solver(example, 3e-13, True), holding.Solver(example, 1e-11, True)
    rows, coarse = solver.run(times), other.run(times)
    n, parts = example.count, [it["name"] for it in example.elements + example.gears]
    moved = max(abs(a - b) for x, y in zip(rows, coarse) for a, b in zip(x[1:2 * n + 1], y[1:2 * n + 1]))
    print(f"{name}: {len(solver.events)} events; the tolerance moves it by {moved:.1e}, instants by "
          f"{max([abs(a[0] - b[0]) for a, b in zip(solver.events, other.events)], default=0.0):.1e}")
    if name == "EddyCurrentBrake":
        header = ["time", "inertia/velocity", "inertia/angle", "states/heat"]
        lines = [[r[0], r[1 + n], r[1], r[2 + n]] for r in rows]
    else:
        header = ["time"] + [f"{s}/{q}" for s in example.shafts for q in ("velocity", "angle")]
        header += [f"{part}/{q}" for part in parts for q in ("heat", "mode")]
        lines = [[r[0]] + [r[1 + i + k] for i in range(n) for k in (n, 0)] +
                 [v for k in range(len(parts)) for v in (r[1 + 2 * n + k], NAMES[r[1 + 2 * n + len(parts) + k]])]
                 for r in rows]
    with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header] + lines)
    with open(folder / f"{name}.events.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [["time", "element", "from", "to"]] +
            [[t, parts[k], NAMES[a], NAMES[b]] for t, k, a, b in solver.events])


if __name__ == "__main__":
    for each in sys.argv[2:] or EXAMPLES:
        write(each, pathlib.Path(sys.argv[1]))
