#!/usr/bin/python3
"""One node owns /clock and others follow it, in lockstep and in real time."""

import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

import roslib.packages
import rosparam
import rospkg
import rospy
import rostest
from rosgraph_msgs.msg import Clock, Log
from variator_sim.msg import SimulationStatus

from support.node_client import Listener, NodeClient, wait_for

PACKAGE = pathlib.Path(rospkg.RosPack().get_path('variator_sim'))
STEPS = PACKAGE / 'test/cases/torque_steps/scene.yaml'
TICK = 1000000  # ns


class ClockTest(unittest.TestCase):
    """The tests share one master and one clock: they run in the order of their names."""

    @classmethod
    def setUpClass(cls):
        cls.owner = NodeClient('owner')
        cls.follower = NodeClient('follower')
        cls.hasty = NodeClient('hasty', states=False)

    def time_of(self, node):
        """Simulated time of the node's last status, ns."""
        return round(node.status.all()[-1].time * 1e9)

    def wait_for_time(self, node, time):
        node.status.wait_new(lambda status: round(status.time * 1e9) == time,
                             f'a time of {time} ns')

    def test_1_time_waits_for_a_clock(self):
        self.assertEqual(rospy.Time.now().to_nsec(), 0)
        for node in (self.follower, self.hasty):
            status = node.status.wait_new()
            self.assertEqual(status.state, SimulationStatus.RUNNING)
            self.assertEqual(status.time, 0.0)
            self.assertEqual(status.ticks, 0)

    def test_2_a_step_moves_all_clocks(self):
        clock = Listener('/clock', Clock).connect()
        first = self.owner.step(0.25)
        self.assertTrue(first.success, first.message)
        clock.wait(lambda m: m.clock.to_nsec() == 250000000, 'the time of the step')
        # The followers' first tick counts from the first time they see, which stamps tell: their own time was 0 before.
        wait_for(lambda: rospy.Time.now().to_nsec() == 250000000, 'ROS time')
        for node in (self.follower, self.hasty):
            for _ in range(2):
                node.status.wait_new(lambda s: s.header.stamp.to_nsec() == 250000000, 'a stamp of 0.25 s')
            self.wait_for_time(node, 0)
        second = self.owner.step(0.5)
        self.assertTrue(second.success, second.message)
        for node in (self.follower, self.hasty):
            self.wait_for_time(node, 500000000)
        last = self.follower.states.wait(lambda m: m.time == 0.5, 'the state at 0.5 s')
        self.assertEqual(last.header.stamp.to_nsec(), 750000000)
        # All states on the way were made, at their instants on /clock.
        states = [m for m in self.follower.states.all() if m.time > 0.0]
        self.assertEqual([m.time for m in states], [n / 100 for n in range(1, 51)])
        for state in states:
            self.assertEqual(state.header.stamp.to_nsec(), round(state.time * 1e9) + 250000000)
        self.assertEqual(self.owner.states.wait(lambda m: m.time == 0.75).header.stamp.to_nsec(),
                         750000000)
        clock.close()

    def test_2b_a_late_subscriber_is_told_a_time_that_stands(self):
        program = ("import rospy; rospy.init_node('late')\n"
                   "while rospy.Time.now().is_zero(): rospy.rostime.wallsleep(0.01)\n"
                   "print(rospy.Time.now().to_nsec())")
        output = subprocess.run([sys.executable, '-c', program], check=True, timeout=30.0,
                                stdout=subprocess.PIPE, text=True).stdout
        self.assertEqual(output.strip(), '750000000')

    def test_3_running_owner_is_followed(self):
        clock = Listener('/clock', Clock).connect()
        self.owner.states.forget()
        self.assertTrue(self.owner.trigger('resume').success)
        self.owner.status.wait_new(lambda s: s.time > 1.5, 'half a second of running')
        self.assertTrue(self.owner.trigger('pause').success)
        end = round(self.owner.wait_for_state(SimulationStatus.PAUSED).time * 1e9)
        clock.wait(lambda m: m.clock.to_nsec() == end, 'the time of the pause')
        for node in (self.follower, self.hasty):
            self.wait_for_time(node, end - 250000000)
        times = [m.clock.to_nsec() for m in clock.all()]
        self.assertEqual(times, sorted(times))
        # /clock comes with the states: 100 Hz.
        self.assertGreater(len(set(times)), 50)
        for state in self.owner.states.all():
            self.assertEqual(state.header.stamp.to_nsec(), round(state.time * 1e9))
        status = self.follower.status.wait_new()
        self.assertEqual(status.overruns, 0)
        self.assertEqual(status.lost_wall_time, 0.0)
        # While the clock stands, simulated time makes no headway.
        self.follower.status.wait_new(lambda s: s.real_time_factor == 0.0, 'a pause of the clock')
        clock.close()

    def test_4_a_clock_that_jumps_back_starts_followers_anew(self):
        self.follower.states.forget()
        before = self.follower.states.all()
        self.assertEqual(before, [])
        self.assertTrue(self.owner.trigger('reset_time').success)
        self.follower.states.wait(lambda m: m.time == 0.0, 'the initial state')
        for node in (self.follower, self.hasty):
            self.wait_for_time(node, 0)
        self.assertTrue(self.owner.step(0.1).success)
        for node in (self.follower, self.hasty):
            self.wait_for_time(node, 100000000)
        # The same motion in both, and the same stamps: both began at the clock's zero.
        of_owner = self.owner.states.wait(lambda m: m.time == 0.1)
        of_follower = self.follower.states.wait(lambda m: m.time == 0.1)
        self.assertEqual(of_owner.velocity, of_follower.velocity)
        self.assertEqual(of_owner.header.stamp, of_follower.header.stamp)

    def test_4b_jumps_back_are_logged_once_a_second(self):
        log = Listener('/rosout', Log).connect()
        begin = time.monotonic()
        for _ in range(20):
            self.assertTrue(self.owner.trigger('reset_time').success)
            self.wait_for_time(self.follower, 0)
            self.assertTrue(self.owner.step(0.01).success)
            self.wait_for_time(self.follower, 10000000)
        log.wait(lambda m: m.name == '/follower' and 'jumped back' in m.msg, 'a jump')
        told = [m for m in log.all() if m.name == '/follower' and 'jumped back' in m.msg]
        self.assertLessEqual(len(told), time.monotonic() - begin + 2)
        log.close()

    def test_5_lockstep_of_an_owner_gives_the_bytes_of_simulate(self):
        self.assertTrue(self.owner.trigger('reset_time').success)
        now = 0  # ns
        rows = []
        with tempfile.TemporaryDirectory() as folder:
            commands = pathlib.Path(folder, 'commands.csv')
            lines = ['time,topic,value']
            for i in range(200):
                given = []
                if i % 10 == 0:
                    given = [('drive_torque', 4.0 + 0.1 * i), ('load_torque', 2.0 - 0.01 * i)]
                lines += [f'{now / 1e9!r},{topic},{value!r}' for topic, value in given]
                duration = TICK + 333 * i
                answer = self.owner.step(duration / 1e9, given)
                self.assertTrue(answer.success, answer.message)
                now += duration
                self.assertEqual(answer.state.header.stamp.to_nsec(), now)
                # `simulate` shows an instant after its commands, ~step before those of the next.
                if i % 10 != 9:
                    rows.append(answer.state)
            commands.write_text('\n'.join(lines) + '\n', encoding='utf-8')
            simulate = roslib.packages.find_node('variator_sim', 'simulate')[0]
            output = subprocess.run(
                [simulate, str(STEPS), '--commands', str(commands), '--duration', repr(now / 1e9),
                 '--times', ','.join(repr(row.time) for row in rows)],
                check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
        self.assertEqual(len(output), 1 + len(rows))
        for line, state in zip(output[1:], rows):
            expected = [state.time]
            for n in range(2):
                expected += [state.angle[n], state.velocity[n], state.acceleration[n],
                             state.applied_torque[n], state.reaction_torque[n],
                             state.reaction_torque_rate[n]]
            expected += [state.residual[0], state.multiplier[0]]
            self.assertEqual([float(word) for word in line.split(',')], expected)

    def test_6_a_second_clock_is_told_by_name(self):
        log = Listener('/rosout', Log).connect()
        self.addCleanup(log.close)
        rosparam.upload_params('/second', {**rosparam.load_file(str(STEPS))[0][0], 'publish_clock': True})
        program = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]
        # (It warns before a subscriber of its log can connect.)
        output = tempfile.NamedTemporaryFile()
        self.addCleanup(output.close)
        second = subprocess.Popen([program, '__name:=second'], stdout=output, stderr=subprocess.STDOUT)
        self.addCleanup(second.wait)
        self.addCleanup(second.kill)
        wait_for(lambda: b'/second: publish_clock is true, and /clock is published by /owner, too'
                 in pathlib.Path(output.name).read_bytes(), 'a warning')
        self.owner.trigger('resume')
        log.wait(lambda m: m.name == '/follower' and '/clock comes from ' in m.msg and '/owner' in m.msg
                 and '/second' in m.msg, 'a warning of the follower')


if __name__ == '__main__':
    rospy.init_node('clock_test')
    rostest.rosrun('variator_sim', 'clock_test', ClockTest, sys.argv)
