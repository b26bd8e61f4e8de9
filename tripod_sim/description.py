"""The robot of a scene as URDF, and where its links are.

Links: base_link (the plane of the flat piece); carriage_i, the body of servo i, which slides inward along -x of its
frame; arm_i, which turns about the servo's axis; effector; and, in a scene that has them, plate (fixed to the effector)
and ball. The frame of a carriage lies on its servo's axis, x outward along the strip, z up. A negative angle of servo i
tips its arm outward and down: the joint's axis is -y. The joint `slide` moves all carriages, all but the first as
its mimics. The silicone between the links is no rigid link; the joints of effector and ball are floating.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_sim.tables.robot import ServoDynamics, Servos

FloatArray = NDArray[np.float64]

Frame = tuple[str, str, FloatArray, FloatArray]
"""Parent, child, position [m] and quaternion (x, y, z, w) of the child in the parent."""

BASE, EFFECTOR, PLATE, BALL = "base_link", "effector", "plate", "ball"
ARM = (0.004, 0.02)
"""Thickness and width of an arm as drawn [m]."""
CARRIAGE = (0.023, 0.012, 0.022)
"""Size of a servo's body of the S90 class as drawn [m]."""
DISC_HEIGHT = 0.005
"""Height of the effector as drawn: the thickness of the shipped piece [m]."""
SILICONE, METAL, WOOD, RED = "0.85 0.75 0.62 1", "0.35 0.37 0.4 1", "0.72 0.55 0.36 1", "0.8 0.16 0.16 1"


def urdf(scene: Scene) -> str:
    """Return the robot of a scene as URDF.

    Raises:
        SceneError: the scene has no servos, or its maze cannot be built.
    """
    servos = _servos(scene)
    robot = ET.Element("robot", name=scene.name)
    _link(robot, BASE)
    for i, azimuth in enumerate(azimuths(servos)):
        _carriage(robot, i, azimuth, servos)
        _arm(robot, i, servos, scene.servo_dynamics or ServoDynamics())
    if scene.effector:
        disc = f"cylinder radius={scene.effector.radius:g} length={DISC_HEIGHT:g}"
        _link(robot, EFFECTOR, disc, SILICONE)
        _joint(robot, EFFECTOR, "floating", BASE, EFFECTOR)
    if scene.maze:
        from tripod_sim.maze.board import make_board  # noqa: PLC0415 - only where there is a maze

        left, back, right, front, _ = make_board(
            scene.maze, scene.ball.radius if scene.ball else 0.0
        ).obstacles.extent
        size = f"box size={right - left:g},{front - back:g},{scene.maze.thickness:g}"
        centre = (0.5 * (left + right), 0.5 * (back + front), -0.5 * scene.maze.thickness)
        _link(robot, PLATE, size, WOOD, centre)
        _joint(robot, PLATE, "fixed", EFFECTOR, PLATE, (0, 0, scene.maze.offset))
    if scene.ball:
        _link(robot, BALL, f"sphere radius={scene.ball.radius:g}", RED)
        _joint(robot, BALL, "floating", BASE, BALL)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def arm_frames(servos: Servos, joints: FloatArray) -> Iterator[Frame]:
    """Yield carriages and arms at `joints`: angles [rad] and the slide [m], shape (count + 1,)."""
    radius = servos.axis_radius - float(joints[servos.count])
    for i, azimuth in enumerate(azimuths(servos)):
        position = np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), -servos.axis_depth])
        yield BASE, f"carriage_{i}", position, np.array([0, 0, np.sin(azimuth / 2), np.cos(azimuth / 2)])
        half = -0.5 * float(joints[i])
        yield f"carriage_{i}", f"arm_{i}", np.zeros(3), np.array([0, np.sin(half), 0, np.cos(half)])


def azimuths(servos: Servos) -> FloatArray:
    """Return the azimuths of the strips from +X [rad], shape (count,)."""
    return 2 * np.pi * np.arange(servos.count) / servos.count


def _servos(scene: Scene) -> Servos:
    if not scene.servos:
        raise SceneError(f"scene {scene.name!r} has no servos: there is no robot to describe")
    if scene.servo:
        raise SceneError(
            f"scene {scene.name!r} has [[servo]] tables: only servos evenly about Z are described"
        )
    return scene.servos


def _carriage(robot: ET.Element, i: int, azimuth: float, servos: Servos) -> None:
    name = f"carriage_{i}"
    _link(robot, name, "box size=" + ",".join(map(str, CARRIAGE)), METAL, (0, 0, -0.5 * CARRIAGE[2]))
    radius = servos.axis_radius
    origin = (radius * np.cos(azimuth), radius * np.sin(azimuth), -servos.axis_depth)
    joint = _joint(robot, f"slide_{i}" if i else "slide", "prismatic", BASE, name, origin, azimuth)
    ET.SubElement(joint, "axis", xyz="-1 0 0")
    ET.SubElement(joint, "limit", lower="0", upper=f"{servos.slide_max:g}", effort="0", velocity="0.1")
    if i:
        ET.SubElement(joint, "mimic", joint="slide")


def _arm(robot: ET.Element, i: int, servos: Servos, dynamics: ServoDynamics) -> None:
    thickness, width = ARM
    depth = servos.axis_depth
    _link(robot, f"arm_{i}", f"box size={thickness:g},{width:g},{depth:g}", METAL, (0, 0, 0.5 * depth))
    joint = _joint(robot, f"servo_{i}", "revolute", f"carriage_{i}", f"arm_{i}")
    ET.SubElement(joint, "axis", xyz="0 -1 0")
    ET.SubElement(
        joint,
        "limit",
        lower=f"{servos.angle_min:g}",
        upper=f"{servos.angle_max:g}",
        effort=f"{dynamics.stall_torque:g}",
        velocity=f"{dynamics.speed:g}",
    )


def _link(
    robot: ET.Element, name: str, shape: str = "", colour: str = "", centre: tuple[float, ...] = (0, 0, 0)
) -> None:
    """Add a link; `shape` as in `box size=1,2,3`."""
    link = ET.SubElement(robot, "link", name=name)
    if not shape:
        return
    kind, *words = shape.split()
    visual = ET.SubElement(link, "visual")
    ET.SubElement(visual, "origin", xyz=_text(centre))
    sizes = {key: value.replace(",", " ") for key, _, value in (word.partition("=") for word in words)}
    ET.SubElement(ET.SubElement(visual, "geometry"), kind, sizes)
    ET.SubElement(ET.SubElement(visual, "material", name=f"{name}_colour"), "color", rgba=colour)


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    origin: tuple[float, ...] = (0, 0, 0),
    yaw: float = 0.0,
) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_text(origin), rpy=f"0 0 {yaw:.9g}")
    return joint


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
