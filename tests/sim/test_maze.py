"""Mazes: text, generator, plate; and the ball in one on the robot."""

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.ball.ball import Place, account
from tripod_sim.maze.board import make_board, mass_points, maze_names, read_maze
from tripod_sim.maze.grid import maze_to_text, parse_maze, random_maze
from tripod_sim.tables.maze import Maze

SMALL = """# remarks
+---+---+---+
| S     |   |
+   +---+   +
|   | o   G |
+   +   +---+
|           |
+---+---+---+
"""


def refusal(text: str) -> str:
    with pytest.raises(SceneError) as caught:
        parse_maze(text, "maze 'm'")
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_text_becomes_walls_and_text_again() -> None:
    grid = parse_maze(SMALL.replace("o", " "), "m")
    assert (grid.rows, grid.columns, grid.start, grid.goal) == (3, 3, (0, 0), (1, 2))
    assert grid.neighbours((1, 1)) == [(2, 1), (1, 2)]
    assert grid.neighbours((0, 2)) == [(1, 2)]
    assert maze_to_text(grid) == SMALL.replace("o", " ").replace("# remarks\n", "")
    assert grid.centre((0, 0), 0.01) == pytest.approx((-0.01, 0.01))
    assert grid.cell_at(-0.012, 0.013, 0.01) == (0, 0)
    assert grid.cell_at(1.0, -1.0, 0.01) == (2, 2)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (SMALL, ("goal (row 2, column 3)", "start (row 1, column 1)", "hole")),
        (
            SMALL.replace("+---+---+---+\n| S", "+   +---+---+\n| S"),
            ("not closed", "outer wall", "above column 1"),
        ),
        (SMALL.replace("G |", "G  "), ("not closed", "outer wall", "right of row 2")),
        (SMALL.replace("S", " "), ("0 cells", "S (start)", "one")),
        (SMALL.replace("o", "G"), ("2 cells", "G (goal)")),
        (SMALL.replace("o", "x"), ("line 5, column 6", "cell", "' '", "'S'", "'G'", "'o'", "' x '")),
        (SMALL.replace("+   +---+   +", "+   +-- +   +"), ("line 4, column 6", "wall '---'", "three spaces")),
        (SMALL.replace("+   +---+   +", "    +---+   +"), ("line 4, column 1", "post '+'", "found ' '")),
        (SMALL.replace("|   | o", "|   x o"), ("line 5, column 5", "wall '|'", "space", "found 'x'")),
        ("+---+\n", ("1 lines",)),
        ("", ("0 lines",)),
        ("+--+\n|  |\n+--+\n", ("4 characters wide",)),
    ],
)
def test_bad_text_is_refused_with_its_place(text: str, named: tuple[str, ...]) -> None:
    assert_names(refusal(text), "maze 'm'", *named)


@pytest.mark.parametrize("seed", range(5))
def test_a_random_maze_has_one_way_between_any_two_cells(seed: int) -> None:
    grid = random_maze(seed, 5, 8, holes=2)
    doors = (grid.above[1:-1] == 0).sum() + (grid.left[:, 1:-1] == 0).sum()
    assert doors == 5 * 8 - 1
    assert len(random_maze(seed, 5, 8).distances((0, 0))) == 40
    assert len(grid.holes) <= 2
    assert grid.goal in grid.distances(grid.start)
    again = parse_maze(maze_to_text(grid), "m")
    assert maze_to_text(again) == maze_to_text(random_maze(seed, 5, 8, holes=2))
    assert maze_to_text(random_maze(seed + 1, 5, 8)) != maze_to_text(random_maze(seed, 5, 8))


def test_shipped_mazes_load_and_can_be_solved() -> None:
    assert len(maze_names()) >= 3
    for name in maze_names():
        grid = read_maze(name)
        assert grid.goal in grid.distances(grid.start)
    assert read_maze("holes").holes


