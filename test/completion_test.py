#!/usr/bin/python3
"""Bash completion of simulate: what TAB offers, asked of an interactive bash."""

import pathlib
import re
import subprocess
import tempfile
import unittest

import roslib.packages
import rosunit

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = pathlib.Path(roslib.packages.find_node(PACKAGE, "simulate")[0])
ASK = r"""
CATKIN_ENV_HOOK_WORKSPACE=$1
. "$2"
shift 2
COMP_WORDS=("$@")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
function=$(complete -p "$1" | sed -nE 's/.*-F ([^ ]+) .*/\1/p')
"$function" "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\n' "${COMPREPLY[@]}"
"""


def offered(*words, folder=None, bash=("-i",)):
    """Returns the completions that TAB offers behind the last word."""
    command = ["bash", "--norc", *bash, "-c", ASK, "bash", str(SIMULATE.parents[2]),
               str(FOLDER / "completion/60.variator_sim.bash"), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False,
                          stdin=subprocess.DEVNULL, start_new_session=True)
    return {line for line in done.stdout.splitlines() if line}


class CompletionTest(unittest.TestCase):

    def test_options_are_those_of_the_help(self):
        text = subprocess.run([SIMULATE, "--help"], capture_output=True, text=True, check=True).stdout
        named = set(re.findall(r"^  (--[a-z-]+)", text, flags=re.MULTILINE))
        self.assertGreater(len(named), 20)
        self.assertEqual(offered("simulate", "scene.yaml", "--"), named)
        self.assertEqual(offered("simulate", "scene.yaml", "--du"), {"--duration"})

    def test_behind_rosrun(self):
        self.assertEqual(offered("rosrun", "variator_sim", "simulate", "--lin"), {"--linearize"})
        self.assertEqual(offered("rosrun", "--prefix", "nice", "variator_sim", "simulate", "--lin"), {"--linearize"})

    def test_rosrun_is_left_what_it_had(self):
        """Packages and programs are offered by rosbash, as before."""
        self.assertIn("variator_sim", {name.strip() for name in offered("rosrun", "variator_s")})
        self.assertIn("simulate", {name.strip() for name in offered("rosrun", "variator_sim", "simul")})

    def test_files_by_their_endings(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in ("scene.yaml", "steps.csv", "out.bag", "note.txt"):
                (pathlib.Path(folder) / name).touch()
            (pathlib.Path(folder) / "runs").mkdir()
            self.assertEqual(offered("simulate", "", folder=folder), {"scene.yaml", "runs"})
            self.assertEqual(offered("simulate", "scene.yaml", "--commands", "", folder=folder), {"steps.csv", "runs"})
            self.assertEqual(offered("simulate", "scene.yaml", "--output", "o", folder=folder), {"out.bag"})
            self.assertEqual(offered("simulate", "scene.yaml", "--at", "r", folder=folder), {"rest", "runs"})
            self.assertEqual(offered("simulate", "scene.yaml", "--save-state", "n", folder=folder), {"note.txt"})
            self.assertEqual(offered("simulate", "scene.yaml", "--duration", "", folder=folder), set())

    def test_groups_of_columns_are_those_of_the_tool(self):
        message = subprocess.run([SIMULATE, FOLDER / "config/ship.yaml", "--duration", "1", "--columns", "nonsense"],
                                 capture_output=True, text=True, check=False).stderr
        groups = set(re.search(r"allowed: (.*)", message).group(1).strip().split(", "))
        self.assertEqual(offered("simulate", "scene.yaml", "--columns", ""), groups)
        self.assertEqual(offered("simulate", "scene.yaml", "--columns", "state,en"), {"state,energy"})

    def test_scripts_are_not_burdened(self):
        """A shell that is not interactive defines no completion."""
        self.assertEqual(offered("simulate", "--", bash=()), set())


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "completion_test", CompletionTest)
