"""The maze up to the ball's first bounce: what the study `maze` measures."""

import time

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.ball.ball import account
from tripod_sim.errors import StepError
from tripod_sim.maze.play import MazeBall
from tripod_sim.simulation import Simulation
from tripod_study.motion import scene_of
from tripod_study.plan import Observed, Settings
from tripod_study.task import Measured, repeated

SCENE = "maze"

WORK, SLIDE, TURN, RAMP = -1.4965, 0.035, 0.1, 0.100
"""Angles before [rad], slide [m], the move of servo 0 [rad], which tilts the plate, and the time it takes [s]."""

DURATION = 0.25
"""Within which the ball must bounce [s]."""

INSTANTS = (0.03, 0.06, 0.09, 0.12, 0.15)
"""At which the ball is looked at, all before its first bounce [s]."""


def command(at: float) -> FloatArray:
    """Return the joints at a time [s]."""
    return np.array([WORK + TURN * min(at / RAMP, 1.0), WORK, WORK, SLIDE])


def task(settings: Settings) -> Measured:
    """Tilt the plate until the ball bounces; cost: CPU time of a simulated second."""
    simulation = Simulation(scene_of(SCENE, settings))
    found: list[tuple[Observed, float]] = []

    def run() -> float:
        simulation.reset()
        observed, ended, cpu = to_first_bounce(simulation)
        found[:] = [(observed, ended)]
        return cpu

    cpu = repeated(run)
    return Measured(found[0][0], cpu, found[0][1], simulation.unknowns)


def to_first_bounce(simulation: Simulation) -> tuple[Observed, float, float]:
    """Step until the ball has bounced; return the observations, the time then and the CPU time taken [s].

    The ball rolls towards the wall of its cell, which it touches once it has moved by half of what the cell leaves it.
    When it does is found within the step, on the parabola through the three states before.

    Raises:
        StepError: it does not bounce within DURATION.
    """
    scene, game = simulation.scene, simulation.ball_game
    assert scene.maze
    assert scene.ball
    assert game
    room = 0.5 * (scene.maze.pitch - scene.maze.wall) - scene.ball.radius
    times, local, world, cpu = [0.0], [_local(simulation, game)], [_world(simulation)], 0.0
    for k in range(round(DURATION / scene.dt)):
        begin = time.thread_time()
        simulation.step(command((k + 1) * scene.dt))
        cpu += time.thread_time() - begin
        ball = simulation.state.ball
        assert ball
        if account(ball).hardest > scene.ball.rest_speed:
            break
        times.append(simulation.state.time)
        local.append(_local(simulation, game))
        world.append(_world(simulation))
    else:
        raise StepError(f"the ball did not bounce within {DURATION} s")
    ended, t, path = simulation.state.time, np.array(times), np.array(local)
    bounce = touch(t, np.linalg.norm(path[:, :2] - path[0, :2], axis=1), room)
    observed = {
        "path": [[float(np.interp(at, t, path[:, i])) for i in range(3)] for at in INSTANTS],
        "bounce": [[bounce]],
        "place": [[float(np.polyval(_parabola(t, x), bounce)) for x in np.array(world).T]],
    }
    return observed, ended, cpu


def touch(times: FloatArray, moved: FloatArray, room: float) -> float:
    """Return when what has `moved` [m] at `times` [s] reaches `room` [m], on the parabola through the last three."""
    coefficients = _parabola(times, moved)
    coefficients[-1] -= room
    roots = np.roots(coefficients)
    real = [float(r.real) for r in roots if abs(r.imag) < 1e-12 and r.real >= times[-1] - 1e-12]
    if not real:
        raise StepError("the ball stops before the wall")
    return min(real)


def _parabola(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return the coefficients of the polynomial through the last three values, highest power first."""
    n = min(3, len(times))
    return np.polyfit(times[-n:], values[-n:], n - 1)


def _local(simulation: Simulation, game: MazeBall) -> FloatArray:
    """Return the ball's centre in the plate's frame [m]."""
    assert simulation.state.ball
    return game.local(simulation.state, simulation.state.ball)


def _world(simulation: Simulation) -> FloatArray:
    """Return the ball's centre in world [m], a copy."""
    assert simulation.state.ball
    return simulation.state.ball.position.copy()
