#!/usr/bin/python3
"""A subtest that fails is told by name in what rosunit writes, and so are those behind it."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosunit

PACKAGE = "variator_sim"
SOME_FAIL = """
import rosunit
from support.subtests import TestCase

class Numbers(TestCase):
    def test_numbers(self):
        for number in range(4):
            with self.subTest(number=number):
                self.assertEqual(number % 2, 0, "odd")
    def test_right(self):
        with self.subTest("right"):
            pass
    def test_skipped(self):
        with self.subTest("left out"):
            self.skipTest("no")

rosunit.unitrun("variator_sim", "numbers", Numbers)
"""


class SubtestsTest(unittest.TestCase):

    def test_all_that_fail_are_named(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "numbers.py")
            file.write_text(SOME_FAIL, encoding="utf-8")
            result = subprocess.run(
                [sys.executable, str(file), f"--gtest_output=xml:{folder}/numbers.xml"], text=True, timeout=60,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
                env={**os.environ, "PYTHONPATH": f"{pathlib.Path(__file__).parent}:{os.environ['PYTHONPATH']}"})
            report = pathlib.Path(folder, "numbers.xml").read_text(encoding="utf-8")
        self.assertEqual(result.returncode, 1, result.stdout)
        for text in (result.stdout, report):
            self.assertIn("2 subtests failed", text)
            for words in ("subtest number=1:", "subtest number=3:", "odd", "numbers.py"):
                self.assertIn(words, text)
            self.assertNotIn("number=2", text)
        self.assertIn("FAILURES: 1 [test_numbers]", result.stdout)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "subtests_test", SubtestsTest)
