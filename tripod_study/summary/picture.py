"""What there is to draw of a scene that is not in its meshes: which nodes are what, obstacles, holes, limits."""

from typing import Any

import numpy as np

from tripod_sim.fields import FIELDS
from tripod_sim.scene.description import DISC_HEIGHT, standing
from tripod_sim.simulation import Simulation
from tripod_sim.tables.robot import Effector, ServoDynamics
from tripod_sim.tables.short_forms import effector_of, soft_bodies

MOST_TRIANGLES = 50_000
"""Of all obstacles; what is beyond is not drawn, and said."""

MOST_POINTS = 500
"""Of nodes that never move."""


def picture(simulation: Simulation) -> dict[str, Any]:
    """Return what a page needs to draw a scene, as JSON has it: lengths in m, angles in rad.

    Keys: name, description, dt, parts (name, kind, first, count: nodes of the skin, in order), obstacles (vertices,
    triangles, flat), held (points that never move), joints (names of all that is commanded but the slide), start
    (their commands at the start, the slide last), cables (name, nodes, weights, fixed, see `Embedding`), servos,
    effector, maze, ball (None where the scene has none), fields (name, unit, signed, see `NodalField`), note.
    """
    scene = simulation.scene
    (obstacles, note), effector = _obstacles(simulation), effector_of(scene)
    cables, not_drawn = _cables(simulation)
    return {
        "name": scene.name,
        "description": scene.description,
        "dt": scene.dt,
        "moves": scene.inertia is not None,
        "parts": _parts(simulation),
        "obstacles": obstacles,
        "held": _held(simulation),
        "joints": [a.name for a in simulation.joints.actuators] if simulation.joints else [],
        "start": simulation.joints.start.tolist() if simulation.joints else [],
        "cables": cables,
        "servos": _servos(simulation),
        "effector": {"radius": effector.radius, "height": _height(effector)} if effector else None,
        "maze": _maze(simulation),
        "ball": {"radius": scene.ball.radius} if scene.ball else None,
        "fields": [
            {
                "name": name,
                "label": FIELDS[name].label,
                "unit": FIELDS[name].unit,
                "signed": FIELDS[name].signed,
            }
            for name in simulation.field_names
        ],
        "note": "; ".join(filter(None, (note, not_drawn))),
    }


def _parts(simulation: Simulation) -> list[dict[str, Any]]:
    """Return which nodes of the skin belong to each soft body, and which to each rigid one."""
    named = [(b.name, "springs" if b.springs else "solid") for b in soft_bodies(simulation.scene)]
    counts = simulation.bodies[0 if named else 1 :]
    named += [(f"rigid.{i}", "rigid") for i in range(len(simulation.rigid_counts))]
    parts, first = list[dict[str, Any]](), 0
    for (name, kind), count in zip(named, counts, strict=True):
        parts.append({"name": name, "kind": kind, "first": first, "count": count})
        first += count
    return parts


def _obstacles(simulation: Simulation) -> tuple[list[dict[str, Any]], str]:
    if not simulation.scene.obstacles:
        return [], ""
    from tripod_sim.contact.contact_build import obstacle_shapes  # noqa: PLC0415 - only where there are obstacles

    found, left = list[dict[str, Any]](), MOST_TRIANGLES
    for part in obstacle_shapes(simulation.scene.obstacles):
        left -= len(part.triangles)
        if left < 0:
            return found, f"obstacles of more than {MOST_TRIANGLES} triangles are not drawn"
        found.append(
            {
                "vertices": np.round(part.vertices, 6).ravel().tolist(),
                "triangles": part.triangles.ravel().tolist(),
            }
        )
    return found, ""


def _height(effector: Effector) -> float:
    """Return the height of the disc [m]; 0 of a point or a set, which have none."""
    return DISC_HEIGHT if effector.is_disc else 0.0


def _cables(simulation: Simulation) -> tuple[list[dict[str, Any]], str]:
    """Return the points of each cable by nodes of the skin, and a note."""
    if not (routes := simulation.routes):
        return [], ""
    if simulation.skin is not simulation.mesh:
        return [], "cables are not drawn beside bodies of springs"
    return [
        {
            "name": name,
            "nodes": route.nodes.tolist(),
            "weights": np.round(route.weights, 9).tolist(),
            "fixed": np.round(route.fixed, 9).tolist(),
        }
        for name, route in routes.items()
    ], ""


def _held(simulation: Simulation) -> list[list[float]]:
    """Return the undeformed places of some of the nodes that never move."""
    return np.asarray(simulation.mesh.nodes)[simulation.fixed][:MOST_POINTS].tolist()


def _servos(simulation: Simulation) -> dict[str, Any] | None:
    joints = simulation.joints
    if not (joints and joints.arms):
        return None
    dynamics = simulation.scene.servo_dynamics
    return {
        "arms": [standing(arm) for arm in joints.arms],
        "slide_max": joints.slide_max,
        "stall_torque": (dynamics or ServoDynamics()).stall_torque,
        "ideal": dynamics is None,
    }


def _maze(simulation: Simulation) -> dict[str, Any] | None:
    plate = simulation.plate
    if not plate:
        return None
    board = plate.board
    x, y, radius = board.goal
    return {
        "holes": board.obstacles.holes.tolist(),
        "goal": [x, y, radius] if radius > 0 else None,
        "start": list(board.start),
        "height": plate.offset,
    }
