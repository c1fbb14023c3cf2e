#!/usr/bin/python3
"""Runs `simulate` on scenes made at random and compares every column with the independent reference.

    compare.py SIMULATE [--seeds FIRST:LAST] [--shafts N] [--stepper NAME ...] [--processes 1|2]
    compare.py SIMULATE --seed N --keep DIRECTORY      leaves the scene there, prints both tables
    compare.py - --write FILE [--seeds FIRST:]         writes references for a test without SciPy

Error: |difference| / (1e-9 + 1e-9 largest magnitude of the column so far), at every sample.

A scene is left out only for what the reference alone says: no unique start, no answer of its own, or
a motion in which errors grow by more than --growth. What is left out is counted. The exit status is 1
when the 99th percentile of a stepper is above --limit, a run is above --wrong, or a valid scene is
refused. Needs Debian's python3-numpy, python3-scipy, python3-yaml.
"""
import argparse
import collections
import json
import math
import multiprocessing
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import warnings

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import motion
import random_scenes

DISTURBANCE = 1e-6
DRIFT = 1e-10  # of the reference from psi = 0, relative: above this it is not trusted


def reference(scene, commands, times):
    """Columns and growth of errors."""
    duration = times[-1]
    exact = motion.Motion(scene, commands, duration)
    columns = exact.sample(times)
    if exact.drift > DRIFT:
        raise motion.Unable("reference drifts", duration)
    near = motion.Motion(scene, commands, duration, 1e-10)
    near.disturb(DISTURBANCE)
    moved = near.sample(times)
    growth = 0.0
    for name, column in columns.items():
        if name.split("/")[1] in motion.QUANTITIES[:3]:
            scale = DISTURBANCE * (1.0 + max(abs(x) for x in column))
            growth = max(growth, max(abs(a - b) for a, b in zip(column, moved[name])) / scale)
    return columns, growth


