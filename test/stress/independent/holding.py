#!/usr/bin/python3
"""Random machines of clutches, brakes and freewheels beside an independent event-driven solver.

    holding.py --machines N [--seed K] [--keep FOLDER]     compares them with simulate

Nothing here is taken from the sources. Between two events the motion is smooth: J w' = Q - C' T with
the torques T of what slides, and those that keep C w' = 0 of what is stuck; DOP853 of SciPy makes it
at 1e-12. Conditions (slips, reserves, capacities) are looked at on a grid of its dense output, their
roots found by Brent's method. At an event all combinations of modes of what is at rest are tried: each
moves on for a short while, and those whose conditions hold there, strictly, are the answer. Where stuck
elements are redundant a linear program says whether limits can hold, and how near they are.
"""
import argparse
import csv
import itertools
import math
import pathlib
import random
import subprocess
import sys
import tempfile

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, linprog

FREE, STUCK, FORWARD, BACKWARD = 2, 0, 1, -1
LATER = 2e-6  # s, after which the modes of an instant are looked at
GRID = 10  # points of a step


class Ambiguous(Exception):
    """Several combinations hold, or none: a machine that decides nothing."""


class Machine:
    """Shafts with inertia, sinusoidal and constant torques, springs, dampers, elements that hold."""

    def __init__(self, rng):
        self.count = n = rng.randint(1, 5)
        self.inertia = [round(10 ** rng.uniform(-1.3, 1.0), 3) for _ in range(n)]
        self.velocity = [rng.choice([0.0, round(rng.uniform(-20, 20), 2)]) for _ in range(n)]
        self.constant = [rng.choice([0.0, round(rng.uniform(-6, 6), 2)]) for _ in range(n)]
        self.damping = [rng.choice([0.0, 0.0, round(rng.uniform(0.01, 0.5), 3)]) for _ in range(n)]
        self.waves = [(i, round(rng.uniform(1, 15), 2), round(rng.uniform(1, 30), 2))
                      for i in range(n) if rng.random() < 0.7]
        self.springs = []
        if n > 2 and rng.random() < 0.4:
            a, b = rng.sample(range(n), 2)
            self.springs.append((a, b, round(rng.uniform(20, 300), 1), round(rng.uniform(0, 2), 2)))
        self.elements = [self.element(rng) for _ in range(rng.randint(1, 4))]

    def element(self, rng):
        pair = rng.sample(range(self.count), 2) if self.count > 1 else [None, 0]
        kind = rng.choice(["Clutch", "Clutch", "Brake", "OneWayClutch"])
        if kind == "Brake" or self.count == 1:
            pair = [None, pair[1]]
            kind = "OneWayClutch" if kind == "OneWayClutch" else "Brake"
        size = round(rng.uniform(1, 15), 2)
        shape = rng.choice(["constant", "constant", "cosine", "switch"])
        capacity = {"constant": ("constant", size, 0.0),
                    "cosine": ("cosine", size, round(rng.uniform(0.5, 6), 2)),
                    "switch": ("switch", size, round(rng.uniform(0.1, 1.5), 3))}[shape]
        if kind == "OneWayClutch":
            capacity = ("constant", rng.choice([0.0, 0.0, round(rng.uniform(0.1, 2), 2)]), 0.0)
        ratio = 1.0 if pair[0] is None else rng.choice([1.0, 1.0, round(rng.uniform(-2.5, 2.5), 2) or 1.0])
        static = 1.0 if kind == "OneWayClutch" else rng.choice([1.0, round(rng.uniform(1, 1.6), 2)])
        return {"kind": kind, "pair": pair, "ratio": ratio, "capacity": capacity, "static": static}

    def scene(self):
        text = f"shafts: [{', '.join(f's{i}' for i in range(self.count))}]\n"
        for i in range(self.count):
            text += f"s{i}: {{inertia: {self.inertia[i]!r}}}\n"
        lines = []
        for i in range(self.count):
            terms = [repr(self.constant[i]), f"-({self.damping[i]!r})*w{i + 1}"]
            terms += [f"{amplitude!r}*sin({omega!r}*t)" for j, amplitude, omega in self.waves if j == i]
            lines.append((f"load{i}", f'type: variator_sim/ExpressionTorque, shaft: s{i}, torque: '
                          f'"{" + ".join(terms)}"'))
        for k, (a, b, stiffness, damping) in enumerate(self.springs):
            lines.append((f"spring{k}", f"type: variator_sim/ElasticCoupling, shafts: [s{a}, s{b}], "
                          f"stiffness: {stiffness!r}, damping: {damping!r}"))
        for k, it in enumerate(self.elements):
            shape, size, rate = it["capacity"]
            capacity = {"constant": repr(size), "cosine": f"{size!r}*cos({rate!r}*t)",
                        "switch": f"if(t < {rate!r}, 0, {size!r})"}[shape]
            a, b = it["pair"]
            shafts = f"shaft: s{b}" if a is None else f"shafts: [s{a}, s{b}], ratio: {it['ratio']!r}"
            lines.append((f"h{k}", f"type: variator_sim/{it['kind']}, {shafts}, "
                          f'capacity: "{capacity}", static: {it["static"]!r}'))
        text += f"torques: [{', '.join(name for name, _ in lines)}]\n"
        text += "".join(f"{name}: {{{law}}}\n" for name, law in lines)
        return text + f"initial: {{velocity: {self.velocity!r}}}\n"


