"""A body of springs among bodies in contact: the potential of an implicit stage in the moves of its free nodes."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.looking_back import Memory, Stage
from tripod_sim.springs.linear_kernels import Slots, assemble
from tripod_sim.springs.spring_kernels import add_gradient, add_products, lengths, tangents
from tripod_sim.springs.spring_system import SpringSystem
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.strain_bound import StrainBound


class _SpringPast(NamedTuple):
    """What the next stage may look back on: the last moves [m], lengths and velocities."""

    change: FloatArray
    length: Memory
    velocity: Memory

    @classmethod
    def of(cls, nodes: int, springs: int) -> "_SpringPast":
        return cls(np.zeros((nodes, 3)), Memory((springs,)), Memory((nodes, 3)))


class SpringNodes:
    """The free nodes of a spring body, with damping (see `springs.implicit_kernels`).

    With d = u - w the way from where the stage looks back, w = z - x (see `integrators.looking_back`),

        M |d - s u_0|² / (2 s²) + a M |d|² / (2 s) + b / (2 s) d^T K_n d + E(x + u) + D(x + u) - F . u

    (u_0 what is known of the velocity) and, with a limit of strains, that of the springs beyond their bound (see
    `forces.strain_bound`).

    Attributes:
        x, v: Positions [m] and velocities [m/s] of all nodes at the start of the stage, shape (n, 3).
        base, width, held, bounded, given, reach, looked_back: See `Nodes` and `Body`.
        weight: M/s² + a M/s of each node [N/m], shape (n,).
    """

    def __init__(
        self,
        system: SpringSystem,
        *,
        drag: float = 0.0,
        rayleigh: float = 0.0,
        bound: "StrainBound | None" = None,
    ) -> None:
        """`drag`: a of the force -a M v [1/s]; `rayleigh`: b of the force -b K v [s]; `bound`: of strains."""
        body = system.body
        self._system, self._drag, self._rayleigh, self._bound = system, drag, rayleigh, bound
        self.bounded = bound is not None
        self.unknowns, self._free = system.unknowns, body.free
        self.reach = np.ones(self.unknowns)
        sides = body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(
            -1, 2
        )  # a contact joins the corners of a triangle
        self.pattern, diagonal, off = system.pattern(sides)
        self._slots = Slots(self.pattern.data, diagonal, off)
        self.base = np.where(system.number >= 0, 3 * system.number, -1)
        self.width, self.held = np.full(len(self.base), 3), np.repeat(self.base[:, None] < 0, 3, axis=1)
        self.given, self.looked_back = np.zeros(0, dtype=np.int64), False
        self.served = self.lasting = False  # springs turn and go slack
        n, m = len(body.nodes), len(body.ends)
        self.x, self.v, self._move, self._at, self._g, self._aim = np.zeros((6, n, 3))
        (self._blocks, self._lagged), (self._lengths, self._reference) = np.zeros((2, m, 6)), np.zeros((2, m))
        self.weight, self._inertia, self._stage = np.zeros(n), np.zeros(n), Stage(1.0, 1.0)
        self._damped, self._rate = bool((body.damping > 0).any()), 0.0
        self._way: FloatArray | None = None
        self._past: _SpringPast | None = None
        self._kept: tuple[FloatArray, FloatArray] | None = None

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step from `state`."""
        self.x[:], self.v[:] = state.positions, state.velocities

    def store(self, state: State) -> None:
        """Write where the nodes are now to `state`."""
        state.positions[:], state.velocities[:] = self.x, self.v

    def forget(self) -> None:
        """Drop what was kept from earlier steps: the tensions at the bound."""
        if self._bound:
            self._bound.relax()

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write where the nodes are."""
        positions[:] = self.x

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the nodes are after the moves `u`."""
        out[:] = self.x
        out[self._free] += u.reshape(-1, 3)

    def rate_at_start(self, out: FloatArray) -> None:
        """Write the velocities of free nodes."""
        out[:] = self.v[self._free].ravel()

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write the velocities of free nodes after the moves `u`."""
        out[:] = u if self._way is None else u - self._way[self._free].ravel()
        out /= self._stage.s

    def give(self, out: FloatArray) -> None:
        """Write 1 / mass of each unknown, with its damping."""
        s = self._stage.s
        out[:] = np.repeat(1 / (s * s * self.weight[self._free]), 3)

    def exceeds(self, u: FloatArray) -> bool:
        """Return whether springs are longer than their bound after the moves `u`."""
        self._place(u)
        return self._bound is not None and self._bound.exceeded(self._at)

    def taut(self) -> bool:
        """Return whether the bound of strains pulls."""
        return self._bound is not None and self._bound.pulls

    def tighten(self) -> None:
        """Stiffen the bound of strains."""
        if self._bound:
            self._bound.harden()

    def settle(self, u: FloatArray) -> float:
        """Give the bound of strains the tensions that the moves `u` ask for; return the error: 1 is small enough."""
        self._place(u)
        return self._bound.settle(self._at) if self._bound else 0.0

    def keep(self) -> None:
        """Remember `x` and `v`."""
        self._kept = self.x.copy(), self.v.copy()

    def recall(self) -> None:
        """Return to them."""
        assert self._kept
        self.x[:], self.v[:] = self._kept

    def past(self) -> tuple[FloatArray, ...]:
        """Return what the next stage may look back on."""
        if not (past := self._past):
            return ()
        return past.change, past.length.change, past.length.rate, past.velocity.change, past.velocity.rate

    def stop(self) -> None:
        """Take all velocities."""
        self.v[:] = 0.0

    def finish(self, u: FloatArray, kick: FloatArray | None) -> None:
        """Let the moves be made."""
        after, free = u.copy(), self._free
        self.rate_at_end(u, after)
        if kick is not None:
            after += kick
        if self.looked_back:
            past = self._past = self._past or _SpringPast.of(len(self.x), len(self._reference))
            self._place(u)
            past.change[:] = self._move
            after_lengths = np.empty_like(self._lengths)
            lengths(self._at, self._system.links, after_lengths)
            past.length.note(self._lengths, self._reference, after_lengths, self._stage)
            known = (
                self._aim / self._stage.s if self._way is None else (self._aim - self._way) / self._stage.s
            )
            velocity = np.zeros_like(self.v)
            velocity[free] = after.reshape(-1, 3)
            past.velocity.note(self.v, known, velocity, self._stage)
        self.x[free] += u.reshape(-1, 3)
        self.v[free] = after.reshape(-1, 3)

    def add_reactions(self, forces: FloatArray) -> None:
        """There are no servos, and nobody asks what holds nodes."""

    def begin(self, stage: Stage) -> None:
        """Prepare a stage from `x` and `v`."""
        system, s = self._system, stage.s
        self._stage = stage
        if self._bound:
            self._bound.aim(s)
        np.divide(system.mass, s * s, out=self._inertia)
        np.multiply(system.mass, self._drag / s, out=self.weight)
        self.weight += self._inertia
        self._rate = 1.0 / s if self._damped else 0.0
        lengths(self.x, system.links, self._lengths)
        self._reference[:] = self._lengths
        if self._rayleigh:
            tangents(self.x, system.links, 0.0, self._reference, True, self._lagged)
        if stage.begins:
            self._way = None
            np.multiply(self.v, s, out=self._aim)
            return
        assert self._past
        past = self._past
        way = self._way = stage.back * past.change + stage.lead * self.v
        past.velocity.known(self.v, stage, self._aim)
        self._aim *= s
        self._aim += way
        past.length.known(self._lengths, stage, self._reference)

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a stage without forces."""
        u[:] = self._aim[self._free].ravel()

    def _place(self, u: FloatArray) -> None:
        self._move[self._free] = u.reshape(-1, 3)
        np.add(self.x, self._move, out=self._at)

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential."""
        self._place(u)
        s, g, d = self._system, self._g, self._move
        np.subtract(d, self._aim, out=g)
        way = d if self._way is None else d - self._way
        phi = 0.5 * float(self._inertia @ np.einsum("ni,ni->n", g, g))
        g *= self._inertia[:, None]
        if self._drag:
            extra = self.weight - self._inertia
            phi += 0.5 * float(extra @ np.einsum("ni,ni->n", way, way))
            g += extra[:, None] * way
        g -= s.force
        phi -= float(np.vdot(s.force, d))
        phi += float(add_gradient(self._at, s.links, self._rate, self._reference, g))
        if self._rayleigh:
            phi += float(add_products(s.body.ends, self._lagged, way, self._rayleigh / self._stage.s, g))
        if self._bound:
            phi += float(add_gradient(self._at, self._bound.links, 0.0, self._reference, g))
        out += g[self._free].ravel()
        return phi

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian at `u` into `pattern.data`."""
        self._place(u)
        s = self._system
        tangents(self._at, s.links, self._rate, self._reference, project, self._blocks)
        if self._rayleigh:
            self._blocks += (self._rayleigh / self._stage.s) * self._lagged
        if self._bound:
            more = np.empty_like(self._blocks)
            tangents(self._at, self._bound.links, 0.0, self._reference, project, more)
            self._blocks += more
        assemble(s.body.ends, self._blocks, self.weight, s.body.free, s.number, self._slots)
