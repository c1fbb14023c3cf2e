#!/usr/bin/python3
"""Runs the real-time benchmark: the node beside bare programs, in turn, under a master of its own.

Writes one CSV row per measurement; realtime_tables.py makes the tables. Needs the package's
environment (. devel/setup.bash) and the programs of the CMake target realtime_benchmarks;
scripts/benchmark_realtime does all of that.
"""

import argparse
import contextlib
import csv
import ctypes
import datetime
import logging
import os
import pathlib
import platform
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

import rosparam
import rospy
import yaml
from variator_sim.msg import SimulationStatus

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmark"))
import document  # noqa: E402: benchmark/document.py

SHIP = ROOT / "config/ship.yaml"  # its ratio sways: it never comes to rest
TORQUE_STEPS = ROOT / "test/cases/torque_steps/scene.yaml"  # the drive shaft's torque is the command
PATIENCE = 60.0  # s; only a failure takes as long
SETTLE = 1.5  # s after a process goes on: longer than the window of its lateness
DRIVETRAINS = 20
NODELET = "variator_sim/VariatorNodelet"
COLUMNS = ["row", "variant", "round", "quantity", "value", "unit"]


class Failure(Exception):
    """The benchmark cannot go on."""


def wait_for(condition, what):
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise Failure(f"waited {PATIENCE:.0f} s in vain for {what}")
        time.sleep(0.02)


def die_with_parent(signal_number):
    """Returns a function for a child to call before its program starts: it then dies with this one."""
    libc = ctypes.CDLL(None)

    def call():
        libc.prctl(1, signal_number)  # PR_SET_PDEATHSIG

    return call


def cpu_seconds(process):
    """Processor time of all threads of a process, in ns resolution."""
    return time.clock_gettime((~process.pid << 3) | 2)  # its CPU clock, as in clock_getcpuclockid


def memory(process):
    """Resident memory, and the part of it that no file backs, MB."""
    fields = {}
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        key, _, value = line.partition(":")
        fields[key] = value
    return tuple(int(fields[key].split()[0]) / 1024 for key in ("VmRSS", "RssAnon"))


class StatusLog:
    """Records one node's ~status, with the instants of arrival."""

    def __init__(self, name):
        self.received = []
        self._subscriber = rospy.Subscriber(f"/{name}/status", SimulationStatus, self._keep)

    def _keep(self, message):
        self.received.append((time.monotonic(), message))

    def between(self, begin, end):
        return [message for instant, message in list(self.received) if begin <= instant <= end]

    def close(self):
        self._subscriber.unregister()


