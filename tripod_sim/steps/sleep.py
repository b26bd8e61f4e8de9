"""Sleep: bodies at rest are not solved for, until something changes.

At rest is what, over two windows of time one after the other,

1. is slow: its root mean square speed, sqrt(2 T / m), stays below a bound;
2. goes nowhere: its mean shape in the second window is that in the first, but for a quarter of what the bound allows;
3. does not fall: its potential energy V sets no more energy free than there is kinetic energy, least V of one window
   against least V of the other. What creeps down slowly, because drag, friction or dampers take the energy at once,
   sets free much more than it has: m g v t against m v² / 2;
4. does not grow faster: what begins to fall from where it was balanced.

So what only trembles, because contacts come and go without end, is put to sleep, and what falls is not, however slowly.
A sleeping body has no velocity: all that is taken from it is kinetic energy below the bound.

Each body has to be at rest by itself, so that a heavy one that lies does not outweigh a light one that rolls; they fall
asleep and wake together. A rigid body is the four mass points that have its mass, centre and inertia.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.report import WORK, StepReport
from tripod_sim.integrators.stepper import Stepper
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_set import RigidSet

DRIFT = 0.25
"""Speed at which the mean shape may move, as a share of the bound on the speed."""

GROWTH = 1.1
"""Kinetic energy of the second window over that of the first from which on a body gets faster."""

SMALL, SMALLEST = 0.01, 1e-12
"""Potential energy set free that counts as none, and kinetic energy that does, as shares of that at the bound."""

ROUNDING = 1e-13
"""Of the potential energy, as a share of it."""


class Potentials(Protocol):
    """What has energies."""

    def potentials(self, state: State) -> tuple[float, float]:
        """Return the energy of the body's deformation and the potential of its weight [J]."""


@dataclass(eq=False)
class _Window:
    """What b bodies did for a while: largest T and least V of each [J], sum of the positions [m], steps, time [s]."""

    total: FloatArray
    most: FloatArray
    least: FloatArray
    steps: int = 0
    time: float = 0.0

    def clear(self) -> None:
        self.total[:], self.most[:], self.least[:] = 0.0, 0.0, np.inf
        self.steps, self.time = 0, 0.0


