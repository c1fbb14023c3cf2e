#!/usr/bin/python3
"""`rosrun variator_sim plot`: runs read from files, laid over each other, and what they differ by."""

import os
import pathlib
import signal
import subprocess
import tempfile
from unittest import mock

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import matplotlib  # noqa: E402
matplotlib.use("Agg")
import numpy  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402

from support.scenes import scene_text  # noqa: E402
from support.subtests import TestCase  # noqa: E402
import variator_sim  # noqa: E402
from variator_sim import planes, plotting, recordings  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
SIMULATE = roslib.packages.find_node(PACKAGE, "simulate")[0]
OBSERVED = FOLDER / "test/scenes/observed.yaml"
SOFT = scene_text("drive 1.0, load 1.0", ["soft of order 3: j2-j1"])
FREE = "shafts: [drive]\ndrive: {inertia: 2.0}\n"
CONSTRAINED = scene_text("a 1.0, b 1.0, c 1.0, d 1.0", [
    "motor on a: 5+3*sin(2*t)",
    "belt of order 1: w2-ratio*w1",
    "soft of order 3: j4-j1",
    "slip: e1^2+e3^2+sin(phi1)*w3-3-push"], "inputs: [ratio, push]",
    "ratio: {topic: ratio, hold: second_order_lag, time_constant: 0.3, initial: 0.6}",
    "push: {topic: push, hold: zero_order, initial: 0.0}",
    "initial: {velocity: [5, 3, 1, 0], acceleration: [1, 0.6, 1.4, 0], project: true}")
GROUPS = "state,elements,inputs,outputs,energy"
HOLDING = scene_text("wheel 2.0", [
    "motor on wheel: 4",
    "brake = Brake, shaft: wheel, capacity: 10"], "initial: {velocity: [3.0]}")


