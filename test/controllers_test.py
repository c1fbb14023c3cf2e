#!/usr/bin/python3
"""Closed loops of variator_sim.control: settling and overshoot in simulated time, exact in lockstep."""

import importlib.util
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosgraph
import roslib.packages
import rospy
import rostest
from std_msgs.msg import Float64
import variator_sim
from variator_sim.control import PI, DutyCycle, RatioController, SpeedController, lockstep, settling
from variator_sim.control_node import StepClient
from variator_sim.msg import NamedValues
from variator_sim.srv import GetState

from support.node_client import Listener, NodeClient, wait_for

FOLDER = roslib.packages.get_pkg_dir("variator_sim")
SHIP = FOLDER + "/config/ship.yaml"
CAR = FOLDER + "/config/applications/car.yaml"
PERIOD = 0.01  # s


def ship_controller():
    controller = SpeedController("drive", "drive_torque", p=12, i=10, minimum=-80, maximum=80,
                                 feed_forward=[-46.5, 0.7])
    controller.command = 45.0
    return controller


class Driver:
    """Closes the clutch."""

    def update(self, _time, _velocity):
        return {"clutch": 200.0}


def car_controllers():
    speed = SpeedController("wheels", "throttle", p=0.2, i=0.02, minimum=0, maximum=1,
                            feed_forward=[0.1, 0.0, 0.000045])
    speed.command = 60.0
    ratio = RatioController(["gearbox", "wheels"], "ratio", p=0.1, i=0.1, minimum=0.07, maximum=0.31)
    ratio.command = 250.0
    return [Driver(), speed, ratio]


def offline(scene):
    simulation = variator_sim.Simulation(scene)
    simulation.state()  # as a StepClient asks for: steps begin anew there
    return simulation


def ship_run(simulation):
    return list(lockstep(simulation, [ship_controller()], PERIOD, 6.0))


def car_run(simulation):
    return list(lockstep(simulation, car_controllers(), PERIOD, 25.0))


