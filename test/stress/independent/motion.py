#!/usr/bin/python3
"""An independent reference: the motion of a scene from the documents, with SciPy.

    motion.py SCENE.yaml --times 0,0.5,1 [--commands FILE.csv]     prints CSV as `simulate` does

Nothing here is taken from the C++ sources. The equations are those of doc/theory.md, as one
KKT system in the jerks (generalized_gauss) or in the accelerations (gauss):

    generalized_gauss   J eta + g = C' Lambda,      C eta + c0 = 0
    gauss               J eps + n - Q = C' lambda,  psi = 0       (orders 1, 2)
                        its total derivative with C eta + c0 = 0  (with an order 3)

Nothing is projected or stabilised. Laws are graphs with exact derivatives (graph.py, laws.py);
between two events they are smooth, and DOP853 of SciPy integrates them at a tolerance of 1e-13.
Known instants end steps; guards are looked at on a grid of the dense output, with their rates, so
that pairs of zeros are seen too, and the step is repeated up to the zero.
"""
import argparse
import csv
import math

import numpy as np
import yaml
from scipy.integrate import DOP853
from scipy.optimize import brentq

import graph
import laws
from graph import derive, reads, variable, wrap

QUANTITIES = ("angle", "velocity", "acceleration", "applied_torque", "reaction_torque",
              "reaction_torque_rate")


class Unable(Exception):
    """The reference has no answer: `kind` says why."""

    def __init__(self, kind, time, text=""):
        super().__init__(f"{kind} at {time!r} s {text}")
        self.kind, self.time = kind, time


def load(scene_file, commands_file=None):
    """The dictionary of a scene and its commands [(time, topic, value)]."""
    with open(scene_file) as f:
        data = yaml.safe_load(f)
    commands = []
    if commands_file:
        with open(commands_file) as f:
            for row in csv.DictReader(line for line in f if line.strip() and line[0] != "#"):
                commands.append((float(row["time"]), row["topic"], float(row["value"])))
    return data, commands


