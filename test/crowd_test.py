#!/usr/bin/python3
"""Eight clients at once at every service of a node, under floods on all its inputs and subscribers that
come and go. `scripts/sanitize` runs it with instrumented nodes, for longer (VARIATOR_SIM_CROWD_SECONDS).
Starts a master of its own on a free port."""

import os
import pathlib
import random
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest

with socket.socket() as probe:
    probe.bind(('127.0.0.1', 0))
    PORT = probe.getsockname()[1]
# rospy reads it when it is imported.
os.environ['ROS_MASTER_URI'] = f'http://127.0.0.1:{PORT}'
os.environ['ROS_IP'] = '127.0.0.1'
os.environ.pop('ROS_HOSTNAME', None)

# pylint: disable=wrong-import-position
import dynamic_reconfigure.client
import roslib.packages
import rosgraph
import rosparam
import rospkg
import rospy
import rosunit
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from variator_sim.msg import (Commands, DrivetrainEnergy, DrivetrainState, NamedValues, SceneInfo,
                              SimulationStatus)
from variator_sim.srv import GetState, SetState, Step

from support.node_client import PATIENCE, NodeClient, wait_for

SCENE = pathlib.Path(rospkg.RosPack().get_path('variator_sim'), 'config/ratio_steps.yaml')
PROGRAM = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]
SECONDS = float(os.environ.get('VARIATOR_SIM_CROWD_SECONDS', '3'))
CLIENTS = 8
INPUTS = ('drive_torque', 'load_torque')
TOPICS = {'state': DrivetrainState, 'elements': NamedValues, 'inputs': NamedValues,
          'energy': DrivetrainEnergy, 'scene': SceneInfo, 'status': SimulationStatus}
# Instrumented nodes are slow to start.
START_PATIENCE = 10.0 * PATIENCE


def master_answers():
    try:
        rosgraph.Master('/crowd_test').getPid()
        return True
    except (OSError, rosgraph.MasterException):
        return False


class Client(threading.Thread):
    """Calls services at random until `end`."""

    def __init__(self, seed, end):
        super().__init__(daemon=True)
        self.random = random.Random(seed)
        self.end = end
        self.calls = 0
        self.fault = None

    def service(self, name, kind):
        return rospy.ServiceProxy('/crowd/' + name, kind, persistent=True)

    def run(self):
        try:
            self.call_services()
        except Exception as error:  # pylint: disable=broad-except
            self.fault = repr(error)

    def call_services(self):
        triggers = [self.service(name, Trigger)
                    for name in ('pause', 'resume', 'resume', 'reset', 'reset_time')]
        step, get, put = (self.service(*pair) for pair in
                          (('step', Step), ('get_state', GetState), ('set_state', SetState)))
        while time.monotonic() < self.end:
            self.calls += 1
            dice = self.random.random()
            if dice < 0.4:
                self.random.choice(triggers)()
            elif dice < 0.7:
                # Refused while it runs: an answer all the same.
                step(self.random.uniform(1e-4, 5e-3), INPUTS[:1], [self.random.uniform(-3.0, 3.0)])
            elif dice < 0.85:
                get()
            else:
                put(text=get().text, project=True)


class Flood(threading.Thread):
    """Commands, subscribers and settings until `end`."""

    def __init__(self, end):
        super().__init__(daemon=True)
        self.end = end
        self.commands = 0
        self.fault = None

    def run(self):
        try:
            self.flood()
        except Exception as error:  # pylint: disable=broad-except
            self.fault = repr(error)

    def flood(self):
        dice = random.Random(0)
        single = {topic: rospy.Publisher(f'/crowd/{topic}', Float64, queue_size=100) for topic in INPUTS}
        together = rospy.Publisher('/crowd/commands', Commands, queue_size=100)
        settings = dynamic_reconfigure.client.Client('/crowd', timeout=START_PATIENCE)
        subscribers = []
        while time.monotonic() < self.end:
            for topic, publisher in single.items():
                publisher.publish(Float64(dice.uniform(-3.0, 3.0)))
                together.publish(Commands(topics=[topic], values=[dice.choice((1.0, float('nan')))]))
                self.commands += 2
            if dice.random() < 0.1:
                name = dice.choice(sorted(TOPICS))
                subscribers.append(rospy.Subscriber('/crowd/' + name, TOPICS[name], lambda message: None))
            if len(subscribers) > 6:
                subscribers.pop(0).unregister()
            if dice.random() < 0.02:
                settings.update_configuration({'real_time_factor': dice.choice((0.0, 1.0, 20.0)),
                                               'publish_rate': dice.choice((10.0, 1000.0))})
            time.sleep(0.002)
        for subscriber in subscribers:
            subscriber.unregister()


class CrowdTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.master = subprocess.Popen(['rosmaster', '--core', '-p', str(PORT)],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(master_answers, 'the master')
        rospy.init_node('crowd_test')

    @classmethod
    def tearDownClass(cls):
        rospy.signal_shutdown('done')
        cls.master.kill()
        cls.master.wait()

    def test_a_crowd_is_served(self):
        rosparam.upload_params('/crowd', {**rosparam.load_file(str(SCENE))[0][0], 'tick_rate': 1000,
                                          'estimate_error': True})
        with tempfile.TemporaryFile('w+') as log:
            node = subprocess.Popen([PROGRAM, '__name:=crowd'], stdout=log, stderr=subprocess.STDOUT)
            self.addCleanup(node.wait)
            self.addCleanup(node.kill)
            rospy.wait_for_service('/crowd/step', timeout=START_PATIENCE)
            end = time.monotonic() + SECONDS
            threads = [Flood(end), *(Client(seed, end) for seed in range(CLIENTS))]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(SECONDS + START_PATIENCE)
                self.assertFalse(thread.is_alive(), 'a call without an answer')
            self.assertIsNone(node.poll())
            client = NodeClient('crowd', states=False)
            client.trigger('reset')
            client.trigger('resume')
            client.status.wait_new(lambda status: status.state == SimulationStatus.RUNNING, 'motion')
            client.close()
            node.send_signal(signal.SIGINT)
            node.wait(START_PATIENCE)
            log.seek(0)
            words = log.read()
        print(f'crowd: {sum(t.calls for t in threads[1:])} calls, {threads[0].commands} commands')
        self.assertEqual([thread.fault for thread in threads if thread.fault], [], words[-20000:])
        self.assertEqual(node.returncode, 0, words[-20000:])
        self.assertNotIn('Sanitizer', words)
        self.assertGreater(min(thread.calls for thread in threads[1:]), 0)


if __name__ == '__main__':
    rosunit.unitrun('variator_sim', 'crowd_test', CrowdTest)
