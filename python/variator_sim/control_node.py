"""The controllers of variator_sim.control as nodes, with the habits of ros_control.

    <node pkg="variator_sim" type="speed_controller" name="speed_controller">
      <rosparam> {simulator: /variator, shaft: drive, topic: drive_torque, period: 0.01,
                  p: 12, i: 10, minimum: -80, maximum: 80} </rosparam>
    </node>

The set point comes on `~command` (std_msgs/Float64), `~state` (variator_sim/NamedValues) tells set point, process value,
error and output. The node reads the simulator's `~state` and publishes on the topics of its inputs. With `lockstep: true`
it calls the paused simulator's `~step` instead, for `duration` s.
"""

import argparse
import sys
import threading

import rospy
from std_msgs.msg import Float64
from variator_sim import checks
from variator_sim.control import DutyCycle, check_names, lockstep
from variator_sim.msg import DrivetrainState, NamedValues
from variator_sim.nodes import PATIENCE, wait_for_scene
from variator_sim.srv import GetState, Step


def number(what, value):
    return checks.finite(what, value)


def positive(what, value):
    return checks.finite(what, value, "s", above=0.0)


def file_name(what, value):
    """A path; "" as launch files have it: none."""
    return checks.name(what, value) if value != "" else None


# Parameters of every controller: how they are checked, and their default.
COMMON = {"simulator": (checks.name, "/variator"), "period": (positive, 0.01), "initial_command": (number, 0.0),
          "duty_cycle": (file_name, None), "lockstep": (checks.flag, False), "duration": (positive, None)}


class StepClient:
    """A paused simulator as variator_sim.Simulation looks: commands, and steps by its service ~step."""

    def __init__(self, simulator):
        scene = wait_for_scene(simulator)
        self.shafts, self.topics = list(scene.shafts), list(scene.inputs)
        rospy.wait_for_service(f"{simulator}/step", PATIENCE)
        self._step = rospy.ServiceProxy(f"{simulator}/step", Step, persistent=True)
        # Steps begin anew where a state is saved: a Simulation whose state() was asked for is the same to the bit.
        answer = rospy.ServiceProxy(f"{simulator}/get_state", GetState)()
        if not answer.success:
            raise RuntimeError(f"{simulator}: {answer.message}")
        self._state = answer.state
        self._commands = {}

    def sample(self):
        return self._state

    def command(self, topic, value):
        self._commands[topic] = value

    def advance_to(self, time):
        answer = self._step(time - self._state.time, list(self._commands), list(self._commands.values()))
        if not answer.success:
            raise RuntimeError(answer.message)
        self._commands = {}
        self._state = answer.state


def check_period(period, simulator):
    """Of a controller that sees the states of a simulator that runs: between two of them others would be skipped."""
    rate = rospy.get_param(f"{simulator}/publish_rate", min(100.0, rospy.get_param(f"{simulator}/tick_rate", 1000.0)))
    factor = rospy.get_param(f"{simulator}/real_time_factor", 1.0)
    if not factor > 0.0:  # as fast as possible: states come at no fixed simulated time
        return
    states = period * rate / factor
    if round(states) < 1 or abs(states - round(states)) > 1e-6 * states:
        raise ValueError(f"period: {period:g} s; allowed: a multiple of the time between two states of {simulator}, "
                         f"{factor / rate:g} s (its publish_rate is {rate:g} Hz, its real_time_factor {factor:g}), such as "
                         f"{max(1, round(states)) * factor / rate:g}")


