"""Pictures of runs, the same from Python and from the command line (needs matplotlib)."""

import matplotlib.pyplot as plt
from matplotlib.ticker import MaxNLocator

# Wong's palette: told apart by colour-blind readers too.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442"]
# Panel of a column by the last part of its name.
LABELS = {"angle": "Angle, rad", "velocity": "Speed, rad/s", "acceleration": "Acceleration, rad/s²",
          "applied_torque": "Applied torque, N m", "reaction_torque": "Reaction torque, N m",
          "reaction_torque_rate": "Reaction torque rate, N m/s", "residual": "Residual",
          "multiplier": "Multiplier", "torque": "Torque, N m", "power": "Power, W"}
DEFAULT = ("velocity", "acceleration", "applied_torque", "reaction_torque_rate")


def draw_panels(panels, title=""):
    """Panels over simulated time, one below the other; returns figure and axes.

    Args:
        panels: tuples (label of the axis, lines), each line (name, times, values).
    """
    figure, axes = plt.subplots(len(panels), 1, sharex=True, squeeze=False,
                                figsize=(10, 2.0 + 2.25 * len(panels)), layout="constrained")
    axes = axes[:, 0]
    figure.suptitle(title, fontsize=14, x=0.02, ha="left")
    for axis, (label, lines) in zip(axes, panels):
        for i, (name, times, values) in enumerate(lines):
            axis.plot(times, values, color=COLOURS[i % len(COLOURS)], linewidth=1.6, label=name)
        axis.set_ylabel(label)
        axis.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
        axis.grid(True, color="0.9")
        axis.margins(x=0)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
        axis.xaxis.set_major_locator(MaxNLocator(nbins=11, steps=[1, 2, 5, 10]))
    axes[-1].set_xlabel("Simulated time, s")
    figure.align_ylabels(axes)
    return figure, axes


def put_legend_above(axis):
    """The names of a panel's lines in one row above it."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False,
                ncol=len(axis.get_lines()))


def plot(result, columns=None, title="", path=None):
    """Draws columns of a `Result`, one panel for each quantity.

    Args:
        columns: names, such as ["load/velocity", "energy/kinetic"]; default: speeds, accelerations,
            applied torques and reaction torque rates of all shafts.
        path: write the picture there too.

    Returns:
        The figure, and its axes from above.
    """
    if columns is None:
        columns = [name for name in result if name.rsplit("/", 1)[-1] in DEFAULT]
    if isinstance(columns, str):
        columns = [columns]
    groups = {}
    for name in columns:
        owner, _, quantity = name.rpartition("/")
        if owner in ("inputs", "outputs", "energy"):
            label, line = {"energy": "Energy, J"}.get(owner, owner.capitalize()), quantity
        else:
            label, line = LABELS.get(quantity, quantity), owner
        groups.setdefault(label, []).append((line, result["time"], result[name]))
    figure, axes = draw_panels(list(groups.items()), title)
    names = None
    for axis, lines in zip(axes, groups.values()):
        if [line[0] for line in lines] != names:  # a legend serves all panels below
            names = [line[0] for line in lines]
            put_legend_above(axis)
    if path is not None:
        figure.savefig(path, dpi=110)
    return figure, axes
