"""Controllers of drivetrains, and a loop that runs them in lockstep. Nothing here knows of ROS.

    from variator_sim import Simulation
    from variator_sim.control import SpeedController, lockstep

    controller = SpeedController("drive", "drive_torque", p=6.0, i=8.0, minimum=-80, maximum=80)
    controller.command = 40.0                                   # rad/s
    for time, velocity in lockstep(Simulation("scene.yaml"), [controller], period=0.01, duration=10.0):
        ...

A controller reads speeds by the names of shafts and answers with commands by the topics of inputs. The nodes
`speed_controller` and `ratio_controller` (variator_sim.control_node) run the same objects.
"""

import csv
import math

from variator_sim.checks import finite, finite_list, name, one_of, pair_of_names


class PI:
    """u = u0 + p e + I,  I' = i e,  minimum <= u <= maximum.

    The integral stands while u is at a limit that e pushes it beyond (no wind-up), and where numbers overflow.
    """

    def __init__(self, p, i, minimum, maximum):
        self.p, self.i = finite("p", p), finite("i", i)
        self.minimum, self.maximum = finite("minimum", minimum), finite("maximum", maximum)
        if not self.minimum < self.maximum:
            raise ValueError(f"minimum: {self.minimum:g} is not below maximum: {self.maximum:g}")
        self.reset()

    def reset(self):
        self._integral = 0.0
        self._time = None
        self._output = min(max(0.0, self.minimum), self.maximum)

    def update(self, time, error, feed_forward):
        """The output at `time` (s, ascending; where it goes back, all starts anew)."""
        if self._time is not None and time < self._time:
            self.reset()
        period = 0.0 if self._time is None else time - self._time
        self._time = time
        growth = self.i * error * period
        wanted = feed_forward + self.p * error + self._integral + growth
        if math.isnan(wanted):  # inf - inf: the last output stays
            return self._output
        if math.isfinite(wanted) and not (wanted > self.maximum and growth > 0.0 or wanted < self.minimum and growth < 0.0):
            self._integral += growth
        self._output = min(max(feed_forward + self.p * error + self._integral, self.minimum), self.maximum)
        return self._output


class _Controlled:
    """What controllers share: a set point that is a finite number."""

    _command = 0.0

    @property
    def command(self):
        """The set point, rad/s."""
        return self._command

    @command.setter
    def command(self, value):
        self._command = finite("command", value, "rad/s")


class SpeedController(_Controlled):
    """Keeps the speed of `shaft` at `command`, rad/s, by the input `topic` (a torque, a throttle).

    u = c0 + c1 r + c2 r^2 + PI(r - w): `feed_forward` = [c0, c1, c2, ...] is what the speed r needs in the end.
    """

    def __init__(self, shaft, topic, p, i, minimum, maximum, feed_forward=()):
        self.shaft = name("shaft", shaft)
        self.topic = name("topic", topic)
        self.feed_forward = finite_list("feed_forward", feed_forward)
        self._pi = PI(p, i, minimum, maximum)
        self.reset()

    @property
    def shafts(self):
        return [self.shaft]

    def reset(self):
        self._pi.reset()
        self.state = {}

    def update(self, time, velocity):
        """The command by topic; `velocity` is rad/s by shaft."""
        value = velocity[self.shaft]
        error = self.command - value
        needed = 0.0
        for coefficient in reversed(self.feed_forward):
            needed = needed * self.command + coefficient
        output = self._pi.update(time, error, needed)
        self.state = {"set_point": self.command, "process_value": value, "error": error, "output": output}
        return {self.topic: output}


class RatioController(_Controlled):
    """Keeps the speed of the driving shaft at `command`, rad/s, by the ratio i = w_driven / w_driving.

    i = w_driven / r + PI(w_driving / r - 1): a driving shaft that is too fast needs a higher ratio.
    """

    def __init__(self, shafts, topic, p, i, minimum, maximum):
        self.driving, self.driven = pair_of_names("shafts", shafts, "[driving, driven]")
        self.topic = name("topic", topic)
        self._pi = PI(p, i, minimum, maximum)
        self.reset()

    @property
    def shafts(self):
        return [self.driving, self.driven]

    def reset(self):
        self._pi.reset()
        self.state = {}

    def update(self, time, velocity):
        """The command by topic; nothing before the first `command` above 0."""
        if self.command <= 0.0:
            return {}
        value = velocity[self.driving]
        output = self._pi.update(time, value / self.command - 1.0, velocity[self.driven] / self.command)
        self.state = {"set_point": self.command, "process_value": value, "error": self.command - value,
                      "output": output}
        return {self.topic: output}


