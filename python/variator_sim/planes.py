"""The plane of two shafts' accelerations: what a constraint allows there, and the motion on it."""

import matplotlib.pyplot as plt
import numpy
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize

from variator_sim.simulation import Simulation
from variator_sim.checks import one_of
from variator_sim.plotting import save

# Without its end, a yellow that white paper swallows.
TIMES = ListedColormap(plt.get_cmap("viridis")(numpy.linspace(0.0, 0.88, 256)), "times")
LETTERS = {1: "f′", 2: "ψ"}
GRID = 301  # points along each axis
NEAR = 1e-3  # of the view: how far off its constraint a run may lie
SPREAD = 4.0  # times as far in one direction as in the other: beyond, a circle is no circle


class Plane:
    """One constraint over the accelerations of two shafts; the others keep those of the instant."""

    def __init__(self, simulation, constraint, shafts):
        self.simulation = simulation
        self.constraint = constraint
        self.shafts = shafts
        self.name = simulation.constraints[constraint]
        self.order = simulation.orders[constraint]
        self.offset = 0.0

    def residual(self, accelerations):
        return self.simulation.residuals(accelerations)[..., self.constraint] - self.offset

    def gradient(self, acceleration):
        steps = numpy.diag(1e-6 * (1.0 + numpy.abs(acceleration)))
        ahead, behind = (self.residual(acceleration + sign * steps) for sign in (1.0, -1.0))
        return (ahead - behind) / (2.0 * numpy.diag(steps))

    def check(self, acceleration, time, size):
        """Moves f' onto the motion and refuses a psi that does not lie there."""
        self.offset = 0.0
        left = float(self.residual(acceleration))
        if self.order == 1:
            # The term of the commanded inputs' rates, which runs do not have, is the same for all
            # accelerations.
            self.offset = left
        elif not abs(left) <= NEAR * size * numpy.linalg.norm(self.gradient(acceleration)) + 1e-9:
            raise ValueError(f"at {time:g} s the run does not lie on constraint '{self.name}', of which "
                             f"{left:g} is left: is it a run of this scene, with these values?")

    def values(self, acceleration, axes):
        """Its residual over a grid."""
        points = numpy.tile(acceleration, (GRID, GRID, 1))
        points[..., self.shafts[0]], points[..., self.shafts[1]] = numpy.meshgrid(*axes)
        return self.residual(points)


class Motion:
    """A run of a scene, instant by instant."""

    def __init__(self, result, simulation, instants):
        self.simulation = simulation
        self.time = result["time"]
        self.angle, self.velocity, self.acceleration = (
            numpy.column_stack([result[f"{shaft}/{quantity}"] for shaft in simulation.shafts])
            for quantity in ("angle", "velocity", "acceleration"))
        missing = [topic for topic in simulation.topics if f"inputs/{topic}" not in result]
        if missing:
            raise ValueError(f"this run does not tell its inputs ({', '.join(missing)}), which the constraint may "
                             "depend on; run it with the columns state,inputs")
        self.inputs = {topic: result[f"inputs/{topic}"] for topic in simulation.topics}
        self.rows = self.find(instants)

    def find(self, instants):
        """Places of the samples next to these instants; by default of six of them."""
        first, last = self.time[0], self.time[-1]
        if instants is None:
            instants = numpy.linspace(first, last, 6)
        for instant in instants:
            if not first <= instant <= last:
                raise ValueError(f"instants: {instant:g} s; this run is one from {first:g} to {last:g} s")
        return sorted({int(numpy.abs(self.time - instant).argmin()) for instant in instants})

    def go_to(self, row):
        """Puts the simulation there."""
        shafts = {name: {"angle": float(self.angle[row, i]), "velocity": float(self.velocity[row, i]),
                         "acceleration": float(self.acceleration[row, i])}
                  for i, name in enumerate(self.simulation.shafts)}
        inputs = {topic: {"value": float(values[row])} for topic, values in self.inputs.items()}
        self.simulation.set_state({"time": float(self.time[row]), "shafts": shafts, "inputs": inputs}, project=True)
        moved = numpy.abs(self.simulation.sample().velocity - self.velocity[row])
        if not numpy.all(moved <= 1e-6 * (1.0 + numpy.abs(self.velocity[row]).max())):
            raise ValueError(f"at {self.time[row]:g} s the run's speeds contradict the scene's constraints: is it "
                             "a run of this scene, with these values?")


def choose_planes(simulation, motion, shafts):
    """A plane for each constraint that reads accelerations: of the shafts named, or of the two that it reads most."""
    planes = [Plane(simulation, m, None) for m, order in enumerate(simulation.orders) if order < 3]
    if shafts is not None:
        for shaft in shafts:
            one_of("shafts", shaft, simulation.shafts, "shaft of this scene")
        if len(set(shafts)) != 2:
            raise ValueError("shafts: two different ones make a plane")
    weights = numpy.zeros((len(planes), len(simulation.shafts)))
    for row in motion.rows:
        motion.go_to(row)
        here = motion.acceleration[row]
        for point in (here, here + 1.0 + numpy.abs(here)):  # e^2 has no slope at e = 0
            weights += [numpy.abs(plane.gradient(point)) for plane in planes]
    for plane, weight in zip(planes, weights):
        # (Stable: of shafts that it reads alike, or not at all, the first ones.)
        plane.shafts = (tuple(sorted(numpy.argsort(-weight, kind="stable")[:2])) if shafts is None
                        else tuple(simulation.shafts.index(shaft) for shaft in shafts))
    return planes


