"""Leading the tracker: from a pose that no step betters to the closest one there is, along a way that does not snap.

Pure: the caller gives the time.
"""

from collections.abc import Sequence
from math import expm1, inf

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.joint_path import PathSource
from tripod_ik.snap_through import HURRY, LEAST_MARGIN, WITHIN
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task

STILL, MOVED = 2e-5, 1e-3
"""A target that moves by less than STILL [m, of a normal] is the same; one that moves by MOVED needs another way."""

WORSE = 1e-5
"""A way to a pose that misses so much more [m] than the present one is not taken: the model is not the robot."""

STRAYED = 0.02
"""A robot that is farther from where the way begins [rad] does not take it."""

MET = 1e-5
"""A target that the end of the way misses by less [m] is met; the tracker finds the rest itself."""

ARRIVED = 1e-3
"""Distance [rad] at which the end of the way counts as reached."""

SLOWEST = 2e-3
"""Of what is left of ρ² at least so much counts, where a way comes to its softest pose."""

PATIENCE = 2.0
"""Time [s] in which the command has to come on by `ARRIVED`; else the way is given up, since something blocks it."""

THINKING = 0.5
"""Time [s] for which a robot that could still move waits for an answer: then it goes on by itself."""


def steps_of(move: float, fall: float) -> float:
    """Return how many steps a way is long.

    Towards a snap the body gets softer: after a part t of the way, of `move` steps as the Jacobian says,
    √(1 - t fall) of the stability margin is left, and the effector has moved by 2 t move / (1 + √(1 - t fall)).

    Args:
        move: Steps, by the Jacobian at its beginning.
        fall: Part of ρ² that is lost on it.
    """
    left = 1.0 - fall / (2.0 * move) if move > 0 else 1.0
    if fall <= 0 or left >= 1.0:
        return move
    return fall / (1.0 - max(left, 0.0) ** 2)


