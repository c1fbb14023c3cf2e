"""The compiled part: scenes, motions, samples."""

import os
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy
from numpy.typing import NDArray

from variator_sim.simulation import Sample

Scene = Union[str, "os.PathLike[str]", Mapping[str, Any]]
Array = NDArray[numpy.float64]

class Simulation:
    """What of variator_sim.Simulation is compiled."""

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
    def _linearize(self, state: Optional[Mapping[str, Any]], project: bool,
                   full: bool) -> Tuple[str, List[complex], List[str], str]: ...
    def _trim(self, fix: Sequence[Tuple[str, float]], free: Sequence[Tuple[str, float]],
              accelerating: bool) -> Tuple[str, List[Tuple[Any, ...]]]: ...
    def _residuals(self, accelerations: Array) -> Array: ...

def _format(value: float) -> str: ...
def read_commands(path: Union[str, "os.PathLike[str]"]) -> List[Tuple[float, str, float]]: ...
