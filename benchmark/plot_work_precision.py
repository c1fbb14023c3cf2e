#!/usr/bin/python3
"""Writes the summary of the rows of work_precision into doc/evidence.md, all tables, and pictures.

The summary stands between the markers `<!-- begin generated: work precision -->` and
`<!-- end generated -->`. The folder of tables gets work_precision.csv, the run times at equal error,
from which plot_families.py draws the pictures, and failures.csv.
"""

import argparse
import collections
import csv
import math
import pathlib

import document  # beside this file, as the next
import plot_families
TARGETS = (1e-4, 1e-6, 1e-7, 1e-9, 1e-12)
FAMILIES = ("SUNDIALS", "Odeint", "GSL")
OUR_STEPPERS = ("auto", "dopri5", "fehlberg78", "radau")


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
        lines = document.read_lines(path)
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


# --- Tables

def show_time(entry):
    return "-" if entry is None else f"{entry:.3g}"


def show_exponent(number):
    return f"1e-{round(-math.log10(number))}"


TARGET_HEAD = ("error", "scene", "ours, best", "auto, machine code", "auto, formulas", "SUNDIALS", "Odeint", "GSL",
               "best peer / ours")


def target_rows(scenes, target):
    """One row per scene; times in ms, interpolated between the two runs that bracket the error."""
    rows = []
    for name, curves in scenes.items():
        ours = best_of(curves, lambda m, f: family_of(m) == "ours", target)
        cells = [show_exponent(target), name]
        if ours is None:
            cells.append("-")
        else:
            cells.append(f"{ours[0]:.3g} {short_name(ours[1][0])}")
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
    return rows


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
    return document.table(["error", "ours reaches it in", "ours is fastest in", "best peer / ours",
                  *(f"{family} / ours" for family in FAMILIES)], rows)


def delivered_table(scenes):
    """Largest error / tolerance over the scenes, and whether less was asked for more."""
    tolerances = sorted({p.tolerance for curves in scenes.values() for points in curves.values()
                         for p in points}, reverse=True)
    tolerances = [t for t in tolerances if t > 0.5e-13]
    rows = []
    for stepper, given in [("auto", "machine code"), *((stepper, None) for stepper in OUR_STEPPERS)]:
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
    return document.table(["stepper", "scenes", *map(show_exponent, tolerances), "monotone"], rows)


FAILURE_HEAD = ("method", "runs", "reason: scenes (number of tolerances)")


def failure_rows(scenes):
    """Runs without a result. `not run`: the method was too slow at a larger tolerance or a larger tau."""
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
    return rows


def make_section(heads, scenes):
    parts = ["Measured on: " + ", ".join(heads) + ".\n"]
    parts.append("Run time of the best method of a family / best run time of this package, at equal error: "
                 "above 1 the peer takes longer. Geometric mean over the scenes that both reach, least and "
                 "largest in brackets.\n")
    for title, stiff in (("Scenes that are not stiff", False), ("Stiff scenes", True)):
        chosen = {name: curves for name, curves in scenes.items()
                  if name.startswith("stiff") == stiff}
        if chosen:
            parts.append(f"**{title}**\n\n" + summary_table(chosen))
    parts.append("\n".join(f"![{caption}](pictures/benchmarks/{file})\n"
                           for file, caption in plot_families.pictures_of(scenes)))
    parts.append("**Error at the end / tolerance** of this package, the largest over the scenes. `monotone`: "
                 "scenes in which every smaller tolerance gave a smaller error, down to 1e-12.\n\n" + delivered_table(scenes))
    return "\n".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="+", help="CSV files of work_precision")
    parser.add_argument("--document", default="doc/evidence.md")
    parser.add_argument("--tables", default="doc/tables", help="folder")
    parser.add_argument("--pictures", default="doc/pictures/benchmarks", help="folder")
    arguments = parser.parse_args()

    heads, scenes = read_rows(arguments.rows)
    folder = pathlib.Path(arguments.pictures)
    folder.mkdir(parents=True, exist_ok=True)
    document.write_section(arguments.document, "work precision", make_section(heads, scenes))
    tables = pathlib.Path(arguments.tables)
    times = tables / "work_precision.csv"
    document.write_csv(times, TARGET_HEAD, [row for target in TARGETS for row in target_rows(scenes, target)])
    document.write_csv(tables / "failures.csv", FAILURE_HEAD, failure_rows(scenes))
    plot_families.draw(times, folder)


if __name__ == "__main__":
    main()
