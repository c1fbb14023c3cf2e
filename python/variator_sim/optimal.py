"""Programmes of commands that make a quantity of a run least, by SciPy's SLSQP and exact gradients of runs."""

import dataclasses
import math
import re
import warnings

import numpy

from variator_sim.checks import did_you_mean, finite, mapping, one_of, shown, texts, whole_number
from variator_sim.checks import name as checked_name
from variator_sim.errors import MotionStopped
from variator_sim.files import whole_file
from variator_sim.running import OVERRIDES, read_commands, simulate

NAME = r"[A-Za-z_][\w/]*"
SUBJECT = re.compile(rf"\s*({NAME})\s*(?:\(\s*([^)]+)\))?\s*(<=|>=|=)\s*(\S+)\s*")
SHAFT_QUANTITIES = {"phi": "angle", "w": "velocity", "e": "acceleration"}


@dataclasses.dataclass
class Subject:
    """A condition `name(time) relation value`; time None: at the end of every part of the programme."""

    text: str
    name: str
    time: float
    relation: str
    value: float


@dataclasses.dataclass
class Programme:
    """An optimal programme, as `optimise` returns it.

    Attributes:
        minimised: the name of the quantity.
        commands: the optimal programme, tuples (time, topic, value); `result`: its run.
        cost: the least value; `constant_cost`: that of the best constant commands, `constant_commands`, or NaN
            where none satisfy the conditions; `constant_result`: their run.
        message: how SLSQP ended; `runs`: the number of runs it took.
    """

    minimised: str
    commands: list
    cost: float
    result: object
    constant_commands: list
    constant_cost: float
    constant_result: object
    message: str
    runs: int

    def describe_constant(self, digits):
        """The cost that the programme's is beside, for people."""
        if math.isnan(self.constant_cost):
            return "no constant commands meet the conditions"
        return f"with the best constant commands {self.constant_cost:.{digits}g}"

    def to_csv(self, path):
        """Writes the commands as `simulate --commands` plays them."""
        with whole_file(path) as file:
            file.write("time,topic,value\n")
            file.writelines(f"{time!r},{topic},{value!r}\n" for time, topic, value in self.commands)

    def plot(self, controls, columns):
        """A figure: commands, and columns of both runs, titled by the cost of both."""
        from variator_sim.plotting import draw_lines, make_panels, put_legend_above  # take a second to load
        title = f"{self.minimised} at the end: {self.cost:.4g}, {self.describe_constant(4)}"
        figure, axes = make_panels(len(controls) + len(columns), 1, title)
        runs = (("programme", self.result, self.commands),
                ("best constant commands", self.constant_result, self.constant_commands))
        for axis, control in zip(axes[:, 0], controls):
            lines = []
            for name, result, commands in runs:
                points = [(time, value) for time, topic, value in commands if topic == control]
                ends = [time for time, _ in points[1:]] + [result.time[-1]]
                lines.append((name, numpy.ravel(list(zip([time for time, _ in points], ends))),
                              numpy.repeat([value for _, value in points], 2)))
            draw_lines(axis, lines, f"command\n{control}")
        for axis, column in zip(axes[len(controls):, 0], columns):
            unit = self.result.units.get(column)
            label = column.replace("/", "/\n", 1) + (f", {unit}" if unit else "")
            draw_lines(axis, [(name, result.time, result[column]) for name, result, _ in runs], label)
        put_legend_above(axes[0, 0])
        figure.align_ylabels(axes[:, 0])
        return figure


def read_subject(text):
    found = SUBJECT.fullmatch(text)
    try:
        name, time, relation, value = found.groups()
        return Subject(text, name, None if time is None else float(time), relation, float(value))
    except (AttributeError, ValueError):
        raise ValueError(f"subject: '{text}'; allowed: NAME(TIME) = NUMBER, with <= or >= too, such as "
                         "\"w_wheels(20) = 30\"; without (TIME) throughout") from None


def column_of(name, columns, what="minimise"):
    """The column of a quantity: w_SHAFT, phi_SHAFT, e_SHAFT, a state, an output, or a column's name."""
    kind, _, shaft = name.partition("_")
    candidates = [name, f"states/{name}", f"outputs/{name}", f"{shaft}/{SHAFT_QUANTITIES.get(kind, '')}"]
    for candidate in candidates:
        if candidate in columns:
            return candidate
    known = [column.split("/", 1)[1] if column.startswith(("states/", "outputs/")) else column for column in columns]
    raise ValueError(f"{what}: '{name}' is no quantity with a gradient{did_you_mean(name, known)}; allowed: w_SHAFT, phi_SHAFT, "
                     f"e_SHAFT, {', '.join(known)}")


