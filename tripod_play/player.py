"""What solves a maze: measured positions of the ball in, tilts out. Pure; the caller keeps the period."""

from dataclasses import dataclass, field

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_play.control import ControlSettings, acceleration, given_by, tilt_for
from tripod_play.observer import Observer, ObserverSettings
from tripod_play.plan import PlannerThread
from tripod_sim.maze.grid import MazeGrid


@dataclass(frozen=True)
class PlayerSettings:
    """How a maze is played.

    Attributes:
        control: Of the ball.
        observer: Of the ball.
        clearance: Between the middle of a corridor and the ball's centre at a wall [m].
        smoothing: Time constant with which the tilt follows what control wants [s]: jerks throw the ball.
        tilt_rate: Largest speed of the tilt [rad/s].
        lever: Height of the floor above the point about which the plate seems to tilt [m]: tilting to one side moves
            the floor there, from under the ball.
    """

    control: ControlSettings = field(default_factory=ControlSettings)
    observer: ObserverSettings = field(default_factory=ObserverSettings)
    clearance: float = 0.001
    smoothing: float = 0.04
    tilt_rate: float = 0.8
    lever: float = 0.038


class Player:
    """Leads the ball to the goal: guide, observer and control, once a period.

    Attributes:
        observer: Where it believes the ball to be.
    """

    def __init__(self, grid: MazeGrid, pitch: float, settings: PlayerSettings) -> None:
        """`pitch`: of the cells [m]."""
        self.settings, self._grid, self._pitch = settings, grid, pitch
        self._guide = PlannerThread(grid, pitch)
        self.observer = Observer(settings.observer)
        self._started = False
        self._tilt = np.zeros(2)

    def start(self, position: FloatArray) -> None:
        """Begin again with a ball at rest at `position` [m], shape (2,), in the plate's frame."""
        self.observer.start(position)
        self._started, self._tilt = True, np.zeros(2)

    def update(self, seen: FloatArray | None) -> FloatArray:
        """Return the tilt to ask for in the coming period [rad], shape (2,).

        Args:
            seen: Where the ball was `observer.delay` ago [m], shape (2,), in the plate's frame; None if not seen.

        Raises:
            PlayError: the goal cannot be reached from where the ball is.
        """
        if not self._started and seen is not None:
            self.start(seen)
        o, control = self.observer, self.settings.control
        place = o.position - self._shift(o.tilting)
        here = self._held(place)
        speed = np.where(here == place, o.velocity, 0.0)
        wanted = (
            acceleration(control, self._guide.stretch(here), o.position + here - place, speed) - o.disturbance
        )
        period = self.settings.observer.period
        change = (tilt_for(control, wanted) - self._tilt) * -np.expm1(-period / self.settings.smoothing)
        most = self.settings.tilt_rate * period
        self._tilt = self._tilt + np.clip(change, -most, most)
        o.update(given_by(control, self._tilt), None if seen is None else seen + self._shift(o.tilted))
        return self._tilt.copy()

    def _shift(self, given: FloatArray) -> FloatArray:
        """Return how far the floor has moved under the ball by the tilt that accelerates it by `given` [m/s²].

        A floor that moves by s carries a rolling ball along by 2/7 of it: what remains of the double integrator is the
        ball's position on the floor plus 5/7 s.
        """
        return given * (self.settings.lever / self.settings.control.gravity)

    def _held(self, position: FloatArray) -> FloatArray:
        """Return the position nearest to a predicted one that the walls of its cell allow [m], shape (2,)."""
        cell = self._guide.cell(position)
        r, c = cell
        x, y = self._grid.centre(cell, self._pitch)
        free = self.settings.clearance
        low = [
            x - (free if self._grid.left[r, c] else np.inf),
            y - (free if self._grid.above[r + 1, c] else np.inf),
        ]
        high = [
            x + (free if self._grid.left[r, c + 1] else np.inf),
            y + (free if self._grid.above[r, c] else np.inf),
        ]
        return np.clip(position, low, high)
