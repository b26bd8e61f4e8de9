"""What the study of inverse kinematics measures: the pose that a robot takes with the angles found, from the target.

The robot is a model with a much finer mesh. For each target inverse kinematics finds angles on its own model, from the
working pose; the robot takes them, and the error is how far its effector then is from the target.
"""

import time
from functools import cache

import numpy as np

from tripod_ik.inverse import InverseSolver
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.rotation import normal_of
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim.scene import Scene
from tripod_study.motion import scene_of
from tripod_study.plan import Settings
from tripod_study.task import Measured, repeated

SCENE = "tripod"

TARGETS = (
    (0.0, 0.0, -0.012),
    (0.0, 0.0, -0.004),
    (0.003, 0.0, -0.008),
    (-0.002, 0.003, -0.007),
    (-0.002, -0.003, -0.009),
    (0.001, 0.002, -0.010),
)
"""Of the effector [m], all within reach about the working pose."""

HERE = "reference.targets"
"""Not a field: the targets themselves, what a perfect model would reach."""

ITERATIONS, ACCURACY = "ik.max_iterations", "ik.accuracy"
"""Not fields of the scene, but arguments of `InverseSolver`."""

ROBOT = "robot.level"
"""Not a field of the scene: mesh level of the robot's H20 elements."""


def model_scene(settings: Settings) -> Scene:
    """Return the scene of a model with the settings that are the scene's."""
    fields = {k: v for k, v in settings.items() if not k.startswith(("ik.", "robot."))}
    return scene_of(SCENE, fields)


@cache
def robot(level: int) -> StaticModel:
    """Return the robot in its working pose."""
    return StaticModel(model_scene({"mesh.element": "h20", "mesh.level": level, "solver.max_turn": 0.3}))


def task(settings: Settings) -> Measured:
    """Solve for all targets; cost: CPU time of one, from the working pose."""
    if HERE in settings:
        return Measured({"effector": [list(t) for t in TARGETS]}, [1.0])
    model = StaticModel(model_scene(settings))
    joints = model.simulation.joints
    assert joints
    solver = InverseSolver(
        model, AngleLimit(joints.low, joints.high), max_iterations=int(settings[ITERATIONS]),
        accuracy=float(settings[ACCURACY]),
    )  # fmt: skip
    start = model.save()
    angles: list[np.ndarray] = []

    def run() -> float:
        angles.clear()
        cpu = 0.0
        for target in TARGETS:
            model.restore(start)
            tasks = TrackerSettings(goal=Goal.POSITION).tasks(np.array(target), normal_of(0.0, 0.0))
            begin = time.thread_time()
            solver.solve(tasks)
            cpu += time.thread_time() - begin
            angles.append(model.angles)
        return cpu

    cpu = repeated(run)
    reached = _taken(angles, robot(int(settings[ROBOT])))
    return Measured({"effector": reached}, cpu, len(TARGETS), model.simulation.unknowns)


def _taken(angles: list[np.ndarray], plant: StaticModel) -> list[list[float]]:
    """Return where the robot's effector is at each set of angles [m], each from the working pose."""
    start, found = plant.save(), []
    for goal in angles:
        plant.simulation.step(np.append(goal, plant.slide))
        found.append(plant.simulation.state.centres[0].tolist())
        plant.restore(start)
    return found
