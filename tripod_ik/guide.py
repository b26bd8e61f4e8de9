"""The pathfinder in a thread of its own, for a node that must not stop answering meanwhile."""

import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tripod_ik.errors import IkError
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task
from tripod_ik.way import NOWHERE, Way
from tripod_sim.errors import SceneError, StepError

if TYPE_CHECKING:
    from tripod_ik.pathfinder import Pathfinder

SLID = 1e-5
"""Slides that differ by more [m] need another pathfinder."""


NEAR_WAY = "closest pose near the way here"
"""What there is to say where there is no way to a better one."""


class Guide:
    """Answers the question for a way, some calls later.

    Attributes:
        notice: What there is to say about it; empty where nothing.
    """

    def __init__(self, build: Callable[[float], "Pathfinder"]) -> None:
        """`build`: makes the pathfinder for a slide [m]; called in another thread."""
        self._build = build
        self._finder: Pathfinder | None = None
        self._built_at = np.nan
        self._thread: threading.Thread | None = None
        self._asked: LinearState | None = None
        self._answer: Way | None = None
        self._waiting = False
        self.slide = 0.0
        self.notice = ""

    def forget(self) -> None:
        """Build the pathfinder anew for the next question: the limits have changed."""
        self._built_at = np.nan

    def __call__(self, state: LinearState, tasks: Sequence[Task], *, hurry: bool = False) -> Way | None:
        """Return the way that was asked for; None as long as it is not known, or where there is none."""
        if self._thread is not None and self._thread.is_alive():
            self._waiting = hurry
            return None
        if state is self._asked:
            return self._answer
        self._asked, self._answer, self._waiting = state, None, False
        self.notice = "looking for the closest pose"
        self._thread = threading.Thread(
            target=self._find, args=(state, tuple(tasks), self.slide), daemon=True
        )
        self._thread.start()
        return None

    def _find(self, state: LinearState, tasks: Sequence[Task], slide: float) -> None:
        try:
            if self._finder is None or not abs(slide - self._built_at) < SLID:
                self._finder, self._built_at = self._build(slide), slide
                self._finder.hurry = lambda: self._waiting
            self._answer = self._finder.way(state, tasks)
            known = self._answer is not NOWHERE
            self.notice = "" if known else f"{NEAR_WAY}; the robot does not rest as its model does"
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            expected = isinstance(error, SceneError | StepError | IkError)
            reason = str(error) if expected else f"{type(error).__name__}: {error}"
            self.notice, self._answer = f"{NEAR_WAY}; no model to look farther: {reason}", NOWHERE

    def close(self, longest: float = 2.0) -> None:
        """Wait for the thread, for `longest` [s]."""
        if self._thread is not None:
            self._thread.join(longest)
