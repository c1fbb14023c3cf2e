#!/usr/bin/python3
"""The core knows nothing of ROS: neither its sources nor its library do."""

import pathlib
import re
import subprocess

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
CORE = [FOLDER / "include"] + [folder for folder in (FOLDER / "src").iterdir()
                               if folder.name not in ("plugins", "python", "ros", "tools")]
# Headers that a core file may include beside the standard library and the project's own.
ALLOWED = re.compile(r"((unsupported/)?Eigen|boost|yaml-cpp|sys)/|[a-z_0-9]+(\.h)?$")
# The C++ runtime, and nothing else.
ALLOWED_LIBRARIES = re.compile(r"(libstdc\+\+|libm|libgcc_s|libc|ld-linux.*|lib[a-z]san)\.so")


class CoreIndependenceTest(TestCase):

    def test_includes(self):
        files = [path for folder in CORE for path in folder.rglob("*.[hc]*")]
        self.assertGreater(len(files), 100)
        for path in files:
            for line in path.read_text(encoding="utf-8").splitlines():
                match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)', line)
                if not match:
                    continue
                with self.subTest(file=str(path.relative_to(FOLDER)), include=match.group(2)):
                    if match.group(1) == "<":
                        self.assertRegex(match.group(2), f"^({ALLOWED.pattern})")
                    else:
                        self.assertNotRegex(match.group(2), "^(plugins|python|ros|tools)/")

    def test_dynamics_does_not_know_motions(self):
        # Motions include the search for accelerations; a circle would tie them together.
        files = list((FOLDER / "src" / "dynamics").iterdir())
        self.assertGreater(len(files), 10)
        for path in files:
            with self.subTest(file=path.name):
                self.assertNotRegex(path.read_text(encoding="utf-8"),
                                    r'#\s*include\s*"(motion_program|motion)/')

    def test_library(self):
        # Executables lie in lib/variator_sim, libraries in lib.
        simulate = pathlib.Path(roslib.packages.find_node(PACKAGE, "simulate")[0])
        library = simulate.parents[1] / "libvariator_sim_core.so"
        listing = subprocess.run(["readelf", "-d", str(library)], check=True, text=True,
                                 stdout=subprocess.PIPE).stdout
        needed = re.findall(r"\(NEEDED\).*\[(.+)\]", listing)
        self.assertTrue(needed)
        for name in needed:
            self.assertRegex(name, "^" + ALLOWED_LIBRARIES.pattern)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "core_independence_test", CoreIndependenceTest)
