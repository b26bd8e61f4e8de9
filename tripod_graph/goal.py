"""A trajectory that somebody waits for the end of: how near the joints must stay, and how it went. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tripod_graph.command import CommandError, CommandFollower
from tripod_graph.joint import Joint
from tripod_graph.names import SLIDE
from tripod_host.arrays import FloatArray

GOAL_ANGLE, GOAL_SLIDE = 0.01, 1e-4
"""How near to the last point a trajectory ends unless the goal says otherwise [rad], [m]; whole degrees are."""

GOAL_SHARE = 0.005
"""The same of joints other than servos and the slide, as a share of their range."""


class Outcome(IntEnum):
    """Values of control_msgs/FollowJointTrajectory.Result.error_code."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class Motion:
    """What a node that follows trajectories does now.

    Attributes:
        trajectory: Which one it follows, see `CommandFollower`; None: none.
        silent: Whether the time for the next command is over, so that the joints hold.
        joints: All, the slide last.
        desired: Where the joints should be now [rad, m].
        end: Where the trajectory ends.
        actual: Where those are of which it is known, the servos first, with the slide or without.
        now: The time of the trajectory [s].
        why: Who is in charge, or what is wrong, for people.
    """

    joints: tuple[Joint, ...]
    trajectory: object
    silent: bool
    desired: FloatArray
    end: FloatArray
    actual: FloatArray
    now: float
    why: str


def motion_of(
    follower: CommandFollower, actual: Sequence[float] | FloatArray, now: float, why: str
) -> Motion:
    """Return what `follower` does at `now` [s]."""
    here, joints = np.array(actual, float), follower.limits.table
    silent = follower.is_silent(now)
    return Motion(joints, follower.trajectory, silent, follower.goal.copy(), follower.end, here, now, why)


@dataclass(frozen=True)
class Tolerances:
    """How far joints may be from where they should be [rad, m]; infinite: no matter.

    Attributes:
        path: On the way, of each joint.
        goal: At the end, of each joint.
        time: How long after the end they may arrive [s]; infinite: as long as the node waits for the next command.
    """

    path: FloatArray
    goal: FloatArray
    time: float = np.inf


def tolerances(
    joints: Sequence[Joint], path: Mapping[str, float], goal: Mapping[str, float], time: float
) -> Tolerances:
    """Return the tolerances that a goal asks for: 0 means the default (none on the way), negative means none.

    Raises:
        CommandError: a joint is unknown, or a number is none.
    """
    none, arrived = (
        np.full(len(joints), np.inf),
        np.array([_default_goal(joint) for joint in joints]),
    )
    return Tolerances(
        _of_joints("path_tolerance", joints, path, none),
        _of_joints("goal_tolerance", joints, goal, arrived),
        time if time > 0 else np.inf,
    )


def judge(
    motion: Motion, tolerance: Tolerances, trajectory: object, end: float
) -> tuple[Outcome, str] | None:
    """Return how `trajectory`, whose last point is due at `end` [s], has ended, and why in one line; None: not yet."""
    if motion.trajectory is not trajectory:
        by = f"interrupted: {motion.why}" if motion.trajectory is None else "replaced by another command"
        return Outcome.INVALID_GOAL, by
    if motion.now < end:
        far = _beyond("path_tolerance", motion, motion.desired, tolerance.path)
        return (Outcome.PATH_TOLERANCE_VIOLATED, far) if far else None
    far = _beyond("goal_tolerance", motion, motion.end, tolerance.goal)
    if not far:
        return Outcome.SUCCESSFUL, ""
    if motion.now < end + tolerance.time and not motion.silent:
        return None
    return Outcome.GOAL_TOLERANCE_VIOLATED, far


def _of_joints(
    name: str, joints: Sequence[Joint], asked: Mapping[str, float], default: FloatArray
) -> FloatArray:
    found, known = default.copy(), [joint.name for joint in joints]
    for joint, value in asked.items():
        if joint not in known:
            raise CommandError(f"{name} names the unknown joint {joint!r:.60}; joints: {', '.join(known)}")
        if np.isnan(value):
            raise CommandError(f"{name} of {joint} is nan; allowed: any number")
        if value:
            found[known.index(joint)] = value if value > 0 else np.inf
    return found


def _default_goal(joint: Joint) -> float:
    if joint.name == SLIDE:
        return GOAL_SLIDE
    return GOAL_ANGLE if joint.unit == "rad" else GOAL_SHARE * joint.span


def _beyond(name: str, motion: Motion, asked: FloatArray, allowed: FloatArray) -> str:
    """Return which joint is farther from where it is asked to be than `allowed`, in words; empty if none is."""
    for joint, here, there, most in zip(motion.joints, motion.actual, asked, allowed, strict=False):
        if not abs(here - there) <= most:  # the negation also catches NaN
            unit, form = joint.unit, ".4f" if joint.unit in ("rad", "m") else ".4g"
            at = f"{joint.name} is at {here:{form}} {unit}, but should be at {there:{form}}"
            return f"{at}; {name} is {most:g} {unit}"
    return ""
