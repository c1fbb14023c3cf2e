#!/usr/bin/python3
"""~get_state, ~set_state and ~commands of a running node."""

import sys
import unittest

import rospy
import rostest
from variator_sim.msg import Commands, SimulationStatus
from variator_sim.srv import GetState, SetState

from support.node_client import NodeClient, wait_for
from support.subtests import TestCase

VALUES = ('angle', 'velocity', 'acceleration', 'applied_torque', 'reaction_torque',
          'reaction_torque_rate')


def values(state):
    return [getattr(state, name) for name in VALUES]


class StatesTest(TestCase):

    def setUp(self):
        self.saved = self.client('saved')
        self.restored = self.client('restored')

    def client(self, name):
        client = NodeClient(name, states=False)
        self.addCleanup(client.close)
        client.trigger('reset_time')
        return client

    def get(self, node):
        response = node.call('get_state', GetState)
        self.assertTrue(response.success, response.message)
        return response

    def set(self, node, text='', project=False, **arrays):
        return node.call('set_state', SetState, text, arrays.get('angle', []),
                         arrays.get('velocity', []), arrays.get('acceleration', []), project)

    def run_on(self, node):
        """0.4 s in steps, with a command on the way."""
        states = []
        for n in range(8):
            response = node.step(0.05, [('drive_torque', 9.0)] if n == 3 else [])
            self.assertTrue(response.success, response.message)
            states.append(values(response.state))
        return states

    def test_another_node_goes_on_to_the_bit(self):
        self.assertTrue(self.saved.step(0.123, [('drive_torque', 4.0), ('load_torque', 2.0)]).success)
        state = self.get(self.saved)
        self.restored.step(1.0, [('drive_torque', -3.0)])
        answer = self.set(self.restored, state.text)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(values(answer.state), values(state.state))
        # Messages go on in their own time, the motion in that of the state.
        self.assertEqual((state.state.time, answer.state.time), (0.123, 1.0))
        self.assertEqual(self.run_on(self.saved), self.run_on(self.restored))
        self.assertEqual(self.restored.step(0.1).state.time, 1.5)

    def test_what_is_not_given_stays(self):
        self.saved.step(0.5, [('drive_torque', 4.0)])
        before = self.get(self.saved).state
        answer = self.set(self.saved, velocity=[12.0, 7.0])
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(list(answer.state.velocity), [12.0, 7.0])
        self.assertEqual(answer.state.angle, before.angle)
        self.assertEqual(answer.state.applied_torque[0], 4.0)
        self.assertLess(abs(answer.state.residual[0]), 1e-9)
        answer = self.set(self.saved, 'shafts: {load: {velocity: 3}}\ninputs: {load_torque: {value: 2}}')
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(list(answer.state.velocity), [12.0, 3.0])
        # The brake's gain is -1, friction takes 0.3 N m s of 3 rad/s.
        self.assertAlmostEqual(answer.state.applied_torque[1], -2.9)
        self.assertTrue(self.saved.step(0.1).success)

    def test_inconsistent_states_are_refused_or_projected(self):
        self.saved.step(0.5)
        before = self.get(self.saved)
        answer = self.set(self.saved, acceleration=[5.0, 5.0])
        self.assertFalse(answer.success)
        for word in ('accelerations [5, 5]', "residual of 'variator'", 'consistent accelerations near them are'):
            self.assertIn(word, answer.message)
        self.assertEqual(self.get(self.saved).text, before.text)
        answer = self.set(self.saved, acceleration=[5.0, 5.0], project=True)
        self.assertTrue(answer.success, answer.message)
        self.assertNotEqual(list(answer.state.acceleration), [5.0, 5.0])
        self.assertLess(abs(answer.state.residual[0]), 1e-9)

    def test_faults_change_nothing(self):
        self.saved.step(0.25)
        before = self.get(self.saved).text
        for arguments, words in (
                ({}, 'nothing is to be set'),
                ({'velocity': [1.0]}, 'velocity has 1 values'),
                ({'angle': [1.0, float('nan')]}, 'angle'),
                ({'text': 'shafts: {laod: {angle: 1}}'}, "did you mean 'load'?"),
                ({'text': 'shafts: ['}, 'text:'),
                ({'text': 'time: 0.1234567891234'}, 'whole nanoseconds'),
                ({'text': 'time: 1e300'}, 'time'),
                ({'text': before.replace('  energy:', '  enregy:')}, 'history/energy')):
            with self.subTest(arguments=arguments):
                answer = self.set(self.saved, **arguments)
                self.assertFalse(answer.success)
                self.assertIn(words, answer.message)
                self.assertEqual(self.get(self.saved).text, before)

    def test_while_running(self):
        node = NodeClient('running', states=False)
        self.addCleanup(node.close)
        state = self.get(node)
        node.status.wait_new(lambda s: s.time > state.state.time + 0.2, 'a later time')
        answer = self.set(node, state.text)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(values(answer.state), values(state.state))
        self.assertGreater(answer.state.time, state.state.time)
        node.status.wait_new(lambda s: s.time > answer.state.time + 0.2, 'a later time')

    def test_a_stopped_motion_has_no_state_to_go_on_from(self):
        node = self.client('stopping')
        node.step(100.0)
        node.wait_for_state(SimulationStatus.STOPPED)
        for answer in (node.call('get_state', GetState), self.set(node, 'time: 0')):
            self.assertFalse(answer.success)
            self.assertIn('~reset', answer.message)
            self.assertIn('NonFiniteValue', answer.message)
        node.trigger('reset')
        self.assertTrue(node.call('get_state', GetState).success)


