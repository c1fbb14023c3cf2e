#!/usr/bin/python3
"""Work against precision of SciPy's solvers on the scenes of benchmark/scenes/.

The right-hand sides are written by hand in plain Python, as a user of SciPy would write them; each
step pays for the interpreter. DOP853 and LSODA run in their compiled form (scipy.integrate.ode),
Radau in Python (solve_ivp). The rows have the form of work_precision's.
"""

import argparse
import math
import pathlib
import sys
import time

import numpy
import scipy
from scipy.integrate import ode, solve_ivp

TIME_OUT = 2.0  # s, of one run
SLOW = 500.0  # ms: what takes longer is not run at smaller tolerances


class TimeOut(Exception):
    """A run takes too long."""


def jerk_two(rate1, rate2, j1, j2, c1, c2, c0):
    """eta of two shafts and one constraint, by the symmetric solve."""
    f1 = rate1 / j1
    f2 = rate2 / j2
    l = (c0 + c1 * f1 + c2 * f2) / (c1 * c1 / j1 + c2 * c2 / j2)
    return f1 - c1 * l / j1, f2 - c2 * l / j2


def kloss_rate(peak, synchronous, w, e):
    s = (synchronous - w) / synchronous
    d = s * s + 0.04
    return peak * (s * s - 0.04) / (d * d) * e / synchronous


def least_reaction(torque1, torque2, j1, j2, c1, c2, psi):
    """Accelerations of least reaction; psi(e1, e2) is linear."""
    e1 = torque1 / j1
    e2 = torque2 / j2
    l = psi(e1, e2) / (c1 * c1 / j1 + c2 * c2 / j2)
    return e1 - c1 * l / j1, e2 - c2 * l / j2


class Scene:
    """One scene: f(t, x), the start, the end. Events only where it has some."""

    event_times = ()
    jacobian = None

    def event(self, index, x):
        raise NotImplementedError


class Ship(Scene):
    name = "ship"
    end = 20.0
    start = [0.0, 0.0, 5.0, 2.0, 8.7766140234030305241, 6.0165615693436304098]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        u = 0.6 + 0.2 * math.sin(0.7 * t)
        du = 0.14 * math.cos(0.7 * t)
        slip = e2 - u * e1
        g = 0.2 + 0.01 * (e1 * e1 + e2 * e2)
        bend = 0.02 * slip
        n1, n2 = jerk_two(kloss_rate(12.0, 50.0, w1, e1), -0.04 * w2 * e2, 0.8, 2.0,
                          bend * e1 - u * g, bend * e2 + g, slip - du * (g * e1 + w1))
        return [w1, w2, e1, e2, n1, n2]


class SmoothLinear(Scene):
    name = "smooth_linear"
    end = 20.0
    start = [0.0, 0.0, 10.0, 7.0,
             *least_reaction(12.0, -3.5, 0.6, 1.5, -0.35, 0.5, lambda e1, e2: 0.5 * e2 - 0.35 * e1)]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        n1, n2 = jerk_two(6.5 * math.cos(1.3 * t) - 0.8 * e1, -0.5 * e2, 0.6, 1.5, -0.35, 0.5,
                          e2 - 0.7 * e1)
        return [w1, w2, e1, e2, n1, n2]


class AccelerationCircle(Scene):
    name = "acceleration_circle"
    end = 5.0
    start = [0.0, 0.0, 0.0, 0.0, 1.2, 1.6]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        n1, n2 = jerk_two(3.0, 0.0, 1.5, 1.5, 2.0 * e1, 2.0 * e2, 0.0)
        return [w1, w2, e1, e2, n1, n2]


class TorqueSteps(Scene):
    name = "torque_steps"
    end = 10.0
    event_times = tuple(0.5 * i for i in range(1, 20))
    start = [0.0, 0.0, 10.0, 8.0,
             *least_reaction(-1.0, -3.04, 0.5, 1.2, -0.4, 0.5, lambda e1, e2: 0.5 * e2 - 0.4 * e1)]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        n1, n2 = jerk_two(-0.5 * e1, (-0.3 - 0.02 * w2) * e2, 0.5, 1.2, -0.4, 0.5, e2 - 0.8 * e1)
        return [w1, w2, e1, e2, n1, n2]

    def event(self, index, x):
        """The exact jump of the accelerations at command `index` (from 0)."""
        def command(i):
            return 4.0 + 3.0 * ((2 * i) % 5)
        free = (command(index + 1) - command(index)) / 0.5
        l = -0.4 * free / (0.16 / 0.5 + 0.25 / 1.2)
        x[4] += free + 0.4 * l / 0.5
        x[5] -= 0.5 * l / 1.2