class PlotTest(TestCase):

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        for name, *words in [("run.csv", "--rate", "50"), ("run.bag", "--rate", "50"),
                             ("heavy.csv", "--rate", "20", "--set", "load/inertia=3")]:
            subprocess.run([SIMULATE, str(OBSERVED), "--duration", "1", "--columns", GROUPS,
                            "--output", str(cls.folder / name), *words], check=True, timeout=60,
                           stderr=subprocess.DEVNULL)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def plot(self, *words):
        environment = {name: value for name, value in os.environ.items()
                       if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        return subprocess.run(["rosrun", PACKAGE, "plot", *words], cwd=self.folder, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=120, env=environment, check=False)

    def check_refused(self, words, *expected):
        result = self.plot(*words)
        self.assertEqual(result.returncode, 2, result.stderr)
        for word in expected:
            self.assertIn(word, result.stderr)
        self.assertNotIn("Traceback", result.stderr)

    # --- files ------------------------------------------------------------------------------------

    def test_bags_and_files_of_numbers_are_one_run(self):
        expected = variator_sim.simulate(OBSERVED, 1.0, rate=50, columns=GROUPS)
        table = variator_sim.read_run(self.folder / "run.csv")
        self.assertEqual(table.columns, expected.columns)
        numpy.testing.assert_array_equal(table.values, expected.values)
        bag = variator_sim.read_run(self.folder / "run.bag")
        self.assertEqual(set(bag), set(expected))
        for column in expected:
            numpy.testing.assert_array_equal(bag[column], expected[column], err_msg=column)

    def test_a_bag_of_two_drivetrains_after_a_reset(self):
        import rosbag
        from variator_sim.msg import DrivetrainState, SceneInfo
        path = str(self.folder / "two.bag")
        with rosbag.Bag(path, "w") as bag:
            for name in "ab":
                bag.write(f"/{name}/scene", SceneInfo(shafts=[name], constraints=[]))
            for speed, time in [(1.0, 0.0), (2.0, 0.1), (3.0, 0.0), (4.0, 0.2)]:
                for name, sign in (("a", 1.0), ("b", -1.0)):
                    state = DrivetrainState(time=time, **{key: [sign * speed]
                                                          for key in recordings.STATE})
                    bag.write(f"/{name}/state", state)
        run = variator_sim.read_run(path)
        self.assertEqual(list(run["time"]), [0.0, 0.2])
        self.assertEqual(list(run["a/velocity"]), [3.0, 4.0])
        self.assertNotIn("b/velocity", run)

    def test_files_that_are_no_runs(self):
        for name, text, words in [("empty.csv", "", "first column"),
                                  ("header.csv", "time,a\n", "no samples"),
                                  ("short.csv", "time,a\n0,1\n1\n", "line 3: 1 values"),
                                  ("words.csv", "time,a\n0,x\n", "line 2"),
                                  ("semicolons.csv", "time;a\n0;1\n", "separated by semicolons"),
                                  ("other.csv", "t,a\n0,1\n", "not time but 't'"),
                                  ("twice.csv", "time,a,a\n0,1,2\n", "the column 'a' is there more than once"),
                                  ("bare.csv", "time\n0\n1\n", "no column but time"),
                                  ("far.csv", "time,a/velocity\n0,1\n1,1e308\n", "a (Speed, rad/s): 1e+308 at 1 s is too large"),
                                  ("no.bag", "what is this", "no.bag")]:
            path = self.folder / name
            path.write_text(text, encoding="utf-8")
            with self.subTest(name=name):
                self.check_refused([name, "--output", "x.png"], words)
        self.check_refused(["run.csv", "none.csv", "--output", "x.png"], "none.csv")
        whole = self.folder / "run.bag"
        (self.folder / "fields.bag").write_bytes(
            whole.read_bytes().replace(b"float64[] velocity", b"float64[] velosity"))
        self.check_refused(["fields.bag", "--output", "x.png"], "fields.bag: damaged")

    def test_a_mark_of_order_and_one_sample(self):
        path = self.folder / "marked.csv"
        path.write_text("\ufefftime,a/velocity\n0,2\n", encoding="utf-8")
        run = variator_sim.read_run(path)
        self.assertEqual(run.columns, ["time", "a/velocity"])
        _, axes = run.plot()
        self.assertEqual(axes[0].get_lines()[0].get_marker(), "o")
        _, axis = plotting.plot_energy(variator_sim.simulate(OBSERVED, times=[0.5], columns="state,elements,energy"))
        self.assertEqual(axis.get_lines()[-1].get_marker(), "o")

    def test_ctrl_c_while_a_file_is_read(self):
        fifo = self.folder / "fifo.csv"
        os.mkfifo(fifo)
        process = subprocess.Popen([str(FOLDER / "scripts/plot"), str(fifo), "--output", "x.png"], cwd=self.folder, text=True,
                                   stderr=subprocess.PIPE)
        with open(fifo, "w", encoding="utf-8") as file:  # it opens the other end to read
            file.write("time,a\n0,")
            file.flush()
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(60), 130)
        self.assertEqual(process.stderr.read(), "plot: interrupted\n")
        process.stderr.close()

    # --- differences ------------------------------------------------------------------------------

    def test_differences(self):
        run = variator_sim.Result(["time", "a"], numpy.array([[0, 0], [1, 2], [2, 4.0]]), {})
        other = variator_sim.Result(["time", "a"], numpy.array(
            [[0.5, 1], [1.0 + 1e-12, 1], [1.5, 1], [3, 1]]), {})
        times, values = recordings.difference(other, run, "a")
        numpy.testing.assert_allclose(times, [0.5, 1.0, 1.5, 2.0], atol=1e-9)
        numpy.testing.assert_allclose(values, [0.0, -1.0, -2.0, -3.0], atol=1e-9)
        late = variator_sim.Result(["time", "a"], numpy.array([[5, 0], [6, 2.0]]), {})
        self.assertEqual(len(recordings.difference(late, run, "a")[0]), 0)
        gap = variator_sim.Result(["time", "a"], numpy.array([[0, 0], [1, numpy.nan], [2, 4]]), {})
        numpy.testing.assert_array_equal(recordings.difference(gap, run, "a")[1], [0, 0, 0])

    def test_pictures_show_lines_and_differences(self):
        runs = {name: variator_sim.read_run(self.folder / name) for name in ("run.csv", "heavy.csv")}
        figure, axes = plotting.compare(runs, ["*/velocity", "outputs/speed_ratio"])
        self.assertEqual(axes.shape, (3, 2))
        left, right = axes[1]
        self.assertEqual(left.get_ylabel(), "load/velocity\nSpeed, rad/s")
        self.assertEqual([line.get_label() for line in left.get_lines()[:2]], list(runs))
        times, values = recordings.difference(runs["heavy.csv"], runs["run.csv"], "load/velocity")
        drawn = right.get_lines()[1]
        self.assertEqual(drawn.get_color(), left.get_lines()[1].get_color())
        numpy.testing.assert_array_equal(drawn.get_xdata(), times)
        numpy.testing.assert_array_equal(drawn.get_ydata(), values)
        self.assertGreater(abs(values).max(), 0.1)
        self.assertEqual(plotting.compare(runs, differences=False)[1].shape, (8, 1))
        plotting.plt.close("all")

    def test_from_any_folder_by_rosrun(self):
        result = self.plot("run.csv", "heavy.csv", "run.bag", "--compare", "--columns",
                           "load/velocity", "--output", "three.png")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertGreater((self.folder / "three.png").stat().st_size, 10000)
        rows = [line.split() for line in result.stdout.splitlines()]
        self.assertEqual([row[1] for row in rows[1:]], ["heavy.csv", "run.bag"])
        self.assertGreater(abs(float(rows[1][2])), 0.1)
        self.assertEqual(float(rows[2][2]), 0.0)
        for words in (["run.bag"], ["run.csv", "heavy.csv", "--title", "Both"]):
            result = self.plot(*words, "--output", "one.svg")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual(result.stdout, "")

    def test_runs_of_one_name(self):
        (self.folder / "other").mkdir()
        (self.folder / "other/run.csv").write_bytes((self.folder / "run.csv").read_bytes())
        result = self.plot("run.csv", "other/run.csv", "--compare", "--output", "same.png")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("other/run.csv", result.stdout)

    def test_words_are_checked(self):
        self.check_refused(["run.csv", "--columns", "load/velocty", "--output", "x.png"],
                           "did you mean 'load/velocity'")
        self.check_refused(["run.csv", "--columns", "no*", "--output", "x.png"], "no*")
        self.check_refused(["run.csv", "--compare", "--output", "x.png"], "differ from")
        self.check_refused(["run.csv"], "no screen", "--output")
        (self.folder / "none").mkdir()
        (self.folder / "none/matplotlib.py").write_text("raise ImportError", encoding="utf-8")
        with mock.patch.dict(os.environ, PYTHONPATH=f"{self.folder / 'none'}:{os.environ['PYTHONPATH']}"):
            self.check_refused(["run.csv", "--output", "x.png"], "apt install python3-matplotlib")
        self.check_refused(["run.csv", "--output", "x.what"], "what", "allowed: .png, .pdf, .svg")
        self.check_refused(["run.csv", "--output", "picture"], "'picture' does not end in", ".png")
        self.check_refused(["run.csv", "--output", "x.pgn"], "did you mean 'png'")
        self.assertFalse((self.folder / "picture.png").exists())

    # --- the flow of energy ----------------------------------------------------------------------

    def test_bands_of_power(self):
        """Sources and sinks of power are stacked apart; the line is their sum: the rate of T."""
        run = variator_sim.read_run(self.folder / "run.csv")
        _, axis = plotting.plot_energy(run, path=self.folder / "energy.png")
        line = [line for line in axis.get_lines() if len(line.get_xdata()) == len(run["time"])][0]
        powers = [run[name] for name in run if name.endswith("/power")] + [run["power/reactions"]]
        numpy.testing.assert_allclose(line.get_ydata(), sum(powers))
        rate = numpy.gradient(run["energy/kinetic"], run["time"])
        numpy.testing.assert_allclose(line.get_ydata()[2:-2], rate[2:-2], rtol=0.02,
                                      atol=0.02 * numpy.max(numpy.abs(rate)))
        heights = numpy.concatenate([band.get_paths()[0].vertices[:, 1] for band in axis.collections])
        above = sum(numpy.maximum(power, 0.0) for power in powers)
        below = sum(numpy.minimum(power, 0.0) for power in powers)
        self.assertAlmostEqual(heights.max(), above.max(), delta=1e-5 * above.max())
        self.assertAlmostEqual(heights.min(), below.min(), delta=1e-5 * above.max())
        plotting.plt.close("all")

    def test_bands_of_a_run_with_incomplete_samples(self):
        run = variator_sim.read_run(self.folder / "run.csv")
        _, whole = plotting.plot_energy(run)
        run.values[5, run.columns.index("power/reactions")] = numpy.nan
        run.values[7, [run.columns.index(name) for name in run if name.endswith("/power")]] = numpy.nan
        _, axis = plotting.plot_energy(run)
        self.assertGreater(len(whole.collections), 3)
        self.assertEqual(len(axis.collections), len(whole.collections))
        line = [line for line in axis.get_lines() if len(line.get_xdata()) == len(run["time"]) - 2]
        self.assertTrue(numpy.isfinite(line[0].get_ydata()).all())
        run.values[:, run.columns.index("power/reactions")] = numpy.nan
        with self.assertRaisesRegex(ValueError, "no sample of this run has all of its powers"):
            plotting.plot_energy(run)
        plotting.plt.close("all")

    def test_bands_from_the_command_line(self):
        self.assertEqual(self.plot("run.csv", "--energy", "--output", "flow.png").returncode, 0)
        self.assertTrue((self.folder / "flow.png").exists())
        self.check_refused(["run.csv", "heavy.csv", "--energy", "--output", "two.png"], "--energy: of one run")
        subprocess.run([SIMULATE, str(OBSERVED), "--duration", "1", "--output", str(self.folder / "state.csv")],
                       check=True, timeout=60, stderr=subprocess.DEVNULL)
        self.check_refused(["state.csv", "--energy", "--output", "none.png"], "state,elements,energy")

    # --- the plane of accelerations --------------------------------------------------------------

    def draw_plane(self, scene, duration, commands=None, **options):
        run = variator_sim.simulate(scene, duration, rate=50, columns="state,inputs", commands=commands)
        figure, axes = planes.plot_acceleration_plane(run, scene, **options)
        plotting.plt.close(figure)
        return run, axes

    @staticmethod
    def curves_of(axis):
        """Points of each curve; the motion and the points on it were drawn last."""
        return [numpy.concatenate([path.vertices for path in curve.get_paths()])
                for curve in axis.collections[:-2]]

    def test_a_curve_that_stays_is_drawn_once(self):
        run, [axis] = self.draw_plane(FOLDER / "config/acceleration_circle.yaml", 2.0,
                                      limits=((-3.0, 3.0), (-3.0, 3.0)))
        [circle] = self.curves_of(axis)
        numpy.testing.assert_allclose(numpy.hypot(*circle.T), 2.0, atol=1e-3)
        numpy.testing.assert_allclose(circle.min(axis=0), [-2.0, -2.0], atol=1e-3)
        self.assertIn("the same at all times", axis.get_title())
        motion, points = axis.collections[-2:]
        self.assertEqual(len(motion.get_paths()), len(run["time"]) - 1)
        rows = [0, 20, 40, 60, 80, 100]
        numpy.testing.assert_array_equal(
            points.get_offsets(),
            numpy.column_stack([run["drive/acceleration"], run["load/acceleration"]])[rows])

    def test_points_lie_on_the_curves_of_their_instants(self):
        commands = {"ratio": [(0.2, 0.9)], "push": [(0.5, 0.4)]}
        run, axes = self.draw_plane(CONSTRAINED, 1.0, commands, instants=[0.0, 0.4, 0.9])
        titles = [axis.get_title() for axis in axes]
        self.assertEqual(titles, ["belt: f′ = 0", "slip: ψ = 0"])  # `soft` is of order 3
        self.assertEqual([(axis.get_xlabel(), axis.get_ylabel()) for axis in axes],
                         [("Acceleration of a, rad/s²", "Acceleration of b, rad/s²"),
                          ("Acceleration of a, rad/s²", "Acceleration of c, rad/s²")])
        for axis in axes:
            curves = self.curves_of(axis)
            points = axis.collections[-1].get_offsets()
            self.assertEqual((len(curves), len(points)), (3, 3))
            size = numpy.diff(axis.get_xlim())[0]
            for curve, point in zip(curves, points):
                self.assertLess(numpy.hypot(*(curve - point).T).min(), 0.01 * size)
        # The belt's ratio is commanded: its line turns with it.
        slopes = [numpy.polyfit(*curve.T, 1)[0] for curve in self.curves_of(axes[0])]
        numpy.testing.assert_allclose(slopes, run["inputs/ratio"][[0, 20, 45]], rtol=1e-6)
        # At its position e3 has no slope, and it stands still.
        still = {"shafts": ["a", "b", "c"], **{name: {"inertia": 1.0} for name in "abc"}, "constraints": ["ring"],
                 "ring": {"type": "variator_sim/ExpressionConstraint", "order": 2, "expression": "e1^2+e3^2-4"},
                 "initial": {"acceleration": [2, 1, 0]}}
        _, [axis] = self.draw_plane(still, 0.1)
        self.assertEqual(axis.get_ylabel(), "Acceleration of c, rad/s²")
        numpy.testing.assert_allclose([axis.get_xlim(), axis.get_ylim()], [(0.5, 3.5), (-1.5, 1.5)])
        _, axes = self.draw_plane(CONSTRAINED, 0.1, shafts=["c", "b"])
        self.assertEqual([axis.get_xlabel() for axis in axes], ["Acceleration of c, rad/s²"] * 2)

    def test_what_has_no_plane_is_told(self):
        circle = str(FOLDER / "config/acceleration_circle.yaml")
        run = variator_sim.simulate(circle, 1.0)
        for scene, options, words in [
                (circle.replace("acceleration_circle", "ratio_steps"), {}, "drive_torque.*state,inputs"),
                (SOFT, {}, "'soft' is of order 3"), (FREE, {}, "no constraint"),
                (circle, {"instants": [0.5, 1.5]}, "1.5 s; this run is one from 0 to 1 s"),
                (circle, {"shafts": ["drive", "lod"]}, "'lod'.*drive, load"),
                (circle, {"shafts": ["load", "load"]}, "two different")]:
            with self.subTest(words=words), self.assertRaisesRegex(ValueError, words):
                planes.plot_acceleration_plane(run, scene, **options)
        for path, value, words in [("variator/expression", "e1^2+e2^2-4.1", "'variator', of which -0.1 is left"),
                                   ("variator/expression", "e1^2+e2^2-4+t", "at 0.2 s .* with these values")]:
            other = variator_sim.Simulation(circle, {path: value, "initial/project": True})
            with self.subTest(value=value), self.assertRaisesRegex(ValueError, words):
                planes.plot_acceleration_plane(run, other)
        belt = {"variator/order": 1, "variator/expression": "w2-0.5*w1", "initial/project": True}
        with self.assertRaisesRegex(ValueError, "speeds contradict"):
            planes.plot_acceleration_plane(run, variator_sim.Simulation(circle, belt))

    def test_planes_from_the_command_line(self):
        scene = str(FOLDER / "config/ratio_steps.yaml")
        for name in ("steps.bag", "steps.csv"):
            subprocess.run([SIMULATE, scene, "--duration", "1", "--columns", "state,inputs", "--output",
                            str(self.folder / name)], check=True, timeout=60, stderr=subprocess.DEVNULL)
        for words in (["steps.bag"], ["steps.csv", "--scene", scene, "--instants", "0,0.5", "--shafts", "load",
                                      "drive"]):
            result = self.plot(*words, "--acceleration-plane", "--output", "plane.png")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertGreater((self.folder / "plane.png").stat().st_size, 10000)
            (self.folder / "plane.png").unlink()
        for words, expected in [(["steps.csv", "--acceleration-plane"], "--scene SCENE.yaml"),
                                (["steps.bag", "--acceleration-plane", "--shafts", "load", "driv"], "did you mean 'drive'"),
                                (["steps.bag", "--instants", "0,x"], "0,x"),
                                (["steps.bag", "--acceleration-plane", "--instants", "2"], "from 0 to 1 s")]:
            with self.subTest(words=words):
                self.check_refused([*words, "--output", "x.png"], expected)

    def test_modes_are_bands_under_the_speeds(self):
        # It slides for 1 s of 4, then it holds.
        result = variator_sim.simulate(HOLDING, 4.0, columns="state,elements")
        figure, axes = result.plot(["*/velocity", "brake/torque"])
        bands = figure.axes[1]
        self.assertEqual([axis.get_ylabel() for axis in axes], ["Speed, rad/s", "Torque, N m"])
        self.assertEqual([label.get_text() for label in bands.get_yticklabels()], ["brake"])
        self.assertEqual([text.get_text() for text in bands.texts], ["forward", "stuck"])
        spans = [band.get_paths()[0].get_extents() for band in bands.collections]
        numpy.testing.assert_allclose([(span.x0, span.x1) for span in spans], [(0.0, 1.0), (1.0, 4.0)], atol=1e-9)
        self.assertLess(bands.get_position().y1, axes[0].get_position().y0)
        self.assertEqual(len(result.plot(["brake/torque"])[0].axes), 1)  # no speeds, no bands


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "plot_test", PlotTest)
