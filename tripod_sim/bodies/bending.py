"""Estimate the error of linear elements in bending before anything is simulated, from mesh and Poisson's ratio alone.

A body bends as its softest vibrations do. The inertial forces F of a few softest modes of the free mesh are applied to
it, and to quadratic elements on the same cells, which represent bending and do not lock. With K and K' the stiffness of
these, the compliances are

    C = F^T K^-1 F,     C' = F^T K'^-1 F.

The eigenvectors d of C' are the motions in which the body is soft. The mesh errs by 1 - (d . C d) / (d . C' d) in each,
relative to its deflection. What C has off the diagonal is motion sideways, of meshes whose elements lean to one side.
The errors grow as the cells across the body become few, and as nu comes close to 0.5 (volumetric locking).

The deflection under a load is a mixture of the softest motions. Where their errors agree, this is its error. Else the
least of them is exceeded. benchmarks/coarse_meshes.py compares this with bodies that hang under their weight.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element, node_volumes
from tripod_sim.forces.solid import Solid
from tripod_sim.linear.ldl import Ldl
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import vector
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh

MODES, ROUNDS = 4, 15
"""Softest modes that are sought, and steps of the inverse iteration that seeks them."""

SOFT = 0.3
"""Compliance of a motion over that of the softest, above which loads move a body in that motion, too."""

AGREE = 1.3
"""Ratio of errors up to which they agree."""

MOST_NODES = {"t10": 8000, "h20_full": 4000}
"""Nodes of the quadratic elements up to which a mesh is examined: their factorisation takes a second or two then."""

RIGID = 1e-9
"""Added to the diagonal against rigid motions, as a fraction of its largest entry."""


class Bending(NamedTuple):
    """Errors of the deflections of a mesh, relative; positive where the mesh deflects too little.

    Attributes:
        softest: Of the softest motion.
        low, high: Least and largest of those of all soft motions.
        sideways: Motion across the softest one that quadratic elements do not show, relative to it.
        sure: Whether any load causes about the error `softest`; else it depends on the direction of the load.
    """

    softest: float
    low: float
    high: float
    sideways: float
    sure: bool


def bending(mesh: SolidMesh, poisson: float) -> Bending | None:
    """Return the errors of a mesh of linear elements, None if that is not known: it is too large, or its elements are
    not of one kind with a quadratic one on the same cells; `poisson`: nu of its material."""
    if len(mesh.blocks) > 1 or not mesh.kind.quadratic:
        return None
    if len((rich := _quadratic(mesh)).nodes) > MOST_NODES[rich.kind.name]:
        return None
    return _bending(mesh.kind, mesh.nodes.tobytes(), mesh.elements.tobytes(), poisson)


def _quadratic(mesh: SolidMesh) -> SolidMesh:
    """Return the mesh of quadratic elements on the same cells, whose first nodes are those of `mesh`."""
    rich = ELEMENTS[mesh.kind.quadratic]
    return convert(SolidMesh.of(mesh.nodes, mesh.elements, mesh.kind.plain), rich.full or rich.name)


@lru_cache(maxsize=8)
def _bending(kind: Element, of_nodes: bytes, of_elements: bytes, poisson: float) -> Bending:
    """Compute it for nodes (n, 3) [m] and elements (m, k); the cache serves scenes that are built often."""
    elements = np.frombuffer(of_elements, dtype=np.int64).reshape(-1, kind.size)
    mesh = SolidMesh.of(np.frombuffer(of_nodes).reshape(-1, 3), elements, kind)
    size, stiffness = mesh.nodes.size, _factored(mesh, poisson)
    mass = np.zeros(len(mesh.nodes))
    np.add.at(mass, mesh.elements, node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0])
    mass = np.repeat(mass, 3)
    modes = _softest(stiffness, mesh.nodes, mass)
    forces = np.zeros((3 * len((rich := _quadratic(mesh)).nodes), modes.shape[1]))
    forces[:size] = mass[:, None] * modes
    own = forces[:size].T @ stiffness.solve_many(forces[:size].copy())
    right = forces.T @ _factored(rich, poisson).solve_many(forces)
    compliances, motions = linalg.eigh((right + right.T) / 2, modes.T @ forces[:size])
    own, compliances = (motions.T @ own @ motions)[::-1, ::-1], compliances[::-1]  # the softest first
    soft = compliances > SOFT * compliances[0]
    errors = (1 - np.diag(own) / compliances)[soft]
    sideways = float(np.linalg.norm(own[0, 1:]) / own[0, 0])
    low, high = float(errors.min()), float(errors.max())
    sure = max(abs(low), abs(high)) <= AGREE * min(abs(low), abs(high)) and low * high > 0
    return Bending(float(errors[0]), low, high, sideways, sure)


def _softest(stiffness: Ldl, nodes: FloatArray, mass: FloatArray) -> FloatArray:
    """Return the softest motions of a free body by inverse iteration, free of rigid motions, shape (3n, modes).

    Args:
        stiffness: Factored.
        nodes: [m], shape (n, 3).
        mass: Of each coordinate, shape (3n,).
    """
    arms, rigid = nodes - nodes.mean(axis=0), np.zeros((nodes.size, 6))
    for i, axis in enumerate(np.eye(3)):
        rigid[:, i], rigid[:, 3 + i] = np.tile(axis, len(nodes)), np.cross(axis, arms).ravel()
    rigid = linalg.qr(np.sqrt(mass)[:, None] * rigid, mode="economic")[0]
    count = min(MODES, nodes.size - 6)
    motions = np.random.default_rng(1).standard_normal((nodes.size, count))
    scale = np.sqrt(mass)[:, None]
    for _ in range(ROUNDS):
        motions = scale * stiffness.solve_many(np.ascontiguousarray(scale * motions))
        motions -= rigid @ (rigid.T @ motions)
        motions = linalg.qr(motions, mode="economic")[0]
    return np.asarray(motions / scale)


def _factored(mesh: SolidMesh, poisson: float) -> Ldl:
    """Return the factored stiffness of a free mesh, E = 1 Pa."""
    law = "neo_hooke"  # any: their tangents agree in the undeformed shape
    solid = Solid(mesh.nodes, mesh.elements, mesh.kind, law, vector(law, *lame_constants(1.0, poisson)))
    solid.stiffness(mesh.nodes, solid.rest_modes(), project=False)
    found = Ldl(_upper(solid.matrices, mesh.elements, len(mesh.nodes)))
    found.factor()
    return found


def _upper(matrices: FloatArray, elements: IndexArray, count: int) -> sparse.csc_matrix:
    """Return the upper triangle of the stiffness of `count` nodes, with `RIGID` on its diagonal."""
    dofs = (3 * elements[:, :, None] + np.arange(3)).reshape(len(elements), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    upper = rows <= columns
    found = sparse.csc_matrix((matrices[upper], (rows[upper], columns[upper])), (3 * count,) * 2)
    return found + sparse.identity(3 * count, format="csc") * (RIGID * found.diagonal().max())
