"""Where rigid bodies are and how they move: what changes each step."""

from dataclasses import dataclass

from tripod_host.arrays import FloatArray
from tripod_sim.copied import Copied


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
