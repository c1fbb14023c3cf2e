"""Drivetrains under the ROS master, and waits that say what they wait for."""

import http.client
import time
import xmlrpc.client

import rosgraph
import rospy
from variator_sim.checks import did_you_mean
from variator_sim.msg import SceneInfo

PATIENCE = 30.0  # s of wall time, for a simulator to come up
QUIET = 2.0      # s of a wait after which it is told of


class _Transport(xmlrpc.client.Transport):
    """With a bound on the wait for a machine that is gone."""

    def make_connection(self, host):
        if self._connection and host == self._connection[0]:
            return self._connection[1]
        self._connection = host, http.client.HTTPConnection(host, timeout=1.0)
        return self._connection[1]


def _answers(master, node):
    """Whether a node that the master knows still lives: one that was killed stays registered."""
    try:
        with xmlrpc.client.ServerProxy(master.lookupNode(node), transport=_Transport()) as slave:
            return slave.getPid(rospy.get_name())[0] == 1
    except (OSError, http.client.HTTPException, xmlrpc.client.Error, rosgraph.MasterException):
        return False


def drivetrains():
    """The names of all drivetrains whose node, or nodelet manager, answers."""
    master = rosgraph.Master(rospy.get_name())
    kinds = dict(master.getTopicTypes())
    return sorted(topic[:-len("/status")] for topic, publishers in master.getSystemState()[0]
                  if kinds.get(topic) == "variator_sim/SimulationStatus" and topic.endswith("/status")
                  and any(_answers(master, node) for node in publishers))


def known_drivetrains(simulator):
    """A sentence of the drivetrains that there are beside `simulator`."""
    simulator = rospy.resolve_name(simulator)
    try:
        there_are = drivetrains()
    except (OSError, rosgraph.MasterException):
        return "the master does not answer"
    others = [node for node in there_are if node != simulator]
    if simulator in there_are:
        return f"{simulator} is there, but has not sent it"
    return (f"no drivetrain of that name runs{did_you_mean(simulator, others)}; there are: " + ", ".join(others)
            if others else "no drivetrain runs")


class Waiting:
    """Tells once, after QUIET s, what is waited for."""

    def __init__(self, what, explain=lambda: "", patience=PATIENCE):
        self._what, self._explain, self._patience = what, explain, patience
        self._begin = time.monotonic()
        self._has_told = False

    def check(self):
        """Raises RuntimeError once the patience is at its end, ROSInterruptException at a shutdown."""
        if rospy.is_shutdown():
            raise rospy.ROSInterruptException("shutdown")
        seconds = time.monotonic() - self._begin
        if seconds > self._patience:
            raise RuntimeError(f"{self._what} has not come within {self._patience:g} s: {self._explain()}")
        if seconds > QUIET and not self._has_told:
            self._has_told = True
            rospy.logwarn("%s: waiting for %s: %s", rospy.get_name(), self._what, self._explain())


def wait_for_scene(simulator, patience=PATIENCE):
    """The SceneInfo of a simulator, which it publishes when it is ready."""
    found = []
    subscriber = rospy.Subscriber(f"{simulator}/scene", SceneInfo, found.append, queue_size=1)
    waiting = Waiting(f"{simulator}/scene", lambda: known_drivetrains(simulator), patience)
    try:
        while not found:
            waiting.check()
            time.sleep(0.01)
        return found[0]
    finally:
        subscriber.unregister()
