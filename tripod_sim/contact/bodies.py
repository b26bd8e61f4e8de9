"""What moves in a step with contact: nodes tied by springs, and rigid bodies. Each is a potential in its unknowns."""

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from scipy import sparse

from tripod_sim.constraints.groups import rotation_matrix
from tripod_sim.contact.rigid_state import RigidState
from tripod_sim.mesh.solid_mesh import FloatArray
from tripod_sim.springs.linear_kernels import assemble
from tripod_sim.springs.spring_kernels import add_gradient, add_products, lengths, tangents
from tripod_sim.springs.system import SpringSystem
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.springs.strain_limit import Bound


class Body(Protocol):
    """A potential of implicit Euler in a body's unknowns u, the moves over the step.

    Attributes:
        unknowns: Their number.
        yielding: How many of them are sought; those behind are given.
        pattern: Upper triangle of the Hessian, CSC, with full blocks of nodes or bodies; `hessian` writes its data.
    """

    unknowns: int
    yielding: int
    pattern: Any

    def begin(self, h: float) -> None:
        """Prepare a step of `h` [s] from the body's present state."""

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a step without forces."""

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` [N, N m] to `out`; return the potential [J]. Both of shape (unknowns,)."""

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian at `u` into `pattern.data`; `project` makes it positive definite."""


class Nodes(Body, Protocol):
    """A deformable body, whose surface's vertices follow its unknowns.

    Attributes:
        base, width: First unknown of each vertex, -1 if it never moves, and 3 (node) or 6 (rigid group), shape (k,).
        held: Which vertices do not yield, whatever presses them, shape (k,).
        bounded: Whether strains are.
    """

    base: Any
    width: Any
    held: Any
    bounded: bool

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step of `dt` [s] from `state`, in which driven frames move to `joints`."""

    def store(self, state: State) -> None:
        """Write where the body is now to `state`."""

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write the vertices and their arms from the centres of rigid groups [m], both of shape (k, 3)."""

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the vertices are after the moves `u` [m], shape (k, 3)."""

    def velocity(self, out: FloatArray) -> None:
        """Write the velocities of the unknowns at the start of the step [m/s, rad/s]."""

    def give(self, out: FloatArray) -> None:
        """Write 1 / mass of each unknown [1/kg, 1/(kg m²)], 0 of given ones."""

    def exceeds(self, u: FloatArray) -> bool:
        """Return whether strains after the moves `u` are larger than their bound."""

    def tighten(self) -> None:
        """Stiffen what bounds the strains."""

    def settle(self, u: FloatArray) -> float:
        """Give what bounds the strains the tensions that the moves `u` ask for; return the error: 1 is small enough."""

    def finish(self, u: FloatArray, v: FloatArray, h: float, ends: FloatArray) -> None:
        """Let the moves `u`, which lead to `ends`, be made in `h` [s]; `v`: velocities of the unknowns afterwards."""

    def add_torques(self, forces: FloatArray) -> None:
        """Tell the servos what forces on the vertices [N], shape (k, 3), ask of them."""


class _Slots(NamedTuple):
    data: Any
    diagonal: Any
    off: Any


