"""The compiled part: scenes, motions, samples."""

import os
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy
from numpy.typing import ArrayLike, NDArray

from variator_sim.running import Result

Scene = Union[str, "os.PathLike[str]", Mapping[str, Any]]
Array = NDArray[numpy.float64]

class Sample:
    """A motion at one instant; a copy, which no later step changes.

    Arrays are in the order of the scene's shafts (`residual`, `multiplier`: of its constraints).
    `sample["load/velocity"]` is one number, by the name of its column.
    """

    @property
    def time(self) -> float:
        """s"""
    @property
    def angle(self) -> Array:
        """rad"""
    @property
    def velocity(self) -> Array:
        """rad/s"""
    @property
    def acceleration(self) -> Array:
        """rad/s^2"""
    @property
    def applied_torque(self) -> Array:
        """N m, positive accelerates"""
    @property
    def reaction_torque(self) -> Array:
        """N m"""
    @property
    def reaction_torque_rate(self) -> Array:
        """R', N m/s"""
    @property
    def reaction_torque_covariant_rate(self) -> Array:
        """G, N m/s; R' where the inertias are constant"""
    @property
    def residual(self) -> Array:
        """Residual of each constraint, its own unit."""
    @property
    def multiplier(self) -> Array: ...
    def keys(self) -> List[str]:
        """Names of the columns."""
    def __getitem__(self, column: str) -> float: ...