class Problem:
    """Runs of a programme x: of each control the commands at its knots, divided by `scale`."""

    def __init__(self, scene, duration, controls, knots, minimise, subjects, commands, overrides, rate):
        self.scene, self.duration, self.controls, self.knots = scene, duration, controls, knots
        self.subjects, self.overrides, self.rate = subjects, overrides, rate
        self.sign = -1.0 if minimise.startswith("-") else 1.0
        self.minimise = minimise.lstrip("-")
        self.instants = [duration * k / knots for k in range(knots)]
        self.others = [command for command in commands if command[1] not in controls]
        ends = [*self.instants[1:], duration]
        self.times = sorted({*ends, *(s.time for s in subjects if s.time is not None)})
        self.scale = numpy.ones(len(controls) * knots)
        self.limits = [(-math.inf, math.inf)] * len(controls)
        self.paths = [f"{control}@{time!r}" for control in controls for time in self.instants]
        self.runs = 0
        self.last = (None, None)
        self.steps = None  # of `limit_steps`
        self.best = (math.inf, None)  # cost and commands of the best run so far that satisfies all conditions

    def commands(self, x):
        values = (x * self.scale).reshape(len(self.controls), self.knots)
        own = [(time, control, min(max(float(value), low), high))
               for control, row, (low, high) in zip(self.controls, values, self.limits)
               for time, value in zip(self.instants, row)]
        return sorted(own + self.others, key=lambda command: command[0])

    def evaluate(self, x):
        """Cost, its gradient, and of each condition value - bound and its gradient at each of its instants."""
        if self.last[0] is not None and numpy.array_equal(self.last[0], x):
            return self.last[1]
        self.runs += 1
        try:
            result = simulate(self.scene, self.duration, times=self.times, commands=self.commands(x),
                              columns="state,outputs,states", overrides=self.overrides, gradient=self.paths)
        except MotionStopped as error:
            raise RuntimeError(f"a programme on the way to the optimum stops the motion ({error}); narrower bounds or "
                               "rates, or another start, keep away from it") from None

        def read(name, row, what):
            column = column_of(name, [c for c in result.columns if f"d({c})/d({self.paths[0]})" in result.columns], what)
            slope = numpy.array([result[f"d({column})/d({path})"][row] for path in self.paths]) * self.scale
            if not numpy.isfinite(slope).all():
                raise RuntimeError(f"{column}: no derivative at {result.time[row]:g} s")
            return result[column][row], slope

        cost, slope = read(self.minimise, -1, "minimise")
        conditions = []
        for subject in self.subjects:
            rows = range(len(self.times)) if subject.time is None else [self.times.index(subject.time)]
            values, slopes = zip(*(read(subject.name, row, f"subject: '{subject.text}'") for row in rows))
            conditions.append((numpy.array(values) - subject.value, numpy.array(slopes)))
        answer = (self.sign * cost, self.sign * slope, conditions)
        self.last = (x.copy(), answer)
        if answer[0] < self.best[0] and self.misses(x) < 1e-5 and self.keeps_rates(x):
            self.best = (answer[0], x.copy())
        return answer

    def keeps_rates(self, x):
        return self.steps is None or not len(self.steps[0]) or (self.steps[0] @ x <= self.steps[1] + 1e-6).all()

    def solve(self, start, bounds, steps, expand, tolerance):
        """SLSQP over y, x = expand y; `steps`: the largest change of each control from knot to knot."""
        from scipy.optimize import minimize  # takes half a second to load
        first = self.evaluate(expand @ start)
        size = max(abs(first[0]), numpy.abs(first[1]).max()) or 1.0
        sizes = [max(1.0, abs(s.value)) for s in self.subjects]
        constraints = []
        for n, subject in enumerate(self.subjects):
            factor = (-1.0 if subject.relation == "<=" else 1.0) / sizes[n]
            constraints.append({"type": "eq" if subject.relation == "=" else "ineq",
                                "fun": lambda y, n=n, f=factor: f * self.evaluate(expand @ y)[2][n][0],
                                "jac": lambda y, n=n, f=factor: f * self.evaluate(expand @ y)[2][n][1] @ expand})
        if steps is not None and len(steps[0]):
            matrix, limit = steps
            constraints.append({"type": "ineq", "fun": lambda y: limit - matrix @ (expand @ y),
                                "jac": lambda y: -matrix @ expand})
        before = math.inf
        for _ in range(5):  # begun anew, it goes on where its approximation of the curvature was poor
            # (Values that rounding moves out of their bounds are clipped above.)
            warnings.filterwarnings("ignore", "Values in x were outside bounds")
            found = minimize(lambda y: self.evaluate(expand @ y)[0] / size, start,
                             jac=lambda y: self.evaluate(expand @ y)[1] @ expand / size, method="SLSQP", bounds=bounds,
                             constraints=constraints, options={"maxiter": 60, "ftol": tolerance})
            if not found.success or before - found.fun <= 1e-6 * abs(found.fun):
                break
            start, before = found.x, found.fun
        return found

    def misses(self, x):
        """The largest miss of a condition, as a part of its bound."""
        worst = 0.0
        for subject, (values, _) in zip(self.subjects, self.evaluate(x)[2]):
            sign = {"=": 0.0, "<=": 1.0, ">=": -1.0}[subject.relation]
            miss = numpy.abs(values) if sign == 0.0 else numpy.maximum(0.0, sign * values)
            worst = max(worst, miss.max() / max(1.0, abs(subject.value)))
        return worst


