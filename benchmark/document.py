#!/usr/bin/python3
"""Generated sections of pages, between `<!-- begin generated: NAME -->` and `<!-- end generated -->`,
and tables of all rows as CSV files beside the pages. As a program: writes what it reads as the
section NAME of a page: document.py NAME COMMIT PAGE < TABLE"""

import csv
import pathlib
import platform
import re
import sys

END = "<!-- end generated -->"


def read_lines(path):
    try:
        return pathlib.Path(path).read_text().splitlines()
    except FileNotFoundError:
        sys.exit(f"'{path}' is not there: scripts/benchmark or scripts/benchmark_realtime makes it, "
                 "in output/benchmark/")


def processor_name():
    found = re.search(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else platform.machine()


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def write_csv(path, head, rows):
    path = pathlib.Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


def write_section(path, name, section):
    path = pathlib.Path(path)
    text = path.read_text()
    marker = f"<!-- begin generated: {name} -->"
    begin = text.index(marker) + len(marker)
    end = text.index(END, begin)
    path.write_text(text[:begin] + "\n\n" + section + "\n" + text[end:])


if __name__ == "__main__":
    write_section(sys.argv[3], sys.argv[1], f"At commit {sys.argv[2]}.\n\n" + sys.stdin.read())