class LinearModel:
    """x' = A x + B u, y = C x + D u, in deviations from one instant of a motion.

    What the states mean: doc/linear_models.md. `print(model)` is the command line's report.
    """

    @property
    def A(self) -> Array:
        """States x states, 1/s and the states' units."""
    @property
    def B(self) -> Array:
        """States x inputs."""
    @property
    def C(self) -> Array:
        """Outputs x states."""
    @property
    def D(self) -> Array:
        """Outputs x inputs."""
    @property
    def x(self) -> Array:
        """The states there."""
    @property
    def u(self) -> Array:
        """The commands there."""
    @property
    def y(self) -> Array:
        """The outputs there."""
    @property
    def x_rate(self) -> Array:
        """x' there; zeros, but for angles, say that the state is steady."""
    @property
    def time(self) -> float:
        """s"""
    @property
    def states(self) -> List[str]:
        """Names, such as "drive/velocity"; "inputs/throttle" is that of a lag."""
    @property
    def inputs(self) -> List[str]:
        """Names of the commanded inputs."""
    @property
    def outputs(self) -> List[str]:
        """Names, as columns of `simulate`."""
    @property
    def notes(self) -> List[str]:
        """Notes on the validity of the numbers."""
    @property
    def eigenvalues(self) -> NDArray[numpy.complex128]:
        """Eigenvalues of A, 1/s, the slowest first."""
    def save(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Writes .npz, .csv or .mat, as `simulate --linearize --output` does."""

class SteadyState:
    """One of `Simulation.trim`."""

    @property
    def state(self) -> Dict[str, Any]:
        """The state as `Simulation.set_state` takes it, inputs included."""
    @property
    def residual(self) -> float:
        """The largest residual of the equations, N m, N m/s or the constraint's own unit."""
    @property
    def undetermined(self) -> List[str]:
        """Names of what may change together without leaving the steady states; not empty: this is
        one of infinitely many."""
    @property
    def stability(self) -> str:
        """"stable, ..." or "unstable: ...", by the eigenvalues of the linear model there."""

class Simulation:
    """The motion of one scene, moved step by step.

    One thread at a time may use a simulation; other threads of the interpreter go on while it
    moves. The motion depends on the scene and on times and values of commands only: neither samples
    nor how its advances are cut change a bit of it.
    """

    def __init__(self, scene: Scene, overrides: Optional[Mapping[str, Any]] = None, *,
                 energy: bool = False) -> None:
        """Reads a scene.

        Args:
            scene: path of a YAML file, YAML text (of several lines, or in braces), or a dict.
            overrides: values in place of the scene's by path: {"drive/inertia": 1.2}.
            energy: integrate the energies instead of estimating them (costs about a step again).

        Raises:
            SceneError: with the key's path, the value, what is allowed and the nearest name.
        """
    @property
    def time(self) -> float:
        """The present, s."""
    def advance(self, duration: float) -> None:
        """Moves the present by `duration`, s. Raises MotionStopped."""
    def advance_to(self, time: float) -> None:
        """Moves the present to `time`, s. Raises MotionStopped."""
    def step(self, duration: float, commands: Optional[Mapping[str, float]] = None) -> Sample:
        """Gives commands, advances by `duration`, s, and returns the sample there.

        What the service `~step` does: lockstep with a controller.
        """
    def command(self, topic: str, value: float) -> bool:
        """Commands an input from the present on; False when the value was clamped."""
    def sample(self) -> Sample:
        """Everything at the present, after its commands."""
    def __getitem__(self, column: str) -> float:
        """A column of `sample` at the present, without making one: for loops of a million steps."""
    def record(self, columns: Union[str, Iterable[str]] = "state") -> Result:
        """Adds the present to the recording of this simulation, and returns all of it.

        Args:
            columns: groups of columns as of `simulate`; other groups than before begin a new recording.
        """
    def state(self) -> Dict[str, Any]:
        """All that the motion to come depends on beside the scene, as plain Python values.

        The motion goes on from what is returned, exactly as one does that is given it by
        `set_state`: with steps begun anew.
        """
    def set_state(self, state: Mapping[str, Any], project: bool = False) -> None:
        """Goes on from a state, or from a part of one: the rest stays as it is.

        Args:
            state: of `state`, or such as {"shafts": {"drive": {"velocity": 5.0}}} (doc/scene.md).
            project: move inconsistent values to consistent ones near them.
        """
    def take_events(self) -> List[Dict[str, Any]]:
        """Changes of modes and events of the scene up to the present that have not been taken:
        `time` (s), `element`, `from`, `to`, `torque` (N m), `impulse` (N m s)."""
    def reset(self) -> None:
        """Back to time 0 and the scene's start; commands and counts are forgotten."""
    def linearize(self, state: Optional[Mapping[str, Any]] = None, *, project: bool = False,
                  full: bool = False) -> LinearModel:
        """The linear model at the present, from exact derivatives; the motion stays where it is.

        Args:
            state: there instead; what `set_state` takes, with `project` as there.
            full: all of (phi, omega, epsilon) as states instead of coordinates on the constraints.

        Raises:
            SceneError: where there is no model: C has lost rank, or a corner of the constraint.
        """
    def trim(self, fix: Optional[Mapping[str, float]] = None,
             free: Union[None, str, Iterable[str], Mapping[str, Optional[float]]] = None, *,
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
    def residuals(self, accelerations: ArrayLike) -> Array:
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
    @property
    def outputs(self) -> Dict[str, float]:
        """The scene's named outputs at the present."""
    @property
    def states(self) -> Dict[str, float]:
        """The scene's states at the present."""
    @property
    def variables(self) -> Dict[str, float]:
        """The scene's variables at the present."""
    @property
    def principle(self) -> Dict[str, float]:
        """G of each shaft, N m/s, its measure Z and the constraint measure."""
    @property
    def inputs(self) -> Dict[str, float]:
        """Commanded inputs in force, after hold and clamp."""
    @property
    def elements(self) -> Dict[str, float]:
        """Torques and powers of each torque element, and what elements tell beside."""
    @property
    def energy(self) -> Dict[str, float]:
        """kinetic, applied, reactions (J, the latter two since the start), applied_power,
        reaction_power (W)."""
    @property
    def shafts(self) -> List[str]: ...
    @property
    def constraints(self) -> List[str]: ...
    @property
    def orders(self) -> List[int]:
        """Order of each constraint: 1 for speeds, 2 for accelerations, 3 for jerks."""
    @property
    def topics(self) -> List[str]:
        """Names that `command` takes."""
    @property
    def scene(self) -> Dict[str, Any]:
        """The scene as it was read, overrides included."""
    @property
    def stepper(self) -> str:
        """The stepper in use and why."""
    @property
    def machine_code(self) -> str:
        """The machine code or interpreter that evaluates the formulas."""
    def compile(self) -> bool:
        """Makes machine code of the formulas, which changes no bit; about a second. False where
        `machine_code` says why not."""
    @property
    def is_sleeping(self) -> bool:
        """At rest and not stepped until a command comes."""
    @property
    def statistics(self) -> Dict[str, int]:
        """Counts since the start or the last reset."""
    @property
    def doubts(self) -> List[str]:
        """Doubts about the motion so far: fixed steps that are crude, reactions that feed
        or drain the machine."""
    def columns(self, groups: str = "state") -> List[str]:
        """Names of the columns of groups of `simulate`."""
    def _run(self, duration: float, rate: float, times: Optional[Sequence[float]],
             commands: Sequence[Tuple[float, str, float]], columns: str,
             until_rest: bool, gradient: Sequence[str] = ...) -> Tuple[Any, ...]: ...

def read_commands(path: Union[str, "os.PathLike[str]"]) -> List[Tuple[float, str, float]]: ...
