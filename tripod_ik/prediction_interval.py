"""The expected error of the pose at which a running robot rests, with 90 % bars: what an identification left unknown.

`tripod_identify.intervals` has the equation. It solves the pose on two more meshes, too long for a control loop: so a
thread of its own does it, once for each place where the servos have stood for `STILL`. While they move nothing is
computed or reported.
"""

import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tripod_graph import diagnostic_keys as keys
from tripod_host.arrays import FloatArray
from tripod_host.priority import stand_back
from tripod_ik.errors import IkError
from tripod_ik.planner_thread import HANDOVER
from tripod_ik.state import LinearState

if TYPE_CHECKING:
    from tripod_identify.intervals import Posterior
    from tripod_sim.scene import Scene

STILL = 0.5
"""Time for which the servos must have stood [s]."""

MOVED = 1e-3
"""Angle by which a servo that stands may stray [rad]: 0.03 mm of the effector, of which the error hardly changes."""

APART = 5e-4
"""Where the model of the posterior rests farther from the one in use [m], they are not the same."""


@dataclass(frozen=True, eq=False)
class PredictedError:
    """Truth less pose at rest: x, y, z [m] and rotation [rad], shape (6,) each; by the model, without any feedback.

    Attributes:
        shift: What is expected; 0 where nothing is known of the mesh.
        half: Half of the 90 % interval about it.
    """

    shift: FloatArray
    half: FloatArray


Bars = Callable[[FloatArray, float], tuple[FloatArray, PredictedError]]
"""Gives place [m] and expected error of the pose at rest, at angles [rad] of shape (s,) and a slide [m]."""


class ExpectedError:
    """Tells the expected error where the robot rests.

    Attributes:
        found: It; None while it is not known.
        reason: Why not.
    """

    def __init__(self, bars: Bars) -> None:
        """`bars`: called in another thread; may raise SceneError, StepError, DataError."""
        self._bars = bars
        self._thread: threading.Thread | None = None
        self._angles: FloatArray | None = None
        self._since = 0.0
        self._asked: FloatArray | None = None
        self.found: PredictedError | None = None
        self.reason = "the mode is not IK yet"

    def look(self, state: LinearState, slide: float, now: float) -> None:
        """Take notice of where the robot is at `now` [s], its servo bodies at `slide` [m]."""
        angles = self._angles
        if angles is None or angles.shape != state.angles.shape or abs(state.angles - angles).max() > MOVED:
            self._angles, self._since = state.angles, now
            self.found, self.reason = None, "the robot moves"
        elif self._asked is not angles and now - self._since >= STILL and not self._is_busy():
            self._asked, self.reason = angles, "being computed"
            sys.setswitchinterval(min(sys.getswitchinterval(), HANDOVER))
            self._thread = threading.Thread(target=self._find, args=(angles, state, slide), daemon=True)
            self._thread.start()

    def _is_busy(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _find(self, angles: FloatArray, state: LinearState, slide: float) -> None:
        stand_back()
        found, reason = None, ""
        try:
            place, expected = self._bars(state.angles, slide)
            apart = float(np.abs(place - state.equilibrium).max())
            if apart > APART:
                off = f"{1e3 * apart:.2f} mm from the model in use"
                reason = f"the identified scene rests {off}: it is another scene, or another equilibrium"
            else:
                found = expected
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            reason = str(error) or type(error).__name__
        if angles is self._angles:
            self.found, self.reason = found, reason

    def values(self) -> dict[str, str]:
        """Return what there is to tell, by name."""
        told = [self.found.shift, self.found.half] if self.found else None
        names = (keys.EXPECTED_ERROR, 0), (keys.EXPECTED_ERROR_HALF, 1)
        return {
            name.replace("[m]", f"[{unit}]"): " ".join(f"{v:.3g}" for v in told[i][part])
            if told
            else f"not told: {self.reason}"
            for name, i in names
            for unit, part in (("m", slice(3)), ("rad", slice(3, 6)))
        }

    def close(self) -> None:
        """Wait for the thread, for a short while."""
        if self._thread is not None:
            self._thread.join(2.0)


def expected_error(posterior: Path, scene: "Scene") -> ExpectedError:
    """Return what tells the expected error by the posterior in a file; `scene`: that it is of.

    Raises IkError where the file has none.
    """
    from tripod_identify.errors import DataError  # noqa: PLC0415
    from tripod_identify.intervals import read_posterior  # noqa: PLC0415 - an effect that is absent

    try:
        known = read_posterior(posterior)
    except DataError as error:
        raise IkError(f"parameter 'posterior': {error}") from None
    return ExpectedError(bars_by(known, scene))


def bars_by(posterior: "Posterior", scene: "Scene") -> Bars:
    """Return what computes the bars."""
    from tripod_identify.intervals import pose_bars  # noqa: PLC0415 - an effect that is absent

    def bars(angles: FloatArray, slide: float) -> tuple[FloatArray, PredictedError]:
        found = pose_bars(scene, posterior, angles[None], np.array([slide]))
        shift = (found.mesh + found.steps)[0] if found.known else np.zeros(6)
        return found.poses[0, :3], PredictedError(shift, found.half[0])

    return bars
