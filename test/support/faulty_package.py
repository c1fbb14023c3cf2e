"""A package of torques that fail, made around the library of faulty_torques.cpp."""

import os
import pathlib

import roslib.packages

LIBRARY = "libvariator_sim_faulty.so"


def scene(how, start=None):
    """A scene with a torque that fails from `start`, s, on; while it is built where that is None."""
    when = "" if start is None else f", from: {start}"
    return f"""
shafts: [a]
a: {{inertia: 1}}
torques: [drag]
drag: {{type: variator_sim_faulty/Torque, shaft: a, how: {how}{when}}}
initial: {{velocity: [1]}}
"""


def environment(folder):
    """The variables of the environment with which programs find the package, written to `folder`."""
    package = pathlib.Path(folder) / "variator_sim_faulty"
    package.mkdir(exist_ok=True)
    (package / "package.xml").write_text("""<package format="2">
<name>variator_sim_faulty</name><version>1.0.0</version><description>Torques that fail</description>
<maintainer email="nobody@localhost">nobody</maintainer><license>BSD</license><depend>variator_sim</depend>
<export><variator_sim plugin="${prefix}/plugins.xml"/></export></package>
""", encoding="utf-8")
    (package / "plugins.xml").write_text("""<library path="libvariator_sim_faulty">
<class name="variator_sim_faulty/Torque" type="variator_sim_faulty::Torque" base_class_type="variator_sim::Torque"/>
</library>
""", encoding="utf-8")
    programs = pathlib.Path(roslib.packages.find_node("variator_sim", "simulate")[0]).parent
    library = package / LIBRARY
    if not library.exists():
        library.symlink_to(programs / LIBRARY)
    return {"ROS_PACKAGE_PATH": f"{folder}:{os.environ['ROS_PACKAGE_PATH']}"}
