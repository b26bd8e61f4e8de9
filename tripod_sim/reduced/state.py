"""What a reduced model remembers of the body."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tripod_sim.state import State

FloatArray = NDArray[np.float64]


@dataclass(eq=False)
class ReducedState(State):
    """A state whose positions and velocities are those of the model's rows (see `rows`), not of the mesh's nodes.

    Attributes:
        q: Amplitudes of the shapes [kg^1/2 m], shape (r,).
    """

    q: FloatArray = field(default_factory=lambda: np.zeros(0))

    def copy_to(self, other: State) -> None:
        """Overwrite `other`, a reduced state, too, without allocating."""
        assert isinstance(other, ReducedState)
        super().copy_to(other)
        other.q[:] = self.q

    def copy(self) -> "ReducedState":
        """Return an independent copy."""
        arrays = (self.positions, self.velocities, self.modes, self.centres, self.rotations, self.joints)
        x, v, modes, centres, rotations, joints = (a.copy() for a in arrays)
        return ReducedState(x, v, modes, centres, rotations, joints, self.time, self.step, q=self.q.copy())
