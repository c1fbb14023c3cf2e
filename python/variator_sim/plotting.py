"""Pictures of runs, the same from Python and from the command line (needs matplotlib)."""

import fnmatch
import os

import matplotlib.pyplot as plt
import numpy
from matplotlib.ticker import MaxNLocator

from variator_sim.checks import did_you_mean
from variator_sim.files import writing
from variator_sim.recordings import difference

# Wong's palette: told apart by colour-blind readers too.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442"]
# Panel of a column by the last part of its name.
LABELS = {"angle": "Angle, rad", "velocity": "Speed, rad/s", "acceleration": "Acceleration, rad/s²",
          "applied_torque": "Applied torque, N m", "reaction_torque": "Reaction torque, N m",
          "reaction_torque_rate": "Reaction torque rate, N m/s",
          "reaction_torque_covariant_rate": "Covariant rate of the reaction, N m/s",
          "Z": "Z, N m/s⁴", "constraint_measure": "Constraint measure, N m/s²", "residual": "Residual",
          "multiplier": "Multiplier", "torque": "Torque, N m", "power": "Power, W"}
# Modes of elements that hold: number, name, colour of the band, colour of its text.
MODES = ((0, "stuck", "#0072B2", "white"), (1, "forward", "#E69F00", "black"), (-1, "backward", "#CC79A7", "black"),
         (2, "free", "0.88", "black"))
# More lines than these are told apart by a scale of colours, with some of their names.
MANY = 12
MOST = 1e150  # beyond, Matplotlib's own sums of squares overflow
DEFAULT = ("velocity", "acceleration", "applied_torque", "reaction_torque_rate")


