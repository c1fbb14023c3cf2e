"""Many runs of one scene with other values: designs, runs on all cores or machines, tables."""

import collections.abc
import contextlib
import csv
import errno
import fcntl
import functools
import hashlib
import itertools
import json
import math
import os
import re
import stat
import sys
import threading
import time
import types
import zipfile

import numpy

from variator_sim import _core
from variator_sim.checks import did_you_mean, finite, mapping, shown, texts, whole_number
from variator_sim.errors import MotionStopped, SceneError
from variator_sim.files import find_regular_file, whole_file, writing
from variator_sim.running import OVERRIDES, checked_times, read_commands, simulate

KINDS = ("final", "min", "max", "mean", "integral", "settling")
GROUPS = ("state", "elements", "inputs", "outputs", "states", "variables",
          "principle", "energy")
DISTRIBUTIONS = {"normal": numpy.random.Generator.normal,
                 "uniform": numpy.random.Generator.uniform,
                 "lognormal": numpy.random.Generator.lognormal}
MOST_RUNS = 10_000_000  # of one sweep: its table is held in memory
COMPILE_SECONDS = 2.0  # what is left of a sweep for machine code to be worth compiling
PATIENCE_SECONDS = 0.7  # for threads to end after Ctrl-C
CHUNK_SECONDS = 1.0  # wall time of what is run at once: nothing finished is older when killed
MOST_THREADS = 1024
CONNECT_SECONDS = 5  # for a Dask scheduler to answer


class Table(collections.abc.Mapping):
    """A row for each run: `table["final(load/velocity)"]` is that column, one value a run.

    Columns: "run" (from 0, its number in the whole sweep), the paths, the metrics (NaN where the
    run failed), "reason" ("" or why it failed).
    """

    def __init__(self, columns):
        self._columns = columns

    def __getitem__(self, name):
        return self._columns[name]

    def __iter__(self):
        return iter(self._columns)

    def __len__(self):
        return len(self._columns)

    def __repr__(self):
        failed = int(numpy.count_nonzero(self["reason"] != ""))
        return f"<Table of {len(self['run'])} runs, {failed} failed: {', '.join(self)}>"


# --- The runs -------------------------------------------------------------------------------------

class TooManyRuns(ValueError):
    """More than a table in memory can hold."""


def check_runs(count):
    """Before there is room made for so many."""
    if count > MOST_RUNS:
        raise TooManyRuns(f"{count} runs; allowed: {MOST_RUNS} at most in one sweep")


def read_values(text):
    """Values of one path: "1.2", "1,2,5", "0.1:0.5:50" (50 values, both ends), "log:1e-3:1:20"."""
    try:
        if ":" not in text:
            return numpy.array([float(word) for word in text.split(",")])
        words = text.split(":")
        spaced = numpy.geomspace if words[0] == "log" else numpy.linspace
        first, last, count = words[1:] if words[0] == "log" else words
        check_runs(int(count))
        values = spaced(float(first), float(last), int(count))
        if len(values) and numpy.isfinite(values).all():
            return values
    except TooManyRuns:
        raise
    except ValueError:
        pass
    raise ValueError(f"'{text}': allowed are VALUE, V1,V2,..., FIRST:LAST:COUNT and "
                     "log:FIRST:LAST:COUNT (both of one sign)")


def read_distribution(text):
    """("normal", 1.0, 0.1) of "normal(1,0.1)", or of that tuple."""
    match = re.fullmatch(r"(\w+)\(([^,()]+),([^,()]+)\)", text.replace(" ", "")) if isinstance(text, str) else None
    try:
        name, first, second = match.groups() if match else text
        first, second = float(first), float(second)
        if name in DISTRIBUTIONS and math.isfinite(first) and math.isfinite(second):
            if second >= (first if name == "uniform" else 0.0):
                return name, first, second
    except (TypeError, ValueError):
        pass
    raise ValueError(f"{shown(text)}: allowed are normal(MEAN,DEVIATION), lognormal(MEAN,DEVIATION) (of the logarithm) with "
                     "DEVIATION >= 0, and uniform(LOW,HIGH) with LOW <= HIGH")


