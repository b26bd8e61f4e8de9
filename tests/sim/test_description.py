"""The robot as URDF and frames: they stand where the physics has its arms, disc, plate and ball."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.description import BASE, arm_frames, urdf


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


def test_arms_carry_the_clamped_nodes_as_the_simulation_moves_them() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
    rest = simulation.mesh.nodes
    servos = simulation.scene.servos
    joints = np.array([-0.4, 0.3, -1.1, 0.02])
    before = world(list(arm_frames(servos, np.zeros(4))))
    for k in range(60):
        simulation.step(joints * (k + 1) / 60)
    after = world(list(arm_frames(servos, joints)))
    for i in range(3):
        azimuth = 2 * np.pi * i / 3
        held = rest @ [np.cos(azimuth), np.sin(azimuth), 0] >= servos.clamp_radius - 1e-9
        assert held.any()
        (p0, r0), (p1, r1) = before[f"arm_{i}"], after[f"arm_{i}"]
        expected = p1 + (rest[held] - p0) @ r0 @ r1.T
        np.testing.assert_allclose(simulation.positions[: len(rest)][held], expected, atol=1e-9)


def test_joints_of_the_urdf_give_the_same_frames() -> None:
    scene = load_scene("tripod")
    joints = np.array([-0.4, 0.3, -1.1, 0.02])
    root = ET.fromstring(urdf(scene))
    values = {"slide": joints[3], **{f"servo_{i}": joints[i] for i in range(3)}}
    found = {BASE: (np.zeros(3), np.eye(3))}
    for joint in root.iter("joint"):
        mimic = joint.find("mimic")
        value = values.get(mimic.get("joint") if mimic is not None else joint.get("name"))
        if value is None:
            continue
        origin = joint.find("origin")
        x, (_, _, yaw) = np.fromstring(origin.get("xyz"), sep=" "), np.fromstring(origin.get("rpy"), sep=" ")
        axis = np.fromstring(joint.find("axis").get("xyz"), sep=" ")
        p, r = found[joint.find("parent").get("link")]
        turned = r @ rotation(np.array([0, 0, np.sin(yaw / 2), np.cos(yaw / 2)]))
        if joint.get("type") == "prismatic":
            moved = p + r @ x + turned @ axis * value, turned
        else:
            q = np.array([*axis * np.sin(value / 2), np.cos(value / 2)])
            moved = p + r @ x, turned @ rotation(q)
        found[joint.find("child").get("link")] = moved
    expected = world(list(arm_frames(scene.servos, joints)))
    assert set(found) == set(expected)
    for name, (p, r) in expected.items():
        np.testing.assert_allclose(found[name][0], p, atol=1e-8)
        np.testing.assert_allclose(found[name][1], r, atol=1e-8)


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


def test_a_scene_without_servos_is_no_robot() -> None:
    with pytest.raises(SceneError, match="scene 'cloth' has no servos: there is no robot to describe"):
        urdf(load_scene("cloth"))
