"""The rules of playing: the way, the observer, the control, path files; games won on the simulator."""

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, names, raises_naming
from tripod_play.control import ControlSettings, acceleration, given_by, tilt_for
from tripod_play.errors import PlayError
from tripod_play.follow import servo_path
from tripod_play.observer import Observer, ObserverSettings
from tripod_play.path_file import Kind, read_path
from tripod_play.plan import PlannerThread, Stretch, corners, shortest_way
from tripod_play.solve import Eye, solve
from tripod_play.tilt import lever_of, tilt_map
from tripod_sim import Simulation, load_scene
from tripod_sim.maze.board import maze_names, read_maze
from tripod_sim.maze.grid import parse_maze

LOOP = parse_maze("+---+---+---+\n| S   o   G |\n+   +   +   +\n|           |\n+---+---+---+\n", "loop")


def test_the_shortest_way_goes_round_a_hole() -> None:
    assert shortest_way(LOOP, LOOP.start) == [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2)]
    assert corners(shortest_way(LOOP, LOOP.start)) == [(1, 0), (1, 2), (0, 2)]
    for name in maze_names():
        grid = read_maze(name)
        way = shortest_way(grid, grid.start)
        assert len(way) == grid.distances(grid.start)[grid.goal] + 1
        assert all(b in grid.neighbours(a) for a, b in pairwise(way))
        assert not set(way) & grid.holes


def test_the_guide_leads_from_any_cell_and_back_from_the_brink() -> None:
    guide = PlannerThread(LOOP, 0.01)
    first = guide.stretch(np.array([-0.01, 0.006]))
    np.testing.assert_allclose(first.direction, [0, -1])
    np.testing.assert_allclose(first.end, [-0.01, -0.005])
    assert not first.last
    assert guide.stretch(np.array([0.01, -0.005])).last
    assert not guide.stretch(np.array([0.01, 0.005])).direction.any(), "in the goal"
    brink = guide.stretch(np.array([0.0, 0.005]))
    assert LOOP.cell_at(*brink.end, 0.01) not in LOOP.holes


def test_the_tilt_gives_the_acceleration_that_was_asked() -> None:
    settings = ControlSettings()
    wanted = np.array([0.2, -0.1])
    tilt = tilt_for(settings, wanted)
    np.testing.assert_allclose(given_by(settings, tilt), wanted, rtol=1e-12)
    assert tilt[1] > 0, "a turn about +y lowers +x"
    assert tilt[0] > 0, "a turn about +x raises +y"
    cut = tilt_for(settings, np.array([30.0, 15.0]))
    assert np.abs(cut).max() == pytest.approx(settings.tilt_max)
    assert given_by(settings, cut)[0] == pytest.approx(2 * given_by(settings, cut)[1])


def test_control_pulls_to_the_middle_first_and_stops_at_the_end() -> None:
    s = ControlSettings()
    stretch = Stretch(np.zeros(2), np.array([0.02, 0.0]), np.array([1.0, 0.0]), last=True)
    zero = np.zeros(2)
    assert acceleration(s, stretch, np.array([0.0, 0.0]), zero)[0] == pytest.approx(s.pace * s.speed)
    aside = acceleration(s, stretch, np.array([0.0, 0.002]), zero)
    assert aside[1] == pytest.approx(-s.stiffness * 0.002)
    assert aside[0] == 0
    fast = acceleration(s, stretch, np.array([0.0195, 0.0]), np.array([0.05, 0.0]))
    assert fast[0] < 0
    assert acceleration(s, stretch, np.array([0.022, 0.0]), zero)[0] < 0


def test_by_a_hole_the_ball_goes_slower_and_stops_at_the_end() -> None:
    guide, s = PlannerThread(LOOP, 0.01), ControlSettings()
    below = guide.stretch(np.array([-0.01, -0.005]))  # along the lower row, past the hole above its middle
    assert below.by_hole
    assert guide.stretch(np.array([0.01, -0.005])).by_hole, "the hole is next to the goal"
    rows = (
        "+---+---+---+---+",
        "| S             |",
        "+---+---+---+   +",
        "| o   G         |",
        "+---+---+---+---+",
    )
    far = parse_maze("\n".join(rows) + "\n", "far")
    assert not PlannerThread(far, 0.01).stretch(np.array([-0.015, 0.005])).by_hole
    assert PlannerThread(far, 0.01).stretch(np.array([0.015, -0.005])).by_hole
    along = acceleration(s, below, below.begin, np.zeros(2)) @ below.direction
    assert along == pytest.approx(s.pace * s.hole_speed)
    arriving = acceleration(s, below, below.end, 0.01 * below.direction) @ below.direction
    assert arriving == pytest.approx(-s.pace * 0.01)


