"""Explicit schemes for solids with lumped masses.

    explicit Euler        x' = x + h v,   v' = v + h a      unstable: undamped modes grow by w² h² / 2 a step
    semi-implicit Euler   v' = v + h a,   x' = x + h v'     first order, keeps the energy of long motions
    RK4                   the classical scheme, fourth order, for reference

with a = M^-1 f(x, v), f = -dE/dx + weight - (a M + b K) v, K the tangent at the start of the step, and a = v = 0 of
fixed nodes [HairerLubichWanner2006]. Incompatible modes, which have no mass, follow the nodes in equilibrium.
"""

import math

import numpy as np
from numpy.typing import NDArray

from tripod_sim.errors import StepError
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.integrators.stability import largest_eigenvalue, longest_part, longest_step
from tripod_sim.integrators.substeps import StepReport
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

FIRST, LATER = 500, 10
"""Products of the power iteration at the first step and at those after, which begin where the last one ended."""

MARGIN = 1.05
"""The largest frequency is that much above its estimate, which comes from below and belongs to the step's start."""

MOST_PARTS = 1_000_000
"""Of one step."""

MODES = 1e-9
"""Unbalanced force of incompatible modes, as a share of the nodes', at which they are in equilibrium."""


class ExplicitSolid:
    """Advances a solid by one of three schemes."""

    def __init__(
        self, system: System, mass: FloatArray, scheme: str, *, drag: float, rayleigh: float, divide: bool
    ) -> None:
        """Prepare.

        Args:
            system: Without inertia and damping of its own, rigid bodies or driven frames.
            mass: Of nodes [kg], shape (n,), positive.
            scheme: `semi_implicit_euler`, `explicit_euler` or `rk4`.
            drag: a of the force -a M v [1/s].
            rayleigh: b of the force -b K v [s].
            divide: Whether a step is divided into stable parts; if not, instability shows.
        """
        self._system, self._scheme, self._divide = system, scheme, divide
        self._drag, self._rayleigh = drag, rayleigh
        self._mass = mass
        self._inverse = 1.0 / mass[:, None]
        self._inverse[system.groups.fixed] = 0.0
        n = len(mass)
        self._all = np.arange(len(system.solid.elements))
        self._still = np.zeros((n, 3))
        self._a, self._dx, self._dv, self._drag_force = np.zeros((4, n, 3))
        self._vector: FloatArray | None = None
        self._stage: State | None = None
        self._keep: State | None = None
        self._start_energy: float | None = None
        self._largest = self._grew = 0.0

    def forget(self) -> None:
        """Measure growth and frequency anew from the next step on."""
        self._vector = self._start_energy = None

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s], in place.

        Raises:
            StepError: an element turned inside out or a number overflowed; `state` is unchanged.
        """
        if self._keep is None or self._stage is None:
            self._keep, self._stage = state.copy(), state.copy()
        if self._start_energy is None:
            start, live = self._energy(state)
            self._start_energy, self._largest, self._grew = start, live, 0.0
        state.copy_to(self._keep)
        limit, part = self._limits(state)
        parts = max(1, math.ceil(dt / part)) if self._divide and part < np.inf else 1
        try:
            if parts > MOST_PARTS:
                raise FloatingPointError(f"it would take {parts} parts of {part:.2g} s")
            for _ in range(parts):
                self._advance(state, self._stage, dt / parts)
            total, live = self._energy(state)
            if not math.isfinite(total):
                raise FloatingPointError(self._culprit(state))
        except FloatingPointError as error:
            self._keep.copy_to(state)
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s fails: {error}; the explicit scheme's limit is "
                f"{limit:.3g} s, dt {dt:g} s; substeps = 'auto' divides the step, an implicit scheme needs no limit"
            ) from None
        state.time += dt
        state.step += 1
        self._largest = max(self._largest, live)
        growth = total - self._start_energy
        fall = 0.0
        if self._system.gravity:
            fall = float((self._inverse * self._system.gravity.force**2).sum()) * dt**2
        if self._grew or growth > 0.5 * self._largest + 2 * fall:
            self._grew = self._grew or state.step
        return StepReport(
            parts=parts, dt_limit=limit, growth=growth if self._grew else 0.0, grew_at=int(self._grew)
        )

    def _limits(self, state: State) -> tuple[float, float]:
        """Assemble at `state`; return the stability limit and the length of a part [s]."""
        system = self._system
        if system.assemble(state, project=False) >= 0:
            system.assemble(state, project=True)
        root = np.sqrt(self._inverse)
        out = np.zeros_like(self._a)

        def product(p: FloatArray) -> FloatArray:
            out[:] = 0.0
            add_element_products(system.solid.matrices, system.solid.elements, self._all, root * p, 1.0, out)
            return root * out

        first = self._vector is None
        start = np.random.default_rng(0).standard_normal(out.shape) if self._vector is None else self._vector
        value, self._vector = largest_eigenvalue(product, start, FIRST if first else LATER)
        square = max(0.0, value) * MARGIN**2
        rate = self._drag + self._rayleigh * square
        omega = math.sqrt(square)
        return longest_step(self._scheme, omega, rate), longest_part(self._scheme, omega, rate)

    def _accelerations(self, state: State) -> None:
        """Write M^-1 f at `state`, its modes in equilibrium. Raises FloatingPointError where there is no force."""
        system, solid = self._system, self._system.solid
        phi = system.evaluate(state)
        for _ in range(30):
            g = system.gradient
            if not math.isfinite(phi) or solid.mode_residual_squared <= MODES**2 * float(np.vdot(g, g)):
                break
            solid.advance_modes(state.modes, self._still, 1.0, state.modes)
            phi = system.evaluate(state)
        if not math.isfinite(phi):
            raise FloatingPointError(self._culprit(state))
        np.multiply(system.gradient, -self._inverse, out=self._a)
        if self._rayleigh > 0.0:
            self._drag_force[:] = 0.0
            add_element_products(
                solid.matrices, solid.elements, self._all, state.velocities, self._rayleigh, self._drag_force
            )
            self._a -= self._inverse * self._drag_force
        if self._drag > 0.0:
            self._a -= self._drag * state.velocities

    def _advance(self, state: State, stage: State, h: float) -> None:
        x, v = state.positions, state.velocities
        self._accelerations(state)
        if self._scheme == "semi_implicit_euler":
            v += h * self._a
            x += h * v
            return
        if self._scheme == "explicit_euler":
            x += h * v
            v += h * self._a
            return
        self._dx[:], self._dv[:] = v, self._a
        stage.modes[:] = state.modes
        stage.positions[:], stage.velocities[:] = x + 0.5 * h * v, v + 0.5 * h * self._a
        for weight, reach in ((2.0, 0.5 * h), (2.0, h), (1.0, 0.0)):
            self._accelerations(stage)
            self._dx += weight * stage.velocities
            self._dv += weight * self._a
            stage.positions[:] = x + reach * stage.velocities
            stage.velocities[:] = v + reach * self._a
        state.modes[:] = stage.modes
        x += h / 6 * self._dx
        v += h / 6 * self._dv

    def _energy(self, state: State) -> tuple[float, float]:
        """Return the whole energy and that of motion and strain [J]."""
        kinetic = 0.5 * float(self._mass @ (state.velocities**2).sum(axis=1))
        strain, gravity = self._system.potentials(state)
        return kinetic + strain + gravity, kinetic + strain

    def _culprit(self, state: State) -> str:
        if not np.isfinite(state.positions).all():
            return "a number is not finite"
        element, ratio = self._system.solid.worst_element(state.positions, state.modes)
        return f"element {element} is turned inside out or crushed (volume ratio {ratio:.3g})"
