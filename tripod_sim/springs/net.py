"""Table to a net of springs, before anything of the scene holds it."""

from array import array
from pathlib import Path

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.generate import MOST_NODES, Net, chain, grid, net_of_surface
from tripod_sim.tables.bodies import Springs


def spring_net(description: Springs) -> SpringBody:
    """Return the body that `description` describes. Raises SceneError."""
    net = _net(description)
    nodes = net.nodes + np.array(description.position)
    kinds = [
        (net.structural, description.stiffness),
        (net.shear, description.shear),
        (net.bending, description.bending),
    ]
    kept = [kinds[0]] + [(pairs, k) for pairs, k in kinds[1:] if k > 0]
    ends = np.sort(np.concatenate([pairs for pairs, _ in kept]), axis=1)
    stiffness = np.concatenate([np.full(len(pairs), k) for pairs, k in kept])
    order = np.lexsort((ends[:, 1], ends[:, 0]))  # neighbours in memory
    ends, stiffness = ends[order], stiffness[order]
    length = np.sqrt(((nodes[ends[:, 1]] - nodes[ends[:, 0]]) ** 2).sum(axis=1))
    return SpringBody(
        nodes,
        ends,
        description.rest * length,
        stiffness,
        np.full(len(ends), description.damping),
        np.full(len(nodes), description.node_mass),
        _fixed(description, net),
        description.compressed == "slack",
        net.triangles,
    )


def _net(description: Springs) -> Net:
    if description.source == "chain":
        return chain(description.nodes, description.size)
    if description.source == "grid":
        return grid(description.nodes, description.size)
    if "." in description.source:
        from tripod_sim.mesh.read_surface import read_surface  # noqa: PLC0415 - only where a file is named

        owner = array("q")
        most = 2 * MOST_NODES  # a surface of triangles has about half as many nodes
        surface = read_surface(Path(description.source), description.scale, "springs.source", owner, most)
        return net_of_surface(surface, np.array(owner, dtype=np.int64) if owner else None)
    raise SceneError(
        f"springs.source is {description.source!r}; allowed: chain, grid, or the path of an OBJ or STL file"
    )


def _fixed(description: Springs, net: Net) -> IndexArray:
    """Return the nodes that never move. Raises SceneError, naming those that do not exist."""
    count, named = len(net.nodes), np.array(description.fixed_nodes, dtype=np.int64)
    if (bad := named[named >= count]).size:
        raise SceneError(
            f"springs.fixed_nodes: {names_of(bad)} do not exist; the body has nodes 0 to {count - 1}"
        )
    corners = np.array(description.fixed_corners, dtype=np.int64)
    if (bad := corners[corners >= len(net.corners)]).size:
        have = (
            f"corners 0 to {len(net.corners) - 1}"
            if len(net.corners)
            else "no corners; use springs.fixed_nodes"
        )
        raise SceneError(
            f"springs.fixed_corners: {names_of(bad)} do not exist; {description.source} has {have}"
        )
    fixed = np.unique(np.concatenate([named, net.corners[corners]]))
    if len(fixed) == count:
        raise SceneError("springs: every node is fixed, so nothing can move; fix fewer nodes")
    return fixed
