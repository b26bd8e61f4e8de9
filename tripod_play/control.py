"""The acceleration that brings the ball along a stretch, and the tilt that gives it.

Across the stretch a spring and a damper pull the ball to its middle; along it the ball is brought to the speed from
which it can still stop at the end. A ball that is far off the middle, as after a corner, first goes there.
"""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError
from tripod_play.plan import Stretch

ROLLING = 5 / 7
"""Acceleration of a ball that rolls without slipping, over g sin(tilt)."""


@dataclass(frozen=True)
class ControlSettings:
    """How the ball is led.

    Attributes:
        speed: Of the ball along a stretch [m/s].
        corner_speed: With which it may arrive at the end of one [m/s].
        hole_speed: Of the ball along a stretch by a hole [m/s]; it stops at the end of one.
        brake: Deceleration that is counted on [m/s²].
        stiffness: k of the pull to the middle, and to the end [1/s²].
        damping: c of it [1/s].
        pace: How fast the speed along a stretch is corrected [1/s].
        aside: Distance from the middle at which the ball is no longer driven along [m].
        tilt_max: Largest tilt about each axis [rad].
        gravity: [m/s²].
    """

    speed: float = 0.05
    corner_speed: float = 0.015
    hole_speed: float = 0.025
    brake: float = 0.1
    stiffness: float = 12.0
    damping: float = 5.0
    pace: float = 3.0
    aside: float = 0.0012
    tilt_max: float = 0.06
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for name in (
            "speed",
            "hole_speed",
            "brake",
            "stiffness",
            "damping",
            "pace",
            "aside",
            "tilt_max",
            "gravity",
        ):
            if not 0 < getattr(self, name) < np.inf:
                raise PlayError(f"control {name} is {getattr(self, name)}; it must be above 0")
        if not 0 <= self.corner_speed <= self.speed:
            raise PlayError(
                f"control corner_speed is {self.corner_speed} m/s; allowed: 0 to speed, {self.speed} m/s"
            )


def acceleration(
    settings: ControlSettings, stretch: Stretch, position: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return the acceleration to ask for [m/s²], shape (2,), of a ball at `position` [m] with `velocity` [m/s]."""
    s, d = settings, stretch.direction
    if not d.any():
        return s.stiffness * (stretch.end - position) - s.damping * velocity
    side = np.array([-d[1], d[0]])
    off, aside_speed = float(side @ (position - stretch.begin)), float(side @ velocity)
    left, speed = float(d @ (stretch.end - position)), float(d @ velocity)
    across = -s.stiffness * off - s.damping * aside_speed
    if abs(off) > s.aside:
        along = s.stiffness * float(d @ (stretch.begin - position)) - s.damping * speed
    elif left < 0:
        along = s.stiffness * left - s.damping * speed
    else:
        final = 0.0 if stretch.last or stretch.by_hole else s.corner_speed
        top = s.hole_speed if stretch.by_hole else s.speed
        wanted = min(top, np.sqrt(final**2 + 2 * s.brake * left))
        along = s.pace * (wanted - speed)
    return np.asarray(across * side + along * d)


def tilt_for(settings: ControlSettings, wanted: FloatArray) -> FloatArray:
    """Return the tilt about x and y [rad], shape (2,), that accelerates a rolling ball by `wanted` [m/s²], shape (2,).

    a_x = 5/7 g sin(tilt_y), a_y = -5/7 g sin(tilt_x); too much is cut off at `tilt_max`, direction kept.
    """
    sines = np.array([-wanted[1], wanted[0]]) / (ROLLING * settings.gravity)
    limit = np.sin(settings.tilt_max)
    return np.asarray(np.arcsin(sines / max(1.0, float(np.abs(sines).max()) / limit)))


def given_by(settings: ControlSettings, tilt: FloatArray) -> FloatArray:
    """Return the acceleration [m/s²], shape (2,), that a tilt [rad] gives: the inverse of `tilt_for`."""
    sines = np.sin(tilt) * ROLLING * settings.gravity
    return np.array([sines[1], -sines[0]])
