#!/usr/bin/python3
"""The application scenes, from the rows of `applications`: a summary into doc/evidence.md, all rows as CSV.

The summary stands between the markers `<!-- begin generated: applications -->` and `<!-- end generated -->`.
"""

import argparse
import math

import document  # beside this file, as the next
import plot_work_precision as work_precision

TARGETS = (1e-4, 1e-6, 1e-9)
SAMPLED = " sampled"  # behind the name of a scene of which 100 samples a second are taken
OURS = (("ours auto", "machine code"), ("ours auto", "formulas"), ("ours emitted", "C"))
PAGE_TARGET = 1e-6  # the error whose rows the page shows
HEADERS = ("best peer", "peer, ms", "ours", "interpreter", "emitted C", "peer / ours",
           "peer / emitted C")


def show_ratio(ratio):
    return f"{ratio:.2f}" if ratio else "-"


def make_tables(scenes):
    """The summary (the mean and the least ratio), and the rows of each error."""
    means, leasts = [[], [], []], [[], [], []]
    rows_of_target = {}
    for target in TARGETS:
        rows, ratios = [], []
        for name, curves in scenes.items():
            peer = work_precision.best_of(curves, lambda m, _: not m.startswith("ours"), target)
            own = [work_precision.time_at(curves.get(key, []), target) for key in OURS]
            ratio = [peer[0] / time if peer and time else None for time in own]
            ratios.append(ratio)
            rows.append([name, peer[1][0] if peer else "-",
                         work_precision.show_time(peer and peer[0]),
                         *map(work_precision.show_time, own), *map(show_ratio, ratio[::2])])
        for kind, column in enumerate(zip(*ratios)):
            known = [ratio for ratio in column if ratio]
            means[kind].append(math.exp(sum(map(math.log, known)) / len(known)) if known else None)
            leasts[kind].append(min(known, default=None))
        rows_of_target[target] = rows
    summary = document.table(
        ["best peer / ours", *map(work_precision.show_exponent, TARGETS)],
        [[f"{name}, {kind}", *map(show_ratio, row)] for kind, rows_of in
         zip(("machine code", "interpreter", "emitted C"), zip(means, leasts))
         for name, row in zip(("geometric mean", "least"), rows_of)])
    return summary, rows_of_target


def make_section(path):
    """The section of the page, and the rows of the CSV file."""
    heads, scenes = work_precision.read_rows([path])
    plain = {name: curves for name, curves in scenes.items() if not name.endswith(SAMPLED)}
    sampled = {name[:-len(SAMPLED)]: curves for name, curves in scenes.items()
               if name.endswith(SAMPLED)}
    parts, all_rows = ["Measured on: " + ", ".join(heads) + ".\n"], []
    for title, chosen in (("without samples", plain), ("with 100 samples a second, all columns", sampled)):
        summary, rows_of_target = make_tables(chosen)
        parts.append(f"**{title.capitalize()}**\n\n{summary}")
        if chosen is plain:
            parts.append(document.table(["scene, error 1e-6", *HEADERS], rows_of_target[PAGE_TARGET]))
        all_rows += [[title, work_precision.show_exponent(target), *row]
                     for target, rows in rows_of_target.items() for row in rows]
    return "\n".join(parts), all_rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", help="CSV file of applications")
    parser.add_argument("--document", default="doc/evidence.md")
    parser.add_argument("--table", default="doc/tables/applications.csv")
    arguments = parser.parse_args()
    section, rows = make_section(arguments.rows)
    document.write_section(arguments.document, "applications", section)
    document.write_csv(arguments.table, ["samples", "error", "scene", *HEADERS], rows)


if __name__ == "__main__":
    main()
