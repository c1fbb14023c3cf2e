"""Scenes, played by every way that this package has: the Python module, machine code, sweeps,
`simulate`, saved states, emitted C. Each run is a process of its own, in a folder of its own."""
import collections
import hashlib
import json
import multiprocessing
import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings

import numpy

PRINCIPLES = ("generalized_gauss", "gauss")
ADAPTIVE = ("auto", "dopri5", "fehlberg78", "radau", "taylor")
FIXED = ("rk4", "taylor_fixed")
SOME = ("auto", "dopri5", "radau")
PATIENCE = 30  # s of a process' own time, which other processes do not change
ENDED = (-signal.SIGXCPU, -signal.SIGKILL)  # after it
# Wall times are no part of a motion; texts about what a scene does not need may be reworded.
COUNTERS = re.compile(r"^((?:steps|implicit steps|rejected steps|right-hand sides|projections|"
                      r"Newton iterations|jumps|kinks|commands \w+|samples|simulated time|rounding"
                      r").*|formulas by: machine code)", re.M)
MESSAGES = re.compile(r"^simulate: (?!note)(.*)$", re.M)

# settings: values in place of the scene's, by path
Run = collections.namedtuple("Run", "name scene commands times settings")
# cost: text of which a hash is kept
Outcome = collections.namedtuple("Outcome", "status output messages cost")


class TooLong(Exception):
    """A run that takes more than PATIENCE."""


class Work:
    """A run by one way, in a folder of its own."""

    def __init__(self, run, options, folder):
        self.run, self.folder = run, folder
        self.program, self.cache = options.program, options.cache
        self.scene = folder / "scene.yaml"
        self.scene.write_text(run.scene)
        self.commands = folder / "commands.csv" if run.commands else None
        if self.commands:
            self.commands.write_text(run.commands)

    def settings(self, machine_code):
        return dict(self.run.settings, **{"solver/machine_code": machine_code})

    def python(self, function):
        """Outcome of `function`, which returns (columns, rows, cost) with the Python module."""
        import variator_sim
        status, rows, said = 0, ([], [], ""), []
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                rows = function(variator_sim)
            except variator_sim.MotionStopped as error:
                status, said = 1, [str(error)]
                rows = error.result.columns, error.result.values.tolist(), ""
            except ValueError as error:  # of the scene
                status, said = 2, [str(error)]
        said += [f"warning: {warning.message}" for warning in told]
        lines = [",".join(rows[0]), *(",".join(map(repr, row)) for row in rows[1])]
        messages = "; ".join(said).replace(str(self.folder), "")
        return Outcome(status, "\n".join(lines), messages, rows[2])

    def call(self, *words):
        done = subprocess.run([str(word) for word in words], capture_output=True, text=True,
                              check=False, cwd=self.folder)
        if done.returncode in ENDED:
            raise TooLong
        return done

    def simulate(self, *words):
        commands = ["--commands", self.commands] if self.commands else []
        done = self.call(self.program, self.scene, *commands, *words,
                         *(word for path, value in self.settings("never").items()
                           for word in ("--set", f"{path}={value}")))
        said = done.stderr.replace(str(self.folder), "")
        return Outcome(done.returncode, done.stdout, "; ".join(MESSAGES.findall(said)),
                       "\n".join(COUNTERS.findall(said)))

    def sampled(self, *words):
        return self.simulate("--times", ",".join(map(repr, self.run.times)), "--stats", "--energy",
                             *words)


def play_module(work, machine_code="never"):
    def play(variator_sim):
        settings = work.settings(machine_code)
        code = variator_sim.Simulation(work.scene, settings).machine_code
        result = variator_sim.simulate(work.scene, times=work.run.times, commands=work.commands,
                                       columns="state,energy", overrides=settings)
        is_compiled = code.startswith("machine code")
        return result.columns, result.values.tolist(), f"{is_compiled} {result.statistics}"
    return work.python(play)


def play_kernel(work):
    return play_module(work, "always")


def play_sweep(work):
    def play(variator_sim):
        simulation = variator_sim.Simulation(work.scene, work.settings("never"))
        shaft = simulation.shafts[0]
        inertia = simulation.scene[shaft]["inertia"]
        path = f"{shaft}/inertia" + ("/mean" if isinstance(inertia, dict) else "")
        inertia = inertia["mean"] if isinstance(inertia, dict) else inertia
        rows = numpy.array([[float(inertia) * (1.0 + 0.03 * n)] for n in range(10)])
        metrics = [f"{kind}({column})" for column in simulation.columns("state,energy")[1:]
                   for kind in ("final", "max")]
        task = variator_sim.sweeps.Task(work.scene, None, 100.0, work.run.times, work.commands,
                                        work.settings("always"), [path], rows, metrics)
        values, reasons = task.run(rows, 1, True)
        return metrics, values.tolist() + [[reason] for reason in reasons], ""
    return work.python(play)


