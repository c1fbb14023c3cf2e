"""A test case that runs `simulate`, in a folder of its own."""

import os
import pathlib
import subprocess

import roslib.packages

from support.subtests import FolderTestCase

SIMULATE = roslib.packages.find_node("variator_sim", "simulate")[0]


def fake_compiler(folder, script):
    """A search path whose compiler is the script, of sh, written to the folder."""
    compiler = pathlib.Path(folder, "bin/cc")
    compiler.parent.mkdir()
    compiler.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    compiler.chmod(0o755)
    return f"{compiler.parent}:/usr/bin:/bin"


def call(*words, **options):
    """What a program does: its status and texts."""
    return subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                          timeout=300.0, **options)


def parse(text):
    """Header and rows of a CSV text; the rows as floats."""
    lines = text.splitlines()
    return lines[0].split(","), [[float(word) for word in line.split(",")] for line in lines[1:]]


class SimulateTestCase(FolderTestCase):

    def setUp(self):
        super().setUp()
        # No master is needed. Machine code is made for the test alone.
        self.environment = dict(os.environ, ROS_MASTER_URI="http://localhost:1",
                                VARIATOR_SIM_CACHE=str(self.folder / "cache"))

    def simulate(self, *arguments, **options):
        options.setdefault("stdout", subprocess.PIPE)
        return subprocess.run([SIMULATE, *arguments], stderr=subprocess.PIPE, text=True,
                              env=self.environment, timeout=60, check=False, **options)

    def check_simulate(self, *arguments, **options):
        """The same where it has to end well."""
        result = self.simulate(*arguments, **options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def check_refused(self, arguments, *words, status=2):
        result = self.simulate(*arguments)
        self.assertEqual(result.returncode, status, result.stderr)
        if status == 2:
            self.assertEqual(result.stdout, "")
        for word in words:
            self.assertIn(word, result.stderr)
