#!/usr/bin/python3
"""A sweep of the ship beside a loop over `simulate` and a hand-written program, as a table.

usage: sweep.py [--runs N] [--rounds N] [--threads N] [--program sweep_odeint] [--write PAGE.md]

Runs of 20 s of benchmark/scenes/ship.yaml with as many inertias of its drive. The program is Boost's
Odeint (dopri5) in OpenMP; its tolerance is the largest of 1e-5, 1e-6, .. whose speeds are as good as
ours. The rounds take turns; the best of each counts. `simulate` runs a hundred times, not N.
Runs per second of a core are by processor time, so others on the machine matter little; the speed-up
is by the clock and wants an idle one. --write puts the table between the page's markers.
"""

import argparse
import os
import pathlib
import resource
import subprocess
import time

import numpy
import roslib.packages
import variator_sim

import document  # beside this file

SCENE = pathlib.Path(__file__).resolve().parent / "scenes/ship.yaml"
PATH, METRIC, DURATION = "drive/inertia", "final(load/velocity)", 20.0
# On the constraint, whatever the inertias: nothing has to be searched for.
GIVEN = {"initial/acceleration": [8.7766140234030305, 6.0165615693436304]}
PROCESSES = 100


def processor_time():
    return sum(usage.ru_utime + usage.ru_stime for usage in
               map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def inertias(runs):
    return 0.4 + 0.8 * numpy.arange(runs) / (runs - 1)


def run_sweep(runs, threads, overrides=None):
    return variator_sim.sweep(SCENE, DURATION, grid={PATH: inertias(runs)}, metrics=[METRIC],
                              threads=threads, overrides=overrides)[METRIC]


def run_simulate(simulate):
    for inertia in inertias(PROCESSES):
        subprocess.run([simulate, str(SCENE), "--times", str(DURATION), "--set",
                        f"{PATH}={inertia}"], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)


def run_program(program, runs, tolerance, threads):
    text = subprocess.run([program, str(runs), str(tolerance), str(threads)], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    return numpy.array(text.split(), dtype=float)


def choose_tolerance(program):
    """The program's tolerance, its error and ours, rad/s."""
    runs = 50
    exact = run_sweep(runs, 1, {"solver/relative_tolerance": 1e-13,
                                "solver/absolute_tolerance": 1e-13})
    ours = numpy.abs(run_sweep(runs, 1) - exact).max()
    for tolerance in 10.0 ** -numpy.arange(5, 14):
        error = numpy.abs(run_program(program, runs, tolerance, 1) - exact).max()
        if error <= ours:
            break
    return tolerance, error, ours


def measure(work):
    clock, processor = time.perf_counter(), processor_time()
    work()
    return time.perf_counter() - clock, processor_time() - processor


def make_table(arguments):
    simulate, program = (roslib.packages.find_node("variator_sim", name)[0]
                         for name in ("simulate", "sweep_odeint"))
    program = arguments.program or program
    runs, threads = arguments.runs, arguments.threads
    tolerance, error, ours = choose_tolerance(program)
    kinds = {
        "`sweep`, one thread": (runs, lambda: run_sweep(runs, 1)),
        f"`sweep`, {threads} threads": (runs, lambda: run_sweep(runs, threads)),
        "`sweep`, one thread, `initial/acceleration` given":
            (runs, lambda: run_sweep(runs, 1, GIVEN)),
        "loop over `simulate`": (PROCESSES, lambda: run_simulate(simulate)),
        "Odeint, one thread": (runs, lambda: run_program(program, runs, tolerance, 1)),
        f"Odeint, {threads} threads": (runs, lambda: run_program(program, runs, tolerance,
                                                                 threads))}
    times = {name: [] for name in kinds}
    for _ in range(arguments.rounds):
        for name, (_, work) in kinds.items():
            times[name].append(measure(work))
    clock = {name: kinds[name][0] / min(t for t, _ in taken) for name, taken in times.items()}
    core = {name: kinds[name][0] / min(t for _, t in taken) for name, taken in times.items()}
    first = next(iter(kinds))
    rows = []
    for name in kinds:
        single = name.replace(f"{threads} threads", "one thread")
        speed_up = f"{clock[name] / clock[single]:.2f}" if name != single else ""
        rows.append([name, f"{core[name]:.0f}", f"{core[name] / core[first]:.2f}", f"{clock[name]:.0f}", speed_up])
    table = document.table(["", "runs/s of a core", "to `sweep`", "runs/s", "speed-up by threads"], rows)
    return (f"{table}\n{runs} runs (`simulate`: {PROCESSES}), best of {arguments.rounds} rounds, {os.cpu_count()} cores "
            f"of {document.processor_name()}. Largest error of the final speeds: `sweep` {ours:.0e} rad/s, Odeint "
            f"{error:.0e} rad/s at the tolerance {tolerance:.0e}.\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--program")
    parser.add_argument("--write", type=pathlib.Path, metavar="PAGE.md")
    arguments = parser.parse_args()
    table = make_table(arguments)
    print(table)
    if arguments.write:
        document.write_section(arguments.write, "sweep", table)


if __name__ == "__main__":
    main()