def read_array(values):
    """Values of one path: a text as of `read_values`, a number or an array."""
    if isinstance(values, str):
        return read_values(values)
    try:
        array = numpy.atleast_1d(values).astype(float)
        if array.ndim == 1 and len(array) and numpy.isfinite(array).all():
            return array
    except (TypeError, ValueError):
        pass
    raise ValueError(f"{shown(values)}: allowed are a number, an array of finite numbers, and texts such as '0.1:0.5:50'")


def read_paths(what, values, read):
    """`values` by path, each read; errors name the path."""
    read_values_of = {}
    for path, value in (mapping(what, values, {"drive/inertia": "0.1:0.5:50"}) or {}).items():
        try:
            read_values_of[path] = read(value)
        except TooManyRuns:
            raise
        except ValueError as error:
            raise ValueError(f"{what}: {path}: {error}") from None
    return read_values_of


def make_design(grid, random, samples, seed):
    """Paths and the values of all runs, runs x paths: each point of the grid `samples` times."""
    grid = read_paths("grid", grid, read_array)
    random = read_paths("random", random, read_distribution)
    both = sorted(set(grid) & set(random))
    if both:
        raise ValueError(f"'{both[0]}' is given twice: in the grid and at random")
    samples, seed = whole_number("samples", samples, 1), whole_number("seed", seed, 0)
    count = math.prod(len(values) for values in grid.values())
    check_runs(count * samples)
    points = numpy.array(list(itertools.product(*grid.values())), dtype=float)
    points = numpy.repeat(points.reshape(count, len(grid)), samples, axis=0)
    columns = [points]
    for i, (name, *parameters) in enumerate(random.values()):
        # A stream for each path: one more path leaves the others' numbers as they are.
        generator = numpy.random.default_rng([seed, i])
        columns.append(DISTRIBUTIONS[name](generator, *parameters, size=len(points))[:, None])
    return [*grid, *random], numpy.hstack(columns)


def read_metric(text):
    """(kind, column, band) of "max(load/velocity)" or "settling(load/velocity, 0.05)"."""
    match = re.fullmatch(r"\s*(\w+)\s*\(\s*([^,()]+?)\s*(?:,\s*([^,()]+?)\s*)?\)\s*", text)
    if match and match.group(1) in KINDS:
        kind, column, band = match.groups()
        if band is None:
            return kind, column, 0.02
        try:
            if kind == "settling" and 0.0 < float(band) < 1.0:
                return kind, column, float(band)
        except ValueError:
            pass
    raise ValueError(f"metric {shown(text)}: allowed are final(COLUMN), min, max, mean, integral (over time), and "
                     "settling(COLUMN) or settling(COLUMN, BAND) with 0 < BAND < 1 (default 0.02)")


def find_columns(simulation, metrics):
    """The groups that have the metrics' columns, and (kind, place, band) of each metric."""
    groups_of = {}
    for group in GROUPS:
        for name in simulation.columns(group):
            groups_of.setdefault(name, group)
    # (`--fix` and formulas call an output by its own name.)
    metrics = [(kind, column if column in groups_of or f"outputs/{column}" not in groups_of else f"outputs/{column}", band)
               for kind, column, band in metrics]
    for _, column, _ in metrics:
        if column not in groups_of:
            raise ValueError(f"metric of '{column}': no such column{did_you_mean(column, groups_of)}; the scene's columns: "
                             + ", ".join(groups_of))
    groups = ",".join(sorted({groups_of[column] for _, column, _ in metrics}, key=GROUPS.index))
    names = simulation.columns(groups)
    return groups, [(kind, names.index(column), band) for kind, column, band in metrics]


def calc_metric(kind, column, band, samples):
    """A metric of the samples of a run, samples x columns, the time first."""
    time, values = samples[:, 0], samples[:, column]
    if kind == "final":
        return values[-1]
    if kind in ("min", "max"):
        return getattr(values, kind)()
    if kind in ("integral", "mean"):
        trapezoids = 0.5 * (values[1:] + values[:-1]) * (time[1:] - time[:-1])
        integral = trapezoids.cumsum()[-1] if len(time) > 1 else 0.0  # (a sum in this order)
        return integral if kind == "integral" else integral / (time[-1] - time[0]) if time[-1] > time[0] else values[0]
    off = numpy.flatnonzero(~(numpy.abs(values - values[-1]) <= band * abs(values[-1] - values[0]))[:-1])
    return time[off[-1] + 1 if len(off) else 0] - time[0]


