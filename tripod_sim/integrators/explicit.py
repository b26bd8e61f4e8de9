"""Explicit schemes for solids and springs with lumped masses, whatever holds them.

    explicit Euler        x' = x + h v,   v' = v + h a      unstable: undamped modes grow by w² h² / 2 a step
    semi-implicit Euler   v' = v + h a,   x' = x + h v'     first order, keeps the energy of long motions
    RK4                   the classical scheme, fourth order, for reference

with a = M^-1 f(x, v), f = -dE/dx + weight - a M v and the force of dampers (see `damper_kernels`, `springs.body`)
[HairerLubichWanner2006]; incompatible modes, which have no mass, follow the nodes in equilibrium with dE/dx.

Constraints are exact, as for the implicit schemes:

- A rigid body moves by its momentum and its angular momentum about the mass centre, p' = sum_i f_i and
  S' = sum_i (x_i - C) x f_i (see `rigid_kernels`).
- Driven nodes are, at each instant, where the joints put them, which move evenly from the start of a step to its end;
  they have the velocity of that motion. Ghosts of a compliant clamp are driven, so their lack of mass does not matter.
- What is held along axes of its own or prescribed moves evenly over a step, too, to where its timeline has it.
- The torque of a servo is what holds its frame at the end of the step against all forces on it, and what changed its
  speed from that of the step before, I (w - w_before) / dt: in all steps together the whole angular impulse.
"""

import math
from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.constraints.rigid_kernels import Bodies
from tripod_sim.errors import SceneError, StepError
from tripod_sim.forces.solid_arrays import no_solid
from tripod_sim.forces.spring_kernels import nets_of
from tripod_sim.forces.term import ForceTerm, LinearTerm, Term
from tripod_sim.integrators import explicit_kernels as kernels
from tripod_sim.integrators.force_kernels import ForceScratch, Load, MovingSolid, Solids
from tripod_sim.integrators.frequency import LargestFrequency
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.schemes import IMPLICIT
from tripod_sim.integrators.stability import longest_part, remedy
from tripod_sim.state import State
from tripod_sim.system import System

MARGIN = 1.05
"""The largest frequency is that much above its estimate, which comes from below and belongs to the step's start."""

RUN = 100
"""Parts after which tangent, condensation of the modes and limit are renewed; earlier where the modes ask for it."""

MOST_PARTS = 100_000
"""Of one step."""

THIN = 1e-9
"""Smallest principal moment of inertia of a rigid body, as a share of its largest."""


