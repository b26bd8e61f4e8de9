"""Model to what all bodies in contact share: obstacles from files, the start of rigid bodies, the stepper."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.response import Law
from tripod_sim.contact.stepper import contact_steps
from tripod_sim.integrators.schemes import implicit_euler
from tripod_sim.integrators.step_control import Increments
from tripod_sim.integrators.stepper import Stepper
from tripod_sim.mesh.surfaces import Part
from tripod_sim.model import Model
from tripod_sim.shapes import Shape, shape_of
from tripod_sim.tables.bodies import Obstacle
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.sets import Vector

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_set import RigidSet
    from tripod_sim.contact.servo_bodies import ServoBodies
    from tripod_sim.contact.solid_nodes import SolidNodes

PATIENCE = 10
"""How many times `contact.max_solves` a step may take where an accuracy is asked for: what is wrong with forces that
are not found is in no estimate."""

EXACT, POWER, ROUGH = 0.02, 2.0, 0.03
"""Accuracy for which `contact.tolerance` is meant, power of it that it goes with, and largest there is: what is left of
forces moves bodies by as much in each part, and there are about A^-1/2 of these."""


def obstacle_shapes(obstacles: Sequence[Obstacle]) -> list[Shape]:
    """Return the obstacles of a scene where they stand. Raises SceneError, naming file and line."""
    return [
        shape_of(obstacle, f"obstacles.{i}", obstacle=True).obstacle(
            np.array(obstacle.position), quaternion_matrix(obstacle.orientation)
        )
        for i, obstacle in enumerate(obstacles)
    ]


def obstacle_parts(obstacles: Sequence[Obstacle]) -> list[Part]:
    """Return the surfaces with which the obstacles of a scene touch. Raises SceneError, naming file and line."""
    return [replace(shape.part, name="obstacle") for shape in obstacle_shapes(obstacles)]


def upward(gravity: Vector | None) -> FloatArray:
    """Return the unit vector against gravity [m/s²], Z without it."""
    if gravity and (g := -np.array(gravity)).any():
        return np.asarray(g / np.linalg.norm(g))
    return np.array([0.0, 0.0, 1.0])


def touching(
    model: Model,
    contact: Contact,
    soft: "tuple[SolidNodes, list[Part]] | None",
    placed: list[tuple[str, Part]],
    mesh: Any,
    skin: Any,
) -> "tuple[Any, Any, RigidSet | None, Stepper]":
    """Return mesh and skin with the rigid bodies of a model, these, and what advances all bodies among the obstacles.

    Args:
        model: Of the scene.
        contact: Of the model.
        soft: The soft bodies as `ContactSolver` takes them; None for none.
        placed: Where they begin, by name, as far as that is known.
        mesh, skin: Of soft bodies, may be None.

    Raises:
        SceneError: rigid bodies pass through obstacles, soft ones or each other, and may or can not be lifted.
    """
    if not model.rigid:
        return mesh, skin, None, contact_stepper(model, contact, soft)
    from tripod_sim.contact.rigid_build import rigid_set, shown_with  # noqa: PLC0415 - an effect that is absent
    from tripod_sim.contact.rigid_start import place_bodies  # noqa: PLC0415

    rigid = rigid_set(model.rigid, model.gravity)
    others = [(f"obstacles.{i}", part) for i, part in enumerate(obstacle_parts(model.obstacles))] + placed
    if kinematic := _servo_bodies(model):
        others += kinematic.placed()
    place_bodies(
        rigid, others, upward(model.gravity), contact.contact_distance, lifts=contact.start == "lift"
    )
    return *shown_with(rigid, mesh, skin), rigid, contact_stepper(model, contact, soft, rigid)


def _servo_bodies(model: Model) -> "ServoBodies | None":
    """Return the bodies of the servos; None where there are none, or no rigid body that could meet them."""
    if not (model.joints and model.joints.arms and model.rigid):
        return None
    from tripod_sim.contact.servo_bodies import servo_bodies  # noqa: PLC0415 - only with servos

    return servo_bodies(model.joints)


def contact_stepper(
    model: Model,
    contact: Contact,
    soft: "tuple[SolidNodes, list[Part]] | None",
    rigid: "RigidSet | None" = None,
) -> Stepper:
    """Return what advances soft bodies and rigid ones, as far as there are any, among the obstacles of a model."""
    tolerance, most = contact.tolerance, contact.max_solves
    if model.time_error and model.time_error.accuracy:
        rougher = tolerance * (model.time_error.accuracy / EXACT) ** POWER
        tolerance, most = min(rougher, max(tolerance, ROUGH)), PATIENCE * most
    law = Law(
        contact.response, contact.friction, contact.restitution, contact.rest_speed, contact.contact_distance,
        tolerance, max_solves=most,
    )  # fmt: skip
    bodies = (rigid.bodies(), rigid.parts) if rigid else None
    world = ContactSolver(
        law, contact.alarm_distance, model.implicit if model.scheme else implicit_euler.SCHEME,
        obstacles=obstacle_parts(model.obstacles), nodes=soft, rigid=bodies, kinematic=_servo_bodies(model),
    )  # fmt: skip
    if model.scheme:
        return contact_steps(world)
    from tripod_sim.contact.statics import static_contact_steps  # noqa: PLC0415 - only where nothing moves

    servos = model.joints.count if model.joints else 0
    turns = soft[0].turns if soft else lambda move: np.abs(move[:servos])
    increments = Increments(turns, model.solver.max_turn, model.reach)
    return static_contact_steps(world, model.solver.tolerance, increments)
