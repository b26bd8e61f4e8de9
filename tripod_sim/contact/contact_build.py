"""Scene to what all bodies in contact share: obstacles from files, the start of rigid bodies, the stepper."""

from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_sim.contact.bodies import Nodes
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.response import Law
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.schemes import implicit_euler
from tripod_sim.mesh.surfaces import Part
from tripod_sim.scene import Scene
from tripod_sim.scene_short import joints_of, rigids_of
from tripod_sim.shapes import Shape, shape_of
from tripod_sim.steppers import reach_of
from tripod_sim.tables.contact import Contact

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_set import RigidSet
    from tripod_sim.contact.servo_bodies import ServoBodies

PATIENCE = 10
"""How many times `contact.max_solves` a step may take where an accuracy is asked for: what is wrong with forces that
are not found is in no estimate."""

EXACT, POWER, ROUGH = 0.02, 2.0, 0.03
"""Accuracy for which `contact.tolerance` is meant, power of it that it goes with, and largest there is: what is left of
forces moves bodies by as much in each part, and there are about A^-1/2 of these."""


def obstacle_shapes(scene: Scene) -> list[Shape]:
    """Return the obstacles of `scene` where they stand. Raises SceneError, naming file and line."""
    return [
        shape_of(obstacle, f"obstacles.{i}", obstacle=True).obstacle(
            np.array(obstacle.position), quaternion_matrix(obstacle.orientation)
        )
        for i, obstacle in enumerate(scene.obstacles)
    ]


def obstacle_parts(scene: Scene) -> list[Part]:
    """Return the surfaces with which the obstacles of `scene` touch. Raises SceneError, naming file and line."""
    return [shape.part for shape in obstacle_shapes(scene)]


def upward(scene: Scene) -> FloatArray:
    """Return the unit vector against gravity, Z without it."""
    if scene.gravity and (g := -np.array(scene.gravity.acceleration)).any():
        return np.asarray(g / np.linalg.norm(g))
    return np.array([0.0, 0.0, 1.0])


def touching(
    scene: Scene,
    contact: Contact,
    soft: tuple[Nodes, list[Part]] | None,
    placed: list[tuple[str, Part]],
    mesh: Any,
    skin: Any,
) -> "tuple[Any, Any, RigidSet | None, ContactStepper]":
    """Return mesh and skin with the rigid bodies of a scene, these, and what advances all bodies among the obstacles.

    Args:
        scene: What is described.
        contact: Of the scene.
        soft: The soft bodies as `ContactSolver` takes them; None for none.
        placed: Where they begin, by name, as far as that is known.
        mesh, skin: Of soft bodies, may be None.

    Raises:
        SceneError: rigid bodies pass through obstacles, soft ones or each other, and may or can not be lifted.
    """
    if not rigids_of(scene):
        return mesh, skin, None, contact_stepper(scene, contact, soft)
    from tripod_sim.contact.rigid_build import rigid_set, shown_with  # noqa: PLC0415 - an effect that is absent
    from tripod_sim.contact.rigid_start import place_bodies  # noqa: PLC0415

    rigid = rigid_set(scene)
    others = [(f"obstacles.{i}", part) for i, part in enumerate(obstacle_parts(scene))] + placed
    if kinematic := _servo_bodies(scene):
        others += kinematic.placed()
    place_bodies(rigid, others, upward(scene), contact.contact_distance, lifts=contact.start == "lift")
    return *shown_with(rigid, mesh, skin), rigid, contact_stepper(scene, contact, soft, rigid)


def _servo_bodies(scene: Scene) -> "ServoBodies | None":
    """Return the bodies of the servos; None where there are none, or no rigid body that could meet them."""
    joints = joints_of(scene)
    if not (joints and rigids_of(scene)):
        return None
    from tripod_sim.contact.servo_bodies import servo_bodies  # noqa: PLC0415 - only with servos

    return servo_bodies(joints)


def contact_stepper(
    scene: Scene, contact: Contact, soft: tuple[Nodes, list[Part]] | None, rigid: "RigidSet | None" = None
) -> ContactStepper:
    """Return what advances soft bodies and rigid ones, as far as there are any, among the obstacles of `scene`."""
    tolerance, most = contact.tolerance, contact.max_solves
    if scene.time_error and scene.time_error.accuracy:
        rougher = tolerance * (scene.time_error.accuracy / EXACT) ** POWER
        tolerance, most = min(rougher, max(tolerance, ROUGH)), PATIENCE * most
    law = Law(
        contact.response, contact.friction, contact.restitution, contact.rest_speed, contact.contact_distance,
        tolerance, max_solves=most,
    )  # fmt: skip
    bodies = (rigid.bodies(), rigid.parts) if rigid else None
    world = ContactSolver(
        law, contact.alarm_distance, scene.inertia.implicit if scene.inertia else implicit_euler.SCHEME,
        obstacles=obstacle_parts(scene), nodes=soft, rigid=bodies, kinematic=_servo_bodies(scene),
    )  # fmt: skip
    if scene.inertia:
        return ContactStepper(world)
    from tripod_sim.contact.statics import ContactStatics  # noqa: PLC0415 - only where nothing moves

    solver = scene.solver
    joints = joints_of(scene)
    servos = joints.count if joints else 0
    return ContactStatics(world, solver.tolerance, solver.max_turn, reach_of(scene), servos)
