#!/usr/bin/python3
"""`simulate --linearize` and `--trim` as their users see them: files, reports, exit statuses."""

import ast
import csv
import pathlib
import struct
import zipfile

import numpy
import roslib.packages
import rosunit
import scipy.linalg

from support.scenes import scene_text
from support.simulate import SimulateTestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
CONFIG = FOLDER / "config"
RATIO_STEPS = str(CONFIG / "ratio_steps.yaml")
SHIP = str(CONFIG / "ship.yaml")
DRIFT = scene_text("rotor 4e7, generator 500", [
    "wind on rotor: 4.2e6",
    "gen on generator: -43000",
    "shaft = ElasticCoupling, shafts: [rotor, generator], ratio: 0.01, stiffness: 9e8, damping: 6e6"],
    "principle: gauss")
MATRICES = {"A": ("states", "states"), "B": ("states", "inputs"),
            "C": ("outputs", "states"), "D": ("outputs", "inputs")}


def read_csv(path):
    """Each matrix as {(row, column): value}."""
    matrices = {}
    with open(path, encoding="utf-8") as file:
        for line in csv.DictReader(file):
            entries = matrices.setdefault(line["matrix"], {})
            entries[line["row"], line["column"]] = float(line["value"])
    return matrices


def read_npy(data):
    """A list of numbers or texts, row by row, and the shape."""
    assert data[:8] == b"\x93NUMPY\x01\x00"
    begin = 10 + struct.unpack("<H", data[8:10])[0]
    assert begin % 64 == 0
    head = ast.literal_eval(data[10:begin].decode("ascii"))
    assert not head["fortran_order"]
    if head["descr"] == "<f8":
        return [value for (value,) in struct.iter_unpack("<d", data[begin:])], head["shape"]
    width = 4 * int(head["descr"][2:])
    texts = [data[at:at + width].decode("utf-32-le").rstrip("\0")
             for at in range(begin, len(data), width)]
    return texts, head["shape"]


def read_mat(data):
    """Each variable of level 4 as its columns; texts as rows."""
    variables = {}
    while data:
        kind, rows, columns, imaginary, length = struct.unpack("<5I", data[:20])
        assert imaginary == 0
        name = data[20:20 + length].rstrip(b"\0").decode("ascii")
        code, width = {0: "<d", 51: "<c"}[kind], {0: 8, 51: 1}[kind]  # doubles, letters in bytes
        end = 20 + length + width * rows * columns
        values = [value for (value,) in struct.iter_unpack(code, data[20 + length:end])]
        table = [[values[j * rows + i] for j in range(columns)] for i in range(rows)]
        if code == "<c":
            table = [b"".join(row).decode("ascii").rstrip() for row in table]
        variables[name] = table
        data = data[end:]
    return variables


