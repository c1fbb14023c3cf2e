#!/usr/bin/python3
"""Scenes on the parameter server: every shipped one starts the node, bad ones end it by name."""

import glob
import os
import signal
import subprocess
import sys
import time

import roslib.packages
import rosparam
import rospy
import rospkg
import rostest
import yaml

from support.subtests import TestCase
from variator_sim.msg import SceneInfo, SimulationStatus

PATIENCE = 30.0  # s; only a failure takes as long
PACKAGE = rospkg.RosPack().get_path('variator_sim')

GOOD = """
shafts: [drive, load]
drive: {inertia: 0.5}
load: {inertia: 1.2}
torques: [engine]
engine: {type: variator_sim/CommandedTorque, shaft: drive, topic: drive_torque}
constraints: [variator]
variator:
  type: variator_sim/ExpressionConstraint
  order: 2
  expression: "0.5*(e2-0.8*e1)+w2-0.8*w1"
initial: {velocity: [10.0, 8.0]}
"""


def node_path():
    return roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]


def start(name, folder=None):
    return subprocess.Popen([node_path(), '__name:=' + name], stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True, cwd=folder)


def load(name, scene):
    if rospy.has_param('/' + name):
        rospy.delete_param('/' + name)
    rosparam.upload_params('/' + name, scene)


