"""The robot as URDF and frames: they stand where the physics has its arms, disc, plate and ball."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.messages import assert_names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.scene.description import BASE, arm_frames, urdf
from tripod_sim.tables.short_forms import joints_of


def rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def world(frames: list) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Position and rotation of every frame in base_link."""
    found = {BASE: (np.zeros(3), np.eye(3))}
    for parent, child, position, quaternion in frames:
        p, r = found[parent]
        found[child] = p + r @ position, r @ rotation(quaternion)
    return found


PLACED = [
    "set=[{name='a',along=[1,0,0],beyond=0.045},{name='b',along=[-1,1.7320508075688772,0],beyond=0.045},"
    "{name='c',along=[-1,-1.7320508075688772,0],beyond=0.045}]",
    "servo=[{set='a',hub=[0.06,0,-0.02],axis=[0,-2,0.1],inward=[-3,0.2,0]},"
    "{set='b',hub=[-0.03,0.052,-0.02],axis=[0.866,0.5,0]},{set='c',hub=[-0.03,-0.052,0.03],axis=[-0.866,0.5,0]}]",
]
"""The Tripod with three [[servo]]: one slides, aslant, two do not."""

ROBOTS = [(SHARP, []), ("cross", []), ("two_tripods", ["body.0.mesh.level=1", "body.1.mesh.level=1"]),
          (SHARP, PLACED)]  # fmt: skip

MIXED = [
    "cable=[{name='tendon',range=[0,0.006],tension_max=20,via=[{points=[[0,-0.006,0]]},{body='world',"
    "points=[[0.01,0.02,-0.03]]}]}]",
    "force=[{name='push',set='all',direction=[1,0,1],range=[-0.3,0.3]}]",
]
"""Of the Tripod: a cable and a force."""

ACTUATED = [("finger_cable", []), ("diamond", []), ("trunk", []), ("finger_pneumatic", []), (SHARP, MIXED)]


@pytest.mark.parametrize(("name", "overrides"), ROBOTS)
def test_arms_carry_the_clamped_nodes_as_the_simulation_moves_them(name: str, overrides: list[str]) -> None:
    level = ["mesh.level=1"] if name != "two_tripods" else []
    simulation = Simulation(load_scene(name, [*level, *overrides]))
    rest, arms = simulation.mesh.nodes, simulation.joints
    joints = np.append(np.linspace(-0.4, 0.2, arms.count), 0.01)
    before = world(list(arm_frames(arms, np.zeros(arms.count + 1))))
    for k in range(40):
        simulation.step(joints * (k + 1) / 40)
    after = world(list(arm_frames(arms, joints)))
    frames = simulation._system.groups.driven
    assert len(frames) == arms.count
    for i, frame in enumerate(frames):
        held = frame.nodes
        (p0, r0), (p1, r1) = before[f"arm_{i}"], after[f"arm_{i}"]
        expected = p1 + (rest[held] - p0) @ r0 @ r1.T
        np.testing.assert_allclose(simulation.positions[held], expected, atol=1e-9)


@pytest.mark.parametrize(("name", "overrides"), [*ROBOTS, *ACTUATED])
def test_joints_of_the_urdf_give_the_same_frames(name: str, overrides: list[str]) -> None:
    scene = load_scene(name, overrides)
    actuators = joints_of(scene).actuators
    joints = np.append(np.linspace(-1.1, 0.3, len(actuators)), 0.02)
    root = ET.fromstring(urdf(scene))
    values = dict(zip([*(a.name for a in actuators), "slide"], joints, strict=True))
    found = {BASE: (np.zeros(3), np.eye(3))}
    for joint in root.iter("joint"):
        mimic = joint.find("mimic")
        value = values.get(mimic.get("joint") if mimic is not None else joint.get("name"))
        if value is None and joint.get("type") != "fixed":
            continue
        origin = joint.find("origin")
        x, rpy = np.fromstring(origin.get("xyz"), sep=" "), np.fromstring(origin.get("rpy"), sep=" ")
        p, r = found[joint.find("parent").get("link")]
        p, r = p + r @ x, r @ Rotation.from_euler("xyz", rpy).as_matrix()
        if joint.get("type") == "prismatic":
            p = p + r @ np.fromstring(joint.find("axis").get("xyz"), sep=" ") * value
        elif joint.get("type") == "revolute":
            axis = np.fromstring(joint.find("axis").get("xyz"), sep=" ")
            r = r @ rotation(np.array([*axis * np.sin(value / 2), np.cos(value / 2)]))
        found[joint.find("child").get("link")] = p, r
    expected = world(list(arm_frames(joints_of(scene), joints)))
    assert set(found) == set(expected)
    for link, (p, r) in expected.items():
        np.testing.assert_allclose(found[link][0], p, atol=1e-8)
        np.testing.assert_allclose(found[link][1], r, atol=1e-8)


