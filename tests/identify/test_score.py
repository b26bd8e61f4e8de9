"""Scores: predictions are what the simulator shows, errors put in come out, alignment takes away its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.identify.robots import MOVING, PLACE, POSE, beam, commands, measured, tripod, write_csv
from tests.messages import assert_names, raises_naming
from tripod_host.rotations import rotation_matrix
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.model import plainly, predict
from tripod_identify.observe import Point
from tripod_identify.score import score
from tripod_sim.simulation import Simulation

TIP = tuple(Channel("tip", axis) for axis in range(3))


def test_a_pose_is_where_the_simulator_comes_to_rest() -> None:
    scene = tripod("inertia=off", "damping=off")
    angles, slide = commands(2)
    data = measured(plainly(scene), angles, slide)
    simulation = Simulation(scene)
    for k in range(2):
        simulation.step([*angles[k], slide[k]])
        assert simulation.effector is not None
        assert data.values[k, :3] == pytest.approx(simulation.effector.position, abs=1e-7)
        turn = rotation_matrix(data.values[k, 3:])
        x, y, z, w = simulation.effector.quaternion
        assert turn @ [0, 0, 1] == pytest.approx(
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], abs=1e-5
        )


def test_a_motion_is_stepped_and_joined_by_lines() -> None:
    scene = beam(MOVING)
    simulation = Simulation(scene)
    ways = [simulation.markers[0].copy()]
    for _ in range(4):
        simulation.step()
        ways.append(simulation.markers[0].copy())
    times = np.array([0.0, 0.005, 0.0125, 0.02])
    found = predict(plainly(scene), Measured(times, None, None, TIP, np.zeros((4, 3))), ())
    assert np.array_equal(found[[0, 1, 3]], [ways[0], ways[1], ways[4]])
    assert found[2] == pytest.approx(0.5 * (ways[2] + ways[3]), abs=1e-15)
    assert np.abs(found[3] - found[0]).max() > 1e-4, "it falls"


def test_commands_of_a_motion_are_followed() -> None:
    scene = tripod("solver.mode=newton", "dt=0.005")
    times = np.linspace(0, 0.1, 5)
    angles = np.linspace(0, -0.3, 5)[:, None] * np.ones(3)
    found = predict(plainly(scene), Measured(times, angles, np.zeros(5), PLACE, np.zeros((5, 3))), ())
    simulation = Simulation(scene)
    for k in range(20):
        simulation.step([*np.full(3, -0.3 * (k + 1) / 20), 0.0])
    assert simulation.effector is not None
    assert found[-1] == pytest.approx(simulation.effector.position, abs=1e-9)


def test_a_point_turns_with_its_set() -> None:
    scene = beam()
    glued = (Point("far", "tip", (0.1, 0.01, 0.06)), Point("middle", "tip", (0.1, 0.01, 0.01)))
    channels = (*TIP, *(Channel("far", a) for a in range(3)), *(Channel("middle", a) for a in range(3)))
    found = predict(plainly(scene), Measured(None, None, None, channels, np.zeros((1, 9))), glued)[0]
    assert found[6:] == pytest.approx(found[:3], abs=1e-12)
    arm = found[3:6] - found[6:]
    assert np.linalg.norm(arm) == pytest.approx(0.05, abs=1e-12)
    assert arm[0] > 0.005, "the tip of a beam that sags turns its top outwards"


@pytest.fixture(scope="module")
def seen() -> Measured:
    return measured(plainly(tripod()), *commands(6))


def test_errors_that_are_put_in_come_out(seen: Measured) -> None:
    off = np.zeros_like(seen.values)
    off[2, :3], off[4, 4] = [0.003, 0.0, 0.004], 0.1
    found = score(seen.values + off, seen)
    assert found.distance is not None
    assert found.angle is not None
    assert found.distance.largest == pytest.approx(0.005)
    assert found.distance.mean == pytest.approx(0.005 / 6)
    assert found.channels["effector.x"].rms == pytest.approx(0.003 / np.sqrt(6))
    assert found.angle.largest == pytest.approx(0.1)
    assert found.residuals[2, 0] == pytest.approx(-0.003), "measured minus predicted"


def test_alignment_takes_away_what_it_names_and_no_more(seen: Measured) -> None:
    shift, R = np.array([0.01, -0.02, 0.03]), rotation_matrix(np.array([0.1, -0.2, 0.3]))
    moved = seen.values.copy()
    moved[:, :3] = seen.values[:, :3] @ R.T + shift
    assert score(moved, seen).distance.mean > 0.01
    translated, rigid = score(moved, seen, "translation"), score(moved, seen, "rigid")
    assert translated.residuals[:, :3].mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-15)
    assert 1e-4 < translated.distance.mean < score(moved, seen).distance.mean
    assert rigid.distance.largest < 1e-15
    bent = moved.copy()
    bent[0, 2] += 0.01
    assert score(bent, seen, "rigid").distance.largest > 1e-3


def test_rigid_needs_three_places(seen: Measured) -> None:
    with raises_naming(DataError, "--align rigid", "x, y and z", "have 2"):
        score(seen.values[:2], seen.rows(np.arange(6) < 2), "rigid")


def test_exchanged_motors_and_a_shrunk_range_score_worse(seen: Measured) -> None:
    told, empty = (
        plainly(tripod()),
        Measured(None, seen.commands[:, [1, 0, 2]], seen.slide, POSE, seen.values),
    )
    noisy = score(predict(told, seen, ()), seen, "translation").distance.mean
    assert score(predict(told, empty, ()), empty, "translation").distance.mean > noisy + 1e-3
    shrunk = Measured(None, 0.9 * seen.commands, seen.slide, POSE, seen.values)
    assert score(predict(told, shrunk, ()), shrunk, "translation").distance.mean > noisy + 2e-4


def test_the_command_tells_and_writes(
    seen: Measured, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from tripod_bringup.score_command import score_command

    path = write_csv(tmp_path / "poses.csv", seen)
    more = {"overrides": ["mesh.element=h8_modes"], "points": [], "renames": [], "poses": False}
    out = {"report": tmp_path / "s.html", "plot": tmp_path / "s.png"}
    assert score_command("tripod", path, align="none", as_json=True, quiet=True, **more, **out) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rows"] == 6
    assert found["distance"]["largest"] < 1e-8
    page = (tmp_path / "s.html").read_text()
    assert_names(page, "place [mm]", "data:image/png;base64,")
    assert (tmp_path / "s.png").read_bytes()[:4] == b"\x89PNG"
    none = {"report": None, "plot": None}
    assert score_command("tripod", path, align="bent", as_json=False, quiet=True, **more, **none) == 2
    assert (
        score_command(
            "pendulum", path, align="none", as_json=False, quiet=True, **more | {"overrides": []}, **none
        )
        == 2
    )
    away = none | {"report": tmp_path / "gone" / "s.html"}
    assert score_command("tripod", path, align="none", as_json=False, quiet=True, **more, **away) == 2
    bent, pendulum, gone = capsys.readouterr().err.splitlines()
    assert_names(bent, "tripod identify: ", "--align", "'bent'", "none, translation, rigid")
    assert_names(pendulum, "tripod identify: ", "servo_0, servo_1, servo_2", "0 servos")
    assert_names(gone, "tripod identify: ", away["report"], f"no directory {tmp_path}/gone")