@pytest.mark.parametrize(
    ("source", "named"),
    [
        ("labyrint", ("maze.source is 'labyrint'", "first", "holes", "labyrinth", "random:SEED")),
        ("random:", ("'random:'", "random:SEED", "random:SEED:COLUMNSxROWS")),
        ("random:1:3", ("'random:1:3'", "random:SEED")),
        ("random:1:1x1", ("1 x 1 cells", "2 to 10000 cells")),
        ("nowhere.txt", ("maze.source 'nowhere.txt'", "No such file")),
        ("nowhere.stl", ("maze.source", "nowhere.stl")),
    ],
)
def test_a_bad_source_is_refused(source: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        make_board(Maze(source=source), 0.002)


@pytest.mark.parametrize(
    ("overrides", "named"),
    [
        (
            ["maze.pitch=0.004"],
            ("maze.pitch 0.004 m", "maze.wall 0.001 m", "0.003 m", "ball", "0.004 m wide"),
        ),
        (["maze.source=holes", "maze.hole_radius=0.001"], ("maze.hole_radius is 0.001 m", "between")),
        (["ball.mass=0.002"], ("ball.mass is 0.002 kg", "1/16", "maze.mass", "0.0005 kg")),
        (["effector=off"], ("maze", "effector")),
        (["gravity=off"], ("ball", "gravity")),
        (["maze.wall=1e-9"], ("maze.wall is 1e-09", "at least 1e-05 m")),
    ],
)
def test_a_maze_that_cannot_be_is_refused_in_one_line(overrides: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named) as caught:
        Simulation(load_scene("maze", ["mesh.level=1", *overrides]))
    assert str(caught.value).isprintable()


def test_the_mass_points_move_as_the_plate_would() -> None:
    maze = Maze()
    board = make_board(maze, 0.002)
    points, mass = mass_points(maze, board)
    a, b = 2 * board.obstacles.extent[2:4]
    assert mass.sum() == pytest.approx(maze.mass)
    np.testing.assert_allclose(mass @ points / mass.sum(), [0, 0, -maze.thickness / 2], rtol=0, atol=1e-15)
    arms = points - [0, 0, -maze.thickness / 2]
    second = np.einsum("i,ia,ib->ab", mass, arms, arms)
    expected = maze.mass / 12 * np.diag([a**2, b**2, maze.thickness**2])
    np.testing.assert_allclose(second, expected, rtol=1e-12, atol=1e-18)


def test_the_plate_weighs_on_the_robot_and_its_disc_stays_where_it_was() -> None:
    bare = Simulation(
        load_scene(SHARP, ["mesh.level=1", "servos.angles=[-1.4965,-1.4965,-1.4965]", "servos.slide=0.035"])
    )
    heavy = Simulation(load_scene("maze", ["mesh.level=1", "ball=off", "maze.mass=0.02"]))
    light = Simulation(load_scene("maze", ["mesh.level=1", "ball=off", "maze.mass=1e-9"]))
    assert bare.effector
    assert light.effector
    assert heavy.effector
    np.testing.assert_allclose(light.effector.position, bare.effector.position, rtol=0, atol=1e-8)
    sag = bare.effector.position[2] - heavy.effector.position[2]
    w = bare.compliance().w
    c = w[:6, :6] - w[:6, 6:] @ np.linalg.solve(w[6:, 6:], w[6:, :6])  # at fixed angles
    assert sag == pytest.approx(0.02 * 9.81 * c[2, 2], rel=0.1)


def test_the_ball_rests_on_the_robot_and_weighs_what_it_weighs() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1", "solver.tolerance=1e-7"]))
    ball, game = simulation.state.ball, simulation.ball_game
    assert ball
    assert game
    begin = game.local(simulation.state, ball)
    for _ in range(100):
        simulation.step()
    np.testing.assert_allclose(game.local(simulation.state, ball), begin, rtol=0, atol=2e-4)
    np.testing.assert_allclose(ball.wrench[0], [0, 0, -1e-4 * 9.81], rtol=0, atol=2e-6)
    # its weight off the centre tilts the plate: away from level towards the ball
    level = Simulation(load_scene("maze", ["mesh.level=1", "ball=off", "solver.tolerance=1e-7"]))
    for _ in range(100):
        level.step()
    lean = simulation.state.rotations[0] @ level.state.rotations[0].T
    corner = begin[:2] / np.linalg.norm(begin[:2])
    down = np.array([lean[0, 2], lean[1, 2]])  # where the normal leans
    assert down @ corner > 1e-4


@pytest.mark.parametrize("overrides", [[], ["inertia=off", "damping=off"]])
def test_tilting_rolls_the_ball_and_reset_brings_it_back(overrides: list[str]) -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1", *overrides]))
    ball = simulation.state.ball
    assert ball
    start = ball.numbers.tobytes()

    def play() -> bytes:
        joints = simulation.command
        for k in range(120):
            joints[:3] = -1.4965 + 0.1 * min(k / 20, 1) * np.array([-1, 0.5, 0.5])
            simulation.step(joints)
        return ball.numbers.tobytes()

    first = play()
    assert ball.place is Place.PLAYING
    assert account(ball).gap > 0
    assert np.linalg.norm(np.frombuffer(first)[:3] - np.frombuffer(start)[:3]) > 0.005
    simulation.reset()
    assert ball.numbers.tobytes() == start
    assert play() == first


def test_the_pose_of_a_ball_that_has_rolled_over_has_a_quaternion_with_positive_w() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1"]))
    ball, start = simulation.state.ball, simulation.command
    assert ball
    for k in range(400):
        tilt = 0.06 * np.sin(0.03 * k)
        simulation.step(start + np.array([tilt, -tilt, -tilt / 2, 0.0]))
        pose = simulation.ball
        assert pose
        assert pose.quaternion[3] >= 0
        assert abs(pose.quaternion @ ball.quaternion) == pytest.approx(1.0, abs=1e-12)
        if ball.quaternion[3] < -0.1:
            return
    pytest.fail("the ball did not roll over")


def test_a_ball_thrown_off_the_board_is_an_event() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1"]))
    ball = simulation.state.ball
    assert ball
    ball.velocity[:] = -0.15, 0.15, 1.0
    for _ in range(60):
        simulation.step()
    assert_names(simulation.ball_event, "ball lost", "the board")
    assert 0 < float(simulation.ball_event.partition(" at ")[2].split()[0]) < 1
    assert np.isfinite(simulation.state.positions).all()
    assert np.abs(ball.wrench).max() == 0


def write_stl(path: Path, triangles: list[list[tuple[float, float, float]]]) -> None:
    data = b"\0" * 80 + struct.pack("<I", len(triangles))
    for t in triangles:
        data += struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0)
    path.write_bytes(data)