class LinearizeTest(SimulateTestCase):

    def test_files_hold_the_same_model(self):
        paths = {}
        for ending in ("csv", "npz", "mat"):
            paths[ending] = self.folder / f"model.{ending}"
            report = self.check_simulate(RATIO_STEPS, "--linearize", "--at", "2", "--output",
                                   str(paths[ending])).stdout
            self.assertIn("load/acceleration", report)
            self.assertIn("time constant", report)
        by_names = read_csv(paths["csv"])
        with zipfile.ZipFile(paths["npz"]) as archive:
            self.assertIsNone(archive.testzip())
            npz = {name[:-4]: read_npy(archive.read(name)) for name in archive.namelist()}
        mat = read_mat(paths["mat"].read_bytes())
        self.assertEqual(npz["states"][0], ["drive/angle", "load/angle", "drive/velocity",
                                            "load/velocity", "load/acceleration"])
        self.assertEqual(npz["inputs"][0], ["drive_torque", "load_torque"])
        for names in ("states", "inputs", "outputs"):
            self.assertEqual(mat[names], npz[names][0])
        for matrix, (of, by) in MATRICES.items():
            rows, columns = npz[of][0], npz[by][0]
            values, shape = npz[matrix]
            self.assertEqual(shape, (len(rows), len(columns)))
            self.assertEqual([by_names[matrix][row, column] for row in rows for column in columns],
                             values)
            self.assertEqual([value for row in mat[matrix] for value in row], values)
        self.assertEqual(mat["time"], [[2.0]])
        self.assertEqual(npz["time"], ([2.0], ()))

    def test_models_without_inputs(self):
        for ending in ("npz", "mat"):
            path = self.folder / f"model.{ending}"
            self.check_simulate(str(CONFIG / "acceleration_circle.yaml"), "--linearize", "--at", "1",
                                "--output", str(path))
            with self.subTest(ending=ending):
                if ending == "mat":
                    model = read_mat(path.read_bytes())
                    self.assertEqual((model["inputs"], model["u"]), ([], []))
                    self.assertEqual([len(row) for row in model["B"]], [0] * len(model["x"]))
                else:
                    model = numpy.load(path)
                    self.assertEqual(model["inputs"].shape, (0,))
                    self.assertEqual(model["B"].shape, (len(model["x"]), 0))

    def test_libraries_that_are_missing_are_told_before_the_run(self):
        (self.folder / "scipy.py").write_text("raise ImportError('none here')\n", encoding="utf-8")
        (self.folder / "numpy.py").write_text("raise ImportError('none here')\n", encoding="utf-8")
        self.environment["PYTHONPATH"] = str(self.folder)
        for ending, package in (("npz", "python3-numpy"), ("mat", "python3-scipy")):
            path = self.folder / f"model.{ending}"
            path.write_text("old", encoding="utf-8")
            # The run itself would end with status 1.
            self.check_refused([SHIP, "--linearize", "--output", str(path)], f".{ending} needs {package}",
                               f"apt install {package}", ".csv", status=3)
            self.assertEqual(path.read_text(encoding="utf-8"), "old")
        self.check_simulate(SHIP, "--linearize", "--at", "1", "--output", str(self.folder / "model.csv"))

    def test_files_that_cannot_be_written(self):
        for ending in ("csv", "npz", "mat"):
            self.check_refused([SHIP, "--linearize", "--at", "1", "--output", f"/no/folder/model.{ending}"],
                               "/no/folder", status=3)

    def test_all_states_beside_coordinates(self):
        full = self.check_simulate(RATIO_STEPS, "--linearize", "--at", "2", "--full").stdout
        self.assertIn("6 states", full)
        self.assertIn("drive/acceleration  -1.16444", full)

    def test_trim_leads_to_a_linear_model(self):
        path = self.folder / "state.yaml"
        result = self.check_simulate(RATIO_STEPS, "--trim", "--fix", "drive_torque=5", "--fix",
                               "w_drive=10", "--free", "load_torque", "--output", str(path))
        self.assertIn("one steady state found", result.stderr)
        self.assertRegex(path.read_text(encoding="utf-8"), r"velocity: 10\b")
        # A run that starts there stays there.
        run = self.check_simulate(RATIO_STEPS, "--from-state", str(path), "--times", "2")
        header, row = (line.split(",") for line in run.stdout.splitlines())
        self.assertAlmostEqual(float(row[header.index("load/velocity")]), 8.0, delta=1e-7)
        report = self.check_simulate(RATIO_STEPS, "--linearize", "--at", str(path)).stdout
        self.assertRegex(report, r"drive/velocity +10 +0\n")
        inline = self.check_simulate(
            RATIO_STEPS, "--linearize", "--at",
            "velocity=[10, 8], acceleration=[0, 0], inputs={drive_torque: 5, load_torque: 3.85}")
        self.assertEqual(inline.stdout, report)

    def test_models_at_states_that_runs_have_saved(self):
        path = self.folder / "saved.yaml"
        self.check_simulate(RATIO_STEPS, "--duration", "2", "--save-state", str(path))
        saved = self.check_simulate(RATIO_STEPS, "--linearize", "--at", str(path)).stdout
        reached = self.check_simulate(RATIO_STEPS, "--linearize", "--at", "2").stdout
        self.assertEqual(saved, reached)
        later = self.check_simulate(RATIO_STEPS, "--linearize", "--at", "3", "--from-state", str(path))
        self.assertEqual(later.stdout,
                         self.check_simulate(RATIO_STEPS, "--linearize", "--at", "3").stdout)

    def test_commands_lead_to_rest(self):
        commands = self.folder / "commands.csv"
        commands.write_text("time,topic,value\n0,drive_torque,5\n0,load_torque,3\n",
                            encoding="utf-8")
        report = self.check_simulate(RATIO_STEPS, "--linearize", "--at", "rest", "--commands",
                               str(commands)).stdout
        rate = float(next(line.split()[2] for line in report.splitlines()
                          if line.startswith("drive/velocity")))
        self.assertLess(abs(rate), 1e-8)

    def test_what_is_not_there_is_told(self):
        self.check_refused([SHIP, "--linearize"], "no rest until 1000 s: constraint 'variator' reads the time; --at 0, "
                           "or another time", status=1)
        self.check_refused([SHIP, "--trim"], "no steady state", "read the time", status=1)

    def test_a_train_that_nothing_holds(self):
        """A net torque of -1e5 N m on a rotor and a generator behind a gear: no law reads the time."""
        scene = self.folder / "drift.yaml"
        scene.write_text(DRIFT, encoding="utf-8")
        self.check_refused([scene, "--linearize"], "no rest until 1000 s: the shafts still accelerate, most of all "
                           "'generator' by -", "--trim --accelerating", "--at 0", status=1)
        self.check_refused([scene, "--linearize", "--set", "wind/torque=4.2e6 + sin(t)"],
                           "no rest until 1000 s: torque 'wind' reads the time", status=1)
        self.check_refused([scene, "--linearize", "--set", "solver={sleep: false}"],
                           "'solver/sleep: false' allows none", status=1)
        self.check_refused([scene, "--trim"], "in the torques on shaft 'generator' and the torques on "
                           "shaft 'rotor' together", "--accelerating", status=1)
        for full in ([], ["--full"]):
            report = self.check_simulate(str(scene), "--linearize", "--at", "0", *full).stdout.splitlines()
            begin = next(n for n, line in enumerate(report) if line.startswith("eigenvalues"))
            self.assertEqual([line.split() for line in report[begin + 1:begin + 3]],
                             [["0", "integrator"]] * 2)
            self.assertIn("-0.675 +- 14.2142 i", report[begin + 3])
            self.assertEqual(report[begin + 4], "  (2 integrators stand one behind the other: "
                             "deviations may grow with the time)")
            self.assertNotIn("unstable", "".join(report))

    def test_natural_frequencies_of_a_train_of_24_masses(self):
        """K x = omega^2 M x of an engine's train, by LAPACK's symmetric solver."""
        inertia = [9.0 - 0.2 * n for n in range(24)]
        stiffness = [4e5 + 3e4 * (n % 5) for n in range(23)]
        names = [f"m{n}" for n in range(24)]
        lines = [f"shafts: [{', '.join(names)}]", "principle: gauss",
                 f"torques: [{', '.join('c' + name for name in names[1:])}]"]
        lines += [f"{name}: {{inertia: {value!r}}}" for name, value in zip(names, inertia)]
        K = numpy.zeros((24, 24))
        for n, value in enumerate(stiffness):
            lines.append(f"c{names[n + 1]}: {{type: variator_sim/ElasticCoupling, stiffness: {value!r}, "
                         f"shafts: [{names[n]}, {names[n + 1]}]}}")
            K[n:n + 2, n:n + 2] += value * numpy.array([[1.0, -1.0], [-1.0, 1.0]])
        scene = self.folder / "train.yaml"
        scene.write_text("\n".join(lines), encoding="utf-8")
        self.check_simulate(str(scene), "--linearize", "--at", "0", "--full", "--output",
                            str(self.folder / "train.csv"))
        A = read_csv(self.folder / "train.csv")["A"]
        states = sorted({row for row, _ in A})
        matrix = numpy.array([[A[row, column] for column in states] for row in states])
        found = numpy.sort(numpy.abs(numpy.linalg.eigvals(matrix).imag))[::2]
        squares = scipy.linalg.eigh(K, numpy.diag(inertia), eigvals_only=True)
        expected = numpy.sqrt(numpy.maximum(squares, 0.0))
        numpy.testing.assert_allclose(found[1:], expected[1:], rtol=1e-11)

    def test_words_are_checked(self):
        self.check_refused([SHIP, "--full", "--duration", "1"], "--full belongs to --linearize")
        self.check_refused([SHIP, "--fix", "w_drive=1"], "--fix belongs to --trim")
        self.check_refused([SHIP, "--trim", "--linearize"], "exclude each other")
        self.check_refused([SHIP, "--trim", "--fix", "w_drive"], "is not NAME=VALUE")
        self.check_refused([SHIP, "--trim", "--fix", "w_drvie=1"], "did you mean 'w_drive'")
        self.check_refused([SHIP, "--linearize", "--at", "1", "--output", "model.txt"], ".npz")
        self.check_refused([SHIP, "--linearize", "--at", "velocity=[1]"], "--at/velocity")
        self.check_refused([SHIP, "--linearize", "--at", "velocty=[1, 2]"],
                           "did you mean 'velocity'")
        self.check_refused([SHIP, "--linearize", "--at", "w_load=74"], "--at/w_load", "lists over the shafts",
                           "drive, load", "--trim --fix w_drive=VALUE")
        self.check_refused([SHIP, "--linearize", "--at", "-1"], "at least 0 s")
        self.check_refused([SHIP, "--linearize", "--at", str(self.folder / "none.yaml")],
                           "none.yaml")

    def test_every_application_has_a_model_along_its_commands(self):
        for scene in sorted((CONFIG / "applications").glob("*.yaml")):
            with self.subTest(scene=scene.name):
                report = self.check_simulate(str(scene), "--linearize", "--at", "20", "--commands",
                                       str(scene.with_suffix(".csv"))).stdout
                self.assertIn("eigenvalues", report)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "linearize_test", LinearizeTest)
