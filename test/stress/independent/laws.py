"""The laws of doc/scene.md, tables and commanded inputs, as graphs.

Written from those pages, not from the C++ sources: where the two differ, one of them is wrong.
"""
import bisect
import math

from graph import atan, cos, exp, parse, sin, sinh, sqrt, tanh, wrap

GRAVITY = 9.80665  # m/s^2, standard


class Table:
    """Quintic Hermite through points, with the slopes and second derivatives of doc/scene.md and
    include/variator_sim/table.h; its pieces are 0 (before the first point) to n (after the last)."""

    def __init__(self, x, y, beyond="constant"):
        self.knots = [float(v) for v in x]
        x, y, n = self.knots, [float(v) for v in y], len(x)
        h = [x[k + 1] - x[k] for k in range(n - 1)]
        d = [(y[k + 1] - y[k]) / h[k] for k in range(n - 1)]
        s, q = [0.0] * n, [0.0] * n
        for k in range(1, n - 1):
            if d[k - 1] * d[k] > 0.0:
                limit = 1.25 * min(abs(d[k - 1]), abs(d[k]))
                slope = (h[k] * d[k - 1] + h[k - 1] * d[k]) / (h[k - 1] + h[k])
                s[k] = math.copysign(min(abs(slope), limit), d[k])
            q[k] = 2.0 * (d[k] - d[k - 1]) / (h[k - 1] + h[k])
        if beyond == "linear":
            s[0], s[-1] = d[0], d[-1]
        for k in range(1, n - 1):
            for side, m in ((1.0, k), (-1.0, k - 1)):  # as the left end of interval k, the right of k-1
                sign = math.copysign(1.0, d[m]) if d[m] else 0.0
                curve, slope = side * sign * q[k], sign * s[k]
                low, high = -4.0 * slope / h[m], (10.0 * sign * d[m] - 8.0 * slope) / h[m]
                q[k] = side * sign * min(max(curve, low), high)
        self.pieces = [(x[0], 1.0, self._line(y[0], s[0], beyond))]
        for k in range(n - 1):
            a, b, c = y[k], s[k] * h[k], 0.5 * q[k] * h[k] ** 2
            # the value, slope and second derivative at the right end fix the other three
            e0 = y[k + 1] - a - b - c
            e1 = s[k + 1] * h[k] - b - 2.0 * c
            e2 = q[k + 1] * h[k] ** 2 - 2.0 * c
            self.pieces.append((x[k], h[k], [a, b, c, 10 * e0 - 4 * e1 + 0.5 * e2,
                                             -15 * e0 + 7 * e1 - e2, 6 * e0 - 3 * e1 + 0.5 * e2]))
        self.pieces.append((x[-1], 1.0, self._line(y[-1], s[-1], beyond)))

    @staticmethod
    def _line(y, slope, beyond):
        return [y, slope if beyond == "linear" else 0.0]

    def piece_at(self, x):
        return bisect.bisect_right(self.knots, x)

    def evaluate(self, piece, order, x):
        """The derivative of the given order of one piece, continued beyond its ends."""
        origin, h, c = self.pieces[int(piece)]
        z, sum_ = (x - origin) / h, 0.0
        for m in range(len(c) - 1, order - 1, -1):
            factor = 1.0
            for r in range(order):
                factor *= m - r
            sum_ = sum_ * z + factor * c[m]
        return sum_ / h ** order

    def __call__(self, x):
        return self.evaluate(self.piece_at(x), 0, x)


SMOOTH_STEP = ([0.0, 1.0], [0.0, 1.0])  # 10 x^3 - 15 x^4 + 6 x^5: a table of two points