class Session:
    """A master, the processes under it, the rows measured."""

    def __init__(self, arguments, folder):
        self.quick = arguments.quick
        self.flood_seconds = arguments.flood_seconds
        self.programs = arguments.devel / "lib/variator_sim"
        self.folder = folder
        self.rows = []
        self.processes = []
        self.roscore = None

    def start_master(self):
        with socket.socket() as probe:
            probe.bind(("localhost", 0))
            port = probe.getsockname()[1]
        os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
        os.environ["ROS_LOG_DIR"] = str(self.folder / "log")
        os.environ.pop("ROS_HOSTNAME", None)
        os.environ["ROS_IP"] = "127.0.0.1"
        with open(self.folder / "roscore.txt", "wb") as log:
            # It gets a process group of its own, since roscore starts others.
            self.roscore = subprocess.Popen(
                ["roscore", "-p", str(port)], stdout=log, stderr=log, start_new_session=True,
                preexec_fn=die_with_parent(signal.SIGTERM))

        def is_up():
            with socket.socket() as probe:
                return probe.connect_ex(("localhost", port)) == 0

        wait_for(is_up, "roscore")
        rospy.init_node("realtime_benchmark", disable_signals=True)
        # So that the log does not fill with services found.
        logging.getLogger("rosout").setLevel(logging.ERROR)

    def close(self):
        self.stop_all()
        rospy.signal_shutdown("done")
        if self.roscore is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.roscore.pid, signal.SIGTERM)
            try:
                self.roscore.wait(10)
            except subprocess.TimeoutExpired:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self.roscore.pid, signal.SIGKILL)

    def spawn(self, *command, pinned=None, **options):
        command = [str(word) for word in command]
        if pinned is not None:
            command = ["taskset", "-c", str(pinned)] + command
        name = f"{len(self.processes):03d}"
        with open(self.folder / f"{name}.txt", "wb") as output:
            process = subprocess.Popen(command, stdout=options.pop("stdout", output),
                                       stderr=subprocess.STDOUT,
                                       preexec_fn=die_with_parent(signal.SIGKILL), **options)
        process.output = self.folder / f"{name}.txt"
        self.processes.append(process)
        return process

    def spawn_peer(self, program, *arguments, name=None, **options):
        words = [f"__name:={name}"] if name else []
        return self.spawn(self.programs / "realtime" / program, *arguments, *words, **options)

    def load(self, name, scene, **parameters):
        """A scene and node parameters for the node `name`; nothing of an earlier node remains."""
        with contextlib.suppress(KeyError):
            rospy.delete_param(f"/{name}")
        rosparam.upload_params(f"/{name}", yaml.safe_load(scene.read_text()) | parameters)

    def spawn_node(self, name, scene, **parameters):
        self.load(name, scene, **parameters)
        process = self.spawn(self.programs / "variator_sim_node", f"__name:={name}")
        rospy.wait_for_service(f"/{name}/step", PATIENCE)
        return process

    def spawn_sink(self, *topics):
        sink = self.spawn_peer("sink", *topics, name="sink")
        wait_for(lambda: "all heard" in sink.output.read_text(), "states on " + ", ".join(topics))
        return sink

    def stop(self, *processes):
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.send_signal(signal.SIGCONT)
        for process in processes:
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def stop_all(self):
        self.stop(*(process for process in self.processes if process.poll() is None))

    def check_alive(self, *processes):
        for process in processes:
            if process.poll() is not None:
                raise Failure(f"{process.args} ended: {process.output.read_text()}")

    def add(self, row, variant, number, quantity, value, unit):
        self.rows.append([row, variant, number, quantity, f"{value:.9g}", unit])

    def in_turn(self, peers, rounds, span, measure):
        """One of the peers (name: its processes) runs at a time, the others are stopped meanwhile.

        measure(name, round, begin, end) is called after its span (s); begin and end are instants of
        (time.monotonic(), the processes' CPU time).
        """
        def send(processes, signal_number):
            for process in processes:
                process.send_signal(signal_number)

        def instant(processes):
            return time.monotonic(), sum(cpu_seconds(process) for process in processes)

        for processes in peers.values():
            send(processes, signal.SIGSTOP)
        for number in range(rounds):
            names = list(peers)
            for name in names if number % 2 == 0 else reversed(names):
                processes = peers[name]
                send(processes, signal.SIGCONT)
                time.sleep(SETTLE)
                begin = instant(processes)
                time.sleep(span)
                end = instant(processes)
                send(processes, signal.SIGSTOP)
                self.check_alive(*processes)
                measure(name, number, begin, end)

    def add_cpu(self, row, peers):
        def measure(name, number, begin, end):
            share = (end[1] - begin[1]) / (end[0] - begin[0])
            self.add(row, name, number, "cpu", 1e3 * share, "ms/s")

        self.in_turn(peers, 3 if self.quick else 10, 2 if self.quick else 5, measure)


def cpu_subscribed(session):
    """CPU time at 1 kHz ticks, 100 Hz state, one subscriber."""
    peers = {"variator": [session.spawn_node("variator", SHIP)],
             "bare": [session.spawn_peer("bare_publisher", 1000, 100, name="bare")]}
    session.spawn_sink("/variator/state", "/bare/state")
    session.add_cpu("cpu_subscribed", peers)


def cpu_panel(session):
    """CPU time of a node that a panel shows, of one with one subscriber, of one with none."""
    peers = {"variator": [session.spawn_node("variator", SHIP)],
             "subscribed": [session.spawn_node("subscribed", SHIP)],
             "alone": [session.spawn_node("alone", SHIP)]}
    session.spawn_sink("/subscribed/state")
    panel = session.spawn(ROOT / "scripts/panel", "--node", "/variator", "--port", 0)
    wait_for(lambda: "http://" in panel.output.read_text(), "the panel")
    columns = [f"{shaft}/{quantity}" for shaft in ("drive", "load") for quantity in
               ("velocity", "applied_torque", "acceleration", "reaction_torque")]
    page = session.spawn(ROOT / "benchmark/realtime/page.py",
                         panel.output.read_text().split()[-1], ",".join(columns))
    wait_for(lambda: "looking" in page.output.read_text(), "frames of the panel")
    session.add_cpu("cpu_panel", peers)


