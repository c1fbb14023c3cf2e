#!/usr/bin/python3
"""A controller in lockstep, in Python: ~step of 1 ms with a command, beside services that do
nothing, an empty one and one with the messages of ~step.

usage: step_probe.py ROUNDS CALLS_PER_ROUND

Prints, for each round and service, the median and the 99th percentile of a call (s).
"""

import math
import sys
import time

import rospy
from std_srvs.srv import Trigger, TriggerRequest
from variator_sim.srv import Step, StepRequest


def quantile(values, fraction):
    return sorted(values)[min(len(values) - 1, int(fraction * len(values)))]


def main():
    if len(sys.argv) < 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    rounds, calls = int(sys.argv[1]), int(sys.argv[2])
    rospy.init_node("step_probe_python", disable_signals=True)
    rospy.wait_for_service("/variator/step")
    rospy.wait_for_service("/trigger/trigger")
    rospy.wait_for_service("/trigger/step")
    step = rospy.ServiceProxy("/variator/step", Step, persistent=True)
    idle = rospy.ServiceProxy("/trigger/step", Step, persistent=True)
    trigger = rospy.ServiceProxy("/trigger/trigger", Trigger, persistent=True)
    request = StepRequest(duration=0.001, command_topics=["drive_torque"], command_values=[0.0])
    empty = TriggerRequest()
    steps = 0
    for number in range(-1, rounds):  # the first one warms up
        times = {}
        for name, service, message in (("step", step, request), ("trigger", trigger, empty),
                                       ("idle", idle, request)):
            times[name] = []
            for _ in range(calls):
                request.command_values[0] = 20.0 * math.sin(1e-3 * steps)
                steps += 1
                begin = time.perf_counter()
                answer = service(message)
                times[name].append(time.perf_counter() - begin)
                if not answer.success:
                    print(f"step_probe.py: {name} failed: {answer.message}", file=sys.stderr)
                    return 1
        if number >= 0:
            for name, values in times.items():
                print(number, name, f"{quantile(values, 0.5):.9f} {quantile(values, 0.99):.9f}",
                      flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
