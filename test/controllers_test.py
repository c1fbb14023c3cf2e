#!/usr/bin/python3
"""Closed loops of variator_sim.control: settling and overshoot in simulated time, exact in lockstep."""

import sys
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
