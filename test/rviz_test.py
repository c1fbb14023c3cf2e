#!/usr/bin/python3
"""The input of rviz: the URDF of every shipped scene, belts, arrows, markers of a state."""

import importlib.machinery
import importlib.util
import math
import pathlib
import subprocess
import sys
import unittest
from xml.etree import ElementTree

import roslib.packages
import rosunit
import yaml
from variator_sim.msg import DrivetrainState, NamedValues, SceneInfo

FOLDER = pathlib.Path(roslib.packages.get_pkg_dir('variator_sim'))
sys.path.insert(0, str(FOLDER / 'rviz'))

# pylint: disable=wrong-import-position
import shapes
from machine import BELT_SUM, Machine

from support.subtests import TestCase

SCENES = sorted((FOLDER / 'config').glob('**/*.yaml'))


def urdf_of(path, *options):
    run = subprocess.run([sys.executable, str(FOLDER / 'scripts/scene_urdf'), str(path), *options],
                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    return run.returncode, run.stdout, run.stderr


def load_markers():
    """The program as a module; None where its messages are not installed."""
    path = str(FOLDER / 'scripts/drivetrain_markers')
    loader = importlib.machinery.SourceFileLoader('drivetrain_markers', path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    try:
        loader.exec_module(module)
    except ImportError:
        return None
    return module


class UrdfTest(TestCase):

    def test_a_reader_that_goes_away(self):
        process = subprocess.Popen([sys.executable, str(FOLDER / 'scripts/scene_urdf'), str(SCENES[0])],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        process.stdout.close()
        self.assertEqual((process.stderr.read(), process.wait(timeout=60)), ('', 0))
        process.stderr.close()

    def test_every_shipped_scene_has_its_shafts_as_joints(self):
        self.assertGreater(len(SCENES), 5)
        for path in SCENES:
            with self.subTest(path=path.name):
                scene = yaml.safe_load(path.read_text(encoding='utf-8'))
                status, text, errors = urdf_of(path, '--frame', 'a/b')
                self.assertEqual(status, 0, errors)
                robot = ElementTree.fromstring(text)
                joints = robot.findall('joint')
                self.assertEqual([joint.get('name') for joint in joints], scene['shafts'])
                links = [link.get('name') for link in robot.findall('link')]
                self.assertEqual(links, ['a/b'] + ['a/b/' + name for name in scene['shafts']])
                for joint in joints:
                    self.assertEqual(joint.find('parent').get('link'), 'a/b')
                    self.assertIn(joint.find('child').get('link'), links)

    def test_what_is_no_scene_is_named(self):
        status, text, errors = urdf_of('/dev/null')
        self.assertEqual((status, text), (1, ''))
        self.assertIn("/dev/null: no list 'shafts'", errors)


class MachineTest(TestCase):

    def test_who_is_joined(self):
        car = Machine(yaml.safe_load((FOLDER / 'config/applications/car.yaml').read_text()))
        self.assertEqual([(belt.name, belt.shafts) for belt in car.belts], [('variator', [1, 2])])
        self.assertEqual([(link.name, link.shafts) for link in car.links], [('clutch', [0, 1])])
        ship = Machine(yaml.safe_load((FOLDER / 'config/ship.yaml').read_text()))
        self.assertEqual([belt.shafts for belt in ship.belts], [[0, 1]])
        self.assertGreater(ship.shafts[1].radius, ship.shafts[0].radius)

    def test_pulleys_turn_as_the_belt_runs(self):
        for ratio in (0.2, 1.0, 3.0):
            r_a, r_b = shapes.pulley_radii(ratio, BELT_SUM)
            self.assertAlmostEqual(r_a + r_b, BELT_SUM)
            self.assertAlmostEqual(r_a / r_b, ratio)  # w_a r_a = w_b r_b
        for extreme in (0.0, 1e9, -3.0):
            self.assertTrue(all(0.0 < r < BELT_SUM for r in shapes.pulley_radii(extreme, BELT_SUM)))

    def test_the_belt_touches_its_pulleys(self):
        for crossed in (False, True):
            with self.subTest(crossed=crossed):
                self.check_belt(shapes.belt(0.0, 0.4, 1.25, 0.1, crossed), crossed)

    def check_belt(self, curve, crossed):
        self.assertEqual(curve[0], curve[-1])
        for x, z in curve:
            near = min(abs(math.hypot(x, z) - 0.4), abs(math.hypot(x - 1.25, z) - 0.1))
            self.assertLess(near, 1e-12)
        # Between them it is straight and tangent: orthogonal to the radii where it leaves.
        begin, end = curve[-2], curve[-1]
        along = (end[0] - begin[0], end[1] - begin[1])
        self.assertAlmostEqual(along[0] * end[0] + along[1] * end[1], 0.0)
        # Along the belt both pulleys turn counterclockwise, crossed the second one clockwise.
        (x0, z0), (x1, z1) = curve[37:39]
        turn = (x0 - 1.25) * (z1 - z0) - z0 * (x1 - x0)
        self.assertEqual(turn < 0.0, crossed)
        length = sum(math.dist(a, b) for a, b in zip(curve, curve[1:]))
        dots = shapes.along(curve, 0.2, 0.05)
        self.assertEqual(len(dots), int((length - 0.05) / 0.2) + 1)

    def test_arrows_turn_as_torques_do(self):
        for sweep in (2.0, -2.0):
            line, head = shapes.torque_arrow((1.0, 0.0), 0.5, sweep)
            self.assertAlmostEqual(line[0][0], 1.0)
            tip = math.atan2(head[1][1], head[1][0] - 1.0) - 0.5 * math.pi
            self.assertAlmostEqual(math.remainder(tip - sweep, 2.0 * math.pi), 0.0)
        self.assertEqual(shapes.torque_arrow((1.0, 0.0), 0.5, 0.0), ([], []))


class MarkersTest(TestCase):

    def setUp(self):
        self.module = load_markers()
        if self.module is None:
            self.skipTest('python3-visualization-msgs is not installed')

    def test_the_same_markers_for_every_state(self):
        scene = SceneInfo(parameters=(FOLDER / 'config/applications/car.yaml').read_text())
        drawing = self.module.Drawing(scene, 'car')

        def draw(time, speeds, torque):
            state = DrivetrainState(time=time, angle=[1.0] * 3, velocity=speeds,
                                    applied_torque=[torque] * 3, reaction_torque=[0.0] * 3)
            markers = drawing.draw(state).markers
            for marker in markers:
                self.assertEqual(marker.header.frame_id, 'car')
                self.assertTrue(all(math.isfinite(value) for spot in marker.points
                                    for value in (spot.x, spot.y, spot.z)))
            self.assertEqual(len({marker.id for marker in markers}), len(markers))
            return markers

        first = draw(0.0, [85.0, 0.0, 0.0], 0.0)
        second = draw(0.04, [85.0, 50.0, 5.0], 20.0)
        third = draw(0.08, [85.0, 50.0, 5.0], float('nan'))
        self.assertEqual([marker.id for marker in first], [marker.id for marker in second])
        texts = [marker.text for marker in second]
        self.assertIn('variator 0.100', texts)
        self.assertIn('variator', [marker.text for marker in first])  # it stands: not known
        self.assertTrue(any('engine\n85.0 rad/s\napplied 20.0 N m' in text for text in texts))
        self.assertEqual([marker.id for marker in third], [marker.id for marker in second])

    def test_elements_that_hold_have_the_colour_of_their_mode(self):
        scene = SceneInfo(parameters='shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 0}\ntorques: [lock]\n'
                          'lock: {type: variator_sim/Clutch, shafts: [a, b], capacity: 3}\n')
        drawing = self.module.Drawing(scene, 'machine')
        state = DrivetrainState(angle=[0.0] * 2, velocity=[0.0] * 2, applied_torque=[0.0] * 2,
                                reaction_torque=[0.0] * 2)
        for mode, colour in ((None, 'link'), (0.0, 'stuck'), (-1.0, 'slides'), (1.0, 'slides'), (2.0, 'free')):
            if mode is not None:
                drawing.take_elements(NamedValues(name=['lock/slip', 'lock/mode'], value=[0.0, mode]))
            bar = drawing.draw(state).markers[0].color
            self.assertEqual((bar.r, bar.g, bar.b), self.module.COLOURS[colour])


class RvizSuite(unittest.TestSuite):
    """All of the above, for rosunit."""

    def __init__(self):
        super().__init__(unittest.defaultTestLoader.loadTestsFromTestCase(case)
                         for case in (UrdfTest, MachineTest, MarkersTest))


if __name__ == '__main__':
    rosunit.unitrun('variator_sim', 'rviz_test', 'rviz_test.RvizSuite')
