#!/usr/bin/python3
"""Settings that change while the node runs, its diagnostics, timeouts of commands, and what it asks
of Linux."""

import collections
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import unittest

import dynamic_reconfigure.client
import roslib.packages
import rosparam
import rospkg
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Log
from std_msgs.msg import Float64
from variator_sim.msg import DrivetrainEnergy, SceneInfo, SimulationStatus

from support.node_client import PATIENCE, Listener, NodeClient, wait_for
from support.subtests import TestCase

PACKAGE = pathlib.Path(rospkg.RosPack().get_path('variator_sim'))
STEPS = str(PACKAGE / 'test/cases/torque_steps/scene.yaml')
SCHED_FIFO = 1


class LiveSettingsTest(TestCase):

    def setUp(self):
        self.node = NodeClient('live')
        self.client = dynamic_reconfigure.client.Client('/live', timeout=PATIENCE)
        self.addCleanup(self.node.close)
        self.addCleanup(self.client.close)

    def change(self, **settings):
        return self.client.update_configuration(settings)

    def intervals(self):
        """ms of simulated time between states; nothing may be skipped."""
        times = [round(state.time * 1e9) for state in self.node.states.all()]
        self.assertTrue(all(time % 1000000 == 0 for time in times))
        return [(b - a) // 1000000 for a, b in zip(times, times[1:])]

    def test_real_time_factor_changes_without_burst_or_stall(self):
        self.node.states.wait_new(lambda state: True, 'states before the change')
        self.assertEqual(self.change()['real_time_factor'], 1.0)
        self.assertEqual(self.change(real_time_factor=4.0)['real_time_factor'], 4.0)
        self.assertEqual(rospy.get_param('/live/real_time_factor'), 4.0)
        self.node.status.wait_new(lambda s: s.real_time_factor > 2.0, 'a faster simulation')
        wait_for(lambda: sum(interval > 10 for interval in self.intervals()) > 12,
                 'states of the faster simulation')
        # States come every 10 ms of wall time: 10 ticks at first, then 40. A change of the factor
        # restarts the count, so one interval may be anything up to the sum. A node that did not
        # have its turn for 20 ms sends one between, too.
        intervals = self.intervals()
        self.assertLessEqual(max(intervals), 50, intervals)
        change = next(i for i, interval in enumerate(intervals) if interval > 10)
        times = set(itertools.accumulate(intervals[change + 1:]))
        (place, _), = collections.Counter(time % 40 for time in times).most_common(1)
        self.assertTrue(times.issuperset(range(40 + place, max(times), 40)), intervals)
        self.assertEqual(self.change(real_time_factor=1.0)['real_time_factor'], 1.0)
        self.node.status.wait_new(lambda s: s.real_time_factor < 2.0, 'a slower simulation')
        self.assertEqual(self.node.status.all()[-1].state, SimulationStatus.RUNNING)

    def test_publish_rate_changes(self):
        self.assertEqual(self.change(publish_rate=50.0)['publish_rate'], 50.0)
        self.node.states.forget()
        wait_for(lambda: len(self.node.states.all()) > 12, 'states')
        self.assertEqual(self.intervals()[-10:], [20] * 10)
        self.change(publish_rate=100.0)

    def test_values_that_are_not_allowed_change_nothing(self):
        before = self.change()
        log = Listener('/rosout', Log).connect()
        self.addCleanup(log.close)
        for name, value, words in (('real_time_factor', 1e-4, '0.0001 is not allowed: 0 (unpaced) or from 0.001 to 1e6'),
                                   ('real_time_factor', -1.0, '-1 (or less) is not allowed'),
                                   ('real_time_factor', -5.0, '-1 (or less) is not allowed'),
                                   ('real_time_factor', 1e9, '2e+06 (or more) is not allowed'),
                                   ('publish_rate', 1001.0, '1001 Hz is not allowed: from 0.001 to tick_rate'),
                                   ('publish_rate', 1e-4, '0.0001 Hz is not allowed'),
                                   ('publish_rate', -3.0, '-1 (or less) Hz is not allowed')):
            after = self.change(**{name: value})
            self.assertEqual(after[name], before[name])
            self.assertEqual(rospy.get_param('/live/' + name), before[name])
            log.wait(lambda m, name=name, words=words: f'/live: {name} {words}' in m.msg, words)


class DiagnosticsTest(TestCase):

    def setUp(self):
        self.diagnostics = Listener('/diagnostics', DiagnosticArray).connect()
        self.addCleanup(self.diagnostics.close)

    def wait_for_status(self, node, condition, what):
        def matches(array):
            return any(status.name == f'{node}: simulation' and condition(status)
                       for status in array.status)
        array = self.diagnostics.wait_new(matches, what)
        return next(s for s in array.status if s.name == f'{node}: simulation' and condition(s))

    def test_levels_tell_how_the_simulation_fares(self):
        node = NodeClient('live', states=False)
        self.addCleanup(node.close)
        node.trigger('pause')
        status = self.wait_for_status('live', lambda s: s.message == 'paused', 'a pause')
        self.assertEqual(status.level, DiagnosticStatus.OK)
        self.assertEqual(status.hardware_id, 'none')
        values = {pair.key: pair.value for pair in status.values}
        for key in ('real-time factor', 'ticks', 'overruns', 'lateness p50 (us)',
                    'lateness p99 (us)', 'lateness max (us)', 'lost wall time (s)',
                    'commands clamped', 'commands refused', 'command timeouts', 'samples dropped',
                    'residual of variator', 'stop reason'):
            self.assertIn(key, values)
        self.assertLess(abs(float(values['residual of variator'])), 1e-6)

        torque = rospy.Publisher('/live/drive_torque', Float64, queue_size=10)
        self.addCleanup(torque.unregister)
        wait_for(lambda: torque.get_num_connections() > 0, 'the node')
        torque.publish(Float64(float('nan')))
        status = self.wait_for_status('live', lambda s: 'refused' in s.message, 'a refusal')
        self.assertEqual(status.level, DiagnosticStatus.WARN)
        # It is about the last second: then all is well again.
        self.wait_for_status('live', lambda s: s.level == DiagnosticStatus.OK, 'well-being')
        node.trigger('resume')

    def test_a_stopped_motion_is_an_error(self):
        node = NodeClient('stopping', states=False)
        self.addCleanup(node.close)
        node.trigger('resume')
        status = self.wait_for_status('stopping', lambda s: s.level == DiagnosticStatus.ERROR,
                                      'an error')
        self.assertEqual(status.message, 'stopped: NonFiniteValue')
        self.assertEqual({pair.key: pair.value for pair in status.values}['stop reason'],
                         'NonFiniteValue')

    def test_reactions_that_bring_energy_are_a_word_until_the_reset(self):
        node = NodeClient('live', states=False)
        self.addCleanup(node.close)
        node.trigger('pause')

        def word(status):
            return {pair.key: pair.value for pair in status.values}['energy of the reactions']
        node.trigger('reset')
        self.wait_for_status('live', lambda s: word(s) == '', 'no word')
        self.assertTrue(node.step(3.0).success)
        status = self.wait_for_status('live', word, 'a word')
        self.assertEqual(status.level, DiagnosticStatus.OK)
        for part in ('generalized_gauss', '%', 'doc/theory.md'):
            self.assertIn(part, word(status))
        node.trigger('reset')
        self.wait_for_status('live', lambda s: word(s) == '', 'no word')
        node.trigger('resume')


class EnergyTest(TestCase):
    KINETIC = 0.5 * (0.5 * 10.0 ** 2 + 1.2 * 8.0 ** 2)  # J, at the start

    def setUp(self):
        self.node = NodeClient('live', states=False)
        self.addCleanup(self.node.close)
        self.node.trigger('pause')
        self.addCleanup(self.node.trigger, 'resume')

    def listen(self):
        listener = Listener('/live/energy', DrivetrainEnergy).connect()
        # The node has taken notice when it tells.
        wait_for(lambda: self.node.step(1e-3).success and listener.all(), 'energies')
        return listener

    def run_motion(self):
        """0.9 s in four steps; the time reached."""
        for duration, torque in ((0.3, 4.0), (0.1, 9.0), (0.4, 2.0), (0.1, 2.0)):
            response = self.node.step(duration, [('drive_torque', torque)])
            self.assertTrue(response.success, response.message)
        return response.state.time

    def test_energies_count_from_the_start_of_the_motion(self):
        energies = self.listen()
        energies.forget()
        self.node.trigger('reset_time')
        energies.wait(lambda m: m.time == 0.0, 'the start')
        end = self.run_motion()
        last = energies.wait(lambda m: m.time == end, 'the end')
        self.assertAlmostEqual(last.kinetic - self.KINETIC, last.applied + last.reactions, places=9)
        self.assertGreater(abs(last.applied), 1.0)
        self.assertGreater(abs(last.reactions), 0.01)
        energies.close()

        # Without a subscriber, and with one that comes at the end.
        self.node.trigger('reset_time')
        self.assertEqual(self.run_motion(), end)
        energies = self.listen()
        self.addCleanup(energies.close)
        late = energies.all()[0]
        self.assertAlmostEqual(late.kinetic - self.KINETIC, late.applied + late.reactions, places=9)
        self.assertAlmostEqual(late.applied, last.applied,
                               delta=1e-3 * abs(last.applied)
                               + abs(late.applied_power) * 2.0 * (late.time - end))


class TimeoutsTest(TestCase):
    """Commands are overdue 0.05 s of simulated time after the tick that took them."""

    def setUp(self):
        self.node = NodeClient('overdue')
        self.addCleanup(self.node.close)
        self.node.trigger('pause')
        self.node.trigger('reset_time')

    def test_in_lockstep(self):
        answer = self.node.step(0.001, [('kept', 3.0), ('zeroed', 2.0)])
        self.assertEqual(tuple(answer.state.applied_torque), (3.0, 2.0))
        answer = self.node.step(0.048)
        self.assertEqual(tuple(answer.state.applied_torque), (3.0, 2.0))
        self.node.status.wait_new(lambda s: s.command_timeouts == 0)
        answer = self.node.step(0.001)
        self.assertEqual(tuple(answer.state.applied_torque), (3.0, 0.0))
        self.node.status.wait_new(lambda s: s.command_timeouts == 2, 'two timeouts')
        # One is told once; a command ends it.
        answer = self.node.step(1.0)
        self.assertEqual(tuple(answer.state.applied_torque), (3.0, 0.0))
        answer = self.node.step(0.04, [('zeroed', 1.0)])
        self.assertEqual(tuple(answer.state.applied_torque), (3.0, 1.0))
        self.node.status.wait_new(lambda s: s.command_timeouts == 2, 'two timeouts')

    def test_while_running_the_tick_of_receipt_counts(self):
        publishers = [rospy.Publisher('/overdue/' + topic, Float64, queue_size=10)
                      for topic in ('kept', 'zeroed')]
        for publisher in publishers:
            self.addCleanup(publisher.unregister)
            wait_for(lambda p=publisher: p.get_num_connections() > 0, 'the node')
        self.node.trigger('resume')
        wait_for(lambda: len(self.node.states.all()) > 20, 'states')
        for publisher in publishers:
            publisher.publish(Float64(2.0))
        self.node.status.wait_new(lambda s: s.command_timeouts == 2, 'two timeouts')
        self.node.trigger('pause')
        status = self.node.wait_for_state(SimulationStatus.PAUSED)
        self.assertEqual(status.commands_accepted, 2)
        last = self.node.states.wait(lambda m: m.time == status.time, 'the last state')
        self.assertEqual(tuple(last.applied_torque), (2.0, 0.0))
        # Every tick has a state: from the one that took the command to the timeout, 50 of them (51
        # where the sum of the two times is rounded up).
        times = [state.time for state in self.node.states.all() if state.applied_torque[1] == 2.0]
        first = round(times[0] * 1e3)
        self.assertEqual(times, [tick / 1e3 for tick in range(first, first + 52)
                                 if tick / 1e3 < times[0] + 0.05])


class RealTimeTest(TestCase):

    def start(self, name, prefix=()):
        rosparam.upload_params('/' + name, {**rosparam.load_file(STEPS)[0][0],
                                            'realtime_priority': 40, 'lock_memory': True})
        program = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]
        node = subprocess.Popen([*prefix, program, '__name:=' + name], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True,
                                env=dict(os.environ, ROSCONSOLE_STDOUT_LINE_BUFFERED='1'))
        self.addCleanup(node.kill)
        client = NodeClient(name, states=False)
        self.addCleanup(client.close)
        client.status.wait_new(lambda s: s.ticks > 100, 'ticks')
        return node

    def stop(self, node):
        """Returns the node's output; it has to end well."""
        node.send_signal(signal.SIGINT)
        output, _ = node.communicate(timeout=PATIENCE)
        self.assertEqual(node.returncode, 0, output)
        return output

    def fifo_threads(self, node):
        """The priorities of the threads under SCHED_FIFO."""
        priorities = []
        for task in pathlib.Path(f'/proc/{node.pid}/task').iterdir():
            fields = (task / 'stat').read_text(encoding='utf-8').rpartition(')')[2].split()
            if int(fields[38]) == SCHED_FIFO:
                priorities.append(int(fields[37]))
        return priorities

    def locked_memory(self, node):
        """kB"""
        status = pathlib.Path(f'/proc/{node.pid}/status').read_text(encoding='utf-8')
        return int(next(line for line in status.splitlines() if line.startswith('VmLck:')).split()[1])

    @unittest.skipIf(os.geteuid() != 0, 'needs root')
    def test_both_are_given_to_root(self):
        if subprocess.run(['chrt', '-f', '40', 'true'], check=False,
                          stderr=subprocess.DEVNULL).returncode != 0:
            self.skipTest('the kernel gives no real-time priority here')
        node = self.start('permitted')
        self.assertEqual(self.fifo_threads(node), [40])
        self.assertGreater(self.locked_memory(node), 1000)
        self.assertNotIn('not permitted', self.stop(node))

    def test_a_refusal_is_a_warning(self):
        prefix = ['prlimit', '--memlock=65536:65536', '--rtprio=0:0']
        if os.geteuid() == 0:
            prefix += ['setpriv', '--bounding-set=-sys_nice,-ipc_lock']
        node = self.start('refused', prefix)
        self.assertEqual(self.fifo_threads(node), [])
        self.assertEqual(self.locked_memory(node), 0)
        output = self.stop(node)
        self.assertIn('realtime_priority 40 is not permitted', output)
        self.assertIn('lock_memory is not permitted', output)
        self.assertIn('/etc/security/limits.conf', output)


