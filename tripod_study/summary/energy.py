"""The books of energy of a run: what it had, what the servos put in, what is gone."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.simulation import Energies

SWAY = 0.01
"""Of all energy that has moved: how far a stable scheme may sway above the balance without its being told."""

ROUNDING = 1e-6
"""Of all energy there is: less than that is not told as growth either."""

TINY = 1e-10
"""Less than that is no energy [J]."""

STILL = 1e-9
"""Less than that is no motion of the slide [m]."""


@dataclass(frozen=True)
class Balance:
    """Where the energy of a run is [J].

    Attributes:
        kinetic, strain, gravity: At present; gravity is zero in the undeformed shape.
        work: Of the servos on the body since the books were opened.
        unsure: What that may differ by (see `EnergyBooks`).
        lost: To damping, friction and the time steps since then, E_0 + work - E: negative if energy came from nothing.
        since: Simulated time at which the books were opened [s]: the start, or when the slide moved last or a hand
            pulled, whose work is not known.
        moved: The largest of the work, the kinetic energy and the changes of the others since then.
        grew: Whether energy came from nothing, beyond `SWAY` of all that moved, `ROUNDING` of all there is, `unsure`
            and `TINY`.
    """

    kinetic: float
    strain: float
    gravity: float
    work: float
    unsure: float
    lost: float
    since: float
    moved: float
    grew: bool


class EnergyBooks:
    """Follows the energy of a run from step to step.

    The work of the servos is the sum of (tau_k + tau_k+1) . (theta_k+1 - theta_k) / 2 over the steps: second order in
    the step, so that fast motions leave a part of it in `lost`. Where a servo starts or stops at once, torques within
    the step are not between those at its ends: it may differ by half the second difference of tau times the turn.
    """

    def __init__(
        self, energies: Energies, joints: FloatArray, torques: FloatArray, time: float = 0.0
    ) -> None:
        """Open them at `time` [s]: `joints` [rad ..., m], shape (s + 1,), `torques` [N m], shape (s,)."""
        self._open(energies, joints, torques, time)

    def _open(self, energies: Energies, joints: FloatArray, torques: FloatArray, time: float) -> None:
        self._start = self._energies = energies
        self._joints, self._torques = joints.copy(), torques.copy()
        self._work, self._unsure, self._moved, self._since = 0.0, 0.0, 0.0, time
        self._rise = np.zeros_like(torques)
        self._known_work, self._unknown = 0.0, False

    def add(
        self,
        energies: Energies,
        joints: FloatArray,
        torques: FloatArray,
        time: float,
        *,
        untold: bool = False,
    ) -> None:
        """Enter the state at `time` [s], after one more step; `untold`: something else did work that nobody knows.

        Where `energies` is the object that came with an earlier step, they are not known: the work goes on, and the
        balance is that of the earlier step; books that would have to be opened wait for them.
        """
        unknown = energies is self._energies
        s = len(torques)
        if untold or np.abs(joints[s:] - self._joints[s:]).max() > STILL or (self._unknown and not unknown):
            self._open(energies, joints, torques, time)
            self._unknown = unknown
            return
        turn, rise = joints[:s] - self._joints[:s], torques - self._torques
        self._work += float(0.5 * (torques + self._torques) @ turn)
        self._unsure += float(0.5 * np.abs(rise - self._rise) @ np.abs(turn))
        self._torques, self._rise = torques.copy(), rise
        self._joints[:s] = joints[
            :s
        ]  # the slide, and the time of prescribed motions, is compared with where it was when the books were opened
        if unknown:
            return
        self._energies, self._known_work = energies, self._work
        changes = (energies.gravity - self._start.gravity, energies.strain - self._start.strain)
        self._moved = max(self._moved, abs(self._work), energies.kinetic, *map(abs, changes))

    @property
    def balance(self) -> Balance:
        """How they stand."""
        e = self._energies
        lost = total(self._start) + self._known_work - total(e)
        there = abs(e.kinetic) + abs(e.strain) + abs(e.gravity)
        grew = lost < -max(SWAY * self._moved, ROUNDING * there, self._unsure, TINY)
        return Balance(
            e.kinetic, e.strain, e.gravity, self._known_work, self._unsure, lost, self._since, self._moved, grew
        )  # fmt: skip


def total(energies: Energies) -> float:
    """Return the sum of energies [J]."""
    return energies.kinetic + energies.strain + energies.gravity
