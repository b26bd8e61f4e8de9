"""The soft bodies of a scene where they begin, their nodes in one numbering, those that are tied counted once."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError, shown
from tripod_sim.mesh.embedding import Embedding, in_net, in_solid
from tripod_sim.mesh.solid_mesh import Block, SolidMesh
from tripod_sim.tables.bodies import Body

if TYPE_CHECKING:  # a kind of body that is absent is not imported
    from tripod_sim.springs.body import SpringBody


@dataclass(frozen=True, eq=False)
class SoftBody:
    """One of them.

    Attributes:
        table: What describes it.
        field: How messages name that.
        nodes: The number of each of its nodes among those of all bodies, shape (n,).
        tied: The smallest number of a body with which it is tied, its own if there is none.
        solid: Its mesh where it begins; None of a net.
        net: Its springs where they begin; None of a solid.
    """

    table: Body
    field: str
    nodes: IndexArray
    tied: int
    solid: SolidMesh | None = None
    net: "SpringBody | None" = None

    @property
    def mesh(self) -> "SolidMesh | SpringBody":
        """Its mesh or its springs."""
        found = self.solid or self.net
        assert found
        return found

    @property
    def blocks(self) -> tuple[IndexArray, ...]:
        """Its elements, those of each kind by themselves, or its springs, in the numbering of all bodies."""
        if self.solid:
            return tuple(self.nodes[block.elements] for block in self.solid.blocks)
        assert self.net
        return (self.nodes[self.net.ends],)

    def among(self, nodes: FloatArray) -> SolidMesh:
        """Return the mesh of a solid in the numbering of all bodies, whose `nodes` are given [m], shape (n, 3)."""
        assert self.solid
        kinds = [block.kind for block in self.solid.blocks]
        return SolidMesh(nodes, tuple(map(Block, kinds, self.blocks)), notes=self.solid.notes)

    def embedded(self, points: FloatArray, nodes: FloatArray, name: str) -> Embedding:
        """Return points of the body.

        Args:
            points: Undeformed, in the frame of the body [m], shape (k, 3).
            nodes: Undeformed positions of the nodes of all bodies [m], shape (n, 3).
            name: Of the points, for messages.

        Raises:
            SceneError: a point is outside of the body.
        """
        position, turn = self.table.pose
        places = points @ turn.T + position
        if self.solid:
            return in_solid(places, self.among(nodes), name=name)
        return in_net(places, nodes, self.nodes, name=name)

    def moved(self, nodes: FloatArray) -> "SoftBody":
        """Return it with the places of its nodes taken from those of all bodies [m], shape (n, 3)."""
        return self.placed(nodes[self.nodes])

    def placed(self, nodes: FloatArray) -> "SoftBody":
        """Return it as if it had been made with these nodes [m]: springs keep the ratio of rest length to length."""
        if self.solid:
            return replace(self, solid=replace(self.solid, nodes=nodes))
        net = self.net
        assert net
        before, after = (
            np.linalg.norm(x[net.ends[:, 1]] - x[net.ends[:, 0]], axis=1) for x in (net.nodes, nodes)
        )
        ratio = np.divide(after, before, out=np.ones_like(before), where=before > 0)
        return replace(self, net=replace(net, nodes=nodes, rest_length=net.rest_length * ratio))


class Assembly:
    """All of them: what a simulation shows as one mesh.

    Attributes:
        bodies: In the order of the scene.
        nodes: Undeformed positions [m], shape (n, 3).
    """

    def __init__(self, bodies: Sequence[SoftBody]) -> None:
        self.bodies = tuple(bodies)
        self.nodes = np.empty((max((1 + int(b.nodes.max()) for b in bodies), default=0), 3))
        for body in reversed(self.bodies):  # tied nodes stand where the earlier body has them
            self.nodes[body.nodes] = body.mesh.nodes

    @property
    def named(self) -> Mapping[str, IndexArray]:
        """Nodes of each body, by its name."""
        return {b.table.name: b.nodes for b in self.bodies}

    @property
    def groups(self) -> Mapping[str, IndexArray]:
        """Nodes of the groups of mesh files: of a first body by the group's name, of others by `body:group`."""
        return {
            f"{self.before(body)}{name}": body.nodes[group]
            for body in self.bodies
            if body.solid
            for name, group in body.solid.groups.items()
        }

    def before(self, body: SoftBody) -> str:
        """Return what stands before the names of the groups of a body: nothing for the first."""
        return "" if body is self.bodies[0] else f"{body.table.name}:"

    def body_named(self, name: str, field: str, others: str = "") -> SoftBody:
        """Return a body by its name, the first one for an empty name.

        Args:
            name: Of the body.
            field: Where a scene names it, for the message.
            others: What else could stand there, for the message.

        Raises:
            SceneError: there is no such body.
        """
        known = {body.table.name: body for body in self.bodies}
        if name not in known and (name or not known):
            also = f"; {others}" if others else ""
            raise SceneError(f"{field} is {shown(name)}; bodies: {', '.join(known) or 'none'}{also}")
        return known[name] if name else self.bodies[0]

    @cached_property
    def elements(self) -> IndexArray:
        """Nodes of each element and spring, -1 behind those of elements that have fewer than others, shape (m, k)."""
        blocks = [block for body in self.bodies for block in body.blocks]
        widest = max(b.shape[1] for b in blocks)
        return np.concatenate(
            [np.pad(b, ((0, 0), (0, widest - b.shape[1])), constant_values=-1) for b in blocks]
        )

    @property
    def count(self) -> int:
        """Number of elements and springs."""
        return sum(body.mesh.count for body in self.bodies)

    @cached_property
    def surface(self) -> IndexArray:
        """Triangles, shape (k, 3)."""
        return np.concatenate([b.nodes[b.mesh.surface] for b in self.bodies])

    @cached_property
    def topology_id(self) -> int:
        """CRC-32 of the connectivity."""
        found = 0
        for body in self.bodies:
            ids = np.array([body.mesh.topology_id, *body.nodes])
            found = zlib.crc32(ids.astype("<i8").tobytes(), found)
        return found

    def moved(self, change: Callable[[SoftBody], FloatArray]) -> "Assembly":
        """Return the bodies, each moved as a whole by what `change` says of it [m], shape (3,)."""
        nodes = self.nodes.copy()
        for body in self.bodies:
            nodes[body.nodes] = self.nodes[body.nodes] + change(body)
        return Assembly([body.moved(nodes) for body in self.bodies])


