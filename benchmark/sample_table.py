#!/usr/bin/python3
"""The table of runs of which many samples are taken, from the rows of `samples`, into doc/benchmarks.md.

It stands between the markers `<!-- begin generated: samples -->` and `<!-- end generated -->`.
"""

import argparse
import pathlib

import kernel_tables  # beside this file
import plot_work_precision

TARGETS = (1e-4, 1e-6, 1e-7, 1e-9, 1e-11)


def make_section(path):
    heads, scenes = plot_work_precision.read_rows([path])
    (curves,) = scenes.values()
    times = {key: [plot_work_precision.time_at(points, target) for target in TARGETS]
             for key, points in curves.items()}
    ours = times[("ours auto", "all columns")]
    rows = [[method, form, *map(plot_work_precision.show_time, row)]
            for (method, form), row in times.items()]
    for form in ("state alone", "all columns"):
        ratios = []
        for n, own in enumerate(ours):
            peers = [row[n] for (method, columns), row in times.items()
                     if not method.startswith("ours") and columns == form and row[n] is not None]
            ratios.append(f"{min(peers) / own:.2f}" if peers and own else "-")
        rows.append([f"**best peer, {form} / ours**", "", *ratios])
    header = ["ms to an error of", "samples of",
              *map(plot_work_precision.show_exponent, TARGETS)]
    return ("\n".join(f"- {line}" for line in heads) + "\n\n" +
            plot_work_precision.table(header, rows))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", help="CSV file of samples")
    parser.add_argument("--document", default="doc/benchmarks.md")
    arguments = parser.parse_args()
    kernel_tables.write_section(pathlib.Path(arguments.document), "samples",
                                make_section(arguments.rows))


if __name__ == "__main__":
    main()
