#!/usr/bin/python3
"""The first start of the node by a new user. Masters of its own on free ports."""

import os
import pathlib
import signal
import socket
import subprocess
import tempfile
import threading

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
PATIENCE = 40.0  # s


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class FirstContactTest(TestCase):

    def test_arguments_with_defaults_are_optional(self):
        for file in sorted(FOLDER.glob("launch/*.launch")):
            if file.name == "look_on.launch":
                continue  # what the others include
            with self.subTest(file=file.name):
                text = subprocess.run(["roslaunch", str(file), "--ros-args"], capture_output=True, text=True,
                                      timeout=PATIENCE, check=True).stdout
                self.assertIn("Optional Arguments:", text)
                self.assertNotIn("Required", text)

    def test_programs_are_unique(self):
        """rosrun asks which one is meant where it finds two."""
        for name in ("simulate", "variator_sim_node", "duty_cycle", "panel", "plot_bag", "ratio_controller",
                     "scene_urdf", "speed_controller", "sweep", "torque_profile"):
            with self.subTest(program=name):
                self.assertEqual(len(roslib.packages.find_node(PACKAGE, name)), 1)

    def test_the_topic_of_joint_states_is_an_argument(self):
        port = free_port()
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1",
                           "ROS_LOG_DIR": folder, "ROSCONSOLE_STDOUT_LINE_BUFFERED": "1"}
            environment.pop("ROS_HOSTNAME", None)
            launch = subprocess.Popen(
                ["roslaunch", "-p", str(port), PACKAGE, "variator_sim.launch", "name:=rig", "start_paused:=true",
                 "joint_states:=shafts"], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                text=True)
            alarm = threading.Timer(PATIENCE, launch.send_signal, [signal.SIGINT])
            alarm.start()
            try:
                line = next((line for line in launch.stdout if "ready: " in line), "")
                topics = subprocess.run(["/usr/bin/python3", "-c", "import rosgraph; print(*(t for t, _ in "
                                         "rosgraph.Master('/probe').getTopicTypes()))"], env=environment,
                                        capture_output=True, text=True, timeout=PATIENCE, check=True).stdout
            finally:
                alarm.cancel()
                launch.send_signal(signal.SIGINT)
                launch.communicate(timeout=PATIENCE)
        self.assertIn("INFO", line)
        self.assertIn("/rig: ready: shafts drive, load;", line)
        self.assertIn("/shafts", topics.split())
        self.assertNotIn("/joint_states", topics.split())


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "first_contact_test", FirstContactTest)
