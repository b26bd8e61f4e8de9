"""What changes each step, and nothing else."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from tripod_host.arrays import FloatArray

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.ball.ball import BallState
    from tripod_sim.contact.rigid_state import RigidState
    from tripod_sim.integrators.doubling import TwinState
    from tripod_sim.integrators.time_error import ErrorState
    from tripod_sim.integrators.way_steps import WayState
    from tripod_sim.robot.servo import ServoState


@dataclass(eq=False)
class Copied:
    """What remembers arrays, numbers and others of its kind, and is copied with all of them."""

    def copy_to(self, other: Self) -> None:
        """Overwrite `other` with this, without allocating; a part that only one of them has stays as it is."""
        for name in self.__dataclass_fields__:
            value, old = getattr(self, name), getattr(other, name)
            if isinstance(value, np.ndarray):
                old[:] = value
            elif not isinstance(value, Copied) and not isinstance(old, Copied):
                setattr(other, name, value)
            elif value and old:
                value.copy_to(old)

    def copy(self) -> Self:
        """Return an independent copy."""
        values = (getattr(self, name) for name in self.__dataclass_fields__)
        return type(self)(*(value.copy() if hasattr(value, "copy") else value for value in values))


@dataclass(eq=False)
class State(Copied):
    """Configuration and velocity at one instant.

    Attributes:
        positions: Of nodes [m], shape (n, 3).
        velocities: Of nodes [m/s], shape (n, 3); zero in statics.
        modes: Amplitudes of the elements' incompatible modes [m], shape (m, 3, 3).
        centres: Of the rigid bodies [m], shape (b, 3).
        rotations: Of the rigid bodies, matrices, shape (b, 3, 3).
        joints: Angle of each driven frame [rad] and then their common slide [m], shape (s + 1,); where motions are
            prescribed then the time of these [s], too, shape (s + 2,).
        time: Since the last reset [s].
        step: Completed steps since the last reset.
        servos: What the servos remember; None where their angles are ideal.
        ball: The ball; None in a scene without one.
        errors: Those of the time steps, estimated; None where nobody asks for them.
        rigid: Rigid bodies beside the soft one; None in a scene without any.
        twin: The same scene with steps of half the length; None where the error of the steps is not found so.
        way: How far points have gone and what that erred; None where the steps do not follow that.
    """

    positions: FloatArray
    velocities: FloatArray
    modes: FloatArray
    centres: FloatArray
    rotations: FloatArray
    joints: FloatArray
    time: float = 0.0
    step: int = 0
    servos: "ServoState | None" = None
    ball: "BallState | None" = None
    errors: "ErrorState | None" = None
    rigid: "RigidState | None" = None
    twin: "TwinState | None" = None
    way: "WayState | None" = None

    def copy_to(self, other: "State") -> None:
        """As for others, but written out: each step does it."""
        other.positions[:] = self.positions
        other.velocities[:] = self.velocities
        other.modes[:] = self.modes
        other.centres[:] = self.centres
        other.rotations[:] = self.rotations
        other.joints[:] = self.joints
        other.time, other.step = self.time, self.step
        if self.servos and other.servos:
            self.servos.copy_to(other.servos)
        if self.ball and other.ball:
            self.ball.copy_to(other.ball)
        if self.errors and other.errors:
            self.errors.copy_to(other.errors)
        if self.rigid and other.rigid:
            self.rigid.copy_to(other.rigid)
        if self.twin and other.twin:
            self.twin.copy_to(other.twin)
        if self.way and other.way:
            self.way.copy_to(other.way)
