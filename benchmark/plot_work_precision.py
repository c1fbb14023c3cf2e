#!/usr/bin/python3
"""Draws work-precision diagrams and writes their tables into doc/benchmarks.md.

Reads the rows of work_precision. One picture per scene (the stiff ones share two, of plot_families.py),
tables between the markers `<!-- begin generated: work precision -->` and `<!-- end generated -->`.
"""

import argparse
import collections
import csv
import math
import pathlib

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402: after the choice of the backend
from matplotlib.lines import Line2D  # noqa: E402
from PIL import Image  # noqa: E402: matplotlib needs it too

import kernel_tables  # noqa: E402: beside this file, as the next
import plot_families  # noqa: E402

BEGIN = "<!-- begin generated: work precision -->"
END = "<!-- end generated -->"
FORMAT = "png"  # of the pictures, or "svg"
TARGETS = (1e-4, 1e-6, 1e-7, 1e-9, 1e-12)
TITLES = {
    "ship": "ship: nonlinear constraint, ratio sways in time, 20 s",
    "smooth_linear": "smooth_linear: everything linear, sinusoidal torque, 20 s",
    "acceleration_circle": "acceleration_circle: ε₁² + ε₂² = a², 5 s",
    "torque_steps": "torque_steps: the torque jumps every 0.5 s, 10 s",
    "four_shafts": "four_shafts: two variators and an elastic shaft, 10 s",
    "crank": "crank: inertia depends on the angle, elastic coupling, 2 s",
    "order1": "order1: kinematic ratio sways in time, 20 s",
    "order3": "order3: constraint between the jerks, 20 s",
    "stiff_start": "stiff_start: slip at the start decays within 5e-4 s, 3 s",
}
FAMILIES = ("SUNDIALS", "Odeint", "GSL")
OUR_COLOURS = {"auto": "#0b4f9e", "dopri5": "#d1495b", "fehlberg78": "#e0901f",
               "radau": "#6a1b4d"}
PEER_COLOURS = {"SUNDIALS": "#8395ad", "Odeint": "#b3956a", "GSL": "#86a383"}
MARKERS = "osD^v<>pPX*h"


class Point(collections.namedtuple("Point", "error milliseconds tolerance status")):
    """One run."""

    @property
    def good(self):
        return self.status == "ok" and self.error > 0


def family_of(method):
    first = method.split()[0]
    return {"ours": "ours", "sundials": "SUNDIALS", "odeint": "Odeint", "gsl": "GSL"}[first]


def short_name(method):
    return method.split(" ", 1)[1]


def read_rows(paths):
    """The heads (comments) and {scene: {(method, form): [Point]}}, in the order of the files."""
    heads = []
    scenes = {}
    for path in paths:
        lines = kernel_tables.read_lines(path)
        heads += [line[1:].strip() for line in lines if line.startswith("#")]
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            curves = scenes.setdefault(row["scene"], {})
            curves.setdefault((row["method"], row["form"]), []).append(
                Point(float(row["error"]), float(row["milliseconds"]), float(row["tolerance"]),
                      row["status"]))
    return heads, scenes


def front(points):
    """The runs that no other run beats in both error and time, from large to small errors."""
    best = []
    for point in sorted((p for p in points if p.good), key=lambda p: p.milliseconds):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def time_at(points, target):
    """Milliseconds to an error of at most `target`, or None. Between two runs of the front a
    straight line in both logarithms; beyond its ends nothing is extrapolated."""
    previous = None
    for point in front(points):
        if point.error <= target:
            if previous is None:
                return point.milliseconds
            part = (math.log(previous.error / target) / math.log(previous.error / point.error))
            return math.exp((1 - part) * math.log(previous.milliseconds) +
                            part * math.log(point.milliseconds))
        previous = point
    return None


def best_of(curves, wanted, target):
    """(milliseconds, (method, form)) of the fastest curve that `wanted` accepts, or None."""
    times = [(time_at(points, target), key) for key, points in curves.items() if wanted(*key)]
    times = [entry for entry in times if entry[0] is not None]
    return min(times) if times else None


def ours_forms(curves):
    """Machine code where it was measured, else formulas."""
    return "machine code" if any(form == "machine code" for _, form in curves) else "formulas"


# --- Pictures

