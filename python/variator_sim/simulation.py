"""A motion that is moved step by step: what of it is best written in Python."""

import collections.abc
import dataclasses
import numbers
import os
import warnings
from typing import Any, Dict, Iterable, Iterator, List, Mapping, Union

import numpy
from numpy.typing import ArrayLike

from variator_sim import _core, linear_model_files
from variator_sim.checks import did_you_mean, shown
from variator_sim.errors import NoSteadyState, SceneError
from variator_sim.files import write_bytes
from variator_sim.running import Result, record


class _Array:
    """An array of a sample or a model, a copy."""

    def __init__(self, meaning):
        self.__doc__ = meaning

    def __set_name__(self, kind, name):
        self._name = name

    def __get__(self, owner, kind=None) -> numpy.ndarray:
        return self if owner is None else owner._array(self._name).copy()


class Sample(collections.abc.Mapping):
    """A motion at one instant; a copy, which no later step changes.

    Arrays are in the order of the scene's shafts (`residual`, `multiplier`: of its constraints).
    `sample["load/velocity"]` is one number, by the name of its column.
    """

    __slots__ = ("_numbers", "_places", "_slices")

    def __init__(self, numbers, places, slices):
        self._numbers = numbers
        self._places = places  # of the columns among the numbers
        self._slices = slices  # of the arrays

    angle = _Array("rad")
    velocity = _Array("rad/s")
    acceleration = _Array("rad/s^2")
    applied_torque = _Array("N m, positive accelerates")
    reaction_torque = _Array("N m")
    reaction_torque_rate = _Array("R', N m/s")
    reaction_torque_covariant_rate = _Array("G, N m/s; R' where the inertias are constant")
    residual = _Array("Residual of each constraint, its own unit.")
    multiplier = _Array("Multiplier of each constraint, lambda.")

    def _array(self, name):
        return self._numbers[self._slices[name]]

    @property
    def time(self) -> float:
        """s"""
        return self["time"]

    def keys(self) -> List[str]:
        """Names of the columns."""
        return list(self._places)

    def __getitem__(self, column: str) -> float:
        try:
            return float(self._numbers[self._places[column]])
        except (KeyError, TypeError):
            raise KeyError(f"'{column}' is no column of a sample{did_you_mean(column, self.keys())}; allowed: "
                           + ", ".join(self.keys())) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __eq__(self, other: object) -> bool:
        """True where each column is the same number, or neither is one."""
        if not isinstance(other, Sample) or self.keys() != other.keys():
            return False
        return numpy.array_equal(list(self.values()), list(other.values()), equal_nan=True)

    def __repr__(self) -> str:
        return "Sample(" + ", ".join(f"{name}={_core._format(value)}" for name, value in self.items()) + ")"


