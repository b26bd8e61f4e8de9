"""The planner in a thread of its own, for a node that must not stop answering meanwhile."""

import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.priority import stand_back
from tripod_ik.errors import IkError
from tripod_ik.joint_path import NEAR_PATH, NO_PATH, JointPath
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task
from tripod_sim.errors import SceneError, StepError

if TYPE_CHECKING:
    from tripod_ik.planner import Planner

SLID = 1e-5
"""Slides that differ by more [m] need another planner."""

SETTLED = 1.0
"""Time [s] after which servo bodies that have not slid are taken to stay."""

HANDOVER = 5e-4
"""Time [s] that the thread keeps the interpreter while the node waits for it: with Python's own 5 ms each step of
inverse kinematics would wait for one of the model, and more than once.
"""


class PlannerThread:
    """Answers the question for a way, some calls later.

    Attributes:
        notice: What there is to say about it; empty where nothing.
    """

    def __init__(self, build: Callable[[float], "Planner"]) -> None:
        """`build`: makes the planner for a slide [m]; called in another thread."""
        self._build = build
        self._finder: Planner | None = None
        self._built_at = np.nan
        self._thread: threading.Thread | None = None
        self._asked: LinearState | None = None
        self._answer: JointPath | None = None
        self._prepared = np.nan
        self._since: float | None = None
        self.slide = 0.0
        self.notice = ""

    def forget(self) -> None:
        """Rebuild the planner for the next request: the limits have changed."""
        self._built_at = np.nan

    def stand(self, slide: float, now: float) -> None:
        """Take notice of where the servo bodies are [m] at `now` [s]; where they stay, what takes long of the first
        answer is done before it is asked for.
        """
        if not abs(slide - self.slide) < SLID or self._since is None:
            self.slide, self._since = slide, now
        elif now - self._since > SETTLED and not abs(slide - self._prepared) < SLID and not self._is_busy():
            self._prepared = slide
            self._begin(None, (), ())

    def tell(self, poses: int) -> None:
        """Say how many poses are known while the planner is built."""
        self.notice = f"exploring the poses of the robot: {poses} so far"

    def __call__(
        self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState] = ()
    ) -> JointPath | None:
        """Return the way that was asked for; None as long as it is not known, or where there is none."""
        if self._is_busy():
            return None
        if state is self._asked:
            return self._answer
        self._asked, self._answer = state, None
        self.notice = "searching for the closest pose"
        self._begin(state, tuple(tasks), trail)
        return None

    def _is_busy(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _begin(self, state: LinearState | None, tasks: Sequence[Task], trail: Sequence[LinearState]) -> None:
        sys.setswitchinterval(min(sys.getswitchinterval(), HANDOVER))
        self._thread = threading.Thread(
            target=self._find, args=(state, tasks, trail, self.slide), daemon=True
        )
        self._thread.start()

    def _find(
        self, state: LinearState | None, tasks: Sequence[Task], trail: Sequence[LinearState], slide: float
    ) -> None:
        stand_back()
        try:
            if self._finder is None or not abs(slide - self._built_at) < SLID:
                self._finder, self._built_at = self._build(slide), slide
            if state is None:
                self._finder.prepare()
                self.notice = ""
                return
            self._answer = self._finder.way(state, tasks, trail)
            self.notice = self._answer.reason
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            expected = isinstance(error, SceneError | StepError | IkError)
            reason = str(error) if expected else f"{type(error).__name__}: {error}"
            self.notice, self._answer = (
                f"{NEAR_PATH}; there is no model with which to search further: {reason}",
                NO_PATH,
            )

    def close(self, longest: float = 2.0) -> None:
        """Wait for the thread, for `longest` [s]."""
        if self._thread is not None:
            self._thread.join(longest)