class Solver:
    def __init__(self, machine):
        self.it = machine
        n = machine.count
        self.J = np.array(machine.inertia)
        self.C = np.zeros((len(machine.elements), n))
        for row, element in zip(self.C, machine.elements):
            a, b = element["pair"]
            row[b] = 1.0 if a is None else element["ratio"]
            if a is not None:
                row[a] = -1.0
        self.events = []
        self.switches = sorted({e["capacity"][2] for e in machine.elements
                                if e["capacity"][0] == "switch"})
        self.after = set()  # switches that are over
        self.independent = {}  # by stuck elements

    def capacity(self, h, t):
        shape, size, rate = self.it.elements[h]["capacity"]
        if shape == "cosine":
            return size * math.cos(rate * t)
        if shape == "switch":
            return size if rate in self.after else 0.0
        return size

    def one_way(self, h):
        return self.it.elements[h]["kind"] == "OneWayClutch"

    def limits(self, h, t):
        limit = self.it.elements[h]["static"] * self.capacity(h, t)
        return (-math.inf if self.one_way(h) else -limit), limit

    def applied(self, t, y):
        n = self.it.count
        phi, w = y[:n], y[n:]
        Q = np.array(self.it.constant) - np.array(self.it.damping) * w
        for i, amplitude, omega in self.it.waves:
            Q[i] += amplitude * math.sin(omega * t)
        for a, b, stiffness, damping in self.it.springs:
            T = stiffness * (phi[a] - phi[b]) + damping * (w[a] - w[b])
            Q[a] -= T
            Q[b] += T
        return Q

    def solve(self, t, y, modes, with_reserve=True):
        """Accelerations, torques of all elements, what each that is stuck could hold beyond (above 0);
        of redundant ones there is one number for all."""
        Q = self.applied(t, y)
        T = np.zeros(len(modes))
        for h, mode in enumerate(modes):
            if mode in (FORWARD, BACKWARD):
                T[h] = mode * self.capacity(h, t)
        Q = Q - self.C.T @ T
        stuck = [h for h, mode in enumerate(modes) if mode == STUCK]
        if not stuck:
            return Q / self.J, T, {}
        C = self.C[stuck]
        A = C @ (C / self.J).T
        key = tuple(stuck)
        if key not in self.independent:
            self.independent[key] = np.linalg.matrix_rank(C, tol=1e-9) == len(stuck)
        right = C @ (Q / self.J)
        held = np.linalg.solve(A, right) if self.independent[key] else \
            np.linalg.lstsq(A, right, rcond=1e-10)[0]
        T[stuck] = held
        eps = (Q - C.T @ held) / self.J
        limits = [self.limits(h, t) for h in stuck]
        if not with_reserve:
            return eps, T, {}
        if self.independent[key]:
            return eps, T, {h: min(high - x, x - low)
                            for h, x, (low, high) in zip(stuck, held, limits)}
        return eps, T, {stuck[0]: self.shared_reserve(C, held, limits)}

    @staticmethod
    def shared_reserve(C, held, limits):
        """The largest r with C' T as needed and low + r <= T <= high - r."""
        k = len(held)
        rows, bounds = [], []
        for i, (low, high) in enumerate(limits):
            e = np.zeros(k + 1)
            e[i], e[k] = 1.0, 1.0
            rows.append(e)
            bounds.append(high)
            if math.isfinite(low):
                e = np.zeros(k + 1)
                e[i], e[k] = -1.0, 1.0
                rows.append(e)
                bounds.append(-low)
        equal = np.hstack([C.T, np.zeros((C.shape[1], 1))])
        keep = [r for r in range(C.shape[1]) if np.any(C[:, r] != 0.0)]
        done = linprog(np.append(np.zeros(k), -1.0), A_ub=rows, b_ub=bounds, A_eq=equal[keep],
                       b_eq=(C.T @ held)[keep], bounds=[(None, None)] * k + [(None, 1e3)])
        return done.x[-1] if done.status == 0 else -math.inf

    def slope(self, t, y, modes):
        return np.append(y[self.it.count:], self.solve(t, y, modes, False)[0])

    def collide(self, y):
        """Freewheels that would turn backward stop that at once."""
        w = y[self.it.count:]
        wheels = [h for h in range(len(self.it.elements)) if self.one_way(h)]
        if all(self.C[h] @ w >= -1e-11 for h in wheels):
            return y
        for count in range(1, len(wheels) + 1):
            for active in itertools.combinations(wheels, count):
                C = self.C[list(active)]
                p, *_ = np.linalg.lstsq(C @ (C / self.J).T, -C @ w, rcond=1e-10)
                after = w + (C / self.J).T @ p
                if (p >= -1e-12).all() and all(self.C[h] @ after > -1e-10 for h in wheels):
                    return np.append(y[:self.it.count], after)
        raise Ambiguous("impact")

    def later(self, t, y, modes):
        """The state LATER s behind: one step of Runge and Kutta."""
        h = LATER
        k1 = self.slope(t, y, modes)
        k2 = self.slope(t + h / 2, y + h / 2 * k1, modes)
        k3 = self.slope(t + h / 2, y + h / 2 * k2, modes)
        k4 = self.slope(t + h, y + h * k3, modes)
        return t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def holds(self, t, y, modes, rest):
        """True where the conditions of the modes hold a short while later."""
        at, state = self.later(t, y, modes)
        w = state[self.it.count:]
        if any(reserve < -1e-11 for reserve in self.solve(at, state, modes)[2].values()):
            return False
        for h, mode in enumerate(modes):
            f = self.C[h] @ w
            if mode == STUCK and abs(f) > 1e-12 * (1.0 + np.abs(w).max()):
                return False
            if h in rest and mode in (FORWARD, BACKWARD) and not mode * f > -1e-14:
                return False
        return True

    def decide(self, t, y):
        y = self.collide(y)
        w = y[self.it.count:]
        choices, rest = [], []
        for h in range(len(self.it.elements)):
            f = self.C[h] @ w
            if not self.one_way(h) and not self.capacity(h, t + LATER) > 0.0:
                choices.append([FREE])
            elif abs(f) > 1e-9:
                choices.append([FORWARD if f > 0.0 else BACKWARD])
            else:
                rest.append(h)
                choices.append([STUCK, FORWARD] + ([] if self.one_way(h) else [BACKWARD]))
        found = []
        for modes in itertools.product(*choices):
            stuck = [h for h in rest if modes[h] == STUCK]
            at = y.copy()
            if stuck:  # exactly at rest
                C = self.C[stuck]
                p, *_ = np.linalg.lstsq(C @ (C / self.J).T, -C @ w, rcond=1e-10)
                at[self.it.count:] = w + (C / self.J).T @ p
            if self.holds(t, at, modes, rest):
                found.append((modes, at, self.later(t, at, modes)[1]))
        if not found:
            raise Ambiguous(f"no modes at {t}")
        # An element that can stick does, though with static > 1 it might slide, too.
        might_stick = [h for h in rest if self.it.elements[h]["static"] > 1.0]
        stuck = lambda one: (-sum(one[0][h] != STUCK for h in might_stick),
                             sum(mode == STUCK for mode in one[0]))
        found.sort(key=stuck, reverse=True)
        for other in found[1:]:
            if stuck(other) == stuck(found[0]) and np.abs(other[2] - found[0][2]).max() > 1e-10:
                raise Ambiguous(f"several modes at {t}")
        return list(found[0][0]), found[0][1]

    def conditions(self, t, y, modes):
        """Values that do not become negative in these modes."""
        w = y[self.it.count:]
        reserves = self.solve(t, y, modes)[2]
        values = [reserves.get(h, math.inf) for h in range(len(modes))]
        for h, mode in enumerate(modes):
            capacity = math.inf if self.one_way(h) else self.capacity(h, t)
            values.append(mode * (self.C[h] @ w) if mode in (FORWARD, BACKWARD) else math.inf)
            values.append(-capacity if mode == FREE else capacity)
        return values

    def first_root(self, solver, modes, begin):
        """The first instant in a step at which a condition becomes negative."""
        dense = solver.dense_output()
        times = np.linspace(solver.t_old, solver.t, GRID + 1)
        before = self.conditions(times[0], dense(times[0]), modes)
        for a, b in zip(times, times[1:]):
            values = self.conditions(b, dense(b), modes)
            found = []
            for k, (x, z) in enumerate(zip(before, values)):
                if z >= -1e-13 or not math.isfinite(z):
                    continue
                if not x > 0.0 or not math.isfinite(x):
                    found.append(a if a > begin + LATER else b)
                    continue
                root = brentq(lambda t, k=k: self.conditions(t, dense(t), modes)[k], a, b, xtol=1e-14,
                              rtol=1e-14)
                found.append(root)
            if found:
                return min(found)
            before = values
        return None

    def run(self, times):
        """Rows of time, angles, velocities, modes."""
        y = np.append(np.zeros(self.it.count), np.array(self.it.velocity, dtype=float))
        t, rows, count = 0.0, [], 0
        targets = sorted(set(times) | {s for s in self.switches if s < times[-1]})
        modes, y = self.decide(t, y)
        for target in targets:
            while t < target:
                count += 1
                if count > 400:
                    raise Ambiguous("too many events")
                begin, event = t, None
                solver = DOP853(lambda s, x, m=tuple(modes): self.slope(s, x, m), t, y, target,
                                rtol=1e-11, atol=1e-12, max_step=0.02)
                while solver.status == "running":
                    solver.step()
                    event = self.first_root(solver, modes, begin)
                    if event is not None:
                        break
                t = target if event is None else event
                y = solver.y if event is None else solver.dense_output()(event)
                if event is None:
                    continue
                before = modes
                modes, y = self.decide(t, y)
                self.note(t, before, modes)
            if target in self.switches:
                self.after.add(target)
                before = modes
                modes, y = self.decide(t, y)
                self.note(t, before, modes)
            if target in times:
                rows.append([t, *y, *modes])
        return rows

    def note(self, t, before, modes):
        for h, (a, b) in enumerate(zip(before, modes)):
            if a != b:
                self.events.append((t, h, a, b))


