"""Random cases that no study has seen: poses and loads, and motions from random starts (see accuracy_promise.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tripod_bringup.study_plans import plan
from tripod_sim import Simulation
from tripod_sim.maze.play import MazeBall
from tripod_study import watch
from tripod_study.first_bounce import INSTANTS
from tripod_study.watch import tip_nodes

SPREAD = 0.3
"""Of angles about the line from the flat piece to the working pose [rad]."""

WORK = -1.4965
"""Angle of the servos in the working pose [rad]."""

Rows = np.ndarray


@dataclass(frozen=True)
class Case:
    """One random case.

    Attributes:
        overrides: Of the scene.
        seed: Of what the overrides do not say: kicks and commands.
    """

    overrides: tuple[str, ...]
    seed: int


@dataclass(frozen=True)
class Kind:
    """How the cases of a study are made and run.

    Attributes:
        make: From a seed.
        rows: What a case shows, three numbers for each point that is looked at.
        fine: Of the settings that cases are held against; empty: the cheapest that is surely exact enough. What a kind
            of mesh errs must not cancel: it names another element than those that are picked, or far smaller ones.
        coarse: What differs from `fine` on a mesh whose edges are twice as long: cases are held against Richardson's
            limit of both, of order 2. Without, against `fine` itself.
        placed: Whether rows are places of the effector from that in the flat piece, the first at the start: the error
            of the move is that of the rows from the first on, and that of the pose, relative to the largest of them, is
            looked at besides.
    """

    make: Callable[[int], Case]
    rows: Callable[[Simulation, Case], Rows]
    fine: Mapping[str, Any] = field(default_factory=dict)
    coarse: Mapping[str, Any] = field(default_factory=dict)
    placed: bool = False


def static_case(seed: int) -> Case:
    """Angles about the line from the flat piece to the working pose, gravity within 60 degrees of down.

    Far from that line a strip is pressed together and buckles, to the side that the mesh happens to prefer.
    """
    rng = np.random.default_rng(seed)
    share = rng.random()
    angles = WORK * share + rng.uniform(-SPREAD, SPREAD, 3)
    return Case((*_start(angles, 0.035 * share), _tilted(rng)), seed)


def static_rows(simulation: Simulation, case: Case) -> Rows:
    """The effector in the start pose and after servo 0 has moved by up to half of `SPREAD`."""
    rng = np.random.default_rng([case.seed, 1])
    rows = [simulation.state.centres[0].copy()]
    joints = simulation.command
    joints[0] += rng.uniform(-SPREAD, SPREAD) / 2
    simulation.step(joints)
    rows.append(simulation.state.centres[0].copy())
    return np.array(rows)


def dynamic_case(seed: int) -> Case:
    """A start about the working pose, which is found in few increments: steps of the motion turn servos by far less."""
    rng = np.random.default_rng(seed)
    angles = WORK + rng.uniform(-0.25, 0.25, 3)
    return Case((*_start(angles, rng.uniform(0.030, 0.035)), "solver.max_turn=0.3"), seed)


def dynamic_rows(simulation: Simulation, case: Case) -> Rows:
    """Where the effector is, each 10 ms, while one or all servos turn by up to 0.4 rad in 30 to 100 ms."""
    return _driven(
        simulation, *dynamic_turn(case.seed), 0.01 * np.arange(13), lambda: simulation.state.centres[0]
    )


def dynamic_turn(seed: int) -> tuple[np.ndarray, float]:
    """Return how far the servos turn [rad], shape (3,), and in what time [s]."""
    rng = np.random.default_rng([seed, 1])
    turn, ramp = rng.uniform(0.1, 0.4) * rng.choice([-1, 1]), rng.uniform(0.03, 0.1)
    return turn * (np.ones(3) if rng.random() < 0.3 else np.eye(3)[rng.integers(3)]), ramp


def kicked_case(seed: int) -> Case:
    """Springs under a random gravity."""
    g = np.random.default_rng(seed).uniform(0.5, 1.5) * 9.81
    return Case((f"gravity.acceleration=[0, 0, {-g!r}]",), seed)


def kicked_rows(simulation: Simulation, case: Case) -> Rows:
    """The positions of all nodes each 0.1 s for 1 s, after a kick that turns and throws the body."""
    rng = np.random.default_rng([case.seed, 1])
    x, free = simulation.positions, simulation._mass > 0
    spin, throw = rng.normal(0, 0.5, 3), rng.normal(0, 0.3, 3)
    simulation.state.velocities[free] = (np.cross(spin, x) + throw)[free]
    every = round(0.1 / simulation.scene.dt)
    rows = [x.ravel().copy()]
    for _ in range(10):
        simulation.advance(every)
        rows.append(simulation.positions.ravel().copy())
    return np.array(rows)


def hung_case(seed: int) -> Case:
    """The silicone piece under a gravity within 60 degrees of down."""
    return Case((_tilted(np.random.default_rng(seed)),), seed)


def hung_rows(simulation: Simulation, case: Case) -> Rows:
    """The ends of the two free strips, let go from flat."""
    given = plan("silicone", quick=False).given
    tips = tip_nodes(simulation.mesh.nodes)
    every = round(float(given[watch.INTERVAL]) / simulation.scene.dt)
    rows = []
    for _ in range(int(given[watch.SAMPLES])):
        simulation.advance(every)
        rows.append(np.concatenate([simulation.positions[t].mean(axis=0) for t in tips]))
    return np.array(rows)


def maze_case(seed: int) -> Case:
    """The maze as it is; what differs is how it tilts."""
    return Case((), seed)


def maze_rows(simulation: Simulation, case: Case) -> Rows:
    """The ball in the plate's frame before its first bounce, while one servo turns by up to 0.1 rad in 50 to 100 ms."""
    rng = np.random.default_rng([case.seed, 1])
    turn, ramp = rng.uniform(0.04, 0.1) * rng.choice([-1, 1]), rng.uniform(0.05, 0.1)
    game, ball = simulation.ball_game, simulation.state.ball
    assert isinstance(game, MazeBall)
    assert ball
    return _driven(
        simulation, turn * np.eye(3)[rng.integers(3)], ramp, np.array(INSTANTS),
        lambda: game.local(simulation.state, ball),
    )  # fmt: skip