class Input:
    """A commanded input: u(t) in closed form, piece by piece. doc/scene.md, Holds."""

    def __init__(self, d, low=-math.inf, high=math.inf):
        self.topic, self.hold = d["topic"], d.get("hold", "zero_order")
        self.tau, self.rate = d.get("time_constant"), d.get("rate")
        self.period = d.get("period")
        self.low = max(low, float(d.get("min", -math.inf)))
        self.high = min(high, float(d.get("max", math.inf)))
        self.timeout, self.on_timeout = float(d.get("timeout", 0.0)), d.get("on_timeout", "hold")
        self.target = float(d.get("initial", 0.0))
        self.pieces = [(0.0, self.constant(self.target))]
        self.instants = []  # where it has a kink or a jump

    @staticmethod
    def constant(value):
        return lambda t: (value, 0.0, 0.0)

    def at(self, t):
        """u, u', u'' from t on."""
        found = self.pieces[0][1]
        for begin, piece in self.pieces:
            if begin <= t:
                found = piece
        return found(t)

    def command(self, t, value):
        value = min(max(value, self.low), self.high)
        if value == self.target:
            return
        u, v, _ = self.at(t)
        self.target = value
        if self.hold == "zero_order":
            self.pieces.append((t, self.constant(value)))
            if t == 0.0:
                return
        elif self.hold == "first_order_lag":
            x, tau = u - value, self.tau
            self.pieces.append((t, lambda s: (value + x * math.exp(-(s - t) / tau),
                                              -x / tau * math.exp(-(s - t) / tau),
                                              x / tau ** 2 * math.exp(-(s - t) / tau))))
        elif self.hold == "second_order_lag":
            x, tau = u - value, self.tau
            slope = v + x / tau  # u - value = (x + slope (s - t)) exp(-(s - t)/tau)

            def lag(s):
                decay, line = math.exp(-(s - t) / tau), x + slope * (s - t)
                return (value + line * decay, (slope - line / tau) * decay,
                        (line / tau ** 2 - 2.0 * slope / tau) * decay)

            self.pieces.append((t, lag))
        else:
            span = abs(value - u) / self.rate if self.hold == "rate_limit" else self.period
            slope = (value - u) / span if span > 0.0 else 0.0
            self.pieces = [p for p in self.pieces if p[0] <= t]  # the end of a ramp that is left
            self.pieces.append((t, lambda s: (u + slope * (s - t), slope, 0.0)))
            self.pieces.append((t + span, self.constant(value)))
            self.instants.append(t + span)
        self.instants.append(t)

    def run(self, commands, duration):
        """All commands [(t, value)] of its topic, in the order of the file, with the timeouts among
        them; of several of one instant the last counts."""
        last = {}
        for t, value in commands:
            last[t] = value
        times = sorted(last)
        for k, t in enumerate(times):
            self.command(t, last[t])
            end = times[k + 1] if k + 1 < len(times) else math.inf
            due = t + self.timeout
            if self.timeout > 0.0 and due < min(end, duration) and self.on_timeout == "zero":
                self.command(due, 0.0)


class Build:
    """A law's view of the scene during its construction."""

    def __init__(self, shafts, t, phi, w, e, j, modes):
        self.shafts, self.t, self.phi, self.w, self.e, self.j = shafts, t, phi, w, e, j
        self.modes, self.inputs, self.symbols = modes, [], []

    def index(self, name):
        return self.shafts.index(name)

    def value(self, v, low=-math.inf, high=math.inf):
        """A number, a table over time or a commanded input."""
        if isinstance(v, dict) and "topic" in v:
            self.inputs.append(Input(v, low, high))
            return self.symbols[len(self.inputs) - 1]
        if isinstance(v, dict):
            return self.modes.piece(Table(v["times"], v["values"]), self.t)
        return wrap(float(v))

    def smooth_step(self, x):
        return self.modes.piece(Table(*SMOOTH_STEP), x)

    def names(self, d, order):
        """Variables that a formula may read. order -1: a torque."""
        names = {"t": self.t}
        for i in range(len(self.shafts)):
            names[f"phi{i + 1}"] = self.phi[i]
            names[f"w{i + 1}"] = self.w[i]
            if order >= 2:
                names[f"e{i + 1}"] = self.e[i]
            if order >= 3:
                names[f"j{i + 1}"] = self.j[i]
        names.update({k: wrap(float(v)) for k, v in d.get("parameters", {}).items()})
        return names


