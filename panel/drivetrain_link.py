"""One drivetrain's node as the panel sees it: what it tells, what can be asked of it."""

import queue
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from variator_sim.msg import (DrivetrainEnergy, DrivetrainState, NamedValues, SceneInfo,
                              SimulationStatus)
from variator_sim.srv import Step

import columns
from sample_table import SampleTable
from scene_view import explain, read_inputs, read_output_units

REST = 2.0     # s without a change after which inputs rest
SILENCE = 1.0  # s without ~status (10 Hz) after which the node is taken for dead
TYPES = {"state": DrivetrainState, "elements": NamedValues, "inputs": NamedValues,
         "outputs": NamedValues, "states": NamedValues, "variables": NamedValues,
         "energy": DrivetrainEnergy}
TRIGGERS = ("pause", "resume", "reset", "reset_time")


class DrivetrainLink:
    """Subscribes to a lazy topic of the node only while a page shows it. Methods may be called
    from any thread, none of them waits for the node but `call`."""

    def __init__(self, node):
        self.node = node
        self.scene = None       # SceneInfo
        self.scene_number = 0   # changes with every new scene, and with what is known of its columns
        self.inputs = []        # scene_view.read_inputs
        self.explanation = ""
        self.table = SampleTable()
        self.columns = {}       # group: list of Column
        self.status = None      # SimulationStatus
        self.settings = {}      # what dynamic_reconfigure has in force
        self.diagnostics = None  # DiagnosticStatus
        self._heard = None      # time.monotonic()
        self._known_inputs = None
        self._inputs_moved = 0.0  # time.monotonic()
        self._lock = threading.Lock()
        self._commands = {}     # topic: publisher
        self._wanted = set()
        self._subscribers = {}  # group: subscriber
        self._looked_at = None
        self._work = queue.Queue()
        threading.Thread(target=self._do_work, daemon=True).start()
        rospy.Subscriber(node + "/scene", SceneInfo, self._take_scene)
        rospy.Subscriber(node + "/status", SimulationStatus, self._take_status, queue_size=10)
        rospy.Subscriber(node + "/parameter_updates", Config, self._take_settings)

    # --- Results

    def is_alive(self):
        return self._heard is not None and time.monotonic() - self._heard < SILENCE

    def silence(self):
        """s since the last word; None when there was none."""
        return None if self._heard is None else time.monotonic() - self._heard

    def _take_status(self, message):
        self.status = message
        self._heard = time.monotonic()

    def _take_settings(self, message):
        self.settings = {value.name: value.value for value in message.doubles}

    def _take_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith(self.node.lstrip("/") + ":"):
                self.diagnostics = status

    def _take_scene(self, message):
        with self._lock:
            if self.scene is not None and self.scene.parameters == message.parameters:
                return  # the same again: the node was started anew
            self.scene = message
            self.inputs = read_inputs(message)
            self.explanation = "..."
            self.table = SampleTable()
            self.columns = {"state": columns.state_columns(message),
                            "energy": columns.energy_columns()}
            for group, known in self.columns.items():
                self.table.add_group(group, [column.name for column in known])
            for topic in set(self._commands) - set(message.inputs):
                self._commands.pop(topic).unregister()
            for topic in set(message.inputs) - set(self._commands):
                self._commands[topic] = rospy.Publisher(f"{self.node}/{topic}", Float64,
                                                        queue_size=10)
            self.scene_number += 1
        self._work.put(lambda: self._explain(message))

    def _explain(self, scene):
        text = explain(scene)
        with self._lock:
            if scene is self.scene:
                self.explanation = text
                self.scene_number += 1

    def _take(self, message, group):
        """Called by the thread of the connection."""
        table, scene = self.table, self.scene
        if scene is None:
            return
        if group == "state":
            values = columns.state_values(message)
        elif group == "energy":
            values = columns.energy_values(message)
        else:
            values = message.value
            if not table.knows(group):
                self._learn(group, message.name)
        try:
            table.put(group, message.header.stamp.to_nsec(), message.time, values)
        except (KeyError, ValueError):
            pass  # of another scene: its SceneInfo is under way

    def _learn(self, group, names):
        """The names of a group are known with its first message."""
        with self._lock:
            units = {entry["topic"]: entry["unit"] for entry in self.inputs}
            if group == "outputs":
                units = read_output_units(self.scene)
            found = columns.named_columns(group, names, units)
            self.columns[group] = found
            self.table.add_group(group, [column.name for column in found])
            self.scene_number += 1

    # --- Subscriptions

    def look_at(self, groups):
        """Sets the groups that pages show; None: no page. Groups of unknown names are received once."""
        wanted = set()
        if groups is not None and self.scene is not None:
            wanted = set(groups) | {group for group in TYPES if not self.table.knows(group)
                                    and self._can_have(group)}
        looked_at = groups is not None
        if wanted != self._wanted or looked_at != self._looked_at:
            self._wanted, self._looked_at = wanted, looked_at
            self._work.put(self._subscribe)

    def inputs_move(self):
        """False when no command has come and no input has changed for a while: then what is known
        of them stays true, and no subscription is needed."""
        status = self.status
        counts = status and (status.commands_accepted, status.command_timeouts)
        known = (counts, self.table.latest(
            [column.name for column in self.columns.get("inputs", [])]))
        if known != self._known_inputs:
            self._known_inputs, self._inputs_moved = known, time.monotonic()
        return not self.is_alive() or time.monotonic() - self._inputs_moved < REST

    def _can_have(self, group):
        if group == "inputs":
            return bool(self.scene.inputs)
        if group == "outputs":
            return "\noutputs:" in "\n" + self.scene.parameters
        return True

    def _subscribe(self):
        """Makes the subscriptions what was last wanted."""
        wanted = set(self._wanted)
        if self._looked_at:
            wanted.add("diagnostics")
        for group in set(self._subscribers) - wanted:
            self._subscribers.pop(group).unregister()
        for group in wanted - set(self._subscribers):
            if group == "diagnostics":
                subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray,
                                              self._take_diagnostics, queue_size=10)
            else:
                subscriber = rospy.Subscriber(f"{self.node}/{group}", TYPES[group], self._take,
                                              callback_args=group, queue_size=1000)
            self._subscribers[group] = subscriber

    def _do_work(self):
        """Does work that may wait for the master or take long, one task after the other."""
        while True:
            task = self._work.get()
            try:
                task()
            except Exception as error:  # pylint: disable=broad-except
                rospy.logwarn("panel: %s", error)

    # --- Requests

    def command(self, topic, value):
        publisher = self._commands.get(topic)
        if publisher is None:
            raise ValueError(f"'{topic}' is no input; there are: {', '.join(self._commands)}")
        publisher.publish(Float64(value))

    def call(self, service, **arguments):
        """Calls a service and returns its message, "" when there is nothing to say. Waits."""
        if not self.is_alive():
            raise RuntimeError("the node is not there")
        if service in TRIGGERS:
            answer = self._service(service, Trigger)
        elif service == "step":
            answer = self._service("step", Step, float(arguments["duration"]), [], [])
        elif service == "set_parameters":
            config = Config(doubles=[DoubleParameter(name, float(value))
                                     for name, value in arguments.items()])
            in_force = self._service("set_parameters", Reconfigure, config).config
            refused = [value.name for value in in_force.doubles
                       if value.name in arguments and value.value != float(arguments[value.name])]
            if refused:
                raise RuntimeError(f"{', '.join(refused)}: the node did not take this value")
            return ""
        else:
            raise ValueError(f"'{service}' is no service of the panel")
        if not answer.success:
            raise RuntimeError(answer.message)
        return answer.message

    def _service(self, name, service_type, *arguments):
        # A connection of its own each, but a persistent one: roscpp sometimes loses the answer of a
        # call with another (ros_comm issue 1976), and a node that came back has another address.
        proxy = rospy.ServiceProxy(f"{self.node}/{name}", service_type, persistent=True)
        try:
            return proxy(*arguments)
        finally:
            proxy.close()
