"""A way through the angles, and who knows ways."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.row_limits import SLACK
from tripod_ik.snap_through import SNAP
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task


@dataclass(frozen=True, eq=False)
class JointPath:
    """Where to go.

    Attributes:
        stops: Angles [rad], each reached straight from the one before, the last those of the pose; shape (k, s).
        residual: What is missing there [m].
        limits: What keeps the effector from coming closer there.
        stability_margin: Of the stops, shape (k,).
        reason: Why the pose is no closer, in words; empty where the target is met, or nothing is known.
    """

    stops: FloatArray
    residual: float
    limits: tuple[str, ...]
    stability_margin: FloatArray
    reason: str = ""


NEAR_PATH = "only poses near the path taken were searched"
"""What there is to say where no way to a better one is known."""

NO_PATH = JointPath(
    np.empty((0, 0)), np.inf, (), np.empty(0),
    f"{NEAR_PATH}; the robot is not where its model expects it: go to the working pose, or give "
"the scene of this robot",
)  # fmt: skip
"""No way is known."""


def why_closest(limits: Sequence[str], reason: str, *, searched: bool = True) -> str:
    """Return why a closest pose is no closer, in words: what is known of that, else the active `limits`.

    `searched`: whether a planner searches other poses for a closer one.
    """
    if reason:
        return reason
    slack = [name.removesuffix(SLACK) for name in limits if name.endswith(SLACK)]
    others = [name for name in limits if not name.endswith(SLACK) and name != SNAP]
    reasons = [
        *(["beyond it the body would snap to another shape"] if SNAP in limits else []),
        *([f"limited by {', '.join(others)}"] if others and SNAP not in limits else []),
        *([f"{', '.join(slack)} would have to push, and a cable only pulls"] if slack else []),
    ] or ["no small step comes closer"]
    return "; ".join([*reasons, *([] if searched else ["other poses are searched for servos alone"])])


class PathSource(Protocol):
    """Who knows ways."""

    def __call__(
        self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState] = ()
    ) -> JointPath | None:
        """Return the way from a state to the pose that meets tasks best; None is no answer yet: to be asked again.

        `trail`: states that the robot came by, in this order.
        """
