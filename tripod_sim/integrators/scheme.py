"""Time integrators as objects: an implicit scheme is a list of stages, an explicit one a compiled loop.

With dx, dv what the stage before changed x and v by, and its end at the acceleration A = M^-1 f and the curvature b
(an acceleration that a scheme may carry besides A), an implicit stage leads from x, v to

    x' = z + s v',                  z = x + c_x dx + r_x v + k_x b,
    v' = u + s_f M^-1 f(x', v'),    u = v + c_v dv + r_v A + k_v b,

so that x' minimises |x' - z - s u|²_M / (2 s s_f) and the other potentials (see `stage`). The `Weights` are c, r and k.
Most schemes have s_f = s, no b, and the same weights for positions and velocities.

A scheme is a module of `integrators.schemes`; docs/architecture.md says how to add one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray


class Weights(NamedTuple):
    """Of what a stage starts from: known = now + change * dq + rate * dq/dt + curve * b.

    Attributes:
        change: Of what the last stage changed the quantity by.
        rate: Of the rate at which it ended [s].
        curve: Of the curvature b [s] of velocities, [s²] of positions.
    """

    change: float = 0.0
    rate: float = 0.0
    curve: float = 0.0


NOTHING = Weights()


class Curve(NamedTuple):
    """How a stage makes the new b: change * dq + rate * (new rate) + before * (old rate) + curve * (old b).

    Positions of velocities have the b of these.
    """

    change: float = 0.0
    rate: float = 0.0
    before: float = 0.0
    curve: float = 0.0


class Defect(NamedTuple):
    """What the exact motion lacks in the equations of a stage: tau_x = x d^n a/dt^n, tau_v = v d^(n+1) a/dt^(n+1).

    Attributes:
        derivative: n, of the acceleration a: 0 of a first-order scheme, 1 of a second-order one.
        x, v: Factors, [s^(n + 2)].
        curve: That in the equation of b of velocities: curve d^(n+1) a/dt^(n+1) [s^(n + 1)].
    """

    derivative: int
    x: float
    v: float
    curve: float = 0.0


@dataclass(frozen=True)
class Stage:
    """One stage of an implicit scheme.

    Attributes:
        length: Time that it takes [s].
        s: Of the velocity [s].
        position, velocity: Weights of what it starts from.
        force: s_f, of the force [s]; 0 stands for s.
        defect: None where it is not known: the stage is then never asked for an error estimate.
        curves: How b of positions and of velocities is made; None where the scheme has none.
        lag: Time, over the length of a step, by which b is taken after A.
    """

    length: float
    s: float
    position: Weights = NOTHING
    velocity: Weights = NOTHING
    force: float = 0.0
    defect: Defect | None = None
    curves: tuple[Curve, Curve] | None = None
    lag: float = 0.0

    @cached_property
    def begins(self) -> bool:
        """Whether it uses nothing of the stage before."""
        return self.position == self.velocity == NOTHING

    @cached_property
    def s_force(self) -> float:
        """s_f [s]."""
        return self.force or self.s

    @cached_property
    def square(self) -> float:
        """s s_f [s²]: the stage's inertia is M / (s s_f)."""
        return self.s * self.s_force

    @cached_property
    def key(self) -> float:
        """Which factorisations serve the stage: those of stages of the same key [s]."""
        return self.s if self.s_force == self.s else float(np.sqrt(self.square))


def euler_stage(h: float, curves: tuple[Curve, Curve] | None = None) -> Stage:
    """Return the one stage of a step of implicit Euler of `h` [s]."""
    factor = -(h**2) / 2
    return Stage(h, h, defect=Defect(0, factor, factor), curves=curves)


def total_defect(stages: Sequence[Stage]) -> Defect:
    """Return what the stages of a step add to an error, as of one stage."""
    n, x, v = 0, 0.0, 0.0
    for stage in stages:
        assert stage.defect
        n = stage.defect.derivative
        x = (1 + stage.position.change) * x + stage.defect.x
        v = (1 + stage.velocity.change) * v + stage.defect.v
    return Defect(n, x, v)


@dataclass(frozen=True)
class Scheme:
    """A time integrator.

    Attributes:
        name: That users type, of its module.
        order: Power of the time step with which its error falls.
        parameters: Fields of [inertia] that it takes, each a field of the scheme, too.
        explicit: Whether its steps solve no equations.
        is_automatic: Whether `dt = "auto"` is to choose schemes along with the steps.
        takes_jumps: Whether it gains no energy where a stiff force comes and goes, as that of a cable.
    """

    name: str
    order: int
    parameters: ClassVar[tuple[str, ...]] = ()
    explicit: ClassVar[bool] = False
    is_automatic: ClassVar[bool] = False
    takes_jumps: ClassVar[bool] = True

    @property
    def is_multistep(self) -> bool:
        """Whether a step uses the one before it."""
        return False

    @property
    def has_error_estimate(self) -> bool:
        """Whether the error of its steps is carried along by `time_error.ErrorTransport`."""
        return False

    @property
    def has_one_length(self) -> bool:
        """Whether s_f = s in all stages, as compiled loops take it."""
        return True

    @property
    def over_difference(self) -> float:
        """Defect of the velocity over h³ / 4 times the third difference quotient, of which `way_steps` makes it."""
        return 1.0


