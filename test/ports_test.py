#!/usr/bin/python3
"""Access to a running node: on which addresses its ports and a master's are open, and what the launch
files ask for (doc/evidence.md)."""

import os
import pathlib
import signal
import socket
import subprocess
import tempfile
import time
from unittest import mock

import roslaunch.config
import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
PATIENCE = 60.0  # s; only a failure takes as long
LOOPBACK = "127.0.0.1"
LISTENS = "0A"  # in /proc/net/tcp
PLACES = ("ROS_IP", "ROS_HOSTNAME", "ROS_MASTER_URI")


def environment(**places):
    return {**{name: value for name, value in os.environ.items() if name not in PLACES}, **places}


def free_port():
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


def listening(process):
    """The IPv4 addresses on which `process` has open ports, each with its port."""
    sockets = set()
    for file in pathlib.Path(f"/proc/{process.pid}/fd").iterdir():
        try:
            sockets.add(os.readlink(file))
        except FileNotFoundError:
            pass  # closed meanwhile
    found = []
    for line in pathlib.Path(f"/proc/{process.pid}/net/tcp").read_text(encoding="ascii").splitlines()[1:]:
        words = line.split()
        if words[3] == LISTENS and f"socket:[{words[9]}]" in sockets:
            address, port = words[1].split(":")
            found.append((socket.inet_ntoa(bytes.fromhex(address)[::-1]), int(port, 16)))
    return found


class PortsTest(TestCase):

    def start(self, words, ports, **places):
        """A process; and its open ports, as soon as there are that many."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   env=environment(ROS_LOG_DIR=folder.name, **places))
        self.addCleanup(process.wait)
        self.addCleanup(process.send_signal, signal.SIGINT)
        end = time.monotonic() + PATIENCE
        while len(listening(process)) < ports:
            self.assertIsNone(process.poll(), words)
            self.assertLess(time.monotonic(), end, f"{words} opens no {ports} ports")
            time.sleep(0.02)
        return listening(process)

    def test_ports_are_open_where_the_environment_says(self):
        node = roslib.packages.find_node(PACKAGE, "variator_sim_node")[0]
        for places, is_local in (({"ROS_IP": LOOPBACK}, True), ({"ROS_HOSTNAME": "localhost"}, True),
                                 ({"ROS_HOSTNAME": LOOPBACK}, True), ({}, False),
                                 ({"ROS_HOSTNAME": socket.gethostname()}, False)):
            with self.subTest(places=places):
                port = free_port()
                uri = f"http://{LOOPBACK}:{port}"
                master = self.start(["rosmaster", "--core", "-p", str(port)], 1, ROS_MASTER_URI=uri, **places)
                self.assertEqual(master, [(LOOPBACK if is_local else "0.0.0.0", port)])
                subprocess.run(["rosparam", "load", FOLDER / "config/ship.yaml", "/guarded"], check=True,
                               timeout=PATIENCE, env=environment(ROS_MASTER_URI=uri, **places))
                # One of XML-RPC, one of topics and services.
                ports = self.start([node, "__name:=guarded"], 2, ROS_MASTER_URI=uri, **places)
                self.assertEqual({address for address, _ in ports}, {LOOPBACK if is_local else "0.0.0.0"})

    def test_launch_files_open_ports_to_others_only_when_told(self):
        bench = "http://bench:11311"
        cases = (
            ({}, [], True),
            ({"ROS_MASTER_URI": "http://localhost:11311"}, [], True),
            ({"ROS_MASTER_URI": "http://127.0.0.1:11312/"}, [], True),
            ({}, ["loopback:=false"], False),
            ({"ROS_IP": "192.168.7.1"}, [], False),
            ({"ROS_HOSTNAME": "bench"}, [], False),
            ({"ROS_MASTER_URI": bench}, [], False),
            ({"ROS_MASTER_URI": bench, "ROS_HOSTNAME": "bench"}, ["loopback:=true"], True),
        )
        for file in sorted(FOLDER.glob("launch/*.launch")):
            if file.name == "look_on.launch":
                continue  # what the others include
            for places, arguments, is_local in cases:
                with self.subTest(file=file.name, places=places, arguments=arguments):
                    with mock.patch.dict(os.environ, environment(**places), clear=True):
                        config = roslaunch.config.load_config_default(
                            [(str(file), ["panel:=true", *arguments])], None, assign_machines=False)
                    self.assertGreaterEqual(len(config.nodes), 2)
                    for node in config.nodes:
                        self.assertEqual(dict(node.env_args).get("ROS_HOSTNAME"),
                                         "localhost" if is_local else None, node.name)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "ports_test", PortsTest)
