"""Rigid bodies in contact: the potential of an implicit stage in their moves."""

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.constraints.reduction import move_bodies
from tripod_sim.contact import rigid_kernels as kernels
from tripod_sim.contact.bodies import Body
from tripod_sim.contact.group_kernels import add_residual
from tripod_sim.forces.term import Term
from tripod_sim.integrators.history import History
from tripod_sim.integrators.scheme import Stage
from tripod_sim.mesh.surfaces import Part
from tripod_sim.state import State


class RigidBodies(Body):
    """Rigid bodies under gravity: translation u_c and rotation vector u_r of each, in world.

        m |u_c - w_c - s (v_0 + s_f g)|² / (2 s s_f) + |u_r - t|²_I / (2 s s_f)

    with w = z - x and v_0 as the stage looks back (see `integrators.scheme`). What a scheme does to velocities it
    does to the angular momentum, of which it knows L_0: t = w_r + s I'^-1 L_0, with I' that of the body turned by t.
    Without a torque it stays what it is, however fast the body tumbles. Rotation vectors are about the pose at the
    start of the stage; that the spin is not quite their derivative there is an error of the second order over a motion.
    I is I', too; but in a stage that looks back on nothing, and may be a hit, it is that at its start, as the arms of
    contacts are, and the spin that of the turn, as the contacts ask for.

    Terms of the system that act on rigid bodies (`Term.acts_on_rigid`) add to this.

    Attributes:
        terms: Of the system.
        mass: [kg], shape (b,).
        inertia: About the centre in the body's frame [kg m²], shape (b, 3, 3).
        centre, velocity, spin: [m], [m/s], [rad/s], in world, shape (b, 3).
        rotation: From the body's frame to world, shape (b, 3, 3).
        given, reach, base, width, held, looked_back: See `Body`.
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
        self.unknowns, self.given = 6 * b, np.zeros(0, dtype=np.int64)
        self.reach = np.ones(6 * b)  # until their surfaces are known
        self._first, self._shape, self._arm = np.zeros(1, dtype=np.int64), *np.zeros((2, 0, 3))
        self._stage = Stage(1.0, 1.0)
        self._inverse = np.linalg.inv(self.inertia)
        self._world, self._aim, self._way, self._known = np.zeros((b, 3, 3)), *np.zeros((3, b, 6))
        self._momentum, self._moved = np.zeros((2, b, 6))  # velocity and L; moves of the last stage
        self._history = History((b, 6), slice(0, b))
        self._curve = np.zeros((b, 6))  # b of positions and turns
        self._untouched = np.zeros((b, 3))  # spin after the stage of a body that nothing touches
        self.terms: list[Term] = []
        rows = np.concatenate([np.arange(6 * k, 6 * k + j + 1) for k in range(b) for j in range(6)])
        indptr = np.concatenate([[0], np.cumsum(np.tile(np.arange(1, 7), b))])
        self.pattern = sparse.csc_matrix((np.ones(len(rows)), rows, indptr), shape=(6 * b, 6 * b))
        self._upper = np.array([(i, j) for j in range(6) for i in range(j + 1)]).T

    def bound_by(self, parts: list[Part]) -> None:
        """Take the surface of each body, its vertices about the centre."""
        counts = [len(part.vertices) for part in parts]
        self._first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._shape = np.concatenate([part.vertices for part in parts])
        self._arm = np.empty_like(self._shape)
        self.base = np.repeat(6 * np.arange(len(parts)), counts)
        self.width, self.held = np.full(len(self.base), 6), np.zeros((len(self.base), 3), dtype=bool)
        self.reach.reshape(-1, 6)[:, 3:] = np.array([part.reach for part in parts])[:, None]

    def owners(self) -> IndexArray:
        """Return the body of each vertex, shape (k,)."""
        return self.base // 6

    @property
    def motion(self) -> RigidMotion:
        """Present poses and velocities: views."""
        return RigidMotion(self.centre, self.rotation, self.velocity, self.spin)

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step from `state`."""
        for own, given in zip(self.motion, state.rigid, strict=True):
            own[:] = given

    def store(self, state: State) -> None:
        """Write where the bodies are now to `state`."""
        for of, own in zip(state.rigid, self.motion, strict=True):
            of[:] = own

    def past(self) -> tuple[FloatArray, ...]:
        """Return what the next stage may look back on."""
        return self._moved, self._curve, *self._history.arrays()

    def stop(self) -> None:
        """Take all velocities and spins."""
        self.velocity[:], self.spin[:] = 0.0, 0.0

    def begin(self, stage: Stage) -> None:
        """Prepare a stage from the present poses and velocities."""
        self._stage, s = stage, stage.s
        now, way = self._momentum, self._way
        now[:, :3] = self.velocity
        kernels.carry(self.inertia, self.rotation, self.spin, now[:, 3:])
        way[:] = 0.0
        if not stage.begins:
            of = stage.position
            way += of.change * self._moved
            way[:, :3] += of.rate * self.velocity
            way[:, 3:] += of.rate * self.spin
            if of.curve:
                way += of.curve * self._curve
        self._history.known(now, stage, self._known)
        self._aim[:, :3] = way[:, :3] + s * self._known[:, :3] + stage.square * self._gravity
        L, turn, there = self._known[:, 3:], self._aim[:, 3:], np.empty_like(self.rotation)
        kernels.turn_freely(way[:, 3:], s, self.spin, L, self._inverse, self.rotation, turn, there)
        kernels.carry(self._inverse, there, L, self._untouched)
        kernels.tensors_in_world(self.inertia, self.rotation if stage.begins else there, self._world)

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a stage without contact."""
        u[:] = self._aim.ravel()

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` to `out`; return the potential."""
        phi = float(kernels.add_inertia(u, self._aim, self.mass, self._world, self._stage.square, out))
        for term in self.terms:
            if term.acts_on_rigid:
                per_turn = np.zeros_like(self._aim)
                phi += term.add_rigid_gradient(self._after(u), self._stage.s, per_turn)
                add_residual(per_turn.ravel(), 0, u, out)
        return phi

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian, of inertia the same at any `u`, into `pattern.data`."""
        blocks = np.zeros((len(self.mass), 6, 6))
        blocks[:, :3, :3], blocks[:, 3:, 3:] = self.mass[:, None, None] * np.eye(3), self._world
        blocks /= self._stage.square
        for term in self.terms:
            if term.acts_on_rigid:
                term.add_rigid_stiffness(self._after(u), self._stage.s, blocks)
        self.pattern.data[:] = blocks[:, self._upper[0], self._upper[1]].ravel()

    def rate_at_start(self, out: FloatArray) -> None:
        """Write velocities and spins."""
        out[:] = np.hstack([self.velocity, self.spin]).ravel()

    def free_rate(self, out: FloatArray) -> None:
        """Write velocities, and the spins after the turn of a body that keeps its angular momentum."""
        out[:] = np.hstack([self.velocity, self._untouched]).ravel()

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write those after the moves `u`."""
        out[:] = (u - self._way.ravel()) / self._stage.s

    def inverse_mass(self, out: FloatArray) -> None:
        """Write 1 / mass and the inverse inertia in world of each body."""
        out[0::2] = np.eye(3) / self.mass[:, None, None]
        kernels.tensors_in_world(self._inverse, self.rotation, out[1::2])

    def _after(self, u: FloatArray) -> RigidMotion:
        """Return poses and velocities after the moves `u`."""
        rate = np.empty(self.unknowns)
        self.rate_at_end(u, rate)
        return RigidMotion(*self.moved(u), *np.split(rate.reshape(-1, 6), 2, axis=1))

    def finish(self, u: FloatArray) -> None:
        """Let the moves `u` be made."""
        momentum, start = np.empty_like(self._known), np.hstack([self.velocity, self.spin])
        self.rate_at_end(u, momentum.ravel())
        momentum[:, 3:] = np.einsum("kij,kj->ki", self._world, momentum[:, 3:])
        self.centre, self.rotation = self.moved(u)
        self.velocity[:] = momentum[:, :3]
        if self._stage.begins:
            self.spin[:] = self._untouched + (u.reshape(-1, 6) - self._aim)[:, 3:] / self._stage.s
            kernels.carry(self.inertia, self.rotation, self.spin, momentum[:, 3:])
        else:
            kernels.carry(self._inverse, self.rotation, momentum[:, 3:], self.spin)
        if self.looked_back:
            self._moved[:] = u.reshape(-1, 6)
            self._history.note(self._momentum, self._known, momentum, self._stage)
            self._bend(start)

    def _bend(self, start: FloatArray) -> None:
        """Write b of a stage that has been made, of velocities and spins `start` [m/s, rad/s], shape (b, 6)."""
        stage = self._stage
        if not stage.curves:
            return
        end = np.hstack([self.velocity, self.spin])
        if stage.begins:
            self._curve[:] = (end - start) / stage.s
            return
        by = stage.curves[0]
        self._curve[:] = by.change * self._moved + by.rate * end + by.before * start + by.curve * self._curve
        self._curve[:, :3] = self._history.curve[:, :3]

    def add_velocity(self, change: FloatArray) -> None:
        """Add to velocities and spins."""
        self.velocity += change.reshape(-1, 6)[:, :3]
        self.spin += change.reshape(-1, 6)[:, 3:]

    def moved(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the centres (b, 3) and rotations (b, 3, 3) after the moves `u`."""
        centres, rotations = np.empty_like(self.centre), np.empty_like(self.rotation)
        move_bodies(self.centre, self.rotation, 1.0, u, 0, centres, rotations)
        return centres, rotations

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write where the vertices are now, and their arms."""
        kernels.vertices(self._first, self._shape, self.centre, self.rotation, arm, positions)

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where they are after the moves `u`."""
        kernels.vertices(self._first, self._shape, *self.moved(u), self._arm, out)
