"""Scene to rigid bodies, beside a soft body or alone."""

from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.rotations import quaternion_matrix
from tripod_sim.contact.rigid_set import JoinedMesh, JoinedSkin, RigidSet
from tripod_sim.rigid_state import RigidState
from tripod_sim.scene import Scene
from tripod_sim.scene_short import contact_of, rigids_of
from tripod_sim.shapes import shape_of

if TYPE_CHECKING:
    from tripod_sim.parts import Parts


def rigid_set(scene: Scene) -> RigidSet:
    """Return the rigid bodies of `scene` where it places them. Raises SceneError."""
    fields, bodies = zip(*rigids_of(scene), strict=True)
    shapes = [shape_of(body, field) for field, body in zip(fields, bodies, strict=True)]
    mass = np.array([body.mass for body in bodies])
    start = RigidState(
        np.array([body.position for body in bodies]),
        np.array([quaternion_matrix(body.orientation) for body in bodies]),
        np.array([body.velocity for body in bodies]),
        np.array([body.spin for body in bodies]),
    )
    gravity = np.array(scene.gravity.acceleration) if scene.gravity else np.zeros(3)
    return RigidSet(shapes, mass, start, gravity, fields)


def build_rigid(scene: Scene) -> "Parts":
    """Return the parts of a simulation of rigid bodies alone. Raises SceneError."""
    from tripod_sim.contact.contact_build import touching  # noqa: PLC0415
    from tripod_sim.contact.rigid_set import RigidSystem  # noqa: PLC0415
    from tripod_sim.parts import Parts  # noqa: PLC0415 - it imports this module

    contact = contact_of(scene)
    assert contact
    mesh, _, rigid, stepper = touching(scene, contact, None, [], None, None)
    assert rigid
    return Parts(mesh, np.zeros(0), RigidSystem(rigid), stepper, rigid=rigid)


def shown_with(rigid: RigidSet, mesh: Any, skin: Any) -> tuple[JoinedMesh, "JoinedSkin | None"]:
    """Return mesh and skin of a soft body with rigid bodies behind it; `skin` may be None."""
    return JoinedMesh(mesh, rigid), JoinedSkin(skin, len(mesh.nodes), rigid) if skin else None