def test_the_observer_sees_the_present_through_delay_and_noise() -> None:
    """A ball under known pushes and an unknown constant one, seen 60 ms late with 0.3 mm of noise."""
    settings, rng = ObserverSettings(delay=0.06), np.random.default_rng(0)
    observer, h = Observer(settings), settings.period
    x, v, given, seen, errors, drifts = np.zeros(2), np.zeros(2), np.zeros(2), [np.zeros(2)] * 4, [], []
    unknown = np.array([0.02, -0.03])
    for k in range(400):
        asked = 0.2 * np.array([np.sin(0.11 * k), np.cos(0.07 * k)])
        observer.update(asked, seen[-4] + 3e-4 * rng.standard_normal(2))
        after = asked + (given - asked) * np.exp(-h / settings.lag)
        a = 0.5 * (given + after) + unknown
        x, v, given = x + h * v + 0.5 * h * h * a, v + h * a, after
        seen.append(x)
        if k > 100:
            errors.append(observer.position - x)
            drifts.append(observer.velocity - v)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5e-3
    assert np.sqrt(np.mean(np.square(drifts))) < 1e-2
    late = np.sqrt(np.mean(np.sum((np.array(seen[100:-4]) - np.array(seen[104:])) ** 2, axis=1)))
    assert late > 3 * np.sqrt(np.mean(np.square(errors))), "without it the delay alone would cost more"


def test_servo_angles_tilt_the_plate_as_asked() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1", "ball=off"]))
    w = simulation.compliance().w
    tilts = tilt_map(w, simulation.state.joints[:3], -2.1, 0.6)
    joints = simulation.command
    for tilt in ((0.05, 0.0), (0.0, -0.05)):
        simulation.reset()
        joints[:3] = tilts(np.array(tilt))
        for k in range(100):
            joints[:3] = -1.4965 + (tilts(np.array(tilt)) + 1.4965) * min(k / 40, 1)
            simulation.step(joints)
        r = simulation.state.rotations[0]
        np.testing.assert_allclose([r[2, 1], -r[2, 0]], np.sin(tilt), rtol=0, atol=2e-3)
        shift = simulation.state.centres[0][:2]
        np.testing.assert_allclose(shift, lever_of(w) * np.array([tilt[1], -tilt[0]]), rtol=0, atol=1e-4)
    with raises_naming(PlayError, "servos", "effector", "working pose"):
        tilt_map(np.eye(9), np.zeros(3), -2.1, 0.6)


def test_the_first_maze_is_solved_with_noise_and_delay_and_to_the_same_bits() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1", "maze.source=first"]))
    solution = solve(simulation, 1)
    assert solution.solved, solution.why
    assert 2 < solution.time < 20
    again = solve(simulation, 1)
    assert again.track.tobytes() == solution.track.tobytes()
    assert solve(simulation, 2).track.tobytes() != solution.track.tobytes()
    blind = solve(simulation, 0, eye=Eye(dropout=0.2))
    assert blind.solved, blind.why


def test_a_game_that_cannot_be_is_refused() -> None:
    with raises_naming(PlayError, "'tripod'", "no maze"):
        solve(Simulation(load_scene("tripod", ["mesh.level=1"])), 0)
    with raises_naming(PlayError, "period 0.02 s", "multiple", "dt", "0.003 s"):
        solve(Simulation(load_scene("maze", ["mesh.level=1", "dt=0.003"])), 0)
    maze = Simulation(load_scene("maze", ["mesh.level=1"]))
    for limit in (-1.0, np.nan, np.inf):
        with raises_naming(PlayError, "limit", f"{limit:g} s", "finite", "not negative"):
            solve(maze, 0, limit=limit)
    assert solve(maze, 0, limit=0.0).track.shape == (0, 2)
    with raises_naming(PlayError, "eye noise", "nan", "0 to 0.1"):
        Eye(noise=float("nan"))


