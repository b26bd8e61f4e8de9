"""The rigid bodies of a scene: what they are, where they begin, where their surfaces are."""

import zlib
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes import Shape


class RigidSet:
    """Rigid bodies as a simulation has them.

    Attributes:
        shapes: Of the bodies.
        mass: [kg], shape (b,).
        inertia: About the centre in each body's frame [kg m²], shape (b, 3, 3).
        gravity: [m/s²], shape (3,).
        start: Where they begin.
        fields: How messages name them.
    """

    def __init__(
        self,
        shapes: list[Shape],
        mass: FloatArray,
        start: RigidMotion,
        gravity: FloatArray,
        fields: tuple[str, ...],
    ) -> None:
        self.shapes, self.mass, self.start, self.gravity, self.fields = shapes, mass, start, gravity, fields
        self.inertia = mass[:, None, None] * np.array([s.inertia for s in shapes])

    def bodies(self) -> RigidBodies:
        """Return what a step moves."""
        return RigidBodies(self.mass, self.inertia, self.start.centres, self.gravity)

    @property
    def parts(self) -> list[Part]:
        """The surfaces with which they touch, about their centres."""
        return [replace(s.part, name=field) for s, field in zip(self.shapes, self.fields, strict=True)]

    def placed(self, number: int, state: RigidMotion) -> Part:
        """Return the surface of one of them where it is."""
        part, turned = self.shapes[number].part, state.rotations[number]
        return replace(part, vertices=state.centres[number] + part.vertices @ turned.T)

    def vertices(self, state: RigidMotion) -> FloatArray:
        """Return where the vertices that show the bodies are [m], shape (k, 3)."""
        placed = [
            c + s.vertices @ R.T for s, c, R in zip(self.shapes, state.centres, state.rotations, strict=True)
        ]
        return np.concatenate(placed)

    @property
    def count(self) -> int:
        """Number of `vertices`."""
        return sum(len(s.vertices) for s in self.shapes)

    @cached_property
    def triangles(self) -> IndexArray:
        """Triangles of `vertices`, shape (t, 3)."""
        first = np.cumsum([0, *[len(s.vertices) for s in self.shapes]])
        return np.concatenate([s.triangles + k for s, k in zip(self.shapes, first, strict=False)])

    def below(self, state: RigidMotion, number: int, others: FloatArray) -> float:
        """Return how far body `number` is below all `others`, shape (k, 3), and bodies [m]; 0 without gravity."""
        size = float(np.linalg.norm(self.gravity))
        if not size:
            return 0.0
        bodies = np.repeat(np.arange(len(self.shapes)), [len(s.vertices) for s in self.shapes])
        depth, lowest = self.vertices(state) @ self.gravity, (others @ self.gravity).max(initial=-np.inf)
        lowest = depth[bodies != number].max(initial=lowest)
        return float(depth[bodies == number].min() - lowest) / size

    def energies(self, state: RigidMotion) -> tuple[FloatArray, FloatArray]:
        """Return kinetic energy and potential of gravity, zero at the start, of each body [J], shape (b,)."""
        turned = np.einsum("kji,kj->ki", state.rotations, state.spins)  # in the body's frame
        kinetic = 0.5 * self.mass * (state.velocities**2).sum(axis=1)
        kinetic += 0.5 * np.einsum("ki,kij,kj->k", turned, self.inertia, turned)
        fall = (state.centres - self.start.centres) @ self.gravity
        return kinetic, -self.mass * fall

    @cached_property
    def _arms(self) -> FloatArray:
        """Four points of equal mass that have the mass, centre and inertia of each body [m], shape (b, 4, 3).

        With J = tr(I) 1 / 2 - I = m V diag(s²) V^T they are V diag(s) t, t the corners of a tetrahedron.
        """
        moments = np.trace(self.inertia, axis1=1, axis2=2)[:, None, None] / 2 * np.eye(3) - self.inertia
        squares, axes = np.linalg.eigh(moments / self.mass[:, None, None])
        corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        return np.asarray(np.einsum("kij,kj,aj->kai", axes, np.sqrt(np.maximum(squares, 0.0)), corners))

    @property
    def point_mass(self) -> FloatArray:
        """Of the `points` [kg], shape (b, 4)."""
        return np.repeat(self.mass[:, None] / 4, 4, axis=1)

    def points(self, state: RigidMotion) -> FloatArray:
        """Return where four points are that have mass, centre and inertia of a body [m], shape (4 b, 3)."""
        turned = np.einsum("kij,kaj->kai", state.rotations, self._arms)
        return np.asarray((state.centres[:, None] + turned).reshape(-1, 3))


class JoinedMesh:
    """A soft body, if there is one, and rigid bodies behind it as one surface.

    Attributes:
        nodes: At the start [m], shape (n, 3): of the soft body, then vertices of the rigid ones.
        surface: Triangles, shape (t, 3).
        topology_id: CRC-32 of the connectivity.
        soft: The soft body; None for none.
    """

    def __init__(self, soft: Any, rigid: RigidSet) -> None:
        """`soft`: a mesh with nodes, elements, surface and topology_id, or None."""
        self.soft = soft
        solid = rigid.vertices(rigid.start)
        n = len(soft.nodes) if soft else 0
        self.nodes: FloatArray = np.concatenate([soft.nodes, solid]) if soft else solid
        faces = rigid.triangles + n
        self.surface: IndexArray = np.concatenate([soft.surface, faces]) if soft else faces
        self.topology_id = zlib.crc32(
            faces.astype("<i8").tobytes(), soft.topology_id if soft else zlib.crc32(bytes([0]))
        )

    @property
    def elements(self) -> IndexArray:
        """Of the soft body."""
        return self.soft.elements if self.soft else np.zeros((0, 3), dtype=np.int64)

    @property
    def count(self) -> int:
        """Number of elements of the soft body."""
        return int(self.soft.count) if self.soft else 0


class JoinedSkin(JoinedMesh):
    """A skin of the soft body with the rigid bodies behind it."""

    def __init__(self, skin: Any, count: int, rigid: RigidSet) -> None:
        """`skin`: of the soft body, which has `count` nodes."""
        super().__init__(skin, rigid)
        self._count = count

    def vertices(self, positions: FloatArray) -> FloatArray:
        """Return the vertices for positions of nodes and rigid vertices [m], a new array."""
        n = self._count
        return np.concatenate([self.soft.vertices(positions[:n]), positions[n:]])