def optimise(scene, controls, minimise, subject=(), *, duration=None, knots=20, bounds=None, rates=None, start=None,
             commands=None, overrides=None, rate=100.0, tolerance=1e-7):
    """Finds the commands to `controls`, at `knots` instants each, that make a quantity at the end of a run least.

    Between two commands an input does what its hold says: zero_order steps, first_order_hold with the `period`
    duration/knots straight lines.

    Args:
        scene: as of `simulate`; `commands` to other inputs and `overrides` likewise.
        controls: topic or list of topics.
        minimise: the name of a state or an output, w_SHAFT, phi_SHAFT or e_SHAFT; with - in front: the largest.
        subject: conditions, texts such as "w_wheels(20) = 30" or, throughout, "w_engine <= 600".
        duration: s; left out, the last instant of `subject`.
        bounds: least and largest command by topic, {"ratio": (0.06, 0.4)}, within the scene's min and max (the default).
        rates: the largest change by topic, per second.
        start: constant commands by topic that the search begins with; left out, the middle of the bounds.
        rate: samples per second of the results.
        tolerance: the relative change of the cost at which the search ends.

    Returns a `Programme`. Raises ValueError, RuntimeError where no programme satisfies the conditions. A KeyboardInterrupt
    has the best one so far that satisfies them as its `programme`, where there is one.
    """
    controls = texts("controls", controls, "ratio")
    subjects = [read_subject(text) for text in texts("subject", subject, "w_load(2) = 3")]
    checked_name("minimise", minimise)
    for what, values in (("overrides", overrides), ("bounds", bounds), ("rates", rates), ("start", start)):
        mapping(what, values, {"overrides": OVERRIDES, "bounds": {"ratio": (0.06, 0.4)}}.get(what, {"ratio": 0.1}))
    finite("tolerance", tolerance, above=0.0)
    if duration is None:
        duration = max((s.time for s in subjects if s.time is not None), default=None)
        if duration is None:
            raise ValueError("duration: missing; it may be left out where a condition has an instant")
    duration = finite("duration", duration, "s", above=0.0)
    for s in subjects:
        if s.time is not None and not 0.0 < s.time <= duration:
            raise ValueError(f"subject: '{s.text}': outside of the run; allowed: after 0 s, until {duration:g} s")
    if not controls:
        raise ValueError("controls: none; allowed: one topic of a commanded input or more")
    for control in controls:
        if controls.count(control) > 1:
            raise ValueError(f"control: '{control}' is given twice; allowed: each once")
    problem = Problem(scene, duration, controls, whole_number("knots", knots, 1), minimise, subjects, read_commands(commands),
                      overrides, rate)
    limits, first = read_limits(scene, overrides, controls, bounds or {}, start or {})
    problem.limits = limits
    problem.scale = numpy.repeat([max(abs(low), abs(high)) if math.isfinite(high - low) else 1.0
                                  for low, high in limits], problem.knots)
    repeat = numpy.kron(numpy.eye(len(controls)), numpy.ones((problem.knots, 1)))
    unit = problem.scale[::problem.knots]
    problem.steps = limit_steps(problem, controls, rates or {})
    scaled = [(low / u, high / u) for (low, high), u in zip(limits, unit)]

    def run(x):
        return simulate(scene, duration, rate=rate, commands=problem.commands(x), columns="state,outputs,states",
                        overrides=overrides)

    def programme(x, best_constant, constant_cost, message):
        return Programme(problem.minimise, problem.commands(x), problem.sign * problem.evaluate(x)[0], run(x),
                         problem.commands(best_constant), constant_cost, run(best_constant), message, problem.runs)

    best_constant, constant_cost = repeat @ (numpy.array(first) / unit), math.nan
    try:
        constant = problem.solve(numpy.array(first) / unit, scaled, None, repeat, tolerance)
        found = repeat @ constant.x
        if numpy.isfinite(found).all() and problem.misses(found) < 1e-6:  # else no constant commands satisfy the conditions
            best_constant, constant_cost = found, problem.sign * problem.evaluate(found)[0]
        found = problem.solve(best_constant, [pair for pair in scaled for _ in range(problem.knots)], problem.steps,
                              numpy.eye(len(best_constant)), tolerance)
    except KeyboardInterrupt as interrupt:
        if problem.best[1] is not None:
            interrupt.programme = programme(problem.best[1], best_constant, constant_cost, "interrupted")
        raise
    if problem.misses(found.x) > 1e-5 or (not found.success and not found.message.startswith("Iteration limit")):
        raise RuntimeError(f"no programme that satisfies {', '.join(s.text for s in subjects)} was found ({found.message}); "
                           "wider bounds, more time or another start may have one")
    return programme(found.x, best_constant, constant_cost, found.message)


