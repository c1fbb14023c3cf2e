"""Whole runs, as arrays by column name."""

import collections.abc
import contextlib
import csv
import math
import os
import warnings
import weakref

import numpy

from variator_sim import _core
from variator_sim.checks import did_you_mean, finite, is_number, mapping, shown, texts
from variator_sim.errors import MotionStopped
from variator_sim.files import whole_file


MOST_SAMPLES = 100_000_000  # of one run: its table is held in memory
OVERRIDES = {"drive/inertia": 1.2}  # an example


class Result(collections.abc.Mapping):
    """Samples of a run: `result["load/velocity"]` is that column, one value a sample.

    A mapping of column names to arrays, so `pandas.DataFrame(dict(result))` is its table.

    Attributes:
        columns: names of the columns, "time" (s) first.
        values: all of it, samples x columns.
        statistics: steps, jumps, commands and other counts of the run.
        events: changes of modes and the scene's events in the run, dicts of time (s), element, from,
            to, torque (N m), impulse (N m s).
        units: the units that the scene states for its outputs, {"outputs/speed": "rpm"}.
    """

    def __init__(self, columns, values, statistics, units=None, events=()):
        self.columns = list(columns)
        self.values = values
        self.statistics = statistics
        self.events = list(events)
        self.units = {name: unit for name, unit in (units or {}).items() if name in self.columns}
        self._places = {name: place for place, name in enumerate(self.columns)}

    @property
    def time(self):
        """Instants of the samples, s."""
        return self["time"]

    def __getitem__(self, column):
        try:
            return self.values[:, self._places[column]]
        except KeyError:
            raise KeyError(f"'{column}' is no column of this run{did_you_mean(column, self.columns)}; its columns: "
                           + ", ".join(self.columns)) from None

    def __iter__(self):
        return iter(self.columns)

    def __len__(self):
        return len(self.columns)

    def __repr__(self):
        span = f", {self.time[0]:g} to {self.time[-1]:g} s" if len(self.values) else ""
        return f"<Result of {len(self.values)} samples x {len(self.columns)} columns{span}>"

    def to_csv(self, path):
        """Writes the file that `simulate --output` writes, in full precision."""
        with whole_file(path) as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([f"{name} [{self.units[name]}]" if name in self.units else name for name in self.columns])
            writer.writerows(self.values.tolist())

    def plot(self, columns=None, **options):
        """Draws it: `variator_sim.plotting.plot`."""
        from variator_sim import plotting  # matplotlib takes a second to load
        return plotting.plot(self, columns, **options)


def read_commands(commands):
    """Commands in the order of their times, as tuples (time, topic, value).

    Args:
        commands: None; the path of a CSV with the header time,topic,value; such tuples; or a dict
            of topics, each with pairs (time, value).
    """
    if commands is None:
        return []
    if isinstance(commands, (str, os.PathLike)):
        listed = _core.read_commands(commands)
    elif isinstance(commands, collections.abc.Mapping):
        listed = []
        for topic, points in commands.items():
            try:
                listed += [(time, topic, value) for time, value in points]
            except (TypeError, ValueError):
                raise ValueError(f"commands: '{topic}': {str(points)[:80]}; allowed: pairs (time, value), such as "
                                 f"{{'{topic}': [(0.0, 0.4)]}}") from None
    else:
        listed = list(commands) if isinstance(commands, collections.abc.Iterable) else [commands]
    try:
        listed = [(float(time), str(topic), float(value)) for time, topic, value in listed]
    except (TypeError, ValueError):
        raise ValueError(f"commands: {str(listed)[:80]}; allowed: tuples (time, topic, value) of numbers, a dict of "
                         "topics with pairs (time, value), or the path of a CSV file") from None
    for time, topic, value in listed:
        if not (math.isfinite(time) and time >= 0.0 and math.isfinite(value)):
            raise ValueError(f"commands: ({time}, '{topic}', {value}); allowed: finite values at "
                             "times of 0 s or later")
    return sorted(listed, key=lambda command: command[0])