def read_one(scene, overrides, paths, values):
    """The first, the last or a middle run's scene: where none can be read, no run is worth it."""
    fault = None
    for i in (0, -1, len(values) // 2):
        try:
            return _core.Simulation(scene, {**overrides, **dict(zip(paths, values[i].tolist()))})
        except SceneError as error:
            fault = fault or error
    raise fault


def file_digest(name):
    """A hash of a file that a scene reads, by its path as YAML has it; "" where there is none."""
    with contextlib.suppress(OSError, ValueError, SceneError):
        with open(_core._file_path(json.loads(name) if name.startswith('"') else name), "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()
    return ""


def describe(thing, depth=8):
    """Plain values in which another function, or one that was made with other values, differs: its code without names of
    files and numbers of lines, defaults, closure; of an object its kind and, where it is called, its attributes."""
    if thing is None or isinstance(thing, (bool, int, float, str)):
        return repr(thing)
    if depth == 0:  # a function that calls itself is in its own closure
        return type(thing).__qualname__
    if isinstance(thing, (list, tuple)):
        return [describe(item, depth - 1) for item in thing]
    if isinstance(thing, dict):
        return [[str(key), describe(item, depth - 1)] for key, item in thing.items()]
    if isinstance(thing, numpy.ndarray):
        return [str(thing.dtype), thing.shape, hashlib.sha256(thing.tobytes()).hexdigest()]
    if isinstance(thing, types.CodeType):
        return [thing.co_code.hex(), thing.co_names, describe(thing.co_consts, depth - 1)]
    if isinstance(thing, types.FunctionType):
        cells = [cell.cell_contents for cell in thing.__closure__ or ()]
        return [describe(part, depth - 1) for part in (thing.__code__, thing.__defaults__, thing.__kwdefaults__, cells)]
    if isinstance(thing, functools.partial):
        return [describe(part, depth - 1) for part in (thing.func, thing.args, thing.keywords)]
    call = getattr(type(thing), "__call__", None)
    parts = (call, vars(thing)) if isinstance(call, types.FunctionType) else ()
    return [type(thing).__qualname__, *(describe(part, depth - 1) for part in parts)]


class NoController(TypeError):
    """A function that makes no controllers: no run is worth it."""


class Task:
    """The common part of all runs of a sweep: plain values, so it can be sent to other machines."""

    def __init__(self, scene, duration, rate, times, commands, overrides, paths, values, metrics, controller=None,
                 period=0.01):
        if not isinstance(scene, collections.abc.Mapping):
            scene = os.fspath(scene)
            if "\n" not in scene and not scene.startswith("{"):
                with open(scene, encoding="utf-8") as file:
                    text = file.read() + "\n"
                # Files that the scene names lie beside it, wherever its text goes.
                scene = _core._describe_scene(scene, {}) if re.search(r"\bfile\b", text) else text
        read = [read_metric(text) for text in metrics]
        if not read:
            raise ValueError("metrics: none given; allowed: one or more such as 'final(load/velocity)'")
        if not set(paths).isdisjoint(overrides or {}):
            raise ValueError("overrides: a path that varies is overridden too")
        simulation = read_one(scene, overrides or {}, paths, values)
        groups, places = find_columns(simulation, read)
        self.width = len(simulation.columns(groups))
        self.duration, times = checked_times(duration, rate, times)
        if times is None and all(kind == "final" for kind, _, _ in read):
            times = [self.duration]  # nothing before the end is looked at
        self.metrics = list(metrics)
        self.arguments = (self.duration, float(rate), None if times is None else list(map(float, times)),
                          read_commands(commands), groups, places)
        self.scene, self.overrides, self.paths = scene, overrides, list(paths)
        self.controller, self.period = controller, period

    def run_controlled(self, row):
        """Metrics and the reason of one row of values, with a controller of its own."""
        values = dict(zip(self.paths, row.tolist()))
        duration, rate, times, commands, groups, metrics = self.arguments
        where = "(in the run with " + ", ".join(f"{path}={value!r}" for path, value in values.items()) + ")"
        try:
            controller = self.controller(values)
            if not callable(controller):
                raise NoController(f"controller: returned {str(controller)[:80]} {where}; allowed: a function that returns "
                                   "the run's own controller, a function of a sample as `simulate` has it")
            result = simulate(self.scene, duration, rate=rate, times=times, commands=commands, columns=groups,
                              overrides={**(self.overrides or {}), **values}, controller=controller, period=self.period)
            return [calc_metric(*metric, result.values) for metric in metrics], ""
        except NoController:
            raise
        except Exception as error:  # pylint: disable=broad-except
            # A controller may raise any exception: the other runs go on.
            kind = "" if isinstance(error, (SceneError, MotionStopped)) else f"{type(error).__name__}: "
            return [math.nan] * len(metrics), f"{kind}{error} {where}"

    def run(self, values, threads, compiles):
        """Metrics (runs x metrics) and reasons of some rows of values."""
        if self.controller is not None:
            rows = [self.run_controlled(row) for row in values]
            return numpy.array([row[0] for row in rows]), [row[1] for row in rows]
        rows = run_rows(self, values.tolist(), threads, compiles)
        return numpy.array([row[0] for row in rows]), [row[1] for row in rows]

    def fingerprint(self, values, shard):
        """A hash of everything that the runs depend on, every number to its last bit."""
        scene = _core._describe_scene(self.scene, self.overrides)
        parts = [scene, [file_digest(name) for name in re.findall(r"^ +file: (.+)$", scene, re.MULTILINE)],
                 self.paths, self.arguments, self.metrics, shard]
        if self.controller is not None:
            parts += [self.period, describe(self.controller)]
        text = json.dumps(parts)
        return hashlib.sha256(text.encode() + values.tobytes()).hexdigest()


# --- Storage of finished runs ---------------------------------------------------------------------

class Journal:
    """Finished runs, row by row in a file beside the output, until all are there.

    Killed at any moment it keeps what was finished: a line without its end is cut off, and a line
    that is no row (of a disk that lost power) is passed over, so that its run is made again.
    """

    def __init__(self, path, fingerprint, metric_count):
        self.rows = {}
        self._path = path
        self._file = self._open(path)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RuntimeError(f"{path}: another sweep is writing it") from None
        self._file.seek(0)
        text = self._file.read()
        whole = text[:text.rfind("\n") + 1]
        header, *lines = whole.split("\n")
        if not whole and fingerprint.startswith(text):
            self._file.truncate(0)
            self._file.write(fingerprint + "\n")
        elif header != fingerprint:
            raise RuntimeError(f"{path} is of an interrupted sweep with other values, or no journal: finish "
                               "that sweep, choose another output, or delete the file")
        else:
            self._file.truncate(len(whole.encode(errors="surrogateescape")))
            for line in lines:
                self._read(line, metric_count)
        self._file.flush()

    @staticmethod
    def _open(path):
        """The journal itself, never through a link; what is no regular file is left alone."""
        try:
            with writing(path):
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
                                     | os.O_CLOEXEC, 0o666)
            if stat.S_ISREG(os.fstat(descriptor).st_mode):
                return os.fdopen(descriptor, "a+", encoding="utf-8", errors="surrogateescape", newline="")
            os.close(descriptor)
        except OSError as error:
            if error.errno not in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
                raise
        raise RuntimeError(f"{path} is no regular file: choose another output, or move it away")

    def _read(self, line, metric_count):
        with contextlib.suppress(ValueError, csv.Error):
            run, *metrics, reason = next(csv.reader([line]), [""] * 2)
            metrics = [float(metric) for metric in metrics]
            if len(metrics) == metric_count:
                self.rows[int(run)] = (metrics, reason)

    def add(self, runs, metrics, reasons):
        writer = csv.writer(self._file, lineterminator="\n")
        with writing(self._path):
            for run, values, reason in zip(runs, metrics.tolist(), reasons):
                reason = " ".join(reason.split())  # a line a run
                self.rows[int(run)] = (values, reason)
                writer.writerow([int(run), *values, reason])
            self._file.flush()
            os.fsync(self._file.fileno())

    def remove(self):
        os.unlink(self._path)
        self._file.close()

    def close(self):
        with writing(self._path):
            self._file.close()


class Memory:
    """Finished runs of a sweep without an output."""

    def __init__(self):
        self.rows = {}

    def add(self, runs, metrics, reasons):
        for run, values, reason in zip(runs, metrics.tolist(), reasons):
            self.rows[int(run)] = (values, reason)

    def remove(self):
        pass

    close = remove


def write_rows(table, file):
    """Writes a CSV into an open file."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(list(table))
    writer.writerows(zip(*(table[name].tolist() for name in table)))


def write_table(table, path):
    """Writes a CSV or NPZ, whole or not at all."""
    if os.fspath(path).endswith(".npz"):
        with whole_file(path, "wb") as file:
            numpy.savez_compressed(file, **{name: table[name] for name in table})
    else:
        with whole_file(path) as file:
            write_rows(table, file)


def read_part(path):
    """The columns of one file, by name."""
    if path.endswith(".npz"):
        with numpy.load(path) as arrays:
            part = {name: arrays[name] for name in arrays.files}
    else:
        with open(path, encoding="utf-8-sig", newline="") as file:
            names, *rows = csv.reader(file)
        if any(len(row) != len(names) for row in rows):
            raise ValueError("a row has another number of values than the header")
        columns = zip(*rows) if rows else [[] for _ in names]
        kinds = {"run": int, "reason": str}
        part = {name: numpy.array(column, dtype=kinds.get(name, float)) for name, column in zip(names, columns)}
    if not {"run", "reason"} <= set(part):
        raise ValueError("without the columns run and reason")
    return part


def read_table(*paths):
    """One table of the outputs of a sweep, or of its shards, in the order of their runs."""
    if not paths:
        raise ValueError("read_table: no file; allowed: the outputs of a sweep, CSV or .npz")
    parts = []
    for path in map(os.fspath, paths):
        try:
            parts.append(read_part(path))
        except (ValueError, csv.Error, zipfile.BadZipFile) as error:
            raise ValueError(f"{path}: no table of a sweep ({error}); allowed: a CSV or .npz that a sweep has written") from None
    for path, part in zip(paths, parts):
        if list(part) != list(parts[0]):
            raise ValueError(f"{os.fspath(path)}: of another sweep than {os.fspath(paths[0])}: its columns are "
                             f"{', '.join(part)}; expected: {', '.join(parts[0])}")
    runs = numpy.concatenate([part["run"] for part in parts])
    if len(numpy.unique(runs)) != len(runs):
        raise ValueError("a run is in more than one of the tables")
    order = numpy.argsort(runs)
    return Table({name: numpy.concatenate([part[name] for part in parts])[order]
                  for name in parts[0]})


# --- Running --------------------------------------------------------------------------------------

class Progress:
    """A line on standard error: runs, failures, runs a second, time left."""

    def __init__(self, whole, done, on):
        self._whole, self._begun_with, self._on = whole, done, on
        self._start = time.monotonic()
        self._failed = 0

    def update(self, done, failed):
        self._failed += failed
        if not self._on:
            return
        seconds = time.monotonic() - self._start
        rate = (done - self._begun_with) / seconds if seconds > 0.0 else 0.0
        left = f", {(self._whole - done) / rate:.0f} s left" if rate > 0.0 else ""
        end = "\n" if done == self._whole else ""
        print(f"\r{done}/{self._whole} runs, {self._failed} failed, {rate:.0f} runs/s{left}\033[K",
              end=end, file=sys.stderr, flush=True)


def chunk_size(size, seconds, left, parts):
    """How many runs take CHUNK_SECONDS, after `size` took `seconds`; at the end all have some."""
    wanted = size * CHUNK_SECONDS / max(seconds, 1e-3)
    return max(1, min(int(wanted), 8 * size, math.ceil(left / parts)))


def is_long(size, seconds, left, parts):
    """Whether what is left repays compiling, after `size` runs took one of `parts` `seconds`."""
    return left * seconds / size > COMPILE_SECONDS * parts


def run_rows(task, values, threads, compiles):
    """Metrics and the reason of each row of values, on `threads` threads, or as many as can be started."""
    *arguments, metrics = task.arguments
    sweep = _core._Sweep(task.scene, task.overrides, task.paths, *arguments, compiles)
    rows, faults = [None] * len(values), []
    left = iter(range(len(values)))

    def end(fault):
        faults.append(fault)
        sweep.cancel()

    def work():
        runner = _core._RowRunner(sweep)
        try:
            with numpy.errstate(all="ignore"):
                for i in left:
                    samples, reason = runner.run(values[i], task.width)
                    if faults:
                        return
                    failed = reason or not len(samples)
                    rows[i] = [math.nan if failed else calc_metric(*metric, samples) for metric in metrics], reason
        except BaseException as fault:  # pylint: disable=broad-except
            end(fault)

    pool = []
    try:
        for _ in range(min(threads, len(values))):
            thread = threading.Thread(target=work, daemon=True)  # one that a plugin blocks is left behind
            try:
                thread.start()
            except RuntimeError:  # fewer threads make the same rows
                if not pool:
                    raise
                break
            pool.append(thread)
        for thread in pool:
            thread.join()
    except BaseException as fault:
        end(fault)
        latest = time.monotonic() + PATIENCE_SECONDS
        for thread in pool:
            thread.join(max(0.0, latest - time.monotonic()))
        raise
    if faults:
        raise faults[0]
    return rows


def run_locally(task, values, runs, threads, finished):
    first, size, compiles = 0, threads if task.controller is None else 1, False
    while first < len(runs):
        chunk = runs[first:first + size]
        start = time.monotonic()
        finished(chunk, *task.run(values[chunk], threads, compiles))
        seconds = time.monotonic() - start
        first += len(chunk)
        compiles = compiles or is_long(len(chunk), seconds, len(runs) - first, 1)
        if task.controller is None:
            size = chunk_size(len(chunk), seconds, len(runs) - first, 1)


def _run_remotely(task, values, compiles):
    """Runs a worker's part, on as many threads as it has."""
    from distributed import get_worker
    start = time.monotonic()
    state = getattr(get_worker(), "state", None)
    threads = getattr(state, "nthreads", 1)
    metrics, reasons = task.run(values, threads, compiles)
    return metrics, list(reasons), time.monotonic() - start


def connect(scheduler):
    """A client of the Dask scheduler at this address."""
    try:
        from distributed import Client
    except ImportError:
        raise RuntimeError("scheduler: Dask is not installed; on Debian and Ubuntu: apt install "
                           "python3-distributed") from None
    try:
        return Client(scheduler, timeout=CONNECT_SECONDS)
    except (OSError, ValueError, TypeError) as error:
        raise RuntimeError(f"scheduler: no Dask scheduler has answered at '{scheduler}' within {CONNECT_SECONDS} s "
                           f"({error}); allowed: the address that dask-scheduler prints, "
                           "tcp://HOST:8786") from None


def run_on_cluster(task, values, runs, scheduler, finished):
    """Chunks to Dask's workers; those of a worker that dies run again elsewhere."""
    with connect(scheduler) as client:
        from distributed import as_completed
        client.wait_for_workers(1)
        # A worker's threads are the chunk's: one chunk takes the whole worker.
        workers = max(1, len(client.scheduler_info()["workers"]))
        waiting = list(runs)
        size, compiles = 8, False
        chunks = {}

        def submit():
            chunk = numpy.array(waiting[:size])
            del waiting[:size]
            future = client.submit(_run_remotely, task, values[chunk], compiles, pure=False,
                                   retries=10)
            chunks[future.key] = chunk
            return future

        pending = as_completed([submit() for _ in range(2 * workers) if waiting])
        for future in pending:
            metrics, reasons, seconds = future.result()
            chunk = chunks.pop(future.key)
            finished(chunk, metrics, reasons)
            size = chunk_size(len(chunk), seconds, len(waiting), 2 * workers)
            compiles = compiles or is_long(len(chunk), seconds, len(waiting), workers)
            if waiting:
                pending.add(submit())


def check_output(output, scene, commands):
    """Refuses to write over what is read."""
    if output is None:
        return
    for what, read in (("scene", scene), ("commands", commands)):
        if not isinstance(read, (str, os.PathLike)):
            continue
        try:
            is_same = os.path.samefile(output, read)
        except (OSError, ValueError):  # one is not there, or a text and no path
            is_same = False
        if is_same:
            raise ValueError(f"output: '{os.fspath(output)}' is the file of the {what}")


def sweep(scene, duration=None, *, grid=None, random=None, samples=1, seed=0, metrics, rate=100.0,
          times=None, commands=None, overrides=None, output=None, threads=None, shard=(1, 1),
          scheduler=None, progress=False, controller=None, period=0.01):
    """Runs a scene for each point of a grid, `samples` times with random values; returns a `Table`.

    Args:
        scene, duration, rate, times, commands, overrides: as of `simulate`.
        grid: values by path, arrays or texts: {"drive/inertia": "0.1:0.5:50"} (`read_values`).
        random: distributions by path: {"load/inertia": "normal(2,0.1)"}.
        samples: random draws at each point of the grid.
        seed: of the random values, which are the same in every shard.
        metrics: a text, or texts, such as "final(load/velocity)": final, min, max, mean, settling of a column
            of `simulate`. Times count as sampled: all but final see what `rate` or `times` see.
        output: file ending in .npz, or a CSV. Interrupted, the same call goes on where it stood
            (into a device or a FIFO: from the beginning).
        threads: default one a core.
        shard: (i, n): only every n-th run from the i-th, i from 1.
        scheduler: address of a Dask scheduler, "tcp://...": its workers run everything.
        progress: a line on standard error.
        controller: called with the values of each run by path; returns the run's own controller, a
            function as of `simulate`. Runs are made one after the other then; one whose controller raises
            is a row with its reason. An interrupted sweep goes on where the controller's code, and the values
            that it was made with, are the same.
        period: of the controller, s of simulated time.
    """
    mapping("overrides", overrides, OVERRIDES)
    metrics = texts("metrics", metrics, "final(load/velocity)")
    if controller is not None:
        finite("period", period, "s", above=0.0)
        if not callable(controller):
            raise TypeError(f"controller: {shown(controller)}; allowed: a function of the values of a run")
    check_output(output, scene, commands)
    regular = None if output is None else find_regular_file(output)
    threads = len(os.sched_getaffinity(0)) if threads is None else whole_number("threads", threads, 1, MOST_THREADS)
    paths, values = make_design(grid, random, samples, seed)
    if not isinstance(shard, (tuple, list)) or len(shard) != 2:
        raise ValueError(f"shard: {shown(shard)}; allowed: a tuple (i, n), such as (1, 4)")
    parts = whole_number("shard", shard[1], 1)
    part = whole_number("shard", shard[0], 1, parts)
    task = Task(scene, duration, rate, times, commands, overrides, paths, values, metrics, controller, period)
    wanted = numpy.arange(len(values))[part - 1::parts]
    journal = Memory() if regular is None else Journal(
        f"{regular}.journal", task.fingerprint(values, (part, parts)), len(metrics))
    line = Progress(len(wanted), len(journal.rows), progress)

    def finished(runs, rows, reasons):
        journal.add(runs, rows, reasons)
        line.update(len(journal.rows), sum(reason != "" for reason in reasons))

    try:
        missing = numpy.array([run for run in wanted if run not in journal.rows], dtype=int)
        if scheduler is None:
            run_locally(task, values, missing, threads, finished)
        else:
            run_on_cluster(task, values, missing, scheduler, finished)
        results = numpy.array([journal.rows[run][0] for run in wanted]).reshape(len(wanted), -1)
        table = Table({"run": wanted,
                       **{path: values[wanted, i] for i, path in enumerate(paths)},
                       **{name: results[:, i] for i, name in enumerate(metrics)},
                       "reason": numpy.array([journal.rows[run][1] for run in wanted], dtype=str)})
        if output is not None:
            write_table(table, output)
        journal.remove()
        return table
    finally:
        journal.close()
