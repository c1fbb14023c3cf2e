#!/usr/bin/python3
"""The node on one machine, its controller on another: two network namespaces joined by a cable.

The master and the node live at 10.77.0.1; this process is the controller, at 10.77.0.2. The
namespaces have no names and vanish with their last process. Where the kernel or the permissions
forbid them the test is skipped, with the reason in its result.
"""

import contextlib
import ctypes
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from xml.etree import ElementTree

import roslib.packages
import rosparam
import rospy
import rosunit
import yaml
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from variator_sim.msg import DrivetrainState, SimulationStatus
from variator_sim.srv import Step

PACKAGE = "variator_sim"
NAME = "two_machines_test"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SCENE = FOLDER / "test/cases/torque_steps/scene.yaml"
INSIDE = "VARIATOR_SIM_INSIDE_NAMESPACE"
NODE_IP, CONTROLLER_IP = "10.77.0.1", "10.77.0.2"
PATIENCE = 60.0  # s; only a failure takes as long
SKIPPED = 77  # ctest's SKIP_RETURN_CODE of this test
# Root needs no user namespace; another user becomes root in one of its own.
UNSHARE = ["unshare", "--net"] + (["--map-root-user"] if os.geteuid() != 0 else [])
PROBE = "ip link add name probe0 type veth peer name probe1 && unshare --net true"


def why_not():
    """Returns why this process cannot use namespaces, or ""."""
    try:
        result = subprocess.run(UNSHARE + ["sh", "-c", PROBE], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True, check=False, timeout=30)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if result.returncode == 0:
        return ""
    return f"two network namespaces are not to be had here: {result.stdout.strip()}"


def wait_for(condition, what):
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited {PATIENCE:.0f} s in vain for {what}")
        time.sleep(0.02)


def die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Machine:
    """A network namespace other than ours, with an address."""

    def __init__(self):
        self.processes = []
        # It opens the namespace and holds it open.
        self.holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"],
                                       preexec_fn=die_with_parent)
        own = os.readlink("/proc/self/ns/net")

        def is_apart():
            with contextlib.suppress(OSError):
                return os.readlink(f"/proc/{self.holder.pid}/ns/net") != own
            return False

        wait_for(is_apart, "a network namespace")

    def command(self, *words):
        return ["nsenter", f"--net=/proc/{self.holder.pid}/ns/net", *words]

    def run(self, *words):
        subprocess.run(self.command(*words), check=True)

    def spawn(self, *words, log, **environment):
        with open(log, "wb") as output:
            process = subprocess.Popen(self.command(*words), stdout=output, stderr=output,
                                       env=dict(os.environ, **environment),
                                       preexec_fn=die_with_parent)
        self.processes.append(process)
        return process

    def close(self):
        for process in reversed(self.processes):
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.holder.kill()
        self.holder.wait()


class Controller:
    """All that the node says, kept; and commands to it."""

    def __init__(self):
        self.lock = threading.Lock()
        self.states = []
        self.status = None
        self.subscribers = [
            rospy.Subscriber("/variator/state", DrivetrainState, self._keep, tcp_nodelay=True),
            rospy.Subscriber("/variator/status", SimulationStatus, self._look)]
        self.torque = rospy.Publisher("/variator/drive_torque", Float64, queue_size=1000)
        wait_for(lambda: self.status is not None and self.torque.get_num_connections() > 0
                 and self.subscribers[0].get_num_connections() > 0, "the node")

    def _keep(self, state):
        with self.lock:
            self.states.append(state)

    def _look(self, status):
        self.status = status

    def last_time(self):
        """Simulated time of the last state, s; -1 before the first one."""
        with self.lock:
            return self.states[-1].time if self.states else -1.0

    def take_states(self):
        with self.lock:
            states, self.states = self.states, []
        return states


class TwoMachinesTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.addClassCleanup(rospy.signal_shutdown, "done")
        folder = tempfile.TemporaryDirectory(prefix="variator_two_machines_")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.machine = Machine()
        cls.addClassCleanup(cls.machine.close)
        ip("link", "set", "lo", "up")
        ip("link", "add", "name", "cable", "type", "veth", "peer", "name", "cable", "netns",
           str(cls.machine.holder.pid))
        ip("address", "add", f"{CONTROLLER_IP}/24", "dev", "cable")
        ip("link", "set", "cable", "up")
        cls.machine.run("ip", "link", "set", "lo", "up")
        cls.machine.run("ip", "address", "add", f"{NODE_IP}/24", "dev", "cable")
        cls.machine.run("ip", "link", "set", "cable", "up")

        # Both users set the master's address, and the address that the other side can reach.
        os.environ["ROS_MASTER_URI"] = f"http://{NODE_IP}:11311"
        os.environ["ROS_LOG_DIR"] = folder.name
        os.environ.pop("ROS_HOSTNAME", None)
        cls.machine.spawn("rosmaster", "--core", "-p", "11311", log=cls.folder / "master.txt",
                          ROS_IP=NODE_IP)
        os.environ["ROS_IP"] = CONTROLLER_IP

        def is_up():
            with socket.socket() as probe:
                return probe.connect_ex((NODE_IP, 11311)) == 0

        wait_for(is_up, "the master")
        rosparam.upload_params("/variator", yaml.safe_load(SCENE.read_text()))
        cls.node = cls.machine.spawn(
            roslib.packages.find_node(PACKAGE, "variator_sim_node")[0], "__name:=variator",
            log=cls.folder / "node.txt", ROS_IP=NODE_IP)
        rospy.init_node("controller", disable_signals=True)
        cls.controller = Controller()

    def setUp(self):
        self.assertIsNone(self.node.poll(), (self.folder / "node.txt").read_text())

    def call(self, service, kind, *arguments):
        proxy = rospy.ServiceProxy(f"/variator/{service}", kind)
        proxy.wait_for_service(PATIENCE)
        answer = proxy(*arguments)
        self.assertTrue(answer.success, answer.message)
        return answer

    def test_nothing_is_lost(self):
        """300 states of 100 Hz and 200 commands: each arrives, once and in order."""
        controller = self.controller
        self.call("pause", Trigger)
        self.call("reset", Trigger)
        wait_for(lambda: controller.status.state == SimulationStatus.PAUSED
                 and controller.status.commands_accepted == 0, "the reset")
        start = controller.status.time
        controller.take_states()  # some of them from before a reset of time
        self.call("resume", Trigger)

        def states():
            with controller.lock:
                return [state for state in controller.states if state.time > start]

        sent = 200
        for number in range(1, sent + 1):
            controller.torque.publish(1e-3 * number)
        wait_for(lambda: controller.status.commands_accepted >= sent, f"{sent} commands")
        wait_for(lambda: len(states()) >= 300, "300 states")
        self.assertEqual(controller.status.commands_accepted, sent)
        self.assertEqual(controller.status.commands_refused, 0)
        self.assertEqual(controller.status.commands_dropped, 0)
        self.assertEqual(controller.status.samples_dropped, 0)
        states = states()
        for number, state in enumerate(states):
            self.assertEqual(state.header.seq, states[0].header.seq + number)
            # 10 ms apart on the simulated clock, from the first one on.
            self.assertAlmostEqual(state.time, start + 0.01 * (number + 1), delta=1e-6)
        # The last command is in force, and no other one.
        self.assertEqual(states[-1].applied_torque[0], 1e-3 * sent)

    def test_lockstep_gives_the_bytes_of_the_offline_tool(self):
        self.call("pause", Trigger)
        self.addCleanup(self.call, "resume", Trigger)
        self.call("reset_time", Trigger)
        proxy = rospy.ServiceProxy("/variator/step", Step, persistent=True)
        times, velocities = [], []
        for number in range(1, 51):
            answer = proxy(0.002, ["drive_torque"], [0.1 * number])
            self.assertTrue(answer.success, answer.message)
            times.append(answer.state.time)
            velocities.append(list(answer.state.velocity))
        proxy.close()
        commands = self.folder / "commands.csv"
        commands.write_text("time,topic,value\n" + "".join(
            f"{0.002 * (number - 1):.3f},drive_torque,{0.1 * number!r}\n"
            for number in range(1, 51)))
        result = subprocess.run(
            [roslib.packages.find_node(PACKAGE, "simulate")[0], SCENE, "--commands", commands,
             "--duration", "0.1", "--times", "0.1"],
            stdout=subprocess.PIPE, text=True, check=True, timeout=PATIENCE)
        header, row = [line.split(",") for line in result.stdout.splitlines()]
        self.assertEqual(times[-1], 0.1)
        for index, shaft in enumerate(("drive", "load")):
            self.assertEqual(velocities[-1][index], float(row[header.index(f"{shaft}/velocity")]))

    def test_the_link_goes_down_and_comes_back(self):
        """The node goes on alone; without a restart the controller hears and commands it again."""
        controller = self.controller
        wait_for(lambda: controller.last_time() >= 0.0, "a state")
        status = controller.status
        outage = 2.0  # s of simulated time
        ip("link", "set", "cable", "down")
        try:
            before = controller.take_states()[-1]
            # How long the cable is out: nothing is waited for.
            time.sleep(outage)
        finally:
            ip("link", "set", "cable", "up")
        wait_for(lambda: controller.last_time() > before.time + outage, "states after the outage")
        wait_for(lambda: controller.status.time > before.time + outage, "the status")

        # Simulated time went on with the wall's clock: at most what is caught up in a burst is open.
        after = controller.take_states()[-1]
        lost = controller.status.lost_wall_time - status.lost_wall_time
        wall = (after.header.stamp - before.header.stamp).to_sec()
        self.assertLess(abs(wall - lost - (after.time - before.time)), 0.3)
        # The thread that publishes did not wait for the cable.
        self.assertEqual(controller.status.samples_dropped, 0)

        torque = 7.25
        wait_for(lambda: controller.torque.get_num_connections() > 0, "the node to listen")
        controller.torque.publish(torque)

        def is_shown():
            with controller.lock:
                return bool(controller.states) and \
                    controller.states[-1].applied_torque[0] == torque

        wait_for(is_shown, "the command in a state")


def write_skip(reason):
    """The result file that rosunit does not write: skipped, with the reason."""
    for word in sys.argv:
        if not word.startswith("--gtest_output=xml:"):
            continue
        suite = ElementTree.Element("testsuite", name=NAME, tests="1", errors="0", failures="0")
        case = ElementTree.SubElement(suite, "testcase", classname=NAME, name=NAME, time="0")
        ElementTree.SubElement(case, "skipped", message=reason)
        path = pathlib.Path(word.partition(":")[2])
        path.parent.mkdir(parents=True, exist_ok=True)
        ElementTree.ElementTree(suite).write(path)


def main():
    if INSIDE not in os.environ:
        reason = why_not()
        if reason:
            print(f"SKIPPED: {reason}")
            write_skip(reason)
            return SKIPPED
        os.environ[INSIDE] = "1"
        sys.stdout.flush()
        os.execvp(UNSHARE[0], UNSHARE + [sys.executable] + sys.argv)
    rosunit.unitrun(PACKAGE, NAME, TwoMachinesTest)
    return 0


if __name__ == "__main__":
    sys.exit(main())