def test_an_open_stl_surface_is_a_maze_and_said_to_be_open(tmp_path: Path) -> None:
    a, h = 20.0, 8.0  # [mm]
    corners = [(-a, -a), (a, -a), (a, a), (-a, a)]
    triangles = [[(*corners[0], 0.0), (*corners[1], 0.0), (*corners[2], 0.0)]]
    triangles += [[(*corners[0], 0.0), (*corners[2], 0.0), (*corners[3], 0.0)]]
    for p, q in zip(corners, corners[1:] + corners[:1], strict=True):
        triangles += [[(*q, 0.0), (*p, 0.0), (*p, h)], [(*q, 0.0), (*p, h), (*q, h)]]
    write_stl(tmp_path / "tray.stl", triangles)
    source = [f"maze.source={str(tmp_path / 'tray.stl')!r}", "mesh.level=1", "maze.goal=[0.01, 0.0, 0.003]"]
    simulation = Simulation(load_scene("maze", source))
    (note,) = simulation.notes
    assert_names(note, "maze 'tray.stl'", "not watertight", "sides", "ball")
    ball, game = simulation.state.ball, simulation.ball_game
    assert ball
    assert game
    ball.velocity[:] = 0.3, 0.05, 0
    for _ in range(400):
        simulation.step()
        q = game.local(simulation.state, ball)
        assert (np.abs(q[:2]) < 0.018).all()
        assert q[2] > 0.0019
    assert_names(simulation.ball_event, "goal reached")
    assert 0 < float(simulation.ball_event.partition(" at ")[2].split()[0]) < 1
    assert account(ball).gap > 0
    with raises_naming(SceneError, "maze.start is [0.03, 0.0] m", "'tray.stl'", "covers"):
        Simulation(load_scene("maze", [*source, "maze.start=[0.03, 0.0]"]))