class ScenesTest(TestCase):
    def expect_refusal(self, name, scene, *parts):
        """The node ends with status 2 and a message that holds all parts."""
        load(name, scene)
        node = start(name)
        try:
            output, _ = node.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            node.kill()
            output, _ = node.communicate()
            self.fail('the node went on: ' + output)
        self.assertEqual(node.returncode, 2, output)
        for part in parts:
            self.assertIn(part, output)

    def check_starts(self, name, scene, folder=None):
        load(name, scene)
        node = start(name, folder)
        try:
            info = rospy.wait_for_message('/%s/scene' % name, SceneInfo, PATIENCE)
            self.assertEqual(info.shafts, scene['shafts'])
            self.assertEqual(info.torques, scene.get('torques', []))
            self.assertEqual(info.constraints, scene.get('constraints', []))
            parameters = yaml.safe_load(info.parameters)
            for shaft in info.shafts:
                self.assertIn(shaft, parameters)
            status = rospy.wait_for_message('/%s/status' % name, SimulationStatus, PATIENCE)
            self.assertEqual(status.state, SimulationStatus.RUNNING, status.message)
            begin = time.monotonic()
            node.send_signal(signal.SIGINT)
            node.wait(PATIENCE)
            self.assertLess(time.monotonic() - begin, 5.0)
            self.assertEqual(node.returncode, 0)
        finally:
            if node.poll() is None:
                node.kill()
            output, _ = node.communicate()
            print(output)
        return output

    def test_every_shipped_scene_starts(self):
        files = sorted(glob.glob(os.path.join(PACKAGE, 'config', '**', '*.yaml'), recursive=True))
        self.assertTrue(files)
        simulate = roslib.packages.find_node('variator_sim', 'simulate')[0]
        for file in files:
            with self.subTest(file=file):
                subprocess.run([simulate, file, '--duration', '0.01'], check=True,
                               stdout=subprocess.DEVNULL, timeout=PATIENCE)
                # As roslaunch reads it; files of a scene are found from the node's folder.
                scene = rosparam.load_file(file)[0][0]
                name = os.path.basename(file)[:-5]
                output = self.check_starts('shipped_' + name, scene, os.path.dirname(file))
                # Its ratio alone follows a speed under `gauss`.
                self.assertEqual(output.count('take or give energy'), int(name == 'vbelt_vehicle'), output)

    def test_a_scene_with_a_delay_starts(self):
        scene = yaml.safe_load(GOOD)
        scene['torques'].append('governor')
        scene['governor'] = {'type': 'variator_sim/ExpressionTorque', 'shaft': 'drive', 'torque': '10 - delay(w1, 0.04)'}
        self.check_starts('delayed', scene)

    def test_launch_file(self):
        info = rospy.wait_for_message('/launched/scene', SceneInfo, PATIENCE)
        self.assertEqual(info.shafts, ['drive', 'load'])
        self.assertEqual(rospy.get_param('/launched/publish_rate'), 50)

    def test_bad_scenes_end_the_node_by_name(self):
        cases = [
            ({'variator/expression': 'tau*e2'}, '/bad/variator/expression: ', 'tau'),
            ({'engine/shaft': 'drve'}, '/bad/engine/shaft: ', "'drive'"),
            ({'engine/type': 'variator_sim/ComandedTorque'}, '/bad/engine/type: ',
             'variator_sim/CommandedTorque'),
            ({'drive/inertia': -1.0}, '/bad/drive/inertia: '),
            ({'drive/inertia': float('nan')}, '/bad/drive/inertia: '),
            ({'initail': 1}, '/bad/initail: ', "'initial'"),
            ({'engine/topic': 'state'}, '/bad/engine/topic: ', 'state'),
            ({'engine/topic': '2 words'}, '/bad/engine/topic: '),
            ({'tick_rate': 0}, '/bad/tick_rate: '),
            ({'publish_rate': 2000}, '/bad/publish_rate: ', 'tick_rate'),
            ({'publish_rate': 1e-17}, '/bad/publish_rate: ', '0.001'),
            ({'publish_clock': 'perhaps'}, '/bad/publish_clock: '),
            ({'real_time_factor': 0.0001}, '/bad/real_time_factor: ', '0.001'),
        ]
        for changes, *parts in cases:
            with self.subTest(changes=changes):
                scene = yaml.safe_load(GOOD)
                for path, value in changes.items():
                    section = scene
                    *sections, key = path.split('/')
                    for part in sections:
                        section = section[part]
                    section[key] = value
                self.expect_refusal('bad', scene, *parts)

    def test_keys_of_an_earlier_scene_are_told(self):
        # `rosparam set` and `rosparam load` merge dictionaries.
        load('merged', yaml.safe_load(GOOD))
        rosparam.upload_params('/merged', {'variator': {'type': 'variator_sim/SlipRatio', 'shafts': ['drive', 'load'],
                                                        'ratio': 0.8, 'time_constant': 0.5}})
        output, _ = start('merged').communicate(timeout=PATIENCE)
        self.assertIn('/merged/variator/expression: unknown key', output)
        self.assertIn("until 'rosparam delete /merged/variator'", output)
        rospy.delete_param('/merged/variator')
        scene = yaml.safe_load(GOOD)
        scene['variator'] = {'type': 'variator_sim/SlipRatio', 'shafts': ['drive', 'load'], 'ratio': 0.8,
                             'time_constant': 0.5}
        scene['engine']['initial'] = 5.0  # without a torque it would rest
        self.check_starts('merged', scene)

    def test_a_value_in_place_of_a_scene_is_told(self):
        for value, words in ((5, 'an integer: 5'), ([1], 'a list: [1]'), ('text', 'a text: text')):
            rospy.set_param('/no_scene', value)
            node = start('no_scene')
            output, _ = node.communicate(timeout=PATIENCE)
            self.assertEqual(node.returncode, 2, output)
            self.assertIn(f"/no_scene: a scene (dictionary) is expected, got {words}; 'rosparam delete /no_scene'", output)
            rospy.delete_param('/no_scene')

    def test_no_scene_at_all(self):
        node = start('empty')
        output, _ = node.communicate(timeout=PATIENCE)
        self.assertEqual(node.returncode, 2, output)
        self.assertIn('/empty: no parameters', output)


if __name__ == '__main__':
    rospy.init_node('scenes_test', anonymous=True)
    rostest.rosrun('variator_sim', 'scenes_test', ScenesTest, sys.argv)
