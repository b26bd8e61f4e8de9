"""The rigid ball on plates that move as a test says: rolling, sliding, bouncing, and never through anything."""

from dataclasses import replace

import numpy as np
import pytest

from tests.checks import random_rotation
from tests.tiers import sampled
from tripod_host.rotations import rotation_matrix, rotation_vector
from tripod_sim.ball.ball import BallOnPlate, BallState, Place, PlateMotion, account
from tripod_sim.ball.obstacle_kernels import MISSES, box_distance, distance, sweep, triangle_distance
from tripod_sim.ball.obstacles import Obstacles, sorted_obstacles
from tripod_sim.maze.board import make_board
from tripod_sim.tables.maze import Ball, Maze

GRAVITY = np.array([0.0, 0.0, -9.81])
NO_TRIANGLES = np.zeros((0, 9))


def field(half: float = 1.0, walls: object = (), holes: object = ()) -> Obstacles:
    """A square floor with its top at z = 0."""
    boxes = [[0, 0, -0.001, half, half, 0.001], *walls]
    return sorted_obstacles(
        np.array(boxes, dtype=float),
        NO_TRIANGLES,
        np.array(holes),
        np.array([-half, -half, half, half, -0.002]),
        0.01,
    )


def resting(position: object, rotation: np.ndarray | None = None, centre: object = (0, 0, 0)) -> BallState:
    """A ball at rest at `position` of the plate's frame."""
    numbers = np.zeros(13)
    numbers[:3] = np.array(centre) + (np.eye(3) if rotation is None else rotation) @ np.array(
        position, dtype=float
    )
    numbers[12] = 1
    return BallState(numbers)


def fixed(rotation: np.ndarray | None = None) -> PlateMotion:
    r = np.eye(3) if rotation is None else rotation
    return PlateMotion(np.zeros((2, 3)), np.array([r, r]), np.zeros((2, 3)))