def choose_view(points):
    """Limits of both axes around a path, and whether these are alike enough for one scale."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, spans = 0.5 * (low + high), high - low
    size = numpy.abs(points).max() or 1.0
    if spans.max() <= NEAR * size:  # it stands
        spans = numpy.full(2, size)
    alike = spans.max() <= SPREAD * spans.min() or spans.min() <= NEAR * spans.max()
    half = 0.75 * (numpy.full(2, spans.max()) if alike else spans)
    return list(zip(middle - half, middle + half)), alike


def draw_plane(axis, plane, motion, view, colours):
    """Curves at the instants, the path, and the points of the instants on it."""
    limits, alike = view
    size = numpy.hypot(*(high - low for low, high in limits))
    axes = [numpy.linspace(*limit, GRID) for limit in limits]
    curves = []
    for row in motion.rows:
        motion.go_to(row)
        plane.check(motion.acceleration[row], motion.time[row], size)
        curves.append(plane.values(motion.acceleration[row], axes))
    scale = max(numpy.nanmax(numpy.abs(values)) for values in curves)
    is_fixed = all(numpy.allclose(values, curves[0], rtol=0.0, atol=1e-9 * scale) for values in curves)
    for row, values in list(zip(motion.rows, curves))[:1 if is_fixed else None]:
        colour = "0.45" if is_fixed else colours.to_rgba(motion.time[row])
        axis.contour(*axes, values, levels=[0.0], colors=[colour], linewidths=1.2)
    points = motion.acceleration[:, plane.shafts]
    path = LineCollection(numpy.stack([points[:-1], points[1:]], axis=1), colors=colours.to_rgba(motion.time[1:]),
                          linewidths=3.5, capstyle="round", zorder=3)
    axis.add_collection(path)
    axis.scatter(*points[motion.rows].T, s=55, color=colours.to_rgba(motion.time[motion.rows]), edgecolor="black",
                 linewidth=1.0, zorder=4)
    axis.set_title(f"{plane.name}: {LETTERS[plane.order]} = 0" + (", the same at all times" if is_fixed else ""),
                   fontsize=11)
    names = [motion.simulation.shafts[i] for i in plane.shafts]
    axis.set(xlim=limits[0], ylim=limits[1], xlabel=f"Acceleration of {names[0]}, rad/s²",
             ylabel=f"Acceleration of {names[1]}, rad/s²", aspect="equal" if alike else "auto")
    axis.grid(True, color="0.92")
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def plot_acceleration_plane(result, scene, instants=None, shafts=None, title="", path=None, limits=None):
    """Draws each constraint as the curve that it is in the plane of two accelerations, and the motion on it.

    The other shafts' accelerations, and all that the constraint reads beside, are those of the instant. A
    constraint of order 2 is the curve psi = 0, one of order 1 the line f' = 0; those of order 3 leave
    accelerations open and are not drawn.

    Args:
        result: a run, with the column group `inputs` where the scene has commanded ones.
        scene: that it is a run of: path, text or dict, as of `Simulation`, or a `Simulation`.
        instants: s, at which curves and points are drawn; default: six of them, evenly.
        shafts: names of two; default: those that the constraint reads most.
        path: write the picture there too.
        limits: ((low, high), (low, high)) of the axes, rad/s^2; default: around the motion.

    Returns:
        The figure, and its axes, one for each constraint.
    """
    simulation = scene if isinstance(scene, Simulation) else Simulation(scene)
    if not simulation.constraints:
        raise ValueError("this scene has no constraint")
    if min(simulation.orders) == 3:
        raise ValueError(f"constraint '{simulation.constraints[0]}' is of order 3: it binds jerks and leaves all "
                         "accelerations open")
    motion = Motion(result, simulation, instants)
    planes = choose_planes(simulation, motion, shafts)
    colours = plt.cm.ScalarMappable(Normalize(motion.time[0], motion.time[-1]), TIMES)
    figure, axes = plt.subplots(1, len(planes), squeeze=False, figsize=(1.5 + 6.0 * len(planes), 6.0),
                                layout="constrained")
    figure.suptitle(title, fontsize=14, x=0.02, ha="left")
    for axis, plane in zip(axes[0], planes):
        view = choose_view(motion.acceleration[:, plane.shafts]) if limits is None else (limits, True)
        draw_plane(axis, plane, motion, view, colours)
    figure.colorbar(colours, ax=list(axes[0]), label="Simulated time, s", pad=0.02)
    save(figure, path)
    return figure, axes[0]