class LinearModel:
    """x' = A x + B u, y = C x + D u, in deviations from one instant of a motion.

    What the states mean: doc/linear_models.md. `print(model)` is the command line's report.

    Attributes:
        time: the instant, s.
        states: names, such as "drive/velocity"; "inputs/throttle" is that of a lag.
        inputs: names of the commanded inputs.
        outputs: names, as columns of `simulate`.
        notes: on the validity of the numbers.
    """

    def __init__(self, table, eigenvalues, notes, report):
        self._table = table
        self._arrays = {**linear_model_files.read(table), "eigenvalues": numpy.array(eigenvalues, dtype=complex)}
        self._report = report
        self.notes = notes
        self.time = float(self._arrays["time"])
        self.states, self.inputs, self.outputs = (self._arrays[name].tolist() for name in ("states", "inputs", "outputs"))

    A = _Array("States x states, 1/s and the states' units.")
    B = _Array("States x inputs.")
    C = _Array("Outputs x states.")
    D = _Array("Outputs x inputs.")
    x = _Array("The states there.")
    u = _Array("The commands there.")
    y = _Array("The outputs there.")
    x_rate = _Array("x' there; zeros, but for angles, say that the state is steady.")
    eigenvalues = _Array("Eigenvalues of A, 1/s, the slowest first.")

    def _array(self, name):
        return self._arrays[name]

    def save(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Writes .npz, .csv or .mat, as `simulate --linearize --output` does."""
        ending = os.path.splitext(os.fspath(path))[1]
        if ending != ".csv" and ending not in linear_model_files.WRITERS:
            raise ValueError(f"'{path}' ends neither with .csv nor with .npz nor with .mat")
        write_bytes(path, self._table.encode() if ending == ".csv" else linear_model_files.convert(self._table, ending))

    def __str__(self):
        return self._report

    def __repr__(self):
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<LinearModel at {_core._format(self.time)} s: {sizes}>"


@dataclasses.dataclass(frozen=True)
class SteadyState:
    """One of `Simulation.trim`.

    Attributes:
        state: the state as `Simulation.set_state` takes it, inputs included.
        residual: the largest residual of the equations, N m, N m/s or the constraint's own unit.
        undetermined: names of what may change together without leaving the steady states; not empty: this is one
            of infinitely many.
        stability: "stable, ..." or "unstable: ...", by the eigenvalues of the linear model there.
    """

    state: Dict[str, Any]
    residual: float
    undetermined: List[str]
    stability: str

    def __repr__(self):
        return f"<SteadyState {self.state!r}, {self.stability}>"


def _choices(choices, what):
    """Names with values, NaN where there is none."""
    if choices is None:
        return []
    if isinstance(choices, str):
        choices = [choices]
    if not isinstance(choices, collections.abc.Iterable):
        raise TypeError(f"{what}: {shown(choices)}; allowed: a name, a list of names, or a dict such as "
                        "{'w_drive': 10.0}")
    pairs = list(choices.items() if hasattr(choices, "items") else [(name, None) for name in choices])
    for name, value in pairs:
        if not isinstance(name, str):
            raise SceneError(f"{what}: {shown(name)} is not a text", what)
        if value is not None and not isinstance(value, numbers.Real):
            raise TypeError(f"{what}: '{name}': {shown(value)}; allowed: a number")
    return [(name, numpy.nan if value is None else float(value)) for name, value in pairs]


class Simulation(_core.Simulation):
    """The motion of one scene, moved step by step.

    One thread at a time may use a simulation; other threads of the interpreter go on while it
    moves. The motion depends on the scene and on times and values of commands only: neither samples
    nor how its advances are cut change a bit of it.
    """

    __slots__ = ()

    def record(self, columns: Union[str, Iterable[str]] = "state") -> Result:
        """Adds the present to the recording of this simulation, and returns all of it.

        Args:
            columns: groups of columns as of `simulate`; other groups than before begin a new recording.
        """
        return record(self, columns)

    def linearize(self, state: Union[None, Mapping[str, Any]] = None, *, project: bool = False,
                  full: bool = False) -> LinearModel:
        """The linear model at the present, from exact derivatives; the motion stays where it is.

        Args:
            state: there instead; what `set_state` takes, with `project` as there.
            full: all of (phi, omega, epsilon) as states instead of coordinates on the constraints.

        Raises:
            SceneError: where there is no model: C has lost rank, or a corner of the constraint.
        """
        return LinearModel(*self._linearize(state, project, full))

    def trim(self, fix: Union[None, Mapping[str, float]] = None,
             free: Union[None, str, Iterable[str], Mapping[str, Union[None, float]]] = None, *,
             accelerating: bool = False) -> List[SteadyState]:
        """The scene's steady states, the nearest to its start first.

        Args:
            fix: what is given: {"drive_torque": 5.0, "w_drive": 10.0}; speeds `w_SHAFT`, angles
                `phi_SHAFT`, inputs, `t`, outputs, "SHAFT/applied_torque", "SHAFT/reaction_torque".
            free: names of what is not, beside speeds; or a dict with where to look first.
            accelerating: accelerations in constant ratios instead of constant speeds.

        What is not named is as at the scene's start; neither the present nor its commands matter.
        Of infinitely many states one is returned, with a warning.

        Raises:
            NoSteadyState: with what stands against it.
            SceneError: a name that means nothing.
        """
        given = _choices(fix, "fix")
        for name, value in given:
            if not numpy.isfinite(value):
                raise SceneError(f"fix: '{name}': {_core._format(value)}; allowed: a finite number", "fix")
        message, found = self._trim(given, _choices(free, "free"), accelerating)
        if not found:
            raise NoSteadyState(message)
        states = [SteadyState(*it) for it in found]
        if states[0].undetermined:
            warnings.warn(message, stacklevel=2)
        return states

    def residuals(self, accelerations: ArrayLike) -> numpy.ndarray:
        """Residuals of the constraints at the current time for the given accelerations of the shafts.

        Time, angles, speeds and inputs in force are the present's; the motion stays where it is.

        Args:
            accelerations: rad/s^2, of shape (..., shafts), in the order of `shafts`.

        Returns:
            Of shape (..., constraints), in the order of `constraints`, each in its own unit: psi for
            order 2, f' = df/dt for order 1, and NaN for order 3, which says nothing of accelerations
            alone.

        Raises:
            ValueError: another number of accelerations than of shafts, or one that is not finite.
            MotionStopped: there is no present.
        """
        try:
            values = numpy.asarray(accelerations, dtype=float)
        except (TypeError, ValueError):
            raise TypeError(f"accelerations: {shown(accelerations)}; allowed: numbers") from None
        shafts = self.shafts
        if values.ndim == 0 or values.shape[-1] != len(shafts):
            found = f"{values.shape[-1]} in the last dimension" if values.ndim else "one number"
            raise ValueError(f"accelerations: {found}; allowed: {len(shafts)}, one for each shaft ({', '.join(shafts)})")
        for place in numpy.argwhere(~numpy.isfinite(values)):
            raise ValueError(f"accelerations: {_core._format(values[tuple(place)])} for shaft '{shafts[place[-1]]}'; "
                             "allowed: finite numbers")
        return self._residuals(values)