@pytest.mark.parametrize(
    ("scene", "more"),
    [("tripod", set()), ("maze", {"plate", "ball"}), ("tripod_ball", {"ball"})],
)
def test_it_has_the_links_that_the_scene_has(scene: str, more: set[str]) -> None:
    root = ET.fromstring(urdf(load_scene(scene)))
    arms = {f"{kind}_{i}" for kind in ("carriage", "arm") for i in range(3)}
    links = {link.get("name") for link in root.iter("link")}
    assert links == {"base_link", "effector"} | arms | more
    children = [joint.find("child").get("link") for joint in root.iter("joint")]
    assert sorted(children) == sorted(links - {"base_link"}), "a tree: one parent each"


def test_limits_are_those_of_the_scene() -> None:
    root = ET.fromstring(urdf(load_scene("tripod", ["servos.angle_min=-1.5", "servo_dynamics.speed=7"])))
    limit = next(j for j in root.iter("joint") if j.get("name") == "servo_1").find("limit")
    assert (limit.get("lower"), limit.get("velocity")) == ("-1.5", "7")


@pytest.mark.parametrize(("name", "overrides"), [*ROBOTS, *ACTUATED, ("examples/emio.toml", [])])
def test_what_moves_is_a_joint_that_is_commanded_and_names_are_there_once(
    name: str, overrides: list[str]
) -> None:
    scene = load_scene(name, overrides)
    root, joints = ET.fromstring(urdf(scene)), joints_of(scene)
    every = [joint.get("name") for joint in root.iter("joint")]
    assert len(every) == len(set(every))
    kinds = {
        joint.get("name"): joint.get("type") for joint in root.iter("joint") if joint.find("mimic") is None
    }
    moving = {n: kind for n, kind in kinds.items() if kind not in ("fixed", "floating")}
    slide = {"slide": "prismatic"} if joints.slides else {}
    kind_of = {"rad": "revolute", "m": "prismatic"}
    assert moving == slide | {a.name: kind_of[a.unit] for a in joints.actuators if a.unit in kind_of}


def test_a_scene_without_actuators_is_no_robot() -> None:
    with raises_naming(SceneError, "scene 'cloth'", "no servos", "no other actuators"):
        urdf(load_scene("cloth"))


def test_what_urdf_has_no_joint_for_is_named() -> None:
    for name, overrides, left_out in (
        ("finger_pneumatic", [], "pressure"),
        ("finger_pneumatic", ["chamber.0.command=volume", "chamber.0.range=[0,1e-6]"], "volume"),
        (SHARP, MIXED, "push force"),
    ):
        told = [
            line for line in urdf(load_scene(name, ["motion=off", *overrides])).splitlines() if "<!--" in line
        ]
        assert_names(" ".join(told), *left_out.split())
    limit = next(
        j for j in ET.fromstring(urdf(load_scene(SHARP, MIXED))).iter("joint") if j.get("name") == "tendon"
    ).find("limit")
    assert limit is not None
    assert limit.attrib == {"lower": "0", "upper": "0.006", "effort": "20", "velocity": "0.006"}
