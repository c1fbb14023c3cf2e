"""Drivetrains with a variator, simulated from Python.

    import variator_sim
    result = variator_sim.simulate("scene.yaml", 20.0)
    result["load/velocity"]                                  # an array, rad/s

    simulation = variator_sim.Simulation("scene.yaml", {"drive/inertia": 1.2})
    sample = simulation.step(0.001, {"drive_torque": 25.0})  # lockstep with a controller
    sample.velocity

No ROS master is needed. The messages lie beside: `variator_sim.msg`, `variator_sim.srv`.
"""

from variator_sim.errors import MotionStopped, NoSteadyState, SceneError
from variator_sim.optimal import Programme, optimise
from variator_sim.recordings import read_run
from variator_sim.running import Result, simulate
from variator_sim.simulation import LinearModel, Sample, Simulation, SteadyState
from variator_sim.sweeps import Table, read_table, sweep

__all__ = ["LinearModel", "MotionStopped", "NoSteadyState", "Programme", "Result", "Sample", "SceneError",
           "Simulation", "SteadyState", "Table", "optimise", "read_table", "simulate", "sweep"]