class Sleeping:
    """A time integrator that leaves bodies alone while they are at rest.

    Attributes:
        asleep: Whether it does.
        integrator: The stepper of bodies that are not at rest.
    """

    def __init__(
        self,
        stepper: Stepper,
        system: Potentials,
        mass: FloatArray,
        *,
        speed: float,
        time: float,
        rigid: "RigidSet | None" = None,
    ) -> None:
        """Prepare.

        Args:
            stepper: The time integrator.
            system: The soft body's energies.
            mass: Of its nodes [kg], shape (n,); empty where there is no soft body.
            speed: Root mean square speed below which a body can be at rest [m/s].
            time: Length of each of the two windows [s].
            rigid: The rigid bodies.
        """
        self.asleep = False
        self.integrator = stepper
        self._system, self._soft, self._rigid = system, mass, rigid
        self._speed, self._time = speed, time
        masses = ([mass] if len(mass) else []) + ([*rigid.point_mass] if rigid else [])
        ends = np.cumsum([len(m) for m in masses])
        self._bodies = [slice(end - len(m), end) for m, end in zip(masses, ends.tolist(), strict=True)]
        self._mass = np.concatenate(masses)
        self._weight = np.array([m.sum() for m in masses])
        self._bound = 0.5 * self._weight * speed**2
        n, b = len(self._mass), len(masses)
        self._now, self._before = (_Window(np.zeros((n, 3)), np.zeros(b), np.zeros(b)) for _ in range(2))
        self._x, self._joints, self._report = np.zeros((n, 3)), np.zeros(0), StepReport()
        self._loads, self._load = getattr(system, "loads", None), np.zeros(0)
        self.wake()

    def forget(self) -> None:
        """Drop what was kept from earlier steps, and wake up."""
        self.wake()
        self.integrator.forget()

    def prepare(self, state: State, dt: float) -> None:
        """Wake up and make the first step from `state` as fast as the others, where the time integrator can."""
        self.wake()
        prepare = getattr(self.integrator, "prepare", None)
        if prepare:
            prepare(state, dt)
        else:
            self.integrator.forget()

    def renew(self, state: State, dt: float) -> None:
        """Do now what the next step would begin with, if it is to be solved for."""
        if not self.asleep and (renew := getattr(self.integrator, "renew", None)):
            renew(state, dt)

    def wake(self) -> None:
        """Solve for the bodies again from the next step on."""
        self.asleep = False
        self._now.clear()
        self._before.clear()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by one step, in place; sleeping bodies only in time. Raises StepError and leaves `state`."""
        if self.asleep:
            if self._unchanged(state, joints):
                state.time += dt
                state.step += 1
                return self._report
            self.wake()
        report = self.integrator.step(state, joints, dt)
        self._look(state, dt)
        if self.asleep:
            for velocities in self._velocities(state):
                velocities[:] = 0.0
            self._x[:], self._joints = self._positions(state), joints.copy()
            self._load = self._loads.force.copy() if self._loads else self._load
            self._report = _without_work(report)
            report.asleep = True
        return report

    def _velocities(self, state: State) -> list[FloatArray]:
        return [state.velocities, state.centre_velocities, state.spins]

    def _positions(self, state: State) -> FloatArray:
        """Return where all mass is [m], shape (n, 3): nodes, then the points of the rigid bodies."""
        if not self._rigid:
            return state.positions
        return np.concatenate([state.positions, self._rigid.points(state.rigid)])

    def _unchanged(self, state: State, joints: FloatArray) -> bool:
        same = np.array_equal(joints, self._joints) and np.array_equal(self._positions(state), self._x)
        same &= self._loads is None or np.array_equal(self._loads.force, self._load)
        return same and not any(velocities.any() for velocities in self._velocities(state))

    def _energies(self, state: State) -> tuple[FloatArray, FloatArray, float]:
        """Return T and V of each body [J], shape (b,), and the size of what V is the sum of."""
        kinetic, potential, size = np.zeros(0), np.zeros(0), 0.0
        if len(self._soft):
            strain, weight = self._system.potentials(state)
            moving = 0.5 * float(self._soft @ np.einsum("ni,ni->n", state.velocities, state.velocities))
            kinetic, potential = np.array([moving]), np.array([strain + weight])
            size = abs(strain) + abs(weight)
        if self._rigid:
            of_rigid, fallen = self._rigid.energies(state.rigid)
            kinetic, potential = np.append(kinetic, of_rigid), np.append(potential, fallen)
            size += float(np.abs(fallen).sum())
        return kinetic, potential, size

    def _look(self, state: State, dt: float) -> None:
        """Note what the step did, and fall asleep at the end of a window of rest."""
        now, before = self._now, self._before
        kinetic, potential, size = self._energies(state)
        if not (kinetic < self._bound).all():
            if now.steps or before.steps:
                self.wake()
            return
        np.maximum(now.most, kinetic, out=now.most)
        np.minimum(now.least, potential, out=now.least)
        now.total += self._positions(state)
        now.steps += 1
        now.time += dt
        if now.time < self._time * (1 - 1e-9):
            return
        self.asleep = before.steps > 0 and self._rests(ROUNDING * size)
        self._now, self._before = before, now
        self._now.clear()

    def _rests(self, rounding: float) -> bool:
        now, before = self._now, self._before
        drift = now.total / now.steps - before.total / before.steps
        spread = self._mass * np.einsum("ni,ni->n", drift, drift)
        moved = np.sqrt(np.array([spread[body].sum() for body in self._bodies]) / self._weight)
        freed = before.least - now.least
        return bool(
            (moved <= DRIFT * self._speed * self._time).all()
            and (freed <= np.maximum(now.most, SMALL * self._bound) + rounding).all()
            and (now.most <= np.maximum(GROWTH * before.most, SMALLEST * self._bound)).all()
        )


def _without_work(report: StepReport) -> StepReport:
    """Return what a sleeping step reports: the forces and gaps of the last one, and no work."""
    none: dict[str, Any] = dict.fromkeys(WORK, 0)
    asleep = replace(report, asleep=True, **none)
    if asleep.contact:
        asleep.contact = replace(asleep.contact, rounds=0, passes=0, met=0)
    return asleep
