#!/usr/bin/python3
"""The pages run as they are written: files and commands are taken out of them.

In the README and in every page of doc/,
- a fenced block after a line that ends with "`NAME`:" is the file NAME;
- a block of `sh` is run by bash, all of them of one page in one folder, in order; it has to succeed
  (`|| true` says that it may not);
- a block of `text` right after it is what it prints; "..." stands for anything.
"""

import os
import pathlib
import re
import signal
import socket
import subprocess
import tempfile
import unittest

import roslib.packages
import rosunit

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
PATIENCE = 110.0  # s for a page; a plugin is compiled in one
BLOCK = re.compile(r"(?P<before>[^\n]*)\n+```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page):
    """(kind, text, name of the file or None) of each fenced block."""
    for match in BLOCK.finditer(page.read_text(encoding="utf-8")):
        name = re.search(r"`([\w./]+)`:$", match["before"].strip())
        yield match["kind"], match["text"], name and name[1]


def pattern(text):
    """Turns printed text, with "..." for anything, into a regular expression."""
    return r"\s+".join(re.escape(word).replace(r"\.\.\.", ".*?") for word in text.split())


class TutorialsTest(unittest.TestCase):

    def run_page(self, page):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1",
                           "ROS_LOG_DIR": f"{folder}/log", "ROS_HOME": f"{folder}/home", "MPLBACKEND": "Agg",
                           "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin:" + os.environ["PATH"]}
            environment.pop("ROS_HOSTNAME", None)
            printed, ran = "", 0
            for kind, text, name in blocks(page):
                if name:
                    file = pathlib.Path(folder, "work", name)
                    file.parent.mkdir(parents=True, exist_ok=True)
                    file.write_text(text, encoding="utf-8")
                elif kind == "sh":
                    printed = self.run_commands(text, f"{folder}/work", environment)
                    ran += 1
                elif kind == "text":
                    self.assertRegex(printed, re.compile(pattern(text), re.DOTALL))
            self.assertGreater(ran, 0, "a page without commands")

    def run_commands(self, text, folder, environment):
        pathlib.Path(folder).mkdir(exist_ok=True)
        # The exports of a block hold in the next ones.
        script = f"[ ! -f ../env ] || . ../env; set -eo pipefail\n{text}\nset +e; export -p > ../env\n"
        process = subprocess.Popen(["bash", "-c", script], cwd=folder, env=environment, text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            output, _ = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)
            output, _ = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 0, f"{text}\n{output}")
        return re.sub(r"\x1b\[[0-9;]*m", "", output)  # colours


def add_tests():
    """Adds one test for each page, so that a failure names it."""
    pages = [FOLDER / "README.md", *sorted(FOLDER.glob("doc/**/*.md"))]
    for page in pages:
        if not any(kind == "sh" for kind, _, _ in blocks(page)):
            continue
        setattr(TutorialsTest, f"test_{page.stem}", lambda self, page=page: self.run_page(page))


add_tests()

if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "tutorials_test", TutorialsTest)
