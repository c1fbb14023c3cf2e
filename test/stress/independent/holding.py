#!/usr/bin/python3
"""Random machines of clutches, brakes, freewheels and gears beside an independent event-driven solver.

    holding.py --machines N [--seed K] [--keep FOLDER]     compares them with simulate

Nothing here is taken from the sources. Between two events the motion is smooth: J w' = Q - C' T with
the torques T of what slides, and those that keep C w' = 0 of what is stuck, all of them unknowns of one
system with what gears pass and lose; shafts may be massless. DOP853 of SciPy makes it at 1e-11.
Conditions (slips, reserves, capacities, sides that drive) are looked at on a grid of its dense output,
their roots found by Brent's method. At an event all combinations of modes of what is at rest are tried:
each moves on for a short while, and those whose conditions hold there, strictly, are the answer. Where
stuck elements are redundant a linear program says whether limits can hold, and how near they are.
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
        self.breaks = sorted({e["capacity"][2] for e in self.elements if e["capacity"][0] == "switch"})
        self.gears, self.rows = [], []
        joined = list(range(n))
        for _ in range(rng.choice([0, 1, 1, 2]) if n > 1 else 0):
            self.add_gear(rng, joined)

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

    def add_gear(self, rng, joined):
        """Between shafts that no other gears connect; its second shaft may be massless."""
        a, b = rng.sample(range(self.count), 2)
        if joined[a] == joined[b]:
            return
        numbers = [(1.0, 1.0, 0.0, 0.0),
                   (round(rng.uniform(0.3, 1), 2), round(rng.uniform(0.3, 1), 2), 0.0, 0.0),
                   (round(rng.uniform(0.3, 1), 2), round(rng.uniform(0.3, 1), 2),
                    round(rng.uniform(0, 3), 2), round(rng.uniform(0, 3), 2))][rng.choice([0, 1, 1, 2, 2])]
        ratio = rng.choice([1.0, round(rng.uniform(0.3, 3), 2), -round(rng.uniform(0.3, 3), 2)])
        group = [i for i in range(self.count) if joined[i] == joined[b]]
        if self.velocity[a] * ratio != self.velocity[b]:
            ends = [i for i in range(self.count) if joined[i] in (joined[a], joined[b])]
            for i in ends:
                self.velocity[i] = 0.0
        if len(group) == 1 and rng.random() < 0.25 and self.inertia[a] > 0.0:
            self.inertia[b] = 0.0
        joined[:] = [joined[a] if joined[i] == joined[b] else joined[i] for i in range(self.count)]
        self.gears.append({"a": a, "b": b, "ratio": ratio, "numbers": numbers,
                           "loss": lambda w, numbers=numbers: numbers})

    def capacity(self, h, t, after):
        shape, size, rate = self.elements[h]["capacity"]
        if shape == "cosine":
            return size * math.cos(rate * t)
        if shape == "switch":
            return size if rate in after else 0.0
        return size

    def torque(self, t, y, after):
        n = self.count
        phi, w = y[:n], y[n:2 * n]
        Q = np.array(self.constant) - np.array(self.damping) * w
        for i, amplitude, omega in self.waves:
            Q[i] += amplitude * math.sin(omega * t)
        for a, b, stiffness, damping in self.springs:
            T = stiffness * (phi[a] - phi[b]) + damping * (w[a] - w[b])
            Q[a] -= T
            Q[b] += T
        return Q

    def speeds(self, t):
        """Imposed by `rows`."""
        return []

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
        if self.gears:
            text += f"constraints: [{', '.join(f'g{k}' for k in range(len(self.gears)))}]\n"
        for k, gear in enumerate(self.gears):
            e1, e2, b1, b2 = gear["numbers"]
            text += (f"g{k}: {{type: variator_sim/KinematicRatio, shafts: [s{gear['a']}, s{gear['b']}], "
                     f"ratio: {gear['ratio']!r}, efficiency: {{driving: {e1!r}, driven: {e2!r}}}, "
                     f"bearing: {{driving: {b1!r}, driven: {b2!r}}}}}\n")
        return text + f"initial: {{velocity: {self.velocity!r}}}\n"


class Solver:
    """Moves a machine: inertia, velocity, elements, gears, breaks (instants at which a torque or a capacity
    may jump), torque(t, y, after), capacity(h, t, after) with the breaks that are over."""

    def __init__(self, machine, tolerance=1e-11, takes_preload=False):
        self.it = machine
        self.takes_preload = takes_preload  # where stuck gears hold with one preload and not with another
        self.tolerance = tolerance
        n = machine.count
        self.J = np.array(machine.inertia, dtype=float)
        self.C = np.zeros((len(machine.elements), n))
        for row, element in zip(self.C, machine.elements):
            a, b = element["pair"]
            row[b] = 1.0 if a is None else element["ratio"]
            if a is not None:
                row[a] = -1.0
        self.G = np.zeros((len(machine.gears), n))
        for row, gear in zip(self.G, machine.gears):
            row[gear["a"]], row[gear["b"]] = -gear["ratio"], 1.0
        self.rows = np.array(machine.rows, dtype=float).reshape(-1, n)
        self.heavy = np.where(self.J > 0.0, self.J, np.max(self.J) * 1e-3)  # measures projections only
        self.events = []
        self.after = set()  # breaks that are over
        self.null = {}  # of modes: what their equations leave open

    def one_way(self, h):
        return self.it.elements[h]["kind"] == "OneWayClutch"

    def limits(self, h, t):
        element = self.it.elements[h]
        limit = element["static"] * self.it.capacity(h, t, self.after)
        return (-math.inf if self.one_way(h) else -limit), limit

    def equations(self, t, y, modes):
        """M x = b of x = accelerations, T of the elements, per gear its torques tau on a and loss L,
        multipliers of other constraints. A gear passes (tau - L)/i to b; by Pelchen et al. L follows
        from tau, the speed's sign and the side that drives."""
        n, h, g = self.it.count, len(self.it.elements), len(self.it.gears)
        size = n + h + 2 * g + len(self.rows)
        w = y[n:2 * n]
        M, b = np.zeros((size, size)), np.zeros(size)
        M[:n, :n] = np.diag(self.J)
        M[:n, n:n + h] = self.C.T
        b[:n] = self.it.torque(t, y, self.after)
        for k in range(h):
            r = n + k
            if modes[k] == STUCK:
                M[r, :n] = self.C[k]
            else:
                M[r, r] = 1.0
                if modes[k] in (FORWARD, BACKWARD):
                    b[r] = modes[k] * (self.it.capacity(k, t, self.after) +
                                       self.it.elements[k].get("viscous", 0.0) * abs(self.C[k] @ w))
        for k, gear in enumerate(self.it.gears):
            tau, L = n + h + 2 * k, n + h + 2 * k + 1
            M[gear["a"], tau] += 1.0
            M[gear["b"], tau] -= 1.0 / gear["ratio"]
            M[gear["b"], L] += 1.0 / gear["ratio"]
            M[tau, :n] = self.G[k]
            mode = modes[h + k]
            if mode == STUCK:
                M[L, gear["a"]] = 1.0
            else:
                factor, constant = self.line(gear, mode, w[gear["a"]])
                M[L, L], M[L, tau], b[L] = 1.0, -factor, constant
        for k, row in enumerate(self.rows):
            r = n + h + 2 * g + k
            M[:n, r] = -row
            M[r, :n] = row
            b[r] = self.it.rates(t)[k]
        return M, b

    @staticmethod
    def line(gear, mode, w):
        """L = factor tau + constant."""
        e1, e2, b1, b2 = gear["loss"](abs(w))
        sign, drives = mode
        return (1.0 - e1, sign * b1) if drives else (1.0 - 1.0 / e2, sign * b2)

    @staticmethod
    def lead(gear, sign, tau, w):
        """Above 0 where a drives."""
        e1, e2, b1, b2 = gear["loss"](abs(w))
        return math.inf if e1 * e2 == 1.0 else sign * tau - (b1 - b2) / (e1 - 1.0 / e2)

    def solve(self, t, y, modes, with_reserve=True):
        """Accelerations, torques, what each that is stuck could hold beyond (above 0); of redundant ones
        there is one number for all."""
        n, h = self.it.count, len(self.it.elements)
        M, b = self.equations(t, y, modes)
        key = tuple(modes)
        if key not in self.null:
            scale = np.abs(M).max(axis=1)
            _, sigma, V = np.linalg.svd(M / scale[:, None])
            self.null[key] = V[sigma < 1e-10].T
        N = self.null[key]
        x = np.linalg.solve(M, b) if N.shape[1] == 0 else np.linalg.lstsq(M, b, rcond=1e-11)[0]
        eps, T = x[:n], x[n:n + h]
        if N.shape[1] and (STUCK not in modes or np.abs(M @ x - b).max() > 1e-8 * (1.0 + np.abs(b).max()) or
                           np.abs(N[:n]).max() > 1e-8):
            raise Ambiguous("equations without a solution")
        if not with_reserve:
            return eps, T, {}, x
        limited = []  # value, its part along N, low, high
        for k in range(h):
            if modes[k] == STUCK:
                limited.append((k, x[n + k], N[n + k], *self.limits(k, t)))
        unknown = False
        sides = []  # of stuck gears: L <= one of two lines of q = tau - L, L >= one of two
        for k, gear in enumerate(self.it.gears):
            if modes[h + k] != STUCK:
                continue
            tau, L = n + h + 2 * k, n + h + 2 * k + 1
            q, moved = x[tau] - x[L], N[tau] - N[L]
            e1, e2, b1, b2 = gear["loss"](0.0)
            lines = [(1.0 / e1 - 1.0, b1 / e1), (e2 - 1.0, e2 * b2)]
            if N.shape[1] == 0:
                high = max(slope * q + base for slope, base in lines)
                low = min(slope * q - base for slope, base in lines)
                limited.append((h + k, x[L], N[L], low, high))
                continue
            unknown = unknown or np.any(np.abs(moved) > 1e-9)
            for sign in (1.0, -1.0):
                sides.append([(h + k, sign * (x[L] - slope * q), sign * (N[L] - slope * moved),
                               -math.inf, base) for slope, base in lines])
        if N.shape[1] == 0:
            return eps, T, {k: min(high - v, v - low) for k, v, _, low, high in limited}, x
        best = max(self.shared_reserve(limited + list(chosen)) for chosen in itertools.product(*sides))
        if unknown and best >= -1e-11 and not self.takes_preload:
            raise Ambiguous("a stuck gear that holds with one preload and not with another")
        return eps, T, {modes.index(STUCK): best}, x

    @staticmethod
    def shared_reserve(limited):
        """The largest r with low + r <= value + part z <= high - r for some z."""
        rows, bounds = [], []
        for _, value, part, low, high in limited:
            rows.append(np.append(part, 1.0))
            bounds.append(high - value)
            if math.isfinite(low):
                rows.append(np.append(-part, 1.0))
                bounds.append(value - low)
        k = len(limited[0][2])
        done = linprog(np.append(np.zeros(k), -1.0), A_ub=rows, b_ub=bounds,
                       bounds=[(None, None)] * k + [(None, 1e3)])
        return done.x[-1] if done.status == 0 else -math.inf

    def slope(self, t, y, modes):
        eps, T, _, x = self.solve(t, y[:2 * self.it.count], modes, False)
        n, h = self.it.count, len(self.it.elements)
        w = y[n:2 * n]
        losses = [x[n + h + 2 * k + 1] * w[gear["a"]] for k, gear in enumerate(self.it.gears)]
        return np.concatenate([w, eps, T * (self.C @ w), losses])

    def project(self, w, active):
        """The nearest speeds at which the rows are 0, and the impulses along them."""
        C = np.vstack([self.C[list(active)], self.G, self.rows])
        goal = np.append(np.zeros(len(active) + len(self.G)), self.it.speeds(self.now))
        p, *_ = np.linalg.lstsq(C @ (C / self.heavy).T, goal - C @ w, rcond=1e-10)
        return w + (C / self.heavy).T @ p, p[:len(active)]

    def collide(self, y):
        """Freewheels that would turn backward stop that at once."""
        n = self.it.count
        w = y[n:2 * n]
        wheels = [h for h in range(len(self.it.elements)) if self.one_way(h)]
        if all(self.C[h] @ w >= -1e-11 for h in wheels):
            return y
        if any(e1 * e2 < 1.0 for e1, e2, _, _ in (gear["loss"](0.0) for gear in self.it.gears)):
            raise Ambiguous("impact beside a gear with losses")
        if np.any(self.J == 0.0):
            raise Ambiguous("impact beside a massless shaft")
        for count in range(1, len(wheels) + 1):
            for active in itertools.combinations(wheels, count):
                after, p = self.project(w, active)
                if (p >= -1e-12).all() and all(self.C[h] @ after > -1e-10 for h in wheels):
                    return np.concatenate([y[:n], after, y[2 * n:]])
        raise Ambiguous("impact")

    def later(self, t, y, modes):
        """The state LATER s behind: one step of Runge and Kutta."""
        h = LATER
        k1 = self.slope(t, y, modes)
        k2 = self.slope(t + h / 2, y + h / 2 * k1, modes)
        k3 = self.slope(t + h / 2, y + h / 2 * k2, modes)
        k4 = self.slope(t + h, y + h * k3, modes)
        return t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def leads(self, t, y, modes, x):
        """Switching functions of gears that turn: above 0 while the side that drives does."""
        n, h = self.it.count, len(self.it.elements)
        found = []
        for k, gear in enumerate(self.it.gears):
            mode = modes[h + k]
            if mode == STUCK:
                found.append(math.inf)
                continue
            lead = self.lead(gear, mode[0], x[n + h + 2 * k], y[n + gear["a"]])
            found.append(lead if mode[1] else -lead)
        return found

    def holds(self, t, y, modes, rest):
        """True where the conditions of the modes hold a short while later."""
        n, h = self.it.count, len(self.it.elements)
        at, state = self.later(t, y, modes)
        w = state[n:2 * n]
        _, _, reserves, x = self.solve(at, state, modes)
        if any(reserve < -1e-11 for reserve in reserves.values()):
            return False
        if any(lead < -1e-11 for lead in self.leads(at, state, modes, x)):
            return False
        small = 1e-12 * (1.0 + np.abs(w).max())
        for k, mode in enumerate(modes):
            f = self.C[k] @ w if k < h else w[self.it.gears[k - h]["a"]]
            sign = mode[0] if isinstance(mode, tuple) else mode
            if mode == STUCK and abs(f) > small:
                return False
            if k in rest and sign in (FORWARD, BACKWARD) and not sign * f > -1e-14:
                return False
        return True

    def choices(self, t, w):
        """Returns, for each element and gear, the modes that its slip allows, and those that are at rest."""
        choices, rest = [], []
        for h in range(len(self.it.elements)):
            f = self.C[h] @ w
            if not self.one_way(h) and not self.it.capacity(h, t + LATER, self.after) > 0.0:
                choices.append([FREE])
            elif abs(f) > 1e-9:
                choices.append([FORWARD if f > 0.0 else BACKWARD])
            else:
                rest.append(h)
                choices.append([STUCK, FORWARD] + ([] if self.one_way(h) else [BACKWARD]))
        for k, gear in enumerate(self.it.gears):
            f = w[gear["a"]]
            is_lossless = gear["loss"](0.0) == (1.0, 1.0, 0.0, 0.0)
            drives = [1] if is_lossless else [1, 0]
            if is_lossless or abs(f) > 1e-9:
                choices.append([(1 if f > 0.0 else -1, d) for d in drives])
            else:
                rest.append(len(self.it.elements) + k)
                choices.append([STUCK] + [(s, d) for s in (1, -1) for d in drives])
        return choices, rest

    def decide(self, t, y):
        self.now = t
        y = self.collide(y)
        n, h = self.it.count, len(self.it.elements)
        w = y[n:2 * n]
        choices, rest = self.choices(t, w)
        found = []
        for modes in itertools.product(*choices):
            stuck = [k for k in rest if modes[k] == STUCK]
            at = y.copy()
            rows = [self.C[k] if k < h else np.eye(n)[self.it.gears[k - h]["a"]] for k in stuck]
            C = np.vstack([np.array(rows).reshape(-1, n), self.G, self.rows])
            if len(C):  # exactly at rest
                goal = np.append(np.zeros(len(rows) + len(self.G)), self.it.speeds(t))
                p, *_ = np.linalg.lstsq(C @ (C / self.heavy).T, goal - C @ w, rcond=1e-10)
                at[n:2 * n] = w + (C / self.heavy).T @ p
            try:
                if self.holds(t, at, modes, rest):
                    found.append((modes, at, self.later(t, at, modes)[1]))
            except np.linalg.LinAlgError:
                continue
        if not found:
            raise Ambiguous(f"no modes at {t}")
        # An element that can stick does, though with static > 1 it might slide, too.
        might_stick = [k for k in rest if k < h and self.it.elements[k]["static"] > 1.0]
        stuck = lambda one: (-sum(one[0][k] != STUCK for k in might_stick),
                             sum(mode == STUCK for mode in one[0]))
        found.sort(key=stuck, reverse=True)
        for other in found[1:]:
            if stuck(other) == stuck(found[0]) and \
                    np.abs(other[2] - found[0][2])[:2 * n].max() > 1e-10:
                raise Ambiguous(f"several modes at {t}")
        return list(found[0][0]), found[0][1]

    def conditions(self, t, y, modes):
        """Values that do not become negative in these modes."""
        n, h = self.it.count, len(self.it.elements)
        w = y[n:2 * n]
        _, _, reserves, x = self.solve(t, y, modes)
        values = [reserves.get(k, math.inf) for k in range(len(modes))]
        values += self.leads(t, y, modes, x)
        for k, mode in enumerate(modes):
            f = self.C[k] @ w if k < h else w[self.it.gears[k - h]["a"]]
            sign = mode[0] if isinstance(mode, tuple) else mode
            lossless = k >= h and self.it.gears[k - h]["loss"](0.0) == (1.0, 1.0, 0.0, 0.0)
            values.append(sign * f if sign in (FORWARD, BACKWARD) and not lossless else math.inf)
            capacity = math.inf if k >= h or self.one_way(k) else self.it.capacity(k, t, self.after)
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
                if z >= -1e-13 or math.isnan(z):
                    continue
                if not x > -1e-13 or math.isinf(x):
                    found.append(a if a > begin + LATER else b)
                    continue
                # (A shared reserve is 0 where one of its elements transmits nothing.)
                root = brentq(lambda t, k=k: max(self.conditions(t, dense(t), modes)[k], -1.0) + 1e-13,
                              a, b, xtol=1e-14, rtol=1e-14)
                found.append(root)
            if found:
                return min(found)
            before = values
        return None

    def run(self, times):
        """Rows of time, angles, velocities, heat, modes."""
        parts = len(self.it.elements) + len(self.it.gears)
        y = np.concatenate([np.zeros(self.it.count), np.array(self.it.velocity, dtype=float),
                            np.zeros(parts)])
        t, rows, count = 0.0, [], 0
        targets = sorted(set(times) | {s for s in self.it.breaks if s < times[-1]})
        modes, y = self.decide(t, y)
        for target in targets:
            while t < target:
                count += 1
                if count > 400:
                    raise Ambiguous("too many events")
                begin, event = t, None
                solver = DOP853(lambda s, x, m=tuple(modes): self.slope(s, x, m), t, y, target,
                                rtol=self.tolerance, atol=0.1 * self.tolerance, max_step=0.02)
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
            if target in self.it.breaks:
                self.after.add(target)
                before = modes
                modes, y = self.decide(t, y)
                self.note(t, before, modes)
            if target in times:
                rows.append([t, *y, *[told(mode) for mode in modes]])
        return rows

    def note(self, t, before, modes):
        for h, (a, b) in enumerate(zip(before, modes)):
            if told(a) != told(b):
                self.events.append((t, h, told(a), told(b)))


def told(mode):
    """A gear's mode is 1 where its first shaft drives, -1 where the second does."""
    return mode if not isinstance(mode, tuple) else 1 if mode[1] else -1


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
