"""The columns of a drivetrain: names as in the CSV of `simulate`, units, the topics they come from."""

import collections

# Topics of the node, each published while it has subscribers.
GROUPS = ("state", "elements", "inputs", "outputs", "states", "variables", "energy")

Column = collections.namedtuple("Column", "name group unit quantity")

SHAFT_QUANTITIES = (  # field of DrivetrainState, unit
    ("angle", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s²"), ("applied_torque", "N m"),
    ("reaction_torque", "N m"), ("reaction_torque_rate", "N m/s"))
CONSTRAINT_QUANTITIES = (("residual", ""), ("multiplier", ""))
ENERGY_QUANTITIES = (  # field of DrivetrainEnergy, column, unit
    ("kinetic", "energy/kinetic", "J"), ("applied", "energy/applied", "J"),
    ("reactions", "energy/reactions", "J"), ("applied_power", "power/applied", "W"),
    ("reaction_power", "power/reactions", "W"))


def state_columns(scene):
    """Columns of a SceneInfo: shaft by shaft, then constraint by constraint."""
    columns = []
    for names, quantities in ((scene.shafts, SHAFT_QUANTITIES),
                              (scene.constraints, CONSTRAINT_QUANTITIES)):
        columns += [Column(f"{name}/{quantity}", "state", unit, quantity)
                    for name in names for quantity, unit in quantities]
    return columns


def energy_columns():
    return [Column(name, "energy", unit, name.partition("/")[0])
            for _, name, unit in ENERGY_QUANTITIES]


HOLDING_UNITS = {"torque": "N m", "reserve": "N m", "slip": "rad/s", "heat": "J"}  # of elements that hold


def named_columns(group, names, units):
    """Columns of a NamedValues of `group`; `units` has those of inputs by their topics and of
    outputs by their names."""
    if group != "elements":
        return [Column(f"{group}/{name}", group, units.get(name, ""), group) for name in names]
    columns = []
    holding = {name.rpartition("/")[0] for name in names if name.endswith("/mode")}
    for name in names:
        parts = name.split("/")
        owner, _, what = name.rpartition("/")
        if owner in holding and what in ("mode", *HOLDING_UNITS):
            columns.append(Column(name, group, HOLDING_UNITS.get(what, ""), "mode" if what == "mode" else f"element {what}"))
        elif len(parts) == 3 and parts[2] == "torque":
            columns.append(Column(name, group, "N m", "element torque"))
        elif len(parts) == 2 and parts[1] == "power":
            columns.append(Column(name, group, "W", "element power"))
        else:
            columns.append(Column(name, group, "", "element output"))
    return columns


def state_values(message):
    """The values of a DrivetrainState in the order of `state_columns`."""
    values = []
    for quantities in (SHAFT_QUANTITIES, CONSTRAINT_QUANTITIES):
        arrays = [getattr(message, quantity) for quantity, _ in quantities]
        for row in zip(*arrays):
            values += row
    return values


def energy_values(message):
    return [getattr(message, field) for field, _, _ in ENERGY_QUANTITIES]


def fill_state(message, values, shafts, constraints):
    """The inverse of `state_values`."""
    per_shaft = len(SHAFT_QUANTITIES)
    for i, (quantity, _) in enumerate(SHAFT_QUANTITIES):
        setattr(message, quantity, values[i:shafts * per_shaft:per_shaft])
    rest = values[shafts * per_shaft:]
    for i, (quantity, _) in enumerate(CONSTRAINT_QUANTITIES):
        setattr(message, quantity, rest[i:constraints * 2:2])


def fill_energy(message, values):
    """The inverse of `energy_values`."""
    for (field, _, _), value in zip(ENERGY_QUANTITIES, values):
        setattr(message, field, value)