def shown_curves(curves):
    """Returns the curves, peers first so that ours lie on top: (label, points, style)."""
    drawn = []
    index = collections.Counter()
    for (method, form), points in sorted(curves.items(), key=lambda item: item[0]):
        family = family_of(method)
        if family == "ours":
            continue
        marker = MARKERS[index[family] % len(MARKERS)]
        index[family] += 1
        drawn.append((method.replace("sundials", "SUNDIALS").replace("odeint", "Odeint")
                      .replace("gsl", "GSL"), points,
                      {"color": PEER_COLOURS[family], "marker": marker, "markersize": 4,
                       "linewidth": 0.9, "zorder": 2}))
    form_of_fixed = ours_forms(curves)
    for stepper, colour in reversed(list(OUR_COLOURS.items())):
        for form in ("formulas", "machine code"):
            points = curves.get((f"ours {stepper}", form))
            if points is None or (stepper != "auto" and form != form_of_fixed):
                continue
            thick = stepper == "auto"
            drawn.append((f"ours {stepper}, {form}", points,
                          {"color": colour, "marker": "o", "markersize": 5 if thick else 4,
                           "linewidth": 2.6 if thick else 1.7,
                           "linestyle": "--" if form == "formulas" and form != form_of_fixed
                                        else "-", "zorder": 4 if thick else 3}))
    return drawn


def draw_panel(axes, curves):
    for _, points, style in shown_curves(curves):
        good = sorted((p for p in points if p.good), key=lambda p: -p.tolerance)
        axes.plot([max(p.error, 1e-16) for p in good], [p.milliseconds for p in good], **style)
        failed = [p for p in points if not p.good]
        # In axes' height: failures have no time worth drawing.
        axes.plot([p.tolerance for p in failed], [0.975] * len(failed), linestyle="none",
                  marker="x", markersize=5, color=style["color"], clip_on=False,
                  transform=axes.get_xaxis_transform(), zorder=style["zorder"])
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1e-1, 1e-15)
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def legend_handles(panels):
    """One entry per curve that occurs in any panel, ours first."""
    entries = {}
    for curves in panels:
        for label, _, style in shown_curves(curves):
            entries.setdefault(label, style)
    ours = [label for label in entries if label.startswith("ours")]
    order = [f"ours {s}" for s in OUR_COLOURS]
    ours.sort(key=lambda label: (order.index(label.split(",")[0]), label))
    peers = [label for label in entries if not label.startswith("ours")]
    peers.sort(key=lambda label: (FAMILIES.index(label.split()[0]), label))
    handles = []
    for label in ours + peers:
        style = {key: value for key, value in entries[label].items() if key != "zorder"}
        handles.append(Line2D([], [], label=label, **style))
    handles.append(Line2D([], [], linestyle="none", marker="x", color="#777777",
                          label="failed, at the tolerance asked"))
    return handles


def save(figure, path):
    figure.savefig(path, bbox_inches="tight", dpi=110,
                   metadata={"Date": None} if path.suffix == ".svg" else {"Software": None})
    if path.suffix == ".png":
        # A palette: a third of the size.
        picture = Image.open(path).convert("RGB")
        picture.quantize(256, method=Image.Quantize.MAXCOVERAGE).save(path, optimize=True)
    pyplot.close(figure)


def draw_scene(name, curves, folder):
    figure, axes = pyplot.subplots(figsize=(6.4, 4.6))
    draw_panel(axes, curves)
    axes.set_title(TITLES.get(name, name), fontsize=10, loc="left")
    axes.set_xlabel("error at the end (smaller to the right)")
    axes.set_ylabel("run time, ms")
    figure.legend(handles=legend_handles([curves]), loc="center left", bbox_to_anchor=(0.93, 0.5),
                  fontsize=8, frameon=False)
    save(figure, folder / f"{name}.{FORMAT}")


# --- Tables

def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def show_time(entry):
    return "-" if entry is None else f"{entry:.3g}"


def show_exponent(number):
    return f"1e-{round(-math.log10(number))}"


