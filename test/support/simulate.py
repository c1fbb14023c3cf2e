"""A test case that runs `simulate`, in a folder of its own."""

import os
import pathlib
import subprocess
import tempfile

import roslib.packages

from support.subtests import TestCase

SIMULATE = roslib.packages.find_node("variator_sim", "simulate")[0]


class SimulateTestCase(TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        # No master is needed. Machine code is made for the test alone.
        self.environment = dict(os.environ, ROS_MASTER_URI="http://localhost:1",
                                VARIATOR_SIM_CACHE=str(self.folder / "cache"))

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    def simulate(self, *arguments, **options):
        options.setdefault("stdout", subprocess.PIPE)
        return subprocess.run([SIMULATE, *arguments], stderr=subprocess.PIPE, text=True,
                              env=self.environment, timeout=60, check=False, **options)

    def check_simulate(self, *arguments):
        """The same where it has to end well."""
        result = self.simulate(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def check_refused(self, arguments, *words, status=2):
        result = self.simulate(*arguments)
        self.assertEqual(result.returncode, status, result.stderr)
        if status == 2:
            self.assertEqual(result.stdout, "")
        for word in words:
            self.assertIn(word, result.stderr)
