"""Closing the loop on what is measured: how far the robot is from its model, and a target that makes up for it.

Pure: the caller gives the time.
"""

import math

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import rotation_matrix
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.history import History, check_delay
from tripod_ik.rotation import tilt_between

LONGEST_DT = 0.1
"""Time that a measurement counts for at most [s]: after a gap the correction does not leap."""


class ModelError:
    """Estimates the model's error d, and takes it off the target.

    With y the pose at rest that the model gives for the present angles, m the measured one and τ the delay of the
    measurement, every measurement moves the estimate by

        d += (1 - exp(-dt/T)) (m(t) - y(t - τ) - d),

    and inverse kinematics follows target - d. Where it gets there, y = target - d, so that d integrates the error of
    the robot, m - target, with the time T: integral action, which leaves no error at rest. Where a limit keeps it
    from getting there, d goes to the model's true error and stays: nothing winds up. Tilts are treated the same way,
    as rotation vectors between normals.

    It is stable while the delay that `delay` does not account for is below about T, for any robot that moves by less
    than twice what its model says.

    Attributes:
        shift: Estimate of the position's error, measured minus model [m], shape (3,).
        tilt: Estimate of the normal's error, the rotation vector from the model's to the measured one [rad],
            shape (3,).
    """

    def __init__(
        self, time: float = 0.4, delay: float = 0.03, *, most_shift: float = 0.02, most_tilt: float = 0.35
    ) -> None:
        """Begin without a correction.

        Args:
            time: T [s].
            delay: τ [s].
            most_shift: Largest correction of a position [m]; what is beyond is not the model but a wrong sensor.
            most_tilt: Largest correction of a tilt [rad].

        Raises:
            IkError: one of them is out of range.
        """
        if not 0 < time < math.inf:
            raise IkError(f"feedback time is {time} s; it must be positive and finite")
        check_delay(delay, "feedback delay")
        self.time, self.delay = time, delay
        self._most = {"shift": most_shift, "tilt": most_tilt}
        self.reset()

    def reset(self) -> None:
        """Begin again without a correction."""
        self._model = History[tuple[FloatArray, FloatArray]]()
        self.shift, self.tilt = np.zeros(3), np.zeros(3)
        self._last: float | None = None
        self._measured: set[str] = set()

    def predict(self, position: FloatArray, normal: FloatArray, now: float) -> None:
        """Remember the model's pose at rest for the angles at `now` [s]: position [m] and normal, shape (3,) each."""
        self._model.add((position, normal), now)

    def measure(self, position: FloatArray | None, normal: FloatArray | None, now: float) -> None:
        """Take a measurement that comes at `now` [s]: position [m], normal, or both; None is not measured.

        Raises:
            IkError: it is not finite, or the normal has no direction; the estimate stays.
        """
        p = None if position is None else frozen("measured position", position, (3,))
        u = None if normal is None else frozen("measured normal", normal, (3,))
        if u is not None and not abs(float(np.linalg.norm(u)) - 1.0) < 1e-2:
            raise IkError(f"measured normal {u.tolist()} has not length 1")
        dt = 0.0 if self._last is None else min(max(0.0, now - self._last), LONGEST_DT)
        self._last = now
        model = self._model.at(now - self.delay)
        if model is None:
            return
        gain = -math.expm1(-dt / self.time)
        self._measured |= {name for name, value in (("shift", p), ("tilt", u)) if value is not None}
        if p is not None:
            self.shift = self._bounded("shift", self.shift + gain * (p - model[0] - self.shift))
        if u is not None:
            found = tilt_between(model[1], u / np.linalg.norm(u))
            self.tilt = self._bounded("tilt", self.tilt + gain * (found - self.tilt))

    def give_up(self, shift: FloatArray, tilt: FloatArray) -> None:
        """Take off what the model has of its error by now: [m] and [rad], shape (3,) each; only of what is measured."""
        if "shift" in self._measured:
            self.shift = self._bounded("shift", self.shift - shift)
        if "tilt" in self._measured:
            self.tilt = self._bounded("tilt", self.tilt - tilt)

    def corrected(self, position: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the target that brings the robot to `position` [m] and `normal`, shape (3,) each."""
        return position - self.shift, rotation_matrix(-self.tilt) @ normal

    def _bounded(self, name: str, value: FloatArray) -> FloatArray:
        length = float(np.linalg.norm(value))
        return value if length <= self._most[name] else value * (self._most[name] / length)
