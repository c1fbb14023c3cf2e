#!/usr/bin/python3
"""The tables of the application scenes, from the rows of `applications`, into doc/benchmarks.md.

They stand between the markers `<!-- begin generated: applications -->` and `<!-- end generated -->`.
"""

import argparse
import math

import document  # beside this file, as the next
import plot_work_precision as work_precision

TARGETS = (1e-4, 1e-6, 1e-9)
SAMPLED = " sampled"  # behind the name of a scene of which 100 samples a second are taken
OURS = (("ours auto", "machine code"), ("ours auto", "formulas"), ("ours emitted", "C"))
HEADERS = ("best peer", "peer, ms", "ours", "interpreter", "emitted C", "peer / ours",
           "peer / emitted C")


def show_ratio(ratio):
    return f"{ratio:.2f}" if ratio else "-"


def make_tables(scenes):
    """One table for each error, and the summary: the mean and the least ratio."""
    means, leasts = [[], [], []], [[], [], []]
    parts = []
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
        title = f"Error {work_precision.show_exponent(target)}"
        parts.append(f"**{title}**\n\n" + document.table(["scene", *HEADERS], rows))
    summary = document.table(
        ["best peer / ours", *map(work_precision.show_exponent, TARGETS)],
        [[f"{name}, {kind}", *map(show_ratio, row)] for kind, rows_of in
         zip(("machine code", "interpreter", "emitted C"), zip(means, leasts))
         for name, row in zip(("geometric mean", "least"), rows_of)])
    return "\n".join([summary, *parts])


def make_section(path):
    heads, scenes = work_precision.read_rows([path])
    plain = {name: curves for name, curves in scenes.items() if not name.endswith(SAMPLED)}
    sampled = {name[:-len(SAMPLED)]: curves for name, curves in scenes.items()
               if name.endswith(SAMPLED)}
    return ("\n".join(f"- {line}" for line in heads) + "\n\n### Without samples\n\n" +
            make_tables(plain) + "\n### With 100 samples a second, all columns\n\n" +
            make_tables(sampled))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", help="CSV file of applications")
    parser.add_argument("--document", default="doc/benchmarks.md")
    arguments = parser.parse_args()
    document.write_section(arguments.document, "applications", make_section(arguments.rows))


if __name__ == "__main__":
    main()