class StiffSlip(Scene):
    end = 3.0

    def __init__(self, name, tau, slips):
        self.name = name
        self.tau = tau
        if slips:
            motor = 12.0 * 0.9 / (0.81 + 0.04)
            self.start = [0.0, 0.0, 5.0, 2.0,
                          *least_reaction(motor, -0.08, 0.8, 2.0, -0.6 * tau, tau,
                                          lambda e1, e2: tau * (e2 - 0.6 * e1) + 2.0 - 3.0)]
        else:
            motor = 12.0 * 0.9 / (0.81 + 0.04)
            e1 = (motor - 0.6 * 0.18 - 0.6 * 2.0 * 0.7) / (0.8 + 0.72)
            rho = -0.7 + tau * 0.14 * e1
            w2 = 3.0 + tau * rho
            self.start = [0.0, 0.0, 5.0, w2, e1, 0.6 * e1 - rho]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        u = 0.6 + 0.2 * math.sin(0.7 * t)
        du = 0.14 * math.cos(0.7 * t)
        n1, n2 = jerk_two(kloss_rate(12.0, 50.0, w1, e1), -0.04 * w2 * e2, 0.8, 2.0, -u, 1.0,
                          (e2 - u * e1 - du * w1) / self.tau - du * e1)
        return [w1, w2, e1, e2, n1, n2]

    def jacobian(self, t, x):
        _, _, w1, w2, e1, e2 = x
        s = (50.0 - w1) / 50.0
        d = 1.0 / (s * s + 0.04)
        slope = 12.0 * (0.04 - s * s) * d * d
        curvature = -24.0 * s * (0.12 - s * s) * d * d * d
        u = 0.6 + 0.2 * math.sin(0.7 * t)
        du = 0.14 * math.cos(0.7 * t)
        b = 1.0 / (u * u / 0.8 + 0.5)
        rate1 = (curvature * e1 / 2500.0, 0.0, -slope / 50.0, 0.0)
        rate2 = (0.0, -0.04 * e2, 0.0, -0.04 * w2)
        c0 = (-du / self.tau, 0.0, -u / self.tau - du, 1.0 / self.tau)
        row1 = [0.0, 0.0]
        row2 = [0.0, 0.0]
        for q1, q2, c in zip(rate1, rate2, c0):
            l = -(c - u * q1 / 0.8 + q2 / 2.0) * b
            row1.append((q1 - u * l) / 0.8)
            row2.append((q2 + l) / 2.0)
        return [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0], row1, row2]


class FourShafts(Scene):
    name = "four_shafts"
    end = 10.0
    start = [0.0, 0.0, 0.0, 0.0, 10.0, 7.0, 7.0, 5.6, 18.22722053114120627745,
             12.75905437179884439422, -0.4181321623640764628555, -0.3350661376058696561941]

    def f(self, t, x):
        _, p2, p3, _, w1, w2, w3, w4, e1, e2, e3, e4 = x
        u = 0.7 + 0.15 * math.sin(0.5 * t)
        du = 0.075 * math.cos(0.5 * t)
        slip = e2 - u * e1
        g = 0.3 + 0.006 * (e1 * e1 + e2 * e2)
        bend = 0.012 * slip
        twist = p2 - p3
        spring = (60.0 + 15.0 * twist * twist) * (w2 - w3) + 4.0 * (e2 - e3)
        # The two constraints share no shaft.
        n1, n2 = jerk_two(kloss_rate(20.0, 60.0, w1, e1), -spring, 1.0, 0.5, bend * e1 - u * g,
                          bend * e2 + g, slip - du * (g * e1 + w1))
        n3, n4 = jerk_two(spring, -0.08 * w4 * e4, 0.8, 2.5, 0.001 * e4 - 0.2, 0.001 * e3 + 0.25,
                          e4 - 0.8 * e3)
        return [w1, w2, w3, w4, e1, e2, e3, e4, n1, n2, n3, n4]


