"""A node of this package as its users see it, for tests in Python. Waits are for conditions, with a
bound that only a failure reaches; they go by the wall clock, also under /use_sim_time."""

import threading
import time

import rospy
from std_srvs.srv import Trigger
from variator_sim.msg import DrivetrainState, SimulationStatus
from variator_sim.srv import Step

PATIENCE = 15.0  # s


def wait_for(condition, what):
    """The first value of `condition` that is true. Raises AssertionError when none comes."""
    end = time.monotonic() + PATIENCE
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError('waited in vain for ' + what)
        time.sleep(0.01)


class Listener:
    """Keeps the messages of one topic."""

    def __init__(self, topic, message_type):
        self.topic = topic
        self._lock = threading.Lock()
        self._messages = []
        self._subscriber = rospy.Subscriber(topic, message_type, self._keep, queue_size=10000,
                                            tcp_nodelay=True)

    def _keep(self, message):
        with self._lock:
            self._messages.append(message)

    def all(self):
        with self._lock:
            return list(self._messages)

    def forget(self):
        with self._lock:
            self._messages = []

    def connect(self):
        wait_for(lambda: self._subscriber.get_num_connections() > 0, 'a publisher of ' + self.topic)
        return self

    def wait(self, condition=lambda message: True, what=''):
        """The first message kept, or to come, that meets the condition."""
        return wait_for(lambda: next((m for m in self.all() if condition(m)), None),
                        f'{what or "a message"} on {self.topic}')

    def wait_new(self, condition=lambda message: True, what=''):
        """As `wait`, of messages from now on."""
        seen = len(self.all())
        return wait_for(lambda: next((m for m in self.all()[seen:] if condition(m)), None),
                        f'{what or "a new message"} on {self.topic}')

    def close(self):
        self._subscriber.unregister()


class NodeClient:
    """Topics and services of one node. `states=False` leaves ~state without a subscriber."""

    def __init__(self, name, states=True):
        self.name = '/' + name
        self.status = Listener(self.name + '/status', SimulationStatus)
        self.states = Listener(self.name + '/state', DrivetrainState) if states else None
        rospy.wait_for_service(self.name + '/step', timeout=PATIENCE)
        self.status.wait()
        if states:
            self.states.connect()
        self._services = {}

    def call(self, service, service_type, *arguments):
        # Persistent: roscpp sometimes loses the answer of a call with a connection of its own
        # (ros_comm issue 1976).
        if service not in self._services:
            self._services[service] = rospy.ServiceProxy(self.name + '/' + service, service_type,
                                                         persistent=True)
        return self._services[service](*arguments)

    def trigger(self, service):
        return self.call(service, Trigger)

    def step(self, duration, commands=()):
        """`commands`: pairs of topic and value."""
        return self.call('step', Step, duration, [topic for topic, _ in commands],
                         [value for _, value in commands])

    def wait_for_state(self, state):
        return self.status.wait_new(lambda status: status.state == state, f'state {state}')

    def close(self):
        self.status.close()
        if self.states:
            self.states.close()
        for service in self._services.values():
            service.close()
