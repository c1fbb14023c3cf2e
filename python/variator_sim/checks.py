"""Checks of arguments: messages name the argument, its value, what is allowed, and the nearest valid name."""

import collections.abc
import difflib
import math
import numbers


def did_you_mean(name, allowed):
    """" (did you mean 'x'?)" with the nearest of the allowed names; "" where none is near."""
    near = difflib.get_close_matches(str(name), list(allowed), 1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def one_of(what, name, allowed, kind):
    """`name`, where it is one of the allowed names of this kind ("shaft of /variator")."""
    if name not in allowed:
        raise ValueError(f"{what}: '{name}' is no {kind}{did_you_mean(name, allowed)}; allowed: "
                         f"{', '.join(allowed) or 'none, there are none'}")
    return name


def is_number(value):
    """Also of NumPy; no text, no truth value."""
    return (isinstance(value, numbers.Real) or hasattr(value, "__float__")) and not isinstance(value, bool)


def shown(value):
    """`value` as Python writes it, bounded."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def finite(what, value, unit="", above=None, least=None):
    """`value` as a float, where it is a finite number within these bounds."""
    allowed = "a finite number" + (f" > {above:g}" if above is not None else f" >= {least:g}" if least is not None else "")
    try:
        if is_number(value):
            number = float(value)
            if math.isfinite(number) and (above is None or number > above) and (least is None or number >= least):
                return number
    except (OverflowError, TypeError):  # a large integer; an array
        pass
    hint = ""
    if isinstance(value, str):
        try:
            hint = f"; this is a text: write {float(value)!r}, without quotes, and with a point (YAML reads 1e-3 as a text)"
        except ValueError:
            hint = "; this is a text"
    raise ValueError(f"{what}: {shown(value)}; allowed: {allowed}{', ' + unit if unit else ''}{hint}")


def whole_number(what, value, least, most=None):
    """`value` as an int, where it is one within these bounds."""
    if not isinstance(value, numbers.Integral) or value < least or (most is not None and value > most):
        allowed = f">= {least}" if most is None else f"from {least} to {most}"
        raise ValueError(f"{what}: {shown(value)}; allowed: a whole number {allowed}")
    return int(value)


def finite_list(what, values):
    """`values` as a list of floats, where they are a list of finite numbers."""
    if isinstance(values, (str, collections.abc.Mapping)) or not isinstance(values, collections.abc.Iterable):
        raise ValueError(f"{what}: {shown(values)}; allowed: a list of finite numbers")
    return [finite(f"{what}[{n}]", value) for n, value in enumerate(values)]


def name(what, value):
    """`value`, where it is the name of something, a text."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"{what}: {shown(value)}; allowed: a name, a text in quotes")
    return value


def pair_of_names(what, value, meaning):
    """`value` as a list of two names."""
    if isinstance(value, str) or not isinstance(value, collections.abc.Sequence) or len(value) != 2 \
            or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{what}: {shown(value)}; allowed: a list of two names, {meaning}")
    return list(value)


def flag(what, value):
    if not isinstance(value, bool):
        raise ValueError(f"{what}: {shown(value)}; allowed: true or false")
    return value


def texts(what, value, example):
    """A list of texts, of one or of several."""
    if isinstance(value, str):
        return [value]
    if not isinstance(value, collections.abc.Iterable) or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{what}: {shown(value)}; allowed: a text such as '{example}', or a list of such")
    return list(value)


def mapping(what, value, example):
    """`value`, where it is a mapping of names, or None."""
    if value is not None and not isinstance(value, collections.abc.Mapping):
        raise ValueError(f"{what}: {shown(value)}; allowed: a dict such as {example}")
    return value