class AssemblySkin:
    """What shows bodies of which some have no surface: chains as `ChainSkin`, others as they are.

    Attributes:
        nodes, surface, topology_id: Of what is shown.
        counts: How many of the nodes belong to each body.
    """

    def __init__(self, assembly: Assembly) -> None:
        from tripod_sim.springs.skin import ChainSkin  # noqa: PLC0415 - only with springs

        self._parts: list[tuple[IndexArray, ChainSkin | None]] = []
        nodes, faces, first, found = [], [], 0, assembly.topology_id
        for body in assembly.bodies:
            skin = ChainSkin(body.net) if body.net and not len(body.net.triangles) else None
            self._parts.append((body.nodes, skin))
            shown = skin or body.mesh
            nodes.append(shown.nodes)
            faces.append(shown.surface + first)
            first += len(shown.nodes)
            found = zlib.crc32(faces[-1].astype("<i8").tobytes(), found)
        self.nodes, self.surface, self.topology_id = np.concatenate(nodes), np.concatenate(faces), found
        self.counts = tuple(len(n) for n in nodes)

    def vertices(self, positions: FloatArray) -> FloatArray:
        """Return where its nodes are [m] for positions of those of all bodies, shape (n, 3), a new array."""
        own = [(positions[nodes], skin) for nodes, skin in self._parts]
        return np.concatenate([skin.vertices(x) if skin else x for x, skin in own])