def simulate(program, scene, commands, times, folder):
    """Exit status, columns and messages."""
    yaml_file, csv_file = folder / "scene.yaml", folder / "commands.csv"
    yaml_file.write_text(random_scenes.write_scene(scene))
    csv_file.write_text(random_scenes.write_commands(commands))
    call = [program, str(yaml_file), "--times", ",".join(repr(t) for t in times)]
    if commands:
        call += ["--commands", str(csv_file)]
    try:
        done = subprocess.run(call, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        return -1, {}, "took more than two minutes"
    columns = {}
    if done.stdout:
        lines = done.stdout.splitlines()
        rows = [[float(x) for x in line.split(",")] for line in lines[1:]]
        for i, name in enumerate(lines[0].split(",")):
            columns[name] = [row[i] for row in rows]
    return done.returncode, columns, done.stderr.strip()


def worst_errors(expected, got):
    """{quantity: largest error / tolerance}, over the samples that `got` has."""
    worst = {}
    for name, column in expected.items():
        largest, error = 0.0, 0.0
        for a, b in zip(column, got.get(name, [])):
            largest = max(largest, abs(a))
            difference = abs(a - b) / (1e-9 + 1e-9 * largest)
            error = max(error, difference if math.isfinite(difference) else math.inf)
        quantity = name.split("/")[1]
        worst[quantity] = max(worst.get(quantity, 0.0), error)
    return worst


def examine(job):
    """The result of one seed: (seed, {stepper: (kind, detail, errors)})."""
    seed, options = job
    warnings.simplefilter("ignore")
    folder = pathlib.Path(tempfile.mkdtemp(prefix="scene_"))
    skip, columns = None, {}
    try:
        scene, commands, times = random_scenes.make(seed, options.shafts)
    except motion.Unable as error:
        return seed, {"": ("left out", error.kind, {})}
    try:
        columns, growth = reference(scene, commands, times)
        if growth > options.growth:
            skip = f"growth > {options.growth:g}"
    except motion.Unable as error:
        skip = error.kind
    except (OverflowError, ZeroDivisionError, ValueError, ArithmeticError) as error:
        if options.keep:
            raise
        skip = f"not defined ({type(error).__name__})"
    out = {}
    for stepper in options.stepper:
        solver = dict(x.split("=") for x in options.solver)
        if stepper != "auto":
            solver["stepper"] = stepper
        if solver:
            scene["solver"] = solver
        status, got, message = simulate(options.program, scene, commands, times, folder)
        name = re.search(r"stopped[^:]*: *(?:\w+: )?(\w+)|\b([A-Z][a-z]+[A-Z]\w+)\b", message)
        name = next((g for g in name.groups() if g), "?") if name else "?"
        if skip:
            out[stepper] = ("left out", f"{skip}; simulate: {name if status else 'runs'}", {})
        elif status == 2 or status < 0:
            out[stepper] = ("refused", message[-400:], {})
        else:
            errors = worst_errors(columns, got)
            errors["growth"] = growth
            errors["about"] = ", ".join(sorted(
                x for x in random_scenes.features(scene)
                if x in ("gauss", "sign", "curved in accelerations") or x in constraint_kinds(scene)))
            out[stepper] = ("stopped", f"{name}: {message[-300:]}", errors) if status else ("ran", "", errors)
        if options.keep:
            keep(options.keep, folder, columns, got, message)
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    return seed, out


def constraint_kinds(scene):
    return {scene[c]["type"].split("/")[1] for c in scene.get("constraints", [])}


def keep(directory, folder, columns, got, message):
    directory = pathlib.Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    for file in ("scene.yaml", "commands.csv"):
        (directory / file).write_text((folder / file).read_text())
    print(message, file=sys.stderr)
    print("column, then at each sample: reference, simulate, error / tolerance")
    for name, column in columns.items():
        print(name)
        largest = 0.0
        for t, a, b in zip(got.get("time", []), column, got.get(name, [])):
            largest = max(largest, abs(a))
            print(f"  {t:<12.9g} {a:<24.17g} {b:<24.17g} {abs(a - b) / (1e-9 + 1e-9 * largest):.3g}")


def write_references(options, first):
    """Scenes with their references for a test that needs no SciPy: of the seeds from `first` on those
    that have a law, hold or function that fewer than two before had."""
    seen, kept, seed = collections.Counter(), [], first
    while len(kept) < options.write_count and seed < first + 2000:
        try:
            scene, commands, times = random_scenes.make(seed, options.shafts)
            new = {x for x in random_scenes.features(scene) if seen[x] < 2}
            if new or len(seen) == 0:
                columns, growth = reference(scene, commands, times)
                if growth < 30.0:
                    kept.append(json.dumps({
                        "seed": seed, "scene": random_scenes.write_scene(scene),
                        "commands": random_scenes.write_commands(commands) if commands else "",
                        "times": times,
                        "columns": {name: [float(f"{x:.15g}") for x in column]
                                    for name, column in columns.items()}}))
                    seen.update(random_scenes.features(scene))
        except (motion.Unable, ArithmeticError, ValueError):
            pass
        seed += 1
    pathlib.Path(options.write).write_text("[\n" + ",\n".join(kept) + "\n]\n")
    print(f"{len(kept)} scenes of the seeds {first} to {seed - 1}; how many have what:")
    print(", ".join(f"{x} {n}" for x, n in sorted(seen.items())))


def quantile(values, part):
    values = sorted(values)
    return values[min(len(values) - 1, int(math.ceil(part * len(values))) - 1)] if values else math.nan


MOTION = motion.QUANTITIES[:5]


def report(results, options):
    """Prints the table; whether all is well."""
    well = True
    for stepper in options.stepper:
        runs, stops, refused, left_out = [], [], [], collections.defaultdict(list)
        for seed, out in results:
            kind, detail, errors = out.get(stepper) or out.get("")
            if kind == "left out":
                left_out[detail].append(seed)
            elif kind == "refused":
                refused.append((seed, detail))
            else:
                runs.append((seed, errors))
                if kind == "stopped":
                    stops.append((seed, detail))
        print(f"\nstepper {stepper}: {len(results)} scenes, {len(runs)} compared, {len(stops)} of them "
              f"stopped by name, {len(refused)} refused, {sum(map(len, left_out.values()))} left out")
        for name, seeds in sorted(left_out.items(), key=lambda x: -len(x[1])):
            print(f"  left out, {name}: {len(seeds)} ({', '.join(map(str, seeds[:8]))})")
        for seed, detail in stops:
            print(f"  stopped {seed}: {detail}")
        for seed, detail in refused:
            print(f"  refused {seed}: {detail}")
            well = False
        print(f"  {'error / tolerance':24}{'median':>10}{'p90':>10}{'p99':>10}{'max':>10}")
        rows = {quantity: [quantity] for quantity in motion.QUANTITIES}
        rows["all but rates"] = MOTION
        for title, quantities in rows.items():
            values = [max(e.get(q, 0.0) for q in quantities) for _, e in runs]
            row = [quantile(values, p) for p in (0.5, 0.9, 0.99, 1.0)]
            print(f"  {title:24}" + "".join(f"{x:10.3g}" for x in row))
            if title == "all but rates":
                well = well and not (row[2] > options.limit or row[3] > options.wrong)
        overall = lambda errors: max(errors.get(q, 0.0) for q in MOTION)
        above = sum(overall(e) > options.limit for _, e in runs)
        print(f"  above {options.limit:g} tolerances: {above}")
        for seed, e in sorted(runs, key=lambda x: -overall(x[1]))[:max(5, above)]:
            print(f"  worst: seed {seed}, {overall(e):.3g}, growth {e['growth']:.2g}, {e['about']}")
        worst = sorted(runs, key=lambda x: -x[1].get("reaction_torque_rate", 0.0))[:5]
        print("  worst rates: " + ", ".join(
            f"{seed} ({e.get('reaction_torque_rate', 0.0):.3g})" for seed, e in worst))
    return well


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program", help="simulate, absolute path")
    parser.add_argument("--seeds", default="1:100", help="FIRST:LAST")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--shafts", type=int, default=3, help="at most so many")
    parser.add_argument("--stepper", nargs="+", default=["auto"])
    parser.add_argument("--solver", nargs="*", default=[], metavar="KEY=VALUE")
    parser.add_argument("--processes", type=int, default=1, choices=(1, 2))
    parser.add_argument("--limit", type=float, default=100.0, help="of the 99th percentile, tolerances")
    parser.add_argument("--wrong", type=float, default=1000.0, help="silently wrong above this, tolerances")
    parser.add_argument("--growth", type=float, default=1e4)
    parser.add_argument("--keep", metavar="DIRECTORY")
    parser.add_argument("--write", metavar="FILE", help="write references of some scenes and end")
    parser.add_argument("--write-count", type=int, default=40)
    options = parser.parse_args()
    first, last = (int(x or 0) for x in options.seeds.split(":"))
    seeds = [options.seed] if options.seed is not None else range(first, last + 1)
    if options.write:
        write_references(options, first)
        return 0
    jobs = [(seed, options) for seed in seeds]
    results = []
    with multiprocessing.Pool(options.processes) as pool:
        for result in pool.imap(examine, jobs):
            results.append(result)
            if len(results) % 50 == 0:
                print(f"{len(results)} scenes", file=sys.stderr)
    return 0 if report(results, options) else 1


if __name__ == "__main__":
    sys.exit(main())