def torque(b, d):
    """{shaft index: Q} of a torque element."""
    kind = d["type"].split("/")[-1]
    if "shaft" in d:
        i = b.index(d["shaft"])
        w, phi = b.w[i], b.phi[i]
    if kind == "ExpressionTorque":
        return {i: parse(d["torque"], b.names(d, -1), b.modes)}
    if kind == "CommandedTorque":
        return {i: float(d.get("gain", 1.0)) * b.value(d)}
    if kind == "ElasticCoupling":
        p, q = (b.index(x) for x in d["shafts"])
        ratio = float(d.get("ratio", 1.0))
        T = (d["stiffness"] * (b.phi[p] - ratio * b.phi[q])
             + d.get("damping", 0.0) * (b.w[p] - ratio * b.w[q]))
        return {p: -T, q: ratio * T}
    if kind == "Friction":
        ratio = float(d.get("ratio", 1.0))
        if "shafts" in d:
            p, q = (b.index(x) for x in d["shafts"])
            w = b.w[p] - ratio * b.w[q]
        coulomb = float(d.get("coulomb", 0.0))
        level = wrap(coulomb)
        if "static" in d:
            level = coulomb + (d["static"] - coulomb) * exp(-(w / d["stribeck_speed"]) ** 2)
        T = level * tanh(w / d.get("regularization_speed", 0.01)) + d.get("viscous", 0.0) * w
        return {p: -T, q: ratio * T} if "shafts" in d else {i: -T}
    if kind == "Propeller":
        w0 = float(d.get("regularization_speed", 0.0))
        if "coefficient" in d:
            k, m = float(d["coefficient"]), 0.0
        else:
            rho, D = float(d.get("density", 1025.0)), float(d["diameter"])
            k = rho * d["torque_coefficient"] * D ** 5 / (2 * math.pi) ** 2
            m = 0.0
            if "advance" in d:
                m = rho * d["advance"]["slope"] * d["advance"]["speed"] * D ** 4 / (2 * math.pi)
        size = w * w / sqrt(w * w + w0 * w0) if w0 > 0.0 else b.modes.abs(w)
        return {i: -(k * w - m) * size}
    if kind == "CuttingTorque":
        h = float(d["ramp"])
        E = b.smooth_step((b.t - float(d["begin"])) / h)
        if "end" in d:
            E = E - b.smooth_step((b.t - float(d["end"])) / h)
        P = wrap(1.0)
        if "tooth_passing" in d:
            tooth = d["tooth_passing"]
            P = 1 + tooth["amplitude"] * sin(tooth["teeth"] * phi + tooth.get("phase", 0.0))
        return {i: -float(d["torque"]) * E * P * tanh(w / d.get("regularization_speed", 0.1))}
    if kind == "VehicleResistance":
        radius = d["wheel_radius"] / d.get("ratio", 1.0)
        v = radius * w
        grade = d.get("grade", 0.0)
        if isinstance(grade, dict):
            grade = b.modes.piece(Table(grade["time"], grade["grade"]), b.t)
        angle = atan(grade)
        smooth = tanh(v / d.get("regularization_speed", 0.1))
        climb = d.get("mass", 0.0) * GRAVITY * sin(angle)
        if d["law"] == "davis":
            F = (d["constant"] + d["quadratic"] * v * v) * smooth + d["linear"] * v + climb
        else:
            F = (d["rolling_coefficient"] * d["mass"] * GRAVITY * cos(angle)
                 + 0.5 * d.get("air_density", 1.2) * d["drag_area"] * v * v) * smooth + climb
        return {i: -radius * F}
    if kind == "MotorCurve":
        direction = float(d.get("direction", 1))
        x = direction * w
        kind = d["characteristic"]
        if kind == "dc" and "voltage" in d:
            k = float(d["torque_constant"])
            return {i: direction * k * (b.value(d["voltage"]) - k * x) / float(d["resistance"])}
        u = b.value(d.get("command", 1.0), 0.0, 1.0)
        if kind == "kloss":
            z = (d["synchronous_speed"] - x) / (d["synchronous_speed"] * d["critical_slip"])
            M = 2.0 * d["breakdown_torque"] * z / (1 + z * z)
        elif kind == "table":
            t = d["table"]
            M = b.modes.piece(Table(t["speed"], t["torque"], t.get("beyond", "constant")), x)
        else:
            M = float(d["stall_torque"]) * (1 - x / float(d["no_load_speed"]))
        return {i: direction * u * M}
    if kind == "DieselEngine":
        t = d["full_load"]
        u = b.value(d["rack"], 0.0, 1.0)
        r = u
        if "idle_governor" in d:
            g = d["idle_governor"]
            r = u + (1 - u) * (1 - b.smooth_step((w - g["speed"] + g["band"]) / (2.0 * g["band"])))
        Q = r * b.modes.piece(Table(t["speed"], t["torque"]), w)
        if "friction" in d:
            f = d["friction"]
            Q = (Q - f["constant"] * tanh(w / f.get("regularization_speed", 1.0))
                 - f.get("linear", 0.0) * w)
        return {i: Q}
    raise ValueError(f"torque law {d['type']}")


