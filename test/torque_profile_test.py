#!/usr/bin/python3
"""torque_profile says what is wrong with its arguments and its file, in time and without a traceback."""

import os
import subprocess
import sys
import tempfile

import rosunit

from support.subtests import TestCase

SCRIPT = os.path.join(os.path.dirname(__file__), "..", "scripts", "torque_profile")
GOOD = "time,topic,value\n0.5,drive_torque,3\n"
# No master listens here.
ENVIRONMENT = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:9", ROS_IP="127.0.0.1")

BAD_FILES = {
    "empty": ("", "ends before its header"),
    "other header": ("t,topic,value\n", "is not the header"),
    "a column less": ("time,topic,value\n1,a\n", ":2: '1,a' does not have three columns"),
    "a column more": ("time,topic,value\n1,a,2,3\n", "three columns"),
    "no number": ("time,topic,value\nx,a,2\n", "time 'x' is not a number"),
    "Python's number": ("time,topic,value\n1_0,a,2\n", "time '1_0' is not a number"),
    "infinite time": ("time,topic,value\ninf,a,2\n", "not a finite number"),
    "time before the start": ("time,topic,value\n-1,a,2\n", "not a finite number >= 0"),
    "NUL in a topic": ("time,topic,value\n1,a\0b,2\n", "topic 'a\\x00b' is not"),
    "no topic": ("time,topic,value\n1,,2\n", "topic '' is not"),
    "a topic of another": ("time,topic,value\n1,/a,2\n", "topic '/a' is not"),
    "a long line": ("time,topic,value\n" + "x" * 2000000 + "\n", "does not have three columns"),
    "a value that is no number": ("time,topic,value\n1,a,nan\n", ":2: value 'nan' of 'a' is not a finite number"),
    "no text": (b"\xff\xfe", "can't decode"),
}


class TorqueProfileTest(TestCase):
    def call(self, content, *options):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "profile.csv")
            with open(path, "wb") as file:
                file.write(content if isinstance(content, bytes) else content.encode())
            result = subprocess.run([sys.executable, SCRIPT, path, *options], env=ENVIRONMENT,
                                    capture_output=True, timeout=60, check=False)
        text = result.stderr.decode()
        self.assertNotIn("Traceback", text)
        self.assertLess(len(text), 4096)
        return result.returncode, text

    def test_bad_files(self):
        for name, (content, message) in BAD_FILES.items():
            with self.subTest(name):
                status, text = self.call(content, "--seconds", "1")
                self.assertEqual(status, 2, text)
                self.assertIn(message, text)

    def test_bad_durations(self):
        for option in ("--seconds", "--patience"):
            for word in ("nan", "inf", "-1", "x", ""):
                with self.subTest(option=option, word=word):
                    status, text = self.call(GOOD, "--seconds", "1", f"{option}={word}")
                    self.assertEqual(status, 2, text)
                    self.assertIn(option, text)

    def test_no_master(self):
        status, text = self.call(GOOD, "--seconds", "1", "--patience", "0.3")
        self.assertEqual(status, 1, text)
        self.assertIn("no ROS master has answered for 0.3 s", text)


if __name__ == "__main__":
    rosunit.unitrun("variator_sim", "torque_profile_test", TorqueProfileTest)
