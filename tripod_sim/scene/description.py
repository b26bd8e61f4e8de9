"""The robot of a scene as URDF, and where its links are.

Links: base_link (the plane of the flat piece); carriage_i, the body of servo i, which slides inward along -x of its
frame; arm_i, which turns about the servo's axis; effector; and, in a scene that has them, plate (fixed to the
effector) and ball. The frame of a carriage lies on its servo's axis, x outward along the strip, z along the arm: up.
A negative angle of servo i tips its arm outward and down: the joint's axis is -y. The joint `slide` moves all
carriages, all but the first as its mimics; one that does not slide is fixed. A cable by its length and a force by its
displacement are prismatic joints of their names along x of base_link: a length, not a place, so their links have no
geometry. What is commanded by force, tension, pressure or volume has no range of length or angle, which URDF asks of
a joint: a comment names it. The silicone between the links is no rigid link; the joints of effector and ball are
floating.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion
from tripod_sim.errors import SceneError
from tripod_sim.scene.scene import Scene
from tripod_sim.tables.joints import Actuator, Arm, Joints
from tripod_sim.tables.robot import ServoDynamics
from tripod_sim.tables.short_forms import effector_of, joints_of

Frame = tuple[str, str, FloatArray, FloatArray]
"""Parent, child, position [m] and quaternion (x, y, z, w) of the child in the parent."""

BASE, EFFECTOR, PLATE, BALL = "base_link", "effector", "plate", "ball"
ARM = (0.004, 0.02)
"""Thickness and width of an arm as drawn [m]."""
CARRIAGE = (0.023, 0.012, 0.022)
"""Size of a servo's body of the S90 class as drawn [m]."""
DISC_HEIGHT = 0.005
"""Height of the effector as drawn: the thickness of the shipped piece [m]."""
STRAIGHT = np.eye(3)
SILICONE, METAL, WOOD, RED = "0.85 0.75 0.62 1", "0.35 0.37 0.4 1", "0.72 0.55 0.36 1", "0.8 0.16 0.16 1"


def urdf(scene: Scene) -> str:
    """Return the robot of a scene as URDF.

    Raises:
        SceneError: the scene has no actuators, or its maze cannot be built.
    """
    joints = joints_of(scene)
    if not joints:
        raise SceneError(
            f"scene {scene.name!r} has no servos and no other actuators, so there is no robot to describe; "
            "take a scene with [servos], such as tripod"
        )
    robot = ET.Element("robot", name=scene.name)
    _link(robot, BASE)
    slides = [i for i, arm in enumerate(joints.arms) if arm.inward.any()]
    for i, arm in enumerate(joints.arms):
        _carriage(robot, i, arm, joints, slides)
        _arm(robot, i, arm, scene.servo_dynamics or ServoDynamics())
    for actuator in joints.others:
        _length(robot, actuator)
    if effector := effector_of(scene):
        disc = f"cylinder radius={effector.radius:g} length={DISC_HEIGHT:g}"
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


def standing(arm: Arm) -> dict[str, Any]:
    """Return where a servo stands and what its arm looks like, for who draws it: hub [m] and axes of its body as a unit
    quaternion, direction of the slide, length of the arm, how far inward of the axis it grips, and of the rail [m].
    """
    return {
        "hub": np.round(arm.hub, 9).tolist(),
        "quaternion": np.round(quaternion(arm.frame), 9).tolist(),
        "inward": np.round(arm.inward, 9).tolist(),
        "length": arm.length,
        "grip": arm.table.axis_radius - arm.table.clamp_radius,
        "rail": arm.table.axis_radius,
    }


def arm_frames(joints: Joints, at: FloatArray) -> Iterator[Frame]:
    """Yield the links of joints that are `at` commands and slide [m], shape (count + 1,), each after its parent."""
    for i, arm in enumerate(joints.arms):
        yield BASE, f"carriage_{i}", arm.hub + float(at[-1]) * arm.inward, quaternion(arm.frame)
        half = -0.5 * float(at[i])
        yield f"carriage_{i}", f"arm_{i}", np.zeros(3), np.array([0, np.sin(half), 0, np.cos(half)])
    for actuator, value in zip(joints.others, at[len(joints.arms) : -1], strict=True):
        if actuator.unit == "m":
            yield BASE, f"{actuator.name}_end", np.array([float(value), 0, 0]), np.array([0, 0, 0, 1.0])


def _carriage(robot: ET.Element, i: int, arm: Arm, joints: Joints, slides: list[int]) -> None:
    name = f"carriage_{i}"
    _link(robot, name, "box size=" + ",".join(map(str, CARRIAGE)), METAL, (0, 0, -0.5 * CARRIAGE[2]))
    first = slides[0] if slides else None
    kind = "prismatic" if i in slides else "fixed"
    joint = _joint(robot, "slide" if i == first else f"slide_{i}", kind, BASE, name, arm.hub, arm.frame)
    if kind == "fixed":
        return
    ET.SubElement(joint, "axis", xyz=_text(arm.frame.T @ arm.inward))
    ET.SubElement(joint, "limit", lower="0", upper=f"{joints.slide_max:g}", effort="0", velocity="0.1")
    if i != first:
        ET.SubElement(joint, "mimic", joint="slide")


def _arm(robot: ET.Element, i: int, arm: Arm, dynamics: ServoDynamics) -> None:
    thickness, width = ARM
    size = f"box size={thickness:g},{width:g},{arm.length:g}"
    _link(robot, f"arm_{i}", size, METAL, (0, 0, 0.5 * arm.length))
    joint = _joint(robot, f"servo_{i}", "revolute", f"carriage_{i}", f"arm_{i}")
    ET.SubElement(joint, "axis", xyz="0 -1 0")
    ET.SubElement(
        joint,
        "limit",
        lower=f"{arm.low:g}",
        upper=f"{arm.high:g}",
        effort=f"{dynamics.stall_torque:g}",
        velocity=f"{dynamics.speed:g}",
    )


def _length(robot: ET.Element, actuator: Actuator) -> None:
    """Add the joint of an actuator that is commanded by a length [m]; name it in a comment if it is another."""
    name = actuator.name
    if actuator.unit != "m":
        robot.append(ET.Comment(f" {name} is left out: URDF has no joint for a {actuator.quantity} "))
        return
    _link(robot, f"{name}_end")
    joint = _joint(robot, name, "prismatic", BASE, f"{name}_end")
    low, high, most = actuator.low, actuator.high, actuator.effort_max or 0.0
    ET.SubElement(joint, "axis", xyz="1 0 0")
    ET.SubElement(
        joint, "limit", lower=f"{low:g}", upper=f"{high:g}", effort=f"{most:g}", velocity=f"{high - low:g}"
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
    origin: Iterable[float] = (0, 0, 0),
    axes: FloatArray = STRAIGHT,
) -> ET.Element:
    """Add a joint, whose frame has `axes` in columns."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    roll, pitch = np.arctan2(axes[2, 1], axes[2, 2]), -np.arcsin(np.clip(axes[2, 0], -1, 1))
    ET.SubElement(
        joint, "origin", xyz=_text(origin), rpy=_text((roll, pitch, np.arctan2(axes[1, 0], axes[0, 0])))
    )
    return joint


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{round(float(value), 12) + 0.0:.9g}" for value in values)
