"""A rigid ball and its account: what changes each step, and how a plate moves it."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import rotation_vector
from tripod_sim.ball import plate_kernels as k
from tripod_sim.ball.obstacles import Obstacles
from tripod_sim.copying import Copyable
from tripod_sim.tables.maze import Ball


class Place(IntEnum):
    """Where a ball is."""

    PLAYING = k.ON_PLATE
    IN_HOLE = k.IN_HOLE
    LEFT = k.LEFT


PLACES = {
    Place.PLAYING: "in play",
    Place.IN_HOLE: "lost: the ball fell through a hole",
    Place.LEFT: "lost: the ball left the board",
}

ABYSS = 0.5
"""How far a lost ball falls before it is no longer followed [m]."""


@dataclass(eq=False)
class BallState(Copyable):
    """A ball at one instant.

    Attributes:
        numbers: Position [m], velocity [m/s], angular velocity [rad/s] in world, unit quaternion (x, y, z, w): (13,).
        ledger: Sums since the start, see `Account`.
        place: Where it is.
        goal_time: When it first reached the goal [s]; NaN before.
        lost_time: When it was lost [s]; NaN before.
        twist: Velocity [m/s] and angular velocity [rad/s] of the plate at the end of the last step, shape (2, 3).
        wrench: Force [N] of the ball on the robot during the next step and its moment about the effector [N m], (2, 3).
        load_work: Of that force on the robot since the start [J]; with the account's work it would sum to zero if the
            force were not a step late.
    """

    numbers: FloatArray
    ledger: FloatArray = field(default_factory=lambda: np.zeros(8))
    place: Place = Place.PLAYING
    goal_time: float = float("nan")
    lost_time: float = float("nan")
    twist: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    wrench: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    load_work: float = 0.0

    def __post_init__(self) -> None:
        if not self.ledger[k.GAP]:
            self.ledger[k.GAP] = np.inf

    @property
    def position(self) -> FloatArray:
        """Of the centre [m], shape (3,), a view."""
        return self.numbers[:3]

    @property
    def velocity(self) -> FloatArray:
        """[m/s], shape (3,), a view."""
        return self.numbers[3:6]

    @property
    def spin(self) -> FloatArray:
        """Angular velocity [rad/s], shape (3,), a view."""
        return self.numbers[6:9]

    @property
    def quaternion(self) -> FloatArray:
        """(x, y, z, w), shape (4,), a view."""
        return self.numbers[9:]

    @property
    def event(self) -> str:
        """What has become of the ball, in words; empty while nothing has."""
        if self.place is not Place.PLAYING:
            return f"ball {PLACES[self.place]} at {self.lost_time:.2f} s"
        return f"goal reached at {self.goal_time:.2f} s" if np.isfinite(self.goal_time) else ""

    def copy_to(self, other: "BallState") -> None:
        """As `State.copy_to`."""
        other.numbers[:], other.ledger[:], other.twist[:] = self.numbers, self.ledger, self.twist
        other.wrench[:], other.load_work = self.wrench, self.load_work
        other.place, other.goal_time, other.lost_time = self.place, self.goal_time, self.lost_time


@dataclass(frozen=True)
class Account:
    """Where the energy of a ball came from and went since the start: E - E_0 = work - loss + gain + shift [J].

    Attributes:
        work: Of the plate on the ball.
        loss: Friction, rolling resistance and impacts.
        gain: What contacts have added: rounding, and what a sub-step makes of forces that change within it.
        shift: Weight times the corrections that keep the ball on the surfaces that it touches.
        gap: Smallest gap between the ball and anything so far [m].
        impacts: Contacts that closed faster than they hold.
        stuck: Sub-steps that ended early because the ball touched too often in them.
        hardest: Normal speed of the hardest impact [m/s].
    """

    work: float
    loss: float
    gain: float
    shift: float
    gap: float
    impacts: int
    stuck: int
    hardest: float


@dataclass(eq=False)
class PlateMotion:
    """Where a plate goes in a step.

    Attributes:
        centre: At the start and at the end [m], shape (2, 3).
        rotation: At the start and at the end, matrices, shape (2, 3, 3).
        twist: Velocity [m/s] and angular velocity [rad/s] at the end, shape (2, 3).
    """

    centre: FloatArray
    rotation: FloatArray
    twist: FloatArray


class BallOnPlate:
    """Moves a ball on a plate; owns the scratch arrays of its kernel.

    Attributes:
        description: Numbers of the ball.
        obstacles: What stands on the plate.
        reaction: Impulses of the ball on the plate in the last step [N s], their moment about the plate's centre
            [N m s], and what of them is along the normals [N s], shape (3, 3).
    """

    def __init__(self, description: Ball, obstacles: Obstacles, gravity: FloatArray) -> None:
        """`gravity`: [m/s²], shape (3,)."""
        d = self.description = description
        self.obstacles = obstacles
        self._numbers = np.array(
            [d.mass, d.radius, d.friction, d.restitution, d.rest_speed, d.rolling, d.substep, *gravity]
        )
        self._gravity = np.array(gravity, dtype=float)
        self._rows, self._cells = k.workspace()
        self._plate = np.zeros((10, 3))
        self.reaction = np.zeros((3, 3))

    def advance(self, state: BallState, motion: PlateMotion, time: float, dt: float) -> None:
        """Advance `state` by `dt` [s] from `time` [s] while the plate moves as `motion` says, in place."""
        self.reaction[:] = 0.0
        if state.place is Place.PLAYING:
            plate = self._plate
            plate[0], plate[1] = motion.centre[0], motion.centre[1] - motion.centre[0]
            plate[2] = rotation_vector(motion.rotation[1] @ motion.rotation[0].T)
            plate[3], plate[5] = state.twist
            plate[4], plate[6] = motion.twist
            plate[7:] = motion.rotation[0]
            place = k.advance(
                state.numbers, plate, dt, self._numbers, self.obstacles, state.ledger, self.reaction, self._rows,
                self._cells,
            )  # fmt: skip
            if place != Place.PLAYING:
                state.place, state.lost_time = Place(place), time + dt
        elif state.position[2] > motion.centre[1, 2] - ABYSS:
            k.fall(state.numbers, dt, self._gravity)
        state.twist[:] = motion.twist

    def energy(self, state: BallState) -> float:
        """Return kinetic and potential energy of the ball [J], the latter zero at the origin."""
        d, v, w = self.description, state.velocity, state.spin
        kinetic = 0.5 * d.mass * float(v @ v) + 0.2 * d.mass * d.radius**2 * float(w @ w)
        return kinetic - d.mass * float(self._gravity @ state.position)


def account(state: BallState) -> Account:
    """Return the ledger of a ball by name."""
    work, loss, gain, shift, gap, impacts, stuck, hardest = state.ledger.tolist()
    return Account(work, loss, gain, shift, gap, int(impacts), int(stuck), hardest)
