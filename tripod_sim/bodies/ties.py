"""Ties: nodes of two bodies that are one node, so that they share their unknowns: exact, no spring, no multiplier."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tripod_host.arrays import IndexArray
from tripod_sim.bodies.assembly import Assembly, SoftBody
from tripod_sim.errors import SceneError
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.mesh.topology import parts
from tripod_sim.tables.bodies import Tie


def tied(assembly: Assembly, ties: Sequence[Tie], sets: NodeSets) -> Assembly:
    """Return the bodies with each node of a tie's set and the nearest one of its other set counted once.

    The place is that of the earlier body. Raises SceneError where nodes are too far apart, or a tie ties none.
    """
    count = len(assembly.nodes)
    owner = np.empty(count, dtype=np.int64)
    for k, body in enumerate(assembly.bodies):
        owner[body.nodes] = k
    pairs = list[IndexArray]()
    for i, tie in enumerate(ties):
        one, other = sets.nodes(tie.set, f"tie.{i}.set"), sets.nodes(tie.to, f"tie.{i}.to")
        partner = _partners(assembly, one, other, i, tie)
        if (within := owner[one] == owner[partner]).any():
            names = names_of(one[within])
            raise SceneError(
                f"tie.{i} ties nodes {names} of {assembly.bodies[owner[one[within][0]]].table.name!r} to the "
                "same body; name sets of two bodies"
            )
        pairs.append(np.column_stack([one, partner]))
    connected = parts([owner[pair] for pair in pairs], len(assembly.bodies))
    kept, number = np.unique(parts(pairs, count), return_inverse=True)
    number = number.ravel()
    assert len(kept)
    nodes = assembly.nodes[kept]
    bodies = []
    for k, body in enumerate(assembly.bodies):
        own = number[body.nodes]
        if len(np.unique(own)) < len(own):
            raise SceneError(
                f"ties join several nodes of body {body.table.name!r} into one; tie each to another node, or "
                "make the meshes fit"
            )
        bodies.append(replace(body, nodes=own, tied=int(connected[k])))
    return Assembly([_moved(body, nodes) for body in bodies])


def _moved(body: SoftBody, nodes: "np.ndarray") -> SoftBody:
    """Return the body where `nodes` has it, as it is where nothing moves."""
    return body if np.array_equal(nodes[body.nodes], body.mesh.nodes) else body.moved(nodes)


def _partners(assembly: Assembly, one: IndexArray, other: IndexArray, i: int, tie: Tie) -> IndexArray:
    """Return the nearest node of `other` for each of `one`. Raises SceneError where one is too far."""
    apart, nearest = cKDTree(assembly.nodes[other]).query(assembly.nodes[one])
    far = np.flatnonzero(apart > tie.within)
    if far.size:
        worst = far[np.argmax(apart[far])]
        place = ", ".join(f"{1e3 * c:.3g}" for c in assembly.nodes[one[worst]])
        raise SceneError(
            f"tie.{i}: {len(far)} of {len(one)} nodes of {tie.set!r} are too far from {tie.to!r}, the "
            f"worst at ({place}) mm by {1000.0 * apart[worst]:.3g} mm; tie.{i}.within allows "
            f"{1000.0 * tie.within:.3g} mm: move a body, name a smaller set, or set a larger within"
        )
    return other[nearest]
