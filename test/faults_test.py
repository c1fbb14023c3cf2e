#!/usr/bin/python3
"""The node's behaviour when its master, its subscribers or itself fail. Starts a master of its
own on a free port."""

import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import xmlrpc.client

with socket.socket() as probe:
    probe.bind(('127.0.0.1', 0))
    PORT = probe.getsockname()[1]
# rospy reads it when it is imported.
os.environ['ROS_MASTER_URI'] = f'http://127.0.0.1:{PORT}'
os.environ['ROS_IP'] = '127.0.0.1'
os.environ.pop('ROS_HOSTNAME', None)

# pylint: disable=wrong-import-position
import roslib.packages
import rosgraph
import rosparam
import rospkg
import rospy
import rosunit
import yaml
from std_msgs.msg import Float64
from variator_sim.msg import DrivetrainState, SimulationStatus

from support import faulty_package
from support.node_client import PATIENCE, Listener, NodeClient, wait_for
from support.simulate import fake_compiler
from support.subtests import TestCase

PACKAGE = pathlib.Path(rospkg.RosPack().get_path('variator_sim'))
STEPS = str(PACKAGE / 'test/cases/torque_steps/scene.yaml')
PROGRAM = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]


def master_answers():
    try:
        rosgraph.Master('/faults_test').getPid()
        return True
    except (OSError, rosgraph.MasterException):
        return False


def start_master():
    master = subprocess.Popen(['rosmaster', '--core', '-p', str(PORT)], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)
    wait_for(master_answers, 'the master')
    return master


def upload(name, **settings):
    rosparam.upload_params('/' + name, {**rosparam.load_file(STEPS)[0][0], **settings})


def resident_memory(process):
    """kB"""
    status = pathlib.Path(f'/proc/{process.pid}/status').read_text(encoding='utf-8')
    return int(next(line for line in status.splitlines() if line.startswith('VmRSS:')).split()[1])


