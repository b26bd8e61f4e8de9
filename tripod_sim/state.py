"""What changes each step, and nothing else."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.copying import Copyable

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.ball.ball import BallState
    from tripod_sim.robot.servo import ServoState


def _none() -> FloatArray:
    return np.zeros((0, 3))


@dataclass(eq=False)
class State(Copyable):
    """Configuration and velocity at one instant.

    Attributes:
        positions: Of nodes [m], shape (n, 3).
        velocities: Of nodes [m/s], shape (n, 3); zero in statics.
        modes: Amplitudes of the elements' incompatible modes [m], shape (m, 3, 3).
        centres: Of the rigid bodies [m], shape (b, 3): of those that hold nodes, then of the f free ones.
        rotations: Of the rigid bodies, matrices, shape (b, 3, 3).
        joints: Angle of each driven frame [rad] and then their common slide [m], shape (s + 1,); where motions are
            prescribed then the time of these [s], too, shape (s + 2,).
        time: Since the last reset [s].
        step: Completed steps since the last reset.
        servos: What the servos remember; None where their angles are ideal.
        ball: The ball; None in a scene without one.
        errors: Those of the time steps, estimated; None where nobody asks for them.
        centre_velocities: Of the free rigid bodies [m/s], shape (f, 3). All others move as the nodes that they hold.
        spins: Angular velocities of the free rigid bodies, in world [rad/s], shape (f, 3).
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
    centre_velocities: FloatArray = field(default_factory=_none)
    spins: FloatArray = field(default_factory=_none)
    twin: "TwinState | None" = None
    way: "WayState | None" = None

    def __repr__(self) -> str:
        """Return it in a few words: the arrays would take pages."""
        return f"<State of {len(self.positions)} nodes at {self.time:.6g} s, step {self.step}>"

    @property
    def rigid(self) -> RigidMotion:
        """Poses and velocities of the free rigid bodies: views of the arrays of this state."""
        first = len(self.centres) - len(self.spins)
        return RigidMotion(self.centres[first:], self.rotations[first:], self.centre_velocities, self.spins)

    @classmethod
    def of_nodes(cls, positions: FloatArray, joints: FloatArray) -> "State":
        """Return nodes at rest, with neither modes nor rigid bodies; copies both."""
        modes, centres, rotations = np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3))
        return cls(positions.copy(), np.zeros_like(positions), modes, centres, rotations, joints.copy())

    def copy_to(self, other: "State") -> None:
        """Overwrite `other` with this, without allocating; a part that only one of them has stays as it is."""
        other.positions[:] = self.positions
        other.velocities[:] = self.velocities
        if self.modes.size:
            other.modes[:] = self.modes
        if self.centres.size:
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
        if self.spins.size:
            other.centre_velocities[:] = self.centre_velocities
            other.spins[:] = self.spins
        if self.twin and other.twin:
            self.twin.copy_to(other.twin)
        if self.way and other.way:
            self.way.copy_to(other.way)


@dataclass(eq=False)
class ErrorState(Copyable):
    """What the estimate of `integrators.time_error` remembers from step to step.

    Attributes:
        error: e_x [m] and e_v [m/s] in the `Coordinates` of the transport, shape (2, n, k).
        before: What the next step may use of the last stage: change, rate and curve (as in `history.History`) of the
            errors, shape (3, 2, n, k).
        velocities: At the end of the last step [m/s], shape (nodes, 3).
        accelerations: At the ends of the last two steps [m/s²], the latest first, shape (2, n, k).
        length: Time between these [s].
        behind: From the latest to the end of the last step [s].
        known: How many of the accelerations are known.
        missing: Length of a first step whose part of the error that comes of j waits for the next step [s], else 0.
        proposed: Length of the next step, where the simulator chooses it [s]; 0 before the first.
        last: Error that the last step added, in parts of the tolerance.
        order: Of the scheme proposed for the next step, where the simulator chooses that, too; 0 before the first.
        still: Whether the last step left no error, and changed neither velocities nor accelerations.
    """

    error: FloatArray
    before: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    known: int = 0
    length: float = 0.0
    behind: float = 0.0
    missing: float = 0.0
    proposed: float = 0.0
    last: float = 1.0
    order: int = 0
    still: bool = False

    def copy_to(self, other: "ErrorState") -> None:
        """As for others, but written out: each step does it."""
        other.error[:], other.before[:] = self.error, self.before
        other.velocities[:], other.accelerations[:] = self.velocities, self.accelerations
        other.known, other.length, other.missing = self.known, self.length, self.missing
        other.proposed, other.last, other.order = self.proposed, self.last, self.order
        other.still, other.behind = self.still, self.behind


@dataclass(eq=False)
class TwinState(Copyable):
    """What the estimate of `steps.doubling` remembers from step to step.

    Attributes:
        twin: Where the twin is.
        last: Where the body was at the end of the last step: if it is elsewhere, somebody has moved it.
        known: Whether both are; 0 or 1.
    """

    twin: State
    last: State
    known: int = 0


@dataclass(eq=False)
class WayState(Copyable):
    """What `steps.path_error_control` remembers. Points are what is shown, then the effector's nodes.

    Attributes:
        origin: Where points began [m], shape (n, 3).
        velocities: Of points at the start of the last part [m/s], shape (n, 3).
        accelerations: Of points at its end [m/s²], shape (n, 3).
        sums: Of the errors of all parts (see `path_error_kernels.write_lengths`), shape (n, 4).
        added: Sum of what parts have added to the errors of points [m], shape (n,).
        furthest: That a point of each kind has been from its origin [m], shape (2,).
        ways: That points have gone [m], shape (n,).
        length: Of the last part [s]; 0 before the first.
        proposed: That of the next [s]; 0 before the first.
        twist: Of the plate of a maze at the end of the last part (see `MazeBall`), shape (2, 3); shape (0, 3) without.
        fastest: That it went [m/s].
        ahead, behind: Balls on plates that are so; None without a maze, and before the ball begins.
    """

    origin: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    sums: FloatArray
    added: FloatArray
    furthest: FloatArray
    ways: FloatArray
    twist: FloatArray
    fastest: float = 0.0
    length: float = 0.0
    proposed: float = 0.0
    ahead: "BallState | None" = None
    behind: "BallState | None" = None

    @property
    def balls(self) -> "list[BallState]":
        """Those ahead and behind, if there are any."""
        return [ball for ball in (self.ahead, self.behind) if ball]
