"""The scene of Emio, four legs that do not fit at rest; the data themselves are not here."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.emio import POINTS, SCENE, YOUNG, fitted, wrong
from tests.messages import raises_naming
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.model import Rest, plainly, predict, rest_states
from tripod_identify.observe import parse_point, plain_sensor, sources_of
from tripod_identify.score import score
from tripod_sim import load_scene
from tripod_sim.state import State
from tripod_sim.system import System

COARSE = ["body.0.mesh.cells=[1,1,10]"]
POSES = np.array(
    [
        *([1.1, -1.1, 1.1, -1.1], [1.1, -1.6, 1.1, -0.6], [0.6, -1.1, 1.6, -1.1], [1.3, -0.9, 0.9, -1.3]),
        *([1.0, -1.4, 1.2, -0.8], [1.5, -1.5, 1.5, -1.5], [0.4, -0.4, 0.4, -0.4], [0.8, -1.0, 1.4, -1.2]),
    ]
)
TRACKER = tuple(Channel("tracker", axis) for axis in range(3))


def poses(count: int, *, name: str = "tracker") -> Measured:
    """Return poses of which nothing was measured yet."""
    channels = tuple(replace(c, source=name) for c in TRACKER)
    return Measured(None, POSES[:count], None, channels, np.zeros((count, 3)))


def test_the_scene_is_short_and_hangs_straight_until_a_motor_turns() -> None:
    assert len(SCENE.read_text().splitlines()) <= 60
    scene = load_scene(SCENE, COARSE)
    level, tipped = predict(plainly(scene), poses(2), POINTS)
    assert level[[0, 2]] == pytest.approx([0, 0], abs=1e-5)
    assert tipped[0] > 0.01, "the leg at x swung out and the one opposite in, as measured"
    assert abs(tipped[2]) < 1e-4


def test_a_point_on_the_platform_moves_as_one_in_its_frame() -> None:
    scene, point = load_scene(SCENE, COARSE), parse_point("tracker=effector:0,-0.027,0")
    assert point == POINTS[0]
    assert sources_of(scene, (point,)) == ("effector", "imu", "tracker")
    seen = predict(plainly(scene), poses(2), (point,))
    told = replace(plainly(scene), sensor=replace(plain_sensor(), mount=np.array([0, -0.027, 0])))
    same = predict(told, poses(2, name="effector"), ())
    assert seen == pytest.approx(same, abs=1e-12)
    centre = predict(plainly(scene), poses(2, name="effector"), ())
    assert np.linalg.norm(seen - centre, axis=1) == pytest.approx(0.027, abs=1e-12)
    with raises_naming(DataError, "--point tracker=effector", "'silicone'", "missing"):
        sources_of(load_scene("silicone"), (point,))


def test_legs_are_bent_once_and_it_is_shown() -> None:
    """States of one modulus serve those of another; bending the legs again would take as long as many poses."""
    scene, data, shown = load_scene(SCENE, COARSE), poses(3), list[float]()
    told = plainly(scene)
    joints = told.joints(data.joints(scene))
    first = Rest(scene, data, POINTS, shown.append)
    states = rest_states(first, joints, progress=shown.append)
    assert len(shown) > 6
    assert shown[-3:] == pytest.approx([1 / 3, 2 / 3, 1])
    assert sorted(shown[:-3]) == shown[:-3]
    assert shown[-4] < 1, "of the way that the legs are bent"
    other = Rest(load_scene(SCENE, [*COARSE, f"{YOUNG}=6e6"]), data, POINTS)
    asked = list[bool]()
    bend = other.system.assembly
    assert bend

    def bending(system: System) -> State:
        asked.append(True)
        return bend(system)

    other.system.assembly = bending
    near = [other.observer.see(s, told.sensor) for s in rest_states(other, joints, states)]
    assert not asked
    far = [other.observer.see(s, told.sensor) for s in rest_states(other, joints)]
    assert asked
    assert np.array(near) == pytest.approx(np.array(far), abs=1e-6)


def test_a_modulus_is_found_again_and_wrong_motors_score_much_worse() -> None:
    scene = load_scene(SCENE, COARSE)
    truth = load_scene(SCENE, [*COARSE, f"{YOUNG}=6e6"])
    data = replace(
        poses(8), values=predict(plainly(truth), poses(8), POINTS) + np.array([0.01, -0.02, 0.003])
    )
    best, result = fitted(scene, data)
    young = float(np.exp(result.u[0]))
    assert young == pytest.approx(6e6, rel=1e-3)
    assert best.body[0].material is not None
    assert best.body[0].material.young == pytest.approx(young)
    for name, bad in wrong(data).items():
        distance = score(predict(plainly(best), bad, POINTS), bad, "translation").distance
        assert distance is not None
        assert distance.mean > 8e-4, name