class PathFollower:
    """Asks for a way where the tracker stands still, leads it there and holds it there until the target moves.

    Attributes:
        arrived: Whether it is where it was led to.
        limits: What keeps the effector from coming closer there.
        reason: Why the answer leads no closer, in words; empty without one.
    """

    def __init__(self, ask: PathSource | None) -> None:
        """`ask`: where ways come from; None leads nowhere."""
        self._ask = ask
        self.reset()

    def reset(self) -> None:
        """Begin again, without a way."""
        self._stops: list[FloatArray] = []
        self._question: tuple[LinearState, Sequence[Task], Sequence[LinearState]] | None = None
        self._target = np.zeros(0)
        self._answered, self._waits = False, 0.0
        self._worth = 0.0
        self._beside = np.zeros(0)
        self._moved: tuple[float, FloatArray] | None = None
        self.arrived = self._met = self._calming = False
        self.limits: tuple[str, ...] = ()
        self.reason = ""
        self._margins: list[float] = []
        self._leg = (np.zeros(0), 0.0)

    @property
    def waits(self) -> bool:
        """Whether a question is open."""
        return self._question is not None and not self._answered

    def command(
        self,
        state: LinearState,
        previous: FloatArray,
        target: FloatArray,
        now: float,
        *,
        dt: float,
        reach: float,
        speed: float,
        least_margin: float = 0.0,
    ) -> FloatArray | None:
        """Return the angles to command [rad], shape (s,); None where the tracker finds its way itself.

        Args:
            state: Where the robot is.
            previous: The last command [rad], shape (s,).
            target: Position [m] and normal that are followed, shape (6,).
            now: [s].
            dt: Time since the last command [s].
            reach: How far a servo may turn in it [rad].
            speed: How fast the resting effector may move [m/s].
            least_margin: Stability margin down to which the body may be led, as it swings now.
        """
        if self._question is None:
            return None
        moved = float(np.abs(target - self._target).max())
        if not self._answered:
            return self._question[0].angles if moved < STILL and now <= self._waits else None
        worth = MOVED if self._calming else max(MOVED, self._worth)
        if state.stability_margin < 0 or moved > (STILL if self.arrived else worth):
            self.reset()
        if not self._stops:
            return None
        if self._moved is None or np.abs(previous - self._moved[1]).max() > ARRIVED:
            self._moved = now, previous
        last = self._stops[-1]
        self.arrived = self.arrived or bool(
            len(self._stops) == 1 and np.abs(state.angles - last).max() < ARRIVED
        )
        blocked = not self.arrived and now - self._moved[0] > PATIENCE
        if blocked or (self.arrived and self._met):
            self._stops = []
            return None
        at, left = previous, 1.0
        rho = max(state.stability_margin, 1e-3)
        soft = max(rho**2 - (WITHIN * LEAST_MARGIN) ** 2, SLOWEST) * -expm1(-dt / HURRY)
        if self._margins[0] > rho:  # out of where it is soft: a body that rings there may do so for long
            least_margin = 0.0
        self._calming = rho**2 - least_margin**2 < soft
        if self._calming:  # it waits until the body is calmer, which is no block
            soft, self._moved = max(rho**2 - least_margin**2, 0.0), (now, previous)
        while True:
            way = self._stops[0] - at
            move = float(np.linalg.norm(state.jacobian[:3] @ way)) / max(speed * dt, 1e-12)
            fall = -2 * rho * float(state.stability_margin_slope @ way)
            part = max(
                float(np.abs(way).max()) / max(reach, 1e-12),
                steps_of(move, fall / rho**2),
                fall / max(soft, 1e-12),
                self._softening(at, least_margin, dt),
            )
            if part > left:
                return np.asarray(at + way * (left / part))
            at, left = self._stops[0], left - part
            if len(self._stops) == 1:
                return at
            self._leg = self._stops.pop(0), self._margins.pop(0)

    def _softening(self, at: FloatArray, least_margin: float, dt: float) -> float:
        """Return how many steps of `dt` [s] it takes from angles to the next stop, as soft as it gets.

        What is commanded now the body follows later, so what it is now does not tell what it can bear. The square of
        the stability margin is taken to change evenly between stops.
        """
        (begin, before), end, after = self._leg, self._stops[0], self._margins[0]
        left = float(np.abs(end - at).max()) / max(float(np.abs(end - begin).max()), 1e-12)
        fall = min(left, 1.0) * (before * abs(before) - after * abs(after))
        here = after * abs(after) + fall
        share = max(here - (WITHIN * LEAST_MARGIN) ** 2, SLOWEST) * -expm1(-dt / HURRY)
        return fall / max(min(share, here - least_margin**2), 1e-12)

    def look(
        self,
        state: LinearState,
        tasks: Sequence[Task],
        target: FloatArray,
        residual: float,
        now: float,
        *,
        closest: bool,
        before_snap: bool = False,
        trail: Sequence[LinearState] = (),
    ) -> None:
        """Ask for a way, where the target stands still; to be called with each step.

        Args:
            state: Where the robot is.
            tasks: What it is to do.
            target: Position [m] and normal that are followed, shape (6,).
            residual: What is missing [m].
            now: [s].
            closest: Whether steps do not better the pose.
            before_snap: Whether they do not by much, since a snap is near.
            trail: States that the robot came by.
        """
        still = len(self._beside) and np.abs(target - self._beside).max() < STILL
        self._beside = target
        if self._ask is None or self._answered or not ((closest or before_snap) and still):
            return
        if self._question is None:
            self._question, self._target = (state, tasks, trail), target
            self._waits = inf if closest else now + THINKING
        moved = float(np.abs(target - self._target).max())
        way = self._ask(*self._question)
        if way is None:
            return
        strayed = float(np.abs(state.angles - self._question[0].angles).max()) > STRAYED
        worth = residual - way.residual - moved
        if strayed or moved > max(MOVED, worth):
            self.reset()
            return
        self._answered, self.reason = True, way.reason
        if worth > -WORSE - moved and len(way.stops):
            self._stops, self.limits, self._met = list(way.stops), way.limits, way.residual < MET
            self._worth, self._moved = worth, None
            self._margins, self._leg = way.stability_margin.tolist(), (state.angles, state.stability_margin)
