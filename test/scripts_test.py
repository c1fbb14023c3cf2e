#!/usr/bin/python3
"""Scripts that install, build and start, run in a fresh clone of the repository."""

import os
import pathlib
import re
import shutil

import roslib.packages
import rosunit

from support.simulate import SIMULATE, call
from support.subtests import FolderTestCase

PACKAGE = "variator_sim"
SCRIPTS = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE)) / "scripts"


APT = """#!/bin/bash
for word in "$@"; do if [[ $word == update ]]; then echo "dlstatus:1:50.0:Retrieving file 1 of 2"; exit; fi; done
for step in 0 4 9 33 66 100; do echo "dlstatus:$step:$step.0000:Retrieving file"; done
echo "Selecting previously unselected package ninja-build."
for step in 0 12.5 50 100; do echo "pmstatus:ninja-build:$step:Unpacking ninja-build (amd64)"; done
exit ${APT_STATUS:-0}
"""


def write(path, text):
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


class ScriptsTest(FolderTestCase):
    def install(self, **variables):
        """install_dependencies where nothing is installed and apt is a program of the test."""
        write(self.folder / "apt-get", APT)
        write(self.folder / "dpkg-query", "#!/bin/sh\nexit 1\n")
        write(self.folder / "sudo", '#!/bin/sh\nexec "$@"\n')
        return call(SCRIPTS / "install_dependencies",
                    env={**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}", **variables})

    def test_apt_shows_its_progress(self):
        done = self.install()
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        lines = done.stdout.splitlines()
        self.assertTrue(lines[0].startswith("Installing "), lines[0])
        self.assertEqual([line.strip() for line in lines[1:]],
                         ["lists of packages", "downloading 50 %", "downloading 0 %", "downloading 30 %",
                          "downloading 60 %", "downloading 100 %", "installing 0 %", "installing 10 %",
                          "installing 50 %", "installing 100 %"])

    def test_lines_of_dpkg_are_shown_when_apt_fails(self):
        done = self.install(APT_STATUS="100")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr, "Selecting previously unselected package ninja-build.\n")

    def copy(self, *names):
        """A repository with these scripts, whose others do nothing, and a project of CMake."""
        scripts = self.folder / "scripts"
        scripts.mkdir(exist_ok=True)
        for name in ("install_dependencies", "count_tests"):
            write(scripts / name, "#!/bin/sh\n")
        for name in names:
            shutil.copy(SCRIPTS / name, scripts)
        (self.folder / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.16)\nproject(p NONE)\nmessage(STATUS told)\n"
            "if(FAILS)\n  message(FATAL_ERROR why)\nendif()\n", encoding="utf-8")

    def build(self, *words):
        return call(self.folder / "scripts/build", *words)

    def werror(self):
        cache = (self.folder / "build/CMakeCache.txt").read_text()
        return re.search("^VARIATOR_SIM_WERROR:[A-Z]*=(.*)$", cache, re.M)[1]

    def test_cmake_is_quiet_unless_it_fails(self):
        self.copy("build")
        done = self.build()
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertNotIn("told", done.stdout)
        done = self.build("-DFAILS=ON")
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("told", done.stderr)
        self.assertIn("why", done.stderr)

    def test_all_builds_have_the_same_flags(self):
        self.copy("build")
        self.build()
        self.assertEqual(self.werror(), "ON")
        self.build("-DVARIATOR_SIM_WERROR=OFF")
        self.build()  # what has been said stays
        self.assertEqual(self.werror(), "OFF")
        self.copy("demo", "test")
        write(self.folder / "scripts/build", f'#!/bin/sh\necho "$@" >>{self.folder}/words\nexit 1\n')
        call(self.folder / "scripts/demo", env={**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:11311",
                                                "ROS_HOSTNAME": "127.0.0.1"})
        call(self.folder / "scripts/test")
        self.assertEqual((self.folder / "words").read_text(), "\n--target=all --target=tests\n")

    def test_a_machine_that_does_not_know_localhost_is_told_at_once(self):
        self.copy("demo")
        write(self.folder / "scripts/build", "#!/bin/sh\necho built\nexit 1\n")
        # Neither file nor server tells the name.
        empty = self.folder / "empty"
        write(empty, "")
        shell = (f"mount --bind {empty} /etc/hosts && mount --bind {empty} /etc/resolv.conf && "
                 "! getent ahosts localhost >/dev/null && exec \"$0\"")
        words = ["unshare", "--map-root-user", "--mount", "--net", "sh", "-c", shell]
        if call(*words, "true").returncode != 0:
            self.skipTest("mounts of one's own are forbidden here, or localhost needs no file")
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROS_")}
        done = call(*words, self.folder / "scripts/demo", env=environment)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("add the line '127.0.0.1 localhost' to /etc/hosts", done.stderr)
        done = call(*words, self.folder / "scripts/demo",
                    env={**environment, "ROS_MASTER_URI": "http://127.0.0.1:11311", "ROS_IP": "127.0.0.1"})
        self.assertEqual(done.stdout, "built\n")

    def golden(self, action, *words):
        return call(SCRIPTS / "golden", action, *words, "--only", "^torque_steps, .*auto$",
                    "--scenes", "0", "--processes", "1", "--cache", self.folder / "cache")

    def test_golden_tells_which_runs_differ(self):
        # Answers what stands in the file `answer`, and saves a state.
        program = self.folder / "lib/package/simulate"
        program.parent.mkdir(parents=True)
        write(program, f"""#!/bin/bash
cat {self.folder}/answer
echo "steps: 7" >&2
for word in "$@"; do if [[ $last == --save-state ]]; then echo state >"$word"; fi; last=$word; done
if [[ "$*" == *--error* ]]; then echo "simulate: StepLimit" >&2; exit 1; fi
""")
        (self.folder / "answer").write_text("time,a/angle\n0,1\n")
        words = [self.folder / "runs", "--program", program, "--ways", "program,error,states"]
        done = self.golden("record", *words)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("3 runs recorded", done.stdout)
        self.assertIn('"1 StepLimit"', (self.folder / "runs").read_text())
        done = self.golden("compare", *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        for kind in ("samples", "cost", "end"):
            self.assertIn(f"{kind}: 0 of 3 runs differ", done.stdout)
        (self.folder / "answer").write_text("time,a/angle\n0,1.0000000000000002\n")
        done = self.golden("compare", *words)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("samples: 3 of 3 runs differ\n  program: torque_steps, its own, auto\n",
                      done.stdout)
        self.assertIn("cost: 0 of 3", done.stdout)

    def test_golden_compares_with_references(self):
        done = self.golden("references", "--program", SIMULATE, "--ways", "program")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("test/cases, program: 1 runs, 0 above 1 tolerances", done.stdout)
        coarse = self.folder / "simulate"
        write(coarse, f'#!/bin/sh\n{SIMULATE} "$@" --set solver/relative_tolerance=1e-4\n')
        done = self.golden("references", "--program", coarse, "--ways", "program")
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("test/cases, program: 1 runs, 1 above 1 tolerances", done.stdout)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "scripts_test", ScriptsTest)