def constraint(b, d):
    """(order, f, psi or C eta + c0) of a constraint."""
    kind = d["type"].split("/")[-1]
    if "shafts" in d:
        p, q = (b.index(x) for x in d["shafts"])
        wa, wb, ea, eb = b.w[p], b.w[q], b.e[p], b.e[q]
    if kind == "ExpressionConstraint":
        order = int(d["order"])
        return order, parse(d["expression"], b.names(d, order), b.modes)
    if kind == "KinematicRatio":
        return 1, wb - b.value(d["ratio"]) * wa
    if kind == "VBeltRatio":
        y = (wa / d["speed"]) ** 2 - 1
        if "load" in d:
            y = y - b.value(d["load"]) / d["load_torque"]
        low, high = float(d["ratio_low"]), float(d["ratio_high"])
        return 1, wb - (low + (high - low) * 0.5 * (1 + tanh(y / d.get("width", 0.5)))) * wa
    if kind == "SlipRatio":
        ratio = b.value(d["ratio"])
        return 2, d["time_constant"] * (eb - ratio * ea) + wb - ratio * wa
    if kind == "TractionCurve":
        w0, g = d.get("regularization_speed", 0.1), d.get("sharpness", 2.0)
        ratio = b.value(d["ratio"])
        load = b.value(d.get("load", 0.0))
        size = wb * wb / sqrt(wb * wb + w0 * w0)
        M = d["inertia"] * eb + load + d.get("load_square", 0.0) * wb * size
        slip = d["nominal_slip"] * sinh(g * M / d["nominal_torque"]) / math.sinh(g)
        return 2, wb - ratio * wa * (1 - slip)
    if kind == "PowerFlow":
        pa, pb = d["inertias"][0] * wa * ea, d["inertias"][1] * wb * eb
        if "power" in d:
            return 2, pa + pb - b.value(d["power"])
        pa, eta, p0 = -pa, float(d["efficiency"]), float(d["smoothing_power"])
        m, n = (1 / eta + eta) / 2, (1 / eta - eta) / 2
        return 2, pb - m * pa + n * (sqrt(pa * pa + p0 * p0) - p0)
    if kind == "AccelerationMagnitude":
        return 2, ea * ea + eb * eb - float(d["magnitude"]) ** 2
    if kind == "ImposedJerk":
        j = b.j[b.index(d["shaft"])]
        if "jerk" in d:
            return 3, j - b.value(d["jerk"])
        T, begin = float(d["duration"]), float(d.get("start", 0.0))
        z = 2 * math.pi * (b.t - begin) / T
        inside = 0.5 * (b.modes.sign_of(b.t - begin) - b.modes.sign_of(b.t - (begin + T)))
        return 3, j - inside * (2 * math.pi * d["velocity_change"] / T ** 2) * sin(z)
    if kind == "JerkLimit":
        i = b.index(d["shaft"])
        limit, tau = float(d["limit"]), float(d["time_constant"])
        target = b.value(d["acceleration"])
        return 3, b.j[i] - limit * tanh((target - b.e[i]) / (limit * tau))
    raise ValueError(f"constraint {d['type']}")
