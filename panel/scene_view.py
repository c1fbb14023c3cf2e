"""The panel's view of a scene: its inputs with limits and units, its equations."""

import math
import subprocess
import tempfile

import roslib.packages
import yaml

# Keys of this package's laws that a command may stand for (doc/scene.md).
UNITS = {"acceleration": "rad/s²", "command": "1", "coulomb": "N m", "damping": "N m s/rad",
         "efficiency": "1", "grade": "1", "jerk": "rad/s³", "limit": "rad/s³", "load": "N m",
         "magnitude": "rad/s²", "mass": "kg", "power": "W", "rack": "1", "ratio": "1",
         "stall_torque": "N m", "static": "N m", "stiffness": "N m/rad", "time_constant": "s",
         "torque": "N m", "velocity_change": "rad/s", "viscous": "N m s/rad", "voltage": "V"}


def read_inputs(scene):
    """Reads from a SceneInfo, per commanded input: topic, unit ("" if unknown), initial, min and max (None without a
    limit), hold."""
    tree = yaml.safe_load(scene.parameters) or {}
    found = {}

    def look(node, key, law):
        if not isinstance(node, dict):
            return
        if "topic" in node:
            unit = ""
            if law == "variator_sim/CommandedTorque":
                unit = "N m"
            elif law.startswith("variator_sim/"):
                unit = UNITS.get(key, "")
            found[str(node["topic"])] = (node, unit)
        for name, child in node.items():
            look(child, name, str(child.get("type", law)) if isinstance(child, dict) else law)

    look(tree, "", "")
    inputs = []
    for topic in scene.inputs:
        node, unit = found.get(topic, ({}, ""))
        inputs.append({"topic": topic, "unit": unit, "hold": str(node.get("hold", "zero_order")),
                       "initial": number(node.get("initial")) or 0.0,
                       "min": number(node.get("min")), "max": number(node.get("max"))})
    return inputs


def read_output_units(scene):
    """The units that the outputs of a SceneInfo state, by name."""
    tree = yaml.safe_load(scene.parameters) or {}
    return {name: str(tree[name].get("unit", "")) for name in tree.get("outputs") or []}


def number(value):
    """A finite float, None for anything else; YAML 1.1 reads 1e-9 as a string."""
    try:
        value = float(value)
    except (TypeError, ValueError):
        return None
    return value if math.isfinite(value) else None


def explain(scene):
    """The equations of motion by `simulate --explain`, or why there are none."""
    programs = roslib.packages.find_node("variator_sim", "simulate")
    if not programs:
        return "The program `simulate` of this package was not found."
    with tempfile.TemporaryDirectory(prefix="variator_sim_panel_") as folder:
        path = folder + "/scene.yaml"
        with open(path, "w", encoding="utf-8") as file:
            file.write(scene.parameters)
        try:
            run = subprocess.run([programs[0], path, "--explain"], stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True, timeout=60, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"simulate --explain: {error}"
    text = run.stdout if run.returncode == 0 else run.stderr
    return text.replace(path, "").strip("\n")