class FaultsTest(TestCase):

    @classmethod
    def setUpClass(cls):
        cls.master = start_master()
        rospy.init_node('faults_test')

    @classmethod
    def tearDownClass(cls):
        rospy.signal_shutdown('done')
        cls.master.kill()
        cls.master.wait()

    def spawn(self, *command, **options):
        process = subprocess.Popen(command, **{'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT,
                                               'text': True, **options})
        for clean_up in (process.stdout.close, process.wait, process.kill):
            self.addCleanup(clean_up)
        return process

    def start(self, name, **settings):
        upload(name, **settings)
        return self.spawn(PROGRAM, '__name:=' + name)

    def client(self, name, **options):
        client = NodeClient(name, **options)
        self.addCleanup(client.close)
        return client

    def expect_good_end(self, node, order):
        node.send_signal(order)
        output, _ = node.communicate(timeout=PATIENCE)
        self.assertEqual(node.returncode, 0, output)
        # (That it was ready, and a word on the energy of the reactions, are no faults.)
        words = [line for line in output.splitlines()
                 if ': ready: ' not in line and 'doc/theory.md' not in line]
        self.assertEqual(words, [])
        return output

    def test_orders_to_end_end_well(self):
        for order in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            for start_paused in (False, True):
                with self.subTest(order=order, start_paused=start_paused):
                    node = self.start('ending', start_paused=start_paused)
                    client = self.client('ending')
                    client.close()
                    self.expect_good_end(node, order)

    def test_a_node_tells_when_it_is_ready(self):
        upload('told', start_paused=True, solver={'machine_code': 'never'})
        node = self.spawn(PROGRAM, '__name:=told', 'told/drive_torque:=/plant/torque')
        self.client('told')
        line = self.expect_good_end(node, signal.SIGINT)
        for words in ('/told: ready: shafts drive, load; constraints variator; '
                      'inputs /plant/torque, /told/load_torque; principle generalized_gauss; '
                      'stepper auto (', '; formulas run by the interpreter',
                      '; paused, ~resume or ~step moves it'):
            self.assertIn(words, line)
        self.assertEqual(line.count('formulas'), 1)

    def test_it_answers_while_a_compiler_does_not(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        folder = pathlib.Path(folder.name)
        path = fake_compiler(folder, f'echo $$ >> {folder}/compilers\nexec sleep 1000')
        upload('preparing', solver={'machine_code': 'always'})
        node = self.spawn(PROGRAM, '__name:=preparing',
                          env={**os.environ, 'PATH': path, 'VARIATOR_SIM_CACHE': str(folder / 'cache')})
        client = self.client('preparing', states=False)
        status = client.status.wait()
        self.assertEqual((status.state, status.time), (SimulationStatus.RUNNING, 0.0))
        self.assertIn('the formulas are being compiled', status.message)
        self.assertTrue(client.trigger('pause').success)
        self.assertTrue(client.step(0.01).success)
        started = folder / 'compilers'
        wait_for(lambda: started.exists() and started.read_text().endswith('\n'), 'a compiler')
        compilers = [int(line) for line in started.read_text().split()]
        begin = time.monotonic()
        self.expect_good_end(node, signal.SIGTERM)
        self.assertLess(time.monotonic() - begin, 5.0)
        for compiler in compilers:
            wait_for(lambda pid=compiler: not pathlib.Path(f'/proc/{pid}').exists(), 'its end')
        self.assertEqual(list((folder / 'cache').iterdir()), [])

    def test_a_scene_that_takes_long_to_read_holds_nothing_back(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        table = os.path.join(folder.name, 'table.csv')
        os.mkfifo(table)  # a reader of a pipe waits for a writer, and there is none
        rosparam.upload_params('/slow', {
            'shafts': ['a'], 'a': {'inertia': 1}, 'tables': ['curve'], 'torques': ['it'],
            'curve': {'file': table, 'x': 'x', 'values': 'y'},
            'it': {'type': 'variator_sim/ExpressionTorque', 'shaft': 'a', 'torque': 'curve(w1)'}})
        node = self.spawn(PROGRAM, '__name:=slow')
        listener = Listener('/slow/status', SimulationStatus)
        self.addCleanup(listener.close)
        self.assertIn('preparing: ', listener.wait().message)
        begin = time.monotonic()
        self.expect_good_end(node, signal.SIGTERM)
        self.assertLess(time.monotonic() - begin, 5.0)

    def test_a_step_is_ended_by_a_pause_and_by_an_order_to_end(self):
        scene = rosparam.load_file(STEPS)[0][0]
        saw = {'type': 'variator_sim/ExpressionTorque', 'shaft': 'load', 'torque': 'cos(1e4*t)'}
        node = self.start('long', start_paused=True, torques=scene['torques'] + ['saw'], saw=saw,
                          solver={'maximum_steps': 1000000000})
        client = self.client('long', states=False)
        answers = []
        caller = threading.Thread(target=lambda: answers.append(client.step(1e6)))
        caller.start()
        wait_for(lambda: client.trigger('pause').success and answers, 'the end of the step')
        caller.join()
        self.assertFalse(answers[0].success)
        self.assertIn('~pause has ended the step', answers[0].message)
        self.assertGreater(answers[0].state.time, 0.0)
        self.assertTrue(client.step(0.001).success)

        def step_on():
            try:
                client.step(1e6)
            except rospy.ServiceException:
                pass  # the node has gone

        caller = threading.Thread(target=step_on)
        caller.start()
        time.sleep(0.5)  # (nothing tells that it has begun)
        begin = time.monotonic()
        self.expect_good_end(node, signal.SIGTERM)
        self.assertLess(time.monotonic() - begin, 5.0)
        caller.join()

    def test_a_plugin_that_throws_stops_its_motion_alone(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        rosparam.upload_params('/faulty', yaml.safe_load(faulty_package.scene('throws_a_number', 0.05)))
        node = self.spawn(PROGRAM, '__name:=faulty', env=dict(os.environ, **faulty_package.environment(folder.name)))
        client = self.client('faulty', states=False)
        for _ in range(2):
            status = client.wait_for_state(SimulationStatus.STOPPED)
            self.assertEqual(status.stop_reason, 'NonFiniteValue')
            self.assertIn("torque 'drag', whose function threw: an exception of type int", status.message)
            self.assertTrue(client.trigger('reset').success)
        self.assertIsNone(node.poll())

    def test_help_and_unknown_arguments_need_no_master(self):
        environment = dict(os.environ, ROS_MASTER_URI='http://127.0.0.1:1')
        for arguments, code, words in (
                (['--help'], 0, 'usage: roslaunch variator_sim variator_sim.launch scene:='),
                (['__name:=asked', '-h'], 0, 'Exit status:'),
                (['scene.yaml'], 2, "unknown argument 'scene.yaml'; allowed: --help, NAME:=VALUE")):
            with self.subTest(arguments=arguments):
                node = subprocess.run([PROGRAM, *arguments], stdout=subprocess.PIPE, env=environment,
                                      stderr=subprocess.STDOUT, text=True, check=False,
                                      timeout=PATIENCE)
                self.assertEqual(node.returncode, code, node.stdout)
                self.assertIn(words, node.stdout)

    def test_help_names_all_parameters_topics_and_services(self):
        words = subprocess.run([PROGRAM, '--help'], stdout=subprocess.PIPE, text=True, check=True,
                               timeout=PATIENCE).stdout
        source = (PACKAGE / 'include/variator_sim/node_names.h').read_text(encoding='utf-8')
        keys, topics = re.findall(r'\{("[^}]*")\}', source)
        for name in re.findall(r'"(\w+)"', keys):
            self.assertRegex(words, rf'\b{name}\b')
        for name in re.findall(r'"(\w+)"', topics):
            self.assertRegex(words, rf'~{name}\b')
        self.addCleanup(self.start('helpful', start_paused=True).send_signal, signal.SIGINT)
        self.client('helpful')
        services = rosgraph.Master('/faults_test').getSystemState()[2]
        for name in (service for service, _ in services if service.startswith('/helpful/')):
            if not name.endswith(('loggers', 'logger_level')):
                self.assertIn('~' + name.rpartition('/')[2], words)

    def subscriber(self, topic):
        """A process that reads the topic; it has received something when this returns."""
        program = ('import rospy, sys\n'
                   'from variator_sim.msg import DrivetrainState\n'
                   "rospy.init_node('subscriber', anonymous=True, disable_signals=True)\n"
                   'def tell(message): print(message.header.seq, flush=True)\n'
                   f"rospy.Subscriber('{topic}', DrivetrainState, tell)\n"
                   'rospy.spin()\n')
        process = self.spawn(sys.executable, '-c', program, stderr=None)
        self.assertNotEqual(process.stdout.readline(), '')
        return process

    def test_subscribers_that_vanish_delay_no_tick(self):
        # 10000 messages of 0.4 kB a second: what piles up shows.
        node = self.start('watched', tick_rate=10000, publish_rate=10000)
        client = self.client('watched', states=False)
        killed, stopped = (self.subscriber('/watched/state') for _ in range(2))
        killed.kill()
        stopped.send_signal(signal.SIGSTOP)
        start = client.status.wait_new()
        # Queues and sockets fill within the first second.
        before = client.status.wait_new(lambda s: s.time > start.time + 1.0, 'a second')
        memory = resident_memory(node)
        after = client.status.wait_new(lambda s: s.time > before.time + 3.0, 'three seconds')
        # (AddressSanitizer keeps what is freed for a while.)
        if 'ASAN_OPTIONS' not in os.environ:
            self.assertLess(resident_memory(node) - memory, 4096)
        # Every tick was made: simulated time is the number of ticks.
        self.assertEqual(round((after.time - before.time) * 10000), after.ticks - before.ticks)
        # A subscriber that reads gets the newest messages.
        reader = Listener('/watched/state', DrivetrainState)
        self.addCleanup(reader.close)
        reader.wait(lambda m: m.time > after.time, 'a new state')
        stopped.send_signal(signal.SIGCONT)
        stopped.kill()
        self.expect_good_end(node, signal.SIGINT)

    def test_a_killed_node_is_respawned(self):
        with tempfile.TemporaryDirectory() as folder:
            launch = pathlib.Path(folder, 'respawn.launch')
            launch.write_text(
                '<launch><node pkg="variator_sim" type="variator_sim_node" name="reborn"'
                ' respawn="true" clear_params="true">'
                f'<rosparam command="load" file="{STEPS}"/></node></launch>', encoding='utf-8')
            roslaunch = self.spawn('roslaunch', str(launch))
            try:
                client = self.client('reborn')
                before = client.status.wait_new(lambda s: s.time > 0.5, 'half a second')
                pid = self.pid_of('reborn')
                os.kill(pid, signal.SIGKILL)
                # Subscribers find the new one by themselves; it starts from the scene.
                client.status.wait_new(lambda s: s.time < before.time, 'a new start')
                client.status.wait_new(lambda s: s.state == SimulationStatus.RUNNING and s.ticks > 100,
                                       'ticks')
                self.assertNotEqual(self.pid_of('reborn'), pid)
                client.states.wait_new()
            finally:
                roslaunch.send_signal(signal.SIGINT)
                output, _ = roslaunch.communicate(timeout=PATIENCE)
            self.assertIn('exit code -9', output)

    def pid_of(self, name):
        uri = rosgraph.Master('/faults_test').lookupNode('/' + name)
        with xmlrpc.client.ServerProxy(uri) as node:
            return node.getPid('/faults_test')[2]

    # The last one: what this process has registered does not survive it either.
    def test_zz_a_master_that_dies_is_not_missed_by_connected_nodes(self):
        node = self.start('orphan')
        client = self.client('orphan')
        torque = rospy.Publisher('/orphan/drive_torque', Float64, queue_size=10)
        wait_for(lambda: torque.get_num_connections() > 0, 'the node')
        self.assertIn('running', client.step(0.1).message)  # the connection stays

        def expect_life(command):
            start = client.status.wait_new()
            client.status.wait_new(lambda s: s.time > start.time + 0.5, 'half a second')
            torque.publish(Float64(command))
            client.states.wait_new(lambda m: m.applied_torque[0] == command, 'the command')
            self.assertIn('running', client.step(0.1).message)

        FaultsTest.master.kill()
        FaultsTest.master.wait()
        expect_life(7.0)
        FaultsTest.master = start_master()
        expect_life(8.0)
        # Ending well does not need a master either.
        FaultsTest.master.kill()
        FaultsTest.master.wait()
        node.send_signal(signal.SIGTERM)
        output, _ = node.communicate(timeout=PATIENCE)
        self.assertEqual(node.returncode, 0, output)


if __name__ == '__main__':
    rosunit.unitrun('variator_sim', 'faults_test', FaultsTest)