class Crank(Scene):
    name = "crank"
    end = 2.0
    start = [0.0, 0.0, 0.0, 10.0, 10.0, 7.0, 15.833333333333333333, -0.61495035182037140116,
             -0.4317929022600517712]

    def f(self, t, x):
        p1, p2, _, w1, w2, w3, e1, e2, e3 = x
        s1 = math.sin(p1)
        c1 = math.cos(p1)
        s2 = 2.0 * s1 * c1
        c2 = 1.0 - 2.0 * s1 * s1
        j = 1.0 + 0.15 * c1 + 0.05 * c2 + 0.02 * s2
        dj = 0.04 * c2 - 0.15 * s1 - 0.1 * s2
        ddj = -0.15 * c1 - 0.2 * c2 - 0.08 * s2
        spring = 400.0 * (p1 - p2) + 3.0 * (w1 - w2)
        spring_rate = 400.0 * (w1 - w2) + 3.0 * (e1 - e2)
        reaction = j * e1 + 0.5 * dj * w1 * w1 - (25.0 + 6.0 * s2 - 0.4 * w1 - spring)
        rate = (12.0 * c2 * w1 - 0.4 * e1 - spring_rate - 2.0 * dj * w1 * e1 -
                0.5 * ddj * w1 * w1 * w1 + 0.5 * dj * w1 * reaction / j)
        n2, n3 = jerk_two(spring_rate, -0.06 * w3 * e3, 0.2, 3.0, 0.002 * e3 - 0.28,
                          0.002 * e2 + 0.4, e3 - 0.7 * e2)
        return [w1, w2, w3, e1, e2, e3, rate / j, n2, n3]


class Order1(Scene):
    name = "order1"
    end = 20.0
    start = [0.0, 0.0, 4.0, 2.0,
             *least_reaction(18.0, -2.04, 0.3, 1.1, -0.5, 1.0,
                             lambda e1, e2: e2 - 0.5 * e1 - 0.08 * 4.0)]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        sine = math.sin(0.8 * t)
        n1, n2 = jerk_two(-0.5 * e1, -0.02 * w2 * e2, 0.3, 1.1, -0.5 - 0.1 * sine, 1.0,
                          0.064 * sine * w1 - 0.16 * math.cos(0.8 * t) * e1)
        return [w1, w2, e1, e2, n1, n2]


class Order3(Scene):
    name = "order3"
    end = 20.0
    start = [0.0, 0.0, 5.0, 2.0, 10.0, 4.0]

    def f(self, t, x):
        _, _, w1, w2, e1, e2 = x
        u = 0.6 + 0.1 * math.sin(0.9 * t)
        n1, n2 = jerk_two(-0.6 * e1, -0.04 * w2 * e2, 0.8, 2.0, -0.2 * u, 0.2,
                          e2 - u * e1 + 1.5 * (w2 - u * w1))
        return [w1, w2, e1, e2, n1, n2]


SCENES = [Ship(), SmoothLinear(), AccelerationCircle(), TorqueSteps(), FourShafts(), Crank(),
          Order1(), Order3(),
          *(StiffSlip(f"stiff_slip_1e-{i}", float(f"1e-{i}"), False) for i in range(1, 9)),
          StiffSlip("stiff_start", 5e-4, True)]
QUICK = {"ship", "torque_steps", "four_shafts", "stiff_slip_1e-3"}


