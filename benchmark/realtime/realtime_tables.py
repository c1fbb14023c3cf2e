#!/usr/bin/python3
"""Writes the rows of run_realtime.py with a goal into doc/node.md, and all rows as CSV.

Between the markers `<!-- begin generated: realtime -->` and `<!-- end generated -->`.
"""

import argparse
import collections
import csv
import pathlib
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import document  # noqa: E402: benchmark/document.py

# row, what, the peer's variant, quantity, its unit, greatest ratio, greatest difference
Goal = collections.namedtuple("Goal", "row what peer quantity unit ratio difference")
GOALS = (
    Goal("cpu_subscribed", "CPU time at 1 kHz, 100 Hz state, one subscriber; against a bare "
         "publisher", "bare", "cpu", "ms/s", 1.2, None),
    Goal("cpu_panel", "CPU time at 1 kHz, 100 Hz state, a panel that is looked at; against one "
         "subscriber", "subscribed", "cpu", "ms/s", 1.1, None),
    Goal("cpu_alone", "CPU time at 1 kHz, no subscriber; against a bare timed loop without ROS",
         "bare", "cpu", "ms/s", 1.2, None),
    Goal("lateness_1000", "lateness p50 at 1 kHz; against a bare loop", "bare", "p50", "µs", 1.1,
         5.0),
    Goal("lateness_5000", "lateness p50 at 5 kHz; against a bare loop", "bare", "p50", "µs", 1.1,
         5.0),
    Goal("latency", "command to the first state that shows it, p50; against an echo node", "echo",
         "p50", "µs", None, 1000.0),
    Goal("drivetrains", "20 drivetrains in one manager on one core: overruns; against 20 bare loops",
         "bare", "overruns", "per 1000 ticks", None, 0.0),
    Goal("memory", "resident memory; against a bare publisher", "bare", "resident", "MB", None,
         8.0),
    Goal("step_cpp", "`~step` of 1 ms from C++, p50; against an empty service", "trigger", "p50",
         "µs", 1.3, None),
    Goal("step_python", "`~step` of 1 ms from Python, p50; against an empty service", "trigger",
         "p50", "µs", 1.3, None),
)
# Reported beside them, without a goal: row, what, our variant, the peer's, quantity, its unit.
MORE = (
    ("cpu_panel", "CPU time at 1 kHz, 100 Hz state, a panel that is looked at; against no "
     "subscriber", "variator", "alone", "cpu", "ms/s"),
    ("cpu_alone", "CPU time at 1 kHz, no subscriber; against the same loop in a process that has "
     "called ros::init", "variator", "ros", "cpu", "ms/s"),
    ("lateness_1000", "lateness p99 at 1 kHz", "variator", "bare", "p99", "µs"),
    ("lateness_5000", "lateness p99 at 5 kHz", "variator", "bare", "p99", "µs"),
    ("latency", "command to state, p99", "variator", "echo", "p99", "µs"),
    ("step_cpp", "`~step` from C++, p50; against a service with the same messages that does nothing",
     "variator", "idle", "p50", "µs"),
    ("step_python", "`~step` from Python, p50; against that service", "variator", "idle", "p50",
     "µs"),
    ("step_python", "that service, from Python, p50; against the empty one", "idle", "trigger",
     "p50", "µs"),
    ("step_cpp", "`~step` from C++, p99", "variator", "trigger", "p99", "µs"),
    ("step_python", "`~step` from Python, p99", "variator", "trigger", "p99", "µs"),
    ("memory", "memory that no file backs", "variator", "bare", "anonymous", "MB"),
    ("drivetrains", "20 drivetrains in one manager: CPU time", "variator", "bare", "cpu", "ms/s"),
    ("drivetrains", "their lateness p50", "variator", "bare", "p50", "µs"),
    ("drivetrains", "their overruns; against one bare loop alone", "variator", "one loop",
     "overruns", "per 1000 ticks"),
)
FLOOD = (("seconds", "measured, s"), ("commands sent", "commands sent since the start"),
         ("commands accepted", "of them accepted"),
         ("commands dropped", "of them dropped by the node"), ("ticks", "ticks"),
         ("ticks lost", "ticks lost (deadlines moved)"),
         ("overruns", "overruns (ticks more than one period late)"),
         ("states dropped", "states dropped between the node's threads"))


