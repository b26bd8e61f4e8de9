"""A maze solved on the simulator, without ROS: the same bits for the same seed."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError
from tripod_play.player import Player, PlayerSettings
from tripod_play.tilt import lever_of, tilt_map
from tripod_sim import Simulation, StepError
from tripod_sim.ball.ball import Place
from tripod_sim.maze.play import MazeBall


@dataclass(frozen=True)
class Eye:
    """How the ball is seen.

    Attributes:
        period: Between two pictures [s].
        delay: From the picture to its position [s].
        noise: Standard deviation of each coordinate [m].
        dropout: Share of pictures without a ball.
    """

    period: float = 0.02
    delay: float = 0.05
    noise: float = 3e-4
    dropout: float = 0.0

    def __post_init__(self) -> None:
        ranges = {"period": (1e-3, 1.0), "delay": (0.0, 1.0), "noise": (0.0, 0.1), "dropout": (0.0, 0.99)}
        for name, (low, high) in ranges.items():
            if not low <= getattr(self, name) <= high:
                raise PlayError(f"eye {name} is {getattr(self, name)}; allowed: {low:g} to {high:g}")


@dataclass(frozen=True)
class Solution:
    """How a game went.

    Attributes:
        solved: Whether the ball reached the goal.
        time: Until the goal, the loss of the ball or the end [s].
        why: In words.
        track: x, y of the ball in the plate's frame in each period [m], shape (n, 2).
    """

    solved: bool
    time: float
    why: str
    track: FloatArray


def solve(
    simulation: Simulation,
    seed: int,
    *,
    eye: Eye | None = None,
    settings: PlayerSettings | None = None,
    limit: float = 120.0,
    watch: Callable[[Simulation], None] | None = None,
) -> Solution:
    """Play the maze of a simulation, from its start state, to the goal.

    Args:
        simulation: With maze and ball; it is reset first.
        seed: Of noise and dropouts.
        eye: How the ball is seen.
        settings: How it is played; the period is the eye's.
        limit: Simulated time after which the game is given up [s].
        watch: Called after each step.

    Raises:
        PlayError: no maze of cells, no ball, the period is no multiple of dt, or `limit` is negative or infinite.
        StepError: a step could not be saved, or an explicit scheme is unstable.
    """
    eye, base, scene = eye or Eye(), settings or PlayerSettings(), simulation.scene
    servos = simulation.joints
    game = simulation.ball_game
    if (
        not isinstance(game, MazeBall)
        or game.plate.board.grid is None
        or not (servos and scene.maze and scene.ball)
    ):
        raise PlayError(
            f"scene {scene.name!r} has no maze of cells with a ball, on a robot with servos; take one "
            "such as maze"
        )
    dt, every, late = scene.dt, round(eye.period / scene.dt), int(np.ceil(eye.delay / eye.period - 1e-9))
    if abs(every * dt - eye.period) > 1e-9 or not every:
        raise PlayError(f"the period {eye.period} s is not a multiple of the dt of the scene, {dt} s")
    if not 0 <= limit < np.inf:
        raise PlayError(f"limit is {limit:g} s; it must be finite and not negative")
    simulation.reset()
    observer = replace(base.observer, period=eye.period, delay=late * eye.period)
    clearance = 0.5 * (scene.maze.pitch - scene.maze.wall) - scene.ball.radius
    w = simulation.compliance().w
    base = replace(base, observer=observer, clearance=clearance, lever=lever_of(w) + scene.maze.offset)
    player = Player(game.plate.board.grid, scene.maze.pitch, base)
    tilts = tilt_map(w, simulation.state.joints[:-1], servos.low, servos.high)
    rng = np.random.default_rng(seed)
    ball = simulation.state.ball
    assert ball
    where = game.local(simulation.state, ball)[:2]
    pictures: deque[FloatArray | None] = deque([where + eye.noise * rng.standard_normal(2)] * (late + 1))
    joints, share, track = simulation.command, np.zeros(len(simulation.efforts)), []
    for k in range(round(limit / dt)):
        if k % every == 0:
            where = game.local(simulation.state, ball)[:2]
            track.append(where)
            seen = where + eye.noise * rng.standard_normal(2)
            pictures.append(None if rng.random() < eye.dropout else seen)
            share = (tilts(player.update(pictures[-1 - late])) - joints[:-1]) / every
            pictures.popleft()
        joints[:-1] += share
        if unstable := simulation.step(joints).instability:
            raise StepError(unstable)
        if watch:
            watch(simulation)
        if np.isfinite(ball.goal_time):
            return Solution(True, ball.goal_time, "goal reached", np.array(track))
        if ball.place is not Place.PLAYING:
            return Solution(False, ball.lost_time, simulation.ball_event, np.array(track))
    return Solution(False, limit, f"goal not reached within {limit:g} s", np.array(track).reshape(-1, 2))