@pytest.mark.parametrize("dt", [0.01, 0.001])
@pytest.mark.parametrize("angle", [0.05, 0.3, 0.7])
def test_a_ball_rolls_down_an_incline_with_five_sevenths(angle: float, dt: float) -> None:
    """a = 5/7 g sin(angle) while 2/7 tan(angle) <= mu, from rest; the issue asks for 0.5 %, the method gives 1e-9."""
    ball = Ball(rolling=0.0, friction=0.3)
    assert 2 / 7 * np.tan(angle) < ball.friction
    game, rotation = BallOnPlate(ball, field(), GRAVITY), rotation_matrix(np.array([0, angle, 0]))
    state = resting([-0.9, 0, ball.radius + 1e-7], rotation)
    begin = state.position.copy()
    energy = game.energy(state)
    for k in range(round(0.4 / dt)):
        game.advance(state, fixed(rotation), k * dt, dt)
    along = rotation[:, 0]
    expected = 5 / 7 * 9.81 * np.sin(angle)
    assert along @ state.velocity / 0.4 == pytest.approx(expected, rel=1e-9)
    assert along @ (state.position - begin) / 0.08 == pytest.approx(expected, rel=1e-9)
    assert state.spin @ rotation[:, 1] * ball.radius == pytest.approx(along @ state.velocity, rel=1e-9)
    assert abs(game.energy(state) - energy) < 1e-12 * ball.mass * 9.81


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2])
def test_beyond_the_friction_cone_it_slides(friction: float) -> None:
    """a = g (sin - mu cos), spin 5/2 mu g cos / r; the energy lost is that of the slip."""
    angle, dt = 0.8, 0.005
    assert 2 / 7 * np.tan(angle) > friction
    ball = Ball(rolling=0.0, friction=friction)
    game, rotation = BallOnPlate(ball, field(), GRAVITY), rotation_matrix(np.array([0, angle, 0]))
    state = resting([-0.9, 0, ball.radius + 1e-7], rotation)
    energy = game.energy(state)
    for k in range(100):
        game.advance(state, fixed(rotation), k * dt, dt)
    speed, spin = rotation[:, 0] @ state.velocity, state.spin @ rotation[:, 1]
    assert speed / 0.5 == pytest.approx(9.81 * (np.sin(angle) - friction * np.cos(angle)), rel=1e-9)
    assert spin / 0.5 == pytest.approx(
        2.5 * friction * 9.81 * np.cos(angle) / ball.radius, rel=1e-9, abs=1e-12
    )
    slip = (speed - spin * ball.radius) * 0.5 / 2
    loss = friction * ball.mass * 9.81 * np.cos(angle) * slip
    assert energy - game.energy(state) == pytest.approx(loss, rel=1e-9, abs=1e-15)
    assert account(state).loss == pytest.approx(loss, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_bounce_heights_follow_the_restitution_and_end(restitution: float) -> None:
    ball = Ball(restitution=restitution, rolling=0.0)
    game, state = BallOnPlate(ball, field(), GRAVITY), resting([0, 0, 0.05 + ball.radius])
    tops, rising = [], False
    for k in range(6000):
        game.advance(state, fixed(), k * 1e-3, 1e-3)
        if rising and state.velocity[2] <= 0:
            tops.append(state.position[2] - ball.radius)
        rising = state.velocity[2] > 0
    expected = 0.05 * restitution ** (2 * np.arange(1, 4))
    if restitution:
        # a sub-step's chord instead of the parabola: g h² / 8 of height at each impact, and the top between samples
        np.testing.assert_allclose(tops[:3], expected, rtol=0, atol=5e-6)
    assert np.linalg.norm(state.velocity) < 1e-12, "the endless bounce ends"
    assert state.position[2] == pytest.approx(ball.radius, abs=3e-7)


def test_rolling_resistance_slows_by_five_sevenths_of_its_share() -> None:
    """v' = -c g 5/7: the couple c r N and the friction that keeps the ball rolling."""
    ball = Ball(rolling=0.01, friction=0.5)
    game, state = BallOnPlate(ball, field(), GRAVITY), resting([0, 0, ball.radius + 1e-7])
    state.velocity[0], state.spin[1] = 0.2, 0.2 / ball.radius
    for k in range(50):
        game.advance(state, fixed(), k * 0.005, 0.005)
    assert (0.2 - state.velocity[0]) / 0.25 == pytest.approx(0.01 * 9.81 * 5 / 7, rel=1e-6)
    for k in range(1000):
        game.advance(state, fixed(), k * 0.005, 0.005)
    assert np.linalg.norm(state.velocity) < 1e-9


@pytest.mark.parametrize("thickness", [1e-5, 1e-3])
def test_nothing_tunnels_at_any_speed_through_walls_of_any_thickness(thickness: float) -> None:
    """300 balls thrown at up to 50 m/s inside a closed box stay inside, at 10 ms a step."""
    rng, half, high = np.random.default_rng(1), 0.02, 0.1
    walls = [[s * half, 0, high, thickness / 2, half, high] for s in (-1, 1)]
    walls += [[0, s * half, high, half, thickness / 2, high] for s in (-1, 1)]
    walls += [[0, 0, 2 * high, half, half, thickness / 2]]
    ball = Ball(restitution=0.9, friction=0.2)
    game = BallOnPlate(ball, field(1.0, walls), GRAVITY)
    for _ in range(300):
        state = resting([*rng.uniform(-0.017, 0.017, 2), rng.uniform(0.003, 0.15)])
        state.velocity[:] = rng.standard_normal(3) * rng.choice([0.1, 1.0, 10.0, 30.0])
        state.spin[:] = rng.standard_normal(3) * 1000
        energy = game.energy(state)
        for k in range(5):
            game.advance(state, fixed(), k * 0.01, 0.01)
        assert np.abs(state.position[:2]).max() < half - ball.radius
        assert ball.radius < state.position[2] < 2 * high - ball.radius
        a = account(state)
        assert a.gap > 0
        assert game.energy(state) <= energy * (1 + 1e-6) + 1e-9
        assert game.energy(state) - energy == pytest.approx(
            -a.loss + a.gain + a.shift, abs=1e-12 * energy + 1e-18
        )


def tilting(dt: float, seconds: float, seed: int) -> list[PlateMotion]:
    """Random tilts of up to 0.3 rad about both axes, a new one every 0.5 s, reached in 0.1 s; the plate heaves."""
    rng = np.random.default_rng(seed)
    targets = rng.uniform(-0.3, 0.3, (int(seconds / 0.5) + 2, 2))

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        i, s = int(t / 0.5), min((t % 0.5) / 0.1, 1.0)
        s = s * s * (3 - 2 * s)
        x, y = (1 - s) * targets[i] + s * targets[i + 1]
        return np.array([0, 0, 0.001 * np.sin(7 * t)]), rotation_matrix(np.array([x, y, 0]))

    motions, h = [], 1e-6
    for k in range(round(seconds / dt)):
        (c0, r0), (c1, r1), (c2, r2) = at(k * dt), at((k + 1) * dt), at((k + 1) * dt + h)
        twist = np.array([(c2 - c1) / h, rotation_vector(r2 @ r1.T) / h])
        motions.append(PlateMotion(np.array([c0, c1]), np.array([r0, r1]), twist))
    return motions


@pytest.mark.parametrize("dt", sampled([0.01, 0.005, 0.002, 0.001], 0.01, 0.002))
def test_hard_play_keeps_the_ball_between_the_walls_and_the_energy_in_the_books(dt: float) -> None:
    """60 s of tilts of up to 0.3 rad: never through a wall, no contact lost, every joule accounted for."""
    ball, maze = Ball(), Maze(source="labyrinth")
    board = make_board(maze, ball.radius)
    grid = board.grid
    assert grid
    game, state = BallOnPlate(ball, board.obstacles, GRAVITY), resting([*board.start, ball.radius + 1e-7])
    energy, cell, visited, fastest = game.energy(state), grid.start, set(), 0.0
    for k, motion in enumerate(tilting(dt, 60.0, 3)):
        game.advance(state, motion, k * dt, dt)
        q = motion.rotation[1].T @ (state.position - motion.centre[1])
        now = grid.cell_at(q[0], q[1], board.pitch)
        if q[2] < maze.height + 0.5 * ball.radius:
            near = {cell, *grid.neighbours(cell)}
            near |= {c for n in near for c in grid.neighbours(n)}
            assert now in near, f"through a wall at {k * dt} s"
        cell = now
        visited.add(cell)
        fastest = max(fastest, float(np.linalg.norm(state.velocity)))
    a = account(state)
    assert state.place is Place.PLAYING
    assert len(visited) > 5
    assert fastest > 0.2, "hard play: above 0.2 m/s the ball moves one radius per 10 ms"
    assert a.gap > 0
    assert a.stuck == 0
    assert game.energy(state) - energy == pytest.approx(a.work - a.loss + a.gain + a.shift, abs=1e-15)
    assert a.loss > 1e-5
    assert a.gain < 0.002 * a.loss, "contacts create no energy"
    assert abs(a.shift) < 0.01 * a.loss


def test_the_path_converges_as_the_step_falls() -> None:
    """A tilt that changes smoothly: positions at the end differ from those at the finest step ever less."""
    ball = Ball(rolling=0.0)
    ends = []
    for dt in (0.01, 0.005, 0.0025, 0.000625):
        game = BallOnPlate(replace(ball, substep=dt / 4), field(), GRAVITY)
        state = resting([0, 0, ball.radius + 1e-7])
        state.twist[1, 0] = 1.2  # the plate turns from the start
        for k in range(round(0.5 / dt)):
            angles = [
                np.array([0.2 * np.sin(6 * t), 0.15 * (1 - np.cos(5 * t)), 0]) for t in (k * dt, (k + 1) * dt)
            ]
            rotations = np.array([rotation_matrix(a) for a in angles])
            ahead = rotation_matrix(
                np.array(
                    [
                        0.2 * np.sin(6 * ((k + 1) * dt + 1e-6)),
                        0.15 * (1 - np.cos(5 * ((k + 1) * dt + 1e-6))),
                        0,
                    ]
                )
            )
            twist = np.array([np.zeros(3), rotation_vector(ahead @ rotations[1].T) / 1e-6])
            game.advance(state, PlateMotion(np.zeros((2, 3)), rotations, twist), k * dt, dt)
        ends.append(state.position.copy())
    errors = [float(np.linalg.norm(e - ends[-1])) for e in ends[:-1]]
    assert errors[0] > errors[1] > errors[2]
    assert errors[0] / errors[2] > 8, "second order would be 16"
    assert errors[2] < 2e-5


def test_a_ball_at_rest_in_a_corner_of_a_tilted_plate_stays() -> None:
    walls = [[0.1, 0, 0.01, 0.001, 0.1, 0.01], [0, 0.1, 0.01, 0.1, 0.001, 0.01]]
    ball = Ball()
    game = BallOnPlate(ball, field(1.0, walls), GRAVITY)
    rotation = rotation_matrix(np.array([-0.2, 0.2, 0]))
    corner = 0.1 - 0.001 - ball.radius - 1e-7
    state = resting([corner, corner, ball.radius + 1e-7], rotation)
    begin = state.position.copy()
    for k in range(400):
        game.advance(state, fixed(rotation), k * 0.005, 0.005)
    assert np.linalg.norm(state.position - begin) < 1e-6
    assert np.linalg.norm(state.velocity) < 1e-6
    # its whole weight rests on the plate
    np.testing.assert_allclose(
        game.reaction[0] / 0.005, [0, 0, -ball.mass * 9.81], rtol=0, atol=1e-6 * ball.mass * 9.81
    )


def test_the_reaction_is_the_momentum_that_the_ball_received() -> None:
    """In every step of hard play, also where the ball rolls into a wall in the midst of a sub-step."""
    ball = Ball()
    board = make_board(Maze(source="first"), ball.radius)
    game, state = BallOnPlate(ball, board.obstacles, GRAVITY), resting([*board.start, ball.radius + 1e-7])
    hardest = 0.0
    for k, motion in enumerate(tilting(0.005, 5.0, 9)):
        before = ball.mass * (state.velocity + GRAVITY * 0.005)
        game.advance(state, motion, k * 0.005, 0.005)
        np.testing.assert_allclose(game.reaction[0], before - ball.mass * state.velocity, rtol=0, atol=1e-15)
        hardest = max(hardest, float(np.abs(game.reaction[0]).max()))
    assert account(state).impacts > 20
    assert hardest > 1e-5


def test_a_hole_swallows_a_ball_over_it_and_holds_one_on_its_rim() -> None:
    ball = Ball()
    game = BallOnPlate(ball, field(holes=[[0.0, 0.0, 0.0026]]), GRAVITY)
    state = resting([0.0005, 0, ball.radius + 1e-7])
    for k in range(100):
        game.advance(state, fixed(), k * 0.005, 0.005)
    assert state.place is Place.IN_HOLE
    assert 0 < state.lost_time < 0.1
    beside = resting([0.0027, 0, ball.radius + 1e-7])
    for k in range(100):
        game.advance(beside, fixed(), k * 0.005, 0.005)
    assert beside.place is Place.PLAYING
    # a small hole: the ball sits in it, touching the rim all round, its centre at sqrt(r² - R²)
    small = BallOnPlate(ball, field(holes=[[0.0, 0.0, 0.0015]]), GRAVITY)
    sitting = resting([0.001, 0, ball.radius + 1e-6])
    for k in range(1000):
        small.advance(sitting, fixed(), k * 0.005, 0.005)
    assert sitting.place is Place.PLAYING
    assert sitting.position[2] == pytest.approx(np.sqrt(0.002**2 - 0.0015**2), abs=2e-5)
    assert np.linalg.norm(sitting.velocity) < 0.01


def test_a_ball_that_leaves_the_board_is_an_event_and_falls() -> None:
    ball = Ball()
    game = BallOnPlate(ball, field(0.05), GRAVITY)
    state = resting([0.045, 0, ball.radius + 1e-7])
    state.velocity[0] = 0.5
    for k in range(40):
        game.advance(state, fixed(), k * 0.005, 0.005)
    assert state.place is Place.LEFT
    assert 0 < state.lost_time < 0.05
    fallen = state.position[2]
    game.advance(state, fixed(), 0.2, 0.005)
    assert state.position[2] < fallen < 0
    for k in range(1000):
        game.advance(state, fixed(), k * 0.005, 0.005)
    assert np.isfinite(state.numbers).all()
    assert state.position[2] > -1.0


def test_distances_agree_with_a_dense_search() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        corners, q = rng.standard_normal((3, 3)), 2 * rng.standard_normal(3)
        normal, weights = np.zeros(3), np.zeros(3)
        d = triangle_distance(corners.ravel(), q, normal, weights)
        a, b = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
        inside = a + b <= 1
        points = (
            corners[0]
            + a[inside][:, None] * (corners[1] - corners[0])
            + b[inside][:, None] * (corners[2] - corners[0])
        )
        best = np.linalg.norm(points - q, axis=1).min()
        assert d <= best + 1e-12
        assert d > best - 0.08
        np.testing.assert_allclose(weights @ corners + d * normal, q, rtol=0, atol=1e-12)
        assert weights.min() >= -1e-12
        box = np.array([*rng.standard_normal(3), *rng.uniform(0.1, 1, 3)])
        d = box_distance(box, q, normal)
        nearest = np.clip(q, box[:3] - box[3:], box[:3] + box[3:])
        if d > 0:
            assert d == pytest.approx(np.linalg.norm(q - nearest), rel=1e-12)
            np.testing.assert_allclose(nearest + d * normal, q, rtol=0, atol=1e-12)


def test_sweep_stops_where_it_touches_and_never_later() -> None:
    """Against a dense search along the line, for boxes and triangles that are turned at random."""
    rng, scratch, hits = np.random.default_rng(2), np.zeros((3, 3)), 0
    for _ in range(300):
        box = np.array([[*(0.3 * rng.standard_normal(3)), *rng.uniform(0.01, 0.5, 3)]])
        triangle = (0.5 * rng.standard_normal((1, 3, 3)) @ random_rotation(rng)).reshape(1, 9)
        o = sorted_obstacles(box, triangle, np.zeros((0, 3)), np.zeros(5), 1.0)
        q, reach = 2 * rng.standard_normal(3), 0.1
        move = -2 * q + 0.5 * rng.standard_normal(3)
        for k in (0, 1):

            def gap(s: float, k: int = k, q=q, move=move, o=o) -> float:
                normal, weights = np.zeros(3), np.zeros(3)
                return float(distance(k, o, q + s * move, normal, weights) - 0.1)

            if gap(0) < 0:
                continue
            s = sweep(k, o, q, move, reach, scratch)
            along = np.array([gap(t) for t in np.linspace(0, 1, 400)])
            if s == MISSES:
                assert along.min() > -1e-9
            else:
                hits += 1
                assert gap(s) == pytest.approx(0, abs=1e-10)
                assert (along[np.linspace(0, 1, 400) < s] > -1e-9).all()
    assert hits > 50