def checked_times(duration, rate, times):
    """Duration and instants (or None) of a run, checked as the command line does."""
    if times is not None:
        try:
            times = numpy.atleast_1d(numpy.asarray(times, dtype=float))
        except (TypeError, ValueError):
            raise ValueError(f"times: {shown(times)}; allowed: instants, s, numbers in ascending order") from None
        if not (times.ndim == 1 and times.size and numpy.isfinite(times).all() and times[0] >= 0.0
                and (numpy.diff(times) >= 0.0).all()):
            raise ValueError("times: allowed are finite instants of 0 s or later in ascending order")
        if duration is None:
            duration = times[-1]
        if times[-1] > finite("duration", duration, "s", least=0.0):
            raise ValueError(f"times: {times[-1]} s lies after the end, {duration} s")
    if duration is None:
        raise ValueError("duration: missing; it may be left out with times")
    finite("rate", rate, "samples per second", above=0.0)
    return finite("duration", duration, "s", least=0.0), times


def check_samples(what, value, count, things="samples"):
    """Before there is room made for so many."""
    if count > MOST_SAMPLES:
        raise ValueError(f"{what}: {value:g} makes {count:.3g} {things}; allowed: {MOST_SAMPLES} at most in one run; several runs, each from "
                         "the state of the one before, take it in parts")


def units_of(scene):
    """The units that a scene, a dict, states for its outputs, by column: {"outputs/speed": "rpm"}."""
    outputs = {name: scene.get(name) for name in scene.get("outputs") or []}
    return {f"outputs/{name}": output["unit"] for name, output in outputs.items()
            if isinstance(output, dict) and "unit" in output}


class Recording(Result):
    """A `Result` that grows, a sample at a time."""

    def __init__(self, simulation, groups):
        self.groups = groups
        self._rows = []
        self._array = None
        super().__init__(simulation.columns(groups), None, {}, units_of(simulation.scene))

    @property
    def values(self):
        if self._array is None or len(self._array) < len(self._rows):
            self._array = numpy.array(self._rows)
        return self._array

    @values.setter
    def values(self, array):
        self._array = array

    def add(self, simulation):
        """Another sample; one of the same instant, after a command, takes the place of the last."""
        rows, _, error = simulation._run(0.0, 1.0, None, [], self.groups, False)
        if error is not None:
            raise error
        row = rows[0]
        if self._rows and self._rows[-1][0] == row[0]:
            self._rows.pop()
            self._array = None
        self._rows.append(row)
        self.statistics = simulation.statistics


RECORDINGS = weakref.WeakKeyDictionary()  # of simulations


def record(simulation, columns="state"):
    """Adds the present to the recording of `simulation`, and returns all of it, a `Result`.

    Args:
        columns: groups of columns as of `simulate`; other groups than before begin a new recording.
    """
    groups = ",".join(texts("columns", columns, "state,inputs"))
    recording = RECORDINGS.get(simulation)
    if recording is None or recording.groups != groups or (len(recording._rows)
                                                           and simulation.time < recording._rows[-1][0]):
        recording = RECORDINGS[simulation] = Recording(simulation, groups)
    recording.add(simulation)
    return recording


def give_result(error, result):
    with contextlib.suppress(AttributeError, TypeError):  # an exception may refuse it
        error.result = result


def run_controlled(simulation, controller, period, end, instants, listed, groups, blocks):
    """Runs to `end` with a controller asked every `period` s; adds to `blocks`, and returns the rest of what
    `Simulation._run` does."""
    outside, error = 0, None
    begin = simulation.time
    count = max(1, math.ceil((end - begin) / period - 1e-9))
    for k in range(1, count + 1):
        now = simulation.time
        commands = controller(simulation.sample())
        if commands is not None and not isinstance(commands, collections.abc.Mapping):
            raise TypeError(f"controller: returned {str(commands)[:80]}; allowed: a dict of commands by topic, or None")
        for topic, value in (commands or {}).items():
            if not (isinstance(topic, str) and is_number(value)):
                raise TypeError(f"controller: returned {shown(topic)}: {shown(value)}; allowed: finite numbers by topic")
            simulation.command(topic, value)
        target = end if k == count else round((begin + k * period) * 1e9) / 1e9
        is_last = k == count
        inside = [t for t in instants if now <= t and (t < target or is_last)]
        due = [command for command in listed if now <= command[0] and (command[0] < target or is_last)]
        values, missed, error = simulation._run(target - now, 1.0, inside, due, groups, False)
        blocks.append(values)
        outside += missed
        if error is not None:
            break
        simulation.advance_to(target)
    return outside, error


