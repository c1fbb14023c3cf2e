#!/usr/bin/python3
"""A million steps of 1 ms in Python beside the same loop in C++: run time and their ratio.

usage: lockstep.py [--steps N] [--rounds N] [--program lockstep_loop]

Both step, read a velocity and, in the second table row, command a torque by it (a controller in the
loop). The rounds take turns; the least time of each counts. Both end at the same bits.
"""

import argparse
import pathlib
import subprocess
import time

import roslib.packages
import variator_sim

SCENE = pathlib.Path(__file__).resolve().parent.parent / "config/ship.yaml"


def run_python(steps, topic):
    simulation = variator_sim.Simulation(SCENE)
    velocity = 0.0
    start = time.perf_counter()
    for _ in range(steps):
        if topic:
            simulation.command(topic, 20.0 - 0.1 * velocity)
        simulation.advance(0.001)
        velocity = simulation["drive/velocity"]
    return time.perf_counter() - start, velocity


def run_cpp(program, steps, topic):
    text = subprocess.run([program, str(SCENE), str(steps), topic or "-"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    return tuple(float(word) for word in text.split())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1000000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--program")
    arguments = parser.parse_args()
    program = arguments.program or roslib.packages.find_node("variator_sim", "lockstep_loop")[0]
    print(f"{'':28}{'C++, ns a step':>16}{'Python':>10}{'ratio':>8}")
    for label, topic in (("step, read", None), ("command, step, read", "drive_torque")):
        cpp, python = [], []
        for _ in range(arguments.rounds):
            cpp.append(run_cpp(program, arguments.steps, topic))
            python.append(run_python(arguments.steps, topic))
        assert cpp[0][1] == python[0][1], "the two loops are not the same motion"
        scale = 1e9 / arguments.steps
        a, b = min(cpp)[0] * scale, min(python)[0] * scale
        print(f"{label:28}{a:16.0f}{b:10.0f}{b / a:8.2f}")


if __name__ == "__main__":
    main()
