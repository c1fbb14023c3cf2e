#!/usr/bin/python3
"""Sweeps: their designs, metrics and tables; what is left when they are killed; other machines."""

import os
import pathlib
import resource
import signal
import stat
import subprocess
import sys
import threading
import time
import unittest
import warnings
from unittest import mock

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import numpy  # noqa: E402
try:
    import distributed
except ImportError:
    distributed = None
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402

import variator_sim  # noqa: E402
from variator_sim import sweeps  # noqa: E402
from support import faulty_package  # noqa: E402
from support.scenes import scene_text  # noqa: E402
from support.subtests import FolderTestCase  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SWEEP = str(FOLDER / "scripts/sweep")
SHIP = FOLDER / "config/ship.yaml"
# Speed (1 - exp(-t/T)) k with T = J/c and k = 1/c: what metrics are is known.
LAG = scene_text("drive 1.0", [
    'motor = ExpressionTorque, shaft: drive, torque: "1 - c*w1", parameters: {c: 1.0}'], "outputs: [power]",
    'power: {expression: "w1*(1 - w1)"}')
DRIVEN = LAG.replace("1 - c*w1", "u - c*w1") + "inputs: [u]\nu: {topic: u, initial: 1}\n"
# usage: python3 -c .. SWEEP WORD...
KILLED_AFTER_ONE_CHUNK = """
import os, runpy, signal, sys
from variator_sim import sweeps
keep = sweeps.Journal.add
def add(*arguments):
    keep(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)
sweeps.Journal.add = add
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


class SweepTest(FolderTestCase):

    def command(self, output, *arguments):
        scene = self.folder / "scene.yaml"
        scene.write_text(LAG, encoding="utf-8")
        return [sys.executable, SWEEP, str(scene), "--duration", "5", "--output", str(output),
                *arguments]

    def check_same(self, table, expected):
        self.assertEqual(list(table), list(expected))
        for name in expected:
            numpy.testing.assert_array_equal(table[name], expected[name], err_msg=name)

    # --- designs and metrics ----------------------------------------------------------------------

    def test_values(self):
        for text, values in [("1.5", [1.5]), ("1,2,5", [1, 2, 5]), ("0:1:3", [0, 0.5, 1]),
                             ("log:1e-2:1:3", [0.01, 0.1, 1])]:
            numpy.testing.assert_allclose(sweeps.read_values(text), values)
        for text in ("", "a", "1:2", "1:2:0", "log:-1:1:3", "1:2:3:4", "nan:1:2"):
            with self.subTest(text=text), self.assertRaisesRegex(ValueError, "FIRST:LAST:COUNT"):
                sweeps.read_values(text)

    def test_design(self):
        paths, values = sweeps.make_design({"a": "1,2", "b": [3, 4, 5]}, {"c": "normal(1,0.1)"}, 4,
                                           7)
        self.assertEqual(paths, ["a", "b", "c"])
        self.assertEqual(values.shape, (24, 3))
        self.assertEqual(len(numpy.unique(values[:, :2], axis=0)), 6)
        self.assertEqual(len(numpy.unique(values[:, 2])), 24)
        self.assertLess(abs(values[:, 2].mean() - 1.0), 0.1)
        again = sweeps.make_design({"a": "1,2", "b": [3, 4, 5]}, {"c": "normal(1,0.1)"}, 4, 7)[1]
        numpy.testing.assert_array_equal(values, again)
        self.assertEqual(sweeps.make_design({}, {"c": "normal(1,0.1)"}, 4, 7)[1].shape, (4, 1))

    def test_metrics(self):
        table = variator_sim.sweep(
            LAG, 8.0, grid={"motor/parameters/c": [1.0, 2.0]}, rate=1000,
            metrics=["final(drive/velocity)", "min(drive/velocity)", "max(drive/acceleration)",
                     "mean(drive/velocity)", "integral(drive/velocity)", "settling(drive/velocity)",
                     "settling(drive/velocity, 0.1)", "max(outputs/power)", "max(power)", "final(time)"])
        c = table["motor/parameters/c"]
        final = (1 - numpy.exp(-8 * c)) / c
        for name, value, tolerance in [
                ("final(drive/velocity)", final, 1e-8), ("min(drive/velocity)", 0 * c, 0),
                ("max(drive/acceleration)", 1 + 0 * c, 1e-8),
                ("mean(drive/velocity)", (8 - final) / c / 8, 1e-5),
                ("integral(drive/velocity)", (8 - final) / c, 1e-5),
                ("settling(drive/velocity)", -numpy.log(0.02) / c, 0.03),
                ("settling(drive/velocity, 0.1)", -numpy.log(0.1) / c, 0.01),
                ("max(outputs/power)", [0.25, 0.25], 1e-6), ("max(power)", [0.25, 0.25], 1e-6),
                ("final(time)", 8 + 0 * c, 0)]:
            numpy.testing.assert_allclose(table[name], value, rtol=0, atol=tolerance, err_msg=name)

    def test_a_controller_of_each_run(self):
        grid = {"motor/parameters/c": [1.0, 2.0]}
        metrics = ["final(drive/velocity)", "min(drive/velocity)", "max(drive/acceleration)", "mean(drive/velocity)",
                   "integral(drive/velocity)", "settling(drive/velocity)", "settling(drive/velocity, 0.1)"]
        plain = variator_sim.sweep(DRIVEN, 8.0, grid=grid, rate=100, metrics=metrics)
        none = variator_sim.sweep(DRIVEN, 8.0, grid=grid, rate=100, metrics=metrics, controller=lambda values: lambda sample: None)
        self.assertEqual(list(none), list(plain))
        for name in plain:
            if name == "reason":
                continue
            numpy.testing.assert_allclose(none[name], plain[name], rtol=1e-8, atol=1e-8, err_msg=name)

        def controller(values):
            total = [0.0]  # a memory of its own

            def update(sample):
                total[0] += 0.01 * (0.5 - sample["drive/velocity"])
                return {"u": values["motor/parameters/c"] * 0.5 + 2.0 * total[0]}
            return update

        output = self.folder / "out.csv"
        table = variator_sim.sweep(DRIVEN, 30.0, grid=grid, metrics=["final(drive/velocity)"], controller=controller,
                                   output=output)
        numpy.testing.assert_allclose(table["final(drive/velocity)"], 0.5, atol=1e-4)
        self.check_same(variator_sim.read_table(output), table)
        with self.assertRaisesRegex(TypeError, "controller: 5; allowed: a function"):
            variator_sim.sweep(DRIVEN, 1.0, grid=grid, metrics=["final(drive/velocity)"], controller=5)
        for fault in (lambda values: None, lambda values: {"u": 1.0}):
            with self.assertRaisesRegex(TypeError, "controller: returned .*as `simulate` has it"):
                variator_sim.sweep(DRIVEN, 1.0, grid=grid, metrics=["final(drive/velocity)"], controller=fault)

    def test_a_controller_that_raises_costs_its_run_only(self):
        call = dict(duration=1.0, grid={"motor/parameters/c": [1.0, 2.0, 3.0]}, metrics=["final(drive/velocity)"])

        def make(values):
            if values["motor/parameters/c"] == 2.0:
                return lambda sample: {"u": 1.0 / (sample.time - 0.5)}
            return lambda sample: None

        table = variator_sim.sweep(DRIVEN, controller=make, period=0.5, **call)
        numpy.testing.assert_array_equal(numpy.isnan(table["final(drive/velocity)"]), [False, True, False])
        self.assertEqual(list(table["reason"]), [
            "", "ZeroDivisionError: float division by zero (in the run with motor/parameters/c=2.0)", ""])

    def test_a_sweep_with_a_controller_goes_on(self):
        call = dict(duration=1.0, grid={"motor/parameters/c": [1.0, 2.0, 3.0]}, metrics=["final(drive/velocity)"],
                    output=self.folder / "out.csv")

        class Watch:
            made, last = [], 2.0

        watch = Watch()

        def maker(gain):
            def make(values):
                if values["motor/parameters/c"] > watch.last:
                    raise KeyboardInterrupt
                watch.made.append(values["motor/parameters/c"])
                return lambda sample: {"u": gain * sample.time}
            return make

        with self.assertRaises(KeyboardInterrupt):
            variator_sim.sweep(DRIVEN, controller=maker(1.0), **call)
        self.assertEqual(watch.made, [1.0, 2.0])
        for change in (dict(controller=maker(1.5)), dict(controller=None), dict(controller=maker(1.0), period=0.02),
                       dict(controller=lambda values: lambda sample: None)):
            with self.assertRaisesRegex(RuntimeError, "other values"):
                variator_sim.sweep(DRIVEN, **{**call, **change})
        watch.made, watch.last = [], 3.0
        table = variator_sim.sweep(DRIVEN, controller=maker(1.0), **call)
        self.assertEqual(watch.made, [3.0])
        del call["output"]
        self.check_same(table, variator_sim.sweep(DRIVEN, controller=maker(1.0), **call))

    def test_a_row_is_its_run_on_any_number_of_threads(self):
        arguments = dict(duration=2.0, grid={"drive/inertia": "0.3:1.5:4"},
                         random={"load/inertia": "uniform(1.8,2.2)"}, samples=3,
                         metrics=["max(load/velocity)", "final(load/velocity)"])
        one = variator_sim.sweep(SHIP, threads=1, **arguments)
        self.check_same(variator_sim.sweep(SHIP, threads=4, **arguments), one)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = variator_sim.simulate(SHIP, 2.0, overrides={
                name: one[name][7] for name in ("drive/inertia", "load/inertia")})
        self.assertEqual(one["final(load/velocity)"][7], result["load/velocity"][-1])
        self.assertEqual(one["max(load/velocity)"][7], result["load/velocity"].max())

    def test_what_is_not_read_anew_is_as_if_it_were(self):
        """Inertias, starts and the solver without the formulas, which are read once in a while."""
        for grid in ({"drive/inertia": "-1:1.6:70"}, {"initial/velocity[1]": "1:3:70"},
                     {"solver/relative_tolerance": "log:1e-10:1e-5:5", "load/inertia": "1:3:14"},
                     {"propeller/parameters/k": "0.01:0.03:5", "drive/inertia": "0.5,1"}):
            with self.subTest(grid=grid):
                table = variator_sim.sweep(SHIP, 0.2, grid=grid, threads=1,
                                           metrics=["final(load/velocity)", "final(load/angle)"])
                good = numpy.flatnonzero(table["reason"] == "")
                self.assertGreater(len(good), 5)
                for row in {good[0], *good[-5:]}:
                    simulation = variator_sim.Simulation(
                        SHIP, {path: table[path][row] for path in grid})
                    simulation.advance(0.2)
                    for name in ("load/velocity", "load/angle"):
                        self.assertEqual(table[f"final({name})"][row], simulation.sample()[name])

    def test_formulas_that_read_reactions_have_the_inertias_of_their_row(self):
        """R = J epsilon + n - Q has J in it, and so have jerks and multipliers."""
        scene = {"shafts": ["a", "b"], "torques": ["m"], "constraints": ["g"], "outputs": ["o"], "states": ["z"],
                 "a": {"inertia": {"mean": 1.0, "harmonics": [{"order": 1, "cos": 0.3}]}}, "b": {"inertia": 2.0},
                 "m": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "3 - 0.1*w_a"},
                 "g": {"type": "variator_sim/KinematicRatio", "shafts": ["a", "b"], "ratio": 0.5},
                 "o": {"expression": "0"}, "z": {"rate": "0"}}
        names = ["outputs/o", "states/z"]
        for formula in ("R_a", "Rr_b", "j_a", "g_multiplier"):
            for shown, rate in ((formula, "0"), ("w_a", formula)):
                read = {**scene, "o": {"expression": shown}, "z": {"rate": rate}}
                for path, values in (("a/inertia/mean", [0.8, 1.0, 1.4]), ("b/inertia", [2.0, 3.0]),
                                     ("a/inertia/harmonics[0]/cos", [0.1, 0.3])):
                    with self.subTest(formula=formula, rate=rate, path=path):
                        table = variator_sim.sweep(read, 0.5, grid={path: values}, threads=1,
                                                   metrics=[f"final({name})" for name in names])
                        for row, value in enumerate(values):
                            result = variator_sim.simulate(read, 0.5, overrides={path: value},
                                                           columns="state,outputs,states")
                            for name in names:
                                self.assertEqual(table[f"final({name})"][row], result[name][-1])

    def test_inertias_by_formulas_of_numbers_are_those_of_each_row(self):
        scene = {"shafts": ["a", "b"], "torques": ["m"], "constraints": ["g"],
                 "a": {"inertia": "2*3"}, "b": {"inertia": 2.0},
                 "m": {"type": "variator_sim/ExpressionTorque", "shaft": "a", "torque": "3"},
                 "g": {"type": "variator_sim/KinematicRatio", "shafts": ["a", "b"], "ratio": 0.5}}
        table = variator_sim.sweep(scene, 0.5, grid={"b/inertia": "2:6:5"}, threads=1,
                                   metrics=["final(a/velocity)"])
        for inertia, velocity in zip(table["b/inertia"], table["final(a/velocity)"]):
            self.assertAlmostEqual(velocity, 0.5 * 3.0 / (6.0 + 0.25 * inertia), 12)

    def test_machine_code_of_one_row_serves_all_and_changes_no_bit(self):
        def run(machine_code):
            return variator_sim.sweep(SHIP, 3.0, grid={"load/inertia": [1.9, 2.0, 2.1]},
                                      random={"propeller/parameters/k": "normal(0.02,0.001)"}, samples=3,
                                      metrics=["final(load/velocity)", "max(drive/velocity)"],
                                      overrides={"solver/machine_code": machine_code})
        with mock.patch.dict(os.environ, {"VARIATOR_SIM_CACHE": str(self.folder / "cache")}):
            interpreted = run("never")
            self.assertFalse((self.folder / "cache").exists())
            compiled = run("always")
            self.assertEqual(len(list((self.folder / "cache").iterdir())), 1)
        for name in interpreted:
            numpy.testing.assert_array_equal(compiled[name], interpreted[name])
        self.assertEqual(set(interpreted["reason"]), {""})

    def test_failed_runs_are_rows(self):
        table = variator_sim.sweep(LAG, 1.0, grid={"drive/inertia": "-1,0,2"},
                                   metrics=["final(drive/velocity)"])
        numpy.testing.assert_array_equal(numpy.isnan(table["final(drive/velocity)"]),
                                         [True, True, False])
        self.assertRegex(table["reason"][0], "drive/inertia: -1.0 is out of range")
        self.assertEqual(table["reason"][2], "")
        stops = LAG.replace("1 - c*w1", "sqrt(c - t)")
        table = variator_sim.sweep(stops, 1.0, grid={"motor/parameters/c": "0.5,2"},
                                   metrics=["final(drive/velocity)"])
        self.assertRegex(table["reason"][0], "NonFiniteValue at t = 0.")
        self.assertTrue(numpy.isfinite(table["final(drive/velocity)"][1]))

    def test_a_plugin_that_throws_fails_its_rows_alone(self):
        with mock.patch.dict(os.environ, faulty_package.environment(self.folder)):
            for how, words in (("throws", "the sensor is off"), ("throws_a_number", "an exception of type int")):
                table = variator_sim.sweep(faulty_package.scene(how, 0.5), 1.0, grid={"drag/from": [0.5, 2.0]},
                                           metrics=["final(a/velocity)"])
                self.assertRegex(table["reason"][0], f"torque 'drag', whose function threw: {words}")
                self.assertEqual(table["reason"][1], "")
                self.assertAlmostEqual(table["final(a/velocity)"][1], numpy.exp(-1), places=6)

    def test_a_plugin_that_blocks_ends_at_the_first_control_c(self):
        scene = self.folder / "blocks.yaml"
        scene.write_text(faulty_package.scene("blocks", 0.5), encoding="utf-8")
        words = [sys.executable, SWEEP, str(scene), "--duration", "1", "--set", "drag/from=0.5,0.6", "--metric",
                 "final(a/velocity)", "--output", str(self.folder / "out.csv")]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              env=dict(os.environ, **faulty_package.environment(self.folder))) as process:
            time.sleep(4.0)  # (nothing tells that it blocks)
            self.assertIsNone(process.poll())
            begin = time.monotonic()
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=30)
        self.assertLess(time.monotonic() - begin, 4.0)

    def test_faults(self):
        good = dict(grid={"drive/inertia": "1:2:3"}, metrics=["final(drive/velocity)"])
        for change, words in [
                (dict(metrics=["finl(drive/velocity)"]), "final"),
                (dict(metrics=["final(drive/velocty)"]), "did you mean 'drive/velocity'"),
                (dict(metrics=["max(drive/velocity,0.1)"]), "BAND"),
                (dict(metrics=[]), "none given"),
                (dict(grid={"drive/inrtia": "1:2:3"}), "did you mean 'inertia'"),
                (dict(random={"drive/inertia": "normal(1,1)"}), "given twice"),
                (dict(random={"a": "gauss(1,1)"}), "normal"),
                (dict(samples=0), "samples"), (dict(shard=(3, 2)), "shard"),
                (dict(threads=3000000000), "threads: 3000000000; allowed: a whole number from 1 to 1024"),
                (dict(threads=0), "threads: 0"), (dict(seed=-1), "seed: -1; allowed: a whole number >= 0"),
                (dict(seed=0.5), "seed: 0.5"), (dict(samples=1.5), "samples: 1.5"),
                (dict(output="/tmp"), "folder"), (dict(output="/nowhere/t.csv"), "'/nowhere/t.csv"),
                (dict(grid={"drive/inertia": []}), r"grid: drive/inertia: \[\]: allowed are a number, an array"),
                (dict(grid={"drive/inertia": [[1.0, 2.0]]}), "grid: drive/inertia: .*: allowed are"),
                (dict(grid={"drive/inertia": [numpy.nan]}), "grid: drive/inertia: .*finite"),
                (dict(grid=["drive/inertia"]), "grid: .*; allowed: a dict"),
                (dict(random={"load/inertia": "normal(1,-2)"}),
                 r"random: load/inertia: 'normal\(1,-2\)': allowed .*DEVIATION >= 0"),
                (dict(random={"load/inertia": "uniform(2,1)"}), "random: load/inertia: .*LOW <= HIGH"),
                (dict(random={"load/inertia": ("gauss", 1, 1)}), "random: load/inertia: .*lognormal"),
                (dict(random={"load/inertia": ("normal", 1)}), "random: load/inertia: .*normal"),
                (dict(metrics=[5]), r"metrics: \[5\]; allowed: a text"),
                (dict(shard=5), "shard: 5; allowed: a tuple"),
                (dict(controller=lambda values: lambda sample: None, period=-1), "period: -1; allowed: a finite number > 0"),
                (dict(overrides={"drive/inertia": 2}), "overridden too")]:
            with self.subTest(change=change), self.assertRaisesRegex((ValueError, OSError), words):
                variator_sim.sweep(LAG, 1.0, **{**good, **change})

    def test_more_runs_than_memory_holds_are_refused_before_room_is_made_for_them(self):
        for grid, samples in (({"drive/inertia": "0.1:1:1000000000000"}, 1),
                              ({"drive/inertia": "0.1:1:5000", "motor/parameters/c": "1:2:5000"}, 1),
                              ({}, 10**12)):
            with self.subTest(grid=grid), self.assertRaisesRegex(ValueError, "runs; allowed: 10000000"):
                sweeps.make_design(grid, {}, samples, 0)

    def test_the_table_is_not_written_over_what_is_read(self):
        scene = self.folder / "scene.yaml"
        done = subprocess.run(self.command(scene, "--metric", "final(drive/velocity)"),
                              capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn("is the file of the scene", done.stderr)
        self.assertEqual(scene.read_text(encoding="utf-8"), LAG)

    def test_messages_are_bounded_and_plain(self):
        for value in ("\x1b[2J\x7f", "1," * 50000):
            done = subprocess.run(self.command(self.folder / "t.csv", "--metric", "final(drive/velocity)",
                                               "--set", f"drive/inertia={value}"),
                                  capture_output=True, text=True, check=False, timeout=60)
            self.assertEqual(done.returncode, 2)
            self.assertLess(len(done.stderr), 4100)
            self.assertTrue(done.stderr.rstrip("\n").isprintable(), repr(done.stderr))

    def test_one_metric_is_a_text(self):
        table = variator_sim.sweep(LAG, 1.0, metrics="final(drive/velocity)")
        self.assertEqual(list(table), ["run", "final(drive/velocity)", "reason"])

    def test_files_that_are_no_tables_are_told(self):
        path = self.folder / "t.csv"
        for text in ("", "a,b\n1,2\n", "run,reason\n1\n", "run,x,reason\n1,a,\n"):
            path.write_text(text, encoding="utf-8")
            with self.subTest(text=text), self.assertRaisesRegex(ValueError, "t.csv: no table of a sweep"):
                variator_sim.read_table(path)
        with self.assertRaisesRegex(ValueError, "no file; allowed"):
            variator_sim.read_table()

    # --- tables, and what is left of them ---------------------------------------------------------

    def test_files_and_shards(self):
        arguments = ["--set", "drive/inertia=log:0.5:2:5", "--random",
                     "motor/parameters/c=normal(1,0.01)", "--samples", "3", "--metric",
                     "final(drive/velocity)"]
        subprocess.run(self.command(self.folder / "all.csv", *arguments), check=True, timeout=60)
        parts = []
        for i, kind in ((1, "csv"), (2, "npz")):
            parts.append(self.folder / f"part{i}.{kind}")
            subprocess.run(self.command(parts[-1], *arguments, "--shard", f"{i}/2"), check=True,
                           timeout=60)
        whole = variator_sim.read_table(self.folder / "all.csv")
        self.assertEqual(len(whole["run"]), 15)
        self.check_same(variator_sim.read_table(*parts), whole)
        with self.assertRaisesRegex(ValueError, "more than one"):
            variator_sim.read_table(self.folder / "all.csv", parts[0])
        self.assertEqual(list(self.folder.glob("*.journal")), [])

    def test_rosrun_finds_one(self):
        result = subprocess.run(["rosrun", PACKAGE, "sweep", "--help"], stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, text=True, timeout=60, check=True)
        self.assertIn("usage: sweep SCENE.yaml", result.stdout)

    def test_a_reader_that_goes_away(self):
        scene = self.folder / "scene.yaml"
        scene.write_text(LAG, encoding="utf-8")
        process = subprocess.Popen([sys.executable, SWEEP, str(scene), "--duration", "1", "--set", "drive/inertia=1,2",
                                    "--metric", "final(drive/velocity)"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        process.stdout.close()
        self.assertEqual((process.stderr.read(), process.wait(timeout=60)), ("", 0))
        process.stderr.close()

    def test_killed_and_called_again_it_goes_on(self):
        arguments = ["--set", "drive/inertia=0.5:2:2000", "--metric", "max(drive/velocity)"]
        output = self.folder / "out.csv"
        journal = self.folder / "out.csv.journal"
        # Killed by itself, once the first runs are in the journal: not sooner, not later.
        words = self.command(output, *arguments)
        killed = subprocess.run([sys.executable, "-c", KILLED_AFTER_ONE_CHUNK, *words[1:]],
                                check=False, timeout=120)
        self.assertEqual(killed.returncode, -signal.SIGKILL)
        kept = journal.read_text(encoding="utf-8").count("\n") - 1
        self.assertTrue(0 < kept < 2000)
        self.assertFalse(output.exists())
        with open(journal, "a", encoding="utf-8") as file:
            file.write("1999,0.123")  # the line that it was writing

        run = []
        whole = sweeps.Task.run

        def counted(task, values, threads, compiles):
            run.extend(values[:, 0])
            return whole(task, values, threads, compiles)

        call = dict(duration=5.0, grid={"drive/inertia": "0.5:2:2000"},
                    metrics=["max(drive/velocity)"])
        with self.assertRaisesRegex(RuntimeError, "other values"):
            variator_sim.sweep(self.folder / "scene.yaml", output=output, rate=50, **call)
        with mock.patch.object(sweeps.Task, "run", counted):
            table = variator_sim.sweep(self.folder / "scene.yaml", output=output, **call)
        self.assertEqual(len(run), 2000 - kept)
        self.assertFalse(journal.exists())
        self.check_same(variator_sim.read_table(output), table)
        self.check_same(table, variator_sim.sweep(self.folder / "scene.yaml", **call))

    # --- what is gone on with ---------------------------------------------------------------------

    def fingerprint(self, scene=LAG, overrides=None, commands=None, rate=100.0, path="drive/inertia"):
        values = numpy.array([[1.0], [2.0]])
        task = sweeps.Task(scene, 1.0, rate, None, commands, overrides, [path], values,
                           ["final(time)"])
        return task.fingerprint(values, (1, 1))

    def test_every_value_counts_to_the_bit(self):
        curve = LAG + "tables: [curve]\ncurve: {x: [0, 1], values: [0, 1]}\n"
        x = numpy.linspace(0.0, 10.0, 1200)
        other = numpy.array(x)
        other[600] = numpy.nextafter(other[600], 1.0)
        self.assertEqual(str(x), str(other))

        def of(values):
            return self.fingerprint(curve, {"curve/x": x, "curve/values": values})
        tree = {"shafts": ["drive"], "drive": {"inertia": 1.0}, "tables": ["curve"],
                "curve": {"x": x, "values": x}}
        commanded = scene_text("drive 1.0", ["motor on drive from torque"])
        for first, second in [
                (of(x), of(other)),
                (self.fingerprint(tree), self.fingerprint({**tree, "curve": {"x": x, "values": other}})),
                (self.fingerprint(LAG, {"initial/angle": [0.0]}), self.fingerprint(LAG, {"initial/angle": [-0.0]})),
                (self.fingerprint(LAG), self.fingerprint(LAG.replace("1 - c", "1 + 0*c - c"))),
                (self.fingerprint(commanded, commands=[(0.1, "torque", 0.1)]),
                 self.fingerprint(commanded, commands=[(0.1, "torque", numpy.nextafter(0.1, 1))])),
                (self.fingerprint(rate=100.0), self.fingerprint(rate=numpy.float32(100.1)))]:
            self.assertNotEqual(first, second)
        for first, second in [(of(x), of(list(x))), (of(x), of(numpy.array(x))),
                              (self.fingerprint(rate=100), self.fingerprint(rate=numpy.float32(100)))]:
            self.assertEqual(first, second)

    def interrupted(self, output):
        """Leaves a journal with its first chunk."""
        keep = sweeps.Journal.add

        def add(*arguments):
            keep(*arguments)
            raise KeyboardInterrupt
        call = dict(duration=1.0, grid={"drive/inertia": "0.5:2:200"}, metrics=["final(drive/velocity)"])
        with mock.patch.object(sweeps.Journal, "add", add), self.assertRaises(KeyboardInterrupt):
            variator_sim.sweep(LAG, output=output, threads=1, **call)
        return call

    def test_lines_of_a_journal_that_are_no_rows_are_run_again(self):
        output = self.folder / "out.csv"
        journal = self.folder / "out.csv.journal"
        call = self.interrupted(output)
        lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
        lines.insert(1, "\n")
        journal.write_bytes("".join(lines).encode() + b"\0\0\0\n7\n\xff,1,\n8,1,2,\n,,\n9,0.1")
        table = variator_sim.sweep(LAG, output=output, **call)
        self.check_same(table, variator_sim.sweep(LAG, **call))
        self.check_same(variator_sim.read_table(output), table)

    def test_files_of_tables_count(self):
        """In the folder of the scene and in packages: other contents are another sweep."""
        package = self.folder / "src/nested/folder"
        package.mkdir(parents=True)
        (package / "package.xml").write_text("<package><name>maps</name></package>", encoding="utf-8")
        scene = self.folder / "scene.yaml"
        for name, place in [("m.csv", self.folder / "m.csv"), ("package://maps/m.csv", package / "m.csv")]:
            scene.write_text(scene_text("a 1", ["pull on a: map(w_a)"], "tables: [map]",
                                        f"map: {{file: '{name}', x: x, values: y, interpolation: linear}}"), encoding="utf-8")
            prints = []
            with mock.patch.dict(os.environ, ROS_PACKAGE_PATH=str(self.folder / "src")):
                for value in (1, 1, 2):
                    place.write_text(f"x,y\n0,{value}\n100,{value}\n", encoding="utf-8")
                    table = variator_sim.sweep(scene, 2.0, grid={"a/inertia": [1.0, 2.0]}, metrics=["final(a/velocity)"])
                    numpy.testing.assert_allclose(table["final(a/velocity)"], [2.0 * value, value])
                    prints.append(self.fingerprint(scene, path="a/inertia"))
            self.assertEqual(prints[0], prints[1])
            self.assertNotEqual(prints[0], prints[2])

    def test_a_file_that_is_no_journal_is_left_alone(self):
        journal = self.folder / "out.csv.journal"
        kept = self.folder / "kept"
        kept.write_text("mine", encoding="utf-8")
        for make in (lambda: journal.write_text("mine", encoding="utf-8"), lambda: os.mkfifo(journal),
                     lambda: journal.symlink_to(kept), journal.mkdir):
            make()
            mode = stat.S_IFMT(os.lstat(journal).st_mode)
            with self.assertRaisesRegex(RuntimeError, "out.csv.journal is"):
                variator_sim.sweep(LAG, 1.0, grid={"drive/inertia": "1,2"}, metrics=["final(drive/velocity)"],
                                   output=self.folder / "out.csv")
            self.assertEqual(stat.S_IFMT(os.lstat(journal).st_mode), mode)
            self.assertEqual(kept.read_text(encoding="utf-8"), "mine")
            if journal.is_dir():
                break
            if mode == stat.S_IFREG:
                self.assertEqual(journal.read_text(encoding="utf-8"), "mine")
            journal.unlink()

    def test_devices_fifos_and_links_stay(self):
        call = dict(duration=1.0, grid={"drive/inertia": "1,2"}, metrics=["final(drive/velocity)"])
        fifo, link, target = (self.folder / name for name in ("fifo.csv", "link.csv", "target.csv"))
        os.mkfifo(fifo)
        read = []
        reader = threading.Thread(daemon=True, target=lambda: read.append(fifo.read_bytes()))
        reader.start()
        variator_sim.sweep(LAG, output=fifo, **call)
        reader.join(60)
        link.symlink_to(target)
        variator_sim.sweep(LAG, output=link, **call)
        expected = target.read_bytes()
        self.assertEqual(expected.count(b"\n"), 3)
        self.assertEqual(read, [expected])
        target.chmod(0o640)
        variator_sim.sweep(LAG, output=link, **call)
        self.assertEqual(stat.S_IMODE(target.stat().st_mode), 0o640)
        self.assertTrue(link.is_symlink())
        self.assertTrue(fifo.is_fifo())
        self.assertEqual({path.name for path in self.folder.iterdir()}, {"fifo.csv", "link.csv", "target.csv"})
        # (Not by its own name: a test that fails should not replace the machine's.)
        link = self.folder / "stdout"
        link.symlink_to("/dev/stdout")
        done = subprocess.run(self.command(link, "--metric", "final(drive/velocity)", "--set", "drive/inertia=1,2"),
                              stdout=subprocess.PIPE, check=True, timeout=60)
        self.assertEqual(done.stdout.count(b"\n"), 3)
        self.assertTrue(link.is_symlink())

    @unittest.skipUnless(os.geteuid() == 0, "only root makes devices")
    def test_a_device_stays_a_device(self):
        null = self.folder / "null"
        try:
            os.mknod(null, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        except OSError:
            self.skipTest("no devices in this container")
        subprocess.run(self.command(null, "--metric", "final(drive/velocity)", "--set", "drive/inertia=1,2"),
                       check=True, timeout=60)
        self.assertTrue(null.is_char_device())

    def test_a_table_that_cannot_be_written_leaves_the_old_one(self):
        output = self.folder / "out.csv"
        output.write_text("old", encoding="utf-8")
        done = subprocess.run(
            self.command(output, "--metric", "final(drive/velocity)", "--set", "drive/inertia=1:2:50"),
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)),
            stderr=subprocess.PIPE, text=True, check=False, timeout=60)
        self.assertEqual(done.returncode, 3, done.stderr)  # as `simulate` has it
        self.assertRegex(done.stderr, r"File too large: '.*/out\.csv")
        self.assertEqual(output.read_text(encoding="utf-8"), "old")
        self.assertEqual(list(self.folder.glob("*.part")), [])

    # --- other machines ---------------------------------------------------------------------------

    def start(self, *words):
        process = subprocess.Popen([sys.executable, "-m", *words], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, cwd=self.folder)

        def stop():
            process.kill()
            process.wait()
        self.addCleanup(stop)
        return process

    @unittest.skipIf(distributed is None, "python3-distributed is not installed")
    def test_a_scheduler_that_is_not_there(self):
        with mock.patch.object(sweeps, "CONNECT_SECONDS", 0.5):
            for address in ("tcp://127.0.0.1:1", "nonsense"):
                with self.assertRaisesRegex(RuntimeError, f"no Dask scheduler has answered at '{address}'"):
                    variator_sim.sweep(LAG, 1.0, grid={"drive/inertia": "1,2"}, scheduler=address,
                                       metrics=["final(drive/velocity)"])

    @unittest.skipIf(distributed is None, "python3-distributed is not installed")
    def test_a_worker_of_two_is_killed(self):
        # The scheduler chooses a port and writes where it is; workers wait for that.
        place = self.folder / "scheduler.json"
        self.start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
                   "--scheduler-file", str(place), "--no-dashboard")
        workers = [self.start("distributed.cli.dask_worker", "--scheduler-file", str(place),
                              "--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name)
                   for name in ("first", "second")]
        with distributed.Client(scheduler_file=str(place), timeout=60) as client:
            client.wait_for_workers(2, timeout=60)
            scheduler = client.scheduler.address

        added = []
        keep = sweeps.Memory.add

        def watch(memory, runs, metrics, reasons):
            if not added:
                workers[0].kill()
            added.extend(runs)
            keep(memory, runs, metrics, reasons)

        call = dict(duration=5.0, grid={"drive/inertia": "0.5:2:300"},
                    metrics=["max(drive/velocity)"])
        with mock.patch.object(sweeps.Memory, "add", watch):
            table = variator_sim.sweep(LAG, scheduler=scheduler, **call)
        self.assertEqual(workers[0].wait(), -signal.SIGKILL)
        self.assertEqual(sorted(added), list(range(300)))
        self.check_same(table, variator_sim.sweep(LAG, **call))


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "sweep_test", SweepTest)
