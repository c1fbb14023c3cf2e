"""For catkin_python_setup: read by CMake, not run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["variator_sim"],
    package_dir={"": "python"},
    package_data={"variator_sim": ["py.typed", "*.pyi"]},
))