def play_program(work):
    return work.sampled()


def play_error(work):
    return work.sampled("--error")


def play_states(work):
    """Samples of a run that saves its state, the state, and samples of a run from there."""
    times, state = work.run.times, work.folder / "state.yaml"
    middle = 0.5 * (times[len(times) // 2 - 1] + times[len(times) // 2])
    saving = work.sampled("--save-state", state, "--save-at", repr(middle))
    if not state.exists():
        return saving
    later = [repr(time) for time in times if time > middle]
    going_on = work.simulate("--from-state", state, "--times", ",".join(later), "--stats")
    return Outcome(going_on.status, saving.output + state.read_text() + going_on.output,
                   going_on.messages, saving.cost + going_on.cost)


def play_c(work):
    emitted = work.folder / "emitted"
    outcome = work.simulate("--emit-c", emitted)
    if outcome.status != 0:
        return outcome
    text = (emitted / "scene.c").read_text() + (emitted / "main.c").read_text()
    player = pathlib.Path(work.cache) / f"player_{digest(text)}"
    if not player.exists():
        made = player.with_name(f"{player.name}_{os.getpid()}")
        done = work.call("cc", "-std=c99", "-O1", "-ffp-contract=off", "-o", made,
                         emitted / "main.c", emitted / "scene.c", "-lm")
        if done.returncode != 0:
            return Outcome(done.returncode, "", done.stderr, text)
        made.rename(player)
    end = work.run.times[-1]
    commands = ["--commands", work.commands] if work.commands else []
    done = work.call(player, "--duration", end, "--rate", 9.7 / end, *commands)
    return Outcome(done.returncode, done.stdout, done.stderr.strip(), text)


# share: one of so many random scenes. Paths that need a compiler run a scene by one principle.
Way = collections.namedtuple("Way", "play principles steppers share")
WAYS = {
    "interpreter": Way(play_module, PRINCIPLES, ADAPTIVE + FIXED, 1),
    "kernel": Way(play_kernel, ("its own",), SOME, 10),
    "sweep": Way(play_sweep, ("its own",), ("auto",), 10),
    "program": Way(play_program, ("its own",), ("auto",), 10),
    "error": Way(play_error, ("its own",), SOME, 5),
    "states": Way(play_states, ("its own",), SOME, 5),
    "c": Way(play_c, ("its own",), ("auto",), 10),
}
OF_MODULE = {"interpreter", "kernel", "sweep"}
OF_REFERENCES = ("interpreter", "kernel", "program", "error")  # samples at the instants of the run


def digest(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def play_here(way, run, options, folder, writer):
    """Writes the Outcome, or null for a run that takes too long, and ends this process."""
    status = 1
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
        try:
            outcome = WAYS[way].play(Work(run, options, pathlib.Path(folder)))
        except TooLong:
            outcome = None
        with os.fdopen(writer, "w") as pipe:
            json.dump(outcome, pipe)
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)


def play(job):
    """(way, run, Outcome). In a child process: one that crashes, or is ended, ends nothing else."""
    way, run, options = job
    with tempfile.TemporaryDirectory(prefix="golden_") as folder:
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reader)
            play_here(way, run, options, folder, writer)
        os.close(writer)
        with os.fdopen(reader) as pipe:
            text = pipe.read()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status in ENDED:
        return way, run, None
    outcome = json.loads(text) if status == 0 else [status, "", "crashed", ""]
    return way, run, outcome and Outcome(*outcome)


def play_all(jobs, options):
    with multiprocessing.Pool(options.processes) as pool:
        for n, done in enumerate(pool.imap(play, jobs, chunksize=4), 1):
            if n % 200 == 0:
                print(f"{n} of {len(jobs)} runs", file=sys.stderr)
            yield done


def prepare(options):
    """The common part of all runs, prepared before processes start."""
    pathlib.Path(options.cache).mkdir(mode=0o700, parents=True, exist_ok=True)
    os.environ["VARIATOR_SIM_CACHE"] = options.cache
    if OF_MODULE.intersection(options.ways):
        modules = pathlib.Path(options.program).resolve().parents[1] / "python3/dist-packages"
        sys.path.insert(0, str(modules))
        import variator_sim
        variator_sim.Simulation("{shafts: [a], a: {inertia: 1.0}}")  # loads the plugins