class SpringNodes:
    """The free nodes of a spring body, with damping (see `springs.implicit_kernels`).

        M |u - h v|² / (2 h²) + a M |u|² / (2 h) + b / (2 h) u^T K_n u + E(x + u) + D(x + u) - F . u

    and, with a limit of strains, that of the springs beyond their bound (see `springs.strain_limit`).

    Attributes:
        x, v: Positions [m] and velocities [m/s] of all nodes at the start of the step, shape (n, 3).
        base, width, held, bounded, yielding: See `Nodes`.
        weight: M/h² + a M/h of each node [N/m], shape (n,).
    """

    def __init__(
        self, system: SpringSystem, *, drag: float = 0.0, rayleigh: float = 0.0, bound: "Bound | None" = None
    ) -> None:
        """`drag`: a of the force -a M v [1/s]; `rayleigh`: b of the force -b K v [s]; `bound`: of strains."""
        body = system.body
        self._system, self._drag, self._rayleigh, self._bound = system, drag, rayleigh, bound
        self.bounded = bound is not None
        self.unknowns, self._free = system.unknowns, body.free
        sides = body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(
            -1, 2
        )  # a contact joins the corners of a triangle
        self.pattern, diagonal, off = system.pattern(sides)
        self._slots = _Slots(self.pattern.data, diagonal, off)
        self.base = np.where(system.number >= 0, 3 * system.number, -1)
        self.width, self.held = np.full(len(self.base), 3), self.base < 0
        self.yielding = self.unknowns
        n, m = len(body.nodes), len(body.ends)
        self.x, self.v, self._move, self._at, self._g = np.zeros((5, n, 3))
        self._blocks, self._lagged, self._reference = np.zeros((m, 6)), np.zeros((m, 6)), np.zeros(m)
        self.weight, self._inertia, self._h = np.zeros(n), np.zeros(n), 1.0
        self._rate = 0.0

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

    def velocity(self, out: FloatArray) -> None:
        """Write the velocities of free nodes."""
        out[:] = self.v[self._free].ravel()

    def give(self, out: FloatArray) -> None:
        """Write 1 / mass of each unknown, with its damping."""
        out[:] = np.repeat(1 / (self._h * self._h * self.weight[self._free]), 3)

    def exceeds(self, u: FloatArray) -> bool:
        """Return whether springs are longer than their bound after the moves `u`."""
        self._place(u)
        return self._bound is not None and self._bound.exceeded(self._at)

    def tighten(self) -> None:
        """Stiffen the bound of strains."""
        if self._bound:
            self._bound.harden()

    def settle(self, u: FloatArray) -> float:
        """Give the bound of strains the tensions that the moves `u` ask for; return the error: 1 is small enough."""
        self._place(u)
        return self._bound.settle(self._at) if self._bound else 0.0

    def finish(self, u: FloatArray, v: FloatArray, h: float, ends: FloatArray) -> None:
        """Let the moves be made."""
        self.x[:] = ends
        self.v[self._free] = v.reshape(-1, 3)

    def add_torques(self, forces: FloatArray) -> None:
        """There are no servos."""

    def begin(self, h: float) -> None:
        """Prepare a step of `h` [s] from `x` and `v`."""
        s = self._system
        self._h = h
        np.divide(s.mass, h * h, out=self._inertia)
        np.multiply(s.mass, self._drag / h, out=self.weight)
        self.weight += self._inertia
        self._rate = 1.0 / h if (s.body.damping > 0).any() else 0.0
        lengths(self.x, s.links, self._reference)
        if self._rayleigh:
            tangents(self.x, s.links, 0.0, self._reference, True, self._lagged)

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a step without forces."""
        u[:] = (self._h * self.v[self._free]).ravel()

    def _place(self, u: FloatArray) -> None:
        self._move[self._free] = u.reshape(-1, 3)
        np.add(self.x, self._move, out=self._at)

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential."""
        self._place(u)
        s, g, d = self._system, self._g, self._move
        np.multiply(self.v, self._h, out=g)
        np.subtract(d, g, out=g)
        phi = 0.5 * float(self._inertia @ np.einsum("ni,ni->n", g, g))
        g *= self._inertia[:, None]
        if self._drag:
            extra = self.weight - self._inertia
            phi += 0.5 * float(extra @ np.einsum("ni,ni->n", d, d))
            g += extra[:, None] * d
        g -= s.force
        phi -= float(np.vdot(s.force, d))
        phi += float(add_gradient(self._at, s.links, self._rate, self._reference, g))
        if self._rayleigh:
            phi += float(add_products(s.body.ends, self._lagged, d, self._rayleigh / self._h, g))
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
            self._blocks += (self._rayleigh / self._h) * self._lagged
        if self._bound:
            more = np.empty_like(self._blocks)
            tangents(self._at, self._bound.links, 0.0, self._reference, project, more)
            self._blocks += more
        assemble(s.body.ends, self._blocks, self.weight, s.body.free, s.number, self._slots)


