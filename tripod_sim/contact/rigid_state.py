"""Where rigid bodies are and how they move: what changes each step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tripod_sim.state import Copied

FloatArray = NDArray[np.float64]


@dataclass(eq=False)
class RigidState(Copied):
    """Poses and velocities of rigid bodies.

    Attributes:
        centres: Of mass, in world [m], shape (b, 3).
        rotations: From each body's frame to world, shape (b, 3, 3).
        velocities: Of the centres [m/s], shape (b, 3).
        spins: Angular velocities in world [rad/s], shape (b, 3).
    """

    centres: FloatArray
    rotations: FloatArray
    velocities: FloatArray
    spins: FloatArray