class ExplicitSteps:
    """Advances all terms of a system by one of three schemes.

    Attributes:
        finer: Times as many parts as are needed that a step is divided into.
    """

    def __init__(
        self, system: System, mass: FloatArray, scheme: ExplicitScheme, *, drag: float, divide: bool
    ) -> None:
        """Prepare.

        Args:
            system: Without inertia and damping of its own.
            mass: Of nodes [kg], shape (n,); positive of free nodes.
            scheme: Which.
            drag: a of the force -a M v [1/s].
            divide: Whether a step is divided into stable parts; if not, instability shows.

        Raises:
            SceneError: the masses of a rigid body lie in a line, or there is a term that no explicit scheme can take.
        """
        self._system, self._scheme, self._divide, self._mass = system, scheme, divide, mass
        self._drag, self._tableau = drag, scheme.tableau
        self._frequency = LargestFrequency(system, mass, self._add_stiffness)
        self._take(system.terms)
        damped = any(t.remembers for t in system.elastic.terms)
        self._damping = LargestFrequency(system, mass, self._add_damping) if damped else None
        elastic = system.elastic.terms
        self._solids = [(k, term.solid) for k, term in enumerate(elastic) if term.solid]
        self._nets = nets_of([term.links for term in elastic if term.links])
        self._at: State | None = None  # where `_add_damping` takes the matrix of dampers
        self._bodies, self._offset = _bodies(system, mass)
        self._frames = _frames(system)
        self._load = self._make_load()
        n, s, b = len(mass), len(system.groups.driven), len(system.groups.rigid)
        self._scratch = ForceScratch._make([*np.zeros((5, n, 3)), np.zeros(1)])
        turns = [np.zeros((b, 3)), np.zeros((b, 3, 3)), *np.zeros((3, b, 3)), np.zeros((4, b, 3))]
        self._begin = kernels.Start._make([*np.zeros((4, n, 3)), *turns])
        self._jerked, self._reduced = np.zeros(s), np.zeros(system.unknowns)
        self._moving = np.where(
            system.groups.held(), 0.0, mass[:, None]
        )  # of nodes whose motion is not prescribed
        self._fall = 0.0
        for term in self._forces:
            if not term.works:
                square = (term.force**2).sum(axis=1)
                self._fall += float(np.divide(square, mass, out=np.zeros(n), where=mass > 0).sum())
        self._keep: State | None = None
        self._start_energy: float | None = None
        self._given = self._largest = 0.0
        self._limit = np.inf
        self._grew, self.finer = 0, 1

    def _take(self, terms: Sequence[Term]) -> None:
        """Sort the terms by what compiled loops do with them. Raises SceneError for one that they cannot take."""
        self._forces, linear = list[ForceTerm](), list[LinearTerm]()
        for term in terms:
            if isinstance(term, ForceTerm):
                self._forces.append(term)
            elif isinstance(term, LinearTerm) and not linear:
                linear.append(term)
            else:
                raise SceneError(
                    f"inertia.scheme is {self._scheme.name!r}, which cannot compute {term.name}; choose one of: "
                    f"{', '.join(IMPLICIT)}"
                )
        self._bed = next(iter(linear), None)
        if unknown := [type(t).__name__ for t in self._system.elastic.terms if not (t.solid or t.links)]:
            raise SceneError(f"inertia.scheme is {self._scheme.name!r}, which cannot compute {unknown[0]}")

    def _make_load(self) -> Load:
        system, mass = self._system, self._mass
        n, bed = len(mass), self._bed
        free = system.reduction.kind == Kind.FREE
        inverse = np.divide(1.0, mass, out=np.zeros(n), where=free & (mass > 0))
        none, indices = np.zeros((0, 1, 1)), np.zeros((0, 2), dtype=np.int64)
        return Load(
            np.zeros((n, 3)), mass, inverse, self._drag,
            bed.couplings if bed else none, bed.elements if bed else indices, 0.0,
        )  # fmt: skip

    def take_forces(self, term: ForceTerm) -> None:
        """Add forces, which may change from step to step."""
        self._forces.append(term)

    def forget(self) -> None:
        """Measure growth and frequency again from the next step on."""
        self._start_energy = None
        self._frequency.forget()
        if self._damping:
            self._damping.forget()

    def take(self, work: float) -> None:
        """Count `work` [J] that something else than this has done to the bodies since the last step."""
        self._given += work

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: an element turned inside out or a number overflowed; `state` is unchanged.
        """
        if self._keep is None:
            self._keep = state.copy()
        if self._start_energy is None:
            self._start_energy, self._largest = self._energy(state, self._system.potentials(state)[0])
            self._given, self._grew = 0.0, 0
        state.copy_to(self._keep)
        self._limit = np.inf
        try:
            parts, strain = self._advance(state, joints, dt)
        except FloatingPointError as error:
            self._keep.copy_to(state)
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s fails: {error}; the explicit scheme's limit is "
                f"{self._limit:.3g} s, dt {dt:g} s; {remedy(self._limit, divides=self._divide)}"
            ) from None
        state.time += dt
        state.step += 1
        total, live = self._energy(state, strain)
        self._largest = max(self._largest, live)
        growth = total - self._start_energy - self._given
        beyond = growth > 0.5 * self._largest + 2 * self._fall * dt**2
        if self._grew or (beyond and growth > self._rounding(state)):
            self._grew = self._grew or state.step
        return StepReport(
            parts=parts, dt_limit=self._limit, growth=growth if self._grew else 0.0, grew_at=self._grew
        )

    def _longest_part(self, state: State) -> float:
        """Assemble at `state`; note the stability limit, return the length of a part [s]."""
        system = self._system
        if system.assemble(state, project=False) >= 0:
            system.assemble(state, project=True)
        system.elastic.limit()
        square = self._frequency.largest(state) * MARGIN**2
        rate = self._drag
        if self._damping:
            self._at = state
            rate += self._damping.largest(state) * MARGIN**2
        omega = math.sqrt(square)
        self._limit = min(self._limit, self._scheme.longest_step(omega, rate))
        return longest_part(self._scheme, omega, rate) if self._divide else np.inf

    def _add_stiffness(self, dx: FloatArray, out: FloatArray) -> None:
        """Add K dx to `out` [N], K that of all terms."""
        system = self._system
        system.elastic.add_products(system.elastic.matrices, dx, 1.0, out)
        if self._bed:
            self._bed.add_products(dx, out)

    def _add_damping(self, v: FloatArray, out: FloatArray) -> None:
        """Add C v to `out` [N], C a bound of the matrix of all dampers."""
        assert self._at
        self._system.elastic.add_damping_bound(self._at.positions, self._at.modes, v, out)

    def _advance(self, state: State, joints: FloatArray, dt: float) -> tuple[int, float]:
        """Move `state`, write torques and work; return parts and strain energy [J], or raise FloatingPointError."""
        system, scheme = self._system, self._tableau
        bodies, frames, scratch = self._bodies, self._frames, self._scratch
        load, nodes = self._prepare(state, joints, dt), (state.positions, state.velocities)
        solids, nets = self._solids_of(state), self._nets
        kernels.start_step(*nodes, load, frames, bodies)
        count, time, h, work = 0, 0.0, 0.0, 0.0
        while time < dt:
            part = self._longest_part(state)
            left = max(1, math.ceil(self.finer * (dt - time) / part)) if part < np.inf else 1
            if count + left > MOST_PARTS:
                raise FloatingPointError(f"the step would need {count + left} substeps of {part:.2g} s")
            largest = system.elastic.largest_stiffness() * float(np.abs(state.positions).max())
            load = load._replace(floor=(1e-6 * largest) ** 2)
            before, h = h, (dt - time) / left
            done, given = kernels.explicit_parts(
                scheme, min(left, RUN), h, before, time, *nodes, solids, nets, load, frames, bodies, scratch,
                self._begin,
            )  # fmt: skip
            self._place_bodies(state)
            if not math.isfinite(given):
                raise FloatingPointError(self._culprit(state))
            count, work, time = count + done, work + given, dt if done == left else time + done * h
        strain, given = kernels.finish_step(scheme, h, *nodes, solids, nets, load, frames, scratch)
        if not math.isfinite(strain):
            raise FloatingPointError(self._culprit(state))
        self._finish(state, joints, work + given)
        return count, strain

    def _solids_of(self, state: State) -> Solids:
        """Return the solids with the modes of `state`, as many as a power of two from 2 on: few sizes are compiled."""
        of = self._system.elastic.of
        found = [
            MovingSolid(arrays, of(state.modes, k), bool(self._system.elastic.terms[k].remembers))
            for k, arrays in self._solids
        ]
        count = 1 << max(1, (len(found) - 1).bit_length())
        return (*found, *[MovingSolid(no_solid(), np.zeros((0, 0, 3)), False)] * (count - len(found)))

    def _prepare(self, state: State, joints: FloatArray, dt: float) -> Load:
        """Set bodies and frames for a step from `state`; return the load."""
        system, bodies, frames, load = self._system, self._bodies, self._frames, self._load
        bodies.turn[:] = state.rotations
        bodies.centre[:] = state.centres + np.einsum("bij,bj->bi", state.rotations, self._offset)
        s = len(frames.joints)
        np.subtract(joints[:s], state.joints[:s], out=frames.rates)
        frames.joints[:], frames.rates[:] = state.joints[:s], frames.rates / dt
        if len(frames.held):
            held = tuple(frames.held.T)
            frames.begin[:], goal = state.positions[held], state.positions.copy()
            if prescribed := system.groups.prescribed:
                prescribed.place(joints[-1], goal)
            frames.speed[:] = (goal[held] - frames.begin) / dt
        load.constant[:] = 0.0
        for term in self._forces:
            load.constant[:] -= term.force
        self._measure_jerk(state, dt)
        return load

    def _place_bodies(self, state: State) -> None:
        """Write the poses of the bodies to `state`, their rotations orthonormal."""
        R = self._bodies.turn
        R[:] = 1.5 * R - 0.5 * np.einsum("bij,bkj,bkl->bil", R, R, R)
        state.rotations[:] = R
        state.centres[:] = self._bodies.centre - np.einsum("bij,bj->bi", R, self._offset)

    def _finish(self, state: State, joints: FloatArray, work: float) -> None:
        """Write torques, and the work done to the body by frames and loads, at the end of a step."""
        system = self._system
        system.drive(state, joints)
        system.update_levers(state)
        system.gradient[:] = self._scratch.gradient
        system.reduction.gradient(self._scratch.gradient, self._reduced, system.torques)
        system.torques += self._jerked
        self._given += work
        for term in self._forces:
            if term.works and self._keep:
                self._given += float(np.vdot(term.force, state.positions - self._keep.positions))

    def _measure_jerk(self, state: State, dt: float) -> None:
        """Write the torques that change the speed of the frames from that of the last step to that of this one."""
        frames = self._frames
        if not len(frames.nodes):
            return
        angle, rate = frames.joints[frames.frame, None], frames.rates[frames.frame, None]
        turning = np.cos(angle) * frames.sine - np.sin(angle) * frames.cosine
        change = rate * turning + frames.rates[-1] * frames.inward - state.velocities[frames.nodes]
        torque = self._mass[frames.nodes] * (turning * change).sum(axis=1) / dt
        self._jerked[:] = np.bincount(frames.frame, torque, minlength=len(self._jerked))

    def _energy(self, state: State, strain: float) -> tuple[float, float]:
        """Return the whole energy and that of motion and strain [J]; nodes of driven frames have no part in motion."""
        kinetic = 0.5 * float((self._moving * state.velocities**2).sum())
        gravity = sum(term.energies(state.positions)[1] for term in self._forces)
        return kinetic + strain + gravity, kinetic + strain

    def _rounding(self, state: State) -> float:
        """Return how far off strain energy is by rounding [J]: of a body that nothing moves there is no other."""
        stiffness, size = self._system.elastic.largest_stiffness(), float(np.abs(state.positions).max())
        return float(np.finfo(float).eps) * len(state.positions) * stiffness * size**2

    def _culprit(self, state: State) -> str:
        if not np.isfinite(state.positions).all():
            return "a number is not finite"
        return self._system.elastic.culprit(state.positions, state.modes)


def _bodies(system: System, mass: FloatArray) -> tuple[Bodies, FloatArray]:
    """Return the rigid bodies, and C - c of each, undeformed, c the mean of its nodes [m], shape (b, 3)."""
    rest, rigid = system.rest, system.groups.rigid
    b = len(rigid)
    masses, inverses, offsets, arms = np.zeros(b), np.zeros((b, 3, 3)), np.zeros((b, 3)), []
    for i, nodes in enumerate(rigid):
        m = mass[nodes]
        masses[i] = m.sum()
        centre = m @ rest[nodes] / masses[i]
        offsets[i] = centre - rest[nodes].mean(axis=0)
        arm = rest[nodes] - centre
        inertia = (m @ (arm**2).sum(axis=1)) * np.eye(3) - (arm * m[:, None]).T @ arm
        moments = np.linalg.eigvalsh(inertia)
        if not moments[0] > THIN * moments[-1]:
            raise SceneError(
                f"the masses of rigid body {i} ({len(nodes)} nodes) lie on a line, so it has no moment of "
                "inertia about it, which an explicit inertia.scheme needs; enlarge effector.radius or choose "
                f"one of: {', '.join(IMPLICIT)}"
            )
        inverses[i] = np.linalg.inv(inertia)
        arms.append(arm)
    members = np.concatenate([*rigid, np.zeros(0, dtype=np.int64)])
    owner = np.repeat(np.arange(b), [len(nodes) for nodes in rigid])
    arm = np.concatenate([*arms, np.zeros((0, 3))])
    moving = np.zeros((6, b, 3))
    parts = [members, owner, arm, masses, inverses, moving[0], np.zeros((b, 3, 3)), *moving[1:]]
    return Bodies._make(parts), offsets


def _frames(system: System) -> kernels.Frames:
    """Return the driven frames, and what else is held and would move or is to move."""
    driven = system.groups.driven
    s = len(driven)
    nodes = np.concatenate([*(f.nodes for f in driven), np.zeros(0, dtype=np.int64)])
    frame = np.repeat(np.arange(s), [len(f.nodes) for f in driven])
    swings = [(*f.swing(system.rest[f.nodes]), np.tile(f.inward, (len(f.nodes), 1))) for f in driven]
    swing = [np.concatenate([*(part[k] for part in swings), np.zeros((0, 3))]) for k in range(4)]
    groups = system.groups
    moved = groups.prescribed.nodes if groups.prescribed else np.zeros(0, dtype=np.int64)
    whole = np.intersect1d(moved, groups.fixed)  # other fixed nodes have no mass to move by
    held = np.ascontiguousarray(np.concatenate([groups.pinned, np.argwhere(np.ones((len(whole), 3)))]))
    held[len(groups.pinned) :, 0] = whole[held[len(groups.pinned) :, 0]]
    return kernels.Frames._make(
        [nodes, frame, *swing, *np.zeros((2, s + 1)), held, *np.zeros((2, len(held)))]
    )
