"""Runs that are files: CSV of `simulate` or `Result.to_csv`, bags of `simulate` or `rosbag record`."""

import csv
import os
import re

import numpy

from variator_sim.checks import shown
from variator_sim.running import Result, units_of

STATE = ("angle", "velocity", "acceleration", "applied_torque", "reaction_torque",
         "reaction_torque_rate")
ENERGY = {"energy/kinetic": "kinetic", "energy/applied": "applied", "energy/reactions": "reactions",
          "power/applied": "applied_power", "power/reactions": "reaction_power"}
KINDS = ("variator_sim/DrivetrainState", "variator_sim/NamedValues", "variator_sim/DrivetrainEnergy")


def read_run(path):
    """The `Result` of a file: a bag where its name ends in .bag, else a CSV whose first column is
    time.

    Of a bag with several drivetrains the first, of a motion that was reset what came after.
    """
    path = os.fspath(path)
    return read_bag(path) if path.endswith(".bag") else read_csv(path)


def read_csv(path):
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.reader(file)
        columns = next(rows, [])
        if not columns or columns[0] != "time":
            header = ",".join(columns)
            hint = "; its columns are separated by semicolons: commas are needed, and points in numbers" if ";" in header else ""
            raise ValueError(f"{path}: the first column is not time but {shown(columns[0] if columns else '')}{hint}; allowed: "
                             "a CSV of `simulate`, with the header time,SHAFT/velocity,..")
        for name in columns:
            if columns.count(name) > 1:
                raise ValueError(f"{path}: the column '{name}' is there more than once; allowed: each name once")
        values = []
        for row in rows:
            try:
                values.append([float(value) for value in row])
            except ValueError as error:
                raise ValueError(f"{path}, line {rows.line_num}: {error}") from None
            if len(row) != len(columns):
                raise ValueError(f"{path}, line {rows.line_num}: {len(row)} values; the header has "
                                 f"{len(columns)}")
    if not values:
        raise ValueError(f"{path}: no samples")
    titles = [re.fullmatch(r"(.*) \[(.*)\]", title) for title in columns]
    columns = [title[1] if title else name for title, name in zip(titles, columns)]
    return Result(columns, numpy.array(values), {}, {title[1]: title[2] for title in titles if title})


def read_state(message, scene):
    shafts = scene.shafts if scene else numbered("shaft", message.velocity)
    constraints = scene.constraints if scene else numbered("constraint", message.residual)
    row = {}
    for i, shaft in enumerate(shafts):
        row.update({f"{shaft}/{name}": getattr(message, name)[i] for name in STATE})
    for i, constraint in enumerate(constraints):
        row[f"{constraint}/residual"] = message.residual[i]
        row[f"{constraint}/multiplier"] = message.multiplier[i]
    return row


def read_group(topic, message):
    """Columns of any other message of a drivetrain."""
    if message._type == "variator_sim/DrivetrainEnergy":
        return {column: getattr(message, field) for column, field in ENERGY.items()}
    group = topic.rsplit("/", 1)[-1]
    prefix = "" if group == "elements" else group + "/"
    return {prefix + name: value for name, value in zip(message.name, message.value)}


def read_bag(path):
    import rosbag  # loads half of ROS
    import yaml
    samples, owner, latest = {}, None, -numpy.inf
    try:
        with rosbag.Bag(path) as bag:
            topics = {topic: info.msg_type for topic, info in
                      bag.get_type_and_topic_info().topics.items()}
            scenes = [topic for topic, kind in topics.items() if kind == "variator_sim/SceneInfo"]
            # (Without topics `read_messages` reads all of them.)
            scenes = {topic.rpartition("/")[0]: message for topic, message, _ in
                      (bag.read_messages(topics=scenes) if scenes else ())}
            wanted = [topic for topic, kind in topics.items() if kind in KINDS]
            for topic, message, _ in bag.read_messages(topics=wanted) if wanted else ():
                namespace = topic.rpartition("/")[0]
                owner = namespace if owner is None else owner
                if namespace != owner:
                    continue
                if message._type == "variator_sim/DrivetrainState":
                    if message.time < latest - 1e-9:
                        samples = {}  # reset
                    latest = message.time
                    row = read_state(message, scenes.get(owner))
                else:
                    row = read_group(topic, message)
                samples.setdefault(message.time, {}).update(row)
    except rosbag.ROSBagException as error:
        raise ValueError(f"{path}: {error}") from None
    except OSError:
        raise
    except Exception as error:  # pylint: disable=broad-except
        # A bag with wrong bytes may raise any exception: of structures, names, classes.
        raise ValueError(f"{path}: damaged, or of other messages than these: "
                         f"{type(error).__name__}: {error}") from None
    if not samples:
        raise ValueError(f"{path} holds no samples of variator_sim")
    columns = list(dict.fromkeys(name for row in samples.values() for name in row))
    values = [[time, *(samples[time].get(name, numpy.nan) for name in columns)]
              for time in sorted(samples)]
    units = units_of(yaml.safe_load(scenes[owner].parameters) or {}) if owner in scenes else {}
    return Result(["time", *columns], numpy.array(values), {}, units)


def read_scene(path):
    """The scene of the run that `read_run` reads from a bag, as YAML text."""
    import rosbag
    path = os.fspath(path)
    try:
        with rosbag.Bag(path) as bag:
            topics = {topic: info.msg_type for topic, info in bag.get_type_and_topic_info().topics.items()}
            wanted = [topic for topic, kind in topics.items() if kind in KINDS]
            first = next(bag.read_messages(topics=wanted), None) if wanted else None
            owner = first.topic.rpartition("/")[0] if first else ""
            scenes = [topic for topic, kind in topics.items()
                      if kind == "variator_sim/SceneInfo" and topic.rpartition("/")[0] == owner]
            for _, message, _ in bag.read_messages(topics=scenes) if scenes else ():
                return message.parameters
    except rosbag.ROSBagException as error:
        raise ValueError(f"{path}: {error}") from None
    raise ValueError(f"{path} does not hold the scene of its run, the topic {owner}/scene")


def numbered(word, values):
    return [f"{word} {i + 1}" for i in range(len(values))]


def difference(run, reference, column):
    """Instants of both runs that lie in both, and `run` minus `reference` there.

    Between samples both are straight lines; where the instants are the same nothing is
    interpolated.
    """
    parts = []
    for one in (run, reference):
        known = ~numpy.isnan(one[column])
        parts.append((one["time"][known], one[column][known]))
    (times, values), (others, other_values) = parts
    if not (len(times) and len(others)):
        return numpy.array([]), numpy.array([])
    instants = numpy.union1d(times, others)
    # Times that differ by rounding alone are one instant.
    if len(instants) > 1:
        apart = numpy.diff(instants, prepend=-numpy.inf) > 1e-9 * max(1.0, abs(instants[-1]))
        instants = instants[apart]
    first, last = max(times[0], others[0]), min(times[-1], others[-1])
    instants = instants[(instants >= first) & (instants <= last)]
    return instants, (numpy.interp(instants, times, values)
                      - numpy.interp(instants, others, other_values))