def inputs_of(tree, found=None):
    """The dictionaries of commanded inputs in a scene, by topic."""
    found = {} if found is None else found
    for value in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ():
        if isinstance(value, dict) and "topic" in value:
            found[value["topic"]] = value
        inputs_of(value, found)
    return found


def read_limits(scene, overrides, controls, bounds, start):
    """Bounds and first values of the controls."""
    from variator_sim import _core
    inputs = inputs_of(_core.Simulation(scene, overrides).scene)
    for name in controls:
        one_of("control", name, inputs, "commanded input of the scene")
    for what, values in (("bounds", bounds), ("start", start)):
        for name in values:
            one_of(what, name, controls, "control")
    limits, first = [], []
    for name in controls:
        least, greatest = float(inputs[name].get("min", -math.inf)), float(inputs[name].get("max", math.inf))
        try:
            low, high = bounds.get(name, (least, greatest))
            low, high = float(low), float(high)
        except (TypeError, ValueError):
            raise ValueError(f"bounds: '{name}': {shown(bounds[name])}; allowed: two numbers, the lower one first") from None
        if not low < high:
            raise ValueError(f"bounds: '{name}': from {low:g} to {high:g}; allowed: the lower one first")
        if low < least or high > greatest:
            raise ValueError(f"bounds: '{name}': from {low:g} to {high:g}; allowed: within the scene's limits, {least:g} to "
                             f"{greatest:g}")
        middle = 0.5 * (low + high) if math.isfinite(high - low) else float(inputs[name].get("initial", 0.0))
        value = finite(f"start: '{name}'", start[name]) if name in start else min(max(middle, low), high)
        if not low <= value <= high:
            raise ValueError(f"start: '{name}': {value:g}; allowed: within its bounds, {low:g} to {high:g}")
        limits.append((low, high))
        first.append(value)
    return limits, first


def limit_steps(problem, controls, rates):
    """Rows and bounds of |u_(k+1) - u_k| <= rate h."""
    for name, value in rates.items():
        one_of("rate", name, controls, "control")
        finite(f"rate: '{name}'", value, "per second", above=0.0)
    n, h = problem.knots, problem.duration / problem.knots
    rows, limit = [], []
    for c, name in enumerate(controls):
        for k in range(n - 1 if name in rates else 0):
            for sign in (1.0, -1.0):
                row = numpy.zeros(len(controls) * n)
                row[c * n + k + 1], row[c * n + k] = sign, -sign
                rows.append(row)
                limit.append(rates[name] * h / problem.scale[c * n])
    return numpy.array(rows), numpy.array(limit)
