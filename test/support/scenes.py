"""Scenes of tests as lines; of C++ tests, scenes.h has the same."""

import re

CONSTRAINTS = ("AccelerationMagnitude", "ExpressionConstraint", "ImposedJerk", "JerkLimit", "KinematicRatio", "PowerFlow",
               "SlipRatio", "TractionCurve", "VBeltRatio")


def element_keys(line):
    """Name, keys and whether it is a constraint, of a line:
    NAME on SHAFT: FORMULA               a torque by formula
    NAME on SHAFT from TOPIC, KEYS       a commanded torque
    NAME: FORMULA, NAME of order N: ...  a constraint by formula, of order 2 if none is given
    NAME = TYPE, KEYS                    a law of this package
    """
    name, word, rest = re.fullmatch(r"(\w+)( = | on \w+ from | on \w+: | of order \d: |: )(.*)", line).groups()
    words = word.strip(" :").split()
    if word == " = ":
        return name, f"type: variator_sim/{rest}", rest.split(",")[0] in CONSTRAINTS
    if "from" in words:
        return name, f"type: variator_sim/CommandedTorque, shaft: {words[1]}, topic: {rest}", False
    if "on" in words:
        return name, f'type: variator_sim/ExpressionTorque, shaft: {words[1]}, torque: "{rest}"', False
    order = words[-1] if words else 2
    return name, f'type: variator_sim/ExpressionConstraint, order: {order}, expression: "{rest}"', True


def scene_text(shafts, elements, *keys):
    """A scene. `shafts` are names with their inertias, "drive 0.8, load 2"; `keys` are further lines."""
    inertias = [part.split() for part in shafts.split(",")]
    read = [element_keys(line) for line in elements]
    lines = [f"{name}: {{inertia: {inertia}}}" for name, inertia in inertias]
    lines += [f"{name}: {{{text}}}" for name, text, _ in read]
    lists = {"shafts": [name for name, _ in inertias]}
    for kind, wanted in (("torques", False), ("constraints", True)):
        names = [name for name, _, is_constraint in read if is_constraint == wanted]
        if names:
            lists[kind] = names
    lines += [f"{kind}: [{', '.join(names)}]" for kind, names in lists.items()]
    return "\n".join([*lines, *keys, ""])
