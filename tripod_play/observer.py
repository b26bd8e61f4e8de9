"""Where the ball is now, from where it was seen a while ago.

State of each axis: position x, speed v, and a slow disturbance d of the acceleration (a plate that is not level):

    x' = v,   v' = u + d - c v,   d' = 0,

u the acceleration that the tilt should give. A Kalman filter with constant gains corrects the state as of the moment
of the measurement; what was asked since then is replayed up to now [AstromWittenmark1997, section 12.4].
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError


@dataclass(frozen=True)
class ObserverSettings:
    """What the observer expects.

    Attributes:
        period: Between two updates [s].
        delay: Age of a measurement when it arrives [s], a multiple of the period.
        lag: Time constant with which the robot takes a new tilt [s].
        noise: Standard deviation of a measurement [m].
        push: Of the acceleration that the model does not know, from one period to the next [m/s²].
        drift: Of the change of the disturbance in a period [m/s²].
    """

    period: float = 0.02
    delay: float = 0.06
    lag: float = 0.02
    noise: float = 3e-4
    push: float = 0.3
    drift: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("period", "lag", "noise", "push", "drift"):
            if not 0 < getattr(self, name) < np.inf:
                raise PlayError(f"observer {name} is {getattr(self, name)}; it must be above 0")
        if not 0 <= self.delay <= 1.0:
            raise PlayError(f"observer delay is {self.delay} s; allowed: 0 to 1 s")


class Observer:
    """Estimates position and speed of the ball in the plate's frame, now.

    Attributes:
        position, velocity: The prediction [m], [m/s], shape (2,).
        disturbance: [m/s²], shape (2,).
        tilting: Acceleration that the tilt gives now [m/s²], shape (2,).
        tilted: The same when the last measurement was made.
    """

    def __init__(self, settings: ObserverSettings) -> None:
        self.settings = s = settings
        h = s.period
        self._steps = round(s.delay / h)
        step = np.array([[1, h, 0.5 * h * h], [0, 1, h], [0, 0, 1]])
        known = np.array([[1.0, 0.0, 0.0]])
        push = np.array([0.5 * h * h, h, 0.0])
        spread = np.outer(push, push) * s.push**2 + np.diag([0, 0, s.drift**2]) + 1e-18 * np.eye(3)
        p = solve_discrete_are(step.T, known.T, spread, np.array([[s.noise**2]]))
        self._gain = (p @ known.T / (known @ p @ known.T + s.noise**2)).ravel()
        self.start(np.zeros(2))

    def start(self, position: FloatArray) -> None:
        """Begin again with a ball at rest at `position` [m], shape (2,)."""
        self._past = np.zeros((3, 2))
        self._past[0] = position
        self._asked: deque[FloatArray] = deque([np.zeros(2)] * (self._steps + 1), maxlen=self._steps + 1)
        self.tilted = np.zeros(2)
        self._predict()

    def update(self, asked: FloatArray, seen: FloatArray | None) -> None:
        """Go one period on.

        Args:
            asked: Acceleration asked for from now on [m/s²], shape (2,).
            seen: Position measured `delay` ago [m], shape (2,); None if there is none this time.
        """
        oldest = self._asked[0]
        self._asked.append(np.array(asked))
        if seen is not None:
            self._past += np.outer(self._gain, seen - self._past[0])
        self._past, self.tilted = self._moved(self._past, self.tilted, oldest)
        self._predict()

    def _moved(
        self, state: FloatArray, given: FloatArray, asked: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return state and tilt one period later."""
        h = self.settings.period
        after = asked + (given - asked) * np.exp(-h / self.settings.lag)
        acceleration = 0.5 * (given + after) + state[2]
        moved = np.array(
            [state[0] + h * state[1] + 0.5 * h * h * acceleration, state[1] + h * acceleration, state[2]]
        )
        return moved, after

    def _predict(self) -> None:
        state, given = self._past, self.tilted
        for asked in list(self._asked)[1:]:
            state, given = self._moved(state, given, asked)
        self.tilting = given
        self.position, self.velocity, self.disturbance = state[0].copy(), state[1].copy(), state[2].copy()
