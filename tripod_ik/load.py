"""An unknown weight on the effector, while the robot runs: from how far it sags below the pose of its model.

The servos hold their angles, so a vertical force f at the disc's centre moves place and tilt by f h to first order,
h = (W_ee - J W_ae) e_z of `LinearState`. With what is measured less what the model says, m - y, and its mean r_0 while
nothing was on the disc yet, least squares over the last `WINDOW` give

    f = Σ h . (m - y - r_0) / Σ |h|²,    sd(f) = s sqrt((1 + n / n_0) / Σ |h|²),

s being the scatter of what f does not explain, n and n_0 the numbers of measurements in the window and in r_0. So a
load that comes is told as soon as the window has nothing from before it.

Inverse kinematics takes the load into account: the model then rests at y - f h with the torques τ + f W_aa^-1 W_ae e_z.
What feedback has already measured of it is taken off its correction, so that nothing moves when a load is told, and in
another pose, where h is another, the correction is right before it is measured again. f counts by its share
1 - (half / f)² where that is positive: what might be nothing moves nothing.
Pure: the caller gives the time.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from tripod_ik.arrays import FloatArray, frozen
from tripod_ik.feedback import ModelError
from tripod_ik.history import History, check_delay
from tripod_ik.rotation import tilt_between
from tripod_ik.state import LinearState

WINDOW = 0.4
"""Time over which measurements count [s]: in half a second a load is told whole."""

FEWEST = 8
"""Measurements below which nothing is told."""

QUANTILE = 1.645
"""Standard deviations of half a 90 % interval."""

SLACK = 1e-6
"""Sag per force [m/N, rad/N] below which nothing measured depends on the load."""


@dataclass(frozen=True)
class Load:
    """A vertical load on the effector, beyond what was there at the beginning.

    Attributes:
        force: Downwards [N], negative where something pushes from below; NaN where it is not told.
        half: Half its 90 % interval by the scatter of the measurements [N]; infinite where it is not told.
    """

    force: float
    half: float

    @property
    def sure(self) -> float:
        """The part of the force that counts [N]."""
        return self.force * (1 - (self.half / self.force) ** 2) if abs(self.force) > self.half else 0.0


UNTOLD = Load(math.nan, math.inf)


class LoadObserver:
    """Estimates the load from measured places of the effector, or from its tilt where no place is measured.

    The first `WINDOW` of measurements is the tare: what the model has wrong there, and what lies on the disc.
    """

    def __init__(self, delay: float = 0.03) -> None:
        """`delay`: age of a measurement when it comes [s]. Raises IkError where it is out of range."""
        check_delay(delay, "delay of measurements")
        self.delay = delay
        self.reset()

    def reset(self) -> None:
        """Begin anew: tare again."""
        self._model = History[tuple[FloatArray, FloatArray, FloatArray]]()
        self._rows: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._tare: FloatArray | None = None
        self._tared = 0
        self._borne = 0.0

    def predict(self, state: LinearState, now: float) -> None:
        """Remember the model's pose at rest and its answer to a force, at `now` [s]."""
        self._model.add((state.equilibrium, state.equilibrium_rotation[:, 2], _sag(state)), now)

    def loaded(self, state: LinearState, correction: ModelError | None = None) -> LinearState:
        """Return the state with what is known of the load; `correction` gives up what it has measured of it."""
        load = self.load
        force = load.sure if math.isfinite(load.force) else self._borne
        h, change, self._borne = _sag(state), force - self._borne, force
        if correction:
            correction.give_up(-change * h[:3], -change * _tilt(h, state.equilibrium_rotation[:, 2]))
        if force == 0.0:
            return state
        return replace(
            state,
            equilibrium_offset=state.equilibrium_offset - force * h,
            torques=state.torques + force * (state.stiffness @ state.W[6:, 2]),
        )

    def measure(self, position: FloatArray | None, normal: FloatArray, now: float) -> None:
        """Take a measurement that comes at `now` [s]: position [m], or None, and normal of the effector, (3,) each.

        Raises:
            IkError: it is not finite; the estimate stays.
        """
        p = None if position is None else frozen("measured position", position, (3,))
        u = frozen("measured normal", normal, (3,))
        model = self._model.at(now - self.delay)
        if model is None:
            return
        y, n, h = model
        if p is not None:
            self._rows.append((now, p - y, h[:3]))
        else:
            self._rows.append((now, tilt_between(n, u / np.linalg.norm(u)), _tilt(h, n)))
        if self._tare is None and now - self._rows[0][0] >= WINDOW and len(self._rows) >= FEWEST:
            self._tare, self._tared = np.mean([r for _, r, _ in self._rows], axis=0), len(self._rows)
            self._rows.clear()
        while self._tare is not None and self._rows and now - self._rows[0][0] > WINDOW:
            self._rows.popleft()

    @property
    def load(self) -> Load:
        """The load by the measurements of the last `WINDOW`."""
        if self._tare is None or len(self._rows) < FEWEST:
            return UNTOLD
        r = np.concatenate([row for _, row, _ in self._rows]) - np.tile(self._tare, len(self._rows))
        h = np.concatenate([row for _, _, row in self._rows])
        size = float(h @ h)
        if size < len(self._rows) * SLACK**2:
            return UNTOLD
        force = float(h @ r) / size
        scatter = float(np.linalg.norm(r - force * h)) / math.sqrt(len(r) - 1)
        return Load(-force, QUANTILE * scatter * math.sqrt((1 + len(self._rows) / self._tared) / size))


def _sag(state: LinearState) -> FloatArray:
    """Return h, by which a force upwards moves the effector while the servos stand [m/N, rad/N], shape (6,)."""
    return np.asarray(state.W[:6, 2] - state.jacobian @ state.W[6:, 2])


def _tilt(h: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the part of h that tilts the normal, shape (3,)."""
    return np.asarray(h[3:] - normal * (normal @ h[3:]))