def cpu_alone(session):
    """CPU time at 1 kHz without subscribers."""
    peers = {"variator": [session.spawn_node("variator", SHIP)],
             "bare": [session.spawn_peer("bare_loop", 1000)],
             "ros": [session.spawn_peer("bare_publisher", 1000, name="bare")]}
    session.add_cpu("cpu_alone", peers)


def read_seconds(process, begin, end):
    """Lines of bare_loop --report of seconds within [begin, end]."""
    rows = [[float(word) for word in line.split()]
            for line in process.output.read_text().splitlines()]
    return [row for row in rows if row[0] >= begin and row[1] <= end]


def lateness(session):
    """How late ticks begin at 1 kHz and 5 kHz; states go to a subscriber meanwhile."""
    peers = {}
    logs = {}
    for rate in (1000, 5000):
        peers[f"variator {rate}"] = [session.spawn_node(f"variator_{rate}", SHIP, tick_rate=rate)]
        logs[f"variator {rate}"] = StatusLog(f"variator_{rate}")
        peers[f"bare {rate}"] = [session.spawn_peer("bare_loop", rate, 1, "--report")]
    session.spawn_sink("/variator_1000/state", "/variator_5000/state")

    def measure(name, number, begin, end):
        variant, rate = name.split()
        time.sleep(0.1)  # the last line may be under way
        if variant == "bare":
            seconds = [row[4:6] for row in read_seconds(*peers[name], begin[0], end[0])]
        else:
            seconds = [(message.lateness_p50, message.lateness_p99)
                       for message in logs[name].between(begin[0], end[0])]
        if not seconds:
            raise Failure(f"{name}: no lateness between {begin[0]} and {end[0]} s")
        for quantity, values in zip(("p50", "p99"), zip(*seconds)):
            session.add(f"lateness_{rate}", variant, number, quantity,
                        1e6 * statistics.median(values), "us")

    session.in_turn(peers, 3 if session.quick else 10, 3.5 if session.quick else 6.5, measure)
    for log in logs.values():
        log.close()


def run_probe(session, *command):
    """The output of a probe, in rows of words."""
    probe = session.spawn(*command)
    try:
        status = probe.wait(600)
    except subprocess.TimeoutExpired as error:
        raise Failure(f"{command[0]} did not come to its end") from error
    text = probe.output.read_text()
    if status != 0:
        raise Failure(f"{command[0]}: {text}")
    return [line.split() for line in text.splitlines()]


def add_probe(session, row, output, names):
    """Lines of "round, name, median, 99th percentile" in s."""
    for number, name, *values in output:
        for quantity, value in zip(("p50", "p99"), values):
            session.add(row, names[name], int(number), quantity, 1e6 * float(value), "us")


def latency(session):
    """From a command to the first state that shows it, ticks and states at 1 kHz."""
    session.spawn_node("variator", TORQUE_STEPS, publish_rate=1000)
    session.spawn_peer("echo_node", name="echo")
    output = run_probe(session, session.programs / "realtime/latency_probe",
                       3 if session.quick else 10, 100 if session.quick else 400,
                       "/variator", "/echo")
    add_probe(session, "latency", output, {"/variator": "variator", "/echo": "echo"})


def step(session):
    """One ~step of 1 ms against services that do nothing."""
    session.spawn_node("variator", SHIP, start_paused=True)
    session.spawn_peer("trigger_server", name="trigger")
    counts = (4, 500) if session.quick else (20, 1000)
    names = {"step": "variator", "trigger": "trigger", "idle": "idle"}
    for language, program in (("cpp", session.programs / "realtime/step_probe"),
                              ("python", ROOT / "benchmark/realtime/step_probe.py")):
        add_probe(session, f"step_{language}", run_probe(session, program, *counts), names)