class ControllersTest(unittest.TestCase):

    def judge(self, run, shaft, target, band):
        return settling([time for time, _ in run], [velocity[shaft] for _, velocity in run], target, band)

    def test_speed_of_the_ship(self):
        here = ship_run(offline(SHIP))
        self.assertEqual(here, ship_run(StepClient("/ship")))  # to the bit
        settled, overshoot = self.judge(here, "drive", 45.0, 1.0)
        self.assertAlmostEqual(settled, 2.24, delta=0.005)
        self.assertAlmostEqual(overshoot, 4.0393, delta=1e-3)

    def test_speed_and_ratio_of_the_car(self):
        here = car_run(offline(CAR))
        self.assertEqual(here, car_run(StepClient("/car")))
        settled, overshoot = self.judge(here, "wheels", 60.0, 0.6)
        self.assertAlmostEqual(settled, 6.61, delta=0.005)
        self.assertAlmostEqual(overshoot, 0.501, delta=1e-3)
        self.assertLess(self.judge(here[1300:], "gearbox", 250.0, 2.5)[0], PERIOD)

    def test_the_node_in_lockstep_is_the_same(self):
        expected = list(lockstep(offline(SHIP), [ship_controller()], PERIOD, 6.0))[-1]
        get_state = rospy.ServiceProxy("/stepped/get_state", GetState)
        status = NodeClient("stepped", states=False)
        self.addCleanup(status.close)
        status.status.wait(lambda message: message.time > 5.9999, "the end of the run")
        state = get_state().state
        self.assertEqual((state.time, dict(zip(("drive", "load"), state.velocity))), expected)

    def test_the_node_in_real_time_is_nearly_the_same(self):
        live = NodeClient("live")
        self.addCleanup(live.close)
        told = Listener("/beside/state", NamedValues).connect()
        self.addCleanup(told.close)
        command = rospy.Publisher("/beside/command", Float64, queue_size=1, latch=True)
        command.publish(Float64(45.0))
        topics = ("/beside/command", "/live/state", "/live/drive_torque")
        wait_for(lambda: all(self.is_heard(topic) for topic in topics), "listeners")
        live.trigger("resume")
        live.states.wait(lambda state: state.time > 6.0, "6 s of motion")
        live.trigger("pause")
        states = [state for state in live.states.all() if state.time <= 6.0]
        settled, overshoot = settling([s.time for s in states], [s.velocity[0] for s in states], 45.0, 1.0)
        # Commands come a few milliseconds late, and later on a busy machine.
        self.assertLess(settled, 1.5 * 2.24)
        self.assertLess(overshoot, 1.25 * 4.04)
        last = told.all()[-1]
        self.assertEqual(last.name, ["set_point", "process_value", "error", "output"])
        self.assertEqual(last.value[0], 45.0)

    def is_heard(self, topic):
        subscribers = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])
        return any(node in ("/beside", "/live") for node in subscribers.get(topic, ()))

    def test_the_integral_does_not_wind_up(self):
        pi = PI(p=1.0, i=1.0, minimum=-1.0, maximum=1.0)
        for k in range(1000):
            self.assertEqual(pi.update(0.1 * k, 5.0, 0.0), 1.0)
        self.assertEqual(pi.update(100.0, -0.5, 0.0), -0.5 - 0.5 * (100.0 - 99.9))

    def test_time_that_goes_back_begins_anew(self):
        pi = PI(p=0.0, i=1.0, minimum=-9.0, maximum=9.0)
        for time in (0.0, 1.0, 2.0):
            pi.update(time, 1.0, 0.0)
        self.assertEqual(pi.update(0.0, 1.0, 0.0), 0.0)

    # --- what is refused ----------------------------------------------------------------------------

    GOOD = {"simulator": "/live", "shaft": "drive", "topic": "drive_torque", "p": 12, "i": 10, "minimum": -80, "maximum": 80}

    def start(self, script, *words, **changes):
        """The program with these private parameters; None takes one away."""
        values = {name: value for name, value in {**self.GOOD, **changes}.items() if value is not None}
        if script == "ratio_controller":
            values.pop("shaft", None)
        name = f"/checked_{len(self.started)}"
        self.started.append(name)
        if rospy.has_param(name):
            rospy.delete_param(name)
        rospy.set_param(name, values)
        return name, subprocess.Popen([os.path.join(FOLDER, "scripts", script), *words, "__name:=" + name[1:]],
                                      stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    started = []

    def check_refused(self, fault, *words, script="speed_controller", **changes):
        name, process = self.start(script, *words, **changes)
        text = process.communicate(timeout=60)[0]
        self.assertEqual(process.returncode, 2, text)
        self.assertNotIn("Traceback", text)
        self.assertRegex(text, fault)
        self.assertLess(text.count(name), 2, text)

    def test_parameters_are_checked(self):
        for fault, changes in (
                ("p: 'x'; allowed: a finite number; this is a text", {"p": "x"}),
                ("minimum: '-50'; .*write -50.0, without quotes", {"minimum": "-50"}),
                ("p: nan; allowed: a finite number", {"p": math.nan}),
                ("initial_command: inf; allowed: a finite number", {"initial_command": math.inf}),
                ("feed_forward: 3.0; allowed: a list of finite numbers", {"feed_forward": 3.0}),
                (r"feed_forward\[1\]: 'a'", {"feed_forward": [1.0, "a"]}),
                ("lockstep: 'maybe'; allowed: true or false", {"lockstep": "maybe"}),
                ("duration: missing; lockstep: true needs it", {"lockstep": True}),
                ("periode: no such parameter \\(did you mean 'period'\\?\\); allowed: shaft,", {"periode": 0.01}),
                ("period: -1; allowed: a finite number > 0, s", {"period": -1}),
                ("period: 0.015 s; allowed: a multiple of .* 0.01 s .*publish_rate is 100 Hz", {"period": 0.015}),
                ("missing: i, maximum; needed: shaft", {"i": None, "maximum": None}),
                ("minimum: 90 is not below maximum: 80", {"minimum": 90}),
                ("shaft: 'driv' is no shaft of /live .did you mean 'drive'.*; allowed: drive, load", {"shaft": "driv"}),
                ("topic: 'drive_torqe' is no commanded input of /live .did you mean 'drive_torque'",
                 {"topic": "drive_torqe"}),
                ("topic: 'drive_torqe' is no commanded input of /live .did you mean", {
                    "topic": "drive_torqe", "lockstep": True, "duration": 1.0})):
            with self.subTest(changes=changes):
                self.check_refused(fault, **changes)
        self.check_refused("unrecognized arguments: faster", "faster")
        for shafts in ("drive", ["drive"], [1, 2]):
            self.check_refused(r"shafts: .*; allowed: a list of two names, \[driving, driven\]", shafts=shafts,
                               script="ratio_controller")

    def test_a_simulator_that_is_not_there_is_told(self):
        _, process = self.start("speed_controller", simulator="/liv")
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)  # rospy may hang where SIGTERM comes within its own call
        line = process.stdout.readline()
        self.assertRegex(line, "waiting for /liv/scene: no drivetrain of that name runs .did you mean '/live'")

    def test_programs_that_play_files_say_what_is_missing(self):
        with tempfile.TemporaryDirectory() as folder:
            cycle, profile = pathlib.Path(folder, "cycle.csv"), pathlib.Path(folder, "profile.csv")
            cycle.write_text("time,command\n0,1\n", encoding="utf-8")
            profile.write_text("time,topic,value\n0,drive_torqe,1\n", encoding="utf-8")
            _, process = self.start("duty_cycle", str(cycle), "--controller", "/nobody", "--simulator", "/liv")
            self.addCleanup(process.stdout.close)
            self.addCleanup(process.wait)
            self.addCleanup(process.kill)
            self.assertRegex(process.stdout.readline(), "waiting for /nobody: no node of that name listens")
            self.assertRegex(process.stdout.readline(), "waiting for /liv/state: .* .did you mean '/live'")
            _, process = self.start("torque_profile", str(profile), "--seconds", "1", "--simulator", "/live")
            text = process.communicate(timeout=60)[0]
            self.assertEqual(process.returncode, 1, text)
            self.assertIn("'drive_torqe' is no commanded input of /live (did you mean 'drive_torque'?)", text)

    @unittest.skipIf(importlib.util.find_spec("visualization_msgs") is None, "python3-visualization-msgs is not installed")
    def test_markers_say_for_what_they_wait(self):
        _, process = self.start("drivetrain_markers", "--node", "/liv")
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.assertRegex(process.stdout.readline(), "waiting for /liv/scene: .* .did you mean '/live'")

    def test_commands_that_are_no_numbers_are_refused_once(self):
        name, process = self.start("speed_controller", simulator="/ship", initial_command=30)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)  # rospy may hang where SIGTERM comes within its own call
        command = rospy.Publisher(name + "/command", Float64, queue_size=10)
        wait_for(command.get_num_connections, "the controller")
        for value in (math.nan, math.inf, math.nan):
            command.publish(Float64(value))
        self.assertRegex(process.stdout.readline(), "refused on ~command: command: nan; allowed: a finite number, rad/s; "
                         "the set point stays 30")
        command.publish(Float64(31.0))
        command.publish(Float64(-math.inf))
        self.assertRegex(process.stdout.readline(), "command: -inf.*; the set point stays 31")

    def test_no_number_is_lost_in_a_controller(self):
        controller = ship_controller()
        for value in (math.nan, math.inf, "45", None):
            with self.assertRaisesRegex(ValueError, "command: .*; allowed: a finite number"):
                controller.command = value
        self.assertEqual(controller.command, 45.0)
        pi = PI(p=1.0, i=1.0, minimum=-1.0, maximum=1.0)
        pi.update(0.0, 0.1, 0.0)
        before = pi.update(1.0, 0.1, 0.0)
        self.assertEqual(pi.update(2.0, math.nan, 0.0), before)
        self.assertEqual(pi.update(3.0, math.inf, -math.inf), before)
        self.assertEqual(pi.update(4.0, math.inf, 0.0), 1.0)
        self.assertEqual(pi.update(5.0, 0.0, 0.0), 0.1)  # the integral of the first second
        controller = SpeedController("drive", "t", p=1.0, i=1.0, minimum=-1.0, maximum=1.0, feed_forward=[0.0, 0.0, 1.0])
        controller.command = 1e200
        self.assertEqual(controller.update(0.0, {"drive": 0.0}), {"t": 1.0})
        for fault in (dict(p=math.nan), dict(i=math.inf), dict(minimum=-math.inf), dict(feed_forward=[math.nan])):
            with self.subTest(fault=fault), self.assertRaisesRegex(ValueError, f"{list(fault)[0]}.*a finite number"):
                SpeedController("drive", "t", **{**dict(p=1, i=1, minimum=-1, maximum=1), **fault})
        with self.assertRaisesRegex(ValueError, "shaft: 'driv' is no shaft of the simulation .did you mean 'drive'"):
            next(lockstep(offline(SHIP), [SpeedController("driv", "drive_torque", 1, 1, -1, 1)], PERIOD, 1.0))

    def test_files_of_duty_cycles_are_checked(self):
        for text, fault in (("time,comand\n", ":1: 'time,comand' is not the header"), ("time,command\n", "no points"),
                            ("time,command\n0,nan\n", ":2: '0,nan'; allowed: two finite numbers"),
                            ("time,command\n0,1\n\n# b\n1,x\n", ":5: '1,x'"), ("time,command\n0\n", ":2: '0'"),
                            ("time,command\n0,1,2\n", ":2: '0,1,2'"),
                            ("time,command\n0,1\n0,2\n", ":3: the time 0 s does not follow 0 s")):
            with self.subTest(text=text), tempfile.TemporaryDirectory() as folder:
                path = pathlib.Path(folder, "cycle.csv")
                path.write_text(text, encoding="utf-8")
                with self.assertRaisesRegex(ValueError, "cycle.csv" + fault if fault[0] == ":" else fault):
                    DutyCycle.read(path)
                path.write_text("\ufefftime,command\r\n0,1\r\n", encoding="utf-8")
                self.assertEqual(DutyCycle.read(path)(5.0), 1.0)

    def test_duty_cycles(self):
        cycle = DutyCycle([1.0, 3.0], [10.0, 20.0])
        self.assertEqual([cycle(time) for time in (0.0, 1.0, 2.0, 3.0, 9.0)], [10.0, 10.0, 15.0, 20.0, 20.0])
        with self.assertRaises(ValueError):
            DutyCycle([1.0, 1.0], [0.0, 0.0])
        with self.assertRaisesRegex(ValueError, 'longer than'):
            DutyCycle.read('/dev/zero')


if __name__ == "__main__":
    rospy.init_node("controllers_test")
    rostest.rosrun("variator_sim", "controllers_test", ControllersTest, sys.argv)