class ControlNode:
    """Runs one controller, beside a simulator that runs, or in lockstep with one that is paused."""

    def __init__(self, controller, simulator, period, initial_command, duty_cycle, lockstep, duration):
        if lockstep and duration is None:
            raise ValueError("duration: missing; lockstep: true needs it, s")
        self._controller = controller
        self._simulator = rospy.resolve_name(simulator)
        self._period, self._duration, self._is_lockstep = period, duration, lockstep
        self._duty_cycle = DutyCycle.read(duty_cycle) if duty_cycle else None
        self._due = 0.0
        self._last = None
        self._has_told = False  # that a command was refused
        controller.command = initial_command
        self._lock = threading.Lock()
        self._state_publisher = rospy.Publisher("~state", NamedValues, queue_size=100)
        rospy.Subscriber("~command", Float64, self._take_command, queue_size=10)

    def _take_command(self, message):
        with self._lock:
            try:
                self._controller.command = message.data
                self._has_told = False
            except ValueError as error:
                if not self._has_told:
                    rospy.logwarn("%s: refused on ~command: %s; the set point stays %g", rospy.get_name(), error,
                                  self._controller.command)
                self._has_told = True

    def spin(self):
        if self._is_lockstep:
            self._run_in_lockstep()
        else:
            self._run_beside()

    def _run_in_lockstep(self):
        client = StepClient(self._simulator)
        check_names(self._controller, client.shafts, client.topics, self._simulator)
        for time, _ in lockstep(client, [self._controller], self._period, self._duration, self._duty_cycle):
            self._publish_state(time)
            if rospy.is_shutdown():
                return

    def _run_beside(self):
        scene = wait_for_scene(self._simulator)
        check_names(self._controller, scene.shafts, scene.inputs, self._simulator)
        check_period(self._period, self._simulator)
        output = rospy.Publisher(f"{self._simulator}/{self._controller.topic}", Float64, queue_size=10,
                                 tcp_nodelay=True)

        def take_state(state):
            with self._lock:
                if self._last is not None and state.time < self._last:  # a reset
                    self._controller.reset()
                    self._due = 0.0
                self._last = state.time
                if state.time < self._due - 1e-9:
                    return
                self._due = state.time + self._period
                if self._duty_cycle is not None:
                    self._controller.command = self._duty_cycle(state.time)
                commands = self._controller.update(state.time, dict(zip(scene.shafts, state.velocity)))
                for value in commands.values():
                    output.publish(Float64(value))
                self._publish_state(state.time)

        rospy.Subscriber(f"{self._simulator}/state", DrivetrainState, take_state, queue_size=1, tcp_nodelay=True)
        rospy.spin()

    def _publish_state(self, time):
        state = self._controller.state
        message = NamedValues(time=time, name=list(state), value=list(state.values()))
        message.header.stamp = rospy.Time.now()
        self._state_publisher.publish(message)


def read_parameters(given, needed, optional):
    """(needed, optional) parameters, checked, of the dict `given`; both by name: `needed` their checks, `optional`
    their checks and defaults."""
    for name in given:
        if name not in needed and name not in optional:
            raise ValueError(f"{name}: no such parameter{checks.did_you_mean(name, [*needed, *optional])}; allowed: "
                             f"{', '.join([*needed, *optional])}")
    missing = [name for name in needed if name not in given]
    if missing:
        raise ValueError(f"missing: {', '.join(missing)}; needed: {', '.join(needed)}")
    return ({name: check(name, given[name]) for name, check in needed.items()},
            {name: check(name, given[name]) if name in given else default
             for name, (check, default) in optional.items()})


def main(name, text, controller, needed, optional=None):
    """A program that is one such node.

    Args:
        text: of --help.
        controller: the class; it is made of its parameters.
        needed, optional: these parameters, as of `read_parameters`.
    """
    parser = argparse.ArgumentParser(prog=name, description=text, usage=f"{name} [_PARAMETER:=VALUE]...",
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(rospy.myargv()[1:])
    rospy.init_node(name)
    try:
        own = optional or {}
        given = rospy.get_param("~") if rospy.has_param("~") else {}
        values, others = read_parameters(given, needed, {**own, **COMMON})
        values.update({key: others.pop(key) for key in own})
        ControlNode(controller(**values), **others).spin()
    except rospy.ROSInterruptException:
        pass
    except (OSError, RuntimeError, ValueError, rospy.ROSException, rospy.ServiceException) as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        sys.exit(2)
