"""Where simulated and real servos stand apart, the simulated ones go to the real ones, not the other way. Pure.

Inverse kinematics goes on from where the simulator says that the servos are. A simulator that was reset, begun again
with other settings, or started after the driver, says that they are where it begins: the robot would be sent there.
"""

import numpy as np

from tripod_host.arrays import FloatArray

LEAP, FASTEST = 0.2, 10.0
"""A simulated servo that is farther on than LEAP [rad], and faster than FASTEST [rad/s], did not turn: the simulator
has begun again."""

NEAR = 0.05
"""Servos that are no farther apart [rad] stand at the same place: one lags behind, or yields to its load."""

PATIENCE = 4.0
"""After this time [s] the simulated servos have come as near as they can: a load or a range holds them."""


class StateSync:
    """Says what to command until the simulated servos are where the robot's are."""

    def __init__(self) -> None:
        self._last: FloatArray | None = None
        self._looked = float("-inf")
        self._since: float | None = None
        self._asked = True

    def begin(self) -> None:
        """Look at the next state whether both are at the same place: what was before it is not known."""
        self._last = None

    def place(self, simulated: FloatArray, robot: FloatArray | None, now: float) -> FloatArray | None:
        """Return the angles to command at `now` [s]; None: there is nothing to wait for.

        Args:
            simulated: Angles of the simulated servos [rad], shape (s,).
            robot: Angles that the driver has sent [rad], shape (s,); None where there is no driver.
            now: Steady time [s].
        """
        leap = max(LEAP, FASTEST * (now - self._looked))
        last, self._last, self._looked = self._last, simulated, now
        if last is None or last.shape != simulated.shape or np.abs(simulated - last).max() > leap:
            self._asked, self._since = True, None
        if not self._asked:
            return None
        self._since = now if self._since is None else self._since
        apart = (
            robot is not None and robot.shape == simulated.shape and np.abs(simulated - robot).max() > NEAR
        )
        self._asked = bool(apart) and now - self._since < PATIENCE
        return robot if self._asked else None