def write(folder: Path, text: str, name: str = "p.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_csv_and_json_say_the_same(tmp_path: Path) -> None:
    csv = read_path(write(tmp_path, "# tilts\ntime, tilt_x_deg, tilt_z_deg\n0, 0, 0\n0.5, 5, -10\n"))
    rows = [
        {"time": 0, "tilt_x": 0, "tilt_y": 0},
        {"time": 0.5, "tilt_x": np.radians(5), "tilt_y": np.radians(10)},
    ]
    listed = read_path(write(tmp_path, json.dumps(rows), "a.json"))
    columns = {k: [row[k] for row in rows] for k in rows[0]}
    table = read_path(write(tmp_path, json.dumps(columns), "b.json"))
    for other in (listed, table):
        assert other.kind is csv.kind is Kind.TILT
        np.testing.assert_allclose(other.values, csv.values, rtol=1e-12)
    np.testing.assert_allclose(csv.at(0.25), np.radians([2.5, 5]))
    place = read_path(write(tmp_path, "time,x_mm,y_mm,z_mm\n1,2,3,-8\n"))
    assert place.kind is Kind.POSITION
    np.testing.assert_allclose(place.values, [[0.002, 0.003, -0.008]])


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("time,tilt_x,tilt_y\n0,0,0\n1,0,0\n0.5,0,0\n", ("line 4", "0.5 s after 1 s")),
        ("time,tilt_x,tilt_y\n0,0,0\n0,0,0\n", ("line 3", "0 s after 0 s")),
        ("time,tilt_x,tilt_y\n-1,0,0\n", ("line 2", "time", "-1 s", "not be negative")),
        ("time,tilt_x,tilt_y\n0,nan,0\n", ("line 2", "tilt_x", "'nan'", "finite")),
        ("time,tilt_x,tilt_y\n0,inf,0\n", ("line 2", "tilt_x", "'inf'", "finite")),
        ("time,tilt_x,tilt_y\n0,0,0\n1,0,0.7\n", ("line 3", "tilt_y", "0.7 rad", "up to 0.5 rad")),
        ("time,x,y,z\n0,0,0,-8\n", ("line 2", "z", "8 m", "up to 0.15 m")),
        ("time,tilt_x,tilt_y\n0,0\n", ("line 2", "2 values", "time, tilt_x, tilt_y")),
        ("time,pitch,roll\n0,0,0\n", ("time, pitch, roll", "tilt_x, tilt_y", "tilt_x, tilt_z")),
        ("time,tilt_x_mm,tilt_y\n0,0,0\n", ("tilt_x_mm", "unit", "tilt")),
        ("time,tilt_x,tilt_y\n", ("0 key points", "1 to")),
        ("", ("empty", "time, tilt_x, tilt_y")),
    ],
)
def test_a_bad_path_file_is_refused_with_its_line(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    with raises_naming(PlayError, "p.csv", *named) as caught:
        read_path(write(tmp_path, text))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("p.json", "{", ("JSON",)),
        ("p.json", '{"time": [0, 1], "tilt_x": [0]}', ("length", "time 2", "tilt_x 1")),
        ("p.json", '[{"time": 0, "tilt_x": 0, "tilt_y": 0}, {"time": 1}]', ("key point 2", "tilt_x")),
        ("p.json", '[{"time": true, "tilt_x": 0, "tilt_y": 0}]', ("key point 1", "time", "'True'")),
        ("p.txt", "", ("'.txt'", ".csv, .json")),
    ],
)
def test_a_bad_json_path_is_refused(tmp_path: Path, name: str, text: str, named: tuple[str, ...]) -> None:
    with raises_naming(PlayError, name, *named):
        read_path(write(tmp_path, text, name))


def test_a_path_too_fast_for_the_servos_is_slowed_where_it_must_be(tmp_path: Path) -> None:
    scene = load_scene("maze", ["mesh.level=1"])
    points = read_path(write(tmp_path, "time,tilt_x,tilt_y\n0,0,0\n0.5,0.05,0\n0.52,-0.05,0\n1.5,0,0\n"))
    path = servo_path(scene, points, 2.0)
    assert len(path.limits) == 1
    limit = path.limits[0]
    assert (limit.begin, limit.end) == pytest.approx((0.5, 0.52))
    assert re.search(r"servo_[012]\b", limit.why)
    assert_names(limit.why, "rad/s", 2)
    speeds = np.abs(np.diff(path.angles, axis=0)).max(axis=1) / np.diff(path.times)
    assert speeds.max() == pytest.approx(2.0, rel=1e-6)
    assert path.times[-1] > 1.55
    assert path.file_times[-1] == 1.5
    slow = servo_path(scene, points, 50.0)
    assert slow.limits == ()
    assert slow.times[-1] == pytest.approx(1.5)
    simulation = Simulation(load_scene("maze", ["mesh.level=1", "ball=off"]))
    joints = simulation.command
    for k in range(100):
        joints[:3] = slow.at((k + 1) * 0.005)
        simulation.step(joints)
    assert simulation.state.rotations[0][2, 1] == pytest.approx(np.sin(0.05), abs=2e-3)


def test_a_target_out_of_reach_is_said_to_be(tmp_path: Path) -> None:
    scene = load_scene("maze", ["mesh.level=1", "ball=off"])
    points = read_path(write(tmp_path, "time,x,y,z\n0,0,0,-0.0084\n1,0,0,0.06\n"))
    path = servo_path(scene, points, 6.0)
    far = [limit for limit in path.limits if names(limit.why, "out of reach", "mm")]
    assert len(far) == 1
    assert far[0].end == 1.0
    assert 0.3 < far[0].begin < 1.0
