"""One inverse kinematics, from a scene and a target to a summary: what `tripod ik --target` does."""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.atlas import Atlas
from tripod_ik.errors import IkError
from tripod_ik.inverse import PASSED, InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.merit import hard_limits_passed
from tripod_ik.mesh_error import mesh_of
from tripod_ik.model import StaticModel
from tripod_ik.pathfinder import Pathfinder
from tripod_ik.rotation import normal_of, roll_pitch
from tripod_ik.row_limits import EffectorBox, RowLimit, TorqueLimit
from tripod_ik.snap import SNAP
from tripod_ik.target import TargetBox
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene_short import joints_of
from tripod_sim.tables.fields import other_unit

FAR = 2.0
"""A target farther from the effector than so many sizes of the body is no pose that somebody wants."""

WAY = 12
"""Poses on the way from the start that are looked at."""


def solve_once(
    scene: Scene,
    target: Sequence[float],
    *,
    tilt: Sequence[float] = (0.0, 0.0),
    goal: Goal = Goal.POSITION,
    slide: float,
    start: Sequence[float] | None = None,
    torque_max: float = np.inf,
    hard: bool = False,
    box: tuple[FloatArray, FloatArray] | None = None,
    any_branch: bool = False,
    tolerance: float = 1e-6,
    progress: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Return angles, torques and what is missing for a target.

    Args:
        scene: Of the robot; solved without inertia.
        target: x, y, z of the effector at rest [m] in `world`.
        tilt: Roll and pitch [rad], where the goal has a tilt.
        goal: What of both is asked for.
        slide: Inward shift of the servo bodies [m].
        start: Angles [rad] of the pose whose branch is taken; None: see `StaticModel`.
        torque_max: Largest torque [N m]; infinite for no limit.
        hard: Whether torques and box are hard limits.
        box: Smallest and largest corner of where the effector may be [m], or None.
        any_branch: Whether another branch will do.
        tolerance: What may be missing [m].
        progress: Called with the number of linearisations so far and with what the last one found missing [m].

    Returns:
        outcome and reason (words), reached (bool), angles [rad], torques [N m], position [m], roll and pitch [rad],
        error [m], with the scene's `mesh_error` that of the model there (effector, distance) [m], residuals (by task,
        with unit), active_limits, kkt [rad], iterations, seconds, straight_way (whether
        the servos can go there in a straight line from the start without passing a hard limit).

    Raises:
        IkError, SceneError: the input is refused.
        StepError: there is no way to the start.
    """
    position = frozen("target", target, (3,))
    roll, pitch = frozen("tilt", tilt, (2,))
    joints = joints_of(scene)
    begin = None if start is None else frozen("start", start, (joints.count if joints else 0,))
    if np.isnan(torque_max) or torque_max <= 0:
        raise IkError(f"torque limit is {torque_max:g} N m; it must be positive")
    if not 0 < tolerance < np.inf:
        raise IkError(f"tolerance is {tolerance:g} m; it must be positive and finite")
    limits: list[RowLimit] = [TorqueLimit(torque_max, hard=hard)] if np.isfinite(torque_max) else []
    if box is not None:
        limits.append(EffectorBox(*box, hard=hard))
    tasks = TrackerSettings(goal=goal).tasks(position, normal_of(float(roll), float(pitch)))
    model = StaticModel(scene, slide, begin)
    if joints is None:  # StaticModel has refused it
        raise StepError("no servos")
    _check_near(position, model)
    angles = AngleLimit(joints.low, joints.high)
    solver = InverseSolver(
        model, angles, row_limits=limits, any_branch=any_branch, tolerance=tolerance, progress=progress
    )
    began = clock.perf_counter()
    begun, first = model.angles, model.state()
    solution = solver.solve(tasks, everywhere=True)
    held_by_limits = set(solution.active_limits) - {SNAP}
    if solution.outcome is Outcome.CLOSEST and not held_by_limits:  # another way round may be closer
        count, missing = solution.iterations, solution.residual
        tell = progress and (lambda more, missing: progress(count + more, missing))
        if (finder := _finder(scene, slide, angles, limits, tolerance, tell, missing)) and (
            around := finder.around(first)
        ):
            other = finder.closest(tasks, begun, around).solution
            if other.residual < solution.residual - 1e-9:
                solution, model = replace(other, iterations=solution.iterations + finder.count), finder.model
    state, seconds = solution.state, clock.perf_counter() - began
    straight = not (hard and limits) or _keeps_to(limits, model, begun)
    found = roll_pitch(state.equilibrium_rotation[:, 2])
    return {
        "outcome": str(solution.outcome),
        "reason": solution.reason,
        "reached": solution.outcome is Outcome.REACHED,
        "angles": state.angles.tolist(),
        "torques": state.torques.tolist(),
        "position": state.equilibrium.tolist(),
        "roll": found[0],
        "pitch": found[1],
        "error": solution.residual,
        **_mesh_error(model, state.angles),
        "residuals": dict(solution.residuals),
        "active_limits": list(solution.active_limits),
        "kkt": solution.kkt,
        "iterations": solution.iterations,
        "straight_way": straight,
        "seconds": seconds,
    }


def _finder(
    scene: Scene,
    slide: float,
    angles: AngleLimit,
    limits: Sequence[RowLimit],
    tolerance: float,
    progress: Callable[[int, float], None] | None,
    missing: float,
) -> Pathfinder | None:
    """Return what finds ways around snaps; None where the scene cannot begin with as little patience as that has."""
    try:
        atlas = Atlas.of(scene, slide, progress and (lambda poses: progress(poses, missing)))
    except (SceneError, StepError):
        return None
    return Pathfinder(atlas, angles, limits, tolerance=tolerance, progress=progress)


def _mesh_error(model: StaticModel, angles: FloatArray) -> dict[str, Any]:
    """Return the error of the mesh at the effector at `angles` [m], where the scene asks for it; NaN if not known."""
    if not (mesh := mesh_of(model)):
        return {}
    model.move(angles)
    found = mesh.error(model.simulation.state)
    return {"mesh_error": {"effector": model.shown(found.effector).tolist(), "distance": found.distance}}


def _check_near(target: FloatArray, model: StaticModel) -> None:
    """Raise IkError for a target that is far off all that the robot could reach, as one in millimetres is."""
    pose = model.simulation.effector
    if pose is None:  # StaticModel has refused it
        return
    middle, far = np.asarray(pose.position), FAR * float(np.ptp(model.simulation.positions, axis=0).max())
    TargetBox(middle - far, middle + far).check_position(target, other_unit)


def _keeps_to(limits: Sequence[RowLimit], model: StaticModel, begun: FloatArray) -> bool:
    """Return whether the servos can go straight from the angles `begun` [rad] to where `model` stands."""
    way = np.linspace(model.angles, begun, WAY + 1)[1:]
    try:
        passed = [hard_limits_passed(model.move(angles), limits) for angles in way]
    except (StepError, SceneError):
        return False
    return max(passed) <= max(PASSED, passed[-1])  # a start beyond a limit only has to come back