class OverridesTest(TestCase):

    def test_of_the_launch_file_take_the_place_of_values(self):
        node = NodeClient('overridden', states=False)
        self.addCleanup(node.close)
        self.assertEqual([round(v, 6) for v in node.step(1e-9).state.velocity], [5.0, 3.0])
        scene = Listener('/overridden/scene', SceneInfo)
        self.addCleanup(scene.close)
        text = scene.wait().parameters
        self.assertIn('relative_tolerance: 1.0e-07', text)
        self.assertNotIn('overrides', text)

    def test_faults_are_those_of_simulate(self):
        for override, message in (
                ('drvie/inertia=1', "/misspelt/drvie: unknown key (did you mean 'drive'?)"),
                ('drive/inertai=1', "/misspelt/drive/inertai: unknown key (did you mean 'inertia'?)"),
                ('drive/inertia/mean=1', "/misspelt/drive/inertia/mean: 'drive/inertia' is a number"),
                ('drive', "/misspelt: 'drive' is not an override; expected PATH=VALUE")):
            with self.subTest(override=override):
                rosparam.upload_params('/misspelt', {**rosparam.load_file(STEPS)[0][0],
                                                     'overrides': override})
                program = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]
                node = subprocess.run([program, '__name:=misspelt'], stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, text=True, check=False,
                                      timeout=PATIENCE)
                self.assertEqual(node.returncode, 2, node.stdout)
                self.assertIn(message, node.stdout)


class SettingsSuite(unittest.TestSuite):
    """All of the above, for rostest."""

    def __init__(self):
        super().__init__(unittest.defaultTestLoader.loadTestsFromTestCase(case)
                         for case in (LiveSettingsTest, DiagnosticsTest, EnergyTest, TimeoutsTest,
                                      RealTimeTest, OverridesTest))


if __name__ == '__main__':
    rospy.init_node('settings_test')
    rostest.rosrun('variator_sim', 'settings_test', 'settings_test.SettingsSuite', sys.argv)
