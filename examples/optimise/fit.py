#!/usr/bin/python3
"""Fits a motor's curve and a ratio programme to a recorded run, by SciPy's least squares.

usage: fit.py [--recording FILE.csv] [--record] [--picture FILE.png]

The recording has the columns time, drive/velocity, load/velocity, with noise. `--record` makes it
anew, from the values of TRUTH, which the fit does not know.
"""

import argparse
import concurrent.futures
import pathlib

import numpy
import scipy.optimize
import variator_sim

FOLDER = pathlib.Path(__file__).resolve().parent
SCENE = FOLDER / "scene.yaml"
COLUMNS = ["drive/velocity", "load/velocity"]
NOISE = 0.1  # rad/s, standard deviation of a measured speed

# What is looked for: path, first guess, limits.
PARAMETERS = [("motor/breakdown_torque", 20.0, (1.0, 200.0)),       # N m
              ("motor/critical_slip", 0.3, (0.05, 1.0)),            # 1
              *((f"variator/ratio/values[{i}]", 0.5, (0.1, 2.0)) for i in range(4))]
TRUTH = [32.0, 0.18, 0.42, 0.55, 0.75, 0.6]


def run(values, times):
    """The run with these values, a `Result`."""
    overrides = {path: value for (path, *_), value in zip(PARAMETERS, values)}
    return variator_sim.simulate(SCENE, times=times, overrides=overrides)


def record(path):
    times = numpy.linspace(0.0, 12.0, 121)
    result = run(TRUTH, times)
    noise = numpy.random.default_rng(1).normal(0.0, NOISE, (len(times), len(COLUMNS)))
    measured = numpy.column_stack([result[column] for column in COLUMNS]) + noise
    numpy.savetxt(path, numpy.column_stack([times, measured]), fmt="%.4f", delimiter=",",
                  header=",".join(["time", *COLUMNS]), comments="")


def fit(recording):
    """The fitted values and their standard deviations.

    Residuals are differences of speeds in units of the noise. Their derivatives are central
    differences of runs, which the solver's tolerance of 1e-9 leaves six digits; the runs of all
    parameters go at once, for a motion leaves Python's lock to the others.
    """
    times = recording["time"]
    measured = numpy.concatenate([recording[column] for column in COLUMNS])

    def residuals(values):
        result = run(values, times)
        return (numpy.concatenate([result[column] for column in COLUMNS]) - measured) / NOISE

    with concurrent.futures.ThreadPoolExecutor() as pool:
        def jacobian(values):
            steps = 1e-5 * numpy.maximum(1.0, numpy.abs(values))
            moved = [values + sign * step * unit for step, unit in
                     zip(steps, numpy.eye(len(values))) for sign in (1.0, -1.0)]
            ends = list(pool.map(residuals, moved))
            return numpy.column_stack([(above - below) / (2.0 * step) for above, below, step in
                                       zip(ends[::2], ends[1::2], steps)])

        lower, upper = zip(*(limits for _, _, limits in PARAMETERS))
        solution = scipy.optimize.least_squares(
            residuals, [guess for _, guess, _ in PARAMETERS], jacobian, (lower, upper),
            x_scale="jac")
    if not solution.success:
        raise RuntimeError(solution.message)
    # Of Gauss and Newton: the inverse of J^T J, in units of the noise.
    deviations = numpy.sqrt(numpy.diag(numpy.linalg.inv(solution.jac.T @ solution.jac)))
    return solution.x, deviations


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recording", type=pathlib.Path, default=FOLDER / "recording.csv")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--picture", metavar="FILE.png")
    arguments = parser.parse_args()
    if arguments.record:
        record(arguments.recording)
    recording = variator_sim.read_run(arguments.recording)
    values, deviations = fit(recording)
    print(f"{'':28}{'guess':>9}{'fitted':>10}{'±':>9}{'true':>9}")
    for (path, guess, _), value, deviation, true in zip(PARAMETERS, values, deviations, TRUTH):
        print(f"{path:28}{guess:9.3g}{value:10.4f}{deviation:9.4f}{true:9.3g}")
    if arguments.picture:
        import matplotlib
        matplotlib.use("Agg")
        from variator_sim import plotting
        plotting.compare({"recorded": recording, "fitted": run(values, recording["time"])}, COLUMNS,
                         title="Recorded and fitted", path=arguments.picture)


if __name__ == "__main__":
    main()
