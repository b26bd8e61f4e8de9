"""Scene to contact: obstacles from files, the body's start, the stepper."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tripod_sim.contact.bodies import SpringNodes
from tripod_sim.contact.response import Law
from tripod_sim.contact.start import check_start, lift
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.contact.surfaces import Part
from tripod_sim.contact.world import World
from tripod_sim.errors import SceneError
from tripod_sim.mesh.read_surface import read_surface
from tripod_sim.scene import Contact, Scene
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.system import SpringSystem


def obstacle_parts(scene: Scene) -> list[Part]:
    """Return the surfaces of the obstacles of `scene`. Raises SceneError, naming file and line."""
    parts = []
    for i, obstacle in enumerate(scene.obstacles):
        if "." not in obstacle.source:
            raise SceneError(
                f"obstacles.{i}.source is {obstacle.source!r}; allowed: the path of an OBJ or STL file"
            )
        surface = read_surface(Path(obstacle.source), obstacle.scale, f"obstacles.{i}.source")
        parts.append(Part(surface.vertices + np.array(obstacle.position), surface.triangles, fixed=True))
    return parts


def body_part(body: SpringBody, contact: Contact) -> Part:
    """Return the surface of a spring body; a chain touches with its springs."""
    segments = np.zeros((0, 2), dtype=np.int64) if len(body.triangles) else body.ends
    return Part(body.nodes, body.triangles, segments, self_contact=contact.self_contact)


def placed(body: SpringBody, scene: Scene, contact: Contact) -> SpringBody:
    """Return the body where it can start: as it is, or lifted. Raises SceneError if it passes through an obstacle."""
    part, obstacles = body_part(body, contact), obstacle_parts(scene)
    if contact.start == "refuse" or not obstacles:
        check_start(part, obstacles)
        return body
    up = np.array([0.0, 0.0, 1.0])
    if scene.gravity and (g := -np.array(scene.gravity.acceleration)).any():
        up = g / np.linalg.norm(g)
    move = lift(part, obstacles, up, contact.contact_distance)
    return replace(body, nodes=body.nodes + move) if move.any() else body


def contact_stepper(system: SpringSystem, scene: Scene, contact: Contact) -> ContactStepper:
    """Return what advances `system` among the obstacles of `scene`."""
    damping = scene.damping
    nodes = SpringNodes(
        system, drag=damping.mass if damping else 0.0, rayleigh=damping.stiffness if damping else 0.0
    )
    law = Law(
        contact.response, contact.friction, contact.restitution, contact.rest_speed, contact.contact_distance,
        contact.tolerance, max_solves=contact.max_solves,
    )  # fmt: skip
    body = (nodes, body_part(system.body, contact))
    return ContactStepper(World(law, contact.alarm_distance, obstacles=obstacle_parts(scene), nodes=body))