def style_of(i, count):
    """Colour and style of line i of so many."""
    if count > MANY:
        return {"color": plt.get_cmap("viridis")(i / (count - 1)), "linewidth": 1.0}
    return {"color": COLOURS[i % len(COLOURS)], "linewidth": 1.6, "linestyle": ("-", "--")[i // len(COLOURS)]}


def check_picture(path):
    """`path`, where its ending is one of a format that can be written."""
    formats = plt.Figure().canvas.get_supported_filetypes()
    ending = os.path.splitext(os.fspath(path))[1]
    if ending[1:].lower() not in formats:
        raise ValueError(f"'{os.fspath(path)}' does not end in the name of a format{did_you_mean(ending[1:], formats)}; "
                         f"allowed: .png, .pdf, .svg, and .{', .'.join(sorted(set(formats) - {'png', 'pdf', 'svg'}))}")
    return path


def save(figure, path):
    """Writes the picture; None: nothing."""
    if path is not None:
        with writing(check_picture(path)):
            figure.savefig(path, dpi=110)


def check_size(name, times, values):
    """Raises ValueError where values are too large to draw."""
    far = numpy.abs(values) > MOST
    if numpy.any(far & numpy.isfinite(values)):
        place = int(numpy.argmax(far))
        raise ValueError(f"{name}: {values[place]:g} at {times[place]:g} s is too large to draw; allowed: up to {MOST:g}")


def marker_of(values):
    """A line of one point would not be seen."""
    return "o" if numpy.count_nonzero(numpy.isfinite(values)) == 1 else None


def draw_lines(axis, lines, label):
    """Lines (name, times, values) over simulated time in one panel; a point where there is one value only."""
    for i, (name, times, values) in enumerate(lines):
        values = numpy.asarray(values, dtype=float)
        check_size(f"{name} ({' '.join(label.split())})", times, values)
        axis.plot(times, values, label=name, marker=marker_of(values), **style_of(i, len(lines)))
    axis.set_ylabel(label)
    axis.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    axis.grid(True, color="0.9")
    axis.margins(x=0)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    axis.xaxis.set_major_locator(MaxNLocator(nbins=11, steps=[1, 2, 5, 10]))


def make_panels(rows, columns, title, heights=None):
    heights = heights or [1.0] * rows
    figure, axes = plt.subplots(rows, columns, sharex=True, squeeze=False, height_ratios=heights,
                                figsize=(10 if columns == 1 else 13, 2.0 + 2.25 * sum(heights)),
                                layout="constrained")
    figure.suptitle(title, fontsize=14, x=0.02, ha="left")
    for axis in axes[-1]:
        axis.set_xlabel("Simulated time, s")
    return figure, axes


def draw_modes(axis, modes):
    """A band for each element (name, times, modes), as wide as its modes last and labelled with them."""
    span = modes[0][1][-1] - modes[0][1][0]
    for row, (_, times, values) in enumerate(modes):
        begins = numpy.flatnonzero(numpy.diff(values, prepend=numpy.nan))
        for begin, end in zip(begins, [*begins[1:], len(values) - 1]):
            for mode, word, colour, text_colour in MODES:
                if values[begin] != mode:
                    continue
                width = times[end] - times[begin]
                axis.broken_barh([(times[begin], width)], (row - 0.4, 0.8), facecolor=colour, edgecolor="none")
                if width > 0.011 * len(word) * span:
                    axis.text(times[begin] + 0.5 * width, row, word, ha="center", va="center", fontsize=8,
                              color=text_colour)
    seen = numpy.unique(numpy.concatenate([values for _, _, values in modes]))
    handles = [(plt.Rectangle((0, 0), 1, 1, color=colour), word) for mode, word, colour, _ in MODES if mode in seen]
    axis.legend(*zip(*handles), loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncol=4, fontsize=8,
                borderaxespad=0.1)
    axis.set_ylim(len(modes) - 0.5, -0.5)
    axis.set_yticks(range(len(modes)), [name for name, _, _ in modes])
    axis.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axis.spines[side].set_visible(False)


def draw_panels(panels, title="", modes=()):
    """Panels over simulated time, one below the other; returns figure and axes, those of lines.

    Args:
        panels: tuples (label of the axis, lines), each line (name, times, values).
        modes: of elements that hold, tuples (name, times, modes): bands under the speeds.
    """
    heights = [1.0] * len(panels)
    speeds = [label for label, _ in panels].index(LABELS["velocity"]) if modes else None
    if modes:
        heights.insert(speeds + 1, 0.12 + 0.1 * len(modes))
    figure, axes = make_panels(len(heights), 1, title, heights)
    axes = list(axes[:, 0])
    if modes:
        draw_modes(axes.pop(speeds + 1), modes)
    for axis, (label, lines) in zip(axes, panels):
        draw_lines(axis, lines, label)
    figure.align_ylabels(axes)
    return figure, axes


def put_legend_above(axis):
    """The names of a panel's lines in one row above it; of many lines those of eight."""
    handles, names = axis.get_legend_handles_labels()
    if len(names) > MANY:
        shown = numpy.linspace(0, len(names) - 1, 8).round().astype(int)
        handles, names = [handles[n] for n in shown], [names[n] for n in shown]
    axis.legend(handles, names, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncol=len(names) + 1)


def choose_columns(runs, patterns=None):
    """Columns that all of `runs` have and `patterns` name; KeyError where one names nothing.

    Args:
        patterns: names, "load/velocity", or patterns, "load/*"; default: speeds, accelerations,
            applied torques and reaction torque rates of all shafts.
    """
    first = runs[0]
    common = [name for name in first if name != "time" and all(name in run for run in runs)]
    if patterns is None:
        chosen = [name for name in common if name.rsplit("/", 1)[-1] in DEFAULT]
        if not chosen:
            raise ValueError("no speeds, accelerations or torques to draw; "
                             + (f"name some of the columns (--columns): {', '.join(common)}" if common else
                                "no columns but the time are in common" if len(runs) > 1 else "the run has no column but time"))
        return chosen
    chosen = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        found = fnmatch.filter(common, pattern)
        for run in runs if not found else []:
            run[pattern]  # says what is near
        if not found:
            raise KeyError(f"'{pattern}' is no column of these runs; they have in common: "
                           + ", ".join(common))
        chosen += [name for name in found if name not in chosen]
    return chosen


def label_of(column):
    """Label of the axis that a column is drawn over, and the name of its line there."""
    owner, _, quantity = column.rpartition("/")
    if owner in ("inputs", "outputs", "states", "variables", "energy"):
        return {"energy": "Energy, J"}.get(owner, owner.capitalize()), quantity
    return LABELS.get(quantity, quantity), owner


def compare(runs, columns=None, title="", path=None, differences=True):
    """Draws columns of several runs over each other, one panel for each column.

    Args:
        runs: `Result`s by name, {"rk4": ..., "auto": ...}; the first one is the reference.
        columns: as of `choose_columns`.
        path: write the picture there too.
        differences: beside each panel what the others differ by from the first.

    Returns:
        The figure, and its axes: rows of one or two.
    """
    names = list(runs)
    columns = choose_columns(list(runs.values()), columns)
    figure, axes = make_panels(len(columns), 2 if differences else 1, title)
    for row, column in zip(axes, columns):
        unit = runs[names[0]].units.get(column)
        label = f"{column}\n{label_of(column)[0]}" + (f", {unit}" if unit else "")
        draw_lines(row[0], [(name, run["time"], run[column]) for name, run in runs.items()], label)
        if differences:
            # The first one's own line, empty, keeps the colours the same on both sides.
            lines = [(names[0], [], [])]
            lines += [(name, *difference(runs[name], runs[names[0]], column)) for name in names[1:]]
            draw_lines(row[1], lines, f"less {names[0]}")
    put_legend_above(axes[0][0])
    for side in axes.T:
        figure.align_ylabels(side)
    save(figure, path)
    return figure, axes


def stack(axis, times, parts, sign):
    """Bands of one sign, each on the one before; returns the names of those that can be seen."""
    base = numpy.zeros(len(times))
    for name, values in parts:
        check_size(name, times, values)
    least = 1e-6 * max(numpy.max(numpy.abs(values)) for _, values in parts)
    names = []
    for i, (name, values) in enumerate(parts):
        band = sign * numpy.maximum(sign * values, 0.0)
        if numpy.max(numpy.abs(band)) > least:
            axis.fill_between(times, base, base + band, color=COLOURS[i % len(COLOURS)], linewidth=0.0, alpha=0.8,
                              hatch=("", "//", "..", "xx")[i // len(COLOURS) % 4])
            names.append(name)
        base = base + band
    return names


def plot_energy(result, title="", path=None):
    """Draws where the power comes from and where it goes, as bands over simulated time.

    What brings power lies above the axis, what takes it below, one band an element, the reactions last; the
    difference, a line, is what the kinetic energy gains.

    Args:
        result: a run with the columns `elements` and `energy`.
        path: write the picture there too.

    Returns:
        The figure, and its axis.
    """
    parts = [(name.rsplit("/", 1)[0], numpy.asarray(result[name])) for name in result
             if name.endswith("/power") and not name.startswith(("inputs/", "outputs/"))]
    if "power/reactions" not in result or not parts:
        raise ValueError("this run does not tell where its power goes; run it with the columns state,elements,energy")
    parts.append(("reactions", numpy.asarray(result["power/reactions"])))
    # A bag's last sample may lack a topic.
    whole = ~numpy.isnan(sum(values for _, values in parts))
    if not whole.any():
        raise ValueError("no sample of this run has all of its powers: were elements and energy recorded at the same "
                         "instants?")
    times = result["time"][whole]
    parts = [(name, values[whole]) for name, values in parts]
    figure, axes = make_panels(1, 1, title)
    figure.set_size_inches(10, 5)
    axis = axes[0, 0]
    drawn = {name for sign in (1.0, -1.0) for name in stack(axis, times, parts, sign)}
    draw_lines(axis, [], "Power, W")
    line, = axis.plot(times, sum(values for _, values in parts), color="black", linewidth=1.4, marker=marker_of(times))
    bands = [(plt.Rectangle((0, 0), 1, 1, color=COLOURS[i % len(COLOURS)], alpha=0.8), name)
             for i, (name, _) in enumerate(parts) if name in drawn]
    handles, names = zip(*bands, (line, "into kinetic energy"))
    axis.legend(handles, names, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncol=4)
    save(figure, path)
    return figure, axis


def modes_of(result):
    """The modes of the elements that hold, of a run with the columns `elements`."""
    return [(name.rpartition("/")[0], result["time"], numpy.asarray(result[name])) for name in result
            if name.endswith("/mode") and name.partition("/")[0] not in ("outputs", "states", "variables", "inputs")]


def plot(result, columns=None, title="", path=None):
    """Draws columns of a `Result`, one panel for each quantity; under the speeds the modes of elements that hold.

    Args:
        columns: as of `choose_columns`.
        path: write the picture there too.

    Returns:
        The figure, and its axes from above.
    """
    groups = {}
    for name in choose_columns([result], columns):
        label, line = label_of(name)
        if name in result.units:
            label += f", {result.units[name]}"
        groups.setdefault(label, []).append((line, result["time"], result[name]))
    modes = modes_of(result) if LABELS["velocity"] in groups and len(result.values) > 1 else ()
    figure, axes = draw_panels(list(groups.items()), title, modes)
    names = None
    for axis, lines in zip(axes, groups.values()):
        if [line[0] for line in lines] != names:  # a legend serves all panels below
            names = [line[0] for line in lines]
            put_legend_above(axis)
    save(figure, path)
    return figure, axes
