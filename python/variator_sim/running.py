"""Whole runs, as arrays by column name."""

import collections.abc
import csv
import difflib
import math
import os
import warnings

import numpy

from variator_sim import _core
from variator_sim.errors import MotionStopped
from variator_sim.files import whole_file


class Result(collections.abc.Mapping):
    """Samples of a run: `result["load/velocity"]` is that column, one value a sample.

    A mapping of column names to arrays, so `pandas.DataFrame(dict(result))` is its table.

    Attributes:
        columns: names of the columns, "time" (s) first.
        values: all of it, samples x columns.
        statistics: steps, jumps, commands and other counts of the run.
        units: the units that the scene states for its outputs, {"outputs/speed": "rpm"}.
    """

    def __init__(self, columns, values, statistics, units=None):
        self.columns = list(columns)
        self.values = values
        self.statistics = statistics
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
            near = difflib.get_close_matches(str(column), self.columns, 1)
            hint = f" (did you mean '{near[0]}'?)" if near else ""
            raise KeyError(f"'{column}' is no column of this run{hint}; its columns: "
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
        listed = list(commands)
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
        times = numpy.atleast_1d(numpy.asarray(times, dtype=float))
        if not (times.ndim == 1 and times.size and numpy.isfinite(times).all() and times[0] >= 0.0
                and (numpy.diff(times) >= 0.0).all()):
            raise ValueError("times: allowed are finite instants of 0 s or later in ascending order")
        if duration is None:
            duration = times[-1]
        if times[-1] > duration:
            raise ValueError(f"times: {times[-1]} s lies after the end, {duration} s")
    if duration is None:
        raise ValueError("duration: missing; it may be left out with times")
    if not (math.isfinite(duration) and duration >= 0.0):
        raise ValueError(f"duration: {duration} s; allowed: a finite number >= 0")
    if not (math.isfinite(rate) and rate > 0.0):
        raise ValueError(f"rate: {rate}; allowed: a finite number > 0")
    return float(duration), times


def units_of(scene):
    """The units that a scene, a dict, states for its outputs, by column: {"outputs/speed": "rpm"}."""
    outputs = {name: scene.get(name) for name in scene.get("outputs") or []}
    return {f"outputs/{name}": output["unit"] for name, output in outputs.items()
            if isinstance(output, dict) and "unit" in output}


def simulate(scene, duration=None, *, rate=100.0, times=None, commands=None, columns="state",
             overrides=None, state=None, until_rest=False):
    """Runs a scene, as `rosrun variator_sim simulate` does, and returns a `Result`.

    Args:
        scene: path of a YAML file, YAML text (of several lines, or in braces), or a dict.
        duration: simulated time, s; may be left out with `times`.
        rate: samples per second; the end itself is sampled too.
        times: sample at these instants instead, s, ascending.
        commands: path of a CSV, tuples (time, topic, value), or a dict of topics with pairs
            (time, value).
        columns: groups of columns, "state", "elements", "inputs", "outputs", "energy", with commas
            between, or a list of groups.
        overrides: values in place of the scene's by path: {"drive/inertia": 1.2}.
        state: where to start from, of `Simulation.state`.
        until_rest: end sooner, once the motion has come to rest.

    What the command line warns of is a warning here too (`warnings`).

    Raises:
        SceneError: the scene cannot be run as it is written.
        MotionStopped: the motion stopped; its `result` has the samples up to then.
    """
    duration, times = checked_times(duration, rate, times)
    groups = columns if isinstance(columns, str) else ",".join(columns)
    listed = read_commands(commands)
    simulation = _core.Simulation(scene, overrides, energy="energy" in groups.split(","))
    names = simulation.columns(groups)
    if state is not None:
        simulation.set_state(state)
    values, outside, error = simulation._run(duration, rate, times, listed, groups, until_rest)
    result = Result(names, values, simulation.statistics, units_of(simulation.scene))
    if error is not None:
        error.result = result
        raise error
    for doubt in simulation.doubts:
        warnings.warn(doubt, stacklevel=2)
    if outside:
        warnings.warn(f"{outside} commands lie outside of the run and are ignored", stacklevel=2)
    return result