class RigidBodies:
    """Rigid bodies under gravity: translation u_c and rotation vector u_r of each, in world.

        m |u_c - h v - h² g|² / (2 h²) + |u_r - h w + h² I^-1 (w x I w)|²_I / (2 h²)

    Attributes:
        mass: [kg], shape (b,).
        inertia: About the centre in the body's frame [kg m²], shape (b, 3, 3).
        centre, velocity, spin: [m], [m/s], [rad/s], in world, shape (b, 3).
        rotation: From the body's frame to world, shape (b, 3, 3).
    """

    def __init__(
        self, mass: FloatArray, inertia: FloatArray, centre: FloatArray, gravity: FloatArray
    ) -> None:
        """At rest, not turned; `gravity` [m/s²], shape (3,)."""
        b = len(mass)
        self.mass, self.inertia = np.array(mass, dtype=float), np.array(inertia, dtype=float).reshape(b, 3, 3)
        self.centre, self._gravity = (
            np.array(centre, dtype=float).reshape(b, 3),
            np.array(gravity, dtype=float),
        )
        self.velocity, self.spin = np.zeros((2, b, 3))
        self.rotation = np.tile(np.eye(3), (b, 1, 1))
        self.unknowns = self.yielding = 6 * b
        self._h = 1.0
        self._world, self._aim = np.zeros((b, 3, 3)), np.zeros((b, 6))
        rows = np.concatenate([np.arange(6 * k, 6 * k + j + 1) for k in range(b) for j in range(6)])
        indptr = np.concatenate([[0], np.cumsum(np.tile(np.arange(1, 7), b))])
        self.pattern = sparse.csc_matrix((np.ones(len(rows)), rows, indptr), shape=(6 * b, 6 * b))
        self._upper = np.array([(i, j) for j in range(6) for i in range(j + 1)]).T

    def load(self, state: RigidState) -> None:
        """Begin a step from `state`."""
        self.centre[:], self.rotation[:] = state.centres, state.rotations
        self.velocity[:], self.spin[:] = state.velocities, state.spins

    def store(self, state: RigidState) -> None:
        """Write where the bodies are now to `state`."""
        state.centres[:], state.rotations[:] = self.centre, self.rotation
        state.velocities[:], state.spins[:] = self.velocity, self.spin

    def begin(self, h: float) -> None:
        """Prepare a step of `h` [s]."""
        self._h = h
        for k, (R, w) in enumerate(zip(self.rotation, self.spin, strict=True)):
            I_w = self._world[k] = R @ self.inertia[k] @ R.T
            self._aim[k, :3] = h * self.velocity[k] + h * h * self._gravity
            self._aim[k, 3:] = h * w - h * h * np.linalg.solve(I_w, np.cross(w, I_w @ w))

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a step without contact."""
        u[:] = self._aim.ravel()

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential."""
        off = (u.reshape(-1, 6) - self._aim) / (self._h * self._h)
        force = np.empty_like(off)
        force[:, :3] = self.mass[:, None] * off[:, :3]
        force[:, 3:] = np.einsum("kij,kj->ki", self._world, off[:, 3:])
        out += force.ravel()
        return 0.5 * self._h * self._h * float(np.vdot(off, force))

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian, the same at any `u`, into `pattern.data`."""
        block = np.zeros((6, 6))
        for k in range(len(self.mass)):
            block[:3, :3], block[3:, 3:] = self.mass[k] * np.eye(3), self._world[k]
            self.pattern.data[21 * k : 21 * k + 21] = block[self._upper[0], self._upper[1]] / self._h**2

    def moved(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the centres (b, 3) and rotations (b, 3, 3) after the moves `u`."""
        moves = u.reshape(-1, 6)
        turned = [rotation_matrix(t) @ R for t, R in zip(moves[:, 3:], self.rotation, strict=True)]
        return self.centre + moves[:, :3], np.array(turned).reshape(-1, 3, 3)
