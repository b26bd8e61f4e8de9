"""The target that the demo asks of the effector: a horizontal circle and a slower rise and fall. Pure."""

import math
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class DemoTarget:
    """A circle about a centre, entered and left without a jerk.

    With s the smooth step from 0 to 1 over `blend`, and s = 1 after,

        target(t) = centre + s(t) (R cos a, R sin a, L + H sin b),
        a = 2 pi t / period,  b = 2 pi t / height_period.

    It starts at the centre at rest: s, ds/dt and d²s/dt² vanish at t = 0.

    Attributes:
        centre: Effector position at t = 0 [m].
        radius: R [m].
        period: Of the circle [s].
        lift: L [m]. Below the working pose there is little room: at 10 mm to the side and 2 mm down a servo
            reaches its smallest angle.
        height: H, amplitude of the rise and fall [m].
        height_period: Of the rise and fall [s].
        blend: Time to reach the circle [s].
    """

    centre: tuple[float, float, float]
    radius: float = 0.010
    period: float = 10.0
    lift: float = 0.002
    height: float = 0.003
    height_period: float = 12.0
    blend: float = 3.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not np.isfinite(getattr(self, field.name)).all():
                raise ValueError(f"{field.name} is {getattr(self, field.name)}; it must be finite")
        for name in ("period", "height_period", "blend"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)} s; it must be positive")

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return the target [m] at `t` seconds after the start; before it, the centre."""
        t = max(t, 0.0)
        circle, rise = math.tau * t / self.period, math.tau * t / self.height_period
        (x, y, z), s = self.centre, smooth_step(t / self.blend)
        height = self.lift + self.height * math.sin(rise)
        return x + s * self.radius * math.cos(circle), y + s * self.radius * math.sin(circle), z + s * height

    @property
    def speed_bound(self) -> float:
        """A speed [m/s] that the target never exceeds."""
        circle = 2 * np.pi * self.radius / self.period
        rise = 2 * np.pi * self.height / self.height_period
        return float(
            np.hypot(circle, rise) + 1.875 / self.blend * np.hypot(self.radius, abs(self.lift) + self.height)
        )


def smooth_step(u: float) -> float:
    """Return 6u⁵ - 15u⁴ + 10u³ for u within 0 to 1, and 0 or 1 outside; its largest slope is 1.875."""
    u = min(max(u, 0.0), 1.0)
    return u * u * u * (u * (6 * u - 15) + 10)
