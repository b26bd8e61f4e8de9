"""A way through the angles, and who knows ways."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task


@dataclass(frozen=True, eq=False)
class Way:
    """Where to go.

    Attributes:
        stops: Angles [rad], each reached straight from the one before, the last those of the pose; shape (k, s).
        residual: What is missing there [m].
        limits: What keeps the effector from coming closer there.
        firmness: Of the stops, shape (k,).
    """

    stops: FloatArray
    residual: float
    limits: tuple[str, ...]
    firmness: FloatArray


NOWHERE = Way(np.empty((0, 0)), np.inf, (), np.empty(0))
"""No way is known."""


class Ask(Protocol):
    """Who knows ways."""

    def __call__(self, state: LinearState, tasks: Sequence[Task]) -> Way | None:
        """Return the way from a state to the pose that meets tasks best; None is no answer yet: to be asked again."""