def target_table(scenes, target):
    """One row per scene; times in ms."""
    rows = []
    for name, curves in scenes.items():
        ours = best_of(curves, lambda m, f: family_of(m) == "ours", target)
        cells = [name]
        if ours is None:
            cells.append("-")
        else:
            cells.append(f"**{ours[0]:.3g}** {short_name(ours[1][0])}")
        for form in ("machine code", "formulas"):
            points = curves.get(("ours auto", form))
            cells.append(show_time(time_at(points, target)) if points else "-")
        peers = []
        for family in FAMILIES:
            best = best_of(curves, lambda m, f, family=family: family_of(m) == family, target)
            if best is None:
                cells.append("-")
            else:
                peers.append(best[0])
                cells.append(f"{best[0]:.3g} {short_name(best[1][0])}")
        if ours is None:
            cells.append("-")
        elif not peers:
            cells.append("only ours")
        else:
            cells.append(f"{min(peers) / ours[0]:.2g}")
        rows.append(cells)
    return table(["scene", "ours, best", "auto, machine code", "auto, formulas", "SUNDIALS", "Odeint",
                  "GSL", "best peer / ours"], rows)


def summary_table(scenes):
    """Geometric means over the scenes that both reach."""
    rows = []
    for target in TARGETS:
        ours_of = {name: best_of(curves, lambda m, f: family_of(m) == "ours", target)
                   for name, curves in scenes.items()}
        peer_of = {name: best_of(curves, lambda m, f: family_of(m) != "ours", target)
                   for name, curves in scenes.items()}
        reached = [name for name in scenes if ours_of[name] or peer_of[name]]
        wins = [name for name in reached
                if ours_of[name] and (not peer_of[name] or ours_of[name] <= peer_of[name])]
        cells = [show_exponent(target), f"{sum(map(bool, ours_of.values()))} of {len(scenes)}",
                 f"{len(wins)} of {len(reached)}"]
        for family in ("any", *FAMILIES):
            ratios = []
            for name, curves in scenes.items():
                peer = best_of(curves, lambda m, f, family=family: family_of(m) != "ours" and
                               family in ("any", family_of(m)), target)
                if ours_of[name] and peer:
                    ratios.append(peer[0] / ours_of[name][0])
            if ratios:
                mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
                cells.append(f"{mean:.2g} ({min(ratios):.2g} to {max(ratios):.2g})")
            else:
                cells.append("-")
        rows.append(cells)
    return table(["error", "ours reaches it in", "ours is fastest in", "best peer / ours",
                  *(f"{family} / ours" for family in FAMILIES)], rows)


def delivered_table(scenes):
    """Largest error / tolerance over the scenes, and whether less was asked for more."""
    tolerances = sorted({p.tolerance for curves in scenes.values() for points in curves.values()
                         for p in points}, reverse=True)
    tolerances = [t for t in tolerances if t > 0.5e-13]
    rows = []
    for stepper, given in [("auto", "machine code"), *((stepper, None) for stepper in OUR_COLOURS)]:
        for stiff in (False, True):
            cells = [f"{stepper}, {given}" if given else stepper,
                     "stiff_*" if stiff else "the others"]
            curves_of = {name: curves.get((f"ours {stepper}", given or ours_forms(curves)))
                         for name, curves in scenes.items() if name.startswith("stiff") == stiff}
            curves_of = {name: points for name, points in curves_of.items() if points}
            if not curves_of:
                continue
            for tolerance in tolerances:
                ratios = [p.error / tolerance for points in curves_of.values() for p in points
                          if p.good and p.tolerance == tolerance]
                cells.append(f"{max(ratios):.2g}" if ratios else "-")
            monotone = 0
            for points in curves_of.values():
                # Errors at the floor of double precision count as monotone.
                errors = [p.error for p in sorted(points, key=lambda p: -p.tolerance) if p.good]
                monotone += all(b < a or b < 1e-12 for a, b in zip(errors, errors[1:]))
            cells.append(f"{monotone} of {len(curves_of)}")
            rows.append(cells)
    return table(["stepper", "scenes", *map(show_exponent, tolerances), "monotone"], rows)


def auto_table(scenes):
    rows = []
    for name, curves in scenes.items():
        form = ours_forms(curves)
        cells = [name]
        for target in TARGETS:
            fixed = best_of(curves, lambda m, f: family_of(m) == "ours" and m != "ours auto" and
                            f == form, target)
            points = curves.get(("ours auto", form))
            auto = time_at(points, target) if points else None
            if fixed is None:
                cells.append("-" if auto is None else "only auto")
            elif auto is None:
                cells.append(f"not reached ({short_name(fixed[1][0])})")
            else:
                cells.append(f"{auto / fixed[0]:.2f} ({short_name(fixed[1][0])})")
        rows.append(cells)
    return table(["scene", *map(show_exponent, TARGETS)], rows)