def _driven(
    simulation: Simulation, turn: np.ndarray, ramp: float, times: np.ndarray, look: Callable[[], np.ndarray]
) -> Rows:
    """Return what `look` shows at `times` [s], while the servos turn by `turn` [rad] in `ramp` [s] and then hold."""
    start, dt = simulation.command, simulation.scene.dt
    rows, k = [], 0
    for instant in np.round(times / dt).astype(int):
        while k < instant:
            k += 1
            simulation.step(turned(start, turn, ramp, k * dt))
        rows.append(np.array(look()))
    return np.array(rows)


def turned(start: np.ndarray, turn: np.ndarray, ramp: float, time: float) -> np.ndarray:
    """Return the joints at `time` [s] where the servos turn by `turn` [rad] from `start` in `ramp` [s]."""
    joints = start.copy()
    joints[:3] = np.clip(start[:3] + turn * min(time / ramp, 1.0), -2.1, 0.6)
    return joints


def _start(angles: np.ndarray, slide: float) -> tuple[str, ...]:
    return (f"servos.angles={angles.tolist()}", f"servos.slide={slide!r}")


def _tilted(rng: np.random.Generator) -> str:
    """Return a gravity of 0.5 to 1.5 g within 60 degrees of down."""
    tilt, turn = np.radians(rng.uniform(0, 60)), rng.uniform(0, 2 * np.pi)
    down = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    return f"gravity.acceleration={(rng.uniform(0.5, 1.5) * 9.81 * down).tolist()}"


KINDS = {
    "pendulum": Kind(kicked_case, kicked_rows),
    "cloth": Kind(kicked_case, kicked_rows),
    "drape": Kind(kicked_case, kicked_rows, {"contact.response": "lagrange", "dt": 0.001}),
    "silicone": Kind(hung_case, hung_rows, {"mesh.element": "h27", "mesh.level": 9}),
    "tripod_static": Kind(static_case, static_rows),
    "tripod_dynamic": Kind(
        dynamic_case,
        dynamic_rows,
        {"mesh.level": 9, "dt": 5e-4, "solver.mode": "one_solve"},
        {"mesh.level": 8},
        placed=True,
    ),
    "maze": Kind(maze_case, maze_rows, {"mesh.element": "h27", "mesh.level": 9}),
}
"""By study."""
