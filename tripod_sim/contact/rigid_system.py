"""What a scene of rigid bodies alone is to the simulation: a system without a soft body."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.contact.rigid_set import RigidSet
from tripod_sim.state import State


class RigidSystem:
    """Rigid bodies alone.

    Attributes:
        unknowns: Six for each body.
        groups: There are none.
        torques: Of servos: there are none, shape (0,).
    """

    def __init__(self, rigid: RigidSet) -> None:
        self.unknowns = 6 * len(rigid.mass)
        self.groups, self.torques = Groups(1), np.zeros(0)

    def start_state(self, joints: FloatArray) -> State:
        """Return a state without nodes."""
        none = np.zeros((0, 3))
        return State(
            none.copy(), none.copy(), np.zeros((0, 3, 3)), none.copy(), np.zeros((0, 3, 3)), joints.copy()
        )

    def potentials(self, state: State) -> tuple[float, float]:
        """Return the energies of the soft body: there is none."""
        return 0.0, 0.0
