"""The shape of a body in contact: where it touches, its mass properties and its picture."""

from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact.surfaces import Part


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
