#!/usr/bin/python3
"""Writes the rows of kernel_benchmark as tables into doc/benchmarks.md.

Between the markers `<!-- begin generated: NAME -->` and `<!-- end generated -->`, NAME being kernels,
scaling or skips.
"""

import argparse
import collections
import csv
import pathlib
import sys

END = "<!-- end generated -->"
SHIP = (("formulas", "by hand", "4"), ("formulas, shafts known", "by hand", ""))
SAMPLES = 100  # per second, of the rows of dense output
FORMS = ("SlipRatio", "formulas")

Row = collections.namedtuple("Row", "table scene variant median minimum steps difference")


def read_lines(path):
    try:
        return pathlib.Path(path).read_text().splitlines()
    except FileNotFoundError:
        sys.exit(f"'{path}' is not there: scripts/benchmark makes it, in output/benchmark/")


def read_rows(path):
    """The head (comments) and the rows."""
    lines = read_lines(path)
    head = [line[1:].strip() for line in lines if line.startswith("#")]
    rows = [Row(row["table"], row["scene"], row["variant"], float(row["median"]),
                float(row["minimum"]), row["steps"], row["difference"])
            for row in csv.DictReader(line for line in lines if not line.startswith("#"))]
    return head, rows


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def show(value):
    """Three digits, no exponent."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{value:.{1 if value >= 10 else 2}f}" if value >= 1 else f"{value:.3g}"


def show_ratios(row, base):
    """Returns the ratios of the medians and of the least times."""
    return [show(row.median / base.median), show(row.minimum / base.minimum)]


def kernels_section(head, rows):
    times = {row.variant: row for row in rows if row.table == "ship"}
    ratios = [[f"{variant} / {base}", *show_ratios(times[variant], times[base]), goal]
              for variant, base, goal in SHIP]
    return ("Measured on:\n\n" + "\n".join(f"- {line}" for line in head) + "\n\n" +
            table(["form", "median, ns", "least, ns"],
                  [[row.variant, show(row.median), show(row.minimum)] for row in times.values()]) +
            "\n" + table(["ratio", "of medians", "of least", "goal: at most"], ratios))


def scaling_section(rows):
    times = {(row.scene, row.variant): row for row in rows if row.table == "scaling"}
    parts = []
    for form in FORMS:
        cells = []
        for shafts in range(2, 9):
            row = [times.get((f"{shafts} {k}", form)) for k in range(1, 5)]
            cells.append([f"s = {shafts}", *(show(entry.median) if entry else "" for entry in row)])
        parts.append(f"**{form}**, ns\n\n" + table(["", *(f"k = {k}" for k in range(1, 5))], cells))
    ratios = []
    for form in FORMS:
        ratios.append([form, "(2,1)", *show_ratios(times["8 4", form], times["2 1", form]), "8"])
    ratios.append(["formulas", "(2,1), shafts known",
                   *show_ratios(times["8 4", "formulas"], times["2 1", "formulas, shafts known"]),
                   ""])
    parts.append("**(8,4) over (2,1)**\n\n" +
                 table(["form", "over", "of medians", "of least", "goal: at most"], ratios))
    return "\n".join(parts)


def skips_section(rows):
    pairs = {}
    for row in rows:
        if row.table not in ("ship", "scaling"):
            pairs.setdefault((row.table, row.scene), []).append(row)
    cells = []
    for (skip, scene), (without, saved) in pairs.items():
        steps = without.steps if without.steps == saved.steps else f"{without.steps}, {saved.steps}"
        cells.append([skip, scene, show(without.median), show(saved.median),
                      *show_ratios(saved, without), steps or "-", saved.difference])
    samples = [[scene, show((without.median - saved.median) / SAMPLES),
                show((without.minimum - saved.minimum) / SAMPLES)]
               for (skip, scene), (without, saved) in pairs.items() if skip == "dense output"]
    return (table(["skip", "scene", "without, µs/s", "with, µs/s", "with / without, medians",
                   "least", "steps", "difference"], cells) +
            "\nWhat one sample costs:\n\n" +
            table(["scene, stepper", "median, µs", "least, µs"], samples))


def write_section(path, name, section):
    text = path.read_text()
    marker = f"<!-- begin generated: {name} -->"
    begin = text.index(marker) + len(marker)
    end = text.index(END, begin)
    path.write_text(text[:begin] + "\n\n" + section + "\n" + text[end:])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", help="CSV file of kernel_benchmark")
    parser.add_argument("--document", default="doc/benchmarks.md")
    arguments = parser.parse_args()

    head, rows = read_rows(arguments.rows)
    document = pathlib.Path(arguments.document)
    write_section(document, "kernels", kernels_section(head, rows))
    write_section(document, "scaling", scaling_section(rows))
    write_section(document, "skips", skips_section(rows))


if __name__ == "__main__":
    main()
