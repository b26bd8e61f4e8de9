"""How much too stiffly the cells of a mesh bend because of their shape.

Eight-node hexahedra with incompatible modes bend exactly as long as they are parallelepipeds. On a trapezoid no element
of eight nodes can that keeps even strains exact [MacNeal1987]: its nodes follow a bent beam, its strains do not. A cell
tells by itself how much so. Its nodes are put where beam theory's bending moves them,

    u = s t e_s - 1/2 s² e_t,

s along one of its axes and t across it, from its centroid; the excess of its energy over the right one is

    e = U_cell / (1/2 E int t² dV) - 1.

A cell in a beam relaxes a little, which `RELAXED` stands for, and of n cells one upon the other each has 1/n² of the
bending for itself, the rest being stretched, which is exact: the beam is stiffer by the factor 1 + x,
x = e / (1 + e / RELAXED) / n². The cells along a beam are springs in a row: what bends is their mean of 1 / (1 + x).
benchmarks/trapezoids.py holds that against beams: it is right to a few percent of the deflection where cells are as
long as they are thick, or longer, and tells too much where they are shorter.

Four-node tetrahedra have one strain each, so they are too stiff by what they leave out of bending whatever their shape.
Of a cell that is moved so about its own centroid the energy U_cell - 1/2 E int t² dV is too much, and what the body
should have is 1/2 E V h²/12, h its thickness along t: the mean chord V / (1/2 int |n . t| dA). The quotient of the two
sums is x, for the worst of the principal axes of the surface's normals. nu is left out, which adds to it.
"""

from functools import lru_cache

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.element import Element, reference_gradients
from tripod_sim.elements.hexahedron import FACES
from tripod_sim.elements.strains import strain_squares
from tripod_sim.mesh.solid_mesh import SolidMesh

RELAXED = 16.0
"""Excess that the cells of a beam halve by moving otherwise than it; fitted by benchmarks/trapezoids.py."""

MOST_LAYERS = 32
"""Cells one upon the other that are counted; a thousandth of the excess is left then."""

AXES = ((5, 3), (2, 4), (0, 1))
"""The two faces across each local axis, as places in `FACES`."""

CHUNK = 4096
"""Cells looked at at a time."""


def deflection_share(mesh: SolidMesh) -> float:
    """Return what share of its deflection a body shows: the mean over the volume of each cell's 1 / (1 + x).

    Each cell counts in the direction in which it bends worst.

    Args:
        mesh: Of eight-node hexahedra, plain or with modes.
    """
    return _share(mesh.kind, mesh.nodes.tobytes(), mesh.elements.tobytes())


@lru_cache(maxsize=8)
def _share(kind: Element, of_nodes: bytes, of_elements: bytes) -> float:
    """Return it for nodes (n, 3) [m] and elements (m, 8): whoever builds one mesh often, asks once."""
    every = np.frombuffer(of_nodes).reshape(-1, 3)
    mesh = SolidMesh(every, np.frombuffer(of_elements, dtype=np.int64).reshape(-1, 8), kind)
    layers = stacked(mesh)
    share = volume = 0.0
    for start in range(0, len(layers), CHUNK):
        count, nodes = layers[start : start + CHUNK], mesh.nodes[mesh.elements[start : start + CHUNK]]
        excess, size = bending_excess(mesh.kind, nodes)
        excess = np.maximum(excess, 0.0)
        x = excess / (1 + excess / RELAXED) / count[:, None] ** 2
        share += float(size @ (1 / (1 + x.max(axis=(1, 2)))))
        volume += float(size.sum())
    return share / volume


