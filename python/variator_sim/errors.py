"""Exceptions with their evidence."""

LONGEST_MESSAGE = 4000  # characters


def presentable(message):
    """`message` for a terminal: bounded, control characters as escapes."""
    message = str(message)
    if len(message) > LONGEST_MESSAGE:
        half = LONGEST_MESSAGE // 2
        message = f"{message[:half]}...{message[-half:]}"
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in message)


class SceneError(ValueError):
    """A scene, an override or a state that cannot be run as it is written.

    Attributes:
        key_path: the key at fault from the scene's root, such as "variator/parameters/tau";
            "" where the message alone says where.
    """

    def __init__(self, message, key_path=""):
        super().__init__(message)
        self.key_path = key_path

    def __reduce__(self):
        return type(self), (str(self), self.key_path)


class MotionStopped(RuntimeError):
    """The motion stopped; nothing moves any more until `Simulation.reset` or `set_state`.

    Attributes:
        reason: "SingularConstraint", "StepUnderflow", "NonFiniteValue", ... (doc/programs.md).
        time: time reached, s.
        sample: the last good state, a `Sample`.
        constraint, torque: name of the element at fault, or None.
        result: of `simulate`: the samples up to then, a `Result`; else None.
    """

    def __init__(self, message, reason, time, sample, constraint=None, torque=None):
        super().__init__(message)
        self.reason = reason
        self.time = time
        self.sample = sample
        self.constraint = constraint
        self.torque = torque
        self.result = None

    def __reduce__(self):
        return (type(self), (str(self), self.reason, self.time, self.sample, self.constraint, self.torque),
                {"result": self.result})


class NoSteadyState(RuntimeError):
    """`Simulation.trim` found no steady state; the message says what stands against it."""