class DutyCycle:
    """Commands over time for a controller: straight lines between points, constant beyond the ends."""

    LONGEST = 1 << 24  # characters of a file

    def __init__(self, times, values):
        if len(times) != len(values) or not times or any(b <= a for a, b in zip(times, times[1:])):
            raise ValueError("a duty cycle needs as many values as times, and ascending times")
        self.times = finite_list("times", times)
        self.values = finite_list("values", values)

    @classmethod
    def read(cls, path):
        """Reads a CSV file with the header time,command."""
        with open(path, newline="", encoding="utf-8-sig") as file:
            text = file.read(cls.LONGEST + 1)
        if len(text) > cls.LONGEST:
            raise ValueError(f"{path}: longer than {cls.LONGEST} characters")
        times, values = [], []
        has_header = False
        for count, line in enumerate(text.splitlines(), 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            row = next(csv.reader([line]))
            if not has_header:
                if row != ["time", "command"]:
                    raise ValueError(f"{path}:{count}: {line[:80]!r} is not the header time,command")
                has_header = True
                continue
            try:
                time, value = map(float, row)
            except ValueError:
                time, value = math.nan, math.nan
            if not (math.isfinite(time) and math.isfinite(value)):
                raise ValueError(f"{path}:{count}: {line[:80]!r}; allowed: two finite numbers, time,command in s and rad/s")
            if times and time <= times[-1]:
                raise ValueError(f"{path}:{count}: the time {time:g} s does not follow {times[-1]:g} s; allowed: ascending times")
            times.append(time)
            values.append(value)
        if not times:
            raise ValueError(f"{path}: no points below a header time,command")
        return cls(times, values)

    def __call__(self, time):
        if time <= self.times[0]:
            return self.values[0]
        for k in range(1, len(self.times)):
            if time <= self.times[k]:
                part = (time - self.times[k - 1]) / (self.times[k] - self.times[k - 1])
                return self.values[k - 1] + part * (self.values[k] - self.values[k - 1])
        return self.values[-1]


def check_names(controller, shafts, topics, where):
    """The shafts and the topic of a controller, where it has these, are some of a simulation's."""
    for shaft in getattr(controller, "shafts", ()):
        one_of("shaft", shaft, shafts, f"shaft of {where}")
    if hasattr(controller, "topic"):
        one_of("topic", controller.topic, topics, f"commanded input of {where}")


def lockstep(simulation, controllers, period, duration, duty_cycle=None):
    """Runs `controllers` every `period` s for `duration` s; yields (time, {shaft: velocity}) before each step
    and at the end.

    `simulation` is a variator_sim.Simulation, or what has its `shafts`, `topics`, `sample()`, `command(topic, value)` and
    `advance_to(time)`: control_node.StepClient has, for a node that is paused. Both give the same numbers
    (to the bit after simulation.state(), which a StepClient begins with).
    `duty_cycle` is the command of the first controller over time.
    """
    period = finite("period", period, "s", above=0.0)
    duration = finite("duration", duration, "s", least=0.0)
    for controller in controllers:
        check_names(controller, simulation.shafts, simulation.topics, "the simulation")
    sample = simulation.sample()
    begin = round(sample.time * 1e9)  # ns, as the node counts: instants do not add up roundings
    for k in range(1, round(duration / period) + 1):
        velocity = dict(zip(simulation.shafts, map(float, sample.velocity)))
        yield sample.time, velocity
        if duty_cycle is not None:
            controllers[0].command = duty_cycle(sample.time)
        for controller in controllers:
            for topic, value in controller.update(sample.time, velocity).items():
                simulation.command(topic, value)
        simulation.advance_to((begin + round(k * period * 1e9)) / 1e9)
        sample = simulation.sample()
    yield sample.time, dict(zip(simulation.shafts, map(float, sample.velocity)))


def settling(times, values, target, band):
    """(seconds until `values` stay within `band` of `target`, overshoot in the direction of the step)."""
    settled = times[0]
    for time, value in zip(times, values):
        if abs(value - target) > band:
            settled = time
    sign = 1.0 if target >= values[0] else -1.0
    return settled - times[0], max(0.0, max(sign * (value - target) for value in values))