def simulate(scene, duration=None, *, rate=100.0, times=None, commands=None, columns="state",
             overrides=None, state=None, until_rest=False, controller=None, period=0.01, gradient=()):
    """Runs a scene, as `rosrun variator_sim simulate` does, and returns a `Result`.

    Args:
        scene: path of a YAML file, YAML text (of several lines, or in braces), or a dict.
        duration: simulated time, s; may be left out with `times`.
        rate: samples per second; the end itself is sampled too.
        times: sample at these instants instead, s, ascending.
        commands: path of a CSV, tuples (time, topic, value), or a dict of topics with pairs
            (time, value).
        columns: groups of columns, "state", "elements", "inputs", "outputs", "states", "variables", "principle",
            "energy", with commas between, or a list of groups.
        overrides: values in place of the scene's by path: {"drive/inertia": 1.2}.
        state: where to start from, of `Simulation.state`.
        until_rest: end sooner, once the motion has come to rest.
        controller: called every `period` s, at the start too, with the `Sample` there; returns a dict
            of commands by topic, which act from there on, or None: lockstep, as `Simulation.step`.
        period: of the controller, s of simulated time.
        gradient: numbers of the scene by path ("drive/inertia") and commands ("ratio@2.0") that the samples are
            differentiated by: adds columns such as "d(load/velocity)/d(drive/inertia)".

    What the command line warns of is a warning here too (`warnings`). What a controller raises, and Ctrl-C, has the
    samples up to then as its `result`, too.

    Raises:
        SceneError: the scene cannot be run as it is written.
        MotionStopped: the motion stopped; its `result` has the samples up to then.
    """
    duration, times = checked_times(duration, rate, times)
    groups = ",".join(texts("columns", columns, "state,inputs"))
    listed = read_commands(commands)
    mapping("overrides", overrides, OVERRIDES)
    mapping("state", state, {"shafts": {"drive": {"velocity": 5.0}}})
    if times is None and not until_rest:
        check_samples("rate", rate, duration * rate)
    simulation = _core.Simulation(scene, overrides, energy="energy" in groups.split(","))
    names = simulation.columns(groups)
    if state is not None:
        simulation.set_state(state)

    def result_of(values):
        return Result(names, values, simulation.statistics, units_of(simulation.scene), simulation.take_events())

    if gradient:
        if state is not None or controller is not None:
            raise ValueError("gradient: excludes state and controller, which have no derivatives")
        values, outside, error, names, end_of_gradient = simulation._run(
            duration, rate, times, listed, groups, until_rest, texts("gradient", gradient, "drive/inertia"))
        if end_of_gradient:
            warnings.warn(end_of_gradient, stacklevel=2)
    elif controller is None:
        values, outside, error = simulation._run(duration, rate, times, listed, groups, until_rest)
    else:
        if until_rest or not callable(controller) or not is_number(period) or not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"controller: {controller}, period: {period}, until_rest: {until_rest}; allowed: a "
                             "function of a sample, a period > 0 s, and no until_rest")
        check_samples("period", period, duration / period, "calls of the controller")
        end = simulation.time + duration
        if times is None:
            first, last = math.floor(simulation.time * rate) + 1, math.ceil(end * rate)
            times = [simulation.time, *(k / rate for k in range(first, last)), end]
        blocks = [numpy.empty((0, len(names)))]
        try:
            outside, error = run_controlled(simulation, controller, period, end, times, listed, groups, blocks)
        except BaseException as fault:
            give_result(fault, result_of(numpy.vstack(blocks)))
            raise
        values = numpy.vstack(blocks)
    result = result_of(values)
    if error is not None:
        give_result(error, result)
        raise error
    for doubt in simulation.doubts:
        warnings.warn(doubt, stacklevel=2)
    if outside:
        warnings.warn(f"{outside} commands lie outside of the run and are ignored", stacklevel=2)
    return result
