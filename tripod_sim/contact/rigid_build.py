"""Model to rigid bodies, beside a soft body or alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tripod_host.rotations import quaternion_matrix
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.contact.rigid_set import JoinedMesh, JoinedSkin, RigidSet
from tripod_sim.shapes import shape_of
from tripod_sim.tables.bodies import Rigid
from tripod_sim.tables.sets import Vector


def rigid_set(described: Sequence[tuple[str, Rigid]], gravity: Vector | None) -> RigidSet:
    """Return rigid bodies, each given with its field, where they begin. Raises SceneError."""
    fields, bodies = zip(*described, strict=True)
    shapes = [shape_of(body, field) for field, body in zip(fields, bodies, strict=True)]
    mass = np.array([body.mass for body in bodies])
    start = RigidMotion(
        np.array([body.position for body in bodies]),
        np.array([quaternion_matrix(body.orientation) for body in bodies]),
        np.array([body.velocity for body in bodies]),
        np.array([body.spin for body in bodies]),
    )
    return RigidSet(shapes, mass, start, np.array(gravity or (0.0, 0.0, 0.0)), fields)


def shown_with(rigid: RigidSet, mesh: Any, skin: Any) -> tuple[JoinedMesh, "JoinedSkin | None"]:
    """Return mesh and skin of a soft body with rigid bodies behind it; `skin` may be None."""
    return JoinedMesh(mesh, rigid), JoinedSkin(skin, len(mesh.nodes), rigid) if skin else None