def resident_memory(session):
    """Memory with one subscriber, some seconds after the start."""
    for number in range(2 if session.quick else 5):
        node = session.spawn_node("variator", SHIP)
        bare = session.spawn_peer("bare_publisher", 1000, 100, name="bare")
        sink = session.spawn_sink("/variator/state", "/bare/state")
        time.sleep(3)
        for variant, process in (("variator", node), ("bare", bare)):
            for quantity, value in zip(("resident", "anonymous"), memory(process)):
                session.add("memory", variant, number, quantity, value, "MB")
        session.stop(sink, node, bare)


def spawn_nodelets(session, names, core):
    """The process of a manager on one core, with a nodelet for each name."""
    manager = session.spawn("rosrun", "nodelet", "nodelet", "manager", "__name:=manager",
                            pinned=core)
    rospy.wait_for_service("/manager/load_nodelet", PATIENCE)
    for name in names:
        session.load(name, SHIP)
        loader = session.spawn("rosrun", "nodelet", "nodelet", "load", NODELET, "/manager",
                               "--no-bond", f"__name:={name}")
        rospy.wait_for_service(f"/{name}/step", PATIENCE)
        session.stop(loader)
    return [manager]


def run_on(cores):
    """All threads of this process, and the children to come."""
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(int(thread), cores)


def drivetrains(session):
    """Many drivetrains on one core, in one nodelet manager, against as many loops in one process."""
    everywhere = os.sched_getaffinity(0)
    core = max(everywhere)
    run_on(everywhere - {core} or everywhere)  # we listen to the status of all
    try:
        names = [f"drivetrain_{i:02d}" for i in range(DRIVETRAINS)]
        processes = spawn_nodelets(session, names, core)
        logs = {name: StatusLog(name) for name in names}
        wait_for(lambda: all(log.received for log in logs.values()), "the status of all")
        peers = {"variator": processes,
                 "bare": [session.spawn_peer("bare_loop", 1000, DRIVETRAINS, "--report",
                                             pinned=core)],
                 "one loop": [session.spawn_peer("bare_loop", 1000, 1, "--report", pinned=core)]}

        def measure(name, number, begin, end):
            time.sleep(0.1)  # the last line may be under way
            if name == "variator":
                ticks = overruns = 0
                p50 = []
                for log in logs.values():
                    statuses = log.between(begin[0], end[0])
                    if len(statuses) < 2:
                        raise Failure("a drivetrain is silent")
                    ticks += statuses[-1].ticks - statuses[0].ticks
                    overruns += statuses[-1].overruns - statuses[0].overruns
                    p50 += [status.lateness_p50 for status in statuses]
            else:
                seconds = read_seconds(*peers[name], begin[0], end[0])
                ticks = sum(row[2] for row in seconds)
                overruns = sum(row[3] for row in seconds)
                p50 = [row[4] for row in seconds]
            session.add("drivetrains", name, number, "overruns", 1e3 * overruns / ticks,
                        "per 1000 ticks")
            session.add("drivetrains", name, number, "p50", 1e6 * statistics.median(p50), "us")
            session.add("drivetrains", name, number, "cpu",
                        1e3 * (end[1] - begin[1]) / (end[0] - begin[0]), "ms/s")

        session.in_turn(peers, 3 if session.quick else 20, 3.5 if session.quick else 4, measure)
        for log in logs.values():
            log.close()
    finally:
        run_on(everywhere)


