"""An unknown weight on the effector, or contact, while the robot runs: from how far it is off the pose of its model.

The servos hold their angles, so a force f at the disc's centre moves place and tilt by H f to first order,
H = (W_ee - J W_ae) (e_x e_y e_z) of `LinearState`. With what is measured less what the model says, m - y, and its mean
r_0 while nothing was on the disc yet, least squares over the last `WINDOW` give

    f = (Σ H^T H)^-1 Σ H^T (m - y - r_0),    cov(f) = s² (1 + n / n_0) (Σ H^T H)^-1,

s being the scatter of what f does not explain, n and n_0 the numbers of measurements in the window and in r_0. So a
load that comes is told as soon as the window has nothing from before it. A weight is vertical: its f is found with the
column h = H e_z alone, which is closer, unless places were measured and say that f is not. Then something touches the
disc: a weight up to `SIDEWAYS` of whose size a place beside the middle can feign.

Inverse kinematics takes a weight into account (not a contact, which changes with the pose in ways nobody knows): the
model then rests at y - f h with the torques τ + f W_aa^-1 W_ae e_z. What feedback has already measured of it is taken
off its correction, so that nothing moves when a load is told, and in another pose, where h is another, the correction
is right before it is measured again. f counts by its share 1 - (half / f)² where that is positive: what might be
nothing moves nothing.

It is for servos alone. A slack cable gives way where H counts it as taut, and bodies that cables or air bend are too
slender for one H: on the scene `finger_cable` 50 mN read as 93 mN with both cables slack, and with both taut as a push.
Pure: the caller gives the time.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
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

SIDEWAYS = 0.3
"""Horizontal over whole force from which on it is no weight: one 5 mm off the middle feigns 0.13 at a tipped pose."""

SURE = 2.0
"""Half intervals that the horizontal force has to be at least."""

SLACK = 1e-6
"""Sag per force [m/N, rad/N] below which nothing measured depends on the load."""


@dataclass(frozen=True)
class Load:
    """A load on the effector, beyond what was there at the beginning.

    Attributes:
        force: Downwards [N], negative where something pushes from below; NaN where it is not told.
        half: Half its 90 % interval by the scatter of the measurements [N]; infinite where it is not told.
        push: Along x and y [N]; 0 unless it surely is no weight.
    """

    force: float
    half: float
    push: tuple[float, float] = (0.0, 0.0)

    @property
    def sure(self) -> float:
        """The part of the force that counts as a weight [N]."""
        if any(self.push):
            return 0.0
        return self.force * (1 - (self.half / self.force) ** 2) if abs(self.force) > self.half else 0.0


UNTOLD = Load(math.nan, math.inf)


class LoadObserver:
    """Estimates load or contact from measured places of the effector, or from its tilt where no place is measured.

    The first `WINDOW` of measurements is the tare: what the model has wrong there, and what lies on the disc.
    """

    def __init__(self, delay: float = 0.03) -> None:
        """`delay`: age of a measurement when it comes [s]. Raises IkError where it is out of range."""
        check_delay(delay, "delay of measurements")
        self.delay = delay
        self.reset()

    def reset(self) -> None:
        """Start again: tare first."""
        self._model = History[tuple[FloatArray, FloatArray, FloatArray]]()
        self._rows: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._tare: FloatArray | None = None
        self._tared = 0
        self._borne = 0.0

    def predict(self, state: LinearState, now: float) -> None:
        """Remember the model's pose at rest and its answer to a force, at `now` [s]."""
        self._model.add((state.equilibrium, state.equilibrium_rotation[:, 2], _answer(state)), now)

    def loaded(self, state: LinearState, correction: ModelError | None = None) -> LinearState:
        """Return the state with what is known of the load; `correction` gives up what it has measured of it."""
        load = self.load
        force = load.sure if math.isfinite(load.force) else self._borne
        h, change, self._borne = _answer(state)[:, 2], force - self._borne, force
        if correction:
            correction.give_up(-change * h[:3], -change * _tilt(h, state.equilibrium_rotation[:, 2]))
        if force == 0.0:
            return state
        return replace(
            state,
            equilibrium_offset=state.equilibrium_offset - force * h,
            efforts=state.efforts + force * (state.stiffness @ state.W[6:, 2]),
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
        y, n, H = model
        if p is not None:
            self._rows.append((now, p - y, H[:3]))
        else:
            self._rows.append((now, tilt_between(n, u / np.linalg.norm(u)), _tilt(H[:, 2], n)[:, None]))
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
        H = np.concatenate([row for _, _, row in self._rows])
        own = H[:, -1:]
        size = float((own**2).sum())
        if size < len(self._rows) * SLACK**2:
            return UNTOLD
        if H.shape[1] == 3 and (contact := self._contact(r, H)):
            return contact
        force, covariance = self._fitted(r, own)
        return Load(-float(force[0]), QUANTILE * math.sqrt(covariance[0, 0]))

    def _contact(self, r: FloatArray, H: FloatArray) -> Load | None:
        """Return the force that r, shape (3 n,), tells with H, shape (3 n, 3), if it surely is no weight."""
        if np.linalg.svd(H, compute_uv=False)[-1] < math.sqrt(len(self._rows)) * SLACK:
            return None
        force, covariance = self._fitted(r, H)
        x, y, z = force.tolist()
        sideways, half = math.hypot(x, y), QUANTILE * np.sqrt(np.diag(covariance))
        if sideways < max(SIDEWAYS * math.hypot(sideways, z), SURE * math.hypot(half[0], half[1])):
            return None
        return Load(-z, float(half[2]), (x, y))

    def _fitted(self, r: FloatArray, H: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the force that fits best [N], shape (p,), and its covariance."""
        force, *_ = np.linalg.lstsq(H, r, rcond=None)
        scatter = float(((r - H @ force) ** 2).sum()) / (len(r) - H.shape[1])
        more = 1 + len(self._rows) / self._tared
        return np.asarray(force), np.asarray(scatter * more * np.linalg.inv(H.T @ H))


def _answer(state: LinearState) -> FloatArray:
    """Return H, by which forces along x, y, z move the effector while the servos stand [m/N, rad/N], shape (6, 3)."""
    return np.asarray(state.W[:6, :3] - state.jacobian @ state.W[6:, :3])


def _tilt(h: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the part of h that tilts the normal, shape (3,)."""
    return np.asarray(h[3:] - normal * (normal @ h[3:]))
