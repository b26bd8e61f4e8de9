"""What a reader found in a file: points, and cells by their kind."""

from dataclasses import dataclass, field

from tripod_host.arrays import FloatArray, IndexArray


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a file.

    Attributes:
        points: Shape (n, 3), in the file's unit.
        volumes: Cells by kind, only those of `elements.catalogue.SIZES`: indices of points, shape (m, nodes of a
            cell), corners first in VTK order.
        others: Names of all other kinds of cells in the file: those without a volume are left out.
        solid: Those of `others` that have a volume.
        skipped: How many cells there are of those of `others` that the reader does not know.
        groups: Points of each group of the file, by its name.
        cell_groups: Cells of each group of the file that has some of `volumes`, by its name, numbered over these.
    """

    points: FloatArray
    volumes: dict[str, IndexArray] = field(default_factory=dict)
    others: tuple[str, ...] = ()
    solid: tuple[str, ...] = ()
    skipped: dict[str, int] = field(default_factory=dict)
    groups: dict[str, IndexArray] = field(default_factory=dict)
    cell_groups: dict[str, IndexArray] = field(default_factory=dict)