def flood(session):
    """Commands at 10 kHz, states at 1 kHz for a subscriber that has stopped reading."""
    node = session.spawn_node("variator", TORQUE_STEPS, publish_rate=1000)
    log = StatusLog("variator")
    sink = session.spawn_sink("/variator/state")
    commander = session.spawn_peer("commander", "/variator/drive_torque", 10000, name="commander",
                                   stdin=subprocess.PIPE)
    wait_for(lambda: log.received and log.received[-1][1].commands_accepted > 0, "commands")
    sink.send_signal(signal.SIGSTOP)
    # Until the socket's buffers and the queue of states are full.
    time.sleep(5 if session.quick else 20)
    first = log.received[-1][1]
    end = time.monotonic() + session.flood_seconds
    begin = time.monotonic()
    number = 0
    while time.monotonic() < end:
        time.sleep(max(0.0, min(begin + number + 1, end) - time.monotonic()))
        session.check_alive(node, commander)
        resident, anonymous = memory(node)
        session.add("flood", "variator", number, "resident", resident, "MB")
        session.add("flood", "variator", number, "anonymous", anonymous, "MB")
        number += 1
    last = log.received[-1][1]
    commander.stdin.close()
    commander.wait(10)
    sent = int(commander.output.read_text())
    wait_for(lambda: log.received[-1][1].commands_accepted + log.received[-1][1].commands_dropped
             == sent or log.received[-1][0] > end + 5, "the last command")
    final = log.received[-1][1]
    wall = (last.header.stamp - first.header.stamp).to_sec()
    for quantity, value, unit in (
            ("seconds", wall, "s"),
            ("ticks", last.ticks - first.ticks, ""),
            ("ticks lost", 1e3 * (last.lost_wall_time - first.lost_wall_time), ""),
            ("overruns", last.overruns - first.overruns, ""),
            ("states dropped", last.samples_dropped - first.samples_dropped, ""),
            ("commands sent", sent, ""),
            ("commands accepted", final.commands_accepted, ""),
            ("commands dropped", final.commands_dropped, "")):
        session.add("flood", "variator", 0, quantity, value, unit)
    log.close()


ROWS = {"cpu_subscribed": cpu_subscribed, "cpu_panel": cpu_panel, "cpu_alone": cpu_alone,
        "lateness": lateness, "latency": latency, "step": step, "memory": resident_memory,
        "drivetrains": drivetrains, "flood": flood}


def first_line(*command):
    try:
        return subprocess.run(command, stdout=subprocess.PIPE, text=True,
                              check=False).stdout.splitlines()[0]
    except (OSError, IndexError):
        return "unknown"


def head(arguments):
    return [f"processor: {document.processor_name()}", f"cores: {os.cpu_count()}",
            f"kernel: {platform.release()}, {platform.machine()}",
            f"compiler: {first_line('c++', '--version')}",
            f"roscpp: {first_line('rosversion', 'roscpp')}",
            f"date: {datetime.date.today()}", f"commit: {arguments.commit}",
            f"run: {'quick' if arguments.quick else 'full'}",
            f"load average of the last minute at the start: {os.getloadavg()[0]:.1f}"]


def write(path, lines, rows):
    with open(path, "w", newline="") as file:
        for line in lines:
            file.write(f"# {line}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few rounds, short spans")
    parser.add_argument("--rows", default=",".join(ROWS), help="only these, with commas between: "
                        + ", ".join(ROWS))
    parser.add_argument("--flood-seconds", type=float, help="default 600, with --quick 20")
    parser.add_argument("--devel", type=pathlib.Path, default=ROOT / "devel",
                        help="the devel space of the build")
    parser.add_argument("--commit", default="unknown")
    parser.add_argument("--output", type=pathlib.Path, required=True, help="CSV file")
    arguments = parser.parse_args()
    unknown = [row for row in arguments.rows.split(",") if row not in ROWS]
    if unknown:
        parser.error(f"'{unknown[0]}' is not a row; there are: {', '.join(ROWS)}")
    if arguments.flood_seconds is None:
        arguments.flood_seconds = 20.0 if arguments.quick else 600.0
    return arguments


def main():
    arguments = parse_arguments()
    # Killed politely, we still stop what we have started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    lines = head(arguments)
    write(arguments.output, lines, [])
    status = 0
    with tempfile.TemporaryDirectory(prefix="variator_realtime_") as folder:
        session = Session(arguments, pathlib.Path(folder))
        try:
            session.start_master()
            for row in arguments.rows.split(","):
                print(f"{row}: {ROWS[row].__doc__.splitlines()[0]}", flush=True)
                try:
                    ROWS[row](session)
                except Failure as failure:
                    print(f"run_realtime.py: {row}: {failure}", file=sys.stderr)
                    status = 1
                finally:
                    # An interrupted run leaves what it has.
                    write(arguments.output, lines, session.rows)
                session.stop_all()
        finally:
            session.close()
    return status


if __name__ == "__main__":
    sys.exit(main())
