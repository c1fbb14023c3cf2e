#!/usr/bin/python3
"""Draws the families of methods of doc/evidence.md from the table of run times at equal error.

Three pictures: run time against error, a panel for each scene; the same for the stiff scene, a
panel for each time constant tau of the slip; and run time to one error against tau. A line is the
best method of a family; the tables name which one.
"""

import argparse
import csv
import pathlib
import re

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402: after the choice of the backend

# By their columns in the tables; ours last, so that it lies on top.
FAMILIES = {"GSL": ("#4f8a4b", "D"), "Odeint": ("#b07d2b", "s"),
            "SUNDIALS": ("#5b6f8f", "^"), "ours, best": ("#0b4f9e", "o")}
STIFF = "stiff_slip_"
NAMES = {"ours, best": "variator_sim"}
TAU_TARGET = 1e-6


def read_times(table):
    """{scene: {family: [(error, milliseconds)]}} of the table of run times at equal error."""
    times = {}
    with open(table, encoding="utf-8", newline="") as file:
        for cells in csv.DictReader(file):
            by_family = times.setdefault(cells["scene"], {})
            for family in FAMILIES:
                number = re.match(r"[0-9.e+-]*[0-9]", cells.get(family, "-"))
                if number:
                    by_family.setdefault(family, []).append((float(cells["error"]), float(number[0])))
    return times


def style(family):
    colour, marker = FAMILIES[family]
    ours = family == "ours, best"
    return {"color": colour, "marker": marker, "markersize": 6 if ours else 5, "linewidth": 2.6 if ours else 1.4,
            "label": NAMES.get(family, family)}


def dress(axes):
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.grid(True, color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def legend(figure, axes, **place):
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], frameon=False, fontsize=11, **place)


def save(figure, path):
    figure.savefig(path, dpi=100, bbox_inches="tight", metadata={"Software": None})
    pyplot.close(figure)


def draw_panels(times, columns, path):
    """Run time against error, one panel for each title."""
    rows = -(-len(times) // columns)
    figure, panels = pyplot.subplots(rows, columns, figsize=(9.2, 2.9 * rows), sharex=True, sharey=True,
                                     squeeze=False, layout="constrained")
    for axes, (title, by_family) in zip(panels.flat, times.items()):
        for family in FAMILIES:
            axes.plot(*zip(*by_family.get(family, [(float("nan"), float("nan"))])), **style(family))
        dress(axes)
        axes.set_title(title, fontsize=12, loc="left")
    panels[0][0].set_xlim(4e-4, 2.5e-13)
    panels[0][0].set_xticks([1e-4, 1e-6, 1e-9, 1e-12])
    panels[0][0].set_xticklabels(["1e-4", "1e-6", "1e-9", "1e-12"])
    for axes in panels.flat:
        axes.tick_params(labelsize=10)
    for axes in list(panels.flat)[len(times):]:
        axes.set_axis_off()
    figure.supxlabel("error at the end (smaller to the right)", fontsize=11)
    figure.supylabel("run time, ms", fontsize=11)
    legend(figure, panels[0][0], loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=len(FAMILIES))
    save(figure, path)


def draw_taus(times, path):
    """Run time to one error against tau."""
    figure, axes = pyplot.subplots(figsize=(7.4, 4.4), layout="constrained")
    for family in FAMILIES:
        points = [(tau, milliseconds) for tau, by_family in times.items()
                  for error, milliseconds in by_family.get(family, []) if error == TAU_TARGET]
        axes.plot(*zip(*points or [(float("nan"), float("nan"))]), **style(family))
    dress(axes)
    axes.set_xlim(2e-1, 5e-9)
    axes.tick_params(labelsize=11)
    axes.set_xlabel("τ, s (stiffer to the right)", fontsize=11)
    axes.set_ylabel(f"run time to an error of {TAU_TARGET:.0e}, ms".replace("e-0", "e-"), fontsize=11)
    legend(figure, axes, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, path)


def pictures_of(scenes):
    """File and caption of each picture; those of the stiff scene where there are several of its taus."""
    pictures = [("families.png", "Run time of the best method of each family against error, scene by scene")]
    if sum(name.startswith(STIFF) for name in scenes) > 1:
        pictures += [("stiff_slip.png", "Run time of the best method of each family against error, stiff scenes"),
                     ("stiff_tau.png", "Run time of the best method of each family to an error of 1e-6 against tau")]
    return pictures


def draw(table, folder):
    """Draws all pictures of the table of run times."""
    folder = pathlib.Path(folder)
    times = read_times(table)
    others = {scene: by_family for scene, by_family in times.items() if not scene.startswith(STIFF)}
    if others:
        draw_panels(others, 3, folder / "families.png")
    taus = {float(scene[len(STIFF):]): by_family for scene, by_family in times.items() if scene.startswith(STIFF)}
    if len(taus) > 1:
        taus = dict(sorted(taus.items(), reverse=True))
        titles = {f"τ = {tau:.0e} s".replace("e-0", "e-"): by_family for tau, by_family in taus.items()}
        draw_panels(titles, 4, folder / "stiff_slip.png")
        draw_taus(taus, folder / "stiff_tau.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", default="doc/tables/work_precision.csv")
    parser.add_argument("--pictures", default="doc/pictures/benchmarks", help="folder")
    arguments = parser.parse_args()
    draw(arguments.table, arguments.pictures)


if __name__ == "__main__":
    main()
