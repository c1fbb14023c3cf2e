"""Saves what a panel shows: CSV as `simulate` writes it, bags as `rosbag record` does."""

import math
import tempfile

import genpy
import rosbag
from variator_sim.msg import DrivetrainEnergy, DrivetrainState, NamedValues

import columns


def to_csv(table, names, begin, end):
    """The columns for begin <= time <= end, s, in full double precision."""
    _, times, values = table.window(names, begin, end)
    lines = [",".join(["time"] + list(names))]
    for time, row in zip(times.tolist(), values.tolist()):
        if all(math.isnan(value) for value in row):
            continue  # an instant at which other columns came
        lines.append(",".join(map(repr, [time] + row)))
    return "\n".join(lines) + "\n"


def to_bag(link, groups, begin, end):
    """The bytes of a bag: the messages of these groups, the scene, the last status."""
    with tempfile.TemporaryDirectory(prefix="variator_sim_panel_") as folder:
        path = folder + "/panel.bag"
        with rosbag.Bag(path, "w") as bag:
            first = None
            for group in groups:
                for stamp, message in messages(link, group, begin, end):
                    first = stamp if first is None else min(first, stamp)
                    bag.write(f"{link.node}/{group}", message, stamp)
            if first is not None:
                bag.write(f"{link.node}/scene", link.scene, first)
                bag.write(f"{link.node}/status", link.status, first)
        with open(path, "rb") as file:
            return file.read()


def messages(link, group, begin, end):
    """(stamp, message) of a group as it came."""
    names = link.table.groups().get(group, [])
    if not names:
        return
    stamps, times, values = link.table.window(names, begin, end)
    prefix = group + "/" if group in ("inputs", "outputs") else ""
    for stamp, time, row in zip(stamps.tolist(), times.tolist(), values.tolist()):
        if group != "outputs" and all(math.isnan(value) for value in row):
            continue  # nothing of this group came then
        if group == "state":
            message = DrivetrainState()
            columns.fill_state(message, row, len(link.scene.shafts), len(link.scene.constraints))
        elif group == "energy":
            message = DrivetrainEnergy()
            columns.fill_energy(message, row)
        else:
            message = NamedValues(name=[name[len(prefix):] for name in names], value=row)
        message.time = time
        message.header.stamp = genpy.Time.from_sec(0)
        message.header.stamp.secs, message.header.stamp.nsecs = divmod(stamp, 1000000000)
        yield message.header.stamp, message