def failure_table(scenes):
    failed = {}
    total = collections.Counter()
    for name, curves in scenes.items():
        for key, points in curves.items():
            total[key] += len(points)
            for point in points:
                if not point.good:
                    reasons = failed.setdefault(key, collections.OrderedDict())
                    reasons.setdefault(point.status.split(":")[0], collections.Counter())[name] += 1
    rows = []
    for (method, form), reasons in sorted(failed.items()):
        count = sum(sum(names.values()) for names in reasons.values())
        text = "; ".join(
            f"{reason}: " + ", ".join(f"{name.replace('stiff_slip_', 'τ = ')} ({number})"
                                      for name, number in names.items())
            for reason, names in reasons.items())
        rows.append([f"{method}, {form}", f"{count} of {total[(method, form)]}", text])
    return table(["method", "runs", "why, in which scenes (at how many tolerances)"], rows)


def make_section(heads, scenes, pictures):
    parts = ["Measured on:\n\n" + "\n".join(f"- {line}" for line in heads) + "\n"]
    parts.append("### Summary\n\nRun time of the best method of a family / run time of our best "
                 "one, at equal error: above 1 the peer takes longer. Geometric mean over the "
                 "scenes that both reach, least and largest in brackets.\n")
    for title, stiff in (("Scenes that are not stiff", False), ("Stiff scenes", True)):
        chosen = {name: curves for name, curves in scenes.items()
                  if name.startswith("stiff") == stiff}
        if chosen:
            parts.append(f"**{title}**\n\n" + summary_table(chosen))
    parts.append("### Pictures\n\n" +
                 "\n".join(f"![{caption}](pictures/benchmarks/{file})\n"
                           for file, caption in pictures))
    parts.append("### Run time, ms, at equal error\n\nInterpolated between the two runs that "
                 "bracket the error; `-`: never reached.\n")
    for target in TARGETS:
        parts.append(f"**Error {show_exponent(target)}**\n\n" + target_table(scenes, target))
    parts.append("### Error delivered / tolerance asked, ours\n\nThe largest over the scenes, at "
                 "the end of the run; machine code where it was measured. `monotone`: scenes "
                 "in which every smaller tolerance gave a smaller error, down to 1e-12.\n\n" +
                 delivered_table(scenes))
    parts.append("### Run time of `auto` / the best fixed stepper of ours\n\nAt equal error, same "
                 "form; the best fixed stepper in brackets.\n\n" + auto_table(scenes))
    parts.append("### Failures\n\nRuns without a result. `not run`: the method was too slow at a "
                 "larger tolerance or a larger τ.\n\n" + failure_table(scenes))
    return "\n".join(parts)


def write_section(path, section):
    text = path.read_text()
    begin = text.index(BEGIN) + len(BEGIN)
    end = text.index(END, begin)
    path.write_text(text[:begin] + "\n\n" + section + "\n" + text[end:])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="+", help="CSV files of work_precision")
    parser.add_argument("--document", default="doc/benchmarks.md")
    parser.add_argument("--pictures", default="doc/pictures/benchmarks", help="folder")
    arguments = parser.parse_args()

    pyplot.rcParams.update({"svg.hashsalt": "variator_sim", "font.size": 9,
                            "axes.edgecolor": "#555555"})
    heads, scenes = read_rows(arguments.rows)
    folder = pathlib.Path(arguments.pictures)
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    stiff = sum(name.startswith("stiff_slip") for name in scenes) > 1
    for name, curves in scenes.items():
        if name.startswith("stiff_slip") and stiff:
            continue
        draw_scene(name, curves, folder)
        pictures.append((f"{name}.{FORMAT}", f"Run time against error, {TITLES.get(name, name)}"))
    if pictures:
        pictures.insert(0, ("families.png", "Run time of the best method of each family against error, scene by scene"))
    if stiff:
        pictures.append(("stiff_slip.png", "Run time of the best method of each family against error, stiff scenes"))
        pictures.append(("stiff_tau.png", "Run time of the best method of each family to an error of 1e-6 against tau"))
    write_section(pathlib.Path(arguments.document),
                  make_section(heads, scenes, pictures))
    plot_families.draw(arguments.document, folder)


if __name__ == "__main__":
    main()
