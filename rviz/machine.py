"""Positions of the parts of a scene in space, for the URDF and the markers."""

import collections
import re

SPACING = 1.25  # m between shafts
LARGEST = 0.34  # m, radius of the wheel of the largest inertia
BELT_SUM = 0.55  # m, sum of the radii of two pulleys

# x of the axis, m; radius of its wheel, m
Shaft = collections.namedtuple("Shaft", "name x radius")
# Joins shafts (indices); y of its plane, m
Joint = collections.namedtuple("Joint", "name shafts y")


def mean_inertia(node):
    """kg m^2; a number, or mean and harmonics."""
    value = (node or {}).get("inertia")
    if isinstance(value, dict):
        value = value.get("mean")
    try:
        return max(float(value), 0.0)
    except (TypeError, ValueError):
        return 0.0


class Machine:
    """Reads a scene's tree, as YAML has it."""

    # From the front (looking along +y): torques, belts, wheels, torque elements between shafts.
    wheel_y = 0.15

    def __init__(self, scene):
        if not isinstance(scene, dict) or not scene.get("shafts"):
            raise ValueError("no list 'shafts'")
        names = [str(name) for name in scene["shafts"]]
        inertias = [mean_inertia(scene.get(name)) for name in names]
        greatest = max(inertias) or 1.0
        middle = 0.5 * SPACING * (len(names) - 1)
        self.shafts = [Shaft(name, SPACING * i - middle,
                             max(0.12, LARGEST * (inertia / greatest) ** 0.2))
                       for i, (name, inertia) in enumerate(zip(names, inertias))]
        self.belts = self._joints(scene, "constraints", -0.1, -0.14)
        self.links = self._joints(scene, "torques", 0.32, 0.06)
        self.front = -0.1 - 0.14 * max(1, len(self.belts))
        self.rod = (self.front, 0.32 + 0.06 * max(1, len(self.links)))

    def _joints(self, scene, kind, y, step):
        """The components of a kind that join two shafts or more."""
        joints = []
        for name in scene.get(kind) or []:
            shafts = self._shafts_of(scene.get(name) or {})
            if len(shafts) > 1:
                joints.append(Joint(str(name), shafts, y + step * len(joints)))
        return joints

    def _shafts_of(self, node):
        """Indices of the shafts that a component names, or whose letters its formula reads."""
        names = [shaft.name for shaft in self.shafts]
        told = node.get("shafts", [])
        found = [names.index(name) for name in told if name in names] \
            if isinstance(told, list) else []
        for key in ("shaft", "reaction_on"):
            if node.get(key) in names:
                found.append(names.index(node[key]))
        for formula in (str(node.get("expression", "")),):
            for name in re.findall(r"\b(?:phi|w|e|j)_(\w+)", formula):
                if name in names:
                    found.append(names.index(name))
            found += [int(digits) - 1 for digits in re.findall(r"\b(?:phi|w|e|j)(\d+)\b", formula)
                      if 0 < int(digits) <= len(names)]
        return sorted(set(found))
