"""A finite-element solid among bodies in contact: the potential of an implicit stage in the moves of its unknowns.

The potential is that of `ImplicitStage`, with all that the scene fastens to the solid. Its unknowns are those of
`Reduction` (free nodes, then rigid groups such as the disc, each with a rotation vector theta over the step) and, last,
the nodes of driven frames and prescribed motions on the surface. These move as servos and timelines say, whatever
presses them, and so do free nodes along axes along which they are held or moved: such unknowns are given.

Incompatible modes are no unknowns: at every move they are brought to the minimum of the energy.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.contact import group_kernels
from tripod_sim.contact.bodies import Body
from tripod_sim.integrators.history import History
from tripod_sim.integrators.scheme import Stage
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.state import State
from tripod_sim.system_kernels import largest, same, write_difference

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.strain_bound import StrainBound

HELD = 1e18
"""Stiffness with which driven nodes keep to their way [N/m]: no force that a body bears moves them by an atom."""

NEAR = 0.3
"""Share of the move of nodes by which modes may miss their balance: the condensed gradient knows of it."""

ROOM = 1e6
"""Square of how much more unbalanced than the tolerance modes may be at last."""


class SolidNodes(Body):
    """The solid as a body of a step with contact (see `bodies.Body`).

    Attributes:
        unknowns: Of the reduction and three for each driven or prescribed node of the surface.
        pattern: Upper triangle of the Hessian, CSC.
        nodes: Nodes of the mesh that are vertices of the surface, shape (k,).
        base, width: First unknown of each of them, -1 if it never moves, and 3 (node) or 6 (rigid group), shape (k,).
        held: Along which axes each of them does not yield, shape (k, 3).
        given, reach: See `Body`.
        bound: Of strains, where there are springs and a limit.
        looked_back: Whether the next stage may look back on the last.
        served: See `Body`.
    """

    def __init__(
        self,
        stage: ImplicitStage,
        mass: FloatArray,
        nodes: IndexArray,
        tolerance: float,
        near: float,
        bound: "StrainBound | None" = None,
    ) -> None:
        """Take part in steps with contact.

        Args:
            stage: Of implicit Euler; its system is the solid's.
            mass: Of nodes [kg].
            nodes: Of the surface.
            tolerance: Unbalanced force of modes that is let be [N].
            near: Or by how much they may miss their balance at most [m], if nodes have moved by far more.
            bound: Of the stretch of springs, a term of the system; None without one.
        """
        self._stage, self._system, self._mass, self.nodes = stage, stage.newton.system, mass, nodes
        system, r = self._system, self._system.reduction
        self._tolerance, self._near, self.bound = tolerance**2, near, bound
        kind = r.kind[nodes]
        self._arms = np.flatnonzero(kind == Kind.DRIVEN)
        self._driven = np.flatnonzero(np.isin(nodes, system.driven) & (kind != Kind.FREE))
        self.base, self.width = r.base[nodes].copy(), np.where(kind == Kind.RIGID, 6, 3)
        self._own = r.unknowns
        self.base[self._driven] = r.unknowns + 3 * np.arange(len(self._driven))
        self.unknowns = r.unknowns + 3 * len(self._driven)
        self.given = np.concatenate([r.pinned, np.arange(r.unknowns, self.unknowns)])
        self._pinned, self._way = tuple(system.groups.pinned.T), np.zeros(len(self.given))
        self.held = system.groups.held()[nodes]
        own = sparse.csc_matrix(
            (np.ones(r.pattern.nnz), r.pattern.indices, r.pattern.indptr), r.pattern.shape
        )
        held = [sparse.csc_matrix(np.triu(np.ones((3, 3)))) for _ in self._driven]
        self.pattern: Any = sparse.block_diag([own, *held], format="csc")
        self._diagonal = HELD * np.tile([1.0, 0.0, 1.0, 0.0, 0.0, 1.0], len(held))
        self._rigid = np.flatnonzero(kind == Kind.RIGID)
        n = len(system.rest)
        self._dx, self._last = np.zeros((n, 3)), np.zeros((n, 3))
        self._last_modes = system.elastic.rest_modes()
        self._off = [t.mode_offsets for t in system.elastic.terms if t.has_modes]
        # what only some steps need is compiled
        system.elastic.settle_modes(system.rest, self._last_modes, tolerance)
        system.reduction.moves(np.zeros(system.unknowns), system.lever, self._dx)
        system.elastic.add_products(system.elastic.matrices, self._dx, largest(self._last), self._last)
        self._start: State | None = None
        self._trial: State | None = None
        self._at, self._phi, self._given = np.full(self.unknowns, np.nan), 0.0, False
        self._goal = self._rate = self._pinned_at = np.zeros(0)
        self._left, self._now_at = 1.0, Stage(1.0, 1.0)
        self._history: History | None = None
        self._read = np.zeros((0, 0, 3))  # what of the start of a stage may be looked back on
        self._projected = False
        self._along, self._answers = (
            system.another_linear(),
            False,
        )  # whether it has factored the last assembly
        self._free = r.free
        groups = system.groups.rigid
        self._members = np.concatenate([*groups, np.zeros(0, dtype=np.int64)]).astype(np.int64)
        self._first = np.cumsum([0, *map(len, groups)])
        arms = [system.rest[b] - system.rest[b].mean(axis=0) for b in groups]
        self.reach = np.ones(self.unknowns)
        for b, a in enumerate(arms):
            k = 3 * r.free_count + 6 * b
            self.reach[k + 3 : k + 6] = np.linalg.norm(a, axis=1).max()
        spreads = [np.linalg.pinv((a**2).sum() * np.eye(3) - a.T @ a, rcond=1e-9) for a in arms]
        self._spreads = np.reshape(spreads, (-1, 3, 3))

    @property
    def lasting(self) -> bool:
        """Whether the Hessian of a step may serve in the next."""
        return not (self._projected or self.bound) and any(t.lasting for t in self._system.elastic.terms)

    def turns(self, move: FloatArray) -> FloatArray:
        """As `System.turns`."""
        return self._system.turns(move)

    # what the stepper asks --------------------------------------------------------------------------------------------

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step of `dt` [s] from `state`, in which the driven frames move to `joints`, shape (s + 1,)."""
        if self._start is None or self._trial is None:
            self._start, self._trial = state.copy(), state.copy()
        state.copy_to(self._start)
        self._goal, self._rate, self._left = joints.copy(), (joints - state.joints) / dt, dt

    def store(self, state: State) -> None:
        """Write where the solid is now to `state`."""
        start = self._now()
        for name in ("positions", "velocities", "modes", "joints"):
            getattr(state, name)[:] = getattr(start, name)
        held = self._system.reduction.bodies
        state.centres[:held], state.rotations[:held] = start.centres[:held], start.rotations[:held]

    def forget(self) -> None:
        """Drop what was kept from earlier steps: the tensions at the bound too."""
        self._stage.newton.forget()
        if self.bound:
            self.bound.relax()
        self._at[:] = np.nan
        self._projected = False

    def add_reactions(self, forces: FloatArray) -> None:
        """Let the system's gradient and torques be those with forces on the surface [N], shape (k, 3)."""
        system = self._system
        system.gradient[self.nodes] -= forces
        pressed = self._arms[forces[self._arms].any(axis=1)]
        if not len(pressed):
            return
        nodes = self.nodes[pressed]
        moments = np.cross(system.lever[nodes], forces[pressed])
        frames = system.reduction.number[nodes]
        np.subtract.at(system.torques, frames, (system.axes[frames] * moments).sum(axis=1))

    # what a step with contact asks ------------------------------------------------------------------------------------

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write the surface's vertices and their arms from the centres of rigid groups [m], both of shape (k, 3)."""
        if not (start := self._start):
            return
        positions[:] = start.positions[self.nodes]
        group = self._system.reduction.number[self.nodes[self._rigid]]
        arm[self._rigid] = positions[self._rigid] - start.centres[group]

    def invalidate(self) -> None:
        """Drop what is known of the potential at some moves: the bound of strains has changed."""
        self._at[:] = np.nan

    def exceeds(self, u: FloatArray) -> bool:
        """Return whether strains after the moves `u` are larger than their bound."""
        return self.bound is not None and self.bound.exceeded(self.moved(u))

    def taut(self) -> bool:
        """Return whether their bound pulls."""
        return self.bound is not None and self.bound.pulls

    def tighten(self) -> None:
        """Stiffen what bounds the strains."""
        if self.bound:
            self.bound.harden()
            self.invalidate()

    def settle(self, u: FloatArray) -> float:
        """Give what bounds the strains the tensions that the moves `u` ask for; return the error: 1 is small enough."""
        if not self.bound:
            return 0.0
        error = self.bound.settle(self.moved(u))
        self.invalidate()
        return error

    def past(self) -> tuple[FloatArray, ...]:
        """Return what the next stage may look back on."""
        return self._history.arrays() if self._history else ()

    def stop(self) -> None:
        """Take all velocities."""
        self._now().velocities[:] = 0.0

    def begin(self, stage: Stage) -> None:
        """Prepare a stage from the present state."""
        start, trial, system = self._now(), self._trial, self._system
        assert trial is not None
        self._now_at, self._given = stage, self.served
        known = self._stage.known
        self._stage.read(start, known)
        if self.looked_back:
            if self._history is None:
                self._history, self._read = History(known.shape, slice(1, 2)), np.zeros_like(known)
            self._read[:] = known
            self._history.known(self._read, stage, known)
        self._stage.aim(stage)
        if not self.served:  # what dampers remember is of this stage now
            self._projected = self._answers = False
            if system.assemble(start, project=False) >= 0:
                system.assemble(start, project=True)  # the condensation of the modes is that of the start
        left = self._left - stage.length
        joints = self._goal if left < 1e-9 * stage.length else start.joints + stage.length * self._rate
        start.copy_to(trial)
        system.drive(trial, joints)
        self._pinned_at = trial.positions[self._pinned]
        ways = trial.positions - start.positions
        self._way = np.concatenate([ways[self._pinned], ways[self.nodes[self._driven]].ravel()])
        self._remember(start)
        self._at[:] = np.nan

    def guess(self, u: FloatArray) -> None:
        """Write the moves with the velocities at the start; where some are given others, the linearised answer."""
        self.rate_at_start(u)
        u *= self._now_at.length
        if self._way.any() or self._now().velocities[self._system.driven].any():
            self._go_along(u)
        u[self.given] = self._way

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential, infinite where there is none."""
        phi = self._place(u)
        if not np.isfinite(phi):
            return np.inf
        residual, first = self._system.residual, 3 * self._system.reduction.free_count
        group_kernels.add_residual(residual, first, u, out)
        return phi

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian at `u` into `pattern.data`; not a number where modes are unstable without `project`.

        The first one of a step is that of its start.
        """
        system, trial = self._system, self._trial
        assert trial is not None
        count = system.reduction.pattern.nnz
        if self._given:
            self._answers = False
            if not np.isfinite(self._place(u)) or system.assemble(trial, project=project) >= 0:
                self.pattern.data[:] = np.nan
                return
            self._projected |= (
                project  # the gradient at hand stays: of modes at rest condensation makes nothing
            )
        else:
            system.evaluate(self._now())
            self._remember(self._now())
            self._at[:] = np.nan
            self._given = True
        system.write_hessian()
        self.pattern.data[:count] = system.reduction.pattern.data
        self.pattern.data[count:] = self._diagonal

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the surface's vertices are after the moves `u` [m], shape (k, 3)."""
        out[:] = self.moved(u)[self.nodes]

    def moved(self, u: FloatArray) -> FloatArray:
        """Return where all nodes are after the moves `u` [m], shape (n, 3)."""
        assert self._trial is not None
        if not same(u, self._at):
            self._move(u)
            self._at[:] = np.nan
        return self._trial.positions

    def rate_at_start(self, out: FloatArray) -> None:
        """Write the velocities of the unknowns at the start of the stage, of given ones those over it."""
        self._fit(self._now().velocities, out)
        self._add_given(out)

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write the velocities of the unknowns after the moves `u`, of given ones those over the stage."""
        start, stage = self._now(), self._now_at
        out[:] = 0.0
        if not stage.begins:
            self._fit(start.positions - self._stage.known[0], out)
        out += u
        out /= stage.s
        self._add_given(out)

    def _add_given(self, out: FloatArray) -> None:
        """Write the velocities of given unknowns over the stage."""
        length = self._now_at.length
        out[self.given] = self._way / length if length else 0.0

    def _fit(self, field: FloatArray, out: FloatArray) -> None:
        """Write the unknowns' share of a linear field on the nodes, shape (n, 3), in the present pose."""
        start = self._now()
        group_kernels.fit(
            field, start.positions, self._free, self._members, self._first, start.centres, start.rotations,
            self._spreads, out,
        )  # fmt: skip

    def inverse_mass(self, out: FloatArray) -> None:
        """Write those of free nodes and rigid groups; given unknowns have none."""
        system, mass = self._system, self._mass
        first = system.reduction.free_count
        out[:first] = np.eye(3) / mass[self._free][:, None, None]
        for b, nodes in enumerate(system.groups.rigid):
            m, r = mass[nodes], self._now().positions[nodes] - self._now().centres[b]
            inertia = (m @ (r**2).sum(axis=1)) * np.eye(3) - (r * m[:, None]).T @ r
            k = first + 2 * b
            out[k], out[k + 1] = np.eye(3) / m.sum(), np.linalg.inv(inertia)
        block, axis = np.divmod(self.given, 3)
        out[block, axis], out[block, :, axis] = 0.0, 0.0

    def finish(self, u: FloatArray) -> None:
        """Let the moves `u` be made."""
        start, trial, stage = self._now(), self._trial, self._now_at
        assert trial is not None
        self._place(u)
        np.subtract(trial.positions, self._stage.known[0], out=trial.velocities)
        trial.velocities /= stage.s
        if self.looked_back and self._history:
            after = np.empty_like(self._read)
            self._stage.read(trial, after)
            self._history.note(self._read, self._stage.known, after, stage)
        trial.copy_to(start)
        self._left -= stage.length
        self._at[:] = np.nan

    def add_velocity(self, change: FloatArray) -> None:
        """Add to the velocities of free nodes and rigid groups."""
        system = self._system
        self._dx[:] = 0.0
        system.reduction.moves(np.ascontiguousarray(change[: self._own]), system.lever, self._dx)
        self._now().velocities += self._dx

    # ------------------------------------------------------------------------------------------------------------------

    def _now(self) -> State:
        assert self._start is not None
        return self._start

    def _go_along(self, u: FloatArray) -> None:
        """Write the step that Newton's method makes from the start, its driven nodes moved, if there is one."""
        start, trial, system = self._now(), self._trial, self._system
        assert trial is not None
        driven = system.driven
        system.evaluate(start)
        self._remember(start)
        if not self._answers:
            system.write_hessian()
            self._answers = self._along.factor() and self._along.is_positive()
        if self._answers:
            self._dx[:] = 0.0
            self._dx[driven] = trial.positions[driven] - start.positions[driven]
            system.add_driven(self._dx)
            self._dx[driven] = 0.0
            u[: self._own] = -self._along.solve(system.residual)

    def _remember(self, state: State) -> None:
        """Note where the last gradient was taken, whose modes are balanced."""
        self._last[:], self._last_modes[:] = state.positions, state.modes

    def _move(self, u: FloatArray) -> None:
        """Put the trial state's nodes where the moves `u` bring them; what is given is there."""
        start, trial, system = self._now(), self._trial, self._system
        assert trial is not None
        first = 3 * system.reduction.free_count
        self._dx[self._free] = u[:first].reshape(-1, 3)
        system.move_nodes(start, u[: self._own], self._dx, 1.0, trial)
        trial.positions[self._pinned] = self._pinned_at

    def _balances(self, far: float) -> bool:
        """Return whether modes are balanced well enough after nodes have moved by `far` [m]."""
        left, near = self._system.elastic.mode_residual_squared, min(NEAR * far, self._near)
        return left <= self._tolerance or (left < np.inf and all(largest(y) <= near for y in self._off))

    def _place(self, u: FloatArray) -> float:
        """Put the trial state where `u` brings it, its modes at rest; return the potential, infinite for none."""
        if same(u, self._at):
            return self._phi
        system, trial, elastic = self._system, self._trial, self._system.elastic
        assert trial is not None
        self._move(u)
        far = write_difference(trial.positions, self._last, self._dx)
        elastic.advance_modes(self._last_modes, self._dx, 1.0, trial.modes)
        phi = system.evaluate(trial)
        if not (np.isfinite(phi) and self._balances(far)):
            left = elastic.settle_modes(trial.positions, trial.modes, self._tolerance)
            phi = system.evaluate(trial) if left <= ROOM * self._tolerance else np.inf
        if np.isfinite(phi):
            self._remember(trial)
        else:  # what the gradient left of the modes is spoilt: take it where it was good
            there = trial.positions.copy()
            trial.positions[:], trial.modes[:] = self._last, self._last_modes
            system.evaluate(trial)
            trial.positions[:] = there
        self._at[:], self._phi = u, phi
        return phi