class CommandsTest(TestCase):

    def setUp(self):
        self.node = NodeClient('saved', states=False)
        self.addCleanup(self.node.close)
        self.node.trigger('reset_time')
        self.node.status.wait_new(lambda s: s.commands_refused == 0, 'a reset')
        self.publisher = rospy.Publisher('/saved/commands', Commands, queue_size=100)
        self.addCleanup(self.publisher.unregister)
        wait_for(lambda: self.publisher.get_num_connections() > 0, 'the node')

    def publish(self, topics, numbers):
        self.publisher.publish(Commands(topics=topics, values=numbers))

    def test_they_take_effect_together(self):
        # Not at the start, where commands are initial values.
        self.node.step(0.25)
        self.publish(['load_torque', 'drive_torque'], [2.0, 7.0])
        self.node.status.wait_new(lambda s: s.commands_accepted == 2, 'two commands')
        together = self.node.step(0.1).state
        self.node.status.wait_new(lambda s: s.jumps == 1, 'one jump')
        self.assertEqual(together.applied_torque[0], 7.0)
        self.node.trigger('reset_time')
        self.node.step(0.25)
        in_step = self.node.step(0.1, [('drive_torque', 7.0), ('load_torque', 2.0)]).state
        self.assertEqual(values(together), values(in_step))

    def test_bad_ones_are_refused_as_a_whole_and_counted(self):
        self.node.step(0.25)
        bad = ((['drive_torque', 'laod_torque'], [7.0, 1.0]),
               (['drive_torque', 'drive_torque'], [7.0, 1.0]),
               (['drive_torque'], [float('nan')]),
               (['drive_torque'], [1.0, 2.0]),
               (['x' * 1000000], [1.0]),
               ([''], [1.0]))
        for count, (topics, numbers) in enumerate(bad, 1):
            self.publish(topics, numbers)
            status = self.node.status.wait_new(lambda s, n=count: s.commands_refused == n, 'a count')
            self.assertEqual(status.commands_accepted, 0)
        self.assertEqual(self.node.step(0.1).state.applied_torque[0], 0.0)
        self.publish(['drive_torque'], [3.0])
        self.node.status.wait_new(lambda s: s.commands_accepted == 1, 'a command')


class StatesSuite(unittest.TestSuite):
    """All of the above, for rostest."""

    def __init__(self):
        super().__init__(unittest.defaultTestLoader.loadTestsFromTestCase(case)
                         for case in (StatesTest, CommandsTest))


if __name__ == '__main__':
    rospy.init_node('states_test')
    rostest.rosrun('variator_sim', 'states_test', 'states_test.StatesSuite', sys.argv)
