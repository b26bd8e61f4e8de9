"""Sets: which nodes, and of a solid which elements, the names of a scene mean."""

import difflib
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.sets import NodeSet, Vector

ALL = "all"
"""The set of all nodes, which no table has to define."""


class NodeSets:
    """The sets of all bodies."""

    def __init__(
        self,
        tables: tuple[NodeSet, ...],
        nodes: FloatArray,
        groups: Mapping[str, IndexArray],
        bodies: Mapping[str, IndexArray],
        regions: Collection[str] = (),
    ) -> None:
        """Find the nodes of each table. Raises SceneError if one holds none, or has the name of another.

        Args:
            tables: Of the scene.
            nodes: Undeformed [m], shape (n, 3).
            groups: Of the mesh files, by name.
            bodies: Nodes of each body, by name.
            regions: Names of the sets by which elements are chosen: those may hold no node.
        """
        self._nodes, self._groups, self._bodies = nodes, groups, bodies
        self._empty = dict[str, SceneError]()
        self._found = {ALL: np.arange(len(nodes))} | {
            name: np.asarray(group) for name, group in groups.items()
        }
        self._found |= self._bodies
        for i, table in enumerate(tables):
            if not table.name or table.name in self._found:
                raise SceneError(
                    f"set.{i}.name is {shown(table.name)}; it must differ from 'all' and from the names of other "
                    "sets, of bodies and of the groups of the mesh"
                )
            try:
                self._found[table.name] = self.inside(table, f"set.{i} ({table.name!r})")
            except SceneError as error:
                if table.name not in regions:
                    raise
                self._found[table.name], self._empty[table.name] = np.zeros(0, dtype=np.int64), error
        self._tables = {table.name: table for table in tables}

    def nodes(self, name: str, field: str) -> IndexArray:
        """Return the nodes of a set, ascending.

        Args:
            name: Of the set.
            field: Who asks, such as `load.0.set`, for messages.

        Raises:
            SceneError: there is no such set or group, or it holds no node.
        """
        self._check_known(name, field)
        if name in self._empty:
            raise self._empty[name]
        return self._found[name]

    def elements(
        self,
        name: str,
        field: str,
        blocks: Sequence[IndexArray],
        shares: Sequence[FloatArray],
        cell_groups: Mapping[str, IndexArray],
    ) -> IndexArray:
        """Return the elements of a solid that are in a set, ascending; there may be none.

        Of places those whose centroid is there, of a group of cells its cells, of a group of nodes, or of a body, those
        whose nodes are all in it.

        Args:
            name: Of the set.
            field: Who asks, for messages.
            blocks: Nodes of each element, shape (m, k), by the kinds of elements.
            shares: Of each node in the volume of its element, as `blocks`: they weigh the nodes in the centroid.
            cell_groups: Elements of groups of the mesh file, by the name that the group has here.

        Raises:
            SceneError: there is no such set or group.
        """
        self._check_known(name, field)

        def of(group: str) -> BoolArray:
            if group in cell_groups:
                return np.isin(np.arange(sum(map(len, blocks))), cell_groups[group])
            return np.concatenate([np.isin(nodes, self._found[group]).all(axis=1) for nodes in blocks])

        if not (table := self._tables.get(name)):
            return np.flatnonzero(of(name))
        places = [
            np.einsum("ek,eki->ei", own, self._nodes[nodes])
            for own, nodes in zip(shares, blocks, strict=True)
        ]
        chosen = _distance(table, np.concatenate(places)) <= table.tolerance
        for group in filter(None, (table.body, table.group)):
            chosen &= of(group)
        return np.flatnonzero(chosen)

    def _check_known(self, name: str, field: str) -> None:
        """Raise SceneError, which begins with `field`, if there is no set of that name."""
        if name not in self._found:
            near = difflib.get_close_matches(name, self._found, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            known = ", ".join(sorted(self._found))
            raise SceneError(f"{field} is {shown(name)}{hint}; sets and groups of the mesh: {known}")

    def held(self, name: str, low: Vector | None, high: Vector | None, field: str) -> IndexArray:
        """Return the nodes of a fixed region: of the set `name` or, if that is empty, in a box.

        Args:
            name: Of the set.
            low, high: Corners of the box [m], undeformed.
            field: Of the scene, which a SceneError names.
        """
        if name:
            return self.nodes(name, f"{field}.set")
        return self.inside(NodeSet(field, low=low, high=high), field)

    def inside(self, table: NodeSet, where: str, remedy: str = "move or enlarge the place") -> IndexArray:
        """Return the nodes of a table, ascending. Raises SceneError, from `where` to `remedy`, if there are none."""
        far = _distance(table, self._nodes)
        if table.body:
            if table.body not in self._bodies:
                known = ", ".join(self._bodies)
                raise SceneError(f"{where}: body is {shown(table.body)}; bodies: {known}")
            far[np.setdiff1d(np.arange(len(far)), self._bodies[table.body])] = np.inf
        if table.group:
            if table.group not in self._groups:
                known = ", ".join(sorted(self._groups)) or "none"
                raise SceneError(f"{where}: group is {shown(table.group)}; groups of the mesh: {known}")
            far[np.setdiff1d(np.arange(len(far)), self._groups[table.group])] = np.inf
        found = np.flatnonzero(far <= table.tolerance)
        if not found.size:
            low, high = (np.round(e, 4).tolist() for e in (self._nodes.min(axis=0), self._nodes.max(axis=0)))
            near = int(np.argmin(far))
            place = ", ".join(f"{c:.4g}" for c in self._nodes[near])
            raise SceneError(
                f"{where} holds no node of the body; the nearest is node {near} at ({place}) m, "
                f"{far[near]:.3g} m away. The body reaches from {low} to {high} m: {remedy}"
            )
        return found


def _distance(table: NodeSet, nodes: FloatArray) -> FloatArray:
    """Return how far each node is from meeting the table's places [m], shape (n,); 0 where it does."""
    far = np.zeros(len(nodes))
    if table.low is not None:
        far = np.maximum(far, np.linalg.norm(np.maximum(np.array(table.low) - nodes, 0.0), axis=1))
    if table.high is not None:
        far = np.maximum(far, np.linalg.norm(np.maximum(nodes - np.array(table.high), 0.0), axis=1))
    if table.radius is not None:
        arm = nodes - np.array(table.centre or (0.0, 0.0, 0.0))
        if table.axis is not None:
            axis = _unit(table.axis)
            arm = arm - np.outer(arm @ axis, axis)
        far = np.maximum(far, np.sqrt((arm**2).sum(axis=1)) - table.radius)
    if table.along is not None:
        distance = nodes @ _unit(table.along)
        if table.at is not None:
            far = np.maximum(far, np.abs(distance - table.at))
        if table.beyond is not None:
            far = np.maximum(far, table.beyond - distance)
        if table.below is not None:
            far = np.maximum(far, distance - table.below)
    return far


def _unit(direction: tuple[float, float, float]) -> FloatArray:
    vector = np.array(direction)
    return vector / np.linalg.norm(vector)