@dataclass(frozen=True)
class ImplicitScheme(Scheme):
    """An implicit scheme. A multistep one starts, and restarts after a jump of the velocity, by implicit Euler.

    Attributes:
        pair: Schemes of first and of second order that steps of a chosen length take, whichever gets further; None:
            they take this one.
    """

    pair: "ClassVar[tuple[ImplicitScheme, ImplicitScheme] | None]" = None

    @property
    def has_error_estimate(self) -> bool:
        """See `Scheme`: where the stages' defects are known."""
        return all(stage.defect for stage in self.stages(1.0, 1.0))

    @property
    def has_one_length(self) -> bool:
        """See `Scheme`."""
        return all(stage.s_force == stage.s for stage in self.stages(1.0, 1.0))

    def start(self, h: float) -> Stage:
        """Return the stage of a step of `h` [s] that uses nothing of earlier ones."""
        return euler_stage(h)

    def stages(self, h: float, before: float) -> tuple[Stage, ...]:
        """Return the stages of a step of `h` [s] after one of `before` [s]; 0: after a start or a jump."""
        return (self.start(h),)

    def defect(self, h: float) -> Defect:
        """Return what a step of `h` [s] after one of the same length adds to an error, as of one stage."""
        return total_defect(self.stages(h, h))


@dataclass(frozen=True)
class MultistepScheme(ImplicitScheme):
    """An implicit scheme whose steps use the one before."""

    @property
    def is_multistep(self) -> bool:
        """See `Scheme`."""
        return True

    def stages(self, h: float, before: float) -> tuple[Stage, ...]:
        """See `ImplicitScheme`."""
        return self.following(h, before) if before else (self.start(h),)

    def following(self, h: float, before: float) -> tuple[Stage, ...]:
        """Return the stages of a step of `h` [s] after one of `before` [s], above 0."""
        raise NotImplementedError


class Tableau(NamedTuple):
    """An explicit scheme as compiled loops take it: see `ExplicitScheme`.

    Attributes:
        reach: Shape (s,).
        weights: Shape (s,), and their sum `total`.
        swaps: Whether positions move with the new velocity.
    """

    reach: FloatArray
    weights: FloatArray
    total: float
    swaps: bool


@dataclass(frozen=True)
class ExplicitScheme(Scheme):
    """An explicit Runge-Kutta scheme of s stages, of which each uses the rates of the one before alone.

        y_1 = y,   y_(i+1) = y + c_i h f(y_i),   y' = y + h sum of b_i f(y_i),   y = (x, v),

    advanced by compiled loops (see `explicit_kernels`). With one stage, positions may move with the new velocity
    (symplectic Euler): x' = x + h v'.

    Attributes:
        weights: b_i times a number that makes them whole, shape (s,).
        reach: c_1 ... c_(s-1).
        swaps: Whether positions move with the new velocity.
    """

    explicit: ClassVar[bool] = True
    weights: tuple[float, ...] = (1.0,)
    reach: tuple[float, ...] = ()
    swaps: bool = False

    @property
    def forces(self) -> int:
        """Evaluations of the force in a step."""
        return len(self.weights)

    @property
    def tableau(self) -> Tableau:
        """The scheme as compiled loops take it."""
        return Tableau(
            np.array([*self.reach, 1.0]), np.array(self.weights), float(sum(self.weights)), self.swaps
        )

    @property
    def is_stable(self) -> bool:
        """Whether there is a step at which no mode grows without damping."""
        return self.longest_step(1.0, 0.0) > 0.0

    def longest_step(self, omega: float, rate: float) -> float:
        """Return the longest stable step [s] for modes x'' = -w² x - d x'; infinite where there is no force.

        Args:
            omega: Largest w [rad/s].
            rate: Largest d [1/s].
        """
        if omega == 0.0:
            return 2.0 / rate if rate > 0.0 else np.inf
        return self.limit(omega, rate)

    def limit(self, omega: float, rate: float) -> float:
        """Return `longest_step` [s] for w > 0."""
        raise NotImplementedError

    def divisor(self, omega: float, rate: float) -> float:
        """Return the length [s] of which substeps are a share, from `longest_step`'s arguments."""
        return self.longest_step(omega, rate)
