"""Generator of a block: a brick, or what it becomes with its eight corners elsewhere, divided evenly."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.hexahedron import CORNERS, H8_MODES, functions
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh


def block(corners: FloatArray, cells: tuple[int, int, int]) -> SolidMesh:
    """Return a mesh of eight-node hexahedra.

    Args:
        corners: Eight, in VTK order [m], shape (8, 3).
        cells: How many along the edges from corner 0 to 1, to 3 and to 4.

    Raises:
        SceneError: not eight corners.
    """
    if len(corners) != len(CORNERS):
        raise SceneError(f"mesh.corners has {len(corners)} corners; a block has 8, in VTK order")
    lines = [np.linspace(-1, 1, n + 1) for n in cells]
    places = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange(len(places)).reshape([n + 1 for n in cells])
    a, b, c = cells
    steps = ((CORNERS + 1) // 2).astype(int)
    elements = [numbers[p : a + p, q : b + q, r : c + r].ravel() for p, q, r in steps]
    return SolidMesh.of(functions(places) @ corners, np.stack(elements, axis=1), H8_MODES)
