"""The controllers of variator_sim.control as nodes, with the habits of ros_control.

    <node pkg="variator_sim" type="speed_controller" name="speed_controller">
      <rosparam> {simulator: /variator, shaft: drive, topic: drive_torque, period: 0.01,
                  p: 12, i: 10, minimum: -80, maximum: 80} </rosparam>
    </node>

The set point comes on `~command` (std_msgs/Float64), `~state` (variator_sim/NamedValues) tells set point, process value,
error and output. The node reads the simulator's `~state` and publishes on the topics of its inputs. With `lockstep: true`
it calls the paused simulator's `~step` instead, for `duration` s.
"""

import sys
import threading

import rospy
from std_msgs.msg import Float64
from variator_sim.control import DutyCycle, lockstep
from variator_sim.msg import DrivetrainState, NamedValues, SceneInfo
from variator_sim.srv import GetState, Step

PATIENCE = 30.0  # s of wall time, for the simulator to come up


class StepClient:
    """A paused simulator as variator_sim.Simulation looks: commands, and steps by its service ~step."""

    def __init__(self, simulator):
        self.shafts = list(wait_for_scene(simulator).shafts)
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


def wait_for_scene(simulator):
    return rospy.wait_for_message(f"{simulator}/scene", SceneInfo, PATIENCE)


class ControlNode:
    """Runs one controller, beside a simulator that runs, or in lockstep with one that is paused."""

    def __init__(self, controller):
        self._controller = controller
        self._simulator = rospy.get_param("~simulator", "/variator")
        self._period = rospy.get_param("~period", 0.01)
        if self._period <= 0.0:
            raise ValueError(f"~period: {self._period} is not above 0 s")
        cycle = rospy.get_param("~duty_cycle", "")
        self._duty_cycle = DutyCycle.read(cycle) if cycle else None
        self._due = 0.0
        self._last = None
        controller.command = rospy.get_param("~initial_command", 0.0)
        self._lock = threading.Lock()
        self._state_publisher = rospy.Publisher("~state", NamedValues, queue_size=100)
        rospy.Subscriber("~command", Float64, self._take_command, queue_size=10)

    def _take_command(self, message):
        with self._lock:
            self._controller.command = message.data

    def spin(self):
        if rospy.get_param("~lockstep", False):
            self._run_in_lockstep()
        else:
            self._run_beside()

    def _run_in_lockstep(self):
        client = StepClient(self._simulator)
        self._check_shafts(client.shafts)
        for time, _ in lockstep(client, [self._controller], self._period, rospy.get_param("~duration"),
                                self._duty_cycle):
            self._publish_state(time)
            if rospy.is_shutdown():
                return

    def _run_beside(self):
        scene = wait_for_scene(self._simulator)
        self._check_shafts(scene.shafts)
        unknown = {self._controller.topic} - set(scene.inputs)
        if unknown:
            raise ValueError(f"~topic: '{self._controller.topic}' is no input of {self._simulator}; allowed: "
                             f"{', '.join(scene.inputs)}")
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

    def _check_shafts(self, shafts):
        for shaft in self._controller.shafts:
            if shaft not in shafts:
                raise ValueError(f"'{shaft}' is no shaft of {self._simulator}; allowed: {', '.join(shafts)}")

    def _publish_state(self, time):
        state = self._controller.state
        message = NamedValues(time=time, name=list(state), value=list(state.values()))
        message.header.stamp = rospy.Time.now()
        self._state_publisher.publish(message)


def parameters(*names):
    """Private parameters by name; one that is missing is an error that tells all that are needed."""
    missing = [name for name in names if not rospy.has_param("~" + name)]
    if missing:
        raise ValueError(f"{rospy.get_name()}: missing {', '.join(missing)}; needed: {', '.join(names)}")
    return {name: rospy.get_param("~" + name) for name in names}


def main(name, make_controller):
    """A program that is one such node. `make_controller` reads what it needs by `parameters`."""
    rospy.init_node(name)
    try:
        ControlNode(make_controller()).spin()
    except rospy.ROSInterruptException:
        pass
    except (OSError, RuntimeError, ValueError, rospy.ROSException, rospy.ServiceException) as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        sys.exit(2)
