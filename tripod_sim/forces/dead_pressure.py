"""Notes on dead pressures where they differ most from the pressure of a gas or a liquid.

A dead pressure keeps the size and the direction of its forces. The pressure of a gas follows the surface. The two
differ where the surface turns, and in a closed chamber, where the work of a gas goes with the volume.
"""

import math
from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.closed_surface import encloses
from tripod_sim.mesh.solid_mesh import Faces

TURNED = math.radians(10)
"""By which a face may turn before it is told [rad]."""

BUT_A_GAS = "a gas or a liquid would follow the surface, which can bend the body several times as far"


def pressure_notes(
    field: str, name: str, loaded: Sequence[Sequence[Faces]], rest: FloatArray
) -> "tuple[list[str], list[TurnWatch]]":
    """Return what to say of a dead pressure at once, and what watches for the rest.

    Args:
        field: Of the load in the scene.
        name: Of its set.
        loaded: Of each solid the faces on which the pressure acts.
        rest: Undeformed positions [m], shape (n, 3).
    """
    if not any(encloses(of_solid) for of_solid in loaded if of_solid):
        corners = [[faces.corners for faces in of_solid] for of_solid in loaded if of_solid]
        return [], [TurnWatch(field, of_solid, rest) for of_solid in corners]
    note = (
        f"{field}.pressure acts on a closed surface, set {name!r}, as a dead pressure: its forces "
        f"keep the directions of the undeformed surface; {BUT_A_GAS}. Use [[chamber]] for the pressure "
        "in a chamber"
    )
    return [note], []


class TurnWatch:
    """Tells once when a face under a dead pressure has turned by more than `TURNED`."""

    def __init__(self, field: str, faces: Sequence[IndexArray], rest: FloatArray) -> None:
        """Prepare.

        Args:
            field: Of the load in the scene.
            faces: Nodes of the corners of each, in a loop, arrays (k, 3) or (k, 4).
            rest: Undeformed positions [m], shape (n, 3).
        """
        self._field, self._faces = field, faces
        self._normals = self._unit_normals(rest)

    def __call__(self, positions: FloatArray) -> str:
        """Return the note if a face has turned so far at `positions` [m], shape (n, 3), else an empty one."""
        cosines = np.einsum("fi,fi->f", self._normals, self._unit_normals(positions))
        if cosines.min() >= math.cos(TURNED):
            return ""
        return (
            f"{self._field}.pressure is a dead pressure: its surface has turned by more than "
            f"{math.degrees(TURNED):.0f} degrees, but the forces keep their directions; {BUT_A_GAS}. Do "
            "not rely on the shape from here on"
        )

    def _unit_normals(self, x: FloatArray) -> FloatArray:
        normals = np.concatenate([_normals(x, faces) for faces in self._faces])
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _normals(x: FloatArray, faces: IndexArray) -> FloatArray:
    """Return normals of faces (k, corners), of twice their area."""
    a, b, c, d = (x[faces[:, k]] for k in (0, 1, 2, -1))
    return np.cross(c - a, d - b)