def read_rows(path):
    """The head (comments), and the values by (row, variant, quantity), each by round."""
    lines = document.read_lines(path)
    head = [line[1:].strip() for line in lines if line.startswith("#")]
    values = collections.defaultdict(dict)
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        values[row["row"], row["variant"], row["quantity"]][int(row["round"])] = float(row["value"])
    return head, values


def show(value):
    """Three digits, no exponent."""
    size = abs(value)
    if size >= 100:
        return f"{value:.0f}"
    return f"{value:.{1 if size >= 10 else 2}f}" if size >= 1 else f"{value:.3g}"


def show_range(values):
    return f"{show(statistics.median(values))} ({show(min(values))} to {show(max(values))})"


def compare(values, row, variant, peer, quantity):
    """Ours, the peer's, the ratios and the differences, round by round; None when not measured."""
    ours = values.get((row, variant, quantity), {})
    theirs = values.get((row, peer, quantity), {})
    rounds = sorted(set(ours) & set(theirs))
    if not rounds:
        return None
    ours, theirs = [ours[i] for i in rounds], [theirs[i] for i in rounds]
    ratios = [a / b for a, b in zip(ours, theirs)] if all(theirs) else []
    return ours, theirs, ratios, [a - b for a, b in zip(ours, theirs)]


def judge(goal, ratios, differences):
    met = True
    if goal.ratio is not None:
        met &= bool(ratios) and statistics.median(ratios) <= goal.ratio
    if goal.difference is not None:
        met &= statistics.median(differences) <= goal.difference
    return "yes" if met else "**no**"


def show_goal(goal):
    parts = []
    if goal.ratio is not None:
        parts.append(f"{goal.ratio:g}×")
    if goal.difference is not None:
        parts.append(f"{goal.difference:+g} {goal.unit}")
    return "at most " + " and ".join(parts)


def goal_rows(values):
    cells = []
    for goal in GOALS:
        compared = compare(values, goal.row, "variator", goal.peer, goal.quantity)
        if compared is None:
            cells.append([goal.what, "not measured", "", "", "", show_goal(goal), ""])
            continue
        ours, theirs, ratios, differences = compared
        cells.append([goal.what, f"{show_range(ours)} {goal.unit}",
                      f"{show_range(theirs)} {goal.unit}",
                      show_range(ratios) if ratios else "", show(statistics.median(differences)),
                      show_goal(goal), judge(goal, ratios, differences)])
    return cells


def more_rows(values):
    cells = []
    for row, what, variant, peer, quantity, unit in MORE:
        compared = compare(values, row, variant, peer, quantity)
        if compared is not None:
            ours, theirs, ratios, _ = compared
            cells.append([what, f"{show_range(ours)} {unit}", f"{show_range(theirs)} {unit}",
                          show_range(ratios) if ratios else ""])
    return cells


def flood_rows(values):
    resident = values.get(("flood", "variator", "resident"), {})
    if not resident:
        return []
    samples = [resident[i] for i in sorted(resident)]
    part = max(1, len(samples) // 10)
    first, last = samples[:part], samples[-part:]
    cells = [[text, f"{values['flood', 'variator', key][0]:.10g}"] for key, text in FLOOD
             if ("flood", "variator", key) in values]
    cells += [["resident memory in the first tenth, MB", f"{statistics.mean(first):.3f}"],
              ["in the last tenth, MB", f"{statistics.mean(last):.3f}"],
              ["greatest, MB", f"{max(samples):.3f}"]]
    return cells


def section(head, values):
    return ("Measured on: " + ", ".join(head) + ".\n\n" +
            document.table(["quantity", "node", "peer", "ratio", "difference", "goal", "met"], goal_rows(values)))


def all_rows(values):
    """Rows of all measurements: quantity, node, peer, ratio."""
    flood = [[f"commands at 10 kHz, a subscriber that never reads: {name}", value, "", ""]
             for name, value in flood_rows(values)]
    return [row[:4] for row in goal_rows(values)] + more_rows(values) + flood


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", help="CSV file of run_realtime.py")
    parser.add_argument("--document", default="doc/node.md")
    parser.add_argument("--table", default="doc/tables/realtime.csv")
    arguments = parser.parse_args()
    head, values = read_rows(arguments.rows)
    document.write_section(arguments.document, "realtime", section(head, values))
    document.write_csv(arguments.table, ["quantity", "node", "peer", "ratio"], all_rows(values))


if __name__ == "__main__":
    main()