def tetrahedra_share(mesh: SolidMesh) -> float:
    """Return what share of its bending a body of four-node tetrahedra shows: 1 / (1 + x)."""
    corners, nodes = mesh.nodes[mesh.surface], mesh.nodes[mesh.elements]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    spread = normals.T @ (normals / np.linalg.norm(normals, axis=1, keepdims=True))
    axes = np.linalg.eigh(np.round(spread / np.trace(spread), 3))[1].T  # alike along two: the mesh's own
    gradients, volumes = reference_gradients(mesh.kind, nodes)
    size = volumes[:, 0]
    thickness = size.sum() / (0.5 * np.abs(normals @ axes.T).sum(axis=0))
    places = (nodes - nodes.mean(axis=1, keepdims=True)) @ axes.T
    worst = 0.0
    for i in range(3):
        for j in {0, 1, 2} - {i}:
            s, t = places[..., i], places[..., j]
            moved = (s * t)[..., None] * axes[i] - (s * s / 2)[..., None] * axes[j]
            slope = np.einsum("eai,eaj->eij", moved, gradients[:, 0])
            strain = (slope + slope.transpose(0, 2, 1)) / 2
            excess = (strain**2).sum(axis=(1, 2)) - (t**2).sum(
                axis=1
            ) / 20  # of a tetrahedron int t² dV is V/20 sum t²
            worst = max(worst, float(size @ excess) / (size.sum() * thickness[j] ** 2 / 12))
    return 1 / (1 + worst)


def bending_excess(kind: Element, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return e of cells with `nodes` (m, 8, 3) [m] and their volumes [m³].

    Returns:
        e bent along axis i across axis j, shape (m, 3, 3), zero where i = j; volumes, shape (m,).
    """
    gradients, volumes = reference_gradients(kind, nodes)
    count, size = len(nodes), volumes.sum(axis=1)
    matrix = strain_squares(gradients, volumes, np.broadcast_to(np.eye(3), (count, 3, 3)))
    if kind.modes:
        own, cross = matrix[:, 24:, 24:], matrix[:, :24, 24:]
        matrix = matrix[:, :24, :24] - cross @ np.linalg.solve(own, cross.transpose(0, 2, 1))
    points = np.einsum("qa,eai->eqi", kind.functions(kind.points), nodes)
    centroid = np.einsum("eq,eqi->ei", volumes, points)[:, None] / size[:, None, None]
    frame = kind.jacobians(nodes, np.zeros((1, 3)))[:, 0]
    excess = np.zeros((count, 3, 3))
    for i in range(3):
        along = frame[:, :, i] / np.linalg.norm(frame[:, :, i], axis=1, keepdims=True)
        for j in {0, 1, 2} - {i}:
            across = frame[:, :, j] - np.einsum("ei,ei->e", frame[:, :, j], along)[:, None] * along
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            s, t = (np.einsum("eai,ei->ea", nodes - centroid, axis)[..., None] for axis in (along, across))
            moved = (s * t * along[:, None] - s * s / 2 * across[:, None]).reshape(count, 24)
            square = np.einsum("eqi,ei->eq", points - centroid, across) ** 2
            right = np.einsum("eq,eq->e", volumes, square)
            excess[:, i, j] = np.einsum("ea,eab,eb->e", moved, matrix, moved, optimize=True) / right - 1
    return excess, size


def stacked(mesh: SolidMesh) -> IndexArray:
    """Return how many cells lie one upon the other along each axis of each cell, at most `MOST_LAYERS`, (m, 3)."""
    count = len(mesh.elements)
    faces = np.sort(mesh.elements[:, np.array(FACES)].reshape(-1, 4), axis=1)
    order = np.lexsort(faces.T)
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    beyond = np.full(6 * count, -1)  # the same face as the neighbour has it
    beyond[order[1:][same]], beyond[order[:-1][same]] = order[:-1][same], order[1:][same]
    opposite = np.empty(6, dtype=np.int64)
    for low, high in AXES:
        opposite[low], opposite[high] = high, low
    layers = np.ones((count, 3), dtype=np.int64)
    for axis, sides in enumerate(AXES):
        for side in sides:
            at = 6 * np.arange(count) + side
            for _ in range(MOST_LAYERS):
                inside = at >= 0
                at[inside] = beyond[at[inside]]
                inside &= at >= 0
                if not inside.any():
                    break
                layers[inside, axis] += 1
                at[inside] += opposite[at[inside] % 6] - at[inside] % 6
    return np.minimum(layers, MOST_LAYERS)
