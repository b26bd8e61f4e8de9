"""Short forms of a scene written out.

`[mesh]` with `[material]`, and `[springs]`, are its first bodies. `[servos]` and `[effector]` are those of the first
body, about the Z axis of the world; `[body.servos]` and `[body.effector]` those of another, about its own. `[ball]`
outside of a maze is a rigid body in contact. `lowering` writes them out; builders read the model alone.
"""

from dataclasses import replace
from typing import cast

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.model import BALL
from tripod_sim.tables.actuators import actuator_tables, started
from tripod_sim.tables.bodies import HOME, Body, Rigid
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.fields import Described
from tripod_sim.tables.joints import Arm, Joints
from tripod_sim.tables.robot import Effector, Servos
from tripod_sim.tables.sets import NodeSet, Servo

FIRST, SECOND = "body", "springs"
"""Names of what the short form describes; where that is one body it has the first."""


def soft_bodies(scene: Described) -> tuple[Body, ...]:
    """Return the soft bodies of a scene, those of the short form first."""
    found = {body.name: body for body in _short(scene)}
    bodies = list(found.values())
    for body in scene.body:
        model = found.get(body.like)
        bodies.append(replace(body, mesh=model.mesh, material=model.material) if model else body)
        found.setdefault(body.name, bodies[-1])
    return tuple(bodies)


def field_of(scene: Described, number: int) -> str:
    """Return how a message names body `number`: nothing for the short form, else `body.0.` and so on."""
    first = len(_short(scene))
    return f"body.{number - first}." if number >= first else ""


def _short(scene: Described) -> tuple[Body, ...]:
    found = []
    if scene.mesh or scene.material:
        found.append(Body(FIRST, mesh=scene.mesh, material=scene.material, region=scene.region))
    if scene.springs:
        found.append(Body(SECOND if found else FIRST, springs=scene.springs))
    return tuple(found)


# rigid bodies ---------------------------------------------------------------------------------------------------------


def rigids_of(scene: Described) -> list[tuple[str, Rigid]]:
    """Return the rigid bodies of a scene, each with its field; the ball, unless it plays in a maze, is the last."""
    found = [(f"rigid.{i}", body) for i, body in enumerate(scene.rigid)]
    if (ball := scene.ball) and not scene.maze:
        body = Rigid(shape="ball", radius=ball.radius, mass=ball.mass, position=ball.position)
        found.append((BALL, body))
    return found


NEAR, ALARM = 1 / 16, 3 / 16
"""Contact and alarm distance of a ball in a scene without [contact], in its radii."""


def contact_of(scene: Described) -> Contact | None:
    """Return the contact of a scene: its table, or what a ball outside of a maze brings along."""
    ball, own = scene.ball, scene.contact
    if own or not ball or scene.maze:
        return cast("Contact | None", own)
    return Contact(
        contact_distance=NEAR * ball.radius, alarm_distance=ALARM * ball.radius, friction=ball.friction,
        restitution=ball.restitution, rest_speed=ball.rest_speed,
    )  # fmt: skip


# servos ---------------------------------------------------------------------------------------------------------------


def joints_of(scene: Described) -> Joints | None:
    """Return the joints of a scene; None where it has none."""
    tables = servo_tables(scene)
    others = tuple(table.actuator for _, _, table in actuator_tables(scene))
    if not tables:
        return Joints((), 0.0, 0.0, others) if others else None
    arms = list[Arm]()
    for number, (field, table, body) in enumerate(tables):
        if scene.servo and not number and scene.servos:
            arms += [_placed(i, servo, table) for i, servo in enumerate(scene.servo)]
        else:
            arms += _round(field, table, body)
    slide_max = min(table.slide_max for _, table, _ in tables)
    return Joints(tuple(arms), tables[0][1].slide, slide_max, others)


def servo_tables(scene: Described) -> list[tuple[str, Servos, Body]]:
    """Return each `[servos]` with its field and the body whose nodes they hold, about whose Z axis they stand."""
    bodies = soft_bodies(scene)
    found = []
    if scene.servos and bodies:
        found.append(("servos", scene.servos, replace(bodies[0], position=(0.0,) * 3, orientation=HOME)))
    return found + [
        (f"{field_of(scene, k)}servos", body.servos, body) for k, body in enumerate(bodies) if body.servos
    ]


def _round(field: str, table: Servos, body: Body) -> list[Arm]:
    """Return servos evenly about the Z axis of a body.

    Servo i of n stands at azimuth phi = 2 pi i / n. Its axis is horizontal and perpendicular to the strip,
    a = (sin phi, -cos phi, 0), so that a negative angle tips the arm outward and down.
    """
    (position, turn), arms = body.pose, []
    for i in range(table.count):
        phi = 2 * np.pi * i / table.count
        outward = turn @ np.array([np.cos(phi), np.sin(phi), 0.0])
        beyond = table.clamp_radius + float(outward @ position)
        x, y, z = outward.tolist()
        arms.append(
            Arm(
                NodeSet("", body=body.name, along=(x, y, z), beyond=beyond),
                f"{field}.clamp_radius is {table.clamp_radius} m: servo_{i}",
                turn @ np.array([0, 0, -table.axis_depth]) + table.axis_radius * outward + position,
                turn @ np.array([np.sin(phi), -np.cos(phi), 0.0]),
                -outward,
                table.angles[i],
                table,
            )
        )
    return arms


def _placed(i: int, servo: Servo, table: Servos) -> Arm:
    axis, inward = np.array(servo.axis), np.array(servo.inward or (0.0, 0.0, 0.0))
    length = np.linalg.norm(inward)
    return Arm(
        servo.set,
        f"servo.{i}.set",
        np.array(servo.hub),
        axis / np.linalg.norm(axis),
        inward / length if length > 0 else inward,
        table.angles[i],
        table,
    )


def posed(scene: Described, commands: FloatArray, slide: float) -> Described:
    """Return a scene whose actuators start at `commands`, shape (count,), and `slide` [m]."""
    rest, tables = commands.tolist(), list[Servos]()
    for _, table, _ in servo_tables(scene):
        own, rest = tuple(rest[: table.count]), rest[table.count :]
        tables.append(replace(table, angles=own, slide=slide))
    first = tables.pop(0) if scene.servos else None
    bodies = tuple(replace(b, servos=tables.pop(0)) if b.servos else b for b in scene.body)
    return started(replace(scene, servos=first, body=bodies), rest)


# effectors ------------------------------------------------------------------------------------------------------------


def effectors_of(scene: Described) -> list[tuple[str, Effector, Body]]:
    """Return each `[effector]` with its field and its body; the first is the effector of the scene."""
    bodies = soft_bodies(scene)
    found = []
    if scene.effector and bodies:
        found.append(("effector", scene.effector, replace(bodies[0], position=(0.0,) * 3, orientation=HOME)))
    return found + [
        (f"{field_of(scene, k)}effector", body.effector, body)
        for k, body in enumerate(bodies)
        if body.effector
    ]


def discs_of(scene: Described) -> list[tuple[str, Effector, Body]]:
    """Return those effectors that are rigid discs."""
    return [found for found in effectors_of(scene) if found[1].is_disc]


def effector_of(scene: Described) -> Effector | None:
    """Return the effector of a scene, else its platform as a disc; None where it has neither."""
    if found := effectors_of(scene):
        return found[0][1]
    return Effector(0.5 * max(scene.platform[0].size)) if scene.platform else None