class Motion:
    """A scene with its commands; `sample` gives its columns at some times."""

    def __init__(self, data, commands=(), duration=1e9, tolerance=1e-13):
        graph.forget()
        self.tolerance = tolerance
        self.shafts = list(data["shafts"])
        s = self.s = len(self.shafts)
        name = lambda letter: [f"{letter}{i + 1}" for i in range(s)]
        self.modes = graph.Modes()
        t = variable("t")
        phi, w, e, j = ([variable(x) for x in name(c)] for c in ("phi", "w", "e", "j"))
        b = laws.Build(self.shafts, t, phi, w, e, j, self.modes)
        inputs = 40
        b.symbols = [variable(f"in{m}") for m in range(inputs)]
        J = self._inertia(data, phi)
        Q = [wrap(0.0)] * s
        for element in data.get("torques") or []:
            for i, q in laws.torque(b, data[element]).items():
                Q[i] = Q[i] + q
        self.constraints = list(data.get("constraints") or [])
        k = self.k = len(self.constraints)
        made = [laws.constraint(b, data[c]) for c in self.constraints]
        self.orders = [order for order, _ in made]
        self.gauss = data.get("principle", "generalized_gauss") == "gauss"
        self.formal = self.gauss and 3 in self.orders
        self.inputs = b.inputs
        for u in self.inputs:
            u.run([(c[0], c[2]) for c in commands if c[1] == u.topic], duration)
        m = len(self.inputs)

        # Total derivatives: at eta = 0, and along a jump of the inputs.
        still = {"t": 1.0}
        for i in range(s):
            still[f"phi{i + 1}"], still[f"w{i + 1}"] = w[i], e[i]
        for i in range(m):
            still[f"in{i}"], still[f"in_d{i}"] = variable(f"in_d{i}"), variable(f"in_dd{i}")
        memory = {}
        rate = lambda f: derive(f, still, memory)
        partial = lambda f, x: derive(f, {x: 1.0})
        n = []
        for i in range(s):
            kinetic = wrap(0.0)
            momentum = wrap(0.0)
            for a in range(s):
                momentum = momentum + rate(J[i][a]) * w[a]
                for c in range(s):
                    kinetic = kinetic + partial(J[a][c], f"phi{i + 1}") * w[a] * w[c]
            n.append(momentum - 0.5 * kinetic)
        drift = [sum((rate(J[i][a]) * e[a] for a in range(s)), wrap(0.0)) + rate(n[i]) - rate(Q[i])
                 for i in range(s)]
        # [sigma tau, p] omega_tau, so that G = R' - this J^-1 R
        christoffel = [[sum((0.5 * (partial(J[c][p], f"phi{a + 1}") + partial(J[a][p], f"phi{c + 1}")
                                    - partial(J[a][c], f"phi{p + 1}")) * w[c] for c in range(s)),
                            wrap(0.0)) for p in range(s)] for a in range(s)]
        psi, C, c0, kept = [], [], [], []
        for order, f in made:
            if order == 3:
                C.append([partial(f, f"j{i + 1}") for i in range(s)])
                c0.append(derive_at_zero(f, [f"j{i + 1}" for i in range(s)]))
                psi.append(wrap(0.0))
                continue
            second = rate(f) if order == 1 else f
            # rate(f) has the part of eps already: still maps w to e
            psi.append(second)
            C.append([partial(second, f"e{i + 1}") for i in range(s)])
            c0.append(rate(second))
            kept.append(f if order == 1 else None)
        self.kept = [i for i in range(k) if self.orders[i] < 3]
        first = [f for order, f in made if order == 1]
        first_rows = [[partial(f, f"w{i + 1}") for i in range(s)] for f in first]
        jump_seed = {f"in{i}": variable(f"in_x{i}") for i in range(m)}
        along = lambda f: derive(f, jump_seed)

        lam = [variable(f"l{c}") for c in range(k)]
        force = lambda rows: [sum((J[i][a] * e[a] for a in range(s)), wrap(0.0)) + n[i] - Q[i]
                              - sum((lam[c] * C[c][i] for c in rows), wrap(0.0)) for i in range(s)]
        least = force(self.kept)
        whole = force(range(k))

        # If C reads accelerations (or the sign of one), psi may have many points of least reaction.
        accelerations = set(name("e"))
        self.nonlinear = any(reads(C[c][i], accelerations) for c in self.kept for i in range(s)) or any(
            reads(x, accelerations) for x, _ in self.modes.guards)

        zeros = [f"in{i}" for i in range(m)]
        signature = {"t": None, "q": name("phi"), "w": name("w"), "e": name("e"),
                     "l": [f"l{c}" for c in range(k)], "I0": zeros,
                     "I1": [f"in_d{i}" for i in range(m)], "I2": [f"in_dd{i}" for i in range(m)],
                     "IX": [f"in_x{i}" for i in range(m)], "M": None}
        tables = [table for _, table in self.modes.guards]
        make = lambda outputs: graph.compile_function(outputs, signature, tables)
        self.f_motion = make([J, n, Q, drift, christoffel, C, c0, psi])
        self.f_first = make([first, first_rows, J])
        self.f_kkt = make([least, [psi[c] for c in self.kept],
                           [[partial(f, f"e{i + 1}") for i in range(s)] for f in least],
                           [C[c] for c in self.kept]])
        self.f_whole = make([whole, [[partial(f, f"e{i + 1}") for i in range(s)] for f in whole],
                             [rate(f) for f in whole], C, c0])
        self.f_jump = make([J, C, [along(q) for q in Q], [along(p) for p in psi],
                            [along(f) for f in whole],
                            [[partial(f, f"e{i + 1}") for i in range(s)] for f in whole]])
        full = dict(still)
        for i in range(s):
            full[f"e{i + 1}"] = j[i]
        guard_signature = dict(signature)
        guard_signature["j"] = name("j")
        arguments = [x for x, _ in self.modes.guards]
        self.f_guards = graph.compile_function([arguments, [derive(x, full) for x in arguments]],
                                               guard_signature, tables)
        self._know_instants(arguments, name)
        self.reads_acceleration = [reads(x, set(name("e"))) for x in arguments]
        self._start(data)

    def _inertia(self, data, phi):
        s = self.s
        J = [[wrap(0.0)] * s for _ in range(s)]
        for i, shaft in enumerate(self.shafts):
            inertia = data[shaft]["inertia"]
            if isinstance(inertia, dict):
                J[i][i] = wrap(inertia["mean"])
                for h in inertia.get("harmonics", []):
                    z = h["order"] * phi[i]
                    J[i][i] = (J[i][i] + h.get("cos", 0.0) * graph.cos(z)
                               + h.get("sin", 0.0) * graph.sin(z))
            else:
                J[i][i] = wrap(inertia)
        for a, c, value in data.get("inertia_coupling") or []:
            i, m = self.shafts.index(a), self.shafts.index(c)
            J[i][m] = J[m][i] = wrap(value)
        return J

    def _know_instants(self, arguments, name):
        """Guards that are linear in t alone have zeros that are known beforehand."""
        others = {x for c in ("phi", "w", "e", "j") for x in name(c)}
        others |= {f"in{m}" for m in range(len(self.inputs))}
        self.timed, self.instants = [], set()
        for x, table in self.modes.guards:
            slope = derive(x, {"t": 1.0})
            timed = not reads(x, others) and slope.op == "number" and slope.arguments[0] != 0.0
            self.timed.append(timed)
            if timed:
                at_zero = graph.compile_function([x], {"t": None, "M": None}, [])(0.0, ())[0]
                for knot in (table.knots if table else [0.0]):
                    self.instants.add((knot - at_zero) / slope.arguments[0])
        self.watched = [i for i, timed in enumerate(self.timed) if not timed]
        for u in self.inputs:
            self.instants.update(u.instants)

    # --- evaluations ---------------------------------------------------------------------------

    def _inputs(self, t):
        """u, u', u'' within the present segment."""
        values = [piece(t) for piece in self.pieces]
        return [v[0] for v in values], [v[1] for v in values], [v[2] for v in values]

    def _arguments(self, t, q, w, e, l=None, x=None):
        u = self._inputs(t)
        return (t, q, w, e, l if l is not None else [0.0] * self.k, *u,
                x if x is not None else [0.0] * len(self.inputs), self.M)

    def _choose_pieces(self, t):
        """The pieces of the inputs that hold from t on."""
        self.pieces = []
        for u in self.inputs:
            found = u.pieces[0][1]
            for begin, piece in u.pieces:
                if begin <= t:
                    found = piece
            self.pieces.append(found)

    def _choose_timed(self, middle):
        zeros = [0.0] * self.s
        for _ in range(10):  # guards within guards
            values = self._guards(middle, zeros, zeros, zeros)[0]
            old = self.M
            self.M = [self._mode(i, values[i]) if timed else m
                      for i, (timed, m) in enumerate(zip(self.timed, self.M))]
            if self.M == old:
                return

    def _mode(self, i, value):
        table = self.modes.guards[i][1]
        return table.piece_at(value) if table else math.copysign(1.0, value)

    def _guards(self, t, q, w, e, j=None):
        return self.f_guards(*self._arguments(t, q, w, e), j if j is not None else [0.0] * self.s)

    def _split(self, y):
        """q, w, e, l of an integrator's state."""
        s = self.s
        y = [float(v) for v in y]
        if self.formal:
            return y[:s], y[s:2 * s], y[2 * s:3 * s], y[3 * s:]
        if self.gauss:
            return y[:s], y[s:], None, None
        return y[:s], y[s:2 * s], y[2 * s:], None

    def _join(self):
        if self.formal:
            return np.array([*self.q, *self.w, *self.e, *self.l])
        if self.gauss:
            return np.array([*self.q, *self.w])
        return np.array([*self.q, *self.w, *self.e])

    def _solve_gauss(self, t, q, w, e, l, steps=60):
        """eps and lambda of the classical principle, by Newton's iteration from (e, l)."""
        s, k = self.s, len(self.kept)
        x = np.array([*e, *l])
        last = math.inf
        for step in range(steps):
            full = np.zeros(self.k)
            full[self.kept] = x[s:]
            F1, F2, dF1, C = self.f_kkt(*self._arguments(t, q, w, x[:s].tolist(), full.tolist()))
            A = np.zeros((s + k, s + k))
            A[:s, :s] = dF1
            if k:
                A[:s, s:] = -np.array(C).T
                A[s:, :s] = C
            try:
                change = np.linalg.solve(A, -np.array([*F1, *F2]))
            except np.linalg.LinAlgError:
                raise Unable("singular", t) from None
            size = float(np.max(np.abs(change))) / (1.0 + float(np.max(np.abs(x))))
            x = x + change
            if not math.isfinite(size):
                raise Unable("not finite", t)
            if size < 1e-14 or (size < 1e-11 and size >= last):
                return x[:s].tolist(), x[s:].tolist()
            last = size
        raise Unable("no convergence", t)

    def _jerk(self, t, q, w, e, l=None):
        """eta and the multipliers' rates (gauss) or multipliers (generalized_gauss)."""
        s, k = self.s, self.k
        A = np.zeros((s + k, s + k))
        if self.gauss:
            whole, dF, F_t, C, c0 = self.f_whole(*self._arguments(t, q, w, e, l))
            A[:s, :s] = dF
            right = [-f for f in F_t]
        else:
            J, n, Q, drift, K, C, c0, _ = self.f_motion(*self._arguments(t, q, w, e))
            A[:s, :s] = J
            Jm = np.array(J)
            R = Jm @ e + np.array(n) - np.array(Q)
            right = list(np.array(K) @ np.linalg.solve(Jm, R) - np.array(drift))
        if k:
            A[:s, s:] = -np.array(C).T
            A[s:, :s] = C
        try:
            x = np.linalg.solve(A, np.array([*right, *(-c for c in c0)]))
        except np.linalg.LinAlgError:
            raise Unable("singular", t) from None
        return x[:s].tolist(), x[s:].tolist()

    def _right_hand_side(self, t, y):
        q, w, e, l = self._split(y)
        if self.gauss and not self.formal:
            self.e, self.l = self._solve_gauss(t, q, w, self.e, self.l)
            return [*w, *self.e]
        eta, rates = self._jerk(t, q, w, e, l)
        return [*w, *e, *eta, *rates] if self.formal else [*w, *e, *eta]

    def _complete(self, t, y):
        """q, w, e, eta at a point of the dense output."""
        q, w, e, l = self._split(y)
        if self.gauss and not self.formal:
            e, l = self._solve_gauss(t, q, w, self.e, self.l)
        return q, w, e, self._jerk(t, q, w, e, l)[0]

    # --- the start -----------------------------------------------------------------------------

    def _start(self, data):
        s = self.s
        initial = data.get("initial") or {}
        zeros = [0.0] * s
        self.q = [float(x) for x in initial.get("angle", zeros)]
        self.w = [float(x) for x in initial.get("velocity", zeros)]
        given = initial.get("acceleration")
        self.t = 0.0
        self.M = [1.0] * len(self.modes.guards)
        self._choose_pieces(0.0)
        self.e, self.l = list(zeros), [0.0] * len(self.kept)
        self._choose_timed(1e-9)
        self._keep_velocities()
        self._choose_watched()
        if given is not None and not (self.gauss and not self.formal):
            self.e = [float(x) for x in given]
            self._choose_watched()
            self._keep_accelerations()
            if not self._fits():
                raise Unable("no start", 0.0)
        else:
            self.e, self.l = self._least_reaction()
        if self.formal:
            args = self._arguments(0.0, self.q, self.w, self.e)
            J, n, Q, _, _, C, _, _ = self.f_motion(*args)
            R = np.array(J) @ self.e + np.array(n) - np.array(Q)
            self.l = np.linalg.lstsq(np.array(C).T, R, rcond=None)[0].tolist()

    def _choose_watched(self):
        for _ in range(10):  # guards within guards
            values, rates = self._guards(self.t, self.q, self.w, self.e)
            old, self.M = self.M, list(self.M)
            for i in self.watched:
                self.M[i] = self._mode(i, values[i] if values[i] != 0.0 else rates[i])
            if self.M == old:
                return

    def _keep_velocities(self):
        if 1 not in self.orders:
            return
        for _ in range(30):
            f, C, J = self.f_first(*self._arguments(self.t, self.q, self.w, self.e))
            C, J = np.array(C), np.array(J)
            change = -np.linalg.solve(J, C.T @ np.linalg.solve(C @ np.linalg.solve(J, C.T), f))
            self.w = (np.array(self.w) + change).tolist()
            if np.max(np.abs(change)) < 1e-15 * (1 + np.max(np.abs(self.w))):
                break

    def _keep_accelerations(self):
        """Moves eps onto psi = 0 in the metric J; returns how far."""
        if not self.kept:
            return 0.0
        begin = np.array(self.e)
        for _ in range(30):
            J, _, _, _, _, C, _, psi = self.f_motion(*self._arguments(self.t, self.q, self.w, self.e))
            C, J = np.array(C)[self.kept], np.array(J)
            f = np.array(psi)[self.kept]
            change = -np.linalg.solve(J, C.T @ np.linalg.solve(C @ np.linalg.solve(J, C.T), f))
            self.e = (np.array(self.e) + change).tolist()
            if np.max(np.abs(change)) < 1e-15 * (1 + np.max(np.abs(self.e))):
                break
        return float(np.max(np.abs(np.array(self.e) - begin)))

    def _cost(self, e):
        J, n, Q = (np.array(x) for x in self.f_motion(*self._arguments(self.t, self.q, self.w, e))[:3])
        R = J @ e + n - Q
        return 0.5 * float(R @ np.linalg.solve(J, R))

    def _least_reaction(self, starts=200):
        """The least of the stationary points that Newton's iteration finds from many starts; guards
        that read accelerations are tried with either sign."""
        random = np.random.default_rng(1)
        J, n, Q = (np.array(x) for x in self.f_motion(*self._arguments(self.t, self.q, self.w, self.e))[:3])
        free = np.linalg.solve(J, Q - n)
        loose = [i for i in self.watched if self.reads_acceleration[i]]
        found = []
        for trial in range(starts if self.nonlinear else 1):
            self.e = free.tolist()
            if trial:
                self.e = (free + random.normal(size=self.s) * 10.0 ** random.uniform(-1, 2)).tolist()
            for i in loose:
                self.M[i] = random.choice([-1.0, 1.0])
            try:
                l = [0.0] * len(self.kept)
                if trial % 2:  # from a point of psi = 0 and the multipliers that fit it best
                    self._keep_accelerations()
                    C = self.f_motion(*self._arguments(self.t, self.q, self.w, self.e))[5]
                    R = J @ self.e + n - Q
                    l = np.linalg.lstsq(np.array(C)[self.kept].T, R, rcond=None)[0].tolist()
                e, l = self._solve_gauss(self.t, self.q, self.w, self.e, l)
            except (Unable, ArithmeticError, np.linalg.LinAlgError, ValueError):
                continue
            values = self._guards(self.t, self.q, self.w, e)[0]
            if all(values[i] * self.M[i] >= 0.0 for i in loose):
                found.append((self._cost(e), e, l, list(self.M)))
        if not found:
            raise Unable("no start", 0.0)
        found.sort(key=lambda x: x[0])
        best = found[0]
        for other in found[1:]:
            same = np.max(np.abs(np.array(other[1]) - best[1])) < 1e-6 * (1 + np.max(np.abs(best[1])))
            if not same and other[0] < best[0] * (1 + 1e-6) + 1e-9:
                raise Unable("tie at the start", 0.0)
        self.M, self.e = best[3], best[1]
        for i in loose:
            if self._cost_of_corner(i, best[1], best[2]) < best[0] * (1 - 1e-9) - 1e-9:
                raise Unable("least reaction at a corner of psi", 0.0)
        return best[1], best[2]

    def _cost_of_corner(self, guard, e, l):
        """The least reaction under psi = 0 where guard = 0, a linear function of the accelerations."""
        s, k = self.s, len(self.kept)
        value = lambda e: self._guards(self.t, self.q, self.w, e)[0][guard]
        row = np.array([value(x.tolist()) for x in np.eye(s)]) - value([0.0] * s)
        x = np.array([*e, *l, 0.0])
        for _ in range(50):
            full = np.zeros(self.k)
            full[self.kept] = x[s:s + k]
            F1, F2, dF1, C = self.f_kkt(*self._arguments(self.t, self.q, self.w, x[:s].tolist(),
                                                         full.tolist()))
            rows = np.vstack([np.array(C).reshape(k, s), row])
            A = np.block([[np.array(dF1), -rows.T], [rows, np.zeros((k + 1, k + 1))]])
            right = np.array([*(np.array(F1) - row * x[-1]), *F2, value(x[:s].tolist())])
            change = np.linalg.lstsq(A, -right, rcond=None)[0]
            x = x + change
            if np.max(np.abs(change)) < 1e-12 * (1 + np.max(np.abs(x))):
                return self._cost(x[:s].tolist())
        return math.inf

    def disturb(self, size, seed=0):
        """Moves the start by about `size`, within the constraints."""
        random = np.random.default_rng(seed)
        self.q = (np.array(self.q) + size * random.normal(size=self.s)).tolist()
        self.w = (np.array(self.w) + size * random.normal(size=self.s)).tolist()
        self._keep_velocities()
        if not self.gauss:
            self.e = (np.array(self.e) + size * random.normal(size=self.s)).tolist()
        for _ in range(10):
            self._choose_watched()
            if self.gauss and not self.formal:
                self.e, self.l = self._solve_gauss(self.t, self.q, self.w, self.e, self.l)
            else:
                self._keep_accelerations()
            if self._fits():
                return
        raise Unable("no start", self.t)

    def _fits(self):
        """Whether the accelerations lie in the branch of psi that they were found in."""
        values = self._guards(self.t, self.q, self.w, self.e)[0]
        return all(self.M[i] * values[i] >= -1e-12 for i in self.watched if self.reads_acceleration[i])

    # --- jumps ---------------------------------------------------------------------------------

    def _jump(self, change, torque_change=None, psi_change=None):
        """eps behind a jump of the inputs by `change` (from the values before it, in self.pieces), or
        of the laws by torque_change and psi_change: along the straight line, as doc/theory.md says."""
        s, k = self.s, self.k
        before = self._inputs(self.t)

        def direction(theta, y):
            u = [u0 + theta * d for u0, d in zip(before[0], change)]
            l = y[s:].tolist() if self.formal else [0.0] * k
            J, C, dQ, dpsi, dF, FJ = self.f_jump(self.t, self.q, self.w, y[:s].tolist(), l, u,
                                                 before[1], before[2], change, self.M)
            A = np.zeros((s + k, s + k))
            A[:s, :s] = FJ if self.formal else J
            right = -np.array(dF) if self.formal else np.array(dQ)
            if torque_change is not None:
                right = right + torque_change
            low = -np.array(dpsi)
            if psi_change is not None:
                low = low - psi_change
            if k:
                A[:s, s:] = -np.array(C).T
                A[s:, :s] = C
            x = np.linalg.solve(A, np.array([*right, *low]))
            return x if self.formal else x[:s]

        def distances(theta, y):
            u = [u0 + theta * d for u0, d in zip(before[0], change)]
            values = self.f_guards(self.t, self.q, self.w, y[:s].tolist(), [0.0] * k, u, before[1],
                                   before[2], change, self.M, [0.0] * s)[0]
            return [self._distance(i, values[i])[0] for i in loose]

        loose = [i for i in self.watched if self.reads_acceleration[i]]
        y = np.array([*self.e, *self.l]) if self.formal else np.array(self.e)
        theta, flips = 0.0, 0
        while theta < 1.0:
            solver = DOP853(direction, theta, y, 1.0, rtol=1e-13, atol=1e-13, max_step=0.05)
            event = None
            while solver.status == "running" and event is None:
                solver.step()
                if solver.status == "failed" or solver.nfev > 100000:
                    raise Unable("jump failed", self.t)
                if loose:
                    dense = solver.dense_output()
                    for x in np.linspace(solver.t_old, solver.t, 9)[1:]:
                        h = distances(x, dense(x))
                        if min(h) < 0.0:
                            i = int(np.argmin(h))
                            left = solver.t_old
                            if distances(left, dense(left))[i] <= 0.0:
                                raise Unable("jump sticks to a kink", self.t)
                            event = brentq(lambda x, i=i: distances(x, dense(x))[i], left, x), loose[i]
                            break
            if event is None:
                y = solver.y
                break
            flips += 1
            if flips > 20:
                raise Unable("jump sticks to a kink", self.t)
            theta, guard = event
            y = dense(theta)
            # a hair beyond, so that the next search does not begin at the same zero
            self.M = [-m if i == guard else m for i, m in enumerate(self.M)]
            theta = min(1.0, theta + 1e-13)
            y = y + 1e-13 * direction(theta, y)
        self.e = y[:s].tolist()
        if self.formal:
            self.l = y[s:].tolist()

    def _jump_inputs(self):
        """At self.t: takes the pieces that hold from here on; all inputs that jump move together."""
        old = self._inputs(self.t)[0]
        pieces = self.pieces
        self._choose_pieces(self.t)
        new = self._inputs(self.t)[0]
        change = [b - a if u.hold == "zero_order" else 0.0
                  for u, a, b in zip(self.inputs, old, new)]
        if not any(change):
            return
        fresh, self.pieces = self.pieces, pieces
        if self.gauss and not self.formal:
            for theta in np.linspace(0.0, 1.0, 21)[1:]:
                self.pieces = [laws.Input.constant(a + float(theta) * d) if d else p
                               for a, d, p in zip(old, change, fresh)]
                self.e, self.l = self._solve_gauss(self.t, self.q, self.w, self.e, self.l)
                self._match_accelerations()
            self.pieces = fresh
        else:
            self._jump(change)
            self.pieces = fresh
            self._keep_accelerations()

    def _match_accelerations(self):
        """gauss, behind a jump: the branch of psi in which the new accelerations lie."""
        for _ in range(10):
            values = self._guards(self.t, self.q, self.w, self.e)[0]
            wrong = [i for i in self.watched if self.reads_acceleration[i]
                     and self.M[i] * values[i] < -1e-12]
            if not wrong:
                return
            self.M = [-m if i in wrong else m for i, m in enumerate(self.M)]
            self.e, self.l = self._solve_gauss(self.t, self.q, self.w, self.e, self.l)
        raise Unable("no branch", self.t)

    def _laws(self):
        out = self.f_motion(*self._arguments(self.t, self.q, self.w, self.e))
        return np.array(out[2]), np.array(out[7])

    def _flip(self, new):
        """Modes become `new`; where Q or psi jump with them the accelerations do."""
        if self.gauss and not self.formal:
            self.M = new
            self.e, self.l = self._solve_gauss(self.t, self.q, self.w, self.e, self.l)
            self._match_accelerations()
            return
        Q0, psi0 = self._laws()
        self.M = new
        Q1, psi1 = self._laws()
        dQ, dpsi = Q1 - Q0, psi1 - psi0
        if np.max(np.abs(dQ)) > 1e-9 * (1 + np.max(np.abs(Q0))) or (
                self.k and np.max(np.abs(dpsi)) > 1e-9):
            self._jump([0.0] * len(self.inputs), dQ, dpsi if self.k else None)
            self._keep_accelerations()

    # --- integration ---------------------------------------------------------------------------

    def _solver(self, t, y, end):
        span = end - t
        return DOP853(self._right_hand_side, t, y, end, rtol=self.tolerance, atol=self.tolerance,
                      max_step=min(0.02, span) if self.watched else np.inf)

    def _take(self, t, y):
        self.t = t
        self.q, self.w, e, l = self._split(y)
        if e is not None:
            self.e = e
        if l is not None:
            self.l = l
        if self.gauss and not self.formal:
            self.e, self.l = self._solve_gauss(t, self.q, self.w, self.e, self.l)

    def _distance(self, i, value):
        """The distance of guard i from the end of its present mode, and d distance / d value."""
        table = self.modes.guards[i][1]
        if table is None:
            return self.M[i] * value, self.M[i]
        knots, piece = table.knots, int(self.M[i])
        low = value - knots[piece - 1] if piece > 0 else math.inf
        high = knots[piece] - value if piece < len(knots) else math.inf
        return (low, 1.0) if low <= high else (high, -1.0)

    def _distances(self, t, y):
        values, rates = self._guards(t, *self._complete(t, y))
        out = {}
        for i in self.watched:
            h, sign = self._distance(i, values[i])
            out[i] = (h, sign * rates[i])
        return out

    def _first_event(self, solver, start, fresh):
        """(time, guard) of the first zero within the solver's last step, or None. `fresh`: guards that
        have just crossed at `start`."""
        dense = solver.dense_output()
        a, b = solver.t_old, solver.t
        grid = np.linspace(a, b, 9)
        points = [self._distances(x, dense(x)) for x in grid]
        best = None
        for i in self.watched:
            h = lambda x, i=i: self._distances(x, dense(x))[i][0]
            slope = lambda x, i=i: self._distances(x, dense(x))[i][1]
            for m in range(8):
                (ha, sa), (hb, sb) = points[m][i], points[m + 1][i]
                left, right = float(grid[m]), float(grid[m + 1])
                if m == 0 and a == start:
                    if i in fresh:
                        if sa < 0.0:
                            raise Unable("Chattering", start, f"guard {i}")
                        ha = 0.0
                        if hb < 0.0:
                            left = brentq(slope, left, right) if sa * sb < 0 else left
                            ha = h(left)
                            if ha <= 0.0:
                                raise Unable("touch", start, f"guard {i}")
                    elif ha <= 0.0 and sa < 0.0:
                        best = (a, i)
                        break
                    elif ha <= 0.0 and hb > 0.0:  # it comes from its zero
                        continue
                root = None
                if hb < 0.0:
                    root = brentq(h, left, right, xtol=1e-15, rtol=1e-15) if ha > 0.0 else left
                elif sa < 0.0 < sb:
                    width = right - left
                    # of the tangents at both ends: where they meet lies below the curve if it is convex
                    meet = (hb - sb * width - ha) / (sa - sb)
                    if ha + sa * meet <= 0.0 or ha + sa * meet < 0.5 * min(ha, hb):
                        middle = brentq(slope, left, right)
                        if h(middle) < 0.0 < ha:
                            root = brentq(h, left, middle, xtol=1e-15, rtol=1e-15)
                if root is not None:
                    if best is None or root < best[0]:
                        best = (root, i)
                    break
        return best

    def _advance(self, end):
        """To `end`, between two known instants."""
        fresh = set()
        events = 0
        while self.t < end:
            start = self.t
            solver = self._solver(start, self._join(), end)
            event = None
            while solver.status == "running":
                before = solver.t, solver.y.copy()
                held = self.e, self.l
                solver.step()
                if solver.status == "failed" or solver.nfev > 400000:
                    raise Unable("integration failed", solver.t)
                if self.watched:
                    event = self._first_event(solver, start, fresh)
                    if event:
                        break
            if not event:
                self._take(solver.t, solver.y)
                return
            events += 1
            if events > 3000:
                raise Unable("too many events", event[0])
            when, guard = event
            if self.gauss and self.reads_acceleration[guard]:
                # The least reaction jumps or stays at the corner: no page says which branch is meant.
                raise Unable("corner of psi under gauss", when)
            for _ in range(4):  # the step again, up to the zero
                self.e, self.l = held
                t, y = before
                if when > t:
                    solver = self._solver(t, y, when)
                    solver.max_step = np.inf
                    while solver.status == "running":
                        solver.step()
                    if solver.status == "failed":
                        raise Unable("integration failed", solver.t)
                    t, y = solver.t, solver.y
                h, rate = self._distances(t, y)[guard]
                if rate == 0.0:
                    break
                step = -h / rate
                if abs(step) <= 4e-16 * max(1.0, t) or abs(step) > 1e-6 or when + step < before[0]:
                    break
                when += step
            self._take(t, y)
            new = list(self.M)
            table = self.modes.guards[guard][1]
            if table is None:
                new[guard] = -new[guard]
            else:
                value = self._guards(self.t, self.q, self.w, self.e)[0][guard]
                piece = int(new[guard])
                up = piece < len(table.knots) and (
                    piece == 0 or table.knots[piece] - value < value - table.knots[piece - 1])
                new[guard] = piece + 1 if up else piece - 1
            self._flip(new)
            fresh = fresh | {guard} if self.t - start < 1e-12 else {guard}

    def sample(self, times):
        """Columns at the given times: {"SHAFT/QUANTITY": [..]}, and what is left of psi = 0."""
        columns = {f"{shaft}/{x}": [] for shaft in self.shafts for x in QUANTITIES}
        self.drift = 0.0
        times = sorted(times)
        stops = sorted({x for x in self.instants if 0.0 < x <= times[-1]} | set(times))
        if times[0] <= 0.0:
            self._write(columns)
        for stop in stops:
            if stop > self.t:
                self._advance(stop)
                self._settle(stops)
                self._jump_inputs()
                if stop in times:
                    self._write(columns)
        return columns

    def _look_at_branches(self):
        """gauss: refuses an answer where another branch of psi has a lesser reaction."""
        here, cost = (self.e, self.l, self.M), self._cost(self.e)
        for i in [i for i in self.watched if self.reads_acceleration[i]]:
            self.M = [-m if k == i else m for k, m in enumerate(here[2])]
            try:
                self.e, self.l = self._solve_gauss(self.t, self.q, self.w, here[0], here[1])
                better = self._fits() and self._cost(self.e) < cost * (1 + 1e-9)
            except Unable:
                better = False
            self.e, self.l, self.M = here
            if better:
                raise Unable("two branches of psi under gauss", self.t)

    def _settle(self, stops):
        """At a known instant: the modes of the time that follows, and the jumps that come with them."""
        old, later = list(self.M), [x for x in stops if x > self.t]
        self._choose_timed(0.5 * (self.t + later[0]) if later else self.t + 1e-3)
        new, self.M = self.M, old
        if new != old:
            self._flip(new)

    def _write(self, columns):
        t, q, w = self.t, self.q, self.w
        if self.gauss and not self.formal:
            self._look_at_branches()
        e, l = self.e, self.l
        J, n, Q, drift, _, C, _, psi = self.f_motion(*self._arguments(t, q, w, e))
        J = np.array(J)
        R = J @ e + np.array(n) - np.array(Q)
        rate = J @ self._jerk(t, q, w, e, l)[0] + np.array(drift)
        if self.kept:
            C, psi = np.array(C)[self.kept], np.array(psi)[self.kept]
            away = np.linalg.solve(J, C.T @ np.linalg.solve(C @ np.linalg.solve(J, C.T), psi))
            self.drift = max(self.drift, float(np.max(np.abs(away))) / (1.0 + float(np.max(np.abs(e)))))
        for i, shaft in enumerate(self.shafts):
            for x, value in zip(QUANTITIES, (q[i], w[i], e[i], Q[i], R[i], rate[i])):
                columns[f"{shaft}/{x}"].append(float(value))


def derive_at_zero(f, names):
    """f with the variables `names` set to 0."""
    zero = {name: wrap(0.0) for name in names}
    memory = {}

    def visit(n):
        if n.number in memory:
            return memory[n.number]
        if n.op == "variable":
            out = zero.get(n.arguments[0], n)
        elif n.op == "+":
            out = visit(n.arguments[0]) + visit(n.arguments[1])
        elif n.op == "*":
            out = visit(n.arguments[0]) * visit(n.arguments[1])
        elif n.op == "/":
            out = visit(n.arguments[0]) / visit(n.arguments[1])
        else:
            out = n  # linear in these names: nothing else contains them
        memory[n.number] = out
        return out

    return visit(f)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--times", required=True, help="T1,T2,..., in s")
    parser.add_argument("--commands", metavar="FILE.csv")
    arguments = parser.parse_args()
    times = sorted(float(t) for t in arguments.times.split(","))
    data, commands = load(arguments.scene, arguments.commands)
    columns = Motion(data, commands, times[-1]).sample(times)
    print(",".join(["time", *columns]))
    for row in zip(times, *columns.values()):
        print(",".join(f"{x:.15g}" for x in row))


if __name__ == "__main__":
    main()