def simulated(machine, simulate, folder, duration, rate):
    """The samples of `simulate`."""
    folder = pathlib.Path(folder)
    (folder / "scene.yaml").write_text(machine.scene())
    words = [simulate, folder / "scene.yaml", "--duration", duration, "--rate", rate, "--output",
             folder / "o.csv"]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False,
                          timeout=300)
    if done.returncode != 0:
        return None, done.stderr
    with open(folder / "o.csv", encoding="utf-8") as file:
        return list(csv.reader(file)), ""


def compare(machine, rows, table):
    """The largest difference of angles and velocities, of their scale."""
    header, values = table[0], [list(map(float, line)) for line in table[1:]]
    worst = 0.0
    for i in range(machine.count):
        for quantity, column in (("angle", 1 + i), ("velocity", 1 + machine.count + i)):
            at = header.index(f"s{i}/{quantity}")
            scale = max(1.0, *(abs(row[column]) for row in rows))
            worst = max(worst, *(abs(row[column] - line[at]) / scale for row, line in zip(rows, values)))
    return worst


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--simulate", default="simulate")
    parser.add_argument("--keep", help="a folder for the scenes that differ")
    parser.add_argument("--allowed", type=float, default=1e-6)
    options = parser.parse_args()
    duration, rate, bad, undecided, largest = 2.0, 50, 0, 0, 0.0
    times = [k / rate for k in range(int(duration * rate) + 1)]
    for seed in range(options.seed, options.seed + options.machines):
        machine = Machine(random.Random(seed))
        solver = Solver(machine)
        try:
            rows = solver.run(times)
        except Ambiguous as reason:
            undecided += 1
            print(f"{seed}: no reference: {reason}")
            continue
        with tempfile.TemporaryDirectory() as folder:
            table, stderr = simulated(machine, options.simulate, folder, duration, rate)
            worst = math.inf if table is None else compare(machine, rows, table)
        if worst <= options.allowed:
            largest = max(largest, worst)
            continue
        bad += 1
        print(f"{seed}: {worst:.1e} {stderr.strip()}")
        if options.keep:
            pathlib.Path(options.keep).mkdir(parents=True, exist_ok=True)
            pathlib.Path(options.keep, f"holding_{seed}.yaml").write_text(machine.scene())
    print(f"{options.machines} machines: {bad} differ, {undecided} without a reference, "
          f"largest difference of the others {largest:.1e}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
