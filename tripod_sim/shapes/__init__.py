"""The shapes of rigid bodies and obstacles, each a file of this folder: a further one is a further file.

The file's name is the word for `shape` in `[[rigid]]` and `[[obstacles]]`. It has

    FIELDS                          the fields of the table that it reads, of size, radius, length, source and scale
    make(table, field, obstacle)    returns the `Shape`; `field` names the table in messages, and an `obstacle` needs no
                                    inertia and no centre

What detection needs of a shape is its `Part`: points, segments and triangles, and a radius about all of them. So a ball
is a point with a radius, a capsule a segment with one, a box twelve triangles without. `tests/sim/test_shapes.py`
tests every shape that is found here.
"""

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.surfaces import Part
from tripod_sim.tables.bodies import SHAPES

if TYPE_CHECKING:
    from tripod_sim.tables.bodies import Obstacle, Rigid


@dataclass(frozen=True, eq=False)
class Shape:
    """A body in its own frame. If it can be a rigid body, its centre of mass is the origin.

    Attributes:
        part: The surface with which it touches.
        vertices: Of the surface that shows it [m], shape (k, 3).
        triangles: Of these vertices, seen from outside counter-clockwise, shape (t, 3).
        inertia: About the centre, for a mass of 1 kg spread evenly [m²], shape (3, 3); zero if it is only an obstacle.
        volume: [m³]; zero if it is only an obstacle.
    """

    part: Part
    vertices: FloatArray
    triangles: IndexArray
    inertia: FloatArray
    volume: float

    def obstacle(self, position: FloatArray, rotation: FloatArray) -> "Shape":
        """Return the shape in world, where it never moves: x = position + rotation X."""
        part = replace(
            self.part, vertices=self.part.vertices @ rotation.T + position, rigid=False, fixed=True
        )
        return Shape(part, self.vertices @ rotation.T + position, self.triangles, np.zeros((3, 3)), 0.0)


def fields_of(name: str) -> tuple[str, ...]:
    """Return the fields of a table that the shape `name` reads."""
    return tuple(import_module(f"{__name__}.{name}").FIELDS)


def shape_of(table: "Rigid | Obstacle", field: str, *, obstacle: bool = False) -> Shape:
    """Return the shape that `table`, named `field` in messages, describes. Raises SceneError."""
    shape: Shape = import_module(f"{__name__}.{table.shape}").make(table, field, obstacle)
    return shape


def field_reads() -> dict[str, tuple[str, ...]]:
    """Return the fields that each shape reads, by its name."""
    return {name: fields_of(name) for name in SHAPES}
