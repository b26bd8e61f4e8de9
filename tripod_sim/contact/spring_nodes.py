"""A body of springs among bodies in contact: the potential of an implicit stage in the moves of its free nodes."""

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.bodies import Nodes
from tripod_sim.integrators.history import History
from tripod_sim.integrators.scheme import Stage
from tripod_sim.springs.implicit import problem_of, work_of
from tripod_sim.springs.implicit_kernels import write_blocks
from tripod_sim.springs.linear_kernels import Slots, assemble
from tripod_sim.springs.spring_kernels import add_gradient, lengths, tangents
from tripod_sim.springs.spring_system import SpringSystem
from tripod_sim.state import State
from tripod_sim.system_kernels import dot

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.strain_bound import StrainBound


class SpringNodes(Nodes):
    """The free nodes of a spring body, with damping.

    With d = u - w the way from where the stage looks back, w = z - x (see `integrators.scheme`),

        M |d - s u_0|² / (2 s s_f) + a M |d|² / (2 s) + E(x + u) + D(x + u) - F . u

    (u_0 what is known of the velocity; the rest as in `springs.implicit_kernels`) and, with a limit of strains, that of
    the springs beyond their bound (see `forces.strain_bound`).

    Attributes:
        x, v: Positions [m] and velocities [m/s] of all nodes at the start of the stage, shape (n, 3).
        base, width, held, bound, given, reach, looked_back: See `Nodes` and `Body`.
    """

    def __init__(
        self,
        system: SpringSystem,
        *,
        drag: float = 0.0,
        bound: "StrainBound | None" = None,
    ) -> None:
        """`drag`: a of the force -a M v [1/s]; `bound`: of strains."""
        body = system.body
        self._problem = problem_of(system, drag=drag, moving=True)
        self.bound = bound
        self.unknowns, self._free = system.unknowns, body.free
        self.reach = np.ones(self.unknowns)
        sides = body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(
            -1, 2
        )  # a contact joins the corners of a triangle
        self.pattern, diagonal, off = system.pattern(sides)
        self._slots = Slots(self.pattern.data, diagonal, off)
        self.base = np.where(system.number >= 0, 3 * system.number, -1)
        self.width, self.held = np.full(len(self.base), 3), np.repeat(self.base[:, None] < 0, 3, axis=1)
        self.given = np.zeros(0, dtype=np.int64)
        n, size = len(body.nodes), 6 * len(body.nodes) + len(body.ends)
        self._now, self._known = np.zeros((2, size))  # positions, velocities, lengths
        self._history = History((size,), slice(3 * n, 6 * n))
        self.x, self.v, self._lengths = self._parts(self._now)
        z, v, reference = self._parts(self._known)
        self._work = work_of(system, iterates=False)._replace(z=z, u=v, reference=reference)
        self._at, self._moves = np.zeros((2, n, 3))
        self._mass, self._force = np.repeat(system.mass[self._free], 3), system.force[self._free].ravel()
        self._way, self._aim = np.zeros((2, self.unknowns))  # w and w + s u_0
        self._stage, self._kept = Stage(1.0, 1.0), self._now

    @property
    def lasting(self) -> bool:
        """Whether the Hessian of a step may serve in the next: no, springs turn and go slack."""
        return False

    def _parts(self, of: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and lengths of what `History` takes as one, views."""
        n = len(self.base)
        return of[: 3 * n].reshape(n, 3), of[3 * n : 6 * n].reshape(n, 3), of[6 * n :]

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step from `state`."""
        self.x[:], self.v[:] = state.positions, state.velocities

    def store(self, state: State) -> None:
        """Write where the nodes are now to `state`."""
        state.positions[:], state.velocities[:] = self.x, self.v

    def forget(self) -> None:
        """Drop what was kept from earlier steps: the tensions at the bound."""
        if self.bound:
            self.bound.relax()

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write where the nodes are."""
        positions[:] = self.x

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the nodes are after the moves `u`."""
        self._moves[self._free] = u.reshape(-1, 3)
        np.add(self.x, self._moves, out=out)

    def rate_at_start(self, out: FloatArray) -> None:
        """Write the velocities of free nodes."""
        out[:] = self.v[self._free].ravel()

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write the velocities of free nodes after the moves `u`."""
        np.subtract(u, self._way, out=out)
        out /= self._stage.s

    def inverse_mass(self, out: FloatArray) -> None:
        """Write those of free nodes."""
        out[:] = np.eye(3) / self._mass[::3, None, None]

    def moved(self, u: FloatArray) -> FloatArray:
        """Return where all nodes are after the moves `u` [m], shape (n, 3)."""
        self.ends(u, self._at)
        return self._at

    def keep(self) -> None:
        """Remember `x` and `v`."""
        self._kept = self._now.copy()

    def recall(self) -> None:
        """Return to them."""
        self._now[:] = self._kept

    def past(self) -> tuple[FloatArray, ...]:
        """Return what the next stage may look back on."""
        return self._history.arrays()

    def stop(self) -> None:
        """Take all velocities."""
        self.v[:] = 0.0

    def begin(self, stage: Stage) -> None:
        """Prepare a stage from `x` and `v`."""
        self._stage, links = stage, self._problem.links
        if self.bound:
            self.bound.aim(stage.s)
        lengths(self.x, links, self._lengths)
        self._history.known(self._now, stage, self._known)
        self._way[:] = (self._work.z - self.x)[self._free].ravel()
        self._aim[:] = self._way + stage.s * self._work.u[self._free].ravel()

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a stage without forces."""
        u[:] = self._aim

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential."""
        body, work, s, free = self._problem, self._work, self._stage.s, self._free
        off, way = u - self._aim, u - self._way  # as differences of moves they lose no digits
        g = off * (self._mass / self._stage.square)
        phi = 0.5 * dot(off, g) - dot(self._force, u)
        if body.drag:
            drag = self._mass * (body.drag / s) * way
            phi += 0.5 * dot(drag, way)
            g += drag
        g -= self._force
        work.g[free] = g.reshape(-1, 3)
        phi += add_gradient(
            self.moved(u), body.links, 1.0 / s if body.damped else 0.0, work.reference, work.g
        )
        if self.bound:
            phi += add_gradient(self._at, self.bound.links, 0.0, work.reference, work.g)
        out += work.g[free].ravel()
        return float(phi)

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian at `u` into `pattern.data`."""
        body, work = self._problem, self._work
        blocks = work.blocks
        s, square = self._stage.s, self._stage.square
        write_blocks(self.moved(u), s, project, body, work)
        if square != s * s:
            work.weight[self._free] = self._mass[::3] * (1.0 / square + body.drag / s)
        if self.bound:
            more = np.empty_like(blocks)
            tangents(self._at, self.bound.links, 0.0, work.reference, project, more)
            blocks += more
        assemble(body.links.ends, blocks, work.weight, body.free, body.number, self._slots)

    def finish(self, u: FloatArray) -> None:
        """Let the moves be made."""
        after = self._now.copy()
        x, v, end = self._parts(after)
        rate = np.empty_like(u)
        self.rate_at_end(u, rate)
        self.ends(u, x)
        v[self._free] = rate.reshape(-1, 3)
        if self.looked_back:
            lengths(x, self._problem.links, end)
            self._history.note(self._now, self._known, after, self._stage)
        self._now[:] = after

    def add_velocity(self, change: FloatArray) -> None:
        """Add to the velocities of free nodes."""
        self.v[self._free] += change.reshape(-1, 3)