class Run:
    """One run of one solver on one scene, with a counter and a deadline."""

    def __init__(self, scene, method, tolerance):
        self.scene = scene
        self.method = method
        self.tolerance = tolerance
        self.calls = 0
        self.deadline = math.inf

    def f(self, t, x):
        self.calls += 1
        if self.calls % 64 == 0 and time.process_time() > self.deadline:
            raise TimeOut
        # Plain floats are faster than NumPy's scalars.
        return self.scene.f(t, x.tolist())

    def jacobian(self, t, x):
        return self.scene.jacobian(t, x.tolist())

    def segment(self, t0, t1, x):
        tolerance = self.tolerance
        jacobian = self.jacobian if self.scene.jacobian else None
        if self.method == "radau":
            result = solve_ivp(self.f, (t0, t1), x, method="Radau", rtol=tolerance, atol=tolerance,
                               jac=jacobian)
            if not result.success:
                raise RuntimeError("no success")
            return result.y[:, -1].copy()
        solver = ode(self.f, jacobian)
        if self.method == "lsoda":
            solver.set_integrator("lsoda", rtol=tolerance, atol=tolerance, nsteps=10**8,
                                  with_jacobian=True)
        else:
            solver.set_integrator("dop853", rtol=tolerance, atol=tolerance, nsteps=10**8)
        solver.set_initial_value(x, t0)
        x = solver.integrate(t1)
        if not solver.successful():
            raise RuntimeError("no success")
        return x.copy()

    def __call__(self):
        self.calls = 0
        self.deadline = time.process_time() + TIME_OUT
        x = numpy.array(self.scene.start)
        t = 0.0
        for index, event in enumerate(self.scene.event_times):
            x = self.segment(t, event, x)
            self.scene.event(index, x)
            t = event
        return self.segment(t, self.scene.end, x)


def read_references(path):
    references = {}
    for line in pathlib.Path(path).read_text().splitlines():
        if line.startswith(("#", "scene,")):
            continue
        cells = line.split(",")
        references[cells[0]] = numpy.array([numpy.longdouble(cell) for cell in cells[2:]])
    return references


def measure(run, reference):
    """error, milliseconds, evaluations, status"""
    best = math.inf
    started = time.process_time()
    while True:
        begin = time.perf_counter()
        begin_work = time.process_time()
        try:
            x = run()
        except TimeOut:
            return math.nan, 1e3 * TIME_OUT, run.calls, "time-out"
        except Exception as error:  # whatever a solver raises is a row of the table
            return math.nan, math.nan, run.calls, str(error).replace(",", ";") or "failed"
        elapsed = time.perf_counter() - begin
        # As in work_precision: the wall clock for short runs, the processor's time for long ones.
        best = min(best, elapsed if elapsed < 2e-3 else time.process_time() - begin_work)
        if time.process_time() - started > 0.03:
            break
    error = float(numpy.max(numpy.abs(x - reference) / numpy.maximum(1, numpy.abs(reference))))
    if not math.isfinite(error):
        return math.nan, 1e3 * best, run.calls, "not finite"
    return error, 1e3 * best, run.calls, "ok"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few scenes, few tolerances")
    parser.add_argument("--scene", default="", help="only scenes whose name begins so")
    parser.add_argument("--references", default="benchmark/references.csv")
    parser.add_argument("--output", help="file of the rows; default: standard output")
    arguments = parser.parse_args()

    references = read_references(arguments.references)
    out = open(arguments.output, "w") if arguments.output else sys.stdout
    print(f"# SciPy: {scipy.__version__}, Python {sys.version.split()[0]}", file=out)
    print("scene,method,form,tolerance,error,milliseconds,right_hand_sides,steps,status", file=out)
    too_slow_before = set()
    for scene in SCENES:
        if not scene.name.startswith(arguments.scene):
            continue
        if arguments.quick and not arguments.scene and scene.name not in QUICK:
            continue
        started = time.process_time()
        if not scene.name.startswith("stiff_slip"):
            too_slow_before = set()
        too_slow = set(too_slow_before)
        for exponent in (3, 7, 11) if arguments.quick else (3, 5, 7, 9, 11, 13):
            for method in ("dop853", "lsoda", "radau"):
                if method in too_slow:
                    row = math.nan, math.nan, 0, "not run: too slow with less work"
                else:
                    row = measure(Run(scene, method, float(f"1e-{exponent}")),
                                  references[scene.name])
                    if row[3] == "time-out" or row[1] > SLOW:
                        too_slow.add(method)
                error, milliseconds, calls, status = row
                print(f"{scene.name},scipy {method},Python,1e-{exponent:02d},{error:.3e},"
                      f"{milliseconds:.5f},{calls},0,{status}", file=out)
            if exponent == 3 and scene.name.startswith("stiff"):
                too_slow_before = set(too_slow)
        print(f"{scene.name:22} {time.process_time() - started:.1f} s (SciPy)", file=sys.stderr)


if __name__ == "__main__":
    main()
