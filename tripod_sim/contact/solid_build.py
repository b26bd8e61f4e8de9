"""Scene to a finite-element solid in contact."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.build import Parts
from tripod_sim.contact.build import contact_stepper, obstacle_parts, place_rigid, upward
from tripod_sim.contact.solid_nodes import SolidNodes
from tripod_sim.contact.start import check_itself, check_start, lift
from tripod_sim.contact.surfaces import Part
from tripod_sim.errors import SceneError
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.mesh.solid_mesh import FloatArray, IndexArray, SolidMesh
from tripod_sim.scene import Scene
from tripod_sim.system import System
from tripod_sim.tables.motion import Contact

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.maze.plate import Plate

MODES = 1e-3
"""Unbalanced force that incompatible modes may keep, as a share of the solver's tolerance."""


def solid_part(mesh: SolidMesh, contact: Contact) -> tuple[Part, IndexArray]:
    """Return the surface of a solid, and the nodes of the mesh that are its vertices, ascending."""
    nodes, triangles = np.unique(mesh.surface, return_inverse=True)
    surface = triangles.reshape(-1, 3)
    return Part(mesh.nodes[nodes], surface, self_contact=contact.self_contact), nodes


def placed_solid(mesh: SolidMesh, scene: Scene, contact: Contact) -> SolidMesh:
    """Return the solid where it can start: as it is, or lifted. Raises SceneError if it passes through an obstacle."""
    part, obstacles = solid_part(mesh, contact)[0], obstacle_parts(scene)
    check_itself(part, contact.contact_distance)
    if scene.servos or contact.start == "refuse" or not obstacles:
        if not scene.servos:  # else where the servos bring it
            check_start(part, obstacles)
        return mesh
    if scene.fixed:
        raise SceneError(
            "contact.start is 'lift', but fixed boxes hold the solid where it is; move the obstacles"
        )
    move = lift(part, obstacles, upward(scene), contact.contact_distance)
    return replace(mesh, nodes=mesh.nodes + move) if move.any() else mesh


def solid_parts(
    mesh: SolidMesh,
    system: System,
    inertia: Anchor,
    mass: FloatArray,
    scene: Scene,
    contact: Contact,
    plate: "Plate | None",
) -> Parts:
    """Return the parts of a simulation of a solid, and rigid bodies if there are any, among obstacles.

    Args:
        mesh: The solid.
        system: Its potential.
        inertia: The system's inertia term.
        mass: Of the system's nodes [kg].
        scene, contact: What is described.
        plate: The maze on the disc; it touches nothing.

    Raises:
        SceneError: a body passes through something at the start.
    """
    part, nodes = solid_part(mesh, contact)
    newton = Newton(system, scene.solver.tolerance, scene.solver.max_iterations)
    stage = ImplicitStage(newton, inertia, mass, scene.damping.mass if scene.damping else 0.0)
    soft = (SolidNodes(stage, mass, nodes, MODES * scene.solver.tolerance), part)
    rigid = None
    if scene.rigid:
        from tripod_sim.contact.rigid_build import rigid_set  # noqa: PLC0415 - an effect that is absent

        rigid = rigid_set(scene)
        place_rigid(rigid, scene, contact, None if scene.servos else part)
    stepper = contact_stepper(scene, contact, soft, rigid)

    def check_start_of(positions: FloatArray) -> None:
        """Name what passes through what where the servos have brought the solid."""
        body = replace(part, vertices=positions[nodes])
        check_start(body, obstacle_parts(scene))
        if rigid:
            check_beside(rigid, body)

    check = check_start_of if scene.servos else None
    if not rigid:
        return Parts(mesh, mass, system, stepper, plate=plate, check_start=check)
    from tripod_sim.contact.rigid_build import shown_with  # noqa: PLC0415 - an effect that is absent
    from tripod_sim.contact.rigid_start import check_beside  # noqa: PLC0415

    shown = shown_with(rigid, mesh, None)[0]
    return Parts(shown, mass, system, stepper, plate=plate, rigid=rigid, check_start=check)
