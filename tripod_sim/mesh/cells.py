"""What a reader found in a file: points, and cells by their kind."""

from dataclasses import dataclass, field

from tripod_host.arrays import FloatArray, IndexArray

SIZES = {"tetra": 4, "tetra10": 10, "hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27}
"""Nodes of the cells that elements are made of, by meshio's names."""

FLAT = ("vertex", "line", "triangle", "quad", "polygon")
"""How the names of cells without volume begin; they are left out."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a file.

    Attributes:
        points: Shape (n, 3), in the file's unit.
        volumes: Cells by kind, only those of `SIZES`: indices of points, shape (m, nodes of a cell), corners first in
            VTK order.
        kinds: Names of all kinds of cells in the file, also those left out.
        groups: Points of each group of the file, by its name.
    """

    points: FloatArray
    volumes: dict[str, IndexArray] = field(default_factory=dict)
    kinds: tuple[str, ...] = ()
    groups: dict[str, IndexArray] = field(default_factory=dict)
